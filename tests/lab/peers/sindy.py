"""The peer PySINDy: each next sample is a sparse sum of products, signs and squares of the present sample."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from numpy.typing import NDArray

from lab.peers.grid import Grid, choose, on_grid, spread, steps_for
from lab.real_score import Predictions

Array = NDArray[np.float64]

_DIVERGED = 1e3  # a model has diverged if a channel exceeds this limit, in sd of the channel


@dataclass(frozen=True)
class _Setting:
    degree: int
    friction: bool
    threshold: float


def fit(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the best library and threshold. Each run starts from its first sample."""
    steps = steps_for(dataset)
    grids = (on_grid(dataset, step) for step in sorted({steps[-1], steps[len(steps) // 2]}))
    settings = [_Setting(*one) for one in product((1, 2), (False, True), (1e-3, 1e-2))]
    return choose(grids, settings, _simulated, roles)


def _simulated(grid: Grid, used: Sequence[str], wanted: Sequence[str], setting: _Setting) -> Mapping[str, Array]:
    import pysindy

    inputs = np.vstack([grid.stretches[name].inputs for name in used])
    outputs = np.vstack([grid.stretches[name].outputs for name in used])
    u_size, y_size = spread(inputs), spread(outputs)
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
    shown = [grid.stretches[name] for name in wanted]
    starts = np.array([run.outputs[0] / y_size for run in shown])
    free = _free_runs(peer.feature_library, np.asarray(peer.coefficients()), starts, [r.inputs / u_size for r in shown])
    return {name: y_size * channels for name, channels in zip(wanted, free, strict=True)}


def _free_runs(library: Any, weights: Array, starts: Array, inputs: Sequence[Array]) -> list[Array]:
    """Returns the channels (n, k) of each run. Each sample follows from the previous sample; diverging values are cut.

    All runs advance together, because the library takes the same time for one row and for many rows.
    """
    lengths = [len(one) for one in inputs]
    padded = np.stack([np.pad(one, ((0, max(lengths) - len(one)), (0, 0))) for one in inputs])
    found = np.empty((len(inputs), max(lengths), starts.shape[1]))
    found[:, 0] = starts
    for row in range(1, max(lengths)):
        features = np.asarray(library.transform(np.column_stack([found[:, row - 1], padded[:, row - 1]])))
        found[:, row] = np.clip(np.nan_to_num(features @ weights.T), -_DIVERGED, _DIVERGED)
    return [found[number, :length] for number, length in enumerate(lengths)]
