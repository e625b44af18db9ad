"""The free-run fit of a model to measured runs, in percent: the same figure for discovery and for every peer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from brickpilot.data.signals import SUMMED

Array = NDArray[np.float64]
Predictions = Mapping[str, Mapping[str, Array]]
"""Run -> signal -> (n,) values at the run's own times."""

WORST = -999.0
"""Percent: a fit below it, or of a model that diverged, is written as this."""

ROLES = ("fit", "held_out")


@dataclass(frozen=True)
class Fit:
    """Fit percent: 100 (1 - rms error / rms of the signal about its mean), over all samples of all runs of one role.

    Attributes:
        by_signal: signal -> fit percent over these runs.
        pooled: the same over all signals, each weighted by one over its own spread; None: there is no such run.
    """

    by_signal: Mapping[str, float]
    pooled: float | None

    def to_json(self) -> dict[str, float | None]:
        return {**{name: round(value, 2) for name, value in self.by_signal.items()}, "pooled": _rounded(self.pooled)}


def fits(dataset: Dataset, roles: Roles, predicted: Predictions, signals: Collection[str]) -> dict[str, Fit]:
    """Returns "fit" and "held_out" -> how well `predicted` fits these runs.

    A signal that is not predicted counts as its own mean, 0 %. A signal of arbitrary origin counts from its first known
    sample.
    """
    return {
        role: _fit(dataset, [n for n, own in roles.by_run.items() if own == role], predicted, signals) for role in ROLES
    }


def _fit(dataset: Dataset, names: Collection[str], predicted: Predictions, signals: Collection[str]) -> Fit:
    shares = {}
    for signal in signals:
        runs = [run for run in dataset.runs if run.name in names and signal in run.outputs]
        pairs = [_known(signal, run.outputs[signal], predicted.get(run.name, {}).get(signal)) for run in runs]
        share = _share(pairs)
        if share is not None:
            shares[signal] = share
    by_signal = {signal: _percent(share) for signal, share in shares.items()}
    return Fit(by_signal, _percent(float(np.mean(list(shares.values())))) if shares else None)


def _known(signal: str, measured: Array, predicted: Array | None) -> tuple[Array, Array]:
    """Returns the known samples of a run, and what is predicted there: NaN where nothing is."""
    known = np.isfinite(measured)
    values = measured[known]
    simulated = np.full_like(values, np.nan) if predicted is None else predicted[known]
    if signal in SUMMED and len(values):
        return values - values[0], simulated - simulated[0]
    return values, simulated


def _share(pairs: Sequence[tuple[Array, Array]]) -> float | None:
    """Returns the squared error over the squared spread about the mean of all runs; None: the signal never moves."""
    if not pairs:
        return None
    values, simulated = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
    about = values - values.mean() if len(values) else values
    spread = float(about @ about)
    if spread <= 0:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.where(np.isnan(simulated), about, values - simulated)
        return float(np.sum(error**2)) / spread


def _percent(share: float) -> float:
    return max(WORST, 100.0 * (1.0 - float(np.sqrt(share)))) if np.isfinite(share) else WORST


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
