"""Thins the samples of all runs out to rows: means over short bins of time that never reach from window to window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.fit.horizons import Stretch, Track

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_BIN_S = 0.04  # a fifth of the shortest horizon
_MOST_ROWS = 4000  # a black box learns in a second from so many; longer bins thin long runs out
_LONGEST_BIN_S = 0.2


@dataclass(frozen=True)
class Rows:
    """The rows of all runs, one run after the other.

    Attributes:
        run: (rows,) number of the run.
        time: (rows,) s since the run's first sample.
        edges: (rows,) the first sample of each row, in the samples of all runs one after the other.
        count: (rows,) samples in it.
    """

    run: Indices
    time: Array
    edges: Indices
    count: Indices

    def mean(self, samples: Array) -> Array:
        """Returns (rows,) the mean of `samples` (all samples,) over each row; NaN where none is known."""
        known = np.isfinite(samples)
        number = np.add.reduceat(known.astype(np.float64), self.edges)
        total = np.add.reduceat(np.where(known, samples, 0.0), self.edges)
        return np.where(number > 0, total / np.maximum(number, 1.0), np.nan)

    def total(self, samples: Array) -> Array:
        """Returns (rows,) the sum of the known `samples` (all samples,) over each row."""
        return np.asarray(np.add.reduceat(np.nan_to_num(samples), self.edges))


def rows(track: Track) -> Rows:
    """Returns the rows of the runs of `track`, the same for all its horizons."""
    finest = track.courses[-1].stretches
    seconds = sum(float(one.run.time[-1] - one.run.time[0]) for one in finest)
    width = min(_BIN_S * max(1, int(np.ceil(seconds / _MOST_ROWS / _BIN_S))), _LONGEST_BIN_S)
    number, time, edges, base = [], [], [], 0
    for index, one in enumerate(finest):
        key = np.maximum(np.ceil(one.since_start / width - 1e-6), 1.0) + one.start * 1e6
        first = np.flatnonzero(np.diff(key, prepend=-1.0))
        number.append(np.full(len(first), index))
        edges.append(base + first)
        clock = one.run.time - one.run.time[0]
        time.append(np.add.reduceat(clock, first) / np.diff(first, append=len(clock)))
        base += len(clock)
    starts = np.concatenate(edges)
    return Rows(np.concatenate(number), np.concatenate(time), starts, np.diff(starts, append=base))


def stacked(stretches: tuple[Stretch, ...], values: Callable[[Stretch], Array]) -> Array:
    """Returns (all samples,) the `values` (n,) of each run one after the other."""
    return np.concatenate([values(one) for one in stretches])
