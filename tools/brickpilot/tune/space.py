"""The gains that are tuned, their ranges, and the way between the search's coordinates and raw integers.

A coordinate is log(raw + offset): gains act by ratios, and with the offset a gain of 0 can grow. The search moves
within a factor of the start and within the format, and scores the rounded integer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.vehicle.gains import AT_MOST
from brickpilot.vehicle.setting_defaults import defaults
from brickpilot.vehicle.settings import settings

Array = NDArray[np.float64]

PIDS = ("speed_kp", "speed_ki", "heading_kp", "heading_ki", "heading_kd", "feedforward")
GUIDANCE = ("cruise", "decel", "bearing_hold", "pivot", "align")
TUNED = PIDS + GUIDANCE
"""The gains that are tuned: those of both PIDs, and those of the guidance along the line of sight."""

FACTOR_PID, FACTOR_GUIDANCE = 10.0, 3.0
"""How far a gain may leave the start, either way. Beyond it a loop is another loop, and a route is driven otherwise."""

OFFSET = 0.02
"""Of the packaged robot's raw value: the size at which a gain counts as switched on."""


@dataclass(frozen=True)
class Space:
    """Ranges of the search, in raw integers, (gains,) each and in the order of `names`."""

    names: tuple[str, ...]
    offset: Array
    low: Array
    high: Array

    def coordinates(self, raw: Mapping[str, int]) -> Array:
        """Returns the place of a gain set."""
        return np.asarray(np.log(np.array([float(raw[name]) for name in self.names]) + self.offset))

    def raw(self, coordinates: Array) -> dict[str, int]:
        """Returns the raw integers at a place: rounded, within the ranges, and no pair in contradiction."""
        values = np.clip(np.exp(coordinates) - self.offset, self.low, self.high)
        found = {name: int(value) for name, value in zip(self.names, np.rint(values), strict=True)}
        for less, more in AT_MOST:
            if less in found and more in found:
                most = settings()[less].raw(settings()[more].value(found[more]))
                found[less] = min(found[less], most)
        return found

    def bounds(self) -> tuple[Array, Array]:
        """Returns the least and the largest coordinate of each gain."""
        return np.log(self.low + self.offset), np.log(self.high + self.offset)


def around(start: Mapping[str, int], firmware: Mapping[str, int]) -> Space:
    """Returns the space about a start.

    Args:
        start: raw integers of `TUNED`.
        firmware: raw integers of all settings: what the tuned ones have to agree with.
    """
    names = tuple(name for name in TUNED if name in start)
    packaged = defaults("coupled")
    offset = np.array([max(OFFSET * packaged[name], 1.0) for name in names])
    rows = [_range(name, start, firmware, float(more)) for name, more in zip(names, offset, strict=True)]
    low, high = np.array(rows, dtype=float).T
    return Space(names, offset, low, high)


def _range(name: str, start: Mapping[str, int], firmware: Mapping[str, int], offset: float) -> tuple[int, int]:
    factor, row = (FACTOR_PID if name in PIDS else FACTOR_GUIDANCE), settings()[name]
    low = max(row.low, round((start[name] + offset) / factor - offset))
    high = min(row.high, round((start[name] + offset) * factor - offset))
    for less, more in AT_MOST:  # where the other of a pair is not tuned, it is a limit
        if name == more and less not in start:
            low = max(low, row.raw(settings()[less].value(firmware[less])))
    return min(low, start[name]), max(high, start[name])
