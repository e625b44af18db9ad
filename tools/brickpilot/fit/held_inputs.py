"""Inputs that hold from sample to sample: their means over other steps of time, and the same inputs some time later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def mean_over_steps(time: Array, driven: Array, grid: Array) -> Array:
    """Returns (grid, columns): the mean of each input over each step of the grid. Inputs hold from sample to sample.

    Args:
        time: (n,) s, when each row of `driven` begins to act; what acts before it is 0.
        driven: (n, columns) V; NaN: the motor floats.
        grid: (m,) s. Its last row is the last input.
    """
    held = np.where(np.isnan(driven), 0.0, driven)
    summed = np.vstack([np.zeros(driven.shape[1]), np.cumsum(held[:-1] * np.diff(time)[:, np.newaxis], axis=0)])
    at_grid = np.column_stack([np.interp(grid, time, column) for column in summed.T])
    means = np.vstack([np.diff(at_grid, axis=0) / np.diff(grid)[:, np.newaxis], held[-1]])
    floats = np.isnan(driven[np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)])
    means[floats] = np.nan
    return means


def later(time: Array, driven: Array, delay_s: float) -> Array:
    """Returns (n, columns): inputs that act `delay_s` s later, or earlier below 0, at the same samples.

    Before the first input arrives, 0 V act; the last one holds.
    """
    beyond = max(float(time[-1]), float(time[-1]) + delay_s) + 1.0
    arrives = np.append(time + delay_s, beyond)
    held = np.vstack([driven, driven[-1]])
    return mean_over_steps(arrives, held, np.append(time, beyond))[:-1]


def held_back(time: Array, driven: Array, held_s: float) -> Array:
    """Returns (n, columns): inputs that are 0 V in the first `held_s` s of the run; later ones act in time."""
    steps = np.diff(time, append=2 * time[-1] - time[-2])
    missing = np.clip((held_s - (time - time[0])) / steps, 0.0, 1.0)[:, np.newaxis]
    return np.where(missing >= 1, 0.0, (1 - missing) * driven)
