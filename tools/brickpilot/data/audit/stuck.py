"""Finds where a signal keeps one value: the signal is clipped or frozen, or each sample is held for some rows.

A channel that is logged faster than it is sampled holds its samples. Rows that repeat a sample hold no new data. They
look like a frozen sensor, and make the noise seem smaller. Inputs are not tested: a command holds until the next
command.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from brickpilot.data.audit.view import LEAST_SAMPLES, Held, Mask, RunView, Vector, driven_by, stretches
from brickpilot.data.signals import RATE_OF, SUMMED

_ANALOGUE = ("accel_", "yaw_rate", "current", "force", "battery")  # these repeat values only if they are coarse
_LEAST_CLIPPED = 8  # least number of samples at a clipped extreme
_CLIPPED_BEYOND = 5.0  # least ratio of how often a clipped extreme occurs to how often any other value occurs
_EDGE_STEPS = 3.0  # in resolutions: least jump to and from a plateau
_DITHERS = 0.6  # largest share of repeats in a signal whose noise is at least half a resolution
_BLOCK = 50  # number of samples from which one share of repeats is computed
_QUIET_BLOCKS = 0.9  # quantile of the blocks' shares of repeats: the tenth of blocks with most repeats is ignored
_UNLIKELY = 4.0  # a frozen stretch is at least this many times as long as the longest expected constant stretch
_LEAP = 8.0  # least ratio of the jump at a frozen stretch's end to the signal's largest other change
_NEAR = 4.0  # in usual changes between samples: a sample that is closer to an extreme counts as near it
_FEW = 0.2  # (samples near an extreme) / (samples at the extreme): above this, the sensor froze in steady motion
_STALE = 0.75  # a sensor's other channel is evidence if this share or more is known, and this share or less repeats
_FAR = 0.25  # share of the stated range: a value farther outside counts as far beyond the range
_NOW_AND_THEN = 0.02  # share of samples far beyond the range: if it is larger, clipping is not the cause
_BATTERY = "battery_voltage"
_GROWS = 1.25  # a shaft starts if (second speed / first speed) is larger than this
_STARTS = 0.2  # share of the fastest speed: a slower shaft may begin or end a standstill
_OFF_RATE = 0.1  # share of the fastest motion: allowed difference between a rate and the growth of its angle or travel
_RATE_STEPS = 3.0  # in resolutions: allowed error of a difference of two samples
_DRIVEN = 0.5  # share of the usual drive: with a stronger drive, a constant angle or travel is frozen
_PACE_S, _PACE_SAMPLES = 0.03, 10  # least length, in s and in samples, of a part from which a rate is computed
_STEADY = 0.3  # largest change of a steady rate or drive, as a share of the largest rate or drive
_FAST = 0.3  # share of the fastest motion: a faster motion cannot stop within one sample
_MOTION = ("wheel_", "yaw_", "angle", "speed", "position", "velocity")
_REVERSES = 0.3  # a signal shows noise if it changes direction at a larger share of the samples
_REPEATED = 0.02  # largest share of repeats of a channel that changes with every sample


class AcrossRuns:
    """How the channels behave in all runs together.

    Attributes:
        views: the views of all runs.
        noise: the channels that change direction so often that noise must be the cause.
        fastest: motion channel -> its largest mean rate over one fortieth of a run.
        usual_drive: sum (angle or travel) -> mean size of its drive while the sum moves; 0: not known, because values
            repeat in motion, too.
    """

    def __init__(self, views: Sequence[RunView]) -> None:
        self.views = views
        names = views[0].outputs if views else {}
        changes = {name: np.concatenate([np.diff(one.outputs[name]) for one in views]) for name in names}
        turns = {name: np.count_nonzero(each[1:] * each[:-1] < 0.0) for name, each in changes.items()}
        self.noise = {name for name, count in turns.items() if count > _REVERSES * max(len(changes[name]) - 1, 0)}
        moving = [name for name in names if name.startswith(_MOTION)]
        self.fastest = {name: max(_fastest(one, name) for one in views) for name in moving}
        self.usual_drive = {name: self._drive_while_moving(name) for name in names if name in SUMMED}

    def _drive_while_moving(self, name: str) -> float:
        """Returns the entry of `usual_drive` for one sum. Long constant stretches do not count as motion."""
        repeats = samples = 0
        level = 0.0
        for one in self.views:
            same = _repeats(one.outputs[name])
            outside = np.isfinite(one.outputs[name])
            for first, last in stretches(same, LEAST_SAMPLES - 1):
                same[first:last] = False
                outside[first : last + 1] = False
            repeats += int(np.count_nonzero(same))
            samples += int(np.count_nonzero(outside))
            level += float(np.sum(np.abs(one.drives[driven_by(name)][outside])))
        return level / samples if samples >= LEAST_SAMPLES and repeats <= _REPEATED * samples else 0.0


def clipped(view: RunView, name: str, stated: tuple[float, float] | None) -> Mask:
    """Finds two or more samples in a row at an end of the stated range; without a range, a plateau at an extreme.

    An end at 0 does not count, because an unsigned sensor rests there. A channel whose values are often far beyond the
    range is not clipped, but may be in another unit.
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
    """Finds samples at the highest value, if this value is by far the most frequent and jumps lead to and from it."""
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
    bottom = others.min()  # the opposite end of the range, which may be as frequent
    between = others[others != bottom] if bottom != 0.0 else others
    most = int(np.unique(between, return_counts=True)[1].max(initial=0))
    repeated = np.diff(others) == 0.0
    edges = [near for start, stop in stretches(at_top) for near in (start - 1, stop) if 0 <= near < len(values)]
    leaps = [top - values[near] for near in edges if np.isfinite(values[near])]
    changes = np.abs(np.diff(others))
    sharp = bool(leaps) and np.median(leaps) > max(_EDGE_STEPS * resolution, 0.2 * float(np.median(changes)))
    return at_top if count > _CLIPPED_BEYOND * most and repeated.mean() <= _DITHERS and sharp else none


