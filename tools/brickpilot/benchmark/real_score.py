"""The free-run fit of a model to measured runs, in percent: the same figure for discovery and for every peer."""

from __future__ import annotations

from collections.abc import Collection, Mapping
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
    """Fit percent of all runs of one role: 100 (1 - rms error / rms of the measured signal about its mean in each run).

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
    by_signal, shares = {}, []
    for signal in signals:
        squares, spread = 0.0, 0.0
        for run in dataset.runs:
            if run.name in names and signal in run.outputs:
                found = _squares(signal, run.outputs[signal], predicted.get(run.name, {}).get(signal))
                squares, spread = squares + found[0], spread + found[1]
        if spread > 0:
            share = squares / spread
            shares.append(share)
            by_signal[signal] = _percent(share)
    return Fit(by_signal, _percent(float(np.mean(shares))) if shares else None)


def _squares(signal: str, measured: Array, predicted: Array | None) -> tuple[float, float]:
    """Returns the sum of squared errors, and of squared differences of `measured` from its mean."""
    known = np.isfinite(measured)
    if not known.any():
        return 0.0, 0.0
    values = measured[known]
    spread = float(np.sum((values - values.mean()) ** 2))
    if predicted is None:
        return spread, spread
    simulated = predicted[known]
    if signal in SUMMED:
        values, simulated = values - values[0], simulated - simulated[0]
    with np.errstate(over="ignore", invalid="ignore"):
        squares = float(np.sum((values - simulated) ** 2))
    return (squares if np.isfinite(squares) else np.inf), spread


def _percent(share: float) -> float:
    return max(WORST, 100.0 * (1.0 - float(np.sqrt(share)))) if np.isfinite(share) else WORST


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
