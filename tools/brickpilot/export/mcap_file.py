"""A run or a link's traffic in the format MCAP: the messages are JSON, and each channel has its JSON schema.

The topics of a run are its logged signals, and its poses in Foxglove's form. Signals are in the run's frame, with
y to the right and yaw clockwise. Foxglove's 3D panel has z up. So in poses and transforms, y is to the left and yaw is
counter-clockwise. A layout for Foxglove, with panels for the topics, is written beside the file.
"""

from __future__ import annotations

import binascii
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import numpy as np

from brickpilot import __version__
from brickpilot.errors import InputError
from brickpilot.export.run_read import TIME, Array, Run, unit
from brickpilot.hil import traffic_log
from brickpilot.link.messages import book


@dataclass(frozen=True)
class Topic:
    """One channel of an MCAP file.

    Attributes:
        schema: JSON schema of a message; its title is the schema's name.
        units: field -> unit, kept in the channel's metadata.
    """

    name: str
    schema: Mapping[str, Any]
    units: Mapping[str, str]


@dataclass(frozen=True)
class Sample:
    """One message: its topic, its time in ns, and its content."""

    topic: str
    time_ns: int
    message: Mapping[str, Any]


def signals(name: str, fields: Mapping[str, str]) -> Topic:
    """Returns a topic of plain numbers; `fields`: field -> unit. In a message, an unknown number is null."""
    kinds = {field: {"type": ["number", "null"], "description": unit} for field, unit in fields.items()}
    return Topic(name, _schema(f"brickpilot{name.replace('/', '.')}", kinds), fields)


def write(topics: Iterable[Topic], samples: Iterable[Sample], attachments: Mapping[str, bytes]) -> bytes:
    """Returns the MCAP file.

    Args:
        samples: the messages in the order of their times.
        attachments: name -> JSON text.

    Raises:
        InputError: the library mcap is not installed.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError as error:
        raise InputError(f"needs the library {error.name}: pip install 'brickpilot[export]'", field="mcap") from error
    buffer = io.BytesIO()
    writer = Writer(buffer)
    writer.start("", f"brickpilot {__version__}")
    channels = {}
    for topic in topics:
        text = json.dumps(topic.schema).encode()
        schema = writer.register_schema(str(topic.schema["title"]), "jsonschema", text)
        units = {"units": json.dumps(dict(topic.units))} if topic.units else {}
        channels[topic.name] = writer.register_channel(topic.name, "json", schema, units)
    dump = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode
    for sample in samples:
        writer.add_message(channels[sample.topic], sample.time_ns, dump(sample.message).encode(), sample.time_ns)
    for name, content in attachments.items():
        writer.add_attachment(0, 0, name, "application/json", content)
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()


POSES = {"/pose": "true", "/pose_estimate": "estimate"}
"""Topic of poses -> prefix of the names of the log's columns that hold these poses."""

_POSE_EVERY = 10  # rows of the log from one pose to the next; this gives 33 poses a second
_FRAME = "map"
_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_TURN = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_POSE = {"type": "object", "properties": {"position": _VECTOR, "orientation": _TURN}}


