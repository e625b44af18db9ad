"""How far two repeats of the same inputs differ: no model can be better than that, as it gives the same for both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run
from brickpilot.fit.replay import Replay

Array = NDArray[np.float64]

_SAME_SHARE = 0.05  # rms of the inputs' difference over that of the inputs: up to this they are the same
_LEAST_S, _LEAST_SHARE = 0.5, 0.5  # a repeat is at least so long, and as long as this share of the shorter run
_GRID_S = 0.02


@dataclass(frozen=True)
class Repeat:
    """Two runs that got the same inputs for `seconds` from their first sample on."""

    first: str
    second: str
    seconds: float


def repeats(dataset: Dataset) -> tuple[Repeat, ...]:
    """Returns the pairs of runs that begin with the same inputs: replicates, and runs that came out as such."""
    inputs = Replay(dataset).inputs
    found = []
    for one, other in combinations(dataset.runs, 2):
        seconds = _same_for(one, other, inputs)
        shorter = min(float(run.time[-1] - run.time[0]) for run in (one, other))
        if seconds >= max(_LEAST_S, _LEAST_SHARE * shorter):
            found.append(Repeat(one.name, other.name, seconds))
    return tuple(found)


def half_difference(repeat: Repeat, dataset: Dataset, errors: Mapping[str, Array]) -> tuple[float, int]:
    """Returns half the sum of squared differences between two repeats, and the number of samples.

    Two repeats differ by twice the variance of one. The nominal model's errors (run -> (n,)) are compared and not the
    signals, so that what little the inputs and the start states differ is allowed for.
    """
    runs = {run.name: run for run in dataset.runs}
    one, other = runs[repeat.first], runs[repeat.second]
    clock = one.time - one.time[0]
    known = np.isfinite(errors[other.name])
    if known.sum() < 2:
        return 0.0, 0
    there = np.interp(clock, (other.time - other.time[0])[known], errors[other.name][known])
    apart = (errors[one.name] - there)[clock <= repeat.seconds]
    apart = apart[np.isfinite(apart)]
    return float(apart @ apart) / 2, len(apart)


def _same_for(one: Run, other: Run, inputs: Mapping[str, Array]) -> float:
    """Returns for how many s two runs got the same inputs, from their start on."""
    grid = np.arange(0.0, min(float(run.time[-1] - run.time[0]) for run in (one, other)), _GRID_S)
    given = []
    for run in (one, other):
        held = np.searchsorted(run.time - run.time[0], grid + 1e-9, side="right") - 1
        given.append(inputs[run.name][held])
    if len(grid) == 0 or not np.array_equal(np.isnan(given[0]), np.isnan(given[1])):
        return 0.0
    first, second = (np.nan_to_num(values) for values in given)
    apart = np.cumsum(np.sum((first - second) ** 2, axis=1))
    size = np.cumsum(np.sum(first**2 + second**2, axis=1) / 2)
    same = (apart <= _SAME_SHARE**2 * size) & (size > 0)
    return float(grid[np.flatnonzero(same)[-1]]) if same.any() else 0.0
