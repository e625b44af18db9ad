"""All relations among the channels of a data set, from the signals that it has and the geometry that is known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.relations import Alike, Driven, Group, Motions, Relation, driving, rms
from brickpilot.data.audit.view import driven_by
from brickpilot.data.audit.windows import Windows
from brickpilot.data.signals import RATE_OF

Vector = NDArray[np.float64]

WHEEL_KINDS = ("travel", "velocity", "angle", "speed")

_TIGHT = (0.87, 1.15)  # a ratio over its factor where one sensor measures both motions
_ALIKE, _AS_HARD = 0.95, 1.5  # correlation and ratio of two sides' drives, for the sides to be compared
_APART = 0.5  # difference of two wheels over their mean: larger than a mismatch of their radii
_WIDE = 0.2  # m: radius of a turn, well above the distance of a sensor from the centre


@dataclass(frozen=True)
class Geometry:
    """What is known of the vehicle's geometry.

    Attributes:
        wheel_radius, half_track: m; None where the data set does not state them.
        turned: (yaw channel, kind of wheel channel) -> yaw per difference of left and right, learnt from the data, for
            use where the lengths are not stated.
    """

    wheel_radius: float | None
    half_track: float | None
    turned: Mapping[tuple[str, str], float]

    def metres(self, kind: str) -> float | None:
        """Returns the m per unit of a wheel channel; None where they are not known."""
        return 1.0 if kind in {"travel", "velocity"} else self.wheel_radius

    def turn(self, yaw: str, kind: str) -> float | None:
        """Returns the yaw per difference of left and right; None where it is not known."""
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


def _get(windows: Windows, name: str) -> Vector:
    return windows.moved.get(name, np.full_like(windows.seconds, np.nan))


def _yaw_groups(name: str, present: set[str]) -> tuple[Group, ...]:
    """Returns groups that may be wrong together: the channel alone, all of one gyro, all that the frame may reverse."""
    both = tuple(sorted(present & {"yaw_rate", "yaw_angle"}))
    return tuple(dict.fromkeys([(name,), both, tuple(sorted({*both, *(present & {"accel_sway"})}))]))


def _wheel_groups(kind: str, present: set[str]) -> tuple[Group, ...]:
    """Returns groups that may be wrong together: both wheels' channels of a kind, and all wheel channels."""
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
    """Returns groups that may be wrong together: the channel alone, and the channels of both wheels."""
    for side, other in (("_left", "_right"), ("_right", "_left")):
        if name.endswith(side):
            return (name,), tuple(sorted((name, name.removesuffix(side) + other)))
    return ((name,),)


def _metres_and_radians(present: set[str], geometry: Geometry) -> list[Relation]:
    """Relations of a wheel or shaft that is measured both in metres and in radians."""
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
    """Relations of both wheels' motion to the gyro and to the accelerometers."""
    wheels = _Wheels(kind, geometry.metres(kind))
    groups = _wheel_groups(kind, present)
    found = [_turning(yaw, wheels, groups, present, geometry) for yaw in ("yaw_rate", "yaw_angle") if yaw in present]
    if wheels.metres is None:
        return found
    if "accel_surge" in present:
        surge = Alike(
            (("accel_surge",),), groups, wheels.surging, good=(0.5, 1.8), fits=(0.75, 1.33), surely=0.95, floor=0.3
        )
        found.append(surge)
    yaw = next((name for name in ("yaw_rate", "yaw_angle") if name in present), None)
    if "accel_sway" in present and yaw is not None:
        sideways = (*groups, *_yaw_groups(yaw, present)[:2])
        found.append(
            Alike((("accel_sway",),), sideways, wheels.swaying(yaw), good=(0.3, 3.0), fits=(0.6, 1.6), floor=1.0)
        )
    return found


