"""The coarse time grid on which a search simulates: three times as fast as the measured samples, and near enough."""

from __future__ import annotations

import dataclasses

import numpy as np

from brickpilot.constants import STEP_S
from brickpilot.data.dataset import Dataset
from brickpilot.discover.gates import BIN_S
from brickpilot.fit.blocks import Bins
from brickpilot.fit.held_inputs import mean_over_steps
from brickpilot.fit.replay import Replay

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
        inputs[run.name] = mean_over_steps(run.time, full.inputs[run.name], grid)
        runs.append(dataclasses.replace(run, time=grid))
    coarse = Replay(dataclasses.replace(dataset, runs=tuple(runs)), inputs=inputs, motor_step=step, body_step=step)
    return coarse, Bins(BIN_S, grids, means)
