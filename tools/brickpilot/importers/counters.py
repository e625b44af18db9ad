"""Unwraps counters that overflow, and finds where a counter was set to 0.

A jump counts as an overflow only if it has the usual size after the range of the counter is added. Any other jump
stays, because it may be real.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

_BITS = ((16, 1), (32, 1), (12, 2), (14, 2))  # width; how many overflows show it. 12 and 14 are those of angle sensors
_NEAR = 20  # steps on either side that show the usual size
_USUAL = 3.0  # times the largest step nearby: the largest step of an overflow
_LATE = 50.0  # times the usual step of a clock: the pause that may lie in its overflow
_FAR_STEPS, _FAR_COUNTS = 10.0, 20.0  # a jump to 0 is further than so many usual steps and so many smallest ones
_RETURNS = 5  # samples: a counter that comes back within them was misread, not set to 0


@dataclass(frozen=True)
class Unwrapped:
    """A counter without overflows. `rows`: where it overflowed, by the row after; `kind`: "unsigned 16-bit"."""

    values: Vector
    rows: tuple[int, ...] = ()
    kind: str = ""


def unwrap(values: Vector, clock: bool = False) -> Unwrapped:
    """Returns a column of counts without overflows of 12, 14, 16 or 32 bits, signed or unsigned.

    Args:
        values: cells as logged; NaN where blank.
        clock: whether it counts time and so only rises.
    """
    known = np.flatnonzero(np.isfinite(values))
    counts = values[known]
    if counts.size < 3 or np.any(counts != np.round(counts)):
        return Unwrapped(values)
    low, high = counts.min(), counts.max()
    for bits, least in _BITS:
        span = 2.0**bits
        for kind, start in (("unsigned", 0.0), ("signed", -span / 2)):
            if low < start or high >= start + span:
                continue
            steps = _overflows(np.diff(counts), span, clock)
            if len(steps) >= least:
                turns = np.zeros(counts.size)
                turns[steps + 1] = -np.sign(np.diff(counts)[steps])
                unwrapped = values.copy()
                unwrapped[known] = counts + span * np.cumsum(turns)
                return Unwrapped(unwrapped, tuple(known[steps + 1].tolist()), f"{kind} {bits}-bit")
    return Unwrapped(values)


def unturn(values: Vector, turn: float) -> Unwrapped:
    """Returns a heading without its jumps by a turn, as from 359 to 0 degrees or from 180 to -180.

    Args:
        values: cells as logged; NaN where blank.
        turn: the length of a turn in their unit.
    """
    known = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[known])
    jumps = _overflows(steps, turn, clock=False)
    turns = np.zeros(known.size)
    turns[jumps + 1] = -np.sign(steps[jumps])
    unwrapped = values.copy()
    unwrapped[known] += turn * np.cumsum(turns)
    return Unwrapped(unwrapped, tuple(known[jumps + 1].tolist()), "heading")


def _overflows(steps: Vector, span: float, clock: bool) -> NDArray[np.int64]:
    """Returns which steps of a counter are overflows of a range `span`."""
    large = np.abs(steps) > span / 2
    found = []
    for index in np.flatnonzero(large):
        true = steps[index] - np.sign(steps[index]) * span
        if clock:
            usual = float(np.median(steps[~large])) if (~large).any() else 0.0
            sound = steps[index] < 0 and 0 < true <= _LATE * usual
        else:
            near = slice(max(0, index - _NEAR), index + _NEAR + 1)
            others = np.abs(steps[near][~large[near]])
            sound = bool(others.size) and abs(true) <= min(_USUAL * float(others.max()) + 1.0, span / 8)
        if sound:
            found.append(index)
    return np.array(found, dtype=np.int64)


def resets(values: Vector) -> list[int]:
    """Returns the rows at which a counter jumps to a value near 0, from far away, and does not come back."""
    known = np.flatnonzero(np.isfinite(values))
    counts = values[known]
    steps = np.diff(counts)
    moved = np.abs(steps[steps != 0.0])
    if not moved.size:
        return []
    smallest = float(moved.min())
    found = []
    for index in np.flatnonzero(np.abs(steps) > _FAR_COUNTS * smallest):
        near = np.abs(np.delete(steps, index)[max(0, index - _NEAR) : index + _NEAR])
        usual = float(np.quantile(near, 0.9)) if near.size else 0.0
        before, after = counts[index], counts[index + 1 : index + 1 + _RETURNS]
        far = abs(before) > _FAR_STEPS * usual + _FAR_COUNTS * smallest
        zero = abs(after[0]) <= _USUAL * usual + smallest
        if far and zero and np.all(np.abs(after - before) > abs(before) / 2):
            found.append(int(known[index + 1]))
    return found
