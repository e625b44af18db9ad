"""The yardstick: how well the nominal, the augmented and the best attainable model fit a real machine, in percent.

No simulator matches a real machine down to sensor noise, so multiples of noise say little about a model. The data give
two bounds of the fit: the share of the nominal model's error that the black box of `adequacy` predicts on unseen runs,
and the difference between repeats of the same inputs. This stage runs after the seal is opened, and decides nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.agreement import Agreement, together
from brickpilot.data.signals import SIGNALS
from brickpilot.discover import numbers
from brickpilot.discover.adequacy import out_of_fold, rows_of, taught_by
from brickpilot.discover.finding import Predictor
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.seal import Proof
from brickpilot.discover.settle import Settled
from brickpilot.errors import SimulationError
from brickpilot.fit.residual import of_bins
from brickpilot.vehicle.headline import AHEAD, FREE_RUN, headline, headline_of, repeatability, simulated_at, track
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

HORIZONS: Mapping[str, float] = {**AHEAD, "0.2_s": 0.2}
"""Name -> prediction horizon, s. The free run has no horizon and is not listed."""

_NOTHING = together([])


@dataclass(frozen=True)
class Fit:
    """How well one signal is simulated at one horizon, in percent of the signal: see `data.agreement`.

    The fit counts all samples of the fit runs or of the held-out runs. None: no such run, or the signal is only noise.

    Attributes:
        before, after: the fit of the calibrated nominal model and of the augmented model.
        attainable: a lower bound of the best possible fit: the largest of `before`, `after`, and the fit of the nominal
            model plus a black box on runs that the black box has not seen.
        numbers_before, numbers_after: the other headline numbers of the two models.
    """

    before: float | None
    after: float | None
    attainable: float | None
    numbers_before: Agreement = _NOTHING
    numbers_after: Agreement = _NOTHING

    def to_json(self) -> dict[str, Any]:
        pair = {"before": self.numbers_before, "after": self.numbers_after}
        return {
            "before": self.before,
            "after": self.after,
            "attainable": self.attainable,
            "r2": {when: one.r2 for when, one in pair.items()},
            "rms_error": {when: one.rms_error for when, one in pair.items()},
            "rms_signal": self.numbers_after.rms_signal,
        }


@dataclass(frozen=True)
class SignalFit:
    """The fit of one signal at one horizon, on the fit runs and on the held-out runs.

    Attributes:
        repeatability: the fit of a perfect model, in percent, from repeats of the same inputs: no model can predict the
            difference between repeats. None: no inputs were repeated.
    """

    fit: Fit
    held_out: Fit
    repeatability: float | None

    def to_json(self) -> dict[str, Any]:
        return self.fit.to_json() | {"repeatability": self.repeatability, "held_out": self.held_out.to_json()}


@dataclass(frozen=True)
class Predictable:
    """The share of the nominal model's squared error in free runs that a black box predicts, on runs new to it.

    Attributes:
        share, held_out: the predicted share, 0..1, on the fit runs and on the held-out runs; for held-out runs, the
            black box is trained on the fit runs. Errors are in units of each signal's mean square. None: no such runs.
        removed, removed_held_out: the share of the predictable error that the augmented model removes; negative if the
            error grows, 1 if the model removes more than the black box. None: nothing is predictable.
    """

    share: float | None
    held_out: float | None
    removed: float | None
    removed_held_out: float | None

    def to_json(self) -> dict[str, Any]:
        return {
            "share": self.share,
            "removed": self.removed,
            "held_out": {"share": self.held_out, "removed": self.removed_held_out},
        }


@dataclass(frozen=True)
class Yardstick:
    """How well the nominal and the augmented model fit a real machine.

    Attributes:
        signals: signal -> horizon -> fit.
        predictable: "free_run" -> how much of the nominal model's error is predictable.
        notes: sentences on what could not be measured.
    """

    signals: Mapping[str, Mapping[str, SignalFit]] = field(default_factory=dict)
    predictable: Mapping[str, Predictable] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def horizons(self) -> list[str]:
        return list(dict.fromkeys(name for one in self.signals.values() for name in one))

    def fit_json(self) -> dict[str, Any]:
        """Returns `fit_percent` of verdict.json."""
        return {
            signal: {horizon: {**one.to_json(), "unit": SIGNALS[signal].unit} for horizon, one in fits.items()}
            for signal, fits in self.signals.items()
        }

    def predictable_json(self) -> dict[str, Any]:
        """Returns `predictable` of verdict.json."""
        return {horizon: one.to_json() for horizon, one in self.predictable.items()}


def measure(prepared: Prepared, proof: Proof, nominal: Model, augmented: Model) -> Yardstick:
    """Returns how well the calibrated nominal and the augmented model fit the data."""
    plain = proof.opened.plain
    compared = track(plain, nominal, HORIZONS)
    simulated = simulated_at(compared, [nominal, augmented], threads=prepared.jobs, may_diverge=True)
    before, after = (headline_of(compared, one) for one in simulated)
    shares = _unseen_shares(prepared, proof, nominal)
    repeated = repeatability(compared, simulated[0][FREE_RUN]) if FREE_RUN in simulated[0] else {}

    def fit(signal: str, role: str, horizon: str) -> Fit:
        share = shares.get((signal, role), 0.0) if horizon == FREE_RUN else 0.0
        return _fit(before.of(signal, role, horizon), after.of(signal, role, horizon), share)

    def both(signal: str, horizon: str) -> SignalFit:
        kept = repeated.get(signal) if horizon == FREE_RUN else None
        return SignalFit(fit(signal, "fit", horizon), fit(signal, "held_out", horizon), kept)

    if not simulated[0] or not compared.signals:
        return Yardstick(notes=compared.notes)
    signals = {name: {horizon: both(name, horizon) for horizon in simulated[0]} for name in compared.signals}
    return Yardstick(signals, {FREE_RUN: _predictable(signals)}, compared.notes)


def as_predictor(prepared: Prepared, proof: Proof, found: Settled) -> Predictor:
    """Returns the best predictor with its fit in percent."""
    score = headline(proof.opened.plain, found.model, threads=prepared.jobs)
    fits = {
        signal: {role: score.of(signal, role).fit_percent for role in ("fit", "held_out")} for signal in score.signals
    }
    return Predictor(found.model, found.explanation.names, fits)


def _fit(before: Agreement, after: Agreement, share: float) -> Fit:
    """Returns a signal's fit. `share`: the share of the nominal model's squared error that the black box predicts."""
    known = [one.fit_percent for one in (before, after) if one.fit_percent is not None]
    if not known:
        return Fit(None, None, None)
    if before.fit_percent is not None:
        known.append(100 - (100 - before.fit_percent) * math.sqrt(1 - share))
    return Fit(before.fit_percent, after.fit_percent, round(max(known), 3), before, after)


def _predictable(signals: Mapping[str, Mapping[str, SignalFit]]) -> Predictable:
    """Returns the shares over all signals, from their fits. Squared errors are in units of a signal's mean square."""
    free = [one[FREE_RUN] for one in signals.values() if FREE_RUN in one]
    share, removed = _shares([one.fit for one in free])
    held_out, removed_held_out = _shares([one.held_out for one in free])
    return Predictable(share, held_out, removed, removed_held_out)


