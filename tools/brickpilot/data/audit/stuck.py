"""Finds stretches in which a signal wrongly keeps one value: clipped at the end of its range, or frozen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.data.audit.view import LEAST_SAMPLES, AcrossRuns, Mask, RunView, Vector, driven_by, stretches
from brickpilot.data.signals import RATE_OF, SUMMED

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
_OFF_RATE = 0.1  # of the fastest: allowed difference of a constant rate from the growth of its sum
_RATE_STEPS = 3.0  # resolutions of a difference of two samples
_DRIVEN = 0.5  # of the usual drive
_PACE_S, _PACE_SAMPLES = 0.03, 10
_STEADY = 0.3  # change of pace, over the fastest
_FAST = 0.3  # of the fastest: a motion of this speed does not stop within one sample
_HARDER = 1.3  # times the drive at which it moved in another run
_NEARLY = 0.6  # times that drive: sufficient where the other side moved


def clipped(view: RunView, name: str, stated: tuple[float, float] | None) -> Mask:
    """Finds two or more samples in a row at an end of the stated range; without a range, a plateau at an extreme.

    If an end is 0, an unsigned sensor rests there, which is no sign of clipping. A channel beyond its range may be in
    another unit, and is not clipped.
    """
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    if leaves(values, stated):
        return found
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
    if len(known) < LEAST_SAMPLES or known.max() == 0.0:
        return none
    top = known.max()
    at_top = values >= top - 1e-5 * max(float(np.ptp(known)), abs(top))
    count = int(np.count_nonzero(at_top))
    others = values[~at_top & np.isfinite(values)]
    if count < _LEAST_CLIPPED or len(others) < LEAST_SAMPLES:
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


def frozen(view: RunView, name: str, across: AcrossRuns) -> tuple[Mask, Mask]:
    """Finds stretches of one value that cannot be real by the signal's noise, its rate or a jump at the end.

    Returns the frozen samples, and those that are clipped instead.
    """
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    samples = np.zeros(len(values), dtype=bool)
    samples[view.sampled(name)] = True
    for start, last in stretches(_repeats(values), LEAST_SAMPLES - 1):
        stop = last + 1
        if np.count_nonzero(samples[start:stop]) < LEAST_SAMPLES or _stands(view, name, start, stop):
            continue
        if (
            _contradicts_rate(view, name, start, stop)
            or _cannot_stand(view, name, start, stop, across)
            or (
                _moves_elsewhere(view, name, start, stop)
                and (_jumps(view, name, start, stop) or _too_long(view, name, start, stop, across))
            )
        ):
            found[start:stop] = True
    at_end = _at_extreme(view, name, found)
    return found & ~at_end, at_end


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


def _at_extreme(view: RunView, name: str, stands: Mask) -> Mask:
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
    return bool(len(view.once(name, slice(start, stop))) >= max(LEAST_SAMPLES, _UNLIKELY * once))


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


def _cannot_stand(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
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
    return bool(np.any(away > _OFF_RATE * fastest + _RATE_STEPS * view.resolution[of] / spans))


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
    return bool(known.size and np.count_nonzero(np.diff(known)) > LEAST_SAMPLES)


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
