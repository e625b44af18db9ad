"""Finds what a row of a log means, where the data set does not know: what inputs do between two rows, and whether an
accelerometer gives the instant or the mean over a sample. What the runs surely tell is taken, and said in a note.

Inputs hold or go in a straight line.
The nominal model is fitted with either, and with inputs behind a delay or a first-order lag: held inputs lie near to
linear ones that are late by half a row, and a lag makes a slope of each step. Which of two models is nearer to the
truth, and how sure that is, says the test of Vuong (1989, Econometrica 57): the mean difference of their losses over
stretches of time, against its own scatter.

The instant and the mean of an acceleration are half a sample apart, which a fit would make up for by a motor that is
slower or faster than it is. The same test decides.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.description import UNKNOWN_TIMING, Sampling
from brickpilot.data.input_timing import ramps, with_linear_inputs, with_rows
from brickpilot.discover import numbers
from brickpilot.discover.explanation import Explanation, fit
from brickpilot.discover.prepare import Prepared, calibrate, prepare
from brickpilot.fit.comparable import on_coarse_grid
from brickpilot.fit.replay import Replay, mean_over_steps
from brickpilot.fit.residual import Problem, of_samples
from brickpilot.fit.start_state import run_of
from brickpilot.fit.uncertainty import CORRELATED_S
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Timing = Literal["held", "linear"]

TIMINGS: tuple[Timing, ...] = ("held", "linear")

_FOLLOWABLE_ROW_S = 0.008  # in a log with shorter rows bins hide what inputs do between them
_TOLERANCE = 1e-5  # relative change of cost at which a fit ends
_MOTOR_STEP_S = 0.003  # as the residual at the measured samples has
_PARTS = 8  # of a row, between two of which the inputs are followed


@dataclass(frozen=True)
class Behind:
    """What the inputs are behind: a delay in s, or a first-order lag with a time constant in s."""

    delay: float = 0.0
    lag: float = 0.0

    def __str__(self) -> str:
        return f"a lag of {1e3 * self.lag:.3g} ms" if self.lag else f"a delay of {1e3 * self.delay:.3g} ms"


_NOTHING = Behind()
_DELAYS, _LAGS = (0.5, 1.0, 2.0), (0.5, 1.0, 2.0, 4.0)  # rows: what is tried first
_TRIALS = 6  # between two of these


@dataclass(frozen=True)
class FoundTiming:
    """What the inputs do between two rows.

    Attributes:
        timing: what explains the runs better, or "held" where they do not tell.
        sure: probability that the other one is not nearer to the truth, 0.5..1.
        behind: the other one explains the runs as well behind this; None: it does not.
    """

    timing: Timing
    sure: float
    behind: Behind | None = None

    @property
    def note(self) -> str:
        """Returns the sentence for the user."""
        other = "linear" if self.timing == "held" else "held"
        if self.sure < numbers.SURE:
            return "whether the inputs hold or are linear between two rows, these runs do not tell: held is taken"
        sure = f"{100 * min(self.sure, 0.999):.3g} % sure"
        if self.behind is not None:
            sure += f" if nothing delays them; {other} inputs behind {self.behind} explain as much"
        return f"between two rows the inputs are {self.timing}, found from the runs, {sure}"


def with_known_timing(dataset: Dataset, model: Model | None, *, seed: int, jobs: int) -> Dataset:
    """Returns a data set whose input timing is known: `dataset` itself, or with what its fit runs tell, and a note.

    Raises:
        InputError: as `prepare` does.
    """
    if dataset.input_timing != "unknown":
        return dataset
    row_s = float(np.median(np.concatenate([np.diff(run.time) for run in dataset.runs])))
    if row_s < _FOLLOWABLE_ROW_S:
        return _as(dataset, "held", f"the rows are {1e3 * row_s:.2g} ms apart, so the inputs are taken as held")
    found = _found(prepare(_refined(dataset, row_s), model, seed=seed, jobs=jobs)[0], dataset, row_s)
    return _as(dataset, found.timing, found.note)


def _as(dataset: Dataset, timing: Timing, note: str) -> Dataset:
    notes = tuple(note if one == UNKNOWN_TIMING else one for one in dataset.notes)
    runs = tuple(with_linear_inputs(run) for run in dataset.runs) if timing == "linear" else dataset.runs
    return dataclasses.replace(dataset, runs=runs, notes=notes, input_timing=timing)


def _refined(dataset: Dataset, row_s: float) -> Dataset:
    """Returns the data set with short rows throughout, on which inputs of either kind can act late."""
    runs = []
    for run in dataset.runs:
        parts = np.maximum(np.round(np.diff(run.time) * _PARTS / row_s), 1).astype(np.int64)
        row = np.repeat(np.arange(parts.size), parts)
        part = (np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[row]
        time = np.append(run.time[row] + part * np.diff(run.time)[row], run.time[-1])
        runs.append(with_rows(run, time, _acting(run, time, "held", _NOTHING)))
    return dataclasses.replace(dataset, runs=tuple(runs), input_timing="held")


def _acting(run: Run, time: Array, timing: Timing, behind: Behind) -> dict[str, Array]:
    """Returns the inputs of a logged run, of either kind, as means over the rows at `time`."""
    at, inputs = run.time, run.inputs
    if timing == "linear":
        at, inputs = ramps(at, inputs, float(np.diff(time).min()))
    values = np.column_stack(list(inputs.values()))
    before = at[0] - behind.delay - 1.0  # what acts before the first row
    means = mean_over_steps(np.append(before, at + behind.delay), np.vstack([values[:1], values]), time)
    if behind.lag:
        means = _lagged(time, means, behind.lag)
    return dict(zip(inputs, means.T, strict=True))


def _lagged(time: Array, values: Array, lag: float) -> Array:
    """Returns (n, columns): the means of `values` behind a first-order lag that starts settled; NaN stays."""
    steps = np.diff(time, append=2 * time[-1] - time[-2])
    kept = np.exp(-steps / lag)
    means = np.empty_like(values)
    state = np.nan_to_num(values[0])
    for row, held in enumerate(values):
        means[row] = held + (state - held) * (1 - kept[row]) * lag / steps[row]
        state = np.nan_to_num(held + (state - held) * kept[row])
    return means


def _found(prepared: Prepared, logged: Dataset, row_s: float) -> FoundTiming:
    """Returns what explains the fit runs of `prepared` better, which are those of `logged` with more rows."""
    prepared, nominal = calibrate(prepared)
    stretch, _ = prepared.fine.stretches(CORRELATED_S)

    def losses(timing: Timing, behind: Behind) -> Array:
        """Returns the loss of each stretch."""
        compared = _with_inputs(prepared, logged, timing, behind)
        coarse = Problem(prepared.coarse.with_inputs(on_coarse_grid(compared, numbers.BIN_S)[0]), nominal.plan)
        own = fit(coarse, (), nominal.plan, nominal.point, _TOLERANCE) or nominal
        loss = prepared.fine.with_inputs(Replay(compared, motor_step=_MOTOR_STEP_S)).losses(own.model)
        return np.bincount(stretch, loss).astype(np.float64)

    plain = {timing: losses(timing, _NOTHING) for timing in TIMINGS}
    best = {timing: _best(functools.partial(losses, timing), plain[timing], row_s) for timing in TIMINGS}
    timing, sure = _nearer(best["held"][1], best["linear"][1])
    if sure >= numbers.SURE:
        return FoundTiming(timing, sure)
    timing, sure = _nearer(plain["held"], plain["linear"])
    if sure < numbers.SURE:
        return FoundTiming("held", sure)
    return FoundTiming(timing, sure, best["linear" if timing == "held" else "held"][0])


def _best(losses: Callable[[Behind], Array], plain: Array, row_s: float) -> tuple[Behind, Array]:
    """Returns the delay or lag behind which the inputs explain most, with its losses; `plain` are those behind none."""
    tried = {_NOTHING: plain}

    def total(behind: Behind) -> float:
        tried[behind] = losses(behind)
        return float(tried[behind].sum())

    lag = row_s * min(_LAGS, key=lambda rows: total(Behind(lag=rows * row_s)))
    delay = row_s * min(_DELAYS, key=lambda rows: total(Behind(delay=rows * row_s)))
    _try_between(lambda x: total(Behind(lag=x)), lag / 2, 2 * lag)
    _try_between(lambda x: total(Behind(delay=x)), delay / 2, 1.5 * delay)
    best = min(tried, key=lambda one: tried[one].sum())
    return best, tried[best]


def _try_between(total: Callable[[float], float], low: float, high: float) -> None:
    """Calls `total` at a few places, ever nearer to its minimum."""
    minimize_scalar(total, bounds=(low, high), method="bounded", options={"maxiter": _TRIALS})


def _nearer(held: Array, linear: Array) -> tuple[Timing, float]:
    """Returns which leaves less, and the probability that this is so, from the losses of each stretch."""
    apart = linear - held
    scatter = float(np.std(apart, ddof=1)) * len(apart) ** 0.5 if len(apart) > 1 else 0.0
    if scatter == 0.0:
        return "held", 0.5
    sure = float(student.cdf(abs(apart.sum()) / scatter, len(apart) - 1))
    return ("held" if apart.sum() > 0 else "linear"), sure


def _with_inputs(prepared: Prepared, logged: Dataset, timing: Timing, behind: Behind) -> Dataset:
    """Returns the compared runs, or windows of runs, with inputs of one kind."""
    whole = {run.name: run for run in prepared.dataset.runs}
    acting = {run.name: _acting(run, whole[run.name].time, timing, behind) for run in logged.runs}
    runs = []
    for run in prepared.compared.runs:
        name = run_of(run.name)
        rows = np.searchsorted(whole[name].time, run.time)
        inputs = {signal: values[rows] for signal, values in acting[name].items()}
        runs.append(dataclasses.replace(run, inputs=inputs))
    return dataclasses.replace(prepared.compared, runs=tuple(runs))


_ASSUMED: Sampling = "mean"
_WORDS: dict[Sampling, str] = {"instant": "the instant", "mean": "the mean since the sample before it"}


def with_known_sampling(dataset: Dataset, prepared: Prepared, nominal: Explanation) -> Dataset | None:
    """Returns a data set that says that its accelerometers give the instant; None: they do not, or nobody can tell.

    Args:
        prepared: made of `dataset`.
        nominal: the calibrated nominal model.

    What a sample is, a data set may state. Else the mean is taken, unless the fit runs are sure of the instant.
    """
    measured = {name for run in dataset.runs for name in run.outputs if name.startswith("accel_")}
    names = sorted(name for name in measured if name not in dataset.signals or dataset.signals[name].sampling is None)
    if not names or len(names) < len(measured):
        return None
    losses = {
        kind: _sampled_losses(prepared, nominal, _with_sampling(prepared.compared, names, kind)) for kind in _WORDS
    }
    likelier, sure = _likelier(losses)
    if sure < numbers.SURE or likelier == _ASSUMED:
        return None
    note = (
        f"{', '.join(names)}: the data set does not state what a sample is. It is {_WORDS[likelier]}, "
        f"{100 * min(sure, 0.999):.3g} % sure from the runs, and is taken as such."
    )
    return dataclasses.replace(_with_sampling(dataset, names, likelier), notes=(*dataset.notes, note))


def _likelier(losses: Mapping[Sampling, Array]) -> tuple[Sampling, float]:
    """Returns which of the two leaves less, and the probability that this is so."""
    if not all(np.isfinite(one).all() for one in losses.values()):
        return _ASSUMED, 0.5
    timing, sure = _nearer(losses["mean"], losses["instant"])
    return ("mean" if timing == "held" else "instant"), sure


def _with_sampling(dataset: Dataset, names: Sequence[str], kind: Sampling) -> Dataset:
    described = dict(dataset.signals)
    for name in names:
        if name in described:
            described[name] = dataclasses.replace(described[name], sampling=kind)
    return dataclasses.replace(dataset, signals=described)


def _sampled_losses(prepared: Prepared, nominal: Explanation, compared: Dataset) -> Array:
    """Returns (stretches,) half the squares left by one step of least squares, over samples: bins hide half a sample.

    The parameters so adapt to either.
    """
    runs = list(dict.fromkeys(block.run for block in prepared.fine.blocks))
    data = of_samples(Replay(compared), nominal.plan.model, runs, threads=prepared.jobs)
    scales = {}
    for name, one in data.scales.items():
        known = prepared.fine.scales[name]
        noise = known.sample_noise
        scales[name] = dataclasses.replace(one, size=noise * max(1.0, known.size / known.noise), noise=noise)
    data = dataclasses.replace(data, scales=scales)
    problem = Problem(data, nominal.plan)
    rows, slopes = problem.residual(nominal.point), problem.jacobian(nominal.point)
    stretch, count = data.stretches(CORRELATED_S)
    if not np.isfinite(rows).all():
        return np.full(count, np.inf)
    step = np.linalg.lstsq(slopes, -rows, rcond=1e-9)[0]
    left = (rows + slopes @ step)[: len(data.measured)]
    return np.asarray(np.bincount(stretch, left**2 / 2, count), dtype=np.float64)