def _schema(title: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": dict(fields), "required": list(fields)}


_IN_FRAME = {"timestamp": _TIME, "frame_id": {"type": "string"}}
_POSE_SCHEMA = _schema("foxglove.PoseInFrame", _IN_FRAME | {"pose": _POSE})
_PATH_SCHEMA = _schema("foxglove.PosesInFrame", _IN_FRAME | {"poses": {"type": "array", "items": _POSE}})
_FRAMES = {"parent_frame_id": {"type": "string"}, "child_frame_id": {"type": "string"}}
_MOVED = {"timestamp": _TIME, **_FRAMES, "translation": _VECTOR, "rotation": _TURN}
_TRANSFORM_SCHEMA = _schema("foxglove.FrameTransform", _MOVED)


def groups(run: Run) -> dict[str, dict[str, Array]]:
    """Returns topic -> field -> values of every column of the run except the time."""
    topics: dict[str, dict[str, Array]] = {}
    for column, values in run.log.items():
        if column != TIME:
            topic, field = _place(column)
            topics.setdefault(topic, {})[field] = values
    ticks = {name: values for name, values in run.ticks.items() if name != TIME}
    return topics | ({"/ticks": ticks} if ticks else {})


def _place(column: str) -> tuple[str, str]:
    """Returns topic and field of a column of the log."""
    head, _, rest = column.partition("_")
    if head in ("true", "measured", "estimate"):
        return {"true": "/truth", "measured": "/sensors", "estimate": "/estimate"}[head], rest
    electrical = head in ("left", "right", "battery", "charge") and column.endswith(("_rad_s", "_a", "_v", "_c"))
    return ("/motors" if electrical else "/control"), column


def run_topics(run: Run) -> list[Topic]:
    """Returns the topics of a run."""
    topics = [signals(name, {field: unit(field) for field in fields}) for name, fields in groups(run).items()]
    for name, head in POSES.items():
        if f"{head}_heading_rad" in run.log:
            topics += [Topic(name, _POSE_SCHEMA, {}), Topic(f"{name}_path", _PATH_SCHEMA, {})]
    return [*topics, Topic("/tf", _TRANSFORM_SCHEMA, {})]


def run_samples(run: Run) -> list[Sample]:
    """Returns every message of a run, in the order of time.

    A whole track is one message at the start, so that the 3D panel always shows it.
    """
    samples = []
    tracks = _tracks(run)
    for name, track in tracks.items():
        start = track[0][0] if track else 0.0
        poses = [pose for _, pose in track]
        samples.append(Sample(f"{name}_path", _ns(start), _in_frame(start) | {"poses": poses}))
    for topic, fields in groups(run).items():
        times = (run.ticks if topic == "/ticks" else run.log)[TIME]
        samples += _rows(topic, times, fields)
    for name, track in tracks.items():
        for time, pose in track:
            samples.append(Sample(name, _ns(time), _in_frame(time) | {"pose": pose}))
            if name == "/pose":
                frames = {"parent_frame_id": _FRAME, "child_frame_id": "robot"}
                moved = {"translation": pose["position"], "rotation": pose["orientation"]}
                samples.append(Sample("/tf", _ns(time), {"timestamp": _stamp(time), **frames, **moved}))
    return sorted(samples, key=lambda sample: sample.time_ns)


def _ns(time: float) -> int:
    return round(time * 1e9)


def _stamp(time: float) -> dict[str, int]:
    return dict(zip(("sec", "nsec"), divmod(_ns(time), 10**9), strict=True))


def _in_frame(time: float) -> dict[str, Any]:
    return {"timestamp": _stamp(time), "frame_id": _FRAME}


def _rows(topic: str, times: Array, fields: Mapping[str, Array]) -> Iterator[Sample]:
    """Yields a message for each row of a topic. A value that is not finite is null, because JSON has no NaN."""
    rows = np.column_stack(list(fields.values())).tolist()
    for time, row in zip(times.tolist(), rows, strict=True):
        pairs = zip(fields, row, strict=True)
        yield Sample(topic, _ns(time), {name: value if math.isfinite(value) else None for name, value in pairs})


def _tracks(run: Run) -> dict[str, list[tuple[float, dict[str, Any]]]]:
    """Returns, for each topic of poses, (time, pose) of every tenth row that is finite."""
    tracks = {}
    for name, head in POSES.items():
        if f"{head}_heading_rad" in run.log:
            columns = [run.log[key] for key in (TIME, f"{head}_x_m", f"{head}_y_m", f"{head}_heading_rad")]
            rows = np.column_stack(columns)[::_POSE_EVERY]
            known = rows[np.isfinite(rows).all(axis=1)].tolist()
            tracks[name] = [(time, _pose(x, y, heading)) for time, x, y, heading in known]
    return tracks


def _pose(x: float, y: float, heading: float) -> dict[str, Any]:
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(-heading / 2), "w": math.cos(heading / 2)}
    return {"position": {"x": x, "y": -y, "z": 0.0}, "orientation": turn}


UNKNOWN = "/link/unknown"
"""The topic of damaged frames, and of frames that the DBC does not describe."""

_UNKNOWN_FIELDS = {
    "id": {"type": "integer"},
    "data": {"type": "string", "description": "hexadecimal"},
    "received": {"type": "integer", "description": "1: from the brick, 0: to it"},
}
_UNKNOWN_SCHEMA = {"title": "brickpilot.link.unknown", "type": "object", "properties": _UNKNOWN_FIELDS}


def read_traffic(file: Path) -> tuple[list[Topic], list[Sample]]:
    """Returns the topics and the messages of a recording. Times count from the first message, in ns.

    If the clock was set back, messages get the latest time so far until the clock passes this time.

    Raises:
        InputError: the file cannot be read, is no log of CAN traffic, or holds no message.
    """
    messages = traffic_log.read(file)
    if not messages:
        raise InputError("holds no message", file=file)
    latest, samples = 0, []
    for message in messages:
        latest = max(latest, _ns(message.timestamp - messages[0].timestamp))
        topic, values = _decoded(message)
        samples.append(Sample(topic, latest, values | {"received": int(message.is_rx)}))
    named = {sample.topic for sample in samples}
    topics = [Topic(UNKNOWN, _UNKNOWN_SCHEMA, {})] if UNKNOWN in named else []
    for layout in book().database.messages:
        if f"/link/{layout.name}" in named:
            units = {signal.name: signal.unit or "1" for signal in layout.signals}
            topics.append(signals(f"/link/{layout.name}", units | {"received": "1"}))
    return topics, samples


