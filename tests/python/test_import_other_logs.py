"""Logs of other programs become data sets; a bad log leaves none. Here the library of each format writes the logs."""

from __future__ import annotations

import builtins
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import other_logs as logs
import pytest
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers import IMPORTERS, kind_of
from brickpilot.importers.channels import contents
from command import brickpilot
from importing import import_kind
from other_logs import STAMP, new_log, write_json
from scipy.io import savemat

TIME = 1.0 + np.arange(60) * 0.02
VOLTS = np.where(TIME < 1.5, 6.0, -3.0)
SPEED = np.round(np.cumsum(VOLTS) * 0.25, 6)


def ros_messages() -> list[tuple[int, str, str, dict[str, Any]]]:
    """Returns messages of a robot: commands without a header, and measurements, recorded 3 ms after their stamps."""
    made: list[tuple[int, str, str, dict[str, Any]]] = []
    for k, (volts, speed) in enumerate(zip(VOLTS, SPEED, strict=True)):
        stamp = STAMP + k * 20_000_000
        late = stamp + 3_000_000
        turned = {"left": speed, "right": -speed}
        made += [
            (stamp, "/volts/left", "std_msgs/msg/Float64", {"data": volts}),
            (stamp, "/ticks", "std_msgs/msg/Int32", {"data": k}),
            (stamp, "/note", "std_msgs/msg/String", {"data": "on"}),
            (stamp, "/cmd_vel", "geometry_msgs/msg/Twist", logs.twist(0.5, 0.1)),
            (late, "/cmd", "geometry_msgs/msg/TwistStamped", {"header": logs.header(stamp), "twist": logs.twist(1, 2)}),
            (late, "/joint_states", "sensor_msgs/msg/JointState", logs.joints(stamp, turned, turned)),
            (late, "/imu", "sensor_msgs/msg/Imu", logs.imu(stamp, speed, volts)),
            (late, "/odom", "nav_msgs/msg/Odometry", logs.odometry(stamp, speed / 2, speed)),
        ]
    return made


def wpilog(path: Path, metadata: str = "") -> Path:
    pairs = np.column_stack([VOLTS, SPEED])
    entries = {
        "NT:/drive/volts": ("double", TIME, VOLTS),
        "/drive/speed": ("float", TIME, SPEED),
        "/drive/both": ("double[]", TIME, pairs),
        "/ticks": ("int64", TIME, range(60)),
        "/enabled": ("boolean", TIME, VOLTS > 0),
        "messages": ("string", TIME[:1], ["hello"]),
    }
    return logs.write_wpilog(path, entries, metadata)


def ulog(path: Path) -> Path:
    stamps = np.round(1e6 * TIME).astype("u8")
    motors = {"timestamp": stamps, "control[0]": (VOLTS / 12).astype("f4"), "control[1]": (VOLTS / 12).astype("f4")}
    gyro = {"timestamp": stamps, "x": SPEED}
    return logs.write_ulog(path, {("actuator_motors", 0): motors, ("gyro", 0): gyro, ("gyro", 1): gyro})


def dataflash(path: Path) -> Path:
    formats = [("RCOU", "QHH", "TimeUS,C1,C3", "s--"), ("IMU", "QBfe", "TimeUS,I,GyrZ,T", "s#E-")]
    rows: list[tuple[str, tuple[Any, ...]]] = []
    for time, volts, speed in zip(TIME, VOLTS, SPEED, strict=True):
        microseconds = round(1e6 * time)
        rows.append(("RCOU", (microseconds, 1500 + round(volts * 50), 1500)))
        rows += [("IMU", (microseconds, sensor, speed, 100 * sensor)) for sensor in (0, 1)]
    return logs.write_dataflash(path, formats, rows)


def parquet(path: Path) -> Path:
    wheel = [{"volts": volts, "speed": speed} for volts, speed in zip(VOLTS, SPEED, strict=True)]
    stamps = (TIME * 1e6).round().astype("datetime64[us]")
    return logs.write_parquet(path, {"at": stamps, "t": TIME, "wheel": wheel, "note": ["on"] * 60})


