"""One round of the search: screens all candidates beside a model and fits the best of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, candidates, read_limits
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.fitting import ROUGH, FittedModel, best_first, fit, fit_each, refine
from brickpilot.discover.gates import (
    AT_BOUND,
    LEAST_BASE_SHARE,
    LIMIT_OVER_READING,
    PARAMETER_COST,
    PRIOR_LEFT_SD,
    PRIOR_STRAINED_SD,
    PROMISED_SHARE,
    required_gain,
)
from brickpilot.discover.screen import Trial, screen

Array = NDArray[np.float64]

_FITTED = 10  # candidates of a screen that are fitted
_REFINED = 5  # of those, that are fitted to the end
_NEAR_BEST = 0.2  # of the best one's gain: only those nearer to it are fitted to the end
_ORDER_OFFSETS = np.linspace(-0.08, 0.08, 161).tolist()  # shares of an order by which it may be wrong
_LOWER = 0.98  # of the cost: another order is worth a descent below it


def try_candidates(
    error: BinnedOutputError, current: FittedModel, excitation: Excitation, jobs: int, deadline: Deadline = NO_LIMIT
) -> list[FittedModel]:
    """Returns the best candidates fitted beside `current`, the best one first.

    Where the fit had to move nominal values far beyond what is known of them, candidates are tried from the stated
    values too: an effect must not hide in a nominal value.
    """
    points = [current.point]
    if largest_prior_shift(error, current) > PRIOR_STRAINED_SD:
        points.append(_at_stated_values(current))
    rough = [found for point in points for found in _fit_screened(error, current, point, excitation, jobs, deadline)]
    if rough and (first := best_first(rough)[0]).chosen[-1].is_periodic and (other := _with_better_order(error, first)):
        rough.append(other)
    best = min((one.penalised_cost for one in rough), default=0.0)
    limit = best + _NEAR_BEST * max(current.cost - best, 0.0)
    near = [one for one in best_first(rough) if one.penalised_cost < limit][:_REFINED]
    refined = [one for one in refine(error, near, jobs, deadline) if not ends_at_a_bound(one)]
    refined = [one for one in refined if agrees_with_its_name(one, excitation)]
    return best_first(refined + [one for one in rough if one not in near])


def instead_of_moved_values(
    error: BinnedOutputError, current: FittedModel, excitation: Excitation, jobs: int, deadline: Deadline
) -> list[FittedModel]:
    """Returns the candidates that explain the data with nominal values as they were stated, the best one first.

    What they gain over `current`, which moved those values, is at most the cost of the priors, so that less is asked
    for than of an effect that explains a gap.
    """
    rough = _fit_screened(error, current, _at_stated_values(current), excitation, jobs, deadline, PARAMETER_COST)
    released = [one for one in best_first(rough) if largest_prior_shift(error, one) < PRIOR_LEFT_SD]
    return refine(error, released[:_REFINED], jobs, deadline)


def largest_prior_shift(error: BinnedOutputError, found: FittedModel) -> float:
    """Returns how many sd the fit moved the nominal value that it moved most."""
    return float(np.abs(error.with_plan(found.plan).prior_rows(found.point)[0]).max(initial=0.0))


def _at_stated_values(current: FittedModel) -> Array:
    """Returns the point of `current` with the nominal parameters as they were stated."""
    start = current.plan.start()
    stated = [one.known is not None for one in current.plan.free]
    return np.where(stated, start, current.point)


def _fit_screened(
    error: BinnedOutputError,
    current: FittedModel,
    point: Array,
    excitation: Excitation,
    jobs: int,
    deadline: Deadline,
    least: float | None = None,
) -> list[FittedModel]:
    """Returns the most promising candidates, fitted beside `current` from `point`.

    Args:
        least: the cost that a candidate has to promise to gain; None: a share of what an effect has to gain.
    """
    here = error.with_plan(current.plan)
    here.keep_sensitivities(point, len(point))
    first: dict[tuple[str, tuple[str, ...]], Trial] = {}
    chosen = candidates(current.model, here.signals)
    for trial in screen(here, point, chosen, excitation=excitation, deadline=deadline):
        promised = PROMISED_SHARE * required_gain(trial.after, error.floor_cost()) if least is None else least
        if trial.before - trial.after > promised:
            first.setdefault((trial.candidate.effect, trial.candidate.free), trial)

    def one(trial: Trial) -> FittedModel | None:
        plan = trial.candidate.starting(current.plan, trial.values)
        start = np.concatenate([point, plan.start()[len(point) :]])
        return fit(here, (*current.chosen, trial.candidate), plan, start, ROUGH)

    fits = fit_each(one, list(first.values())[:_FITTED], jobs, deadline)
    two_phases = _with_one_phase(current, fits)
    fits += fit_each(lambda pair: _with_two_phases(here, current, *pair), two_phases, jobs, deadline)
    return [found for found in fits if agrees_with_its_name(found, excitation)]


def _with_one_phase(current: FittedModel, fits: Sequence[FittedModel]) -> list[tuple[FittedModel, Candidate]]:
    """Returns those of `fits` that gave both wheels one phase, each with the candidate that gives them two."""
    return [
        (found, other)
        for found in fits
        for other in candidates(current.model)
        if other.effect == found.names[-1] and {*other.free} - {*found.chosen[-1].free} == {"phase_difference"}
    ]


def _with_two_phases(
    error: BinnedOutputError, current: FittedModel, found: FittedModel, candidate: Candidate
) -> FittedModel | None:
    """Returns `candidate` fitted beside `current` from where `found` ended.

    The linear screen cannot find two phases at once: it starts from no effect, where the wheels stop and slip in turn.
    """
    plan = candidate.starting(current.plan, found.model.effects[candidate.effect])
    start = np.concatenate([found.point[: len(current.point)], plan.start()[len(current.point) :]])
    return fit(error, (*current.chosen, candidate), plan, start, ROUGH)


def _with_better_order(error: BinnedOutputError, found: FittedModel) -> FittedModel | None:
    """Returns `found`, whose last effect is periodic, fitted from the best order near its own; None if that is best.

    Near the right order lie others that differ by one turn over the travel. Each has a valley that a descent stays in.
    """
    problem = error.with_plan(found.plan)
    index = [one.name for one in found.plan.free].index(f"{found.names[-1]}.order")
    direction = np.eye(len(found.point))[index]
    starts = [found.point + offset * direction for offset in _ORDER_OFFSETS]
    costs = [float(problem.losses(found.plan.at(start)).sum()) for start in starts]
    best = int(np.argmin(costs))
    if costs[best] > _LOWER * float(problem.losses(found.model).sum()):
        return None
    return fit(problem, found.chosen, found.plan, starts[best], ROUGH)


def ends_at_a_bound(found: FittedModel) -> bool:
    """Returns whether a fitted parameter of an effect stands at the end of its range: the data ask for another law."""
    for one in found.chosen:
        for info in catalogue.effect(one.effect).parameters:
            value = found.model.effects[one.effect].get(info.name, info.preset)
            away = min(abs(value - end) for end in (info.minimum, info.maximum) if end != 0)
            if info.name in one.free and away < AT_BOUND * abs(value):
                return True
    return False


def agrees_with_its_name(found: FittedModel, excitation: Excitation) -> bool:
    """Returns whether the fitted values are possible for effects of these names.

    A periodic effect has at least about one period. A sensor never reads beyond its limit. A parameter that adds to
    another, as a breakaway torque adds to dry friction, does not replace it.
    """
    tables = found.model.effects
    periodic = all(tables[one.effect]["order"] >= excitation.least_order for one in found.chosen if one.is_periodic)
    limits = [(tables[one.effect][name], signal) for one in found.chosen for name, signal in read_limits(one)]
    additions = [
        (table[info.only_with], table[info.name])
        for name, table in tables.items()
        for info in catalogue.effect(name).parameters
        if info.only_with
    ]
    return (
        periodic
        and all(limit > LIMIT_OVER_READING * excitation.largest.get(signal, 0.0) for limit, signal in limits)
        and all(base > LEAST_BASE_SHARE * added for base, added in additions)
    )