def frozen(view: RunView, name: str, across: AcrossRuns) -> tuple[Mask, Mask]:
    """Finds frozen stretches: stretches of one value that noise, drive, other channels or a jump at the end contradict.

    Returns the frozen samples, and the samples that are not frozen but clipped.
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
            _contradicts_partner(view, name, start, stop, across)
            or _never_stands(view, name, start, stop, across)
            or _stops_alone(view, name, start, stop, across)
            or (
                _moves_elsewhere(view, name, start, stop)
                and (_jumps(view, name, start, stop) or _too_long(view, name, start, stop, across))
            )
        ):
            found[start:stop] = True
    at_end = _at_extreme(view, name, found)
    return found & ~at_end, at_end


def _stands(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a rate is zero, and near zero just before and after, because its shaft stands.

    An encoder's speed has no noise at standstill. At the start of a run the first speed after zero may be large if the
    second speed is larger still: the shaft starts. In contrast, a sensor that starts late jumps to the present
    speed and stays there.
    """
    values = view.outputs[name]
    if name not in RATE_OF.values() or values[start] != 0.0:
        return False
    if start == 0 and stop + 1 < len(values) and values[stop + 1] / values[stop] > _GROWS:
        return True
    around = [abs(values[at]) for at in (start - 1, stop) if 0 <= at < len(values) and np.isfinite(values[at])]
    return bool(around) and max(around) < _STARTS * float(np.nanmax(np.abs(values)))


def _at_extreme(view: RunView, name: str, stands: Mask) -> Mask:
    """Finds samples at an extreme value of the run, if `stands` has samples there: the sensor's range ends.

    Four cases are excluded: an angle or travel, which may stop at its extreme; zero, the value of a dead sensor; a
    stretch up to the run's end, as after a sensor failure; and an extreme with many samples near it, as after a freeze
    in steady motion.
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
    """Returns (n,): whether the next sample has the same value."""
    return np.append(values[1:] == values[:-1], False)


def _moves_elsewhere(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether a motor is driven in most of the stretch, or another output (not the battery) changes in most of it."""
    if any(np.mean(np.nan_to_num(values[start:stop]) != 0.0) > 0.5 for values in view.inputs.values()):
        return True
    others = [values[start:stop] for other, values in view.outputs.items() if other not in (name, _BATTERY)]
    return any(np.mean(np.diff(values) == 0.0) < 0.5 for values in others if np.isfinite(values).mean() > 0.5)


