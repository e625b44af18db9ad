"""Turns flights of `brickpilot run` and `hil` into a data set with only the signals that a real host can log.

So a flight is like the log of a real robot: it can show effects that the firmware's model lacks. The importer takes
counts per turn and nominal values from `rcx.toml`, the robot in the package. So it refuses a flight whose image
`firmware` made for another robot. The battery's voltage is the plant's exact one; a brick reads it in steps of 28 mV.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import COUNTS_PER_TURN, RCX
from brickpilot.data.rows import CsvFormat, read_columns
from brickpilot.data.signals import SIGNALS
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.importers.writer import NewDataset, NewRun, run_names

SUMMARY, LOG = "summary.json", "log.csv"

_REST_S = 1.0  # s: time after a mission's end that is kept, while the robot rolls to rest
_COUNTS = 65536  # the firmware's counters wrap after this number of counts
_ALWAYS = {
    "time": "time_s",
    "duty_left": "left_duty",
    "duty_right": "right_duty",
    "battery_voltage": "battery_v",
    "accel_surge": "measured_accel_surge_m_s2",
    "accel_sway": "measured_accel_sway_m_s2",
    "yaw_rate": "measured_yaw_rate_rad_s",
}
"""Signal -> its column in the log."""
_WHEELS = {"wheel_angle_left": "measured_left_counts", "wheel_angle_right": "measured_right_counts"}
_SENSED = {"imu": _ALWAYS, "imu+encoders": _ALWAYS | _WHEELS}


def import_flight(folders: Sequence[Path]) -> NewDataset:
    """Returns a data set of flights with the same sensors. Each flight becomes a run.

    A run ends a second after the mission's end. The nominal values are those of `rcx.toml`.

    Args:
        folders: run folders.

    Raises:
        InputError: a folder holds no flight of a mission, or a flight with another robot's image; a flight has
            sensors that no real robot has, or other sensors than the first flight.
    """
    summaries = [_summary(folder) for folder in folders]
    names = run_names(folders)
    sensors = summaries[0]["sensors"]
    for folder, summary in zip(folders, summaries, strict=True):
        if summary["image"]:
            message = f"was flown by {summary['image']}, whose counts per turn and nominal values are another robot's"
            raise InputError(message, file=folder)
        if summary["sensors"] not in _SENSED:
            message = f"was flown with {summary['sensors']} sensors, which no robot has: fly it with --sensors imu"
            raise InputError(message, file=folder)
        if summary["sensors"] != sensors:
            raise InputError(f"was flown with {summary['sensors']}, and {folders[0]} with {sensors}", file=folder)
    runs = [NewRun(*run) for run in zip(names, map(_columns, folders, summaries), strict=True)]
    nominal = {key: float(parameter["value"]) for key, parameter in TomlFile(RCX).data["parameters"].items()}
    note = "counts a turn and nominal values are those of the packaged robot"
    units = {signal: SIGNALS[signal].unit for signal in _SENSED[sensors]}
    return NewDataset("diff_drive", "FRD", units, runs, nominal, [note])


def _summary(folder: Path) -> Mapping[str, Any]:
    """Returns a flight's sensors, the end of its mission in s, and its image (None: the packaged image).

    Raises:
        InputError: the folder holds no flight.
    """
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        ended_at_s = float(summary.get("ended_at_s") or math.inf)
        return {"sensors": str(summary["sensors"]), "ended_at_s": ended_at_s, "image": summary.get("image")}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError("is not the summary of a flight of run or hil", file=folder / SUMMARY) from error


def _columns(folder: Path, summary: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Returns signal -> its values (rows,) in SI.

    Raises:
        InputError: the log lacks a column, or no duty drives a motor, as in a manoeuvre.
    """
    values = read_columns(folder / LOG, _SENSED[summary["sensors"]], CsvFormat()).values
    if not any(np.any(values[signal]) for signal in ("duty_left", "duty_right")):
        raise InputError("drives no motor by its duty: it is no flight of a mission", file=folder / LOG)
    turn = 2 * math.pi / COUNTS_PER_TURN
    turns = {signal: turn * np.unwrap(values[signal], period=_COUNTS) for signal in _WHEELS if signal in values}
    kept = values["time"] <= summary["ended_at_s"] + _REST_S
    return {signal: column[kept] for signal, column in (values | turns).items()}
