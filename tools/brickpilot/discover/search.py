"""Searches for explanations. The search proposes and decides nothing: `verdict` weighs all that it fitted.

Singles, pairs of the best, then one part more beside the best two and beside what fits best, each as long as the last
ones surely predict better. Each part of what fits best gives way once to other laws of its mechanism. Rivals are
searched as hard as the winner: each part of the best explanation is forbidden once, and what is best without it is
found from there. An explanation that comes out worse than one that it contains is a failed fit and is fitted again from
there.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.motion import run_of
from brickpilot.discover import evidence, numbers
from brickpilot.discover.deadline import Deadline
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.explanation import (
    ROUGH,
    Explanation,
    before,
    fit,
    is_possible,
    joined,
    refine,
    without,
)
from brickpilot.discover.parts import Excitation, Part, library_parts, run_parts
from brickpilot.discover.screen import Trial, screen
from brickpilot.fit.descent import descend, natural_start
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual
from brickpilot.side_by_side import side_by_side

Array = NDArray[np.float64]
Tell = Callable[[str], None]

_PROMISED = 0.3  # of what a part has to gain: one that promises less in the screen, which saw few sizes, is not fitted
_NEAR = 6.0  # nats that count as one: what fits worse than the best by more is not fitted to the end
_STARTS = 3  # of a periodic part, at so many orders
_BEAM = 2
MOST_PARTS = 4
PARTS_IN_WINDOWS = 2  # robots' runs are cut for a periodic effect, which stands alone or beside one other
_ORDER_OFFSETS = np.linspace(-0.08, 0.08, 161).tolist()  # shares of an order by which it may be wrong
_LOWER = 0.98  # of the cost: another order is worth a descent below it
_WORSE = 0.5  # of the cost: an explanation that is worse than what it contains by more has a failed fit


@dataclass(frozen=True)
class Width:
    """How wide a search is.

    Attributes:
        rough, fine, least: how many of one screen are fitted; how many of these to the end, at most and at least.
        paired: of so many of the best singles all pairs are fitted, half of `fine` to the end.
        swapped: so many other laws of the library are tried in the place of one; 0 where parts are no laws of it.
    """

    rough: int = 12
    fine: int = 7
    least: int = 3
    paired: int = 5
    swapped: int = 4


class Source(Protocol):
    """Where parts come from: the library and values of runs, or terms without a name.

    Attributes:
        word: what one is called.
        most: so many are added at most.
    """

    word: str
    most: int
    width: Width

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns what is worth a fit beside the model of `problem` at `point`, the best first."""

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        """Returns what is worth a fit because of `fits`, which were made beside `current`."""


