"""Each command on the page about logs of other programs works as printed, with logs that their libraries wrote."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import other_logs as logs
from brickpilot.data.reading import read
from brickpilot.importers import CHANNELS, IMPORTERS
from command import brickpilot
from other_logs import STAMP

README = Path(__file__).resolve().parents[2] / "tools/docs/guides/my_log.md"


def logs_of_the_readme(folder: Path) -> None:
    """Writes the files that the page's commands name: a robot whose wheels follow their voltages."""
    time = 1.0 + np.arange(200) * 0.02
    left, right = np.where(time < 3, 6.0, -3.0), np.where(time < 2, 6.0, 3.0)
    travel = {"left": np.cumsum(left) * 0.004, "right": np.cumsum(right) * 0.004}
    yaw_rate = (right - left) / 4
    entries = {
        "/drive/left/volts": ("double", time, left),
        "/drive/right/volts": ("double", time, right),
        "/drive/left/metres": ("double", time, travel["left"]),
        "/drive/right/metres": ("double", time, travel["right"]),
        "/gyro/angle": ("double", time, np.degrees(np.cumsum(yaw_rate) * 0.02)),
    }
    logs.write_wpilog(folder / "drive.wpilog", entries)
    messages = []
    for k in range(200):
        stamp = STAMP + k * 20_000_000
        speeds = {"left": 7 * left[k], "right": 7 * right[k]}
        messages += [
            (stamp, "/pwm/left", "std_msgs/msg/Float64", {"data": 20 * left[k]}),
            (stamp, "/pwm/right", "std_msgs/msg/Float64", {"data": 20 * right[k]}),
            (stamp, "/joint_states", "sensor_msgs/msg/JointState", logs.joints(stamp, speeds, speeds)),
            (stamp, "/imu", "sensor_msgs/msg/Imu", logs.imu(stamp, yaw_rate[k], 0.0)),
            (stamp, "/odom", "nav_msgs/msg/Odometry", logs.odometry(stamp, 0.02 * yaw_rate[: k + 1].sum(), 0.0)),
        ]
    logs.write_mcap(folder / "drive.mcap", messages)
    logs.write_rosbag(folder / "rosbag2_drive", messages)
    stamps = (1e6 * time).round().astype("u8")
    motors = {f"control[{side}]": volts / 12 for side, volts in enumerate((left, right))}
    gyro = {"timestamp": stamps, **{f"xyz[{axis}]": yaw_rate * (axis == 2) for axis in range(3)}}
    topics = {("actuator_motors", 0): {"timestamp": stamps, **motors}, ("vehicle_angular_velocity", 0): gyro}
    logs.write_ulog(folder / "drive.ulg", topics)
    rows: list[tuple[str, tuple[Any, ...]]] = []
    for k in range(200):
        rows.append(("RCOU", (int(stamps[k]), round(1500 + 30 * left[k]), round(1500 + 30 * right[k]))))
        rows.append(("IMU", (int(stamps[k]), yaw_rate[k])))
    formats = [("RCOU", "QHH", "TimeUS,C1,C3", "s--"), ("IMU", "Qf", "TimeUS,GyrZ", "sE")]
    logs.write_dataflash(folder / "drive.bin", formats, rows)
    columns = {"t": time, "left": left, "right": right, "gyro": np.degrees(yaw_rate)}
    logs.write_parquet(folder / "drive.parquet", columns)


def test_each_command_of_the_page_on_other_logs_works(tmp_path: Path) -> None:
    section = README.read_text(encoding="utf-8").partition("## Logs of other programs")[2].partition("\n## ")[0]
    commands = [shlex.split(line) for line in section.splitlines() if line.startswith("brickpilot ")]
    logs_of_the_readme(tmp_path)
    imported = []
    for _, *words in commands:
        done = brickpilot(*words, cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, ""), words
        if "--out" in words:
            imported.append(words[words.index("--out") + 1])
    kinds = {row.kind for row in IMPORTERS if row.options[: len(CHANNELS)] == CHANNELS} | {"parquet"}
    assert {name.removeprefix("from_") for name in imported} == kinds
    for name in imported:
        (run,) = read(tmp_path / name).runs
        assert run.time.size == 200
        raw = run.raw_outputs
        turning = raw["yaw_rate"] if "yaw_rate" in raw else np.gradient(raw["yaw_angle"])
        assert np.nanmax(np.abs(turning)) > 0.01, name
