"""The peer PySINDy: the next sample of all channels as a sparse sum of products, signs and squares of the last one."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brickpilot.benchmark.peers.choice import choose
from brickpilot.benchmark.peers.grid import Grid, on_grid, steps_for
from brickpilot.benchmark.real_score import Predictions
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles

Array = NDArray[np.float64]

_DIVERGED = 1e3  # times the spread of a channel


@dataclass(frozen=True)
class _Setting:
    degree: int
    friction: bool
    threshold: float


def fit(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the best library and threshold. Each run starts from its first sample."""
    grids = (on_grid(dataset, step) for step in steps_for(dataset))
    settings = [_Setting(*one) for one in product((1, 2), (False, True), (1e-3, 1e-2))]
    return choose(grids, settings, _simulated, roles)


def _simulated(grid: Grid, used: Sequence[str], wanted: Sequence[str], setting: _Setting) -> Mapping[str, Array]:
    import pysindy

    inputs = np.vstack([grid.stretches[name].inputs for name in used])
    outputs = np.vstack([grid.stretches[name].outputs for name in used])
    u_size, y_size = _spread(inputs), _spread(outputs)
    library = pysindy.PolynomialLibrary(degree=setting.degree, include_bias=True)
    if setting.friction:
        library = library + pysindy.CustomLibrary([lambda x: np.sign(x), lambda x: x * np.abs(x)])
    peer = pysindy.DiscreteSINDy(
        optimizer=pysindy.STLSQ(threshold=setting.threshold, alpha=1e-6), feature_library=library
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        runs = [grid.stretches[name] for name in used]
        peer.fit([run.outputs / y_size for run in runs], t=grid.step, u=[run.inputs / u_size for run in runs])
    weights = np.asarray(peer.coefficients())
    fitted = peer.feature_library
    return {
        name: y_size * _free_run(fitted, weights, run.outputs[0] / y_size, run.inputs / u_size)
        for name in wanted
        for run in [grid.stretches[name]]
    }


def _free_run(library: object, weights: Array, start: Array, inputs: Array) -> Array:
    """Returns the channels (n, k), each sample from the one before; a model that diverges stays at its last bound."""
    transform = library.transform  # type: ignore[attr-defined]
    found = np.empty((len(inputs), len(start)))
    found[0] = start
    for row in range(1, len(inputs)):
        features = np.asarray(transform(np.concatenate([found[row - 1], inputs[row - 1]])[np.newaxis]))
        found[row] = np.clip(np.nan_to_num(weights @ np.ravel(features)), -_DIVERGED, _DIVERGED)
    return found


def _spread(values: Array) -> Array:
    sizes = values.std(axis=0)
    return np.where(sizes > 0, sizes, 1.0)