WRITERS: dict[str, Callable[[Path], Path]] = {
    "drive.wpilog": wpilog,
    "drive.mcap": lambda path: logs.write_mcap(path, ros_messages()),
    "drive_db3": lambda path: logs.write_rosbag(path, ros_messages()),
    "drive_mcap": lambda path: logs.write_rosbag(path, ros_messages(), "MCAP"),
    "drive.bag": lambda path: logs.write_rosbag1(path, ros_messages()),
    "drive.ulg": ulog,
    "drive.bin": dataflash,
    "drive.parquet": parquet,
}
ROS = ("voltage=/volts/left.data", "speed=/joint_states.velocity[left]")
MAPS: dict[str, tuple[str, ...]] = {
    "drive.wpilog": ("voltage=NT:/drive/volts", "speed=/drive/speed"),
    **dict.fromkeys(("drive.mcap", "drive_db3", "drive_mcap", "drive.bag"), ROS),
    "drive.ulg": ("voltage=actuator_motors.control[0]*12", "speed=gyro[1].x"),
    "drive.bin": ("voltage=(RCOU.C1 - 1500) / 50", "speed=IMU[1].GyrZ"),
    "drive.parquet": ("time=at", "voltage=wheel.volts", "speed=wheel.speed"),
}


def importer(file: Path) -> Any:
    """Returns the importer for the ending of the file, as `brickpilot import FILE` chooses it."""
    return partial(import_kind, str(kind_of(file, IMPORTERS)))