class Library:
    """The effects of the library and the values of runs, as a `Source`."""

    word, width = "effect", Width()

    def __init__(self, excitation: Excitation, most: int = MOST_PARTS, *, periodic: bool = True) -> None:
        self._excitation, self.most, self._periodic = excitation, most, periodic

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns each set of parameters of each effect that the model lacks, from its best sizes."""
        base, runs = problem.plan.at(point), dict.fromkeys(run_of(block.run) for block in problem.data.blocks)
        own = [one for one in run_parts([*runs]) if one.effect not in base.by_run]
        chosen = [one for one in library_parts(base, problem.data.signals) if self._periodic or not one.is_periodic]
        chosen += own
        kept: dict[tuple[str, tuple[str, ...]], int] = {}
        found = []
        for trial in screen(problem, point, chosen, excitation=self._excitation, deadline=deadline):
            key = (trial.part.name, trial.part.free)
            kept[key] = kept.get(key, 0) + 1
            if kept[key] <= (_STARTS if trial.part.is_periodic else 1):
                found.append(trial)
        return found

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        """Returns a second phase for each fit that gave both wheels one, from where that ended.

        The linear screen cannot find two phases at once: it starts from no effect, where wheels stop and slip in turn.
        """
        return [
            Trial(other, found.model.effects[other.effect], found.cost)
            for found in fits
            if found.parts[-1].is_periodic
            for other in library_parts(current.model)
            if other.effect == found.names[-1] and {*other.free} - {*found.parts[-1].free} == {"phase_difference"}
        ]


@dataclass
class Found:
    """Every explanation that was fitted to the end, each set of parts once, with its evidence.

    Attributes:
        nothing: the calibrated nominal model.
        screens: explanation -> what the screen proposed beside it.
        tried: explanations, and the parts that were fitted beside them: the same fit would end at the same values.
    """

    judge: Judge
    nothing: Evidence
    table: dict[frozenset[str], Evidence] = field(default_factory=dict)
    screens: dict[Explanation, list[Trial]] = field(default_factory=dict)
    tried: set[tuple[Explanation, str, tuple[str, ...]]] = field(default_factory=set)

    def add(self, fits: Sequence[Explanation], jobs: int) -> None:
        """Keeps what fits better than what is known of the same parts."""
        best: dict[frozenset[str], Explanation] = {}
        for one in fits:
            known = best.get(one.key) or (self.table[one.key].explanation if one.key in self.table else None)
            if known is None or one.cost < known.cost:
                best[one.key] = one
        for found in side_by_side(self.judge.of_explanation, list(best.values()), jobs):
            if found is not None and np.isfinite(found.total):
                self.table[found.explanation.key] = found

    @property
    def temperature(self) -> float:
        """The nats that count as one, by the best explanation so far."""
        return self.judge.temperature(max(self.table.values(), key=lambda one: one.total), self.nothing)

    def is_sure(self, one: Explanation) -> bool:
        """Returns whether the data alone, without stated values and prior odds, surely tell that more is needed."""
        return self.table[one.key].total - self.nothing.total > self.temperature * numbers.CHANCE_NATS

    def keeps_stated(self, one: Explanation) -> bool:
        """Returns whether an explanation leaves the nominal values as stated, where the nominal model moves one."""
        count = len(self.nothing.explanation.point)
        aways = [each.away[:count].tolist() for each in (self.nothing, self.table[one.key])]
        moves, still = (any(numbers.leaves_prior(away, count) for away in each) for each in aways)
        return moves and not still

    def without_laws(self, one: Evidence) -> Evidence:
        """Returns the evidence of an explanation's values of runs alone; of nothing, where these were not fitted."""
        laws = {part.name for part in one.explanation.effects} - self.nothing.explanation.key
        return self.table.get(one.explanation.key - laws) or self.table[self.nothing.explanation.key]

    def ranked(self, parts: int | None = None, forbidden: Collection[str] = ()) -> list[Evidence]:
        """Returns what was found, the best score first: of so many parts, and without some of them."""
        temperature = self.temperature
        chosen = [
            one for key, one in self.table.items() if (parts is None or len(key) == parts) and not key & set(forbidden)
        ]
        return sorted(chosen, key=lambda one: -one.log_weight(temperature))


