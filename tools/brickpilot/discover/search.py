"""The third stage: searches for what the data ask for, among the effects of the library or among composed terms.

Forward: the best candidate is added as long as it gains enough. All pairs of the best few effects compete with it, so
that two effects at once are not taken for a third one. Backward: what the others make needless is removed.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.discover.backward import explains_more, prune
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.deadline import Deadline
from brickpilot.discover.fitting import (
    ROUGH,
    FittedModel,
    best_first,
    fit,
    fit_each,
    refine,
    unfitted,
    without,
)
from brickpilot.discover.gates import STRUCTURED
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search_round import Source, try_candidates
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
        nominal: the model that the search began with: of effects, the calibrated nominal model.
        best: the model with what is kept; `nominal` itself if that is nothing.
        rounds: the rounds of the search.
    """

    nominal: FittedModel
    best: FittedModel
    rounds: tuple[Round, ...]


def search(
    prepared: Prepared, source: Source, base: FittedModel, tell: Tell, deadline: Deadline, first: str
) -> Searched:
    """Searches forward and backward from `base`, on the coarse grid.

    Args:
        first: what is noted as left out where the deadline passes while the first candidate is searched for.
    """
    error, jobs, word = prepared.coarse, prepared.jobs, source.word
    current, rounds = base, list[Round]()
    while _added(base, current) < source.most and len(rounds) < _ROUNDS:
        number = _added(base, current) + 1
        if rounds and not deadline.allows(f"the search for {word} {number}"):
            break
        tell(f"searching for {word} {number}")
        found = try_candidates(error, source, current, jobs, deadline)
        tried, taken = _search_wider(prepared, source, base, current, rounds, found, deadline)
        deadline.allows(f"a part of the search for {word} {number}" if rounds else first)
        rounds.append(Round(current, tuple(tried), taken))
        if not taken:
            break
        current = tried[0]
        if source.is_finished(error, current):
            break
    tell(f"removing needless {word}s")
    if _added(base, current) > 1 and deadline.allows(f"the removal of needless {word}s on the coarse grid"):
        current = prune(error, base, current, jobs)
    return Searched(base, current, tuple(rounds))


def _added(base: FittedModel, current: FittedModel) -> int:
    return len(current.chosen) - len(base.chosen)


def _search_wider(
    prepared: Prepared,
    source: Source,
    base: FittedModel,
    current: FittedModel,
    rounds: Sequence[Round],
    tried: list[FittedModel],
    deadline: Deadline,
) -> tuple[list[FittedModel], bool]:
    """Returns the models of a round, the best one first, and whether that one is accepted.

    Adds pairs, near ties and exchanges to `tried` where one candidate after the other may be the wrong way.
    """
    error, jobs, added = prepared.coarse, prepared.jobs, _added(base, current)
    structured = STRUCTURED * error.noise_cost()
    taken = bool(tried) and explains_more(error, base, current, tried[0])
    if source.pairs and added == 1 and (taken or current.cost > structured) and not deadline.passed:
        tried += _fit_pairs(error, base, rounds[-1].tried, jobs, deadline)
        if tried and min(one.cost for one in tried) > structured:
            for other in _near_ties(rounds[-1].tried):
                tried += try_candidates(error, source, other, jobs, deadline)
        tried = best_first(tried)
        taken = bool(tried) and explains_more(error, base, current, tried[0])
    if not taken and added > 1 and current.cost > structured and not deadline.passed:
        tried = best_first(tried + _exchange(prepared, source, current, len(base.chosen), deadline))
        taken = bool(tried) and explains_more(error, base, current, tried[0])
    return tried, taken


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


def _exchange(
    prepared: Prepared, source: Source, current: FittedModel, kept: int, deadline: Deadline
) -> list[FittedModel]:
    """Returns `current` with each candidate behind the first `kept` replaced by what is best beside the others."""
    found: list[FittedModel] = []
    starts = [without(current, one) for one in current.chosen[kept:]]
    for fewer in refine(prepared.coarse, starts, prepared.jobs, deadline):
        found += try_candidates(prepared.coarse, source, fewer, prepared.jobs, deadline)[:2]
    return found
