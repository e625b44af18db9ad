"""Relations that hold for any machine between two motions of one run: an angle and its speed, wheels and gyro.

A relation compares two motions over windows. It holds if the two motions are equal within the limits of slip, inexact
lengths and lags. It is broken if the motions are correlated, but have opposite signs or a ratio that another unit
explains. Otherwise the relation is silent. The signals of a data set and the known geometry determine which relations
exist.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import pi

import numpy as np

from brickpilot.data.audit.fault import CLOCK_FACTORS, FACTORS, GRAVITY
from brickpilot.data.audit.view import EQUAL, LEAST_WINDOWS, Vector, Windows, driven_by, ratio_of
from brickpilot.data.signals import RATE_OF

Group = tuple[str, ...]
Motions = Callable[[Windows], tuple[Vector, Vector]]

WHEEL_KINDS = ("travel", "velocity", "angle", "speed")

_PHYSICAL = 5.0  # largest ratio of two motions, up or down, that is possible without another unit
_ONE_SENSOR, _TWO_SENSORS = 1.15, 1.6  # a unit explains a ratio if (ratio / its factor) is below this, up or down
_MOVES = 0.3  # rad/s or m/s^2: a relation of two sensors is tested only if the motion is at least this
_WITH = 0.8  # least ratio |sum of motion x drive| / (sum of |motion x drive|) that is evidence
_DRIVEN = 0.4  # share of the stronger side's drive: a weaker drive is no evidence
_APART = 0.5  # (left less right) / (mean of both): unequal wheels or motors may cause a smaller ratio
_AS_HARD = 1.5  # the two sides are compared only if the ratio of their drives is smaller than this, up or down
_WIDE = 0.2  # m: least radius of a turn that counts, well above a sensor's distance from the centre


class State(IntEnum):
    """The state of a relation in one run."""

    BROKEN = -1
    SILENT = 0
    HOLDS = 1


@dataclass(frozen=True)
class Evidence:
    """What one run shows about one relation.

    Attributes:
        ratio: signed ratio of the two motions; NaN if the relation is silent.
        factors: signed factors that may explain the ratio, if the relation is broken.
    """

    state: State
    ratio: float = np.nan
    factors: tuple[float, ...] = ()


SILENT = Evidence(State.SILENT)


@dataclass(frozen=True, eq=False)
class Alike:
    """Two motions that should be equal.

    Attributes:
        over, under: groups of channels that may be wrong by one factor. The factor of a group in `over` multiplies the
            ratio of the two motions; the factor of a group in `under` divides this ratio.
        motions: function that returns the two motions, (w,) each.
        fits: a factor explains a ratio if ratio / factor is between 1 / `fits` and `fits`.
        floor: least rms per second of the larger motion; with less motion, the relation is silent.
        slips: whether slip may reduce the first motion to a fifth of the second.
    """

    over: tuple[Group, ...]
    under: tuple[Group, ...]
    motions: Motions
    fits: float = _TWO_SENSORS
    floor: float = 0.0
    slips: bool = False

    def evidence(self, windows: Windows, *, faint: bool = False) -> Evidence:
        """Evaluates the relation in one run. `faint`: motions below the floor count, too."""
        motion, against = self.motions(windows)
        known = np.isfinite(motion) & np.isfinite(against)
        level = max(windows.rms(np.where(known, one, np.nan)) for one in (motion, against))
        ratio = ratio_of(motion, against)
        if ratio is None or (level < self.floor and not faint):
            return SILENT
        least = 1 / (_PHYSICAL * EQUAL) if self.slips else 1 / EQUAL
        if least < ratio < EQUAL:
            return Evidence(State.HOLDS, ratio)
        factors = (-1.0,) if least < -ratio < EQUAL else self._factors(ratio)
        return Evidence(State.BROKEN, ratio, factors) if factors else SILENT

    def _factors(self, ratio: float) -> tuple[float, ...]:
        if 1 / _PHYSICAL < abs(ratio) < _PHYSICAL:
            return ()
        accelerations = self.over[0][0].startswith("accel_")
        listed = [GRAVITY if accelerations and one == 30 / pi else one for one in FACTORS]
        least = 1 / _PHYSICAL if self.slips else 1 / self.fits
        found = [one for one in listed if least < abs(ratio) / one < self.fits]
        found += [1 / one for one in listed if 1 / self.fits < abs(ratio) * one < self.fits]
        if ("time",) in self.under:
            found += [1 / one for one in CLOCK_FACTORS if 1 / self.fits < abs(ratio) * one < self.fits]
        return tuple(float(np.copysign(one, ratio)) for one in dict.fromkeys(found))


@dataclass(frozen=True, eq=False)
class Driven:
    """A motion that should go in the direction of its drive.

    Attributes:
        name: the channel of the motion; `drive`: the drive that moves it.
        least: least rms per second of the drive; with less drive, the relation is silent.
    """

    over: tuple[Group, ...]
    under: tuple[Group, ...]
    name: str
    drive: str
    least: float

    def evidence(self, windows: Windows, *, faint: bool = False) -> Evidence:
        """Evaluates the relation in one run; `faint` makes no difference here."""
        drive, motion = windows.of(f"drive_{self.drive}"), windows.of(self.name)
        known = np.isfinite(motion) & np.isfinite(drive)
        strongest = max(windows.rms(windows.of(f"drive_{side}")) for side in ("left", "right"))
        if np.count_nonzero(known) < LEAST_WINDOWS or windows.rms(drive) < max(self.least, _DRIVEN * strongest):
            return SILENT
        work = motion[known] * drive[known]
        share = float(np.sum(work)) / max(float(np.sum(np.abs(work))), 1e-300)
        if share < -_WITH:
            return Evidence(State.BROKEN, -1.0, (-1.0,))
        return Evidence(State.HOLDS, 1.0) if share > _WITH else SILENT


Relation = Alike | Driven


@dataclass(frozen=True)
class Geometry:
    """The known geometry of the vehicle.

    Attributes:
        wheel_radius, half_track: m; None if the data set does not state the length.
        turned: (yaw channel, kind of wheel channel) -> yaw / (left - right wheel), estimated from the data; used
            if the lengths are not stated.
    """

    wheel_radius: float | None
    half_track: float | None
    turned: Mapping[tuple[str, str], float]

    def metres(self, kind: str) -> float | None:
        """Returns the metres per unit of a wheel channel; None: not known."""
        return 1.0 if kind in {"travel", "velocity"} else self.wheel_radius

    def turn(self, yaw: str, kind: str) -> float | None:
        """Returns the ratio yaw / (left - right wheel); None: not known."""
        metres = self.metres(kind)
        if metres is None or self.half_track is None:
            return self.turned.get((yaw, kind))
        return metres / (2 * self.half_track)


def relations(names: Iterable[str], geometry: Geometry, least: Mapping[str, float]) -> list[Relation]:
    """Returns all relations among the channels `names`. `least`: drive -> `Driven.least`."""
    present = set(names)
    found: list[Relation] = [*_sums_and_rates(present), *_metres_and_radians(present, geometry)]
    for kind in WHEEL_KINDS:
        if {f"wheel_{kind}_left", f"wheel_{kind}_right"} <= present:
            found += _of_two_wheels(kind, present, geometry)
    for kind in (*(f"wheel_{kind}" for kind in WHEEL_KINDS), "current"):
        if {f"{kind}_left", f"{kind}_right"} <= present:
            found.append(_left_and_right(f"{kind}_left", f"{kind}_right", least))
    return found + _driven(present, least)


def _yaw_groups(name: str, present: set[str]) -> tuple[Group, ...]:
    """Returns groups that may be wrong together: the channel; all yaw channels; all that a wrong frame reverses."""
    both = tuple(sorted(present & {"yaw_rate", "yaw_angle"}))
    return tuple(dict.fromkeys([(name,), both, tuple(sorted({*both, *(present & {"accel_sway"})}))]))


def _wheel_groups(kind: str, present: set[str]) -> tuple[Group, ...]:
    """Returns groups that may be wrong together: both wheels' channels of a kind, and all wheel channels."""
    every = tuple(sorted(name for name in present if name.startswith("wheel_")))
    return tuple(dict.fromkeys([(f"wheel_{kind}_left", f"wheel_{kind}_right"), every]))


