"""A relation between two motions of one run that has to hold for any machine: an angle and its speed, wheels and gyro.

A relation compares motions over windows. It holds if the two are equal within what physics allows (slip, a scale error
of 10 %, a lag). It is broken if they move together, but with the wrong sign or by the factor of another unit. Otherwise
it is silent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import pi

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.fault import CLOCK_FACTORS, FACTORS, GRAVITY
from brickpilot.data.audit.windows import Windows

Vector = NDArray[np.float64]
Group = tuple[str, ...]
Motions = Callable[[Windows], tuple[Vector, Vector]]

_CLOCK_RATIO = (0.85, 1.15)  # a ratio over the factor of a clock, for the clock to explain it
_LEAST_WINDOWS = 4
_PHYSICAL = 5.0  # ratio of two measurements of one motion that physics may make
_WITH, _AGAINST = 0.5, -0.8  # share of a motion that goes with its drive
_ONSET = 0.5  # of the largest drive: at such a drive the motion follows it, even if something else moves it later
_DRIVEN = 0.4  # of the other side's drive: a weaker drive is no evidence
_TURNED = 0.5  # of the mean drive: a smaller difference of left and right is no evidence of turning


class State(IntEnum):
    """What a run shows of a relation."""

    BROKEN = -1
    SILENT = 0
    HOLDS = 1


@dataclass(frozen=True)
class Evidence:
    """The evidence of one run on one relation.

    Attributes:
        ratio: of the two motions, signed; NaN where the relation is silent.
        factors: where it is broken, the factors that explain the ratio, signed.
    """

    state: State
    ratio: float = np.nan
    factors: tuple[float, ...] = ()


SILENT = Evidence(State.SILENT)


@dataclass(frozen=True, eq=False)
class Alike:
    """Two motions that should be equal.

    Attributes:
        over, under: groups of channels. The ratio grows with a common factor of a group in `over`, and shrinks with one
            in `under`.
        motions: gives the two motions, (w,) each.
        good: lowest and highest ratio that physics may make.
        fits: lowest and highest ratio over a factor, for the factor to explain the ratio; `fits_small`: for factors
            below 1.
        surely: least correlation of the two.
        floor: least rms of either motion per second, for the relation to hold.
        smallest: factors between this and its inverse are not considered.
    """

    over: tuple[Group, ...]
    under: tuple[Group, ...]
    motions: Motions
    good: tuple[float, float]
    fits: tuple[float, float]
    surely: float = 0.9
    floor: float = 0.0
    fits_small: tuple[float, float] | None = None
    smallest: float = 0.0

    def evidence(self, windows: Windows, *, faint: bool = False) -> Evidence:
        """Evaluates the relation in one run. `faint`: it may also hold for motions below the floor."""
        floor = 0.0 if faint else self.floor
        motion, against = self.motions(windows)
        known = np.isfinite(motion) & np.isfinite(against)
        if np.count_nonzero(known) < _LEAST_WINDOWS:
            return SILENT
        y, x, seconds = motion[known], against[known], windows.seconds[known]
        rms_y, rms_x = (float(np.sqrt(np.mean((values / seconds) ** 2))) for values in (y, x))
        if min(rms_x, rms_y) == 0.0 or max(rms_x, rms_y) < floor:
            return SILENT
        correlation = float(y @ x / np.sqrt((y @ y) * (x @ x)))
        if abs(correlation) < self.surely:
            return SILENT
        ratio = float(np.copysign(np.sqrt((y @ y) / (x @ x)), correlation))
        if self.good[0] < ratio < self.good[1]:
            return Evidence(State.HOLDS, ratio) if min(rms_x, rms_y) >= floor else SILENT
        factors = self._factors(ratio)
        return Evidence(State.BROKEN, ratio, factors) if factors else SILENT

    def _factors(self, ratio: float) -> tuple[float, ...]:
        if ratio < 0 and self.good[0] < -ratio < self.good[1]:
            return (-1.0,)
        if 1 / _PHYSICAL < abs(ratio) < _PHYSICAL:
            return ()
        accelerations = self.over[0][0].startswith("accel_")
        listed = [GRAVITY if accelerations and one == 30 / pi else one for one in FACTORS if one > self.smallest]
        small = self.fits if self.fits_small is None else self.fits_small
        found = [one for one in listed if self.fits[0] < abs(ratio) / one < self.fits[1]]
        found += [1 / one for one in listed if small[0] < abs(ratio) * one < small[1]]
        if ("time",) in self.under:
            found += [1 / one for one in CLOCK_FACTORS if _CLOCK_RATIO[0] < abs(ratio) * one < _CLOCK_RATIO[1]]
        return tuple(float(np.copysign(one, ratio)) for one in dict.fromkeys(found))


@dataclass(frozen=True, eq=False)
class Driven:
    """A motion that should go in the direction of its drive.

    Attributes:
        name: the channel of the motion; `drive`: of what drives it.
        least: rms of the drive per second below which the relation is silent.
    """

    over: tuple[Group, ...]
    under: tuple[Group, ...]
    name: str
    drive: str
    least: float

    def evidence(self, windows: Windows, *, faint: bool = False) -> Evidence:
        """Evaluates the relation in one run; `faint` makes no difference here."""
        drive = driving(windows, self.drive)
        motion = windows.moved.get(self.name)
        if drive is None or motion is None:
            return SILENT
        known = np.isfinite(motion) & np.isfinite(drive)
        if np.count_nonzero(known) < _LEAST_WINDOWS or rms(drive, windows) < max(self.least, self._compared(windows)):
            return SILENT
        work = motion[known] * drive[known]
        if not np.any(work):
            return SILENT
        share = float(np.sum(work) / np.sum(np.abs(work)))
        onset = int(np.argmax(np.abs(drive[known]) > _ONSET * np.abs(drive[known]).max()))
        if share < _AGAINST and work[onset] < 0.0:
            return Evidence(State.BROKEN, -1.0, (-1.0,))
        return Evidence(State.HOLDS, 1.0) if share > _WITH else SILENT

    def _compared(self, windows: Windows) -> float:
        """Returns the least rms of this drive beside the drives of both sides."""
        left, right = driving(windows, "left"), driving(windows, "right")
        if left is None or right is None:
            return 0.0
        if self.drive == "yaw":
            return _TURNED * rms(left + right, windows)
        return _DRIVEN * max(rms(left, windows), rms(right, windows))


Relation = Alike | Driven


def driving(windows: Windows, which: str) -> Vector | None:
    """Returns the drive of "left", "right", "shaft" or "yaw", integrated over each window; None where there is none."""
    if which != "yaw":
        return windows.moved.get(f"drive_{which}")
    left, right = windows.moved.get("drive_left"), windows.moved.get("drive_right")
    return None if left is None or right is None else left - right


def rms(values: Vector, windows: Windows) -> float:
    """Returns the rms per second of (w,) values; NaN where none is known."""
    known = np.isfinite(values)
    return float(np.sqrt(np.mean((values[known] / windows.seconds[known]) ** 2))) if known.any() else np.nan
