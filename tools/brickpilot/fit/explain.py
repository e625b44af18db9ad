"""Against what an unknown load varies: each quantity alone, by how much of the load it predicts on other runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BINS = 12  # of a quantity, with as many samples each
_SHRINK = 10.0  # samples of nothing that each bin starts with
_ORDERS = np.arange(0.5, 12.01, 0.05)  # periods per turn that are tried for a load that repeats with the wheel's angle
_PLAINER = 0.05  # of the load's square: a quantity earlier in the list is preferred if it explains so nearly as much
_FOLDS = 5
_STRETCH_S = 1.0  # a stretch of time stays in one fold: a load lasts about so long at most

TIMES = ("time in the run", "time since power-on")
"""Quantities that tell one run or stretch from another. What they explain has to hold on whole runs left out."""

WHEEL_ANGLE = "wheel angle"
"""The quantity of which a load may be a sine, instead of any curve."""


@dataclass(frozen=True)
class Explained:
    """A quantity that explains a part of a load.

    Attributes:
        by: its name.
        share: of the load's mean square, where the curve was not made from it; below 0: none.
    """

    by: str
    share: float


@dataclass(frozen=True)
class LoadOfRun:
    """A load over one run, (n,), with its sd, and the quantities that it may vary with, the plainest first."""

    time: Array
    load: Array
    sd: Array
    quantities: Mapping[str, Array]


def explanations(runs: Sequence[LoadOfRun]) -> list[Explained]:
    """Returns what explains the load, the best first; of two that explain about as much, the plainer one.

    Cross-validation leaves out stretches of time, so that a manoeuvre that one run alone holds is not lost. For the
    quantities in `TIMES` it leaves out whole runs.
    """
    one = _joined(runs)
    stretch = np.concatenate([(run.time - run.time[0]) // _STRETCH_S for run in runs]).astype(np.intp)
    first = np.repeat(np.arange(len(runs)), [len(run.load) for run in runs])
    by_stretch = (stretch + first) % _FOLDS
    by_run = first if len(runs) > 1 else by_stretch
    names = list(one.quantities)
    shares = {name: _share(one, name, by_run if name in TIMES else by_stretch) for name in names}
    best = max(shares.values())
    plainest = next(name for name in names if shares[name] >= best - _PLAINER)
    others = sorted((name for name in names if name != plainest), key=lambda name: -shares[name])
    return [Explained(name, shares[name]) for name in (plainest, *others)]


def _joined(runs: Sequence[LoadOfRun]) -> LoadOfRun:
    names = runs[0].quantities
    return LoadOfRun(
        np.concatenate([run.time for run in runs]),
        np.concatenate([run.load for run in runs]),
        np.concatenate([run.sd for run in runs]),
        {name: np.concatenate([run.quantities[name] for run in runs]) for name in names},
    )


def _share(run: LoadOfRun, name: str, folds: NDArray[np.intp]) -> float:
    """Returns the share of the mean square that is predicted, each fold from the others."""
    weight = 1 / (run.sd**2 + np.mean(run.sd**2) + 1e-300)
    against = run.quantities[name]
    predict = _repeating(against, run.load, weight) if name == WHEEL_ANGLE else _binned
    error = np.array(run.load)
    for fold in np.unique(folds):
        rest, here = folds != fold, folds == fold
        if rest.any():
            error[here] -= predict(against[rest], run.load[rest], weight[rest], against[here])
    total = float(np.sum(weight * run.load**2))
    return 1 - float(np.sum(weight * error**2)) / total if total > 0 else 0.0


def _binned(against: Array, load: Array, weight: Array, at: Array) -> Array:
    """Returns the mean load in the bin of each value `at`."""
    edges = np.unique(np.quantile(against, np.linspace(0, 1, _BINS + 1)[1:-1]))
    where = np.searchsorted(edges, against, side="right")
    unit = float(np.mean(weight))
    count = np.bincount(where, weight / unit, minlength=len(edges) + 1)
    mean = np.bincount(where, weight / unit * load, minlength=len(edges) + 1) / (count + _SHRINK)
    return np.asarray(mean[np.searchsorted(edges, at, side="right")])


def _repeating(against: Array, load: Array, weight: Array) -> Callable[[Array, Array, Array, Array], Array]:
    """Returns the fit of a sine of the angle, of the order that suits the load best."""
    match = np.abs(np.exp(1j * np.outer(_ORDERS, against)) @ (weight * load))
    order = float(_ORDERS[int(np.argmax(match))])

    def waves(angle: Array) -> Array:
        return np.column_stack([np.cos(order * angle), np.sin(order * angle)])

    def sine(against: Array, load: Array, weight: Array, at: Array) -> Array:
        root = np.sqrt(weight)
        return np.asarray(waves(at) @ np.linalg.lstsq(waves(against) * root[:, np.newaxis], load * root, rcond=None)[0])

    return sine