def _shares(fits: Sequence[Fit]) -> tuple[float | None, float | None]:
    """Returns the predictable share of squared error, and what share of this error the augmented model removes."""
    known = np.array([(one.before, one.after, one.attainable) for one in fits], dtype=np.float64).reshape(-1, 3)
    known = known[np.isfinite(known).all(axis=1)]
    if not len(known):
        return None, None
    error, left, least = np.sum((1 - known / 100) ** 2, axis=0).tolist()
    gone = error - least
    removed = round(min(1.0, (error - left) / gone), 4) if gone > 0 else None
    return round(gone / error, 4) if error > 0 else 0.0, removed


def _unseen_shares(prepared: Prepared, proof: Proof, nominal: Model) -> dict[tuple[str, str], float]:
    """Returns (signal, role) -> the share of the free-run squared error that a black box predicts on unseen runs."""
    whole = proof.opened.whole
    names = [run.name for run in whole.runs if run.outputs]
    data = of_bins(whole, nominal, names, width_s=numbers.BIN_S, as_measured=True, threads=prepared.jobs)
    try:
        error = data.measured - data.predict([nominal])[0]
        outputs = data.replay.simulate([nominal], threads=prepared.jobs)[0]
    except SimulationError:
        return {}
    found = {}
    for signal in data.signals:
        columns, target, folds = rows_of(data, outputs, error, signal)
        fitted = np.concatenate([_is_fit(prepared, one.run, one.middle) for one in data.blocks if one.signal == signal])
        if not np.isfinite(target).all() or fitted.sum() < 2:
            continue
        inside = out_of_fold(columns[fitted], target[fitted], folds[fitted], prepared.seed)
        found[signal, "fit"] = _share(target[fitted], inside.value)
        if not fitted.all():
            outside = taught_by(columns[fitted], target[fitted], prepared.seed)(columns[~fitted])[:, inside.best]
            found[signal, "held_out"] = _share(target[~fitted], inside.factor * outside)
    return found


def _share(error: Array, predicted: Array) -> float:
    total = float(error @ error)
    return float(np.clip(1 - np.sum((error - predicted) ** 2) / total, 0.0, 1.0)) if total > 0 else 0.0


def _is_fit(prepared: Prepared, run: str, middle: Array) -> NDArray[np.bool_]:
    """Returns (n,): whether each time of a run belongs to the fitted data."""
    first, last = prepared.roles.stretches.get(run, (np.inf, -np.inf))
    return (prepared.roles.by_run[run] == "fit") & ((middle < first) | (middle > last))
