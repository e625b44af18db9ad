"""Distinguishes a frozen channel from a wheel that stands, by the other channels and by its drive.

Each test takes a stretch in which the channel repeats one value. The stretch is kept if a jam, an end stop or stiction
may explain it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.view import LEAST_FROZEN, AcrossRuns, RunView, driven_by
from brickpilot.data.signals import RATE_OF, SUMMED

Vector = NDArray[np.float64]

_STALE = 0.75  # share of repeats from which a channel stands itself and is no evidence
_OFF_RATE = 0.1  # of the fastest: allowed difference of a constant rate from the growth of its sum
_STEPS = 3.0  # resolutions of a difference of two samples
_DRIVEN = 0.5  # of the usual drive
_PACE_S, _PACE_SAMPLES = 0.03, 10
_STEADY = 0.3  # change of pace, over the fastest
_FAST = 0.3  # of the fastest: a motion of this speed does not stop within one sample
_HARDER = 1.3  # times the drive at which it moved in another run
_NEARLY = 0.6  # times that drive: sufficient where the other side moved


def is_frozen(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether samples `start` to `stop`, all of one value, cannot be a standstill or a steady motion."""
    return (
        _contradicts_sum(view, name, start, stop)
        or _never_stands(view, name, start, stop, across)
        or _stops_alone(view, name, start, stop)
        or _stands_alone(view, name, start, stop, across)
    )


