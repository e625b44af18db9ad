"""Finds collisions: a vehicle in fast motion that loses its speed although its command does not change.

After a collision the run no longer follows from its inputs, because the obstacle was not measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.data.audit.view import Mask, RunView, Vector, driven_by, integral
from brickpilot.data.signals import RATE_OF

_WITHIN_S = 0.1  # a collision stops a vehicle in less time; no friction, battery or slope does
_SETTLED_S = 0.3  # since the last change of command: until then the command itself may change the speed
_CHANGE = 0.05  # of the largest command: a smaller change is none
_FAST = 0.4  # of the fastest motion of any run: a slow wheel may stick
_LOST = 0.5  # of the speed before it: a collision takes more; a patch of rough floor only brakes
_SMOOTH_S = 0.02  # over which a rate is averaged, or a sum is differenced
_STEPS = 4.0  # of the resolution: the least loss of a coarse channel
_AFTER_S = 0.03  # the speed stays lost for so long at least


@dataclass(frozen=True)
class Collision:
    """A collision.

    Attributes:
        run: number of the run.
        row: the last sample before the collision.
        names: the channels that show it.
    """

    run: int
    row: int
    names: tuple[str, ...]


def collisions(views: Sequence[RunView]) -> list[Collision]:
    """Returns the first collision of each run that has one. A run without a measured wheel or shaft has none."""
    rates = [{name: rate for name in one.outputs if (rate := _rate(one, name)) is not None} for one in views]
    names = dict.fromkeys(name for each in rates for name in each)
    fastest = {name: max(float(np.max(np.abs(each[name]))) for each in rates if name in each) for name in names}
    found: list[Collision] = []
    for number, (view, each) in enumerate(zip(views, rates, strict=True)):
        rows = {name: row for name, rate in each.items() if (row := _loss(view, name, rate, fastest[name])) is not None}
        sides = {driven_by(name) for name in rows}
        if "shaft" in sides or {"left", "right"} <= sides:
            found.append(Collision(number, min(rows.values()), tuple(rows)))
    return found


def _rate(view: RunView, name: str) -> Vector | None:
    """Returns the rate of a wheel or shaft, averaged over `_SMOOTH_S`; None for other channels."""
    if name not in RATE_OF and name not in RATE_OF.values():
        return None
    known = np.isfinite(view.outputs[name])
    if np.count_nonzero(known) < 2 or view.interval > _WITHIN_S / 4:
        return None
    values = np.interp(view.time, view.time[known], view.outputs[name][known])
    sums = values if name in RATE_OF else integral(view.time, values)
    half, rows = max(1, round(_SMOOTH_S / view.interval) // 2), np.arange(len(sums))
    late, early = np.minimum(rows + half, len(sums) - 1), np.maximum(rows - half, 0)
    return np.asarray((sums[late] - sums[early]) / (view.time[late] - view.time[early]))


def _loss(view: RunView, name: str, rate: Vector, fastest: float) -> int | None:
    """Returns the last sample before a sudden loss of speed at a settled command; None: there is none."""
    within, after = (max(1, round(seconds / view.interval)) for seconds in (_WITHIN_S, _AFTER_S))
    count = len(rate) - within - after
    if count < 1 or fastest == 0.0:
        return None
    before = rate[:count]
    left = np.max([rate[within + k : within + k + count] * np.sign(before) for k in range(after)], axis=0)
    settled = _settled(view, name)
    step = view.resolution[name] / (_SMOOTH_S if name in RATE_OF else 1.0)
    lost = np.maximum(_LOST * np.abs(before), _STEPS * step)
    hit = (np.abs(before) > _FAST * fastest) & (np.abs(before) - left > lost)
    hit &= settled[:count] & settled[within + after : within + after + count]
    return int(np.argmax(hit)) if hit.any() else None


def _settled(view: RunView, name: str) -> Mask:
    """Returns where no motor's command changed or was 0 within `_SETTLED_S`; a floating motor has no command."""
    settled = np.ones(len(view.time), dtype=bool)
    rows = max(1, round(_SETTLED_S / view.interval))
    for drive in (drive for which, drive in view.drives.items() if which != "yaw"):
        past = np.lib.stride_tricks.sliding_window_view(np.pad(drive, (rows, 0), mode="edge"), rows + 1)
        settled &= np.ptp(past, axis=1) <= _CHANGE * float(np.max(np.abs(drive)))
    return np.asarray(settled & (view.drives[driven_by(name)] != 0.0))
