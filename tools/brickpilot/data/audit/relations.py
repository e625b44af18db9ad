"""What the channels of one run must have in common, whatever the machine: an angle and its speed, wheels and gyro.

A relation compares two motions over windows. Good: they are the same but for what physics may do to them (slip, a scale
10 % off, a lag). Bad: they go together, but with the wrong sign or by the factor of another unit. Silent: neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.view import driven_by
from brickpilot.data.audit.windows import Windows
from brickpilot.data.signals import RATE_OF, SIGNALS

Vector = NDArray[np.float64]
State = Literal[1, 0, -1]
Group = tuple[str, ...]
Motions = Callable[[Windows], tuple[Vector, Vector]]

FACTORS = (180 / pi, 30 / pi, 2 * pi, 1000.0, 100.0, 1 / 0.0254, 25.4)
"""Units that are taken for one another: degrees, rpm or turns for radians; mm, cm or inches for m, mA for A."""

_LENGTHS = (1000.0, 100.0, 1 / 0.0254, 25.4)
_GRAVITY = 9.80665  # of accelerations, in place of 30 / pi: standing beside each other they cannot be told
_TAKEN_FOR = {
    "rad": (180 / pi, 2 * pi, 1000.0),
    "rad/s": (180 / pi, 30 / pi, 2 * pi, 1000.0),
    "m": _LENGTHS,
    "m/s": _LENGTHS,
    "m/s^2": (_GRAVITY, *_LENGTHS),
}

WHEEL_KINDS = ("travel", "velocity", "angle", "speed")

_CLOCK = (1e3, 1e6)
_CLOCK_FITS = (0.85, 1.15)
_SAMPLED_FITS = (0.7, 1.4)
_TIGHT = (0.87, 1.15)  # a ratio over its factor where one sensor measures both
_LEAST_WINDOWS = 4
_GROSS = 5.0  # no physics makes two measures of one motion so different
_WITH, _AGAINST = 0.5, -0.8  # share of a motion that goes the way of its drive
_ONSET = 0.5  # of the largest drive: what is moved by something else goes with its drive there
_DRIVEN = 0.4  # of the other side's drive: less is no evidence
_ALIKE, _AS_HARD = 0.95, 1.5  # of two sides: correlation of their drives, and ratio
_APART = 0.5  # difference of two wheels over their mean: more than a mismatch of their radii
_WIDE = 0.2  # m, radius of a turn well above how far off the centre a sensor sits
_TURNED = 0.5  # of the mean drive, for the difference of left and right


@dataclass(frozen=True)
class Judgement:
    """`state`: 1 good, 0 silent, -1 bad, and then what the ratio may be, signed. `ratio`: NaN where silent."""

    state: State
    ratio: float = np.nan
    factors: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Alike:
    """Two motions that should be the same.

    Attributes:
        over, under: groups of channels by whose common factor the ratio grows, and shrinks.
        motions: the two, (w,) each.
        good: ratios that physics may make.
        fits: a ratio over a factor, for the ratio to be that factor's; `fits_small`: for factors below 1.
        surely: least correlation.
        floor: least rms of either motion per second, for the relation to be good.
        smallest: factors below this, or above its inverse, are not believed.
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

    def judge(self, windows: Windows, *, faint: bool = False) -> Judgement:
        """`faint`: whether motions below the floor may be good too."""
        floor = 0.0 if faint else self.floor
        motion, against = self.motions(windows)
        known = np.isfinite(motion) & np.isfinite(against)
        if np.count_nonzero(known) < _LEAST_WINDOWS:
            return Judgement(0)
        y, x, seconds = motion[known], against[known], windows.seconds[known]
        rms_y, rms_x = (float(np.sqrt(np.mean((values / seconds) ** 2))) for values in (y, x))
        if min(rms_x, rms_y) == 0.0 or max(rms_x, rms_y) < floor:
            return Judgement(0)
        correlation = float(y @ x / np.sqrt((y @ y) * (x @ x)))
        if abs(correlation) < self.surely:
            return Judgement(0)
        ratio = float(np.copysign(np.sqrt((y @ y) / (x @ x)), correlation))
        if self.good[0] < ratio < self.good[1]:
            return Judgement(1, ratio) if min(rms_x, rms_y) >= floor else Judgement(0)
        factors = self._factors(ratio)
        return Judgement(-1, ratio, factors) if factors else Judgement(0)

    def _factors(self, ratio: float) -> tuple[float, ...]:
        if ratio < 0 and self.good[0] < -ratio < self.good[1]:
            return (-1.0,)
        if 1 / _GROSS < abs(ratio) < _GROSS:
            return ()
        accelerations = self.over[0][0].startswith("accel_")
        listed = [_GRAVITY if accelerations and one == 30 / pi else one for one in FACTORS if one > self.smallest]
        small = self.fits if self.fits_small is None else self.fits_small
        found = [one for one in listed if self.fits[0] < abs(ratio) / one < self.fits[1]]
        found += [1 / one for one in listed if small[0] < abs(ratio) * one < small[1]]
        if ("time",) in self.under:
            found += [1 / one for one in _clocks() if _CLOCK_FITS[0] < abs(ratio) * one < _CLOCK_FITS[1]]
        return tuple(float(np.copysign(one, ratio)) for one in dict.fromkeys(found))