@dataclass(frozen=True)
class Search:
    """What a search works on.

    Attributes:
        base: what each explanation begins with: the calibrated nominal model.
    """

    data: Residual
    base: Explanation
    source: Source
    excitation: Excitation
    jobs: int
    deadline: Deadline
    tell: Tell

    def run(self, judge: Judge) -> Found:
        """Returns everything that was found worth weighing."""
        nothing = judge.of_explanation(self.base)
        found = Found(judge, nothing, {self.base.key: nothing})
        base = len(self.base.parts)
        for count in range(1, self.source.most + 1):
            if not self._may_gain(found) or not self.deadline.allows(f"the search for {self.source.word} {count}"):
                break
            self.tell(f"searching for {self.source.word} {count}")
            for parent in self._parents(found, base + count - 1):
                found.add(self.beside(found, parent), self.jobs)
            if count == 1 and (expected := self._as_expected()) is not None:
                found.add(self.beside(found, judge.of_explanation(expected), every=True), self.jobs)
            if count == 2 and self.source.width.paired:
                singles = found.ranked(base + 1)[: self.source.width.paired]
                found.add(self._pairs([one.explanation for one in singles]), self.jobs)
            self._prune(found)
            self._repair(found)
            if not self._gained(found, base + count):
                break
        if len(found.table) > 1 and self.deadline.allows("the search for rivals"):
            self.tell("searching for rivals")
            self._rivals(found)
            self._repair(found)
        return found

    def _parents(self, found: Found, count: int) -> list[Evidence]:
        """Returns what is searched beside: the best so far of so many parts, and what fits best whatever its odds.

        Three odd parts that only together explain a machine are reached through two that look unlikely.
        """
        ranked = found.ranked(count)
        fitting = sorted(ranked, key=lambda one: _information(one.explanation))[:1]
        best = [one for one in _different(ranked) if one not in fitting]
        return best[:_BEAM] + fitting

    def _as_expected(self) -> Explanation | None:
        """Returns the base at stated and usual values, where these are not near: it may stand in for an effect.

        A descent from there would not come back: a resistance of nearly nothing is a lag, and a robot of a huge yaw
        inertia does not turn. What is not stated is fitted within decades of a usual value, to data that are weighed by
        what the base leaves of them.
        """
        plan, fitted = self.base.plan, self.base.point
        stated = np.array([one.known is not None for one in plan.free], dtype=bool)
        point = plan.start() if stated.all() else natural_start(Problem(self.data, plan))
        free = tuple(
            one if one.known else dataclasses.replace(one, natural=one.to_value(x))
            for one, x in zip(plan.free, point.tolist(), strict=True)
        )
        away = [one.away(x) or 0.0 for one, x in zip(free, fitted.tolist(), strict=True)]
        if not any(numbers.leaves_prior(one, len(away)) for one in away):
            return None
        if not stated.all():
            weighed = Problem(self.data.weighed_by_size(self.base.model), dataclasses.replace(plan, free=free))
            point = np.where(stated, plan.start(), descend(weighed, point, ROUGH))
        return Explanation(self.base.parts, plan, point)

    @staticmethod
    def _gained(found: Found, count: int) -> bool:
        """Returns whether so many parts surely predict better than fewer do, whatever their odds."""
        fewer = max(one.total for key, one in found.table.items() if len(key) < count)
        most = max((one.total for key, one in found.table.items() if len(key) == count), default=fewer)
        return most - fewer > found.temperature * numbers.CHANCE_NATS

    def _may_gain(self, found: Found) -> bool:
        """Returns whether one part more could score better than the best so far, if it left white noise alone."""
        best = found.ranked()[0]
        temperature = found.judge.law_error(max(found.table.values(), key=lambda one: one.total), found.nothing)
        surprise = best.explanation.log_odds - best.log_prior(temperature)
        possible = max(found.judge.top - best.total, 0.0) / temperature + surprise  # noise may leave less than `top`
        return bool(possible > -np.log(numbers.COMMON))

    def beside(
        self, found: Found, parent: Evidence, forbidden: Collection[str] = (), *, every: bool = False
    ) -> list[Explanation]:
        """Returns the best parts fitted beside an explanation: those that may score better than the best so far.

        `every`: not only the first of the screen, which is linear and misleads far from any that fits.
        """
        current, temperature, best = parent.explanation, found.temperature, found.ranked()[0]
        here = Problem(self.data, current.plan).keeping(current.point, len(current.point))
        behind = best.log_weight(temperature) - parent.log_weight(temperature)

        def promises(trial: Trial) -> bool:
            gain = trial.gain / temperature + max(trial.prior_gain, 0.0)  # a fit finds values that surprise less
            return gain > _PROMISED * (behind - trial.part.log_odds)

        def start(trial: Trial) -> Explanation | None:
            begin = joined(current, trial.part, trial.values)
            return fit(here, begin.parts, begin.plan, begin.point, ROUGH)

        if current not in found.screens:
            found.screens[current] = self.source.screened(here, current.point, self.deadline)
        wanted = [one for one in found.screens[current] if one.part.name not in forbidden and promises(one)]
        trials = [
            one
            for one in wanted[: None if every else self.source.width.rough]
            if (current, one.part.name, one.part.free) not in found.tried
        ]
        found.tried |= {(current, one.part.name, one.part.free) for one in trials}
        if not trials:
            return []
        rough = self._possible(before(self.deadline, start, trials, self.jobs))
        near = self.source.nearby(here, current, rough)
        rough += self._possible(before(self.deadline, start, near, self.jobs))
        if not rough:
            return []
        rough += self._at_better_order(min(rough, key=_information))
        rough.sort(key=_information, reverse=True)
        rough = sorted({one.key: one for one in rough}.values(), key=_information)  # the best of each start
        least = min(rough[0].cost, best.explanation.cost)
        worth = sum(one.cost < least + _NEAR * best.nat(temperature) for one in rough)
        count = min(max(worth, self.source.width.least), self.source.width.fine)
        return self._refined(rough[:count])

    def _possible(self, fits: Sequence[Explanation | None]) -> list[Explanation]:
        return [one for one in fits if one is not None and is_possible(one, self.excitation)]

    def _refined(self, fits: Sequence[Explanation]) -> list[Explanation]:
        return self._possible(refine(self.data, fits, self.jobs, self.deadline))

    def _rough(self, starts: Sequence[Explanation]) -> list[Explanation]:
        """Returns where rough fits from `starts` end, the best first."""

        def one(begin: Explanation) -> Explanation | None:
            here = Problem(self.data, begin.plan).keeping(begin.point, len(self.base.point))
            return fit(here, begin.parts, begin.plan, begin.point, ROUGH)

        return sorted(self._possible(before(self.deadline, one, starts, self.jobs)), key=_information)

    def _pairs(self, singles: Sequence[Explanation]) -> list[Explanation]:
        """Returns the best pairs of singles, each fitted from where both stood alone: two are not taken for a third."""
        pairs = [self._joined(*pair) for pair in itertools.combinations(singles, 2)]
        return self._refined(self._rough(pairs)[: self.source.width.fine // 2])

    def _joined(self, first: Explanation, second: Explanation) -> Explanation:
        """Returns both explanations' parts, at the mean of the nominal values that each alone led to."""
        count, part = len(self.base.point), second.parts[-1]
        both = joined(first, part, part.values_in(second.model))
        point = np.array(both.point)
        point[:count] = (first.point[:count] + second.point[:count]) / 2
        point[len(first.point) :] = second.point[count:]
        return Explanation(both.parts, both.plan, point)

    def _rivals(self, found: Found) -> None:
        """Searches on with each part forbidden that would be named, and with it the laws that contain it."""
        best, ranked = found.ranked()[0].explanation, found.ranked()
        sure = evidence.held_by(ranked, evidence.weigh(ranked, found.temperature))
        for part in best.parts[len(self.base.parts) :]:
            if self.deadline.passed:
                return
            if sure[part.name] < numbers.SURE:
                continue
            forbidden = [part.name, *(one.name for one in catalogue.effects() if part.name in one.contains)]
            fewer = without(best, part)
            if fewer.key not in found.table:
                found.add(refine(self.data, [fewer], self.jobs, self.deadline), self.jobs)
            known = found.ranked(forbidden=forbidden)[:1]
            starts = {one.explanation.key: one for one in (*known, found.table.get(fewer.key)) if one is not None}
            for key, start in starts.items():
                if len(key) < self.source.most + len(self.base.parts) and key != self.base.key:
                    found.add(self.beside(found, start, forbidden), self.jobs)

    def _prune(self, found: Found) -> None:
        """Fits what fits best without each of its parts: alone, one may have been fitted badly or never."""
        best = min((one.explanation for one in found.table.values()), key=lambda one: one.cost)
        if len(best.parts) > len(self.base.parts) + 1:
            fewer = [without(best, part) for part in best.parts[len(self.base.parts) :]]
            found.add(self._refined(fewer), self.jobs)
        if not self.source.width.swapped:
            return
        near = best.cost + _NEAR * found.ranked()[0].nat(found.temperature)
        known = {key: one.explanation.cost for key, one in found.table.items()}
        swapped = self._rough(self._in_other_laws(best))
        found.add(self._refined([one for one in swapped if one.cost < min(near, known.get(one.key, near))]), self.jobs)

    def _in_other_laws(self, best: Explanation) -> list[Explanation]:
        """Returns `best` with one law replaced by another of its mechanism, or several by the law that they make."""
        added = {one.name: one for one in best.parts[len(self.base.parts) :]}
        swaps: dict[tuple[str, ...], list[Part]] = {}
        for part in library_parts(best.model, self.data.signals):
            like = [(name,) for name, one in added.items() if one.mechanism == part.mechanism]
            for names in (*like, part.made_of):
                if names and added.keys() >= {*names}:
                    swaps.setdefault(names, []).append(part)
        starts = []
        for names, chosen in swaps.items():
            rest = best
            for name in names:
                rest = without(rest, added[name])
            trials = screen(Problem(self.data, rest.plan), rest.point, chosen, excitation=self.excitation)
            best_of = {one.part.name: one for one in reversed(trials)}
            likely = sorted(best_of.values(), key=lambda one: one.left)[: self.source.width.swapped]
            starts += [joined(rest, one.part, one.values) for one in likely]
        return starts

    def _repair(self, found: Found) -> None:
        """Fits again each explanation that came out worse than one that it contains, from there.

        One that still gains nothing stays as it is: the smaller one speaks for it.
        """
        starts, reached = [], {}
        for key, one in found.table.items():
            parts_of = [found.table[other].explanation for other in found.table if other < key]
            best = min(parts_of, key=lambda other: other.cost, default=one.explanation)
            if one.explanation.cost > best.cost + _WORSE:
                starts.append(_from_part(best, one.explanation))
                reached[key] = best.cost
        again = [one for one in self._rough(starts) if one.cost < reached[one.key] - _WORSE]
        found.add(self._refined(again), self.jobs)

    def _at_better_order(self, found: Explanation) -> list[Explanation]:
        """Returns `found`, with a periodic effect, fitted from the best order near its own; nothing if that is best.

        Near the right order lie others that differ by one turn over the travel. Each has a valley that a descent stays
        in.
        """
        orders = [k for k, one in enumerate(found.plan.free) if one.info.name == "order"]
        axes = np.eye(len(found.point))[orders]
        points = [found.point + offset * axis for axis in axes for offset in _ORDER_OFFSETS]
        costs = Problem(self.data, found.plan).costs(points)
        if min(costs, default=np.inf) > _LOWER * found.cost:
            return []
        return self._rough([dataclasses.replace(found, point=points[int(np.argmin(costs))])])


def _different(ranked: Sequence[Evidence]) -> list[Evidence]:
    """Returns those that contain no better one, and vary no better one's laws: what joins one joins the other."""
    families = [frozenset(map(catalogue.family, one.explanation.names)) for one in ranked]
    return [
        one
        for index, one in enumerate(ranked)
        if not any(one.explanation.contains(other.explanation) for other in ranked[:index])
        and families[index] not in families[:index]
    ]


def _information(one: Explanation) -> float:
    """Returns the cost with one unit for each parameter of its parts (Akaike 1974)."""
    return one.cost + one.parameter_count


def _from_part(smaller: Explanation, larger: Explanation) -> Explanation:
    """Returns `larger` with the values of `smaller` for what both have: it contains that."""
    values = dict(zip((one.name for one in smaller.plan.free), smaller.point.tolist(), strict=True))
    point = [values.get(one.name, x) for one, x in zip(larger.plan.free, larger.point.tolist(), strict=True)]
    added = [part for part in larger.parts if part.name not in smaller.key]
    for index, free in enumerate(larger.plan.free):
        if any(part.owns(free) for part in added) and free.info.role == "size":
            # A tenth of a size: a fit goes on from nearly nothing, but feels its slope.
            point[index] = 0.1 * point[index] if free.signed else point[index] - float(np.log(10.0))
    return Explanation(larger.parts, larger.plan, np.array(point))
