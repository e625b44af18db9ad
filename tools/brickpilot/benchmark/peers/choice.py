"""Chooses the settings of a peer by its free runs on fit runs that it was not fitted on, and fits it again on all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot.benchmark.peers.grid import Grid
from brickpilot.benchmark.real_score import Predictions, fits
from brickpilot.data.holdout import Roles

Array = NDArray[np.float64]
Setting = TypeVar("Setting")

Simulated = Callable[[Grid, Sequence[str], Sequence[str], Setting], Mapping[str, Array]]
"""Fits on the runs of the first list and returns the channels of those of the second, (n, k) each."""


def choose(
    grids: Iterable[Grid], settings: Sequence[Setting], simulated: Simulated[Setting], roles: Roles
) -> Predictions:
    """Returns the free runs of the best setting on the best grid.

    With three fit runs or more, every third one tells which setting is best, and the others fit it. With fewer, the
    fit runs do both. Held-out runs are never looked at.
    """
    fitted = roles.fit()
    watched = fitted[1::3] if len(fitted) > 2 else fitted
    used = [name for name in fitted if name not in watched] or fitted
    best: tuple[float, Grid, Setting] | None = None
    for grid in grids:
        for setting in settings:
            score = _score(grid, _safely(simulated, grid, used, watched, setting), watched)
            if best is None or score > best[0]:
                best = (score, grid, setting)
    if best is None:
        return {}
    _, grid, setting = best
    every = [run.name for run in grid.dataset.runs]
    return grid.back(_safely(simulated, grid, fitted, every, setting))


def _score(grid: Grid, simulated: Mapping[str, Array], names: Sequence[str]) -> float:
    if not simulated:
        return -np.inf
    found = fits(grid.dataset, Roles(dict.fromkeys(names, "fit"), ""), grid.back(simulated), grid.signals)["fit"]
    return -np.inf if found.pooled is None else found.pooled


def _safely(
    simulated: Simulated[Setting], grid: Grid, used: Sequence[str], wanted: Sequence[str], setting: Setting
) -> Mapping[str, Array]:
    """Returns nothing where a library gives up on a setting: a singular matrix, or a model that diverges."""
    try:
        with np.errstate(all="ignore"):
            return simulated(grid, used, wanted, setting)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, IndexError):
        return {}
