"""Values that differ from run to run: estimated from what the best explanation leaves, and taken out of the data.

They are random effects: values of the runs about a mean, which belongs to the model and its effects. They are looked
for last, so that they never take what an effect explains.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.discover import gates
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.fitting import FittedModel, without
from brickpilot.discover.prepare import Prepared, part
from brickpilot.discover.windows import run_of
from brickpilot.fit.random_effects import RandomEffects, random_effects
from brickpilot.fit.robust import pseudo_huber, pseudo_huber_loss
from brickpilot.fit.run_values import KINDS, Kind, RunValue, RunValues, inputs_of, with_values

Array = NDArray[np.float64]

_STEP = 2e-3  # of finite differences: a share, or s
_WEAK_SD = 0.3  # a share, or s: of the prior that holds a value of which a run says nothing
_IN_95 = 1.96  # sd of a normal distribution
_DESCENT = 12  # steps, at most
_RESTARTS = 3  # of a descent, at most
_LEAST_FALL = 1e-3  # of the cost: a step that gains less is the last


@dataclass(frozen=True)
class _Fit:
    """Values of the runs fitted together with the model's parameters.

    Attributes:
        kind: None: no values.
        values: (runs,).
        cost: half of all squared residuals and priors, in scales.
        residual, slopes: (samples,) robust residual, and its slope along the value of the sample's run.
        normal, downhill: matrix and right side of the normal equations of a step, parameters first.
    """

    kind: Kind | None
    values: Array
    point: Array
    cost: float
    residual: Array
    slopes: Array
    normal: Array
    downhill: Array


class _Problem:
    """The residual of the fit runs for a model's parameters and for values of the runs, on the coarse grid."""

    def __init__(self, prepared: Prepared, found: FittedModel) -> None:
        self.prepared, self.plan, self.start = prepared, found.plan, found.point
        self.error: BinnedOutputError = prepared.coarse.with_plan(found.plan)
        self.runs = list(dict.fromkeys(run_of(block.run) for block in self.error.blocks))
        self.run_of_sample = np.empty(len(self.error.measured), dtype=np.intp)
        self.time = np.empty(len(self.error.measured))
        for block in self.error.blocks:
            self.run_of_sample[block.place] = self.runs.index(run_of(block.run))
            self.time[block.place] = block.middle

    def with_values(self, kind: Kind | None, values: Array) -> BinnedOutputError:
        """Returns the residual under the inputs that these values give; without a kind those of the data set."""
        if kind is None:
            return self.error
        by_name = dict(zip(self.runs, values.tolist(), strict=True))
        return self.error.with_inputs(_compared_with(self.prepared, kind, by_name))

    def residual(self, kind: Kind | None, values: Array, point: Array) -> Array:
        """Returns (samples,): measured less simulated, in scales; NaN where the plant diverges."""
        return self.with_values(kind, values).residual_of(self.plan.at(point))

    def cost(self, residual: Array, values: Array, point: Array) -> float:
        prior = self.error.prior_rows(point)[0]
        total = pseudo_huber_loss(residual).sum() + np.sum(prior**2) / 2 + np.sum((values / _WEAK_SD) ** 2) / 2
        return float(total) if np.isfinite(total) else float("inf")

    def by_run(self, values: Array) -> Array:
        """Returns (runs,): the sums of (samples,) over each run."""
        return np.bincount(self.run_of_sample, values, len(self.runs)).astype(np.float64)


def _compared_with(prepared: Prepared, kind: Kind, values: Mapping[str, float]) -> Dataset:
    """Returns the compared runs with the inputs that these values give."""
    whole = with_values(prepared.dataset, kind, values)
    return whole if prepared.compared is prepared.dataset else inputs_of(whole, prepared.compared, run_of)


def with_run_values(prepared: Prepared, found: RunValues) -> Prepared:
    """Returns the same data with the inputs that these values give, and with the weights of now.

    A run without a value of its own has the mean.
    """
    values = {run.name: found.mean for run in prepared.dataset.runs}
    values |= {name: one.value for name, one in found.runs.items()}
    dataset, compared = with_values(prepared.dataset, found.kind, values), _compared_with(prepared, found.kind, values)
    samples, threads = part(compared, prepared.roles, "fit"), prepared.jobs
    errors = []
    for now, coarse in ((prepared.coarse, True), (prepared.fine, False)):
        runs = list(dict.fromkeys(block.run for block in now.blocks))
        error = BinnedOutputError(compared, prepared.plan, runs, coarse=coarse, threads=threads, samples=samples)
        error.adopt_scales(now)
        errors.append(error)
    return dataclasses.replace(
        prepared,
        measured=with_values(prepared.measured, found.kind, values),
        dataset=dataset,
        compared=dataset if prepared.compared is prepared.dataset else compared,
        coarse=errors[0],
        fine=errors[1],
    )


