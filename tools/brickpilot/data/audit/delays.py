"""Finds a rate that is late beside the sum of the same wheel: motor controllers report an averaged velocity.

This is a property of the log, not a fault. Both channels are kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.fault import joined
from brickpilot.data.audit.view import RunView
from brickpilot.data.signals import RATE_OF

Vector = NDArray[np.float64]

_LONGEST_S = 0.2  # no sensor has a longer delay
_SPAN_S = 0.04  # over which a sum is differenced, and a rate averaged
_LEAST_SAMPLES = 60
_LEAST_STEPS = 100.0  # resolutions: the least motion of a sum
_CLEARER = 0.8  # residual with the delay over that without it
_STEPS = 20  # tried in each direction of the longest delay
_AGREES = 0.5  # of the median: spread of the delays of the runs
_LEAST_ROWS = 0.75  # rows: a smaller delay may come from the moment at which a row is written


def delays(views: Sequence[RunView]) -> dict[str, float]:
    """Returns rate -> its delay in s behind the derivative of its sum, if the delay is clear and agrees in all runs."""
    found: dict[str, float] = {}
    views = [view for view in views if len(view.time) >= _LEAST_SAMPLES]
    for sums, rate in RATE_OF.items():
        each = [one for view in views if (one := _delay(view, sums, rate)) is not None]
        if not each:
            continue
        middle = float(np.median(each))
        spread = 1.4826 * float(np.median(np.abs(np.array(each) - middle)))
        row = float(np.median([view.interval for view in views]))
        if abs(middle) > _LEAST_ROWS * row and spread < _AGREES * abs(middle):
            found[rate] = middle
    return found


def delay_note(found: dict[str, float]) -> str:
    """Describes the delays of rates, s."""
    told = [f"{name} by {1e3 * abs(seconds):.0f} ms" for name, seconds in found.items()]
    way = "behind" if next(iter(found.values())) > 0 else "ahead of"
    return (
        f"timing: {joined(told)} {'is' if len(told) == 1 else 'are'} {way} the derivative of the travel or angle of "
        "the same wheel, as behind a filter; a model without this delay takes it for the vehicle's"
    )


def _delay(view: RunView, sums: str, rate: str) -> float | None:
    """Returns the delay in one run: 0 where none is clear; None where too little moves."""
    if not {sums, rate} <= view.outputs.keys():
        return None
    summed, rated = (view.sampled(name) for name in (sums, rate))
    if min(len(summed), len(rated)) < _LEAST_SAMPLES or view.interval > _SPAN_S:
        return None
    travel, speed = view.outputs[sums][summed], view.outputs[rate][rated]
    if np.ptp(travel) < _LEAST_STEPS * view.resolution[sums]:
        return None
    time = np.arange(view.time[0] + _LONGEST_S + _SPAN_S, view.time[-1] - _LONGEST_S - _SPAN_S, view.interval)
    if len(time) < _LEAST_SAMPLES:
        return None
    path = np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(view.time[rated])))
    grown = _growth(time, view.time[rated], path)

    def off(delay: float) -> float:
        moved = _growth(time - delay, view.time[summed], travel)
        scale = float(moved @ grown) / max(float(moved @ moved), 1e-300)
        return float(np.sqrt(np.mean((grown - scale * moved) ** 2)))

    tried = np.linspace(-_LONGEST_S, _LONGEST_S, 2 * _STEPS + 1)
    left = np.array([off(delay) for delay in tried.tolist()])
    best = int(np.argmin(left))
    if left[best] > _CLEARER * left[_STEPS] or best in (0, len(tried) - 1):
        return 0.0
    finer = np.linspace(tried[best - 1], tried[best + 1], 2 * _STEPS + 1)
    return float(finer[int(np.argmin([off(delay) for delay in finer.tolist()]))])


def _growth(time: Vector, at: Vector, values: Vector) -> Vector:
    """Returns the change of `values` over `_SPAN_S` about each of `time`."""
    ends = (np.interp(time + sign * _SPAN_S / 2, at, values) for sign in (1, -1))
    later, earlier = ends
    return np.asarray(later - earlier)
