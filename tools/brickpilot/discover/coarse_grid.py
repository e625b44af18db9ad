"""The coarse time grid on which a search simulates: three times as fast as the measured samples, and near enough."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import STEP_S
from brickpilot.data.dataset import Dataset
from brickpilot.discover.gates import BIN_S
from brickpilot.fit.blocks import Bins
from brickpilot.fit.replay import Replay

Array = NDArray[np.float64]

_STEPS_PER_BIN = 3


def on_coarse_grid(dataset: Dataset) -> tuple[Replay, Bins]:
    """Returns the runs on a coarse grid, and bins that compare its simulation with means of the measured samples."""
    full = Replay(dataset)
    step = BIN_S / _STEPS_PER_BIN
    runs, grids, means, inputs = [], {}, {}, {}
    for run in dataset.runs:
        own = float(np.median(np.diff(run.time)))
        if own > step / 1.5:
            runs.append(run)
            inputs[run.name] = full.inputs[run.name]
            continue
        grid = np.append(np.arange(run.time[0], run.time[-1] - step / 2, step), run.time[-1])
        grids[run.name], means[run.name] = grid, min(own, STEP_S)
        inputs[run.name] = _mean_inputs(run.time, full.inputs[run.name], grid)
        runs.append(dataclasses.replace(run, time=grid))
    coarse = Replay(dataclasses.replace(dataset, runs=tuple(runs)), inputs=inputs, motor_step=step, body_step=step)
    return coarse, Bins(BIN_S, grids, means)


def _mean_inputs(time: Array, driven: Array, grid: Array) -> Array:
    """Returns (grid, columns): the mean of each input over each step of the grid. Inputs hold from sample to sample."""
    held = np.where(np.isnan(driven), 0.0, driven)
    summed = np.vstack([np.zeros(driven.shape[1]), np.cumsum(held[:-1] * np.diff(time)[:, np.newaxis], axis=0)])
    at_grid = np.column_stack([np.interp(grid, time, column) for column in summed.T])
    means = np.vstack([np.diff(at_grid, axis=0) / np.diff(grid)[:, np.newaxis], held[-1]])
    floats = np.isnan(driven[np.searchsorted(time, grid, side="right") - 1])
    means[floats] = np.nan
    return means