def values_that_differ(prepared: Prepared, best: FittedModel, kinds: Collection[Kind] = KINDS) -> RunValues | None:
    """Returns the kind of values that differs from run to run beside the explanation `best`; None: none does.

    Of several kinds it is the one that explains most. See `gates` for what it has to gain and to show.
    """
    problem = _Problem(prepared, best)
    floor = problem.error.floor_cost()
    if len(problem.runs) < gates.LEAST_RUNS_THAT_DIFFER or best.cost - prepared.fine.noise_cost() < gates.LEAST_GAIN:
        return None
    base = _descend(problem, None, np.zeros(len(problem.runs)), best.point)
    before = base.cost + gates.parameter_cost(base.cost, floor) * best.parameter_count
    tried: list[tuple[float, _Problem, _Fit]] = []
    for kind in kinds:
        own = _without_timing(problem, best) if kind.is_whole else problem
        fitted = _fitted(own, kind)
        count = len(own.runs) + len(own.plan.free) - len(problem.plan.free) + best.parameter_count
        tried.append((fitted.cost + gates.parameter_cost(fitted.cost, floor) * count, own, fitted))
    for after, own, fitted in sorted(tried, key=lambda one: one[0]):
        if gates.gains_enough(before, after, floor) and (found := _judged(own, fitted, base)) is not None:
            return found
    return None


def pays(prepared: Prepared, before: FittedModel, after: FittedModel, values: RunValues) -> bool:
    """Returns whether the explanation `after`, with values of the runs, gains enough over `before` without them."""
    floor = prepared.fine.floor_cost()
    each = gates.parameter_cost(after.cost, floor)
    return gates.gains_enough(before.penalised_cost, after.penalised_cost + each * len(values.runs), floor)


def _without_timing(problem: _Problem, best: FittedModel) -> _Problem:
    """Returns the problem without the effects of timing: the runs' own values take their place."""
    timing = {one.name for one in catalogue.effects_of(best.names) if one.mechanism == "timing"}
    replaced = [one for one in best.chosen if one.effect in timing]
    for one in replaced:
        best = without(best, one)
    return _Problem(problem.prepared, best) if replaced else problem


def _fitted(problem: _Problem, kind: Kind) -> _Fit:
    """Returns the best fit with values of a kind.

    A descent starts from the best of the values that are tried for each run, and again where a run then fits better
    with another one: a value at which nothing depends on it leads nowhere.
    """
    nothing = np.zeros(len(problem.runs))
    found = _descend(problem, kind, _best_tried(problem, kind, nothing, problem.start), problem.start)
    for _ in range(_RESTARTS if kind.tried else 0):
        values = _best_tried(problem, kind, found.values, found.point)
        if np.array_equal(values, found.values):
            break
        again = _descend(problem, kind, values, found.point)
        if again.cost >= found.cost:
            break
        found = again
    return found


def _best_tried(problem: _Problem, kind: Kind, values: Array, point: Array) -> Array:
    """Returns for each run the best of its value and of those that are tried."""
    tried = [values, *(np.full(len(values), one) for one in kind.tried)]
    losses = [problem.by_run(pseudo_huber_loss(problem.residual(kind, one, point))) for one in tried]
    best = np.argmin(np.nan_to_num(np.array(losses), nan=np.inf), axis=0)
    return np.asarray(np.array(tried)[best, np.arange(len(values))], dtype=np.float64)


def _descend(problem: _Problem, kind: Kind | None, values: Array, point: Array) -> _Fit:
    """Returns the end of a descent by damped Gauss-Newton steps; without a kind the values stay.

    The value of a run touches the samples of that run alone, so one simulation with all runs changed gives the slopes
    along all of them.
    """
    bounds = np.array([one.bounds() for one in problem.plan.free]).reshape(-1, 2)
    residual = problem.residual(kind, values, point)
    cost = problem.cost(residual, values, point)
    for _ in range(_DESCENT):
        now = _linear(problem, kind, values, point, residual, cost)
        step = np.linalg.lstsq(now.normal, now.downhill, rcond=1e-12)[0]
        for share in (1.0, 0.5, 0.25, 0.1):
            moved = point + share * step[: len(point)]
            moved = np.clip(moved, *bounds.T) if len(bounds) else moved
            other = values if kind is None else np.clip(values + share * step[len(point) :], kind.low, kind.high)
            after = problem.residual(kind, other, moved)
            if (lower := problem.cost(after, other, moved)) < cost:
                break
        else:
            return now
        fall, values, point, residual, cost = cost - lower, other, moved, after, lower
        if fall < _LEAST_FALL * cost:
            break
    return _linear(problem, kind, values, point, residual, cost)