@pytest.mark.parametrize("name", WRITERS)
def test_a_log_of_each_kind_becomes_a_data_set(name: str, tmp_path: Path) -> None:
    file = WRITERS[name](tmp_path / name)
    made = importer(file)([file], tmp_path / "set", MAPS[name], vehicle="motor", nominal={"resistance": 2.0})
    (run,) = read(made.folder).runs
    assert run.name == "drive" if "." in name else name
    np.testing.assert_allclose(run.time - run.time[0], TIME - TIME[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.inputs["voltage"], VOLTS, rtol=1e-6)
    np.testing.assert_allclose(run.outputs["speed"], SPEED, rtol=1e-6)
    assert [note for note in made.notes if "ms from" in note] == []


@pytest.mark.parametrize("name", WRITERS)
def test_the_list_says_what_a_log_of_each_kind_holds(name: str, tmp_path: Path) -> None:
    file = WRITERS[name](tmp_path / name)
    done = brickpilot("import", "--list", name, "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    (found,) = json.loads(done.stdout)["files"]
    assert found["kind"] == kind_of(file, IMPORTERS)
    channels = {one["name"]: one for one in found["channels"]}
    (speed,) = [one for one in channels if any(entry == f"speed={one}" for entry in MAPS[name])]
    assert channels[speed]["samples"] == 60
    assert channels[speed]["rate"] == pytest.approx(50)
    assert channels[speed]["last"] - channels[speed]["first"] == pytest.approx(1.18)
    lowest, highest = channels[speed]["lowest"], channels[speed]["highest"]
    assert [lowest, highest] == pytest.approx([SPEED.min(), SPEED.max()])
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]
    table = brickpilot("import", "--list", name, cwd=tmp_path).stdout.splitlines()
    assert table[0] == f"{name}: {found['kind']}, {len(channels)} channels"
    assert any(line.split()[0] == speed for line in table)


def test_messages_of_ros_become_channels_by_field_and_joint(tmp_path: Path) -> None:
    from brickpilot.importers import mcap, rosbag

    of_mcap = mcap.read(logs.write_mcap(tmp_path / "a.mcap", ros_messages()))
    of_bag = rosbag.read(logs.write_rosbag1(tmp_path / "a.bag", ros_messages()))
    for log in (of_mcap, of_bag):
        channels = log.channels
        np.testing.assert_array_equal(channels["/joint_states.position[right]"].values, -SPEED)
        np.testing.assert_array_equal(channels["/cmd_vel.linear.x"].values, np.full(60, 0.5))
        np.testing.assert_array_equal(channels["/cmd.twist.angular.z"].values, np.full(60, 2.0))
        np.testing.assert_array_equal(channels["/imu.angular_velocity.z"].values, SPEED)
        np.testing.assert_array_equal(channels["/ticks.data"].values, np.arange(60.0))
        yaw = channels["/odom.pose.pose.orientation.yaw"].values  # the angle is continuous beyond half a turn
        np.testing.assert_allclose(yaw, SPEED / 2, atol=1e-9)
        assert log.aliases["/joint_states.velocity[1]"] == "/joint_states.velocity[right]"
        assert not any("covariance" in name for name in channels)
        assert any("/note" in name for name in channels) is False


def test_a_header_gives_the_time_and_another_clock_is_told(tmp_path: Path) -> None:
    from brickpilot.importers import mcap

    simulated = 5_000_000_000
    messages = []
    for k in range(20):
        log_ns, stamp = STAMP + k * 10_000_000, simulated + k * 10_000_000
        messages.append((log_ns, "/volts", "std_msgs/msg/Float64", {"data": 1.0}))
        messages.append((log_ns, "/imu", "sensor_msgs/msg/Imu", logs.imu(stamp, 0.1, 0.0)))
    log = mcap.read(logs.write_mcap(tmp_path / "a.mcap", messages))
    np.testing.assert_allclose(log.channels["/volts.data"].time, np.arange(20) * 0.01, atol=1e-9)
    np.testing.assert_allclose(log.channels["/imu.angular_velocity.z"].time, np.arange(20) * 0.01, atol=1e-9)
    (note,) = log.notes
    assert note.startswith("the stamps follow another clock than the log")


def test_a_unit_that_the_file_states_is_used_and_a_wrong_one_refused(tmp_path: Path) -> None:
    file = wpilog(tmp_path / "a.wpilog", '{"unit": "rpm"}')
    load = importer(file)
    read_back = read(
        load([file], tmp_path / "set", ["voltage=NT:/drive/volts:V", "speed=/drive/speed"], vehicle="motor").folder
    )
    np.testing.assert_allclose(read_back.runs[0].outputs["speed"], SPEED * 2 * np.pi / 60, rtol=1e-6)
    with pytest.raises(InputError, match=r"'rpm' is of another kind than V.*voltage=NT:/drive/volts:UNIT"):
        load([file], tmp_path / "other", ["voltage=NT:/drive/volts", "speed=/drive/speed"], vehicle="motor")
    with pytest.raises(InputError, match=r"is in rpm, and so the formula has no clear unit"):
        load([file], tmp_path / "other", ["voltage=/ticks:V", "speed=/drive/speed*2"], vehicle="motor")
    with pytest.raises(InputError, match=r"is in rpm, and so the formula has no clear unit"):
        load([file], tmp_path / "other", ["voltage=/ticks:V", "speed=(/drive/speed+/ticks)/2"], vehicle="motor")


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "drive_mcap"])
def test_a_cut_log_is_refused_and_leaves_nothing(name: str, tmp_path: Path) -> None:
    file = WRITERS[name](tmp_path / name)
    cut = next(file.glob("*.db3")) if file.is_dir() else file
    cut.write_bytes(cut.read_bytes()[: int(0.7 * cut.stat().st_size) + 1])
    options = [word for entry in MAPS[name] for word in ("--map", entry)]
    done = brickpilot("import", name, "--vehicle", "motor", *options, "--out", "set", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"brickpilot: {name}: ")
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


