"""Finds stretches in which a signal stands where it cannot: at the end of its range, or still while others move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit import standstill
from brickpilot.data.audit.view import LEAST_FROZEN, AcrossRuns, RunView, stretches
from brickpilot.data.signals import RATE_OF, SUMMED

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ANALOGUE = ("accel_", "yaw_rate", "current", "force", "battery")  # never still but for lack of resolution
_LEAST_CLIPPED = 8  # samples at a run's extreme
_CLIPPED_BEYOND = 5.0  # times as often as any other value
_EDGE_STEPS = 3.0  # resolutions: the jump on and off a plateau
_DITHERS = 0.6  # share of samples that repeat the one before, at most: noise of half a resolution and more
_BLOCK = 50
_QUIET_BLOCKS = 0.9  # quantile over blocks of that share
_UNLIKELY = 4.0  # times the stretch that is to be expected once, or the longest elsewhere
_LEAP = 8.0  # times the largest other change: how a sum of motion leaps when a frozen sensor wakes
_BY_RATE = 10.0  # resolutions: how far the measured rate must have moved a sum that stands
_ONE_WAY = 0.8  # of its path: motion, not noise
_MOVES = 0.1  # of its largest: no offset of a rate at rest
_NEAR = 4.0  # of the usual change from sample to sample
_FEW = 0.2  # of the samples at an extreme
_STALE = 0.75  # share of repeats in a rate that then says nothing: it stands itself
_FAR = 0.25  # of the range, beyond its ends
_NOW_AND_THEN = 0.02
_BATTERY = "battery_voltage"


def clipped(view: RunView, name: str, stated: tuple[float, float] | None) -> Mask:
    """Samples at or beyond the stated range's ends, two or more in a row; else those of a plateau at an extreme.

    An end of zero is where an unsigned sensor rests, and no sign of clipping.
    """
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    if stated is None:
        for sign in (1.0, -1.0):
            found |= _plateau(sign * values, view.resolution[name]) if name not in SUMMED else False
        return found
    step = min(view.resolution[name], 0.01 * (stated[1] - stated[0]))
    with np.errstate(invalid="ignore"):
        for end, beyond in ((stated[1], values >= stated[1] - step), (stated[0], values <= stated[0] + step)):
            if end != 0.0:
                for start, stop in stretches(beyond):
                    found[start:stop] |= stop - start > 1
    return found


def leaves(values: Vector, stated: tuple[float, float] | None) -> bool:
    """Whether a channel goes, not only now and then, far beyond the stated range: no sensor clips there."""
    known = values[np.isfinite(values)]
    if stated is None or not known.size:
        return False
    far = _FAR * (stated[1] - stated[0])
    return bool(np.mean((known > stated[1] + far) | (known < stated[0] - far)) > _NOW_AND_THEN)


def _plateau(values: Vector, resolution: float) -> Mask:
    """Samples at the highest value, where it comes far more often than any other and is left and met by leaps."""
    none = np.zeros(len(values), dtype=bool)
    known = values[np.isfinite(values)]
    if len(known) < LEAST_FROZEN or known.max() == 0.0:
        return none
    top = known.max()
    at_top = values >= top - 1e-5 * max(float(np.ptp(known)), abs(top))
    count = int(np.count_nonzero(at_top))
    others = values[~at_top & np.isfinite(values)]
    if count < _LEAST_CLIPPED or len(others) < LEAST_FROZEN:
        return none
    bottom = others.min()  # the range's other end, where the signal may stand as often
    between = others[others != bottom] if bottom != 0.0 else others
    most = int(np.unique(between, return_counts=True)[1].max(initial=0))
    repeated = np.diff(others) == 0.0
    edges = [near for start, stop in stretches(at_top) for near in (start - 1, stop) if 0 <= near < len(values)]
    leaps = [top - values[near] for near in edges if np.isfinite(values[near])]
    changes = np.abs(np.diff(others))
    sharp = bool(leaps) and np.median(leaps) > max(_EDGE_STEPS * resolution, 0.2 * float(np.median(changes)))
    return at_top if count > _CLIPPED_BEYOND * most and repeated.mean() <= _DITHERS and sharp else none


def frozen(view: RunView, name: str, across: AcrossRuns) -> Mask:
    """Stretches of one value that the signal's noise cannot make, or that its own rate or a leap at the end denies."""
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    for start, last in stretches(_repeats(values), LEAST_FROZEN - 1):
        stop = last + 1
        if (
            _denied_by_rate(view, name, start, stop)
            or standstill.denied(view, name, start, stop, across)
            or (
                _moves_elsewhere(view, name, start, stop)
                and (_leaps(view, name, start, stop) or _too_long(view, name, start, stop, across))
            )
        ):
            found[start:stop] = True
    return found


