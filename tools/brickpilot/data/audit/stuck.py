"""Finds stretches in which a signal wrongly keeps one value: clipped at the end of its range, or frozen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit import standstill
from brickpilot.data.audit.view import LEAST_FROZEN, AcrossRuns, RunView, stretches
from brickpilot.data.signals import RATE_OF, SUMMED

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ANALOGUE = ("accel_", "yaw_rate", "current", "force", "battery")  # constant only where the resolution is coarse
_LEAST_CLIPPED = 8  # samples at a run's extreme
_CLIPPED_BEYOND = 5.0  # times as often as any other value: the count of the extreme, if clipped
_EDGE_STEPS = 3.0  # resolutions: the least jump to and from a plateau
_DITHERS = 0.6  # largest share of repeats of a signal with noise of half a resolution or more
_BLOCK = 50  # samples
_QUIET_BLOCKS = 0.9  # quantile of that share over blocks: the quietest tenth is not counted
_UNLIKELY = 4.0  # times the stretch that is expected once, or the longest elsewhere
_LEAP = 8.0  # times the largest other change: the jump of a sum when a frozen sensor recovers
_BY_RATE = 10.0  # resolutions: least motion, from the measured rate, of a sum that stands
_ONE_WAY = 0.8  # of the path: least displacement of a motion; noise has less
_MOVES = 0.1  # of the largest rate: more than the offset of a rate at rest
_NEAR = 4.0  # of the usual change from sample to sample
_FEW = 0.2  # of the samples at an extreme
_STALE = 0.75  # share of repeats from which a rate stands itself and is no evidence
_FAR = 0.25  # of the range, beyond its ends
_NOW_AND_THEN = 0.02  # share of samples
_BATTERY = "battery_voltage"
_GROWS = 1.25  # the second speed of a shaft that starts, over its first
_STARTS = 0.2  # of its fastest: the first speed that a shaft shows after it stood


def clipped(view: RunView, name: str, stated: tuple[float, float] | None) -> Mask:
    """Finds two or more samples in a row at an end of the stated range; without a range, a plateau at an extreme.

    If an end is 0, an unsigned sensor rests there, which is no sign of clipping.
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
    """Whether a channel is often far beyond its stated range, which clipping cannot cause."""
    known = values[np.isfinite(values)]
    if stated is None or not known.size:
        return False
    far = _FAR * (stated[1] - stated[0])
    return bool(np.mean((known > stated[1] + far) | (known < stated[0] - far)) > _NOW_AND_THEN)


def _plateau(values: Vector, resolution: float) -> Mask:
    """Finds samples at the highest value, if it is by far the most frequent and is reached and left by jumps."""
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
    bottom = others.min()  # the other end of the range, which may be as frequent
    between = others[others != bottom] if bottom != 0.0 else others
    most = int(np.unique(between, return_counts=True)[1].max(initial=0))
    repeated = np.diff(others) == 0.0
    edges = [near for start, stop in stretches(at_top) for near in (start - 1, stop) if 0 <= near < len(values)]
    leaps = [top - values[near] for near in edges if np.isfinite(values[near])]
    changes = np.abs(np.diff(others))
    sharp = bool(leaps) and np.median(leaps) > max(_EDGE_STEPS * resolution, 0.2 * float(np.median(changes)))
    return at_top if count > _CLIPPED_BEYOND * most and repeated.mean() <= _DITHERS and sharp else none


def frozen(view: RunView, name: str, across: AcrossRuns) -> Mask:
    """Finds stretches of one value that cannot be real by the signal's noise, its rate or a jump at the end."""
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    samples = np.zeros(len(values), dtype=bool)
    samples[view.sampled(name)] = True
    for start, last in stretches(_repeats(values), LEAST_FROZEN - 1):
        stop = last + 1
        if np.count_nonzero(samples[start:stop]) < LEAST_FROZEN or _stands(view, name, start, stop):
            continue
        if (
            _contradicts_rate(view, name, start, stop)
            or standstill.is_frozen(view, name, start, stop, across)
            or (
                _moves_elsewhere(view, name, start, stop)
                and (_jumps(view, name, start, stop) or _too_long(view, name, start, stop, across))
            )
        ):
            found[start:stop] = True
    return found


