"""Finds channels that hold each sample for several rows, because they are logged faster than they are sampled.

A row that only repeats such a sample is no new data. It looks like a sensor that is frozen for a few rows, and makes
the noise look smaller. Inputs are commands: they hold until the next command.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brickpilot.data.audit.view import Held, Mask, Vector

_LEAST_CHANGES = 20
_LEAST_ROWS = 1.5  # mean rows for each sample
_ROW = 1.1  # rows: a change is logged so late at most
_REGULAR = 0.9  # share of changes that are whole beats apart
_STEPS = 2.5  # resolutions: a coarse channel at constant speed also changes at a beat, by one step each time
_TOGETHER = 0.9  # share of the changes of a coarse channel that fall on those of another channel


def held(time: Vector, outputs: Mapping[str, Vector], resolution: Mapping[str, float]) -> dict[str, Held]:
    """Returns the channels of one run that are held, by name.

    A channel is held if its value changes at a common beat of several rows, and by more than one step of its
    resolution. A coarse channel that changes only together with such a channel is held, too. A sample may have the same
    value as the one before it, as at rest. So a beat without a change is a new sample, too.
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
    """Describes the held channels of some runs: `beats`, channel -> s; `row`: s from row to row."""
    where = "all runs" if len(runs) == of else f"run {runs[0]}" if len(runs) == 1 else f"{len(runs)} runs"
    low, high = 1e3 * min(beats.values()), 1e3 * max(beats.values())
    every = f"{low:.3g} ms" if high < 1.1 * low else f"{low:.3g} to {high:.3g} ms"
    return (
        f"{where}: {', '.join(beats)} hold a sample for {every} and are logged every {1e3 * row:.3g} ms; "
        "each sample is used once, in its first row"
    )


def _changes(values: Vector) -> Mask:
    """Returns the rows whose value differs from the last known one; the first known row is one of them."""
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
    beat = float(np.mean(apart[short]))  # each beat is rounded to rows, but their mean is exact
    if beat < _LEAST_ROWS * row:
        return None
    beats = np.maximum(np.round(apart / beat), 1.0)
    if beat < 2 * row and np.mean(beats == 1.0) < _REGULAR:
        return None
    return beat if np.mean(np.abs(apart - beats * beat) <= _ROW * row) > _REGULAR else None


def _grids(beats: Mapping[str, float], changed: Mapping[str, Mask]) -> dict[str, tuple[float, Mask]]:
    """Returns channel -> its beat, and the rows in which it or a channel of the same device changes."""
    found: dict[str, tuple[float, Mask]] = {}
    for name, beat in beats.items():
        device = [other for other in beats if _falls_on(changed[other], changed[name])]
        found[name] = beat, np.logical_or.reduce([changed[other] for other in device])
    return found


def _falls_on(mask: Mask, grid: Mask) -> bool:
    count = int(np.count_nonzero(mask))
    return count >= _LEAST_CHANGES and bool(np.count_nonzero(mask & grid) > _TOGETHER * count)


def _fresh(time: Vector, grid: Mask, beat: float, row: float) -> Mask:
    """Returns the rows of `grid`, and rows at whole beats after one where no row of `grid` is nearer."""
    fresh = grid.copy()
    at = np.append(np.flatnonzero(grid), len(time))
    for start, stop in zip(at[:-1].tolist(), at[1:].tolist(), strict=True):
        last = start
        for later in range(start + 1, stop):
            enough = stop == len(time) or time[stop] - time[later] > beat - _ROW * row
            if time[later] - time[last] > beat - 0.5 * row and enough:
                fresh[later], last = True, later
    return fresh
