"""Manoeuvres for the next experiment: schedules of motor commands that each excite one kind of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = tuple[tuple[float, float, float], ...]
"""Break points: (time in s, left command, right command); the commands are shares of a voltage."""

_REST_S, _END_S = 0.5, 1.0  # s of rest before and after a manoeuvre
_REVERSALS = (1.6, 1.6, 0.8, 0.8, 0.4, 0.4, 0.2, 0.2, 0.2, 0.2)  # s from one reversal to the next


@dataclass(frozen=True)
class Manoeuvre:
    """An experiment: each motor's command as break points (s, V) joined by lines. Two points at one time are a step."""

    name: str
    duration_s: float
    voltage_left: tuple[tuple[float, float], ...]
    voltage_right: tuple[tuple[float, float], ...]


def manoeuvres(vehicle: str, volts: float) -> tuple[Manoeuvre, ...]:
    """Returns manoeuvres up to `volts` that each excite one kind of motion. A `motor` uses the left voltage alone."""
    chosen = _STRAIGHT if vehicle == "motor" else {**_STRAIGHT, **_TURNING}
    sides = {
        name: [[(at, share[k] * volts) for at, *share in points] for k in (0, 1)] for name, points in chosen.items()
    }
    return tuple(Manoeuvre(name, left[-1][0], tuple(left), tuple(right)) for name, (left, right) in sides.items())


def commands(manoeuvre: Manoeuvre, time: Array) -> Array:
    """Returns (n, 2) V: the commands of the left and the right motor at `time` (n,), s; at a step, the new value."""
    sides = (np.array(side).T for side in (manoeuvre.voltage_left, manoeuvre.voltage_right))
    return np.column_stack([np.interp(time, at, volts) for at, volts in sides])


def _steps(*levels: tuple[float, float, float]) -> Points:
    """Returns the break points of rest, then each level (s, left, right), then rest again."""
    points, now = [(0.0, 0.0, 0.0)], _REST_S
    for seconds, left, right in (*levels, (_END_S, 0.0, 0.0)):
        points += [(now, *points[-1][1:]), (now, left, right)]
        now += seconds
    return (*points, (now, 0.0, 0.0))


def _ramp(top: float, ratio: float) -> Points:
    """Returns a ramp from 0 to `top`, then -`top`, then 0; the right motor gets `ratio` times the left command."""
    return tuple((at, share, ratio * share) for at, share in ((0.0, 0.0), (4.0, top), (12.0, -top), (16.0, 0.0)))


_STRAIGHT: Mapping[str, Points] = {
    "forward and back at full power": _steps((3.0, 1.0, 1.0), (3.0, -1.0, -1.0)),
    "forward and back at a third of the power": _steps((4.0, 0.35, 0.35), (4.0, -0.35, -0.35)),
    "a staircase of speeds": _steps(*((2.0, level, level) for level in (0.2, 0.4, 0.6, 0.8, 1.0))),
    "a slow ramp through zero": _ramp(0.4, 1.0),
    "reversals, faster and faster": _steps(*((s, 0.5 * (-1) ** k, 0.5 * (-1) ** k) for k, s in enumerate(_REVERSALS))),
    "half a minute at full power": _steps((30.0, 1.0, 1.0)),
    "creeping": _steps((5.0, 0.12, 0.12), (5.0, -0.12, -0.12)),
}
_TURNING: Mapping[str, Points] = {
    "spinning right, then left": _steps((4.0, 0.5, -0.5), (4.0, -0.5, 0.5)),
    "spinning at full power": _steps((4.0, 1.0, -1.0), (4.0, -1.0, 1.0)),
    "a slow spin through zero": _ramp(0.4, -1.0),
    "curves to the right and to the left": _steps((4.0, 0.8, 0.4), (4.0, 0.4, 0.8)),
    "curves backward": _steps((4.0, -0.8, -0.4), (4.0, -0.4, -0.8)),
    "fast tight curves": _steps((4.0, 1.0, 0.2), (4.0, 0.2, 1.0)),
    "one wheel at a time": _steps((3.0, 0.6, 0.0), (3.0, 0.0, 0.6), (3.0, -0.6, 0.0), (3.0, 0.0, -0.6)),
}