def _stands(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a rate is zero, and near zero just before and after, as for a shaft that stands.

    The speed of an encoder has no noise there, even if it has much in motion. If a run begins at zero, its first speed
    may be large if it then keeps growing: a sensor that starts late shows the speed that it missed, and stays there.
    """
    values = view.outputs[name]
    if name not in RATE_OF.values() or values[start] != 0.0:
        return False
    if start == 0 and stop + 1 < len(values) and values[stop + 1] / values[stop] > _GROWS:
        return True
    around = [abs(values[at]) for at in (start - 1, stop) if 0 <= at < len(values) and np.isfinite(values[at])]
    return bool(around) and max(around) < _STARTS * float(np.nanmax(np.abs(values)))


def at_extreme(view: RunView, name: str, stands: Mask) -> Mask:
    """Finds samples at an extreme of the run among the stretches `stands`: the sensor is at the end of its range.

    Three cases are excluded. A sum may stop at its extreme, and a dead sensor gives zero. A sensor that failed while
    its signal rose also stands at the extreme, but never leaves it. A sensor that froze at a steady level has many
    samples near this level.
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
    """Returns True at each sample that the next one repeats."""
    return np.append(values[1:] == values[:-1], False)


def _moves_elsewhere(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a motor is driven for most of the stretch, or another output (not the battery) mostly changes."""
    if any(np.mean(np.nan_to_num(values[start:stop]) != 0.0) > 0.5 for values in view.inputs.values()):
        return True
    others = [values[start:stop] for other, values in view.outputs.items() if other not in (name, _BATTERY)]
    return any(np.mean(np.diff(values) == 0.0) < 0.5 for values in others if np.isfinite(values).mean() > 0.5)


def _too_long(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether the signal repeats values too rarely elsewhere for a stretch of this length.

    A wheel that stands is no frozen sensor. How often a standing or creeping wheel repeats values says nothing about a
    turning one.
    """
    level = view.outputs[name][start]
    analogue = name.startswith(_ANALOGUE) or (name == "yaw_angle" and level != 0.0)
    if not analogue and (name in SUMMED or level == 0.0) and not across.is_noise(name):
        return False
    elsewhere = [one.once(name) for one in across.views if one is not view]
    elsewhere += [view.once(name, slice(0, start)), view.once(name, slice(stop, None))]
    usual = _repetition([np.isfinite(values) for values in elsewhere], elsewhere)
    # `once`: the length of a stretch that is expected once
    once = np.log(usual.samples) / -np.log(usual.share) if 0.0 < usual.share <= _DITHERS else np.inf
    if not analogue and level != 0.0:
        turning = _repetition([np.abs(values) >= 0.5 * abs(level) for values in elsewhere], elsewhere)
        once = min(once, float(turning.longest)) if turning.share <= _DITHERS else once
    return bool(len(view.once(name, slice(start, stop))) >= max(LEAST_FROZEN, _UNLIKELY * once))


@dataclass(frozen=True)
class _Repetition:
    """How often a signal repeats a value.

    Attributes:
        share: of repeats in all but the quietest blocks; 1: there are too few blocks.
        longest: samples in the longest stretch of one value.
        samples: how many changes were counted.
    """

    share: float
    longest: int
    samples: int


def _repetition(counted: Sequence[Mask], pieces: Sequence[Vector]) -> _Repetition:
    """Counts the repeats in `pieces`, where `counted` is true."""
    inner = [values[a:b] for mask, values in zip(counted, pieces, strict=True) for a, b in stretches(mask)]
    repeats = np.concatenate([np.diff(values) == 0.0 for values in inner] or [np.zeros(0, dtype=bool)])
    blocks = repeats[: len(repeats) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    edges = np.flatnonzero(np.diff(repeats, prepend=False, append=False))
    longest = 1 + int(np.diff(edges)[::2].max(initial=0))
    if len(blocks) < 2:
        return _Repetition(1.0, longest, len(repeats))
    share = max(float(np.quantile(blocks, _QUIET_BLOCKS)), 1.0 / len(repeats))
    return _Repetition(share, longest, len(repeats))


def _jumps(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether the change at the end of the stretch is the signal's largest; at the start, too, unless it is a sum."""
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


def _contradicts_rate(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a sum stands although its measured rate shows that it moved far."""
    rate = view.outputs.get(RATE_OF.get(name, ""))
    if rate is None:
        return False
    during = rate[start:stop]
    if not np.isfinite(during).any() or np.mean(np.diff(during) == 0.0) > _STALE:
        return False
    moved = np.nan_to_num(during[:-1]) * np.diff(view.time[start:stop])
    displacement, path = abs(float(moved.sum())), float(np.abs(moved).sum())
    if displacement <= _ONE_WAY * path or displacement <= _BY_RATE * view.resolution[name]:
        return False
    return bool(abs(float(np.nanmean(during))) > _MOVES * float(np.nanmax(np.abs(rate))))