@dataclass(frozen=True, eq=False)
class Driven:
    """A motion that should go the way it is driven. `least`: rms of the drive per second below which it is silent."""

    over: tuple[Group, ...]
    under: tuple[Group, ...]
    name: str
    drive: str
    least: float

    def judge(self, windows: Windows, *, faint: bool = False) -> Judgement:
        drive = driving(windows, self.drive)
        motion = windows.moved.get(self.name)
        if drive is None or motion is None:
            return Judgement(0)
        known = np.isfinite(motion) & np.isfinite(drive)
        if np.count_nonzero(known) < _LEAST_WINDOWS or _rms(drive, windows) < max(self.least, self._compared(windows)):
            return Judgement(0)
        work = motion[known] * drive[known]
        if not np.any(work):
            return Judgement(0)
        share = float(np.sum(work) / np.sum(np.abs(work)))
        onset = int(np.argmax(np.abs(drive[known]) > _ONSET * np.abs(drive[known]).max()))
        if share < _AGAINST and work[onset] < 0.0:
            return Judgement(-1, -1.0, (-1.0,))
        return Judgement(1, 1.0) if share > _WITH else Judgement(0)

    def _compared(self, windows: Windows) -> float:
        left, right = driving(windows, "left"), driving(windows, "right")
        if left is None or right is None:
            return 0.0
        if self.drive == "yaw":
            return _TURNED * _rms(left + right, windows)
        return _DRIVEN * max(_rms(left, windows), _rms(right, windows))


Relation = Alike | Driven


@dataclass(frozen=True)
class Geometry:
    """`wheel_radius`, `half_track`: m, None where the data set does not state them. `turned`: (yaw channel, kind of
    wheel channel) -> its yaw per difference of left and right in the data themselves, for use where they are not."""

    wheel_radius: float | None
    half_track: float | None
    turned: Mapping[tuple[str, str], float]

    def metres(self, kind: str) -> float | None:
        """m per unit of a wheel channel."""
        return 1.0 if kind in {"travel", "velocity"} else self.wheel_radius

    def turn(self, yaw: str, kind: str) -> float | None:
        metres = self.metres(kind)
        if metres is None or self.half_track is None:
            return self.turned.get((yaw, kind))
        return metres / (2 * self.half_track)


def relations(names: Iterable[str], geometry: Geometry, least: Mapping[str, float]) -> list[Relation]:
    """All relations among the channels of a data set; `least`: drive -> what `Driven` needs of it."""
    present = set(names)
    found: list[Relation] = [*_sums_and_rates(present), *_metres_and_radians(present, geometry)]
    for kind in WHEEL_KINDS:
        if {f"wheel_{kind}_left", f"wheel_{kind}_right"} <= present:
            found += _of_two_wheels(kind, present, geometry)
    for kind in (*(f"wheel_{kind}" for kind in WHEEL_KINDS), "current"):
        if {f"{kind}_left", f"{kind}_right"} <= present:
            found.append(_left_and_right(f"{kind}_left", f"{kind}_right", least))
    return found + _driven(present, least)


def driving(windows: Windows, which: str) -> Vector | None:
    """What drives `which` of "left", "right", "shaft" and "yaw", integrated over each window; None where nothing."""
    if which != "yaw":
        return windows.moved.get(f"drive_{which}")
    left, right = windows.moved.get("drive_left"), windows.moved.get("drive_right")
    return None if left is None or right is None else left - right


def is_unit(factor: float) -> bool:
    """Whether a channel may be off by a factor, and not only a clock."""
    listed = (1.0, _GRAVITY, *FACTORS)
    return any(abs(size / one - 1.0) < 1e-9 for one in listed for size in (abs(factor), 1 / abs(factor)))


def usual_factors(name: str) -> tuple[float, ...]:
    """What the channel's own unit is often off by, above 1."""
    return _TAKEN_FOR.get(SIGNALS[name].unit if name in SIGNALS else "", (1000.0,))


