"""The windows of all runs of a data set, with the evidence of each relation in each run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import log

import numpy as np

from brickpilot.data.audit.relation_list import Geometry, relations
from brickpilot.data.audit.relations import driving
from brickpilot.data.audit.view import driven_by
from brickpilot.data.audit.windows import Windows

TYPICAL_INTERVAL_S = 0.005

_LEVEL = 0.4  # of the run with the strongest drive: in a weaker one something else may move the machine
_WORST = 6.0  # the largest logarithm of a ratio that counts
_TYPICAL = (("yaw_", 3.0), ("wheel_travel", 0.5), ("wheel_velocity", 0.5), ("position", 0.2), ("velocity", 0.2),
            ("wheel_", 10.0), ("angle", 10.0), ("speed", 10.0), ("accel_", 1.0))  # fmt: skip


class RunSet:
    """The runs that are long enough to be compared.

    Attributes:
        windows: number of the run -> its windows.
        names: the output channels.
        roughness: number of the run -> channel -> mean size of its second differences.
        least: drive -> rms per second below which the drive is no evidence.
        relations: all relations among the channels.
        evidence: number of the run -> the evidence of each relation, in their order.
    """

    def __init__(
        self,
        windows: Mapping[int, Windows],
        names: Sequence[str],
        roughness: Mapping[int, Mapping[str, float]],
        geometry: Geometry,
    ) -> None:
        self.windows = windows
        self.names = names
        self.roughness = roughness
        self.least = _least(windows)
        self.relations = relations(names, geometry, self.least)
        self.evidence = {k: [relation.evidence(one) for relation in self.relations] for k, one in windows.items()}


def is_output(name: str) -> bool:
    """Whether a channel is measured, so that it is not a drive."""
    return not name.startswith("drive_")


def _least(windows: Mapping[int, Windows]) -> dict[str, float]:
    """Returns drive -> the rms per second below which the drive is too weak to be evidence."""
    levels = {
        which: [drive_level(one, which) for one in windows.values()] for which in ("left", "right", "shaft", "yaw")
    }
    return {which: _LEVEL * max(each) for which, each in levels.items() if any(level > 0.0 for level in each)}


def drive_level(windows: Windows, which: str) -> float:
    """Returns the rms per second of a drive; 0 where there is none."""
    drive = driving(windows, which)
    return 0.0 if drive is None else float(np.sqrt(np.mean((drive / windows.seconds) ** 2)))


def log_ratio(one: float, other: float) -> float:
    """Returns the absolute logarithm of a ratio, at most 6."""
    return min(abs(log(abs(one) / abs(other))), _WORST)


def usual_gain(others: Iterable[Windows], name: str) -> float | None:
    """Returns the median gain of a channel in other runs; None where none has one."""
    gains = [abs(gain) for one in others if (gain := drive_gain(one, name)) is not None]
    return float(np.median(gains)) if gains else None


def drive_gain(windows: Windows, name: str, *, surely: float = 0.0) -> float | None:
    """Returns a channel's motion per drive, by least squares.

    None where either is unknown or zero, or where their correlation is below `surely`.
    """
    drive = driving(windows, driven_by(name))
    if drive is None or name not in windows.moved:
        return None
    known = np.isfinite(windows.moved[name]) & np.isfinite(drive)
    motion, drive = windows.moved[name][known], drive[known]
    common, power, moved = float(motion @ drive), float(drive @ drive), float(motion @ motion)
    if common == 0.0 or abs(common) < surely * float(np.sqrt(power * moved)):
        return None
    return common / power


def oddness(windows: Windows, name: str) -> float:
    """Returns how far the fastest motion of a channel is from that of a typical small machine, as a logarithm."""
    typical = next((value for start, value in _TYPICAL if name.startswith(start)), None)
    if typical is None or name not in windows.moved:
        return 0.0
    largest = float(np.nanmax(np.abs(windows.moved[name] / windows.seconds), initial=0.0))
    return log_ratio(largest, typical) if largest > 0.0 else 0.0