def _too_long(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether the stretch is too long for a signal that seldom repeats values outside the stretch.

    The channel of a standing wheel does not count as frozen. A moving wheel's stretch is compared a second time,
    with samples of at least half its speed, because a standing or creeping wheel repeats values more often.
    """
    level = view.outputs[name][start]
    analogue = name.startswith(_ANALOGUE) or (name == "yaw_angle" and level != 0.0)
    if not analogue and (name in SUMMED or level == 0.0) and name not in across.noise:
        return False
    elsewhere = [one.once(name) for one in across.views if one is not view]
    elsewhere += [view.once(name, slice(0, start)), view.once(name, slice(stop, None))]
    once = _expected_once(elsewhere, 0.0)
    if not analogue and level != 0.0:
        once = min(once, _expected_once(elsewhere, 0.5 * abs(level)))
    return bool(len(view.once(name, slice(start, stop))) >= max(LEAST_SAMPLES, _UNLIKELY * once))


def _expected_once(pieces: Sequence[Vector], least: float) -> float:
    """Returns the longest constant stretch that chance explains, in samples; infinite: values repeat too often.

    `least`: only values of this size or more count. If `least` is above 0, the longest stretch found is returned
    instead of the expected length, because a wheel may turn slowly for a while.
    """
    inner = [values[a:b] for values in pieces for a, b in stretches(np.abs(values) >= least)]
    repeats = np.concatenate([np.diff(values) == 0.0 for values in inner] or [np.zeros(0, dtype=bool)])
    blocks = repeats[: len(repeats) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    share = max(float(np.quantile(blocks, _QUIET_BLOCKS)), 1.0 / len(repeats)) if len(blocks) > 1 else 1.0
    if share > _DITHERS:
        return np.inf
    longest = 1 + max((stop - start for start, stop in stretches(repeats)), default=0)
    return float(longest if least > 0.0 else np.log(len(repeats)) / -np.log(share))


def _jumps(view: RunView, name: str, start: int, stop: int) -> bool:
    """Whether the change at the stretch's end is by far the run's largest; for a rate, also the change at its start."""
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


def _contradicts_partner(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether the same sensor's other channel (sum or rate) shows another motion in one half of the stretch."""
    partners = {**RATE_OF, **{rate: sums for sums, rate in RATE_OF.items()}}
    partner = partners.get(name, "")
    values = view.outputs.get(partner, np.full_like(view.time, np.nan))
    known = start + np.flatnonzero(np.isfinite(values[start:stop]))
    if len(known) < _STALE * (stop - start) or np.mean(np.diff(values[known]) == 0.0) > _STALE:
        return False
    own = 0.0 if name in SUMMED else view.outputs[name][start]
    step = view.resolution[name if name in SUMMED else partner]
    for first, last in pairwise(known[[0, len(known) // 2, -1]].tolist()):
        away = abs(_pace(view, partner, slice(first, last + 1)) - own)
        if away > _OFF_RATE * across.fastest[partner] + _RATE_STEPS * step / (view.time[last] - view.time[first]):
            return True
    return False


def _never_stands(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether an angle or travel stands although it is driven in both directions about as strongly as in motion.

    A machine that is driven in one direction only may be at its end stop. A yaw angle has no end stop, so for it one
    direction is enough.
    """
    usual = across.usual_drive.get(name) if name in SUMMED else None
    if not usual:
        return False
    during = view.drives[driven_by(name)][start:stop]
    levels = [float(np.mean(one)) if one.size else 0.0 for one in (during[during > 0.0], -during[during < 0.0])]
    return (max(levels) if name == "yaw_angle" else min(levels)) > _DRIVEN * usual


def _stops_alone(view: RunView, name: str, start: int, stop: int, across: AcrossRuns) -> bool:
    """Whether an angle or travel stops within one sample while its drive and the other channels continue."""
    reach = max(_PACE_SAMPLES, int(_PACE_S / view.interval))
    if name not in SUMMED or start < reach or stop - start < 2 * reach:
        return False
    before, after = slice(start - reach, start + 1), slice(start + reach, start + 2 * reach + 1)
    moving = np.count_nonzero(np.diff(view.outputs[name][before])) >= reach // 2
    if not moving or abs(_pace(view, name, before)) < _FAST * across.fastest[name]:
        return False
    if any(
        np.ptp(drive[before.start : after.stop]) > _STEADY * np.max(np.abs(drive)) for drive in view.drives.values()
    ):
        return False
    changes: list[float] = []
    for other, fastest in across.fastest.items():
        if other != name and fastest > 0.0:
            was, now = (_pace(view, other, part) / fastest for part in (before, after))
            if abs(was) > _FAST and np.isfinite(now):
                changes.append(abs(now - was))
    return bool(changes) and max(changes) < _STEADY


def _pace(view: RunView, name: str, part: slice = slice(None)) -> float:
    """Returns the mean rate of a channel over a part of the run; for an angle or travel, its growth per time."""
    values, time = view.outputs[name][part], view.time[part]
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return np.nan
    if name not in SUMMED:
        return float(np.mean(values[known]))
    return float((values[known[-1]] - values[known[0]]) / (time[known[-1]] - time[known[0]]))


def _fastest(view: RunView, name: str) -> float:
    """Returns the largest mean rate over a fortieth of the run."""
    edges = np.linspace(0, len(view.time), 41).astype(int)
    paces = [_pace(view, name, slice(one, other + 1)) for one, other in pairwise(edges.tolist())]
    return float(np.nanmax(np.abs(paces), initial=0.0))


_LEAST_CHANGES = 20
_LEAST_ROWS = 1.5  # least mean number of rows for each sample
_ROW = 1.1  # in rows: the largest delay with which a change is logged
_REGULAR = 0.9  # more than this share of the changes has to be whole beats (sampling periods) apart
_STEPS = 2.5  # in resolutions: smaller changes give no beat, because a coarse channel steps regularly at constant speed
_TOGETHER = 0.9  # a larger share of a coarse channel's changes has to be in rows where another channel changes


def held(time: Vector, outputs: Mapping[str, Vector], resolution: Mapping[str, float]) -> dict[str, Held]:
    """Returns channel -> `Held`, for the channels of one run that hold their samples.

    A channel is held if its value changes at a regular beat of several rows, and by more than one step of its
    resolution. A coarse channel that changes only together with a held channel is held, too. At rest, two samples may
    be equal, so a beat without a change still counts as a new sample.
    """
    row = float(np.median(np.diff(time)))
    changed = {name: _changes(values) for name, values in outputs.items()}
    rows = {name: _row(time, values) for name, values in outputs.items()}
    beats = {
        name: beat
        for name, mask in changed.items()
        if (beat := _beat(time, mask, rows[name])) is not None
        and _steps(outputs[name], mask) > _STEPS * resolution[name]
    }
    grids = _grids(beats, changed)
    found: dict[str, Held] = {}
    for name, mask in changed.items():
        if name in beats:
            beat, grid = grids[name]
        else:
            others = [one for one in grids.values() if _falls_on(mask, one[1])]
            if not others:
                continue
            beat, grid = others[0]
        found[name] = Held(beat, _fresh(time, grid, beat, row))
    return found


def _row(time: Vector, values: Vector) -> float:
    """Returns the time between two rows in which a channel has a value; blank cells do not count."""
    known = time[np.isfinite(values)]
    return float(np.median(np.diff(known if len(known) > 1 else time)))


def held_note(runs: Sequence[str], of: int, beats: Mapping[str, float], row: float) -> str:
    """Describes the held channels of some runs. `beats`: channel -> time between samples, s; `row`: between rows, s."""
    where = "all runs" if len(runs) == of else f"run {runs[0]}" if len(runs) == 1 else f"{len(runs)} runs"
    low, high = 1e3 * min(beats.values()), 1e3 * max(beats.values())
    every = f"{low:.3g} ms" if high < 1.1 * low else f"{low:.3g} to {high:.3g} ms"
    return (
        f"{where}: {', '.join(beats)} hold a sample for {every} and are logged every {1e3 * row:.3g} ms; "
        "each sample is used once, in its first row"
    )


def _changes(values: Vector) -> Mask:
    """Returns the rows whose value differs from the last known value; the first known row counts as changed."""
    mask = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    mask[known] = np.diff(values[known], prepend=np.nan) != 0.0
    return mask


def _steps(values: Vector, changed: Mask) -> float:
    """Returns the median size of the changes."""
    return float(np.median(np.abs(np.diff(values[changed]))))


def _beat(time: Vector, changed: Mask, row: float) -> float | None:
    """Returns the time between two changes, if it is the same in the whole run and longer than a row; else None."""
    at = np.flatnonzero(changed)
    if len(at) < _LEAST_CHANGES:
        return None
    apart = np.diff(time[at])
    short = apart <= 1.5 * float(np.median(apart))
    beat = float(np.mean(apart[short]))  # each beat is rounded to whole rows, but the mean of all beats is not
    if beat < _LEAST_ROWS * row:
        return None
    beats = np.maximum(np.round(apart / beat), 1.0)
    if beat < 2 * row and np.mean(beats == 1.0) < _REGULAR:
        return None
    return beat if np.mean(np.abs(apart - beats * beat) <= _ROW * row) > _REGULAR else None


def _grids(beats: Mapping[str, float], changed: Mapping[str, Mask]) -> dict[str, tuple[float, Mask]]:
    """Returns channel -> its beat, and the rows in which this or another channel of the same device changes."""
    found: dict[str, tuple[float, Mask]] = {}
    for name, beat in beats.items():
        device = [other for other in beats if _falls_on(changed[other], changed[name])]
        found[name] = beat, np.logical_or.reduce([changed[other] for other in device])
    return found


def _falls_on(mask: Mask, grid: Mask) -> bool:
    count = int(np.count_nonzero(mask))
    return count >= _LEAST_CHANGES and bool(np.count_nonzero(mask & grid) > _TOGETHER * count)


def _fresh(time: Vector, grid: Mask, beat: float, row: float) -> Mask:
    """Returns the rows of `grid`, and the rows at whole beats between rows of `grid` that are far apart."""
    fresh = grid.copy()
    at = np.append(np.flatnonzero(grid), len(time))
    for start, stop in zip(at[:-1].tolist(), at[1:].tolist(), strict=True):
        last = start
        for later in range(start + 1, stop):
            enough = stop == len(time) or time[stop] - time[later] > beat - _ROW * row
            if time[later] - time[last] > beat - 0.5 * row and enough:
                fresh[later], last = True, later
    return fresh