def _pair(over: str, under: str, scale: float = 1.0) -> Motions:
    return lambda windows: (windows.of(over), scale * windows.of(under))


def _one_or_both(name: str) -> tuple[Group, ...]:
    """Returns groups that may be wrong together: the channel alone, and the channels of both wheels."""
    for side, other in (("_left", "_right"), ("_right", "_left")):
        if name.endswith(side):
            return (name,), tuple(sorted((name, name.removesuffix(side) + other)))
    return ((name,),)


def _sums_and_rates(present: set[str]) -> list[Relation]:
    return [
        Alike(
            _one_or_both(sums), (*_one_or_both(rate), ("time",)), _pair(sums, rate), _ONE_SENSOR,
            floor=_MOVES if sums == "yaw_angle" else 0.0,
        )
        for sums, rate in (*RATE_OF.items(), ("yaw_angle", "yaw_rate"))
        if {sums, rate} <= present
    ]  # fmt: skip


def _metres_and_radians(present: set[str], geometry: Geometry) -> list[Relation]:
    """Returns the relations of a wheel or shaft that is measured both in metres and in radians."""
    names = [("position", "angle"), ("velocity", "speed")]
    for side in ("left", "right"):
        names += [(f"wheel_travel_{side}", f"wheel_angle_{side}"), (f"wheel_velocity_{side}", f"wheel_speed_{side}")]
    return [
        Alike(((metres,),), ((radians,),), _pair(metres, radians, geometry.wheel_radius))
        for metres, radians in names
        if geometry.wheel_radius is not None and {metres, radians} <= present
    ]