def is_usual(name: str, factor: float) -> bool:
    """Whether a factor is one that the channel's own unit is often off by, or its inverse."""
    listed = (1.0, *usual_factors(name))
    return any(abs(size / one - 1.0) < 1e-9 for one in listed for size in (abs(factor), 1 / abs(factor)))


def is_clock(factor: float) -> bool:
    return any(abs(factor / one - 1.0) < 1e-9 for one in _clocks())


def clock_factors(ratio: float) -> list[float]:
    """The units of time that two intervals may be apart by."""
    return [one for one in _clocks() if _SAMPLED_FITS[0] < ratio / one < _SAMPLED_FITS[1]]


def _clocks() -> list[float]:
    return [one for unit in _CLOCK for one in (unit, 1 / unit)]


def _rms(values: Vector, windows: Windows) -> float:
    """Per second; NaN where nothing is known."""
    known = np.isfinite(values)
    return float(np.sqrt(np.mean((values[known] / windows.seconds[known]) ** 2))) if known.any() else np.nan


def _get(windows: Windows, name: str) -> Vector:
    return windows.moved.get(name, np.full_like(windows.seconds, np.nan))


def _yaw_groups(name: str, present: set[str]) -> tuple[Group, ...]:
    """A yaw channel alone; all from one gyro; all that a wrong frame turns over."""
    both = tuple(sorted(present & {"yaw_rate", "yaw_angle"}))
    return tuple(dict.fromkeys([(name,), both, tuple(sorted({*both, *(present & {"accel_sway"})}))]))


def _wheel_groups(kind: str, present: set[str]) -> tuple[Group, ...]:
    """Both wheels' channels of a kind; all wheel channels."""
    every = tuple(sorted(name for name in present if name.startswith("wheel_")))
    return tuple(dict.fromkeys([(f"wheel_{kind}_left", f"wheel_{kind}_right"), every]))


def _pair(over: str, under: str, scale: float = 1.0) -> Motions:
    return lambda windows: (_get(windows, over), scale * _get(windows, under))


def _sums_and_rates(present: set[str]) -> list[Relation]:
    found: list[Relation] = [
        Alike(_one_or_both(sums), (*_one_or_both(rate), ("time",)), _pair(sums, rate), good=(0.5, 2.0), fits=_TIGHT)
        for sums, rate in RATE_OF.items()
        if {sums, rate} <= present
    ]
    if {"yaw_angle", "yaw_rate"} <= present:
        motions = _pair("yaw_angle", "yaw_rate")
        groups = (("yaw_angle",),), (("yaw_rate",), ("time",))
        found.append(Alike(*groups, motions, good=(0.5, 2.0), fits=_TIGHT, floor=0.2))
    return found


def _one_or_both(name: str) -> tuple[Group, ...]:
    """A channel alone; with that of the other wheel."""
    for side, other in (("_left", "_right"), ("_right", "_left")):
        if name.endswith(side):
            return (name,), tuple(sorted((name, name.removesuffix(side) + other)))
    return ((name,),)


def _metres_and_radians(present: set[str], geometry: Geometry) -> list[Relation]:
    """The same wheel or shaft, measured in both."""
    radius = geometry.wheel_radius
    names = [("position", "angle"), ("velocity", "speed")]
    for side in ("left", "right"):
        names += [(f"wheel_travel_{side}", f"wheel_angle_{side}"), (f"wheel_velocity_{side}", f"wheel_speed_{side}")]
    if radius is None:
        return []
    return [
        Alike(((metres,),), ((radians,),), _pair(metres, radians, radius), good=(0.4, 2.5), fits=(0.8, 1.25))
        for metres, radians in names
        if {metres, radians} <= present
    ]