def _decoded(message: can.Message) -> tuple[str, dict[str, Any]]:
    layout = book().by_id.get(message.arbitration_id)
    if layout is None or len(message.data) != 8:
        return UNKNOWN, {"id": message.arbitration_id, "data": binascii.hexlify(message.data).decode()}
    values: Any = book().database.decode_message(message.arbitration_id, bytes(message.data), decode_choices=False)
    return f"/link/{layout.name}", dict(values)


_PLOTS = {
    "Speed": ("/truth.speed_m_s", "/estimate.speed_m_s", "/control.demand_speed_m_s"),
    "Heading": ("/truth.heading_rad", "/estimate.heading_rad", "/control.demand_heading_rad"),
    "Motors": (
        "/motors.left_voltage_v",
        "/motors.right_voltage_v",
        "/motors.left_current_a",
        "/motors.right_current_a",
    ),
    "Sensors": ("/sensors.yaw_rate_rad_s", "/sensors.accel_surge_m_s2", "/sensors.accel_sway_m_s2"),
    "Cross track": ("/control.cross_track_m", "/control.heading_error_rad"),
    "Link": ("/ticks.round_trip_ms", "/ticks.late_ticks", "/ticks.lost_frames"),
}
_STATES = ("/control.mode", "/control.phase", "/control.waypoint", "/control.fault")


def run_layout(topics: Sequence[Topic]) -> str:
    """Returns the layout of a run, with plots of the signals that the run has."""
    have = {f"{topic.name}.{field}" for topic in topics for field in topic.units}
    panels = {"3D!run": _scene([topic.name for topic in topics if topic.name.startswith("/pose")])}
    for title, paths in _PLOTS.items():
        if shown := [path for path in paths if path in have]:
            panels[f"Plot!{title.lower().replace(' ', '-')}"] = _plot(title, shown)
    if states := [path for path in _STATES if path in have]:
        panels["StateTransitions!mode"] = {"paths": [_path(path) for path in states], "isSynced": True}
    return _layout(panels)


def traffic_layout(topics: Sequence[Topic]) -> str:
    """Returns the layout of a link's traffic: one plot for each kind of message, with its fields."""
    panels = {
        f"Plot!{topic.name.rpartition('/')[2].lower()}": _plot(
            topic.name, [f"{topic.name}.{field}" for field in topic.units]
        )
        for topic in topics
        if topic.units
    }
    return _layout(panels)


def _path(value: str) -> dict[str, Any]:
    return {"value": value, "enabled": True, "timestampMethod": "receiveTime"}


def _plot(title: str, paths: Sequence[str]) -> dict[str, Any]:
    return {
        "title": title,
        "paths": [_path(path) for path in paths],
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _scene(topics: Sequence[str]) -> dict[str, Any]:
    colours = ("#2a9d8fff", "#e76f51ff")
    shown = {
        topic: {
            "visible": True,
            "color": colours["estimate" in topic],
            "lineWidth": 0.01,
            "type": "line" if "path" in topic else "arrow",
        }
        for topic in topics
    }
    grid = {"layerId": "foxglove.Grid", "visible": True, "frameLocked": True, "size": 6, "divisions": 12}
    camera = {"distance": 5, "perspective": False, "phi": 0, "thetaOffset": 90, "target": [0, 0, 0]}
    return {"fixedFrame": _FRAME, "topics": shown, "layers": {"grid": grid}, "cameraState": camera}


def _layout(panels: Mapping[str, Any]) -> str:
    layout = {
        "configById": dict(panels),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(list(panels), "row"),
    }
    return json.dumps(layout, indent=2) + "\n"


def _split(names: Sequence[str], direction: str) -> Any:
    """Returns the panels as nested pairs: one level stands side by side, the next one above the other, and so on."""
    if len(names) <= 1:
        return names[0] if names else ""
    half = max(1, len(names) // 2) if direction == "column" else 1 if names[0].startswith("3D") else len(names) // 2
    parts = (_split(names[:half], "column"), _split(names[half:], "column" if direction == "row" else "row"))
    return {"first": parts[0], "second": parts[1], "direction": direction, "splitPercentage": 50}
