"""Writes logs in the formats of other programs, by the library of each format; ULog and dataflash by parts of theirs.

A ULog file is written by `ULog.write_ulog`, a dataflash log by the buffers of `DFReader_binary`.

A log is topic -> field -> values; each value of a topic has a time, s.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

STAMP = 1_700_000_000_000_000_000
"""Time of a ROS log, ns since 1970."""

HEADER = """std_msgs/Header header
"""
DEFINITIONS = f"""
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{"=" * 80}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{"=" * 80}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{"=" * 80}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{"=" * 80}
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
{"=" * 80}
MSG: geometry_msgs/Twist
Vector3 linear
Vector3 angular
{"=" * 80}
MSG: geometry_msgs/PoseWithCovariance
Pose pose
float64[36] covariance
{"=" * 80}
MSG: geometry_msgs/TwistWithCovariance
Twist twist
float64[36] covariance
"""
MESSAGES = {
    "std_msgs/msg/Float64": "float64 data\n",
    "std_msgs/msg/Int32": "int32 data\n",
    "std_msgs/msg/String": "string data\n",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular\n" + DEFINITIONS,
    "geometry_msgs/msg/TwistStamped": HEADER + "Twist twist\n" + DEFINITIONS,
    "sensor_msgs/msg/JointState": HEADER
    + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    + DEFINITIONS,
    "sensor_msgs/msg/Imu": HEADER
    + "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    + "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    + "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    + DEFINITIONS,
    "nav_msgs/msg/Odometry": HEADER
    + "string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
    + DEFINITIONS,
}


def header(stamp_ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": "base"}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def twist(forward: float, turn: float) -> dict[str, Any]:
    return {"linear": vector(forward), "angular": vector(z=turn)}


def joints(stamp_ns: int, position: Mapping[str, float], velocity: Mapping[str, float]) -> dict[str, Any]:
    return {
        "header": header(stamp_ns),
        "name": list(position),
        "position": list(position.values()),
        "velocity": list(velocity.values()),
        "effort": [],
    }


def imu(stamp_ns: int, yaw_rate: float, accel: float) -> dict[str, Any]:
    return {
        "header": header(stamp_ns),
        "orientation": {**vector(), "w": 1.0},
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": vector(z=yaw_rate),
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": vector(accel, 0.0, 9.81),
        "linear_acceleration_covariance": [0.0] * 9,
    }


def odometry(stamp_ns: int, yaw: float, speed: float) -> dict[str, Any]:
    turned = {"x": 0.0, "y": 0.0, "z": float(np.sin(yaw / 2)), "w": float(np.cos(yaw / 2))}
    return {
        "header": header(stamp_ns),
        "child_frame_id": "base",
        "pose": {"pose": {"position": vector(), "orientation": turned}, "covariance": [0.0] * 36},
        "twist": {"twist": twist(speed, 0.0), "covariance": [0.0] * 36},
    }


Messages = Sequence[tuple[int, str, str, dict[str, Any]]]
"""Log time in ns, topic, type, and the message."""


def write_mcap(path: Path, messages: Messages) -> Path:
    """Writes an MCAP file of ROS 2 by mcap-ros2-support."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        schemas = {}
        for log_ns, topic, kind, message in messages:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, MESSAGES[kind])
            writer.write_message(topic, schemas[kind], message, log_time=log_ns)
        writer.finish()
    return path


def write_rosbag(path: Path, messages: Messages, storage: str = "SQLITE3") -> Path:
    """Writes a bag of ROS 2 by rosbags: a folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        connections: dict[str, Any] = {}
        for log_ns, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_cdr(_typed(store, kind, message), kind))
    return path


def write_rosbag1(path: Path, messages: Messages) -> Path:
    """Writes a bag of ROS 1 by rosbags: a file."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for log_ns, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_ros1(_typed(store, kind, message), kind))
    return path


def _typed(store: Any, kind: str, message: Mapping[str, Any]) -> Any:
    """Returns a message as an object of rosbags; a header of ROS 1 gets the number 0 of a message."""
    values = []
    if kind.endswith("Header") and any(name == "seq" for name, _ in store.fielddefs[kind][1]):
        message = {"seq": 0, **message}
    for name, (node, inner) in store.fielddefs[kind][1]:
        value = message[name]
        if node.name == "NAME":
            value = _typed(store, inner, value)
        elif isinstance(value, list) and inner[0][1][0] != "string":
            value = np.array(value, dtype=inner[0][1][0])
        values.append(value)
    return store.types[kind](*values)


def write_wpilog(path: Path, entries: Mapping[str, tuple[str, Vector, Any]], metadata: str = "") -> Path:
    """Writes a WPILOG file by robotpy-wpiutil. `entries`: name -> type, times in s, values."""
    from wpiutil import DataLogWriter
    from wpiutil import log as kinds

    classes = {
        "double": kinds.DoubleLogEntry, "float": kinds.FloatLogEntry, "int64": kinds.IntegerLogEntry,
        "boolean": kinds.BooleanLogEntry, "double[]": kinds.DoubleArrayLogEntry, "string": kinds.StringLogEntry,
    }  # fmt: skip
    writer = DataLogWriter(str(path))
    records = []
    for name, (kind, time, values) in entries.items():
        entry = classes[kind](writer, name, metadata)
        convert = {"int64": int, "boolean": bool, "string": str, "double[]": list}.get(kind, float)
        records += [(round(t * 1e6), entry, convert(value)) for t, value in zip(time, values, strict=True)]
    for microseconds, entry, value in sorted(records, key=lambda record: record[0]):
        entry.append(value, max(microseconds, 1))
    writer.flush()
    writer.stop()
    return path