@pytest.mark.parametrize("name", ["drive.wpilog", "drive.ulg", "drive.bin"])
def test_a_cut_log_is_read_up_to_there_on_request(name: str, tmp_path: Path) -> None:
    file = WRITERS[name](tmp_path / name)
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size) + 1])
    options = [word for entry in MAPS[name] for word in ("--map", entry)]
    refused = brickpilot("import", name, "--vehicle", "motor", *options, "--out", "set", cwd=tmp_path)
    assert refused.stderr == f"brickpilot: {name}: ends inside a record; --cut reads it up to there\n"
    done = brickpilot("import", name, "--vehicle", "motor", "--cut", *options, "--out", "set", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (run,) = read(tmp_path / "set").runs
    assert 20 < run.time.size < 60
    np.testing.assert_allclose(run.outputs["speed"], SPEED[: run.time.size], rtol=1e-6)


@pytest.mark.parametrize("name", [name for name in WRITERS if name not in ("drive_mcap", "drive_db3")])
def test_a_file_of_another_kind_is_refused(name: str, tmp_path: Path) -> None:
    other = tmp_path / name
    other.write_bytes(b"time,volts\n0,1\n" * 50)
    with pytest.raises(InputError, match=f"{name}: is (not a|no|a bag that cannot be read)"):
        importer(other)([other], tmp_path / "set", MAPS[name], vehicle="motor")
    with pytest.raises(InputError, match="no such file"):
        importer(other)([tmp_path / "none"], tmp_path / "set", MAPS[name], vehicle="motor")
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("name", "entry", "words"),
    [
        ("drive.wpilog", "speed=/drive/sped", "drive.wpilog: no channel '/drive/sped'; the nearest are /drive/speed"),
        ("drive.mcap", "speed=/joint_states.velocity[2]", "the nearest are /joint_states.velocity["),
        ("drive.bin", "speed=IMU.GyrX", "drive.bin: no channel 'IMU.GyrX'; the nearest are IMU.GyrZ, IMU[1].GyrZ"),
        ("drive.ulg", "speed=gyro.z", "drive.ulg: no channel 'gyro.z'; the nearest are gyro.x"),
        ("drive.parquet", "speed=wheel.sped", "no column 'wheel.sped' among at, t, wheel.volts, wheel.speed"),
        ("drive.wpilog", "speed=(/drive/speed + /ticks", "is no formula"),
        ("drive.wpilog", "time=/ticks", "--map: the samples of this log have times of their own"),
    ],
)
def test_an_unknown_channel_is_refused_with_the_nearest_names(
    name: str, entry: str, words: str, tmp_path: Path
) -> None:
    file = WRITERS[name](tmp_path / name)
    mapping = [one for one in MAPS[name] if not one.startswith("speed")] + [entry]
    with pytest.raises(InputError) as refused:
        importer(file)([file], tmp_path / "set", mapping, vehicle="motor")
    assert words in str(refused.value).replace(f"{tmp_path}/", "")
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("drive.wpilog", "wpiutil", "wpilib"),
        ("drive.mcap", "mcap", "ros"),
        ("drive.bag", "rosbags", "ros"),
        ("drive.ulg", "pyulog", "px4"),
        ("drive.bin", "pymavlink", "ardupilot"),
    ],
)
def test_a_missing_library_is_told_with_the_command(
    name: str, module: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = WRITERS[name](tmp_path / name)
    real = builtins.__import__

    def without(wanted: str, *rest: Any) -> Any:
        if wanted.partition(".")[0] == module:
            raise ModuleNotFoundError(f"No module named {module!r}", name=module)
        return real(wanted, *rest)

    load = importer(file)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError) as refused:
        load([file], tmp_path / "set", MAPS[name], vehicle="motor")
    assert (
        str(refused.value) == f"needs the library {module}, which is not installed: pip install 'brickpilot[{extra}]'"
    )


def test_the_list_shows_a_text_entry_as_a_note(tmp_path: Path) -> None:
    from brickpilot.importers.wpilog import read as read_wpilog

    log = read_wpilog(wpilog(tmp_path / "a.wpilog"))
    assert [one.name for one in contents(log).channels][2:4] == ["/drive/both[0]", "/drive/both[1]"]
    assert log.notes == ("without numbers: messages (string)",)


