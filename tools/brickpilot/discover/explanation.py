"""An explanation: a model with added parts (effects, composed terms, values of runs) after one fit of all values."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.parts import Excitation, Part, least_of, read_limits
from brickpilot.errors import SimulationError
from brickpilot.fit.descent import descend
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual
from brickpilot.side_by_side import side_by_side
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

ROUGH, FINE = 1e-3, 1e-4
"""Relative change of cost below which a descent ends: for a proposed explanation, and for a judged one."""

_DESCENTS, _LEAST_GAIN_SHARE = 6, 3e-4  # largest number of descents of a fine fit; a smaller relative gain ends the fit
_AT_BOUND = 1e-3  # a parameter is at an end of its range if it differs from the end by less than this share of itself
_WHOLE = (0, 1)  # a value may be at these ends of a range: a real machine may have none of an effect, or all
_LIMIT_OVER_READING = 0.9  # least ratio of a sensor's limit to its largest reading: noise may exceed the limit
_LEAST_BASE_SHARE = 0.1  # least ratio of a parameter to one that adds to it, such as dry friction to breakaway torque


@dataclass(frozen=True, eq=False)
class Explanation:
    """One model fitted to the fit runs.

    Attributes:
        parts: what it adds to the nominal model: effects, composed terms, and values of runs.
        plan: its free parameters, the nominal parameters first.
        point: the fitted coordinates of these parameters.
        cost: half the sum of squares: of residuals, in scales, and of distances from priors, in sd.
    """

    parts: tuple[Part, ...]
    plan: Plan
    point: Array
    cost: float = np.inf

    @property
    def model(self) -> Model:
        return self.plan.at(self.point)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of its parts, in the order in which they joined."""
        return tuple(part.name for part in self.parts)

    @cached_property
    def key(self) -> frozenset[str]:
        return frozenset(self.names)

    @property
    def log_odds(self) -> float:
        """The log of the prior odds of all its parts together."""
        return sum(part.log_odds for part in self.parts)

    @property
    def is_periodic(self) -> bool:
        """Whether one of its effects repeats with the angle of a wheel."""
        return any(part.is_periodic for part in self.parts)

    @property
    def parameter_count(self) -> int:
        """The number of free parameters of its parts."""
        return sum(any(part.owns(free) for part in self.parts) for free in self.plan.free)

    @cached_property
    def offsets(self) -> frozenset[str]:
        """The names of its effects that are offsets of readings: constants, which have no shape that could be wrong."""
        return frozenset(part.name for part in self.effects if catalogue.effect(part.effect).shapeless)

    @property
    def effects(self) -> tuple[Part, ...]:
        """Its parts that are effects of the library."""
        return tuple(part for part in self.parts if type(part) is Part)

    def says(self, part: Part) -> bool:
        """Returns whether this explanation holds `part`, a law that contains it, or all laws that make up `part`."""
        return part.name in self._said or (bool(part.made_of) and self._said.issuperset(part.made_of))

    def contains(self, other: Explanation) -> bool:
        """Returns whether this explanation covers every part of `other`, with different laws and no fewer parts."""
        if self.laws == other.laws or len(self.parts) < len(other.parts):
            return False
        if len(self.parts) > len(other.parts):
            return all(self.says(part) for part in other.parts)
        return self._said >= other.key

    @cached_property
    def _said(self) -> frozenset[str]:
        """The names of its parts, and of the laws that its parts contain."""
        return self.key.union(*(part.contains for part in self.parts))

    @cached_property
    def laws(self) -> frozenset[str]:
        """The names of its laws. The sum of several laws is replaced by these laws if one of them is also a part.

        For example, friction in one direction is the sum of dry friction and a constant offset. If the explanation also
        has an offset, friction in one direction is replaced by these two laws.
        """
        split = [part for part in self.parts if self.key.intersection(part.made_of)]
        return self.key.difference(part.name for part in split).union(*(part.made_of for part in split))


def fit(
    base: Problem, parts: Sequence[Part], plan: Plan, point: Array, tolerance: float, threads: int = 1
) -> Explanation | None:
    """Returns the fit at the end of a descent from `point`; None if the plant diverges at `point`."""
    problem = base.of(plan, threads)
    try:
        end = descend(problem, point, tolerance)
    except SimulationError:
        return None
    return Explanation(tuple(parts), plan, end, problem.cost(end))