def write_ulog(path: Path, topics: Mapping[tuple[str, int], Mapping[str, Any]]) -> Path:
    """Writes a ULog file by pyulog. `topics`: (name, instance) -> field -> values; one field is `timestamp`, µs."""
    from pyulog import ULog

    log = ULog(None)
    for number, ((name, instance), fields) in enumerate(topics.items()):
        kinds = {field: _ulog_type(np.asarray(values)) for field, values in fields.items()}
        definition = f"{name}:" + "".join(f"{kinds[field]} {field};" for field in fields)
        header = ULog._MessageHeader()
        log.message_formats[name] = ULog.MessageFormat(definition.encode(), header)
        added = ULog._MessageAddLogged(
            struct.pack("<BH", instance, number) + name.encode(), header, log.message_formats
        )
        rows = np.rec.fromarrays([np.asarray(values) for values in fields.values()], dtype=added.dtype)
        added.buffer = bytearray(rows.tobytes())
        log.data_list.append(ULog.Data(added))
    log.write_ulog(str(path))
    return path


def _ulog_type(values: NDArray[Any]) -> str:
    return {"u8": "uint64_t", "f4": "float", "f8": "double"}[values.dtype.str[1:]]


def write_dataflash(
    path: Path, formats: Sequence[tuple[str, str, str, str]], rows: Sequence[tuple[str, tuple[Any, ...]]]
) -> Path:
    """Writes a dataflash log by the message buffers of pymavlink.

    Args:
        path: the file.
        formats: name, format characters, columns, and the characters of the columns' units, "-" for none.
        rows: name and values of each message, in the order of time.
    """
    from pymavlink.DFReader import DFFormat, DFReader_binary

    own = [
        DFFormat(0x81, "UNIT", 0, "QbZ", "TimeUS,Id,Label"),
        DFFormat(0x82, "FMTU", 0, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        *(DFFormat(0x90 + number, name, 0, kind, columns) for number, (name, kind, columns, _) in enumerate(formats)),
    ]
    known = {form.name: form for form in own}
    maker = DFReader_binary.__new__(DFReader_binary)
    maker.formats = {0x80: DFFormat(0x80, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")}
    parts = [maker.make_format_msgbuf(form) for form in own]
    for sign, unit in {"s": b"s", "V": b"V", "E": b"rad/s", "k": b"deg/s", "#": b"instance"}.items():
        parts.append(maker.make_msgbuf(known["UNIT"], (0, ord(sign), unit)))
    for name, _, _, units in formats:
        numbers = (0, known[name].type, units.encode(), b"-" * len(units))
        parts.append(maker.make_msgbuf(known["FMTU"], numbers))
    parts += [maker.make_msgbuf(known[name], values) for name, values in rows]
    path.write_bytes(b"".join(parts))
    return path


def write_parquet(path: Path, columns: Mapping[str, Any]) -> Path:
    """Writes a Parquet file by pyarrow."""
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(dict(columns)), path)
    return path


TURN = 0.5  # unitsPerRotation of the logs below


def old_row(time: float, autospeed: float, left: float, right: float, gyro: float) -> list[float]:
    """Returns a row of frc-characterization: battery at 12 V, absolute voltages, `left` and `right` in rotations."""
    volts = abs(12.0 * autospeed)
    return [time, 12.0, autospeed, volts, volts, left, right, math.copysign(1.0, left), math.copysign(1.0, right), gyro]


def old_log(**changes: Any) -> dict[str, Any]:
    """Returns a log: straight ahead, then a left turn on the spot (left wheel back, right forward, gyro rises)."""
    straight = [old_row(10 + 0.005 * k, 0.5, 0.01 * k + 1, 0.01 * k + 1, 0.0) for k in range(20)]
    spot = [old_row(20 + 0.005 * k, 0.25, -0.01 * k - 1, 0.01 * k + 1, 0.02 * k) for k in range(20)]
    log = {
        "slow-forward": straight,
        "track-width": spot,
        "test": "Drivetrain",
        "units": "Meters",
        "unitsPerRotation": TURN,
    }
    return {**log, **changes}


def new_log(**changes: Any) -> dict[str, Any]:
    """Returns a SysId log of a left turn: rows of time, V left and right, positions, velocities, angle, rate."""
    rows = [[k * 0.02, -3.0, 3.0, -0.1 * k, 0.1 * k, -5.0, 5.0, 0.3 * k, 15.0] for k in range(10)]
    log = {
        "sysid": True,
        "test": "Drivetrain (Angular)",
        "units": "Feet",
        "unitsPerRotation": TURN,
        "fast-forward": rows,
    }
    return {**log, **changes}


def write_json(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path
