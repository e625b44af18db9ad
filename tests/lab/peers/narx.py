"""The peer SysIdentPy: a polynomial NARX for each channel, terms chosen by FROLS."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from numpy.typing import NDArray

from lab.peers.grid import Grid, choose, on_grid, spread, steps_for
from lab.real_score import Predictions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Setting:
    degree: int
    lag: int
    terms: int


def fit(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the best degree, lags and number of terms. Each run starts from its first samples."""
    steps = steps_for(dataset)
    grids = (on_grid(dataset, step) for step in sorted({steps[-1], steps[len(steps) // 2]}))
    settings = [_Setting(*one) for one in product((1, 2, 3), (2, 4), (5, 10))]
    return choose(grids, settings, _simulated, roles)


def _simulated(grid: Grid, used: Sequence[str], wanted: Sequence[str], setting: _Setting) -> Mapping[str, Array]:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    inputs = np.vstack([grid.stretches[name].inputs for name in used])
    outputs = np.vstack([grid.stretches[name].outputs for name in used])
    u_size, y_size = spread(inputs), spread(outputs)
    simulated = {name: np.zeros_like(grid.stretches[name].outputs) for name in wanted}
    lags = [list(range(1, setting.lag + 1))] * inputs.shape[1]
    for channel in range(outputs.shape[1]):
        peer = FROLS(
            ylag=setting.lag, xlag=lags[0] if len(lags) == 1 else lags, order_selection=False, n_terms=setting.terms,
            estimator=LeastSquares(), basis_function=Polynomial(degree=setting.degree), model_type="NARMAX",
        )  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            peer.fit(X=inputs / u_size, y=outputs[:, [channel]] / y_size[channel])
            for name in wanted:
                run = grid.stretches[name]
                values = peer.predict(X=run.inputs / u_size, y=run.outputs[:, [channel]] / y_size[channel])
                simulated[name][:, channel] = y_size[channel] * np.ravel(values)
    return simulated
