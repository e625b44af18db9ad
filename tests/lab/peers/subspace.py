"""The peer nfoursid: a linear state space of all channels, found by a subspace method (N4SID)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from numpy.typing import NDArray

from lab.peers.grid import Grid, Stretch, choose, on_grid, spread, steps_for
from lab.real_score import Predictions

Array = NDArray[np.float64]

_ORDERS = (1, 2, 3, 4, 6, 8)
_START_SAMPLES = 10  # least number of samples from which the state at a run's start is found


@dataclass(frozen=True)
class _Space:
    """A state space of scaled channels: x' = a x + b u, y = c x + d u."""

    a: Array
    b: Array
    c: Array
    d: Array


def fit(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the best order. The state at the start of a run is found from its first samples."""
    return choose((on_grid(dataset, step) for step in steps_for(dataset)), _ORDERS, _simulated, roles)


def _simulated(grid: Grid, used: Sequence[str], wanted: Sequence[str], order: int) -> Mapping[str, Array]:
    import pandas
    from nfoursid.nfoursid import NFourSID

    inputs = np.vstack([grid.stretches[name].inputs for name in used])
    outputs = np.vstack([grid.stretches[name].outputs for name in used])
    u_mean, y_mean = inputs.mean(axis=0), outputs.mean(axis=0)
    u_size, y_size = spread(inputs), spread(outputs)
    u_names, y_names = ([f"{kind}{i}" for i in range(n)] for kind, n in (("u", len(u_mean)), ("y", len(y_mean))))
    table = np.column_stack([(inputs - u_mean) / u_size, (outputs - y_mean) / y_size])
    peer = NFourSID(
        pandas.DataFrame(table, columns=[*u_names, *y_names]),
        output_columns=y_names, input_columns=u_names, num_block_rows=order + 5,
    )  # fmt: skip
    peer.subspace_identification()
    found, _ = peer.system_identification(rank=order)
    space = _Space(*(np.real(np.asarray(matrix)) for matrix in (found.a, found.b, found.c, found.d)))
    simulated = {}
    for name in wanted:
        stretch = grid.stretches[name]
        scaled = Stretch(stretch.time, (stretch.inputs - u_mean) / u_size, (stretch.outputs - y_mean) / y_size)
        simulated[name] = y_mean + y_size * _free_run(space, scaled)
    return simulated


def _free_run(space: _Space, run: Stretch) -> Array:
    """Returns the outputs (n, k) of a run, started from the state that fits its first samples best."""
    states = len(space.a)
    few = min(len(run.inputs), max(_START_SAMPLES, 2 * states))
    forced = _outputs(space, np.zeros(states), run.inputs[:few])
    free = [_outputs(space, one, np.zeros_like(run.inputs[:few])) for one in np.eye(states)]
    columns = np.column_stack([one.ravel() for one in free])
    start: Array = np.asarray(
        np.linalg.lstsq(columns, (run.outputs[:few] - forced).ravel(), rcond=1e-8)[0], dtype=float
    )
    return _outputs(space, start, run.inputs)


def _outputs(space: _Space, state: Array, inputs: Array) -> Array:
    found = np.empty((len(inputs), len(space.c)))
    for row, volts in enumerate(inputs):
        found[row] = space.c @ state + space.d @ volts
        state = space.a @ state + space.b @ volts
    return found