def refine(data: Residual, fits: Sequence[Explanation], jobs: int, deadline: Deadline = NO_LIMIT) -> list[Explanation]:
    """Fits each explanation until a descent gains almost nothing. Returns the fits, the least cost first.

    Sensitivities to nominal parameters take most time, so each descent computes them only once, at its start.
    """

    threads = jobs if len(fits) == 1 else 1  # a single fit simulates in parallel; several fits run side by side

    def one(found: Explanation) -> Explanation | None:
        for _ in range(_DESCENTS):
            own = Problem(data.on_threads(threads), found.plan)
            own = own.keeping(found.point, len(found.point) - found.parameter_count)
            better = fit(own, found.parts, found.plan, found.point, FINE, threads)
            if better is None:
                return None
            gain, found = found.cost - better.cost, better
            if gain < _LEAST_GAIN_SHARE * better.cost or deadline.passed:
                break
        return found

    found = [one for one in before(deadline, one, fits, jobs) if one is not None]
    return sorted(found, key=lambda one: one.cost)


def joined(base: Explanation, part: Part, values: Mapping[str, float]) -> Explanation:
    """Returns `base` with one more part at `values`; it is not fitted here."""
    plan = part.starting(base.plan, values)
    return Explanation((*base.parts, part), plan, np.concatenate([base.point, plan.start()[len(base.point) :]]))


def without(found: Explanation, part: Part) -> Explanation:
    """Returns `found` without one of its parts. The values of the other parts stay; nothing is fitted here."""
    model = part.removed_from(found.plan.model)
    kept = [k for k, one in enumerate(found.plan.free) if _is_in(one, model)]
    plan = dataclasses.replace(found.plan, model=model, free=tuple(found.plan.free[index] for index in kept))
    return Explanation(tuple(one for one in found.parts if one is not part), plan, found.point[kept])


def _is_in(free: Free, model: Model) -> bool:
    """Returns whether a model still has the parameter."""
    if free.effect is None:
        return True
    head, tail = free.effect
    return tail in (model.by_run if "@" in free.name else model.effects).get(head, {})


def before(
    deadline: Deadline, work: Callable[[_Item], _Result], items: Sequence[_Item], jobs: int
) -> list[_Result | None]:
    """Returns the results of `work` in the order of `items`, `jobs` at a time.

    The first item is always done. Later items are done only before the deadline; after it their results are None.
    """
    numbered = list(enumerate(items))
    return side_by_side(lambda one: None if one[0] and deadline.passed else work(one[1]), numbered, jobs)


def is_possible(found: Explanation, excitation: Excitation) -> bool:
    """Returns whether the fitted values are possible for the effects of the explanation.

    There are five conditions. No fitted parameter is at an end of its range, where the data ask for another law. A
    periodic effect has at least about one period in a run. No sensor reads far beyond its limit. No parameter replaces
    the one that it adds to, as a breakaway torque adds to dry friction. No fitted size is below `least_of`.
    """
    tables = found.model.effects
    for part in found.effects:
        for info in catalogue.effect(part.effect).parameters:
            value = tables[part.effect].get(info.name, info.preset)
            away = min((abs(value - end) for end in (info.minimum, info.maximum) if end not in _WHOLE), default=np.inf)
            if info.name in part.free and (away < _AT_BOUND * abs(value) or abs(value) < least_of(info)):
                return False
    periodic = all(tables[part.effect]["order"] >= excitation.least_order for part in found.effects if part.is_periodic)
    limits = [(tables[part.effect][name], signal) for part in found.effects for name, signal in read_limits(part)]
    additions = [
        (table[info.only_with], table[info.name])
        for name, table in tables.items()
        for info in catalogue.effect(name).parameters
        if info.only_with
    ]
    return (
        periodic
        and all(limit > _LIMIT_OVER_READING * excitation.largest.get(signal, 0.0) for limit, signal in limits)
        and all(base > _LEAST_BASE_SHARE * added for base, added in additions)
    )