def _of_two_wheels(kind: str, present: set[str], geometry: Geometry) -> list[Relation]:
    """Returns the relations of both wheels' motion to the gyro and to the accelerometers."""
    metres = geometry.metres(kind) or np.nan
    groups = _wheel_groups(kind, present)
    yaws = [yaw for yaw in ("yaw_rate", "yaw_angle") if yaw in present]
    found: list[Relation] = [Alike((("accel_surge",),), groups, _surging(kind, metres), floor=_MOVES)]
    for yaw in yaws:
        # A ratio that is estimated from the data includes the slip.
        per, is_learnt = geometry.turn(yaw, kind), (yaw, kind) in geometry.turned
        slips = per is not None and not is_learnt
        found.append(Alike(_yaw_groups(yaw, present), groups, _turning(yaw, kind, per), floor=_MOVES, slips=slips))
    for yaw in yaws[:1]:
        sideways = (*groups, *_yaw_groups(yaw, present)[:2])
        found.append(Alike((("accel_sway",),), sideways, _swaying(yaw, kind, metres), floor=1.0))
    return found


def _turning(yaw: str, kind: str, per: float | None) -> Motions:
    """Returns the yaw, and the wheels' difference times `per`; `per` None: only the sign counts."""

    def motions(windows: Windows) -> tuple[Vector, Vector]:
        turn, left, right = windows.of(yaw), windows.of(f"wheel_{kind}_left"), windows.of(f"wheel_{kind}_right")
        apart = left - right
        # In a straight run the body turns because the wheels' radii differ, not their speeds.
        if windows.rms(apart) <= _APART * windows.rms(left + right) / 2:
            return turn, np.full_like(apart, np.nan)
        return turn, apart * (windows.rms(turn) / windows.rms(apart) if per is None else per)

    return motions


def _surging(kind: str, metres: float) -> Motions:
    """Returns the integral of the surge acceleration and the change of the mean wheel speed, each without its mean."""

    def motions(windows: Windows) -> tuple[Vector, Vector]:
        nothing = np.full_like(windows.seconds, np.nan)
        left, right = (windows.changed.get(f"wheel_{kind}_{side}", nothing) for side in ("left", "right"))
        motion, against = windows.of("accel_surge"), metres * (left + right) / 2
        known = np.where(np.isfinite(motion + against), 1.0, np.nan)
        return windows.unbiased(known * motion), windows.unbiased(known * against)

    return motions


def _swaying(yaw: str, kind: str, metres: float) -> Motions:
    """Returns the integral of the sway acceleration, and the integral of speed times yaw rate."""

    def motions(windows: Windows) -> tuple[Vector, Vector]:
        turn = windows.of(yaw)
        ahead = metres * (windows.of(f"wheel_{kind}_left") + windows.of(f"wheel_{kind}_right")) / 2
        # In a turn on the spot, a sensor away from the centre measures an acceleration of its own, not the vehicle's.
        ahead = np.where(np.abs(ahead) > _WIDE * np.abs(turn), ahead, np.nan)
        return windows.of("accel_sway"), ahead * turn / windows.seconds

    return motions


def _left_and_right(left: str, right: str, least: Mapping[str, float]) -> Relation:
    """Returns the relation of left to right; silent unless both drives are strong and about equally large."""

    def sides(windows: Windows) -> tuple[Vector, Vector]:
        one, other = windows.of(left), windows.of(right)
        drives = windows.of("drive_left"), windows.of("drive_right")
        levels = [windows.rms(drive) for drive in drives]
        alike = ratio_of(*drives)
        hard = all(level >= least.get(side, np.inf) for level, side in zip(levels, ("left", "right"), strict=True))
        if not hard or alike is None or not 1 / _AS_HARD < abs(alike) < _AS_HARD:
            return one, np.full_like(other, np.nan)
        return one, alike * other

    return Alike(((left,),), ((right,),), sides)


def _driven(present: set[str], least: Mapping[str, float]) -> list[Relation]:
    found: list[Relation] = []
    for name in sorted(present):
        drive = driven_by(name)
        if drive not in least or name.startswith(("current", "force")):  # a fast motor brakes against its drive
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
