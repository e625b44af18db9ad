"""The manoeuvres that the next experiment is chosen from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.finding import Manoeuvre

Array = NDArray[np.float64]

_REST_S = 0.5  # before a manoeuvre
_REVERSALS = (1.6, 1.6, 0.8, 0.8, 0.4, 0.4, 0.2, 0.2, 0.2, 0.2)  # s between them


def manoeuvres(vehicle: str, volts: float) -> tuple[Manoeuvre, ...]:
    """Returns manoeuvres up to `volts` that each excite one thing. A `motor` uses the left voltage alone."""
    drive = _Drive(volts)
    return drive.straight() if vehicle == "motor" else (*drive.straight(), *drive.turning())


def commands(manoeuvre: Manoeuvre, time: Array) -> Array:
    """Returns (n, 2): the commanded voltage of the left and the right motor at `time` (n,), s."""
    return np.column_stack([_at(points, time) for points in (manoeuvre.voltage_left, manoeuvre.voltage_right)])


def _at(points: Sequence[tuple[float, float]], time: Array) -> Array:
    """Returns (n,): linear between the break points; at a step, the value after it."""
    at, value = np.array(points).T
    index = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
    span = np.where(at[index + 1] > at[index], at[index + 1] - at[index], 1.0)
    return np.asarray(value[index] + (value[index + 1] - value[index]) * np.clip((time - at[index]) / span, 0.0, 1.0))


@dataclass(frozen=True)
class _Drive:
    """Makes manoeuvres from levels in shares of `volts`."""

    volts: float

    def straight(self) -> tuple[Manoeuvre, ...]:
        reversals = [(seconds, 0.5 * (-1) ** k, 0.5 * (-1) ** k) for k, seconds in enumerate(_REVERSALS)]
        return (
            self._steps("forward and back at full power", (3.0, 1.0, 1.0), (3.0, -1.0, -1.0)),
            self._steps("forward and back at a third of the power", (4.0, 0.35, 0.35), (4.0, -0.35, -0.35)),
            self._steps("a staircase of speeds", *((2.0, level, level) for level in (0.2, 0.4, 0.6, 0.8, 1.0))),
            self._ramp("a slow ramp through zero", 0.4, 1.0),
            self._steps("reversals, faster and faster", *reversals),
            self._steps("half a minute at full power", (30.0, 1.0, 1.0)),
            self._steps("creeping", (5.0, 0.12, 0.12), (5.0, -0.12, -0.12)),
        )

    def turning(self) -> tuple[Manoeuvre, ...]:
        one_wheel = ((3.0, 0.6, 0.0), (3.0, 0.0, 0.6), (3.0, -0.6, 0.0), (3.0, 0.0, -0.6))
        return (
            self._steps("spinning right, then left", (4.0, 0.5, -0.5), (4.0, -0.5, 0.5)),
            self._steps("spinning at full power", (4.0, 1.0, -1.0), (4.0, -1.0, 1.0)),
            self._ramp("a slow spin through zero", 0.4, -1.0),
            self._steps("curves to the right and to the left", (4.0, 0.8, 0.4), (4.0, 0.4, 0.8)),
            self._steps("curves backward", (4.0, -0.8, -0.4), (4.0, -0.4, -0.8)),
            self._steps("fast tight curves", (4.0, 1.0, 0.2), (4.0, 0.2, 1.0)),
            self._steps("one wheel at a time", *one_wheel),
        )

    def _steps(self, name: str, *levels: tuple[float, float, float]) -> Manoeuvre:
        """Returns rest, then each level (s, left, right), then rest again."""
        left, right, now = [(0.0, 0.0)], [(0.0, 0.0)], _REST_S
        for seconds, one, other in (*levels, (1.0, 0.0, 0.0)):
            left += [(now, left[-1][1]), (now, one * self.volts)]
            right += [(now, right[-1][1]), (now, other * self.volts)]
            now += seconds
        return Manoeuvre(name, now, (*left, (now, 0.0)), (*right, (now, 0.0)))

    def _ramp(self, name: str, top: float, ratio: float) -> Manoeuvre:
        """Returns a ramp to `top`, down through zero to minus `top`, and back; the right motor gets `ratio` of it."""
        points = ((0.0, 0.0), (4.0, top), (12.0, -top), (16.0, 0.0))
        left = tuple((t, v * self.volts) for t, v in points)
        return Manoeuvre(name, 16.0, left, tuple((t, v * ratio) for t, v in left))
