"""Fits a model with a set of candidates to the fit runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, sizes_of
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.gates import parameter_cost
from brickpilot.errors import SimulationError
from brickpilot.fit.descent import descend
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
_Item = TypeVar("_Item")

ROUGH = 1e-3
"""Relative change of cost at which a descent of the search ends."""
_REFINED = 1e-4
_DESCENTS, _LEAST_GAIN_SHARE = 6, 3e-4  # descents of one refinement, at most; one that gains less is the last


@dataclass(frozen=True, eq=False)
class FittedModel:
    """One model fitted to the fit runs.

    Attributes:
        chosen: the candidates that it has beside what the base model holds.
        cost: half of all squared residuals and priors, in scales.
        penalised_cost: the cost with the penalties for the parameters of its candidates.
        losses: (samples,) the part of the cost that each sample adds.
    """

    chosen: tuple[Candidate, ...]
    plan: Plan
    point: Array
    cost: float
    penalised_cost: float
    losses: Array

    @property
    def model(self) -> Model:
        return self.plan.at(self.point)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its effects."""
        return tuple(one.effect for one in self.chosen)

    @property
    def is_periodic(self) -> bool:
        """Whether one of its effects repeats with the angle of a wheel."""
        return any(one.is_periodic for one in self.chosen)

    @property
    def parameter_count(self) -> int:
        """The number of free parameters of its candidates; those of one effect may share some."""
        return len({(one.effect, name) for one in self.chosen for name in one.free})


def fit(
    error: BinnedOutputError, chosen: Sequence[Candidate], plan: Plan, point: Array, tolerance: float
) -> FittedModel | None:
    """Returns the end of a descent from `point`; None where the plant diverges there."""
    problem = error.with_plan(plan, threads=1)
    try:
        end = descend(problem, point, tolerance)
    except SimulationError:
        return None
    return rated(problem, unfitted(tuple(chosen), plan, end))


def rated(error: BinnedOutputError, found: FittedModel) -> FittedModel:
    """Returns `found` with its costs in the data and at the scales of `error`."""
    problem = error if error.plan is found.plan else error.with_plan(found.plan)
    residual = problem.residual(found.point)
    losses = residual[: len(problem.measured)] ** 2 / 2
    cost = float(np.sum(residual**2)) / 2
    penalty = parameter_cost(cost, problem.floor_cost()) * found.parameter_count
    penalty += sum(one.penalty(found.chosen[:k], cost) for k, one in enumerate(found.chosen))
    return dataclasses.replace(found, cost=cost, penalised_cost=cost + penalty, losses=losses)


def refine(
    error: BinnedOutputError, fits: Sequence[FittedModel], jobs: int, deadline: Deadline = NO_LIMIT
) -> list[FittedModel]:
    """Fits each model to the end, with sensitivities of its own, and returns them with the best one first.

    Sensitivities of nominal parameters cost most. They are computed once per descent, and descents are repeated until
    one gains nothing.
    """

    def one(found: FittedModel) -> FittedModel | None:
        for _ in range(_DESCENTS):
            own = error.with_plan(found.plan, threads=1)
            own.keep_sensitivities(found.point, len(found.point) - found.parameter_count)
            better = fit(own, found.chosen, found.plan, found.point, _REFINED)
            if better is None:
                return None
            gain, found = found.cost - better.cost, better
            if gain < _LEAST_GAIN_SHARE * better.cost or deadline.passed:
                break
        return found

    return best_first(fit_each(one, fits, jobs, deadline))


def without(found: FittedModel, candidate: Candidate) -> FittedModel:
    """Returns `found` without one of its candidates, at the same values of the others; it has to be fitted again."""
    model = candidate.removed_from(found.plan.model)
    kept = [k for k, one in enumerate(found.plan.free) if _is_in(one, model)]
    plan = Plan(model, tuple(found.plan.free[index] for index in kept), ())
    chosen = tuple(one for one in found.chosen if one is not candidate)
    return unfitted(chosen, plan, found.point[kept])


def _is_in(free: Free, model: Model) -> bool:
    return free.effect is None or free.effect[1] in model.effects.get(free.effect[0], {})


def without_parameter(found: FittedModel, candidate: Candidate, name: str) -> FittedModel:
    """Returns `found` with one parameter of `candidate` held at zero; without the effect if it has no size left."""
    left = tuple(one for one in candidate.free if one != name)
    smaller = dataclasses.replace(candidate, free=left, fixed={**candidate.fixed, name: 0.0})
    if not sizes_of(smaller):
        return without(found, candidate)
    kept = [index for index, one in enumerate(found.plan.free) if one.name != f"{candidate.effect}.{name}"]
    table = {**found.plan.model.effects[candidate.effect], name: 0.0}
    model = dataclasses.replace(found.plan.model, effects={**found.plan.model.effects, candidate.effect: table})
    plan = Plan(model, tuple(found.plan.free[index] for index in kept), ())
    chosen = tuple(smaller if one is candidate else one for one in found.chosen)
    return unfitted(chosen, plan, found.point[kept])


def unfitted(chosen: tuple[Candidate, ...], plan: Plan, point: Array) -> FittedModel:
    """Returns a start for `refine`, with infinite cost."""
    return FittedModel(chosen, plan, point, np.inf, np.inf, np.empty(0))


def fit_each(
    work: Callable[[_Item], FittedModel | None], items: Sequence[_Item], jobs: int, deadline: Deadline = NO_LIMIT
) -> list[FittedModel]:
    """Returns the results of `work` in the order of `items`, without None. Runs `jobs` at a time.

    The first item is always worked on; those behind it only before the deadline.
    """

    def one(item: _Item) -> FittedModel | None:
        return work(item) if item is items[0] or not deadline.passed else None

    with ThreadPoolExecutor(jobs) as pool:
        return [found for found in pool.map(one, items) if found is not None]


def best_first(fits: Sequence[FittedModel]) -> list[FittedModel]:
    """Returns the models in the order of their penalised cost."""
    return sorted(fits, key=lambda one: one.penalised_cost)