def _of_two_wheels(kind: str, present: set[str], geometry: Geometry) -> list[Relation]:
    left, right = f"wheel_{kind}_left", f"wheel_{kind}_right"
    wheels = _wheel_groups(kind, present)
    found: list[Relation] = []

    def turning(yaw: str, per: float | None) -> Motions:
        def both(windows: Windows) -> tuple[Vector, Vector]:
            turn, one, other = _get(windows, yaw), _get(windows, left), _get(windows, right)
            apart, together = one - other, one + other
            # driving straight, what turns the body are its wheels' radii, whatever their difference of speed
            known = np.isfinite(apart)
            if not known.any() or _rms(apart, windows) <= _APART * _rms(together, windows) / 2:
                return turn, np.full_like(apart, np.nan)
            return turn, apart * (_rms(turn, windows) / _rms(apart, windows) if per is None else per)

        return both

    for yaw in ("yaw_rate", "yaw_angle"):
        if yaw not in present:
            continue
        per = geometry.turn(yaw, kind)
        # wheels that slip turn the body by less, down to a fifth of what they say; learnt, most slip is in `per`
        stated = per is not None and (yaw, kind) not in geometry.turned
        good, fits, small = ((0.15, 1.6), (0.2, 1.25), (0.8, 1.25)) if stated else ((0.45, 2.2), (0.6, 1.67), None)
        over, under = _yaw_groups(yaw, present), wheels
        if yaw == "yaw_rate" and kind in {"travel", "angle"}:
            over += (("time",),)
        elif yaw == "yaw_angle" and kind in {"velocity", "speed"}:
            under += (("time",),)
        found.append(Alike(over, under, turning(yaw, per), good, fits, floor=0.3, fits_small=small))
    metres = geometry.metres(kind)
    if metres is None:
        return found

    def surging(windows: Windows) -> tuple[Vector, Vector]:
        speeds = [windows.changed.get(name, np.full_like(windows.seconds, np.nan)) for name in (left, right)]
        motion, against = _get(windows, "accel_surge"), metres * (speeds[0] + speeds[1]) / 2
        known = np.isfinite(motion) & np.isfinite(against)
        if not known.any():
            return motion, against
        # a bias or a slope adds the same to each second
        motion, against = (
            values - windows.seconds * (np.sum(values[known]) / np.sum(windows.seconds[known]))
            for values in (motion, against)
        )
        return motion, against

    def swaying(yaw: str) -> Motions:
        def both(windows: Windows) -> tuple[Vector, Vector]:
            ahead, turn = metres * (_get(windows, left) + _get(windows, right)) / 2, _get(windows, yaw)
            # turning on the spot, what a sensor off the centre feels is not the vehicle's
            ahead = np.where(np.abs(ahead) > _WIDE * np.abs(turn), ahead, np.nan)
            return _get(windows, "accel_sway"), ahead * turn / windows.seconds

        return both

    if "accel_surge" in present:
        found.append(
            Alike((("accel_surge",),), wheels, surging, good=(0.5, 1.8), fits=(0.75, 1.33), surely=0.95, floor=0.3)
        )
    turning_by = next((name for name in ("yaw_rate", "yaw_angle") if name in present), None)
    if "accel_sway" in present and turning_by is not None:
        sideways = (*wheels, *_yaw_groups(turning_by, present)[:2])
        motions = swaying(turning_by)
        found.append(Alike((("accel_sway",),), sideways, motions, good=(0.3, 3.0), fits=(0.6, 1.6), floor=1.0))
    return found


def _left_and_right(left: str, right: str, least: Mapping[str, float]) -> Relation:
    """Both sides, where they are driven hard and alike, so that friction cannot hold one of them."""

    def sides(windows: Windows) -> tuple[Vector, Vector]:
        one, other = _get(windows, left), _get(windows, right)
        nothing = one, np.full_like(other, np.nan)
        drives = driving(windows, "left"), driving(windows, "right")
        if drives[0] is None or drives[1] is None:
            return nothing
        levels = [_rms(drive, windows) for drive in drives if drive is not None]
        if any(level < least.get(side, np.inf) for level, side in zip(levels, ("left", "right"), strict=True)):
            return nothing
        alike = float(drives[0] @ drives[1]) / np.sqrt(float(drives[0] @ drives[0]) * float(drives[1] @ drives[1]))
        scale = levels[0] / levels[1]
        if abs(alike) < _ALIKE or not 1 / _AS_HARD < scale < _AS_HARD:
            return nothing
        return one, float(np.copysign(scale, alike)) * other

    return Alike(((left,),), ((right,),), sides, good=(0.25, 4.0), fits=(0.6, 1.67), smallest=9.0)


def _driven(present: set[str], least: Mapping[str, float]) -> list[Relation]:
    found: list[Relation] = []
    for name in sorted(present):
        drive = driven_by(name)
        if drive not in least or name.startswith(("current", "force")):  # a motor that runs ahead of its voltage brakes
            continue
        over: tuple[Group, ...] = _one_or_both(name)
        under: tuple[Group, ...] = ((f"drive_{drive}",),)
        if drive == "yaw":
            over, under = _yaw_groups(name, present), ()
        elif drive != "shaft":
            under += (("drive_left", "drive_right"),)
            over += (_wheel_groups("", present)[1],) if name.startswith("wheel_") else ()
        found.append(Driven(tuple(dict.fromkeys(over)), under, name, drive, least[drive]))
    return found