def at_extreme(view: RunView, name: str, stands: Mask) -> Mask:
    """Samples at those values of the stretches `stands` that the run never exceeds: a sensor at the end of its range.

    A sum of motion may stop at its extreme, and zero is where a dead sensor stands. A sensor that died while its signal
    rose stands at its extreme too, but never leaves it; one that froze at a steady level left many samples near it.
    """
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    known = values[np.isfinite(values)]
    if name not in SUMMED and stands.any() and not stands[-1]:
        for end in (known.min(), known.max()):
            at_end = values == end
            others = known[known != end]
            if end != 0.0 and (at_end & stands).any() and others.size > 1:
                usual = max(float(np.median(np.abs(np.diff(others)))), view.resolution[name])
                if np.count_nonzero(np.abs(others - end) < _NEAR * usual) < _FEW * np.count_nonzero(at_end):
                    found |= at_end
    return found


def _repeats(values: Vector) -> Mask:
    """True at each sample that the next one repeats."""
    return np.append(values[1:] == values[:-1], False)


def _moves_elsewhere(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a motor is driven for most of the stretch, or another output (not the battery) is seldom still."""
    if any(np.mean(np.nan_to_num(values[start:stop]) != 0.0) > 0.5 for values in view.inputs.values()):
        return True
    others = [values[start:stop] for other, values in view.outputs.items() if other not in (name, _BATTERY)]
    return any(np.mean(np.diff(values) == 0.0) < 0.5 for values in others if np.isfinite(values).mean() > 0.5)


def _too_long(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether the signal, wherever else it was measured, repeats itself too seldom for such a stretch.

    The quietest tenth of its blocks is not counted, and a wheel that stands is no frozen sensor; nor does a wheel that
    stands or creeps tell how its rate behaves while it turns.
    """
    level = view.outputs[name][start]
    analogue = name.startswith(_ANALOGUE) or (name == "yaw_angle" and level != 0.0)
    if not analogue and (name in SUMMED or level == 0.0) and not across.is_noise(name):
        return False
    elsewhere = [one.outputs[name] for one in across.views if one is not view]
    elsewhere += [view.outputs[name][:start], view.outputs[name][stop:]]
    share, _, samples = _repetition([np.isfinite(values) for values in elsewhere], elsewhere)
    once = np.log(samples) / -np.log(share) if 0.0 < share <= _DITHERS else np.inf  # a stretch to be expected once
    if not analogue and level != 0.0:
        share, longest, _ = _repetition([np.abs(values) >= 0.5 * abs(level) for values in elsewhere], elsewhere)
        once = min(once, float(longest)) if share <= _DITHERS else once
    return bool(stop - start >= max(LEAST_FROZEN, _UNLIKELY * once))


def _repetition(counted: Sequence[Mask], pieces: Sequence[Vector]) -> tuple[float, int, int]:
    """Of the samples counted: the share of repeats in all but the quietest blocks (1 where there is no telling), the
    longest stretch of repeats, and their number."""
    inner = [values[a:b] for mask, values in zip(counted, pieces, strict=True) for a, b in stretches(mask)]
    repeats = np.concatenate([np.diff(values) == 0.0 for values in inner] or [np.zeros(0, dtype=bool)])
    blocks = repeats[: len(repeats) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    edges = np.flatnonzero(np.diff(repeats, prepend=False, append=False))
    longest = 1 + int(np.diff(edges)[::2].max(initial=0))
    if len(blocks) < 2:
        return 1.0, longest, len(repeats)
    return max(float(np.quantile(blocks, _QUIET_BLOCKS)), 1.0 / len(repeats)), longest, len(repeats)


def _leaps(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether the signal leaves the stretch, and met it if it is no sum, by a change that it never else makes."""
    values = view.outputs[name]
    edges = [stop] if name in SUMMED else [start, stop]
    if name.startswith(_ANALOGUE) or not all(0 < edge < len(values) for edge in edges):
        return False
    if any(abs(values[edge] - values[edge - 1]) <= _LEAP * view.resolution[name] for edge in edges):
        return False
    changes = np.abs(np.diff(values))
    others = np.delete(changes, [edge - 1 for edge in (start, stop) if 0 < edge < len(values)])
    others = others[np.isfinite(others)]
    if not others.size:
        return False
    usual = max(float(others.max()), view.resolution[name])
    return all(bool(changes[edge - 1] > _LEAP * usual) for edge in edges)


def _denied_by_rate(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether the measured rate of a sum says that it moved far while it stood."""
    rate = view.outputs.get(RATE_OF.get(name, ""))
    if rate is None:
        return False
    during = rate[start:stop]
    if not np.isfinite(during).any() or np.mean(np.diff(during) == 0.0) > _STALE:
        return False
    moved = np.nan_to_num(during[:-1]) * np.diff(view.time[start:stop])
    way, moves = abs(float(moved.sum())), float(np.abs(moved).sum())
    if way <= _ONE_WAY * moves or way <= _BY_RATE * view.resolution[name]:
        return False
    return bool(abs(float(np.nanmean(during))) > _MOVES * float(np.nanmax(np.abs(rate))))
