"""Adequacy: whether the residual of an explanation is still predictable, or too large.

No model explains a machine down to its sensors' noise. So a black box without laws is fitted to the residual: a ridge
regression on random features of the inputs and of the simulated states (Rahimi & Recht 2007, NIPS). The black box then
predicts other runs. An error that it predicts may come from a missing law; any other error shows no missing law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brickpilot.data.motion import run_of
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.fit.residual import Residual
from brickpilot.fit.robust import robust_size
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Outputs, Replay

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_FOLDS = 4
_FEATURES = 200
_WIDTH = 0.3  # the features approximate the kernel `exp(-_WIDTH d^2 / columns)`; d: distance of standardised rows
_ALPHAS = (1.0, 10.0, 100.0)  # ridge penalties that are tried; a larger penalty gives a smoother prediction
_TAUGHT_ROWS = 3000  # largest number of rows that train the black box: further rows of a long log add nothing new
_BEYOND = 0.1  # a column is clipped to its training range, widened at each end by this share of the range
_FAR = 5.0  # multiple of the residual's rms without outliers: a larger residual is clipped to this multiple
_NEXT_TO_NOTHING = 1e-300  # least divisor: avoids a division by 0 if the nominal model leaves no error above noise
_FILTERS_S = (0.1, 0.5, 2.0)  # filter time constants for a motor, for a body, and for slow changes
_STANDSTILL_SHARE = 0.03  # below this share of the largest speed or voltage, the smoothed sign goes to 0
_SETTLING_S = 0.3  # time constant, s, of a column that decays from the start of a run


@dataclass(frozen=True)
class Adequacy:
    """The error that an explanation leaves.

    Attributes:
        predictable: signal -> the share of its squared residual that a black box predicts on runs outside its training.
        left: signal -> log(scale of its residual / its noise floor), in nats per value; 0: noise alone.
        explained: signal -> how much of the nominal model's squared error above noise the explanation removes, 0..1.
    """

    predictable: Mapping[str, float]
    left: Mapping[str, float]
    explained: Mapping[str, float]

    @property
    def most_predictable(self) -> float:
        return max(self.predictable.values(), default=0.0)

    @property
    def leaves_more_than_noise(self) -> bool:
        """Whether some signal has more error left than noise alone gives."""
        return max(self.left.values(), default=0.0) > numbers.UNEXPLAINED_NATS

    @property
    def unexplained(self) -> str | None:
        """The signal with the largest `left` above the limit, of the signals less than half `explained`; or None."""
        more = {one: left for one, left in self.left.items() if self.explained[one] < 1 - self.explained[one]}
        return max(
            (one for one in more if more[one] > numbers.UNEXPLAINED_NATS),
            key=lambda one: more[one],
            default=None,
        )

    @property
    def is_adequate(self) -> bool:
        """Whether the residual shows no missing law."""
        return self.most_predictable <= numbers.SHARED_REST and self.unexplained is None

    @property
    def sentence(self) -> str:
        """Returns a sentence that says why the explanation is not adequate; empty if it is adequate."""
        if self.most_predictable > numbers.SHARED_REST:
            signal = max(self.predictable, key=lambda name: self.predictable[name])
            return (
                f"A black box still predicts {100 * self.predictable[signal]:.0f} % of the error of {signal} on runs "
                "that it has not seen: something more is missing."
            )
        if self.unexplained is None:
            return ""
        left, gone = self.left[self.unexplained], self.explained[self.unexplained]
        return (
            f"Much more error of {self.unexplained} is left than noise makes: {left:.2g} nats a value. The best "
            f"explanation removes {100 * gone:.0f} % of its squares. Neither a law of the library nor a black box "
            "predicts it."
        )


def adequacy(judge: Judge, best: Evidence, nothing: Evidence, plain: Evidence, seed: int) -> Adequacy:
    """Returns the adequacy of an explanation on the fit runs. `plain`: the nominal model with the offsets of `best`."""
    signals = judge.data.signals
    found = predictable(judge, best.explanation.model, plain.explanation.model, seed)
    left = {one: float(np.log(judge.squares(best, one))) / 2 - float(np.log(judge.data.floor(one))) for one in signals}
    before, after = judge.excess(nothing), judge.excess(best)
    gone = np.clip(1 - after / np.maximum(before, _NEXT_TO_NOTHING), 0.0, 1.0)
    return Adequacy(found, left, dict(zip(signals, gone.tolist(), strict=True)))


def predictable(judge: Judge, model: Model, plain: Model, seed: int) -> dict[str, float]:
    """Returns signal -> the share, 0..1, of its squared residual that a black box predicts on runs new to it.

    Only error above the floor of noise and simulator error counts: predictable error below this floor comes from a
    sensor's rounding, not from a missing law. Error that inexact laws in `model` may leave does not count either:
    the share `LAW_SHAPE` of the squared error by which `model` is better than `plain`, the model without these laws.
    """
    data = judge.data
    error, before = data.measured - data.predict([model, plain])
    outputs = data.replay.simulate([model], threads=data.threads)[0]
    found = {}
    for signal in data.signals:
        columns, target, folds = rows_of(data, outputs, error, signal)
        size = robust_size(target) or 1.0
        target = np.clip(target, -_FAR * size, _FAR * size)
        predicted = out_of_fold(columns, target, folds, seed).value
        total = float(target @ target)
        noise = len(target) * data.floor(signal) ** 2
        explained = float(np.sum(np.concatenate(data.parts(before, signal)) ** 2)) - total
        own_error = numbers.LAW_SHAPE * max(explained, 0.0)
        gone = total - float(np.sum((target - predicted) ** 2)) - own_error
        found[signal] = max(0.0, min(gone, total - noise)) / max(total, noise)
    return found


def rows_of(data: Residual, outputs: Mapping[str, Outputs], error: Array, signal: str) -> tuple[Array, Array, Indices]:
    """Returns the training data for a signal: columns (rows, columns), error (rows,), and each row's fold (rows,).

    Args:
        outputs: run -> simulated signals.
        error: (values,) the residual of all signals.
    """
    blocks = [block for block in data.blocks if block.signal == signal]
    columns = np.vstack([columns_of(data.replay, outputs, block.run, block.middle) for block in blocks])
    runs = [run_of(block.run) for block in blocks for _ in block.middle]
    folds = folds_of(runs, np.concatenate([block.middle for block in blocks]))
    return columns, np.concatenate(data.parts(error, signal)), folds


@dataclass(frozen=True)
class Unseen:
    """The prediction of a black box for rows that it was not trained on.

    Attributes:
        value: (rows,) the prediction of the black box, already multiplied by `factor`.
        best: the index of the penalty that predicts best.
        factor: 0..1; the black box's prediction fits these rows best if it is multiplied by this factor.
    """

    value: Array
    best: int
    factor: float


def out_of_fold(columns: Array, target: Array, folds: Indices, seed: int) -> Unseen:
    """Predicts each fold of `target` (rows,) from `columns` (rows, columns), after training on the other folds."""
    tried = np.zeros((len(target), len(_ALPHAS)))
    for fold in np.unique(folds):
        here = folds == fold
        if not here.all():
            tried[here] = taught_by(columns[~here], target[~here], seed)(columns[here])
    best = int(np.argmin(np.sum((target[:, np.newaxis] - tried) ** 2, axis=0)))
    power = float(tried[:, best] @ tried[:, best])
    factor = float(np.clip(target @ tried[:, best] / power, 0.0, 1.0)) if power > 0 else 0.0
    return Unseen(factor * tried[:, best], best, factor)


def taught_by(columns: Array, target: Array, seed: int) -> Callable[[Array], Array]:
    """Returns a black box that learned `target` (rows,) from `columns` (rows, columns).

    The black box takes columns and returns (rows, penalties), a prediction for each penalty.
    """
    rows = slice(None, None, -(-len(columns) // _TAUGHT_ROWS))
    columns, target = columns[rows], target[rows]
    middle, size = columns.mean(axis=0), columns.std(axis=0)
    size = np.where(size > 0, size, np.inf)
    low, high = columns.min(axis=0), columns.max(axis=0)
    low, high = low - _BEYOND * (high - low), high + _BEYOND * (high - low)
    random, count = np.random.default_rng(seed), columns.shape[1]
    directions = random.normal(size=(count, _FEATURES)) * (2 * _WIDTH / count) ** 0.5
    phases = random.uniform(0, 2 * np.pi, _FEATURES)
    weight = (2 * count / _FEATURES) ** 0.5  # gives the random features as much weight as the plain columns

    def features(asked: Array) -> Array:
        plain = (np.clip(asked, low, high) - middle) / size
        return np.hstack([plain, weight * np.cos(plain @ directions + phases)])

    taught, mean = features(columns), float(target.mean())
    values, axes = np.linalg.eigh(taught.T @ taught)
    turned = axes.T @ (taught.T @ (target - mean))
    weights = np.column_stack([axes @ (turned / (np.maximum(values, 0.0) + alpha)) for alpha in _ALPHAS])
    return lambda asked: np.asarray(features(asked) @ weights + mean)


def folds_of(runs: Sequence[str], times: Array) -> Indices:
    """Returns (rows,) each row's fold. Runs go to the emptiest fold, the longest run first; a single run is cut."""
    names, number = np.unique(np.array(runs), return_inverse=True)
    if len(names) == 1:
        cut = np.floor(2 * _FOLDS * (times - times.min()) / max(float(np.ptp(times)), 1e-9)).astype(np.int64)
        return np.asarray(np.minimum(cut, 2 * _FOLDS - 1) % _FOLDS, dtype=np.int64)
    sizes = np.bincount(number)
    loads, fold_of = np.zeros(min(_FOLDS, len(names))), np.zeros(len(names), dtype=np.int64)
    for run in np.argsort(-sizes, kind="stable").tolist():
        fold_of[run] = int(np.argmin(loads))
        loads[fold_of[run]] += sizes[run]
    return np.asarray(fold_of[number], dtype=np.int64)