def _linear(problem: _Problem, kind: Kind | None, values: Array, point: Array, residual: Array, cost: float) -> _Fit:
    """Returns the fit at these values with its slopes and the normal matrix."""
    robust = pseudo_huber(residual)
    slopes = np.zeros(len(residual))
    if kind is not None:
        inward = np.where(values + _STEP <= kind.high, _STEP, -_STEP)
        moved = problem.residual(kind, values + inward, point)
        slopes = np.nan_to_num((moved - residual) / inward[problem.run_of_sample]) * robust.slope
    here = problem.with_values(kind, values)
    along = -here.sensitivity(point) * (here.weight() * robust.slope)[:, np.newaxis]
    missed, prior = problem.error.prior_rows(point)
    crossed = np.array([problem.by_run(column * slopes) for column in along.T]).reshape(len(point), -1)
    normal = np.block(
        [
            [along.T @ along + prior.T @ prior, crossed],
            [crossed.T, np.diag(problem.by_run(slopes**2) + _WEAK_SD**-2)],
        ]
    )
    pull = problem.by_run(slopes * robust.value) + values / _WEAK_SD**2
    downhill = np.concatenate([-along.T @ robust.value - prior.T @ missed, -pull])
    return _Fit(kind, values, point, cost, robust.value, slopes, normal, downhill)


def _judged(problem: _Problem, fitted: _Fit, base: _Fit) -> RunValues | None:
    """Returns the values of the runs if they differ by more than chance and belong to the runs; else None."""
    kind, first = fitted.kind, len(fitted.point)
    if kind is None or np.ptp(fitted.values) == 0:
        return None
    covariance = np.asarray(np.linalg.pinv(fitted.normal, hermitian=True)[first:, first:], dtype=np.float64)
    least = np.eye(len(fitted.values))[np.argmin(fitted.values)] if kind.counts_from == "least" else None
    found = random_effects(fitted.values, covariance * _repeated(problem, fitted), least)
    if found.chance > gates.RUNS_DIFFER_CHANCE or _follows_the_drive(problem, found.deviations):
        return None
    if kind.all_through and _half_predicts_half(problem, fitted, found) < gates.HALF_PREDICTS_HALF:
        return None
    values, sds = (found.values, found.value_sds) if kind.is_whole else (found.deviations, found.deviation_sds)
    runs = {
        name: RunValue(value, (value - _IN_95 * sd, value + _IN_95 * sd))
        for name, value, sd in zip(problem.runs, values.tolist(), sds.tolist(), strict=True)
    }
    removed = 1 - fitted.cost / base.cost
    mean = 0.0 if kind.counts_from == "mean" else float(np.mean(values))
    return RunValues(kind, mean, found.sd, runs, removed, applied=not kind.is_whole)


def _repeated(problem: _Problem, fitted: _Fit) -> float:
    """Returns how many times white noise's the variance of the scores is: residuals of a stretch are correlated."""
    numbers, count = problem.error.stretches_of(gates.CORRELATED_S)
    scores = np.bincount(numbers, fitted.slopes * fitted.residual, count)
    return max(1.0, float(np.sum(scores**2) / max(np.sum(fitted.slopes**2), 1e-300)))


def _half_predicts_half(problem: _Problem, fitted: _Fit, found: RandomEffects) -> float:
    """Returns the share of what one half of each run asks for that the other half's value predicts; 1: all of it."""
    middle = np.array([np.mean(problem.time[problem.run_of_sample == number]) for number in range(len(problem.runs))])
    late = problem.time > middle[problem.run_of_sample]
    mean = float(np.mean(found.values))
    asked = missed = 0.0
    halves = []
    for half in (late, ~late):
        weight = problem.by_run(np.where(half, fitted.slopes**2, 0.0))
        pull = problem.by_run(np.where(half, fitted.slopes * fitted.residual, 0.0))
        halves.append((weight, fitted.values - pull / np.maximum(weight, 1e-300)))
    (weight_a, value_a), (weight_b, value_b) = halves
    told = np.minimum(weight_a, weight_b) > 0.01 * np.maximum(weight_a, weight_b)
    for weight, value, other in ((weight_a, value_a, value_b), (weight_b, value_b, value_a)):
        asked += float(np.sum((weight * (value - mean) ** 2)[told]))
        missed += float(np.sum((weight * (value - other) ** 2)[told]))
    return 1 - missed / asked if asked > 0 else 0.0


def _follows_the_drive(problem: _Problem, deviations: Array) -> bool:
    """Returns whether the values follow the runs' age, the mean or rms of a voltage, or how much the vehicle turns."""
    dataset = problem.prepared.dataset
    age, drives = 0.0, {}
    for run in dataset.runs:
        age += run.gap_s
        driven = np.nan_to_num(motor_inputs(run, dataset))
        turning = np.mean(np.diff(driven, axis=1) ** 2, axis=0)
        squares = np.mean(driven**2, axis=0)
        drives[run.name] = [age, *driven.mean(axis=0), *squares**0.5, np.sum(squares) ** 0.5, *turning**0.5]
        age += float(run.time[-1] - run.time[0])
    table = np.array([drives[name] for name in problem.runs]).T
    pairs = [(column, deviations) for column in table if np.ptp(column) > 0]
    pairs += [(rankdata(column), rankdata(values)) for column, values in pairs]
    return any(abs(np.corrcoef(one, other)[0, 1]) > gates.FOLLOWS_THE_DRIVE for one, other in pairs)