def test_the_list_shows_tables_matrices_and_tests_too(tmp_path: Path) -> None:
    rows = "\n".join(f"{10 * k};{k / 8:.3f};on".replace(".", ",") for k in range(40))
    (tmp_path / "bench.csv").write_text(f"rig 7, 2024\nmillis;pwm;state\n{rows}\n", encoding="utf-8")
    savemat(tmp_path / "axis.mat", {"qm": np.arange(5.0), "many": np.ones((5, 2)), "about": {"rig": "axis"}})
    write_json(tmp_path / "sysid.json", new_log())
    done = brickpilot("import", "--list", "bench.csv", cwd=tmp_path).stdout
    assert [line.split() for line in done.splitlines()[1:4]] == [
        ["channel", "type", "unit", "samples", "rate", "Hz", "first", "s", "last", "s", "lowest", "highest"],
        ["millis", "number", "-", "40", "0.1", "0", "390", "0", "390"],
        ["pwm", "number", "-", "40", "0.1", "0", "390", "0", "4.875"],
    ]
    assert "note: the rate and the times are those of column millis, in its unit" in done
    assert "'rig 7, 2024'" in done  # the line before the header
    assert "note: without numbers: state" in done
    channels = json.loads(brickpilot("import", "--list", "axis.mat", "--json", cwd=tmp_path).stdout)["files"][0][
        "channels"
    ]
    assert [(one["name"], one["samples"]) for one in channels] == [("qm", 5), ("many[0]", 5), ("many[1]", 5)]
    listed = brickpilot("import", "--list", "sysid.json", cwd=tmp_path).stdout
    assert "fast-forward.wheel_travel_left" in listed
    refused = brickpilot("import", "--list", "rcx", "/dev/null", cwd=tmp_path)
    assert (refused.returncode, refused.stderr) == (2, "brickpilot: --list: does not work with rcx\n")
    (tmp_path / "what.xyz").write_text("1")
    refused = brickpilot("import", "--list", "what.xyz", cwd=tmp_path)
    assert refused.stderr.startswith("brickpilot: what.xyz: no kind of log is known by this ending; name one: wpilib, ")
    assert brickpilot("import", "--list", "--kind", "table", "bench.csv", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("ending", ["wpilog", "parquet"])
def test_a_log_with_many_manoeuvres_is_split(ending: str, tmp_path: Path) -> None:
    time = 1.0 + np.arange(500) * 0.02
    volts = np.select([(time > 2) & (time < 4), (time > 6) & (time < 9)], [6.0, -6.0], 0.0)
    speed = np.where(volts == 0, 0.0, volts + 0.01 * np.sin(40 * time))
    if ending == "wpilog":
        changed = np.flatnonzero(np.diff(volts, prepend=np.nan))
        entries = {"/u": ("double", time[changed], volts[changed]), "/w": ("double", time, speed)}
        file, mapping = logs.write_wpilog(tmp_path / "a.wpilog", entries), ["voltage=/u", "speed=/w"]
    else:
        file = logs.write_parquet(tmp_path / "a.parquet", {"t": 1000 * time, "u": volts, "w": speed})
        mapping = ["time=t:ms", "voltage=u", "speed=w"]
    load = importer(file)
    first, second = read(load([file], tmp_path / "rests", mapping, vehicle="motor", split=["rests"]).folder).runs
    assert [first.name, second.name] == ["drive_1", "drive_2"]
    assert set(first.inputs["voltage"]) == {0.0, 6.0}
    assert set(second.inputs["voltage"]) == {0.0, -6.0}
    assert second.gap_s == pytest.approx(second.time[0] - first.time[-1], abs=1e-6)
    (part,) = read(load([file], tmp_path / "span", mapping, vehicle="motor", split=["3,5"]).folder).runs
    assert [part.time[0], part.time[-1]] == pytest.approx([3.0, 5.0])
