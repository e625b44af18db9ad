"""One round of the search: screens all candidates beside a model and fits the best of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, read_limits
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
from brickpilot.discover.screen import Trial

Array = NDArray[np.float64]

_FITTED = 10  # candidates of a screen that are fitted
_REFINED = 5  # of those, that are fitted to the end
_NEAR_BEST = 0.2  # of the best one's gain: only those nearer to it are fitted to the end
_ORDER_OFFSETS = np.linspace(-0.08, 0.08, 161).tolist()  # shares of an order by which it may be wrong
_LOWER = 0.98  # of the cost: another order is worth a descent below it


@dataclass(frozen=True)
class Start:
    """Where a fit of a candidate starts: its values, and the (parameters,) point of the model that it joins."""

    candidate: Candidate
    values: Mapping[str, float]
    point: Array


class Source(Protocol):
    """The candidates of a search: effects of the library, or terms without a name.

    Attributes:
        word: what one is called.
        most: so many are added at most.
        pairs: candidates may also be tried two at once.
        excitation: how far the vehicle was driven.
    """

    word: str
    most: int
    pairs: bool
    excitation: Excitation

    def screened(self, error: BinnedOutputError, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns what is worth a fit beside the model of `error` at `point`, the best first."""

    def nearby(self, error: BinnedOutputError, current: FittedModel, fits: Sequence[FittedModel]) -> list[Start]:
        """Returns what is worth a fit because of `fits`, which were made beside `current`."""

    def is_finished(self, error: BinnedOutputError, current: FittedModel) -> bool:
        """Returns whether nothing more can be added to `current`."""


def try_candidates(
    error: BinnedOutputError, source: Source, current: FittedModel, jobs: int, deadline: Deadline = NO_LIMIT
) -> list[FittedModel]:
    """Returns the best candidates fitted beside `current`, the best one first.

    Where the fit had to move nominal values far beyond what is known of them, candidates are tried from the stated
    values too: an effect must not hide in a nominal value.
    """
    points = [current.point]
    if largest_prior_shift(error, current) > PRIOR_STRAINED_SD:
        points.append(_at_stated_values(current))
    rough = [found for point in points for found in _fit_screened(error, source, current, point, jobs, deadline)]
    if rough and (first := best_first(rough)[0]).chosen[-1].is_periodic and (other := _with_better_order(error, first)):
        rough.append(other)
    best = min((one.penalised_cost for one in rough), default=0.0)
    limit = best + _NEAR_BEST * max(current.cost - best, 0.0)
    near = [one for one in best_first(rough) if one.penalised_cost < limit][:_REFINED]
    refined = [one for one in refine(error, near, jobs, deadline) if not ends_at_a_bound(one)]
    refined = [one for one in refined if agrees_with_its_name(one, source.excitation)]
    return best_first(refined + [one for one in rough if one not in near])


def instead_of_moved_values(
    error: BinnedOutputError, source: Source, current: FittedModel, jobs: int, deadline: Deadline
) -> list[FittedModel]:
    """Returns the candidates that explain the data with nominal values as they were stated, the best one first.

    What they gain over `current`, which moved those values, is at most the cost of the priors, so that less is asked
    for than of an effect that explains a gap.
    """
    rough = _fit_screened(error, source, current, _at_stated_values(current), jobs, deadline, PARAMETER_COST)
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
    source: Source,
    current: FittedModel,
    point: Array,
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

    def promises(trial: Trial) -> bool:
        promised = PROMISED_SHARE * required_gain(trial.after, error.floor_cost()) if least is None else least
        return trial.before - trial.after > promised

    def one(start: Start) -> FittedModel | None:
        plan = start.candidate.starting(current.plan, start.values)
        begin = np.concatenate([start.point, plan.start()[len(start.point) :]])
        return fit(here, (*current.chosen, start.candidate), plan, begin, ROUGH)

    trials = [trial for trial in source.screened(here, point, deadline) if promises(trial)]
    starts = [Start(trial.candidate, trial.values, point) for trial in trials[:_FITTED]]
    fits = fit_each(one, starts, jobs, deadline)
    fits += fit_each(one, source.nearby(here, current, fits), jobs, deadline)
    return [found for found in fits if agrees_with_its_name(found, source.excitation)]


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