def _turning(yaw: str, wheels: _Wheels, groups: tuple[Group, ...], present: set[str], geometry: Geometry) -> Relation:
    """A yaw channel beside the difference of the wheels."""
    per = geometry.turn(yaw, wheels.kind)
    # Wheels that slip turn the body less, down to a fifth of their difference. A ratio that is learnt from the data
    # includes most of the slip.
    stated = per is not None and (yaw, wheels.kind) not in geometry.turned
    good, fits, small = ((0.15, 1.6), (0.2, 1.25), (0.8, 1.25)) if stated else ((0.45, 2.2), (0.6, 1.67), None)
    over, under = _yaw_groups(yaw, present), groups
    if yaw == "yaw_rate" and wheels.kind in {"travel", "angle"}:
        over += (("time",),)
    elif yaw == "yaw_angle" and wheels.kind in {"velocity", "speed"}:
        under += (("time",),)
    return Alike(over, under, wheels.turning(yaw, per), good, fits, floor=0.3, fits_small=small)


@dataclass(frozen=True)
class _Wheels:
    """Both wheels' channels of a kind; `metres`: m per unit, None where it is not known."""

    kind: str
    metres: float | None

    @property
    def left(self) -> str:
        return f"wheel_{self.kind}_left"

    @property
    def right(self) -> str:
        return f"wheel_{self.kind}_right"

    def turning(self, yaw: str, per: float | None) -> Motions:
        """The yaw, and the difference of the wheels times `per`; None: scaled so that only the sign counts."""

        def motions(windows: Windows) -> tuple[Vector, Vector]:
            turn, one, other = _get(windows, yaw), _get(windows, self.left), _get(windows, self.right)
            apart, together = one - other, one + other
            # In a straight run the body turns by the difference of the wheels' radii, not of their speeds.
            known = np.isfinite(apart)
            if not known.any() or rms(apart, windows) <= _APART * rms(together, windows) / 2:
                return turn, np.full_like(apart, np.nan)
            return turn, apart * (rms(turn, windows) / rms(apart, windows) if per is None else per)

        return motions

    def surging(self, windows: Windows) -> tuple[Vector, Vector]:
        """The integral of the surge acceleration, and the change of the wheels' mean speed, without their means."""
        nothing = np.full_like(windows.seconds, np.nan)
        speeds = [windows.changed.get(name, nothing) for name in (self.left, self.right)]
        motion, against = _get(windows, "accel_surge"), (self.metres or np.nan) * (speeds[0] + speeds[1]) / 2
        known = np.isfinite(motion) & np.isfinite(against)
        if not known.any():
            return motion, against
        # A bias or a slope adds the same amount in each second.
        motion, against = (
            values - windows.seconds * (np.sum(values[known]) / np.sum(windows.seconds[known]))
            for values in (motion, against)
        )
        return motion, against

    def swaying(self, yaw: str) -> Motions:
        """The integral of the sway acceleration, and speed times yaw rate."""

        def motions(windows: Windows) -> tuple[Vector, Vector]:
            metres = self.metres or np.nan
            ahead = metres * (_get(windows, self.left) + _get(windows, self.right)) / 2
            turn = _get(windows, yaw)
            # In a turn on the spot, a sensor off the centre measures its own acceleration, not the vehicle's.
            ahead = np.where(np.abs(ahead) > _WIDE * np.abs(turn), ahead, np.nan)
            return _get(windows, "accel_sway"), ahead * turn / windows.seconds

        return motions


def _left_and_right(left: str, right: str, least: Mapping[str, float]) -> Relation:
    """The relation of both sides, if they are driven alike and so hard that friction cannot hold one of them."""

    def sides(windows: Windows) -> tuple[Vector, Vector]:
        one, other = _get(windows, left), _get(windows, right)
        nothing = one, np.full_like(other, np.nan)
        drives = driving(windows, "left"), driving(windows, "right")
        if drives[0] is None or drives[1] is None:
            return nothing
        levels = [rms(drive, windows) for drive in drives if drive is not None]
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
        if drive not in least or name.startswith(("current", "force")):  # a motor above the speed of its voltage brakes
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
