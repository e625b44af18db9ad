"""Computes the fit of predicted free runs to measured runs, in percent, for discovery and all peers in the same way."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from brickpilot.data.agreement import Agreement, agreement, mean_fit, together
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from brickpilot.data.signals import SUMMED
from brickpilot.vehicle.headline import noise_sd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Predictions = Mapping[str, Mapping[str, Array]]
"""Run -> signal -> (n,) values at the run's own times."""

WORST = -999.0
"""Lowest reported fit, percent: it replaces lower fits and the fit of a model that diverged."""

ROLES = ("fit", "held_out")

FIGURE = "share of the signal"
"""The entry "figure" of a result: its fits are relative to the rms of the signal. In older results, which have no such
entry, fits are relative to the signal's sd about its mean."""

_DIVERGED = 1e200  # largest error, SI, because squares of larger values overflow


@dataclass(frozen=True)
class Fit:
    """Fit in percent, the headline number of `data.agreement`, over all samples of all runs of one role.

    Attributes:
        by_signal: signal -> fit in percent over these runs.
        pooled: the mean over the signals; None: there is no run of this role.
    """

    by_signal: Mapping[str, float]
    pooled: float | None

    def to_json(self) -> dict[str, float | None]:
        return {**{name: round(value, 2) for name, value in self.by_signal.items()}, "pooled": _rounded(self.pooled)}


def fits(dataset: Dataset, roles: Roles, predicted: Predictions, signals: Collection[str]) -> dict[str, Fit]:
    """Returns "fit" or "held_out" -> the fit of `predicted` to the runs of this role.

    A sample without a prediction counts as if 0 was predicted. Signals that sum up motion, such as an angle, are
    compared by their change since the first known sample. A signal whose rms is at most 3 sd of its noise is left out.
    """
    return {
        role: _fit(dataset, [n for n, own in roles.by_run.items() if own == role], predicted, signals) for role in ROLES
    }


def _fit(dataset: Dataset, names: Collection[str], predicted: Predictions, signals: Collection[str]) -> Fit:
    by_signal = {}
    for signal in signals:
        runs = [run for run in dataset.runs if signal in run.outputs]
        noise = noise_sd(dataset, signal, [run.outputs[signal] for run in runs])
        parts = [
            _agreement(signal, run.outputs[signal], predicted.get(run.name, {}).get(signal), noise)
            for run in runs
            if run.name in names
        ]
        found = together(parts)
        if found.percent_of(0.0) is not None:
            fit = found.fit_percent
            by_signal[signal] = WORST if fit is None else max(WORST, fit)
    return Fit(by_signal, mean_fit(by_signal))


def _agreement(signal: str, measured: Array, predicted: Array | None, noise: float) -> Agreement:
    values, simulated = _known(signal, measured, predicted)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.where(np.isnan(simulated), values, values - simulated)
    return agreement(np.clip(error, -_DIVERGED, _DIVERGED), values, noise_sd=noise)


def _known(signal: str, measured: Array, predicted: Array | None) -> tuple[Array, Array]:
    """Returns the known samples of a run, (n,), and their predictions, (n,); NaN: there is no prediction."""
    known = np.isfinite(measured)
    values = measured[known]
    simulated = np.full_like(values, np.nan) if predicted is None else predicted[known]
    if signal in SUMMED and len(values):
        return values - values[0], simulated - simulated[0]
    return values, simulated


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
