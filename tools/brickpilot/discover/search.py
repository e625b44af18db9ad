"""The third stage: searches for the effects that the data ask for.

Forward: the best candidate is added as long as it gains enough. All pairs of the best few compete with it, so that two
effects at once are not taken for a third one. Backward: effects that the others make needless are removed.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.discover.backward import prune
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.deadline import FIRST_EFFECT, SEARCHED, Deadline
from brickpilot.discover.fitting import (
    ROUGH,
    FittedModel,
    best_first,
    fit,
    fit_each,
    refine,
    unfitted,
    without_effect,
)
from brickpilot.discover.gates import (
    GAIN_SHARE_OF_EARLIER,
    MOST_EFFECTS,
    PRIOR_STRAINED_SD,
    STRAIN_RELEASED,
    STRUCTURED,
    gains_enough,
)
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search_round import largest_prior_shift, try_candidates
from brickpilot.fit.parameters import Free, Plan

Tell = Callable[[str], None]

_PAIRED = 5  # candidates, of which all pairs are fitted
_ROUNDS = 5
_NEAR_TIE = 0.05  # of the best one's penalised cost


@dataclass(frozen=True)
class Round:
    """One round of the search.

    Attributes:
        before: the model that it began with.
        tried: every model that was tried, the best one first.
        taken: whether the best one was taken.
    """

    before: FittedModel
    tried: tuple[FittedModel, ...]
    taken: bool


@dataclass(frozen=True)
class Searched:
    """What the search found.

    Attributes:
        nominal: the calibrated nominal model.
        best: the model with the effects that are kept; `nominal` itself if there are none.
        rounds: the rounds of the search.
    """

    nominal: FittedModel
    best: FittedModel
    rounds: tuple[Round, ...]


def search(prepared: Prepared, nominal: FittedModel, tell: Tell) -> Searched:
    """Searches forward and backward from `nominal`, on the coarse grid.

    Over whole runs the search ends at a periodic effect that leaves structure: simulated wheels get out of phase, and
    what is tried beside the effect would fit that error.
    """
    error, excitation, jobs, deadline = prepared.coarse, prepared.excitation, prepared.jobs, prepared.until(SEARCHED)
    current, rounds, structured = nominal, list[Round](), STRUCTURED * error.noise_cost()
    while len(current.chosen) < MOST_EFFECTS and len(rounds) < _ROUNDS:
        number = len(current.chosen) + 1
        if rounds and not deadline.allows(f"the search for effect {number}"):
            break
        tell(f"searching for effect {number}")
        found = try_candidates(error, current, excitation, jobs, deadline)
        tried, taken = _search_wider(prepared, nominal, current, rounds, found, deadline)
        deadline.allows(f"a part of the search for effect {number}" if rounds else FIRST_EFFECT)
        rounds.append(Round(current, tuple(tried), taken))
        if not taken:
            break
        current = tried[0]
        loses_phase = excitation.wheels_measured and not excitation.windowed and current.is_periodic
        if loses_phase and current.cost > structured:
            break
    tell("removing needless effects")
    if len(current.chosen) > 1 and deadline.allows("the removal of needless effects on the coarse grid"):
        current = prune(error, current, jobs)
    return Searched(nominal, current, tuple(rounds))


def _search_wider(
    prepared: Prepared,
    nominal: FittedModel,
    current: FittedModel,
    rounds: Sequence[Round],
    tried: list[FittedModel],
    deadline: Deadline,
) -> tuple[list[FittedModel], bool]:
    """Returns the models of a round, the best one first, and whether that one is accepted.

    Adds pairs, near ties and exchanges to `tried` where one effect after the other may be the wrong way.
    """
    error, excitation, jobs = prepared.coarse, prepared.excitation, prepared.jobs
    structured = STRUCTURED * error.noise_cost()
    taken = bool(tried) and _is_accepted(error, nominal, current, tried[0])
    if len(current.chosen) == 1 and (taken or current.cost > structured) and not deadline.passed:
        tried += _fit_pairs(error, nominal, rounds[-1].tried, jobs, deadline)
        if tried and min(one.cost for one in tried) > structured:
            for other in _near_ties(rounds[-1].tried):
                tried += try_candidates(error, other, excitation, jobs, deadline)
        tried = best_first(tried)
        taken = bool(tried) and _is_accepted(error, nominal, current, tried[0])
    if not taken and len(current.chosen) > 1 and current.cost > structured and not deadline.passed:
        tried = best_first(tried + _exchange(prepared, current, deadline))
        taken = bool(tried) and _is_accepted(error, nominal, current, tried[0])
    return tried, taken


def _is_accepted(error: BinnedOutputError, nominal: FittedModel, current: FittedModel, found: FittedModel) -> bool:
    """Returns whether `found` gains enough over `current`, and more than a slightly wrong law of `current` leaves.

    Where `current` strains a nominal value and `found` does not, the gain is not of that kind.
    """
    gain = current.penalised_cost - found.penalised_cost
    released = (
        largest_prior_shift(error, current) > PRIOR_STRAINED_SD > STRAIN_RELEASED * largest_prior_shift(error, found)
    )
    least = 0.0 if released else GAIN_SHARE_OF_EARLIER * (nominal.cost - current.cost)
    return gains_enough(current.penalised_cost, found.penalised_cost, error.floor_cost()) and gain > least


def _fit_pairs(
    error: BinnedOutputError, nominal: FittedModel, singles: Sequence[FittedModel], jobs: int, deadline: Deadline
) -> list[FittedModel]:
    """Returns the best pairs of the best single candidates, each fitted from where both stood alone."""
    best: dict[str, FittedModel] = {}
    for single in singles:
        if len(single.chosen) == len(nominal.chosen) + 1:
            best.setdefault(single.names[-1], single)
    few = list(best.values())[:_PAIRED]

    def one(pair: tuple[FittedModel, FittedModel]) -> FittedModel | None:
        joined = _joined(nominal, pair)
        own = error.with_plan(joined.plan, threads=1)
        own.keep_sensitivities(joined.point, len(nominal.point))
        return fit(own, joined.chosen, joined.plan, joined.point, ROUGH)

    rough = best_first(fit_each(one, list(itertools.combinations(few, 2)), jobs, deadline))
    return refine(error, rough[:2], jobs, deadline)


def _joined(nominal: FittedModel, pair: tuple[FittedModel, FittedModel]) -> FittedModel:
    """Returns both candidates' effects, at the mean of the nominal values that each alone led to."""
    count = len(nominal.point)
    first, second = pair
    model = dataclasses.replace(first.plan.model, effects={**first.plan.model.effects, **second.plan.model.effects})
    free: tuple[Free, ...] = (*first.plan.free, *second.plan.free[count:])
    point = np.concatenate(
        [(first.point[:count] + second.point[:count]) / 2, first.point[count:], second.point[count:]]
    )
    return unfitted((*first.chosen, second.chosen[-1]), Plan(model, free, ()), point)


def _near_ties(tried: Sequence[FittedModel]) -> list[FittedModel]:
    """Returns the next best of `tried` with other effects, if it is nearly as good. The wrong one may lead."""
    others = [one for one in tried if one.names != tried[0].names]
    return [one for one in others[:1] if one.penalised_cost < (1 + _NEAR_TIE) * tried[0].penalised_cost]


def _exchange(prepared: Prepared, current: FittedModel, deadline: Deadline) -> list[FittedModel]:
    """Returns `current` with each of its effects in turn replaced by what is best beside the others."""
    found: list[FittedModel] = []
    starts = [without_effect(current, name) for name in current.names]
    for fewer in refine(prepared.coarse, starts, prepared.jobs, deadline):
        found += try_candidates(prepared.coarse, fewer, prepared.excitation, prepared.jobs, deadline)[:2]
    return found