def columns_of(replay: Replay, outputs: Mapping[str, Outputs], run: str, at: Array) -> Array:
    """Returns (rows, columns): the simulator's inputs and outputs, raw and low-pass filtered, at times `at` of a run.

    The columns contain no measured value.
    """
    time = next(driven.time for driven in replay.dataset.runs if driven.name == run)
    step = float(np.median(np.diff(time)))
    clock = time - time[0]
    made = [clock, np.exp(-clock / _SETTLING_S)]
    for volts in np.nan_to_num(replay.inputs[run]).T:
        small = max(_STANDSTILL_SHARE * float(np.abs(volts).max()), 1e-12)
        made += [volts, np.tanh(volts / small), *_past(volts, step)]
    simulated = outputs[run]
    rates = [name for name in simulated if name in _RATES]
    for name in rates:
        rate = np.nan_to_num(simulated[name])
        small = max(_STANDSTILL_SHARE * float(np.abs(rate).max()), 1e-12)
        side = np.tanh(rate / small)
        made += [rate, np.abs(rate), side, *_past(rate, step), *_past(side, step)]
    if "yaw_rate" in simulated and "surge" in simulated:
        made.append(simulated["surge"] * simulated["yaw_rate"])
    return np.column_stack([np.interp(at, time, column) for column in made])


_RATES = frozenset({"speed", "velocity", "yaw_rate", "wheel_speed_left", "wheel_speed_right"})


def _past(values: Array, step: float) -> list[Array]:
    """Returns `values` (n,) after a first-order low-pass filter, for each time constant. The filters start at 0."""
    decays = [float(np.exp(-step / constant)) for constant in _FILTERS_S]
    return [np.asarray(lfilter([1 - decay], [1.0, -decay], values)) for decay in decays]
