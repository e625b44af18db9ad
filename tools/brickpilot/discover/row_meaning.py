"""Finds what a row of a log means, if the data set does not state it: what inputs do between two rows, and whether an
accelerometer gives the value at an instant or the mean over a sample. A sure answer is used, with a note.

Between two rows, inputs are held or linear. The nominal model is fitted with held and linear inputs, also with a delay
or first-order lag of the inputs: held inputs resemble linear inputs that are half a row late, and a lag turns each step
into a slope. The test of Vuong (1989, Econometrica 57) gives the probability that one of two models is nearer to the
truth: it compares the mean difference of their losses over stretches of time with the scatter of this difference.

An acceleration at an instant and a mean over a sample are half a sample apart. A fit would compensate this delay by a
slower or faster motor. The same test decides between instant and mean.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import ttest_1samp

from brickpilot.data import input_timing
from brickpilot.data.dataset import Dataset
from brickpilot.data.input_timing import Behind, Kind, Timing, inputs_acting, refined, with_linear_inputs
from brickpilot.data.motion import run_of
from brickpilot.discover import numbers
from brickpilot.discover.explanation import Explanation, fit
from brickpilot.discover.prepare import Prepared, calibrate, prepare
from brickpilot.fit.blocks import with_inputs_of
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import MOTOR_STEP_S, of_samples
from brickpilot.fit.uncertainty import CORRELATED_S
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay

Array = NDArray[np.float64]
TIMINGS: tuple[Timing, ...] = ("held", "linear")

_FOLLOWABLE_ROW_S = 0.008  # least distance of rows, s, for this search: bins hide what inputs do between closer rows
_TOLERANCE = 1e-5  # relative change of cost at which a fit ends
_ROWS: dict[Kind, tuple[float, ...]] = {"lag": (0.5, 1.0, 2.0, 4.0), "delay": (0.5, 1.0, 2.0)}  # tried first, in rows
_LEAST, _MOST = 0.5, {"lag": 2.0, "delay": 1.5}  # bounds of the second search, as multiples of the best of `_ROWS`
_TRIALS = 6  # largest number of trials of the second search
_SURELY = 0.999  # the largest certainty that a note states


def with_known_timing(dataset: Dataset, model: Model | None, *, seed: int, jobs: int) -> Dataset:
    """Returns `dataset` with a known input timing: as stated, otherwise as found from its fit runs, with a note.

    Raises:
        InputError: in the same cases as `prepare`.
    """
    if dataset.input_timing != "unknown":
        return dataset
    row_s = float(np.median(np.concatenate([np.diff(run.time) for run in dataset.runs])))
    timing: Timing = "held"
    if row_s < _FOLLOWABLE_ROW_S:
        note = f"the rows are {1e3 * row_s:.2g} ms apart, so the inputs are taken as held"
    else:
        timing, note = _found(prepare(refined(dataset), model, seed=seed, jobs=jobs)[0], dataset, row_s)
    notes = tuple(note if one == input_timing.UNKNOWN_TIMING else one for one in dataset.notes)
    runs = tuple(with_linear_inputs(run) for run in dataset.runs) if timing == "linear" else dataset.runs
    return dataclasses.replace(dataset, runs=runs, notes=notes, input_timing=timing)


def _found(prepared: Prepared, logged: Dataset, row_s: float) -> tuple[Timing, str]:
    """Returns what the inputs do between rows ("held" if the runs do not decide it) and the sentence for the user.

    Args:
        prepared: the fit runs of `logged`, each row divided into several.
    """
    prepared, nominal = calibrate(prepared)
    stretch, _ = prepared.fine.stretches(CORRELATED_S)

    def losses(timing: Timing, behind: Behind) -> Array:
        """Returns (stretches,): the loss of each stretch."""
        compared = _with_inputs(prepared, logged, timing, behind)
        coarse = Problem(prepared.coarse.with_inputs(with_inputs_of(prepared.coarse.replay, compared)), nominal.plan)
        own = fit(coarse, (), nominal.plan, nominal.point, _TOLERANCE) or nominal
        loss = prepared.fine.with_inputs(Replay(compared, motor_step=MOTOR_STEP_S)).losses(own.model)
        return np.bincount(stretch, loss).astype(np.float64)

    held, linear = (_tried(functools.partial(losses, timing), row_s) for timing in TIMINGS)
    certainty, condition = _certainty(held.least, linear.least), ""
    if max(certainty, 1 - certainty) < numbers.SURE:
        certainty = _certainty(held.plain, linear.plain)
        other = f"linear inputs behind {linear.behind}" if certainty > 0.5 else f"held inputs behind {held.behind}"
        condition = f" if nothing delays them; {other} explain as much"
    timing, sure = TIMINGS[0 if certainty > 0.5 else 1], max(certainty, 1 - certainty)
    if sure < numbers.SURE:
        return "held", "whether the inputs hold or are linear between two rows, these runs do not tell: held is taken"
    return timing, f"between two rows the inputs are {timing}, found from the runs, {_percent(sure)} sure{condition}"


@dataclass(frozen=True)
class _Tried:
    """How well inputs of one kind, held or linear, explain the runs.

    Attributes:
        plain: (stretches,) the losses without delay or lag.
        behind: the delay or lag with the least loss.
        least: (stretches,) the losses with that delay or lag.
    """

    plain: Array
    behind: Behind
    least: Array


def _tried(losses: Callable[[Behind], Array], row_s: float) -> _Tried:
    """Returns the losses without delay or lag, and with the best delay or lag that a search finds."""
    tried = {Behind(): losses(Behind())}

    def total(seconds: float, kind: Kind) -> float:
        behind = Behind(kind, seconds)
        tried[behind] = losses(behind)
        return float(tried[behind].sum())

    for kind, rows in _ROWS.items():
        _, near = min((total(one * row_s, kind), one * row_s) for one in rows)
        bounds = (_LEAST * near, _MOST[kind] * near)
        minimize_scalar(total, args=(kind,), bounds=bounds, method="bounded", options={"maxiter": _TRIALS})
    best = min(tried, key=lambda one: float(tried[one].sum()))
    return _Tried(tried[Behind()], best, tried[best])


def _certainty(first: Array, second: Array) -> float:
    """Returns the probability, 0..1, that the model with losses `first` (stretches,) is nearer to the truth."""
    apart = second - first
    if not np.isfinite(apart).all() or np.ptp(apart) == 0:
        return 0.5
    return float(ttest_1samp(apart, 0.0, alternative="less").pvalue)


def _percent(sure: float) -> str:
    return f"{100 * min(sure, _SURELY):.3g} %"


def _with_inputs(prepared: Prepared, logged: Dataset, timing: Timing, behind: Behind) -> Dataset:
    """Returns the compared runs, or windows of runs, with inputs of the kind `timing` that are late by `behind`."""
    whole = {run.name: run for run in prepared.dataset.runs}
    acting = {run.name: inputs_acting(run, whole[run.name].time, timing, behind) for run in logged.runs}
    runs = []
    for run in prepared.compared.runs:
        name = run_of(run.name)
        rows = np.searchsorted(whole[name].time, run.time)
        inputs = {signal: values[rows] for signal, values in acting[name].items()}
        runs.append(dataclasses.replace(run, inputs=inputs))
    return dataclasses.replace(prepared.compared, runs=tuple(runs))


def with_known_sampling(dataset: Dataset, prepared: Prepared, nominal: Explanation) -> Dataset | None:
    """Returns the data set with accelerometer readings stated as instantaneous; None: not surely so, or stated already.

    Args:
        prepared: `dataset`, ready for fits.
        nominal: the calibrated nominal model.

    A sample that the data set does not describe counts as a mean unless the fit runs surely show an instant.
    """
    measured = {name for run in dataset.runs for name in run.outputs if name.startswith("accel_")}
    names = sorted(name for name in measured if name not in dataset.signals or dataset.signals[name].sampling is None)
    if not names or len(names) < len(measured):
        return None
    kinds: tuple[input_timing.Sampling, input_timing.Sampling] = ("instant", "mean")
    instant, mean = (_sampled_losses(prepared, nominal, _sampled(prepared.compared, names, kind)) for kind in kinds)
    sure = _certainty(instant, mean)
    if sure < numbers.SURE:
        return None
    note = (
        f"{', '.join(names)}: the data set does not state what a sample is. It is the instant, {_percent(sure)} sure "
        "from the runs, and is taken as such."
    )
    return dataclasses.replace(_sampled(dataset, names, "instant"), notes=(*dataset.notes, note))


def _sampled(dataset: Dataset, names: Sequence[str], kind: input_timing.Sampling) -> Dataset:
    own = {name: dataclasses.replace(dataset.signals[name], sampling=kind) for name in names if name in dataset.signals}
    return dataclasses.replace(dataset, signals={**dataset.signals, **own})


def _sampled_losses(prepared: Prepared, nominal: Explanation, compared: Dataset) -> Array:
    """Returns (stretches,): half the sum of squared residuals at the samples, after one step of least squares.

    The step adapts the parameters to the kind of sample. Means over bins would hide a shift of half a sample.
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