def _contradicts_sum(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a rate is constant while the sum of the same sensor grows at another rate, or at a changing one."""
    of = next((sums for sums, rate in RATE_OF.items() if rate == name and sums in view.outputs), None)
    if of is None:
        return False
    time, sums = view.time, view.outputs[of]
    known = np.isfinite(sums[start:stop])
    if known.mean() < _STALE or np.mean(np.diff(sums[start:stop][known]) == 0.0) > _STALE:
        return False
    fastest = _fastest(time, sums)
    at = np.flatnonzero(known)
    marks = start + at[np.array([0, len(at) // 2, -1])]
    spans = np.diff(time[marks])
    away = np.abs(np.diff(sums[marks]) / spans - view.outputs[name][start])
    return bool(np.any(away > _OFF_RATE * fastest + _STEPS * view.resolution[of] / spans))


def _never_stands(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether a sum stands although the drive is as strong, in both directions, as where it changes at every sample.

    A machine that is driven in one direction only may be at its end stop. A yaw angle has no end stop.
    """
    during = view.drives[driven_by(name)][start:stop] if name in SUMMED else np.zeros(0)
    both = (during[during > 0.0], -during[during < 0.0])
    levels = [float(np.mean(one)) if one.size else 0.0 for one in both]
    driven = max(levels) if name == "yaw_angle" else min(levels)
    if driven == 0.0:
        return False
    usual = across.usual_drive(name)
    return usual is not None and driven > _DRIVEN * usual


def _stops_alone(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a sum in steady motion stops within one sample while its drive and other channels continue."""
    reach = max(_PACE_SAMPLES, int(_PACE_S / view.interval))
    if name not in SUMMED or start < 2 * reach or stop - start < 2 * reach:
        return False
    before, earlier, after = _slices(start, -reach), _slices(start - reach, -reach), _slices(start + reach, reach)
    values = view.outputs[name]
    if any(np.count_nonzero(np.diff(values[part])) < _PACE_SAMPLES // 2 for part in (earlier, before)):
        return False
    fastest = _fastest(view.time, values)
    paces = [_pace(view, name, part) for part in (earlier, before)]
    if min(map(abs, paces)) < _FAST * fastest or abs(paces[1] - paces[0]) > _STEADY * fastest:
        return False
    for drive in view.drives.values():
        near = drive[start - reach : start + 2 * reach]
        if np.ptp(near) > _STEADY * np.max(np.abs(drive)):
            return False
    others = [other for other in view.outputs if other != name and _is_motion(other)]
    changes: list[float] = []
    for other in others:
        if (top := _fastest(view.time, view.outputs[other], other)) > 0.0:
            was, now = _pace(view, other, before), _pace(view, other, after)
            if np.isfinite(was) and np.isfinite(now) and (abs(was) > _FAST * top or other.startswith("yaw_")):
                changes.append(abs(now - was) / top)
    return bool(changes) and max(changes) < _STEADY


def _stands_alone(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether a channel stands for a whole run, at a drive that moves it in other runs, while the other side moves.

    If one wheel is held for so long, the robot turns: a gyro, if there is one, must not show a turn.
    """
    if start > 0 or stop < len(view.time) or not _is_motion(name):
        return False
    if name == "yaw_angle":
        return _turns(view, across)
    side = driven_by(name)
    other = name.replace(side, "left" if side == "right" else "right") if side in {"left", "right"} else name
    own_drive = _level(view, side)
    lowest = min((_level(one, side) for one in across.views if one is not view and _moves(one, name)), default=np.inf)
    if other == name or not np.isfinite(lowest) or not _moves(view, other):
        return bool(other == name and own_drive > _HARDER * lowest)
    if own_drive > _HARDER * lowest:
        return True
    return own_drive > _NEARLY * lowest and _goes_straight(view, other)


def _goes_straight(view: RunView, moving: str) -> bool:
    """Whether the gyro shows no turn, as a robot would make if only one wheel moved; False without a gyro."""
    rate = view.outputs.get("yaw_rate")
    if rate is None or not np.isfinite(rate).any():
        return False
    sign = 1.0 if moving.endswith("_left") else -1.0
    return bool(sign * np.nanmean(rate) * np.sign(_pace(view, moving, slice(None))) < 0.1 * np.nanmax(np.abs(rate)))


def _turns(view: RunView, across: AcrossRuns) -> bool:
    """Whether left and right differ in this run by as much as in another in which the yaw angle moved."""
    for kind in ("travel", "velocity", "angle", "speed"):
        left, right = f"wheel_{kind}_left", f"wheel_{kind}_right"
        if left in view.outputs and right in view.outputs:
            apart = [
                abs(_pace(one, left, slice(None)) - _pace(one, right, slice(None))) for one in (view, *across.views)
            ]
            moved = [
                difference for difference, one in zip(apart[1:], across.views, strict=True) if _moves(one, "yaw_angle")
            ]
            return bool(moved and apart[0] > _DRIVEN * max(moved))
    return False


def _is_motion(name: str) -> bool:
    return name.startswith(("wheel_", "yaw_")) or name in {"angle", "speed", "position", "velocity"}


def _level(view: RunView, drive: str) -> float:
    return float(np.sqrt(np.mean(view.drives[drive] ** 2)))


def _moves(view: RunView, name: str) -> bool:
    values = view.outputs[name]
    known = values[np.isfinite(values)]
    return bool(known.size and np.count_nonzero(np.diff(known)) > LEAST_FROZEN)


def _slices(start: int, reach: int) -> slice:
    return slice(start + reach, start + 1) if reach < 0 else slice(start, start + reach + 1)


def _pace(view: RunView, name: str, part: slice) -> float:
    """Returns the mean rate of a channel over a part of the run; for a sum, its growth per time."""
    values, time = view.outputs[name][part], view.time[part]
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return np.nan
    if name not in SUMMED:
        return float(np.mean(values[known]))
    return float((values[known[-1]] - values[known[0]]) / (time[known[-1]] - time[known[0]]))


def _fastest(time: Vector, values: Vector, name: str = "angle") -> float:
    """Returns the largest mean rate over a fortieth of the run."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return 0.0
    marks = known[np.unique(np.linspace(0, known.size - 1, 41).astype(int))]
    if name in SUMMED:
        return float(np.max(np.abs(np.diff(values[marks]) / np.diff(time[marks]))))
    return float(np.max(np.abs(values[marks])))
