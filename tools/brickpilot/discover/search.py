"""Searches for explanations. The search only proposes explanations: `verdict` weighs all that were fitted.

The search fits single parts, then pairs of the best parts. Then it adds one part to the best two explanations and to
the best fit. It stops if no added part surely predicts better, or if the best fit leaves no more error than wrong
shapes of its laws may leave. Before it stops, it tries offsets of readings. It replaces each part of the best fit by
other laws of the same mechanism. To find rivals, it searches again without each part of the best explanation. A fit has
failed if it costs more than the fit of some of its parts; it is then repeated from the values of that smaller fit.
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
from brickpilot.vehicle.replay import RUN_KINDS

Array = NDArray[np.float64]
Tell = Callable[[str], None]

_PROMISED = 0.3  # limit: a part is fitted if the screen promises this share of the needed gain; a fit may gain more
_NEAR = 6.0  # a rough fit is refined if its cost is at most this much above the best cost; unit: `Evidence.nat`
_STARTS = 3  # number of starts of a periodic part, each from another order
_BEAM = 2  # number of best explanations to which a further part is added
MOST_PARTS = 4  # largest number of parts that a search adds
PARTS_IN_WINDOWS = 2  # largest number of parts in windows: a periodic effect, alone or with one other part
_ORDER_OFFSETS = np.linspace(-0.08, 0.08, 161).tolist()  # relative changes of an order that are tried
_LOWER = 0.98  # limit, as a share of the present cost: a descent starts from another order if its cost is lower
_WORSE = 0.5  # units of cost: a fit has failed if it costs this much more than an explanation that it contains


@dataclass(frozen=True)
class Width:
    """How wide a search is.

    Attributes:
        rough: largest number of trials of a screen that are fitted; `least` to `fine` of these are then refined.
        paired: number of the best single parts that are fitted in pairs; the best `fine` / 2 pairs are refined.
        swapped: number of library laws that are tried in place of one law; 0 if the parts are not laws of the library.
    """

    rough: int = 12
    fine: int = 7
    least: int = 3
    paired: int = 5
    swapped: int = 4


class Source(Protocol):
    """A source of parts for the search: the library and values of runs, or terms without a name.

    Attributes:
        word: the word for a part in messages.
        most: largest number of parts that are added.
    """

    word: str
    most: int
    width: Width

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns the trials that are worth a fit as additions to the model of `problem` at `point`, the best first."""

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        """Returns further trials that are worth a fit. `fits`: all fits so far of `current` with one more part."""


class Library:
    """The effects of the library and the values of runs, as a `Source`."""

    word, width = "effect", Width()

    def __init__(self, excitation: Excitation, most: int = MOST_PARTS, *, periodic: bool = True) -> None:
        self._excitation, self.most, self._periodic = excitation, most, periodic

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns trials at the best sizes, for each effect that the model lacks and each set of free parameters."""
        base, runs = problem.plan.at(point), dict.fromkeys(run_of(block.run) for block in problem.data.blocks)
        own = [part for part in run_parts([*runs]) if part.effect not in base.by_run]
        chosen = [part for part in library_parts(base, problem.data.signals) if self._periodic or not part.is_periodic]
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
        """Returns, for each fit with one phase for both wheels, a trial with a second phase, started from that fit.

        The screen is linear about a model without the effect. It cannot find two phases, because wheels stop and slip.
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
    """All explanations that were fitted to the end, one for each set of parts, with their evidence.

    Attributes:
        nothing: the calibrated nominal model.
        screens: explanation -> the trials that the screen proposed as additions to it.
        tried: each explanation with each part that was added in a fit: a repeated fit would end at the same values.
    """

    judge: Judge
    nothing: Evidence
    table: dict[frozenset[str], Evidence] = field(default_factory=dict)
    screens: dict[Explanation, list[Trial]] = field(default_factory=dict)
    tried: set[tuple[Explanation, str, tuple[str, ...]]] = field(default_factory=set)

    def add(self, fits: Sequence[Explanation], jobs: int) -> None:
        """Keeps each fit that costs less than the known fit of the same parts."""
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
        """The number of nats that count as one nat, computed from the best explanation so far."""
        return self.judge.temperature(max(self.table.values(), key=lambda evidence: evidence.total), self.nothing)

    def is_sure(self, explanation: Explanation) -> bool:
        """Returns whether the data alone, without stated values and prior odds, surely support an explanation."""
        return self.table[explanation.key].total - self.nothing.total > self.temperature * numbers.CHANCE_NATS

    def keeps_stated(self, explanation: Explanation) -> bool:
        """Returns whether the nominal model needs a value far from its stated value, but the explanation needs none."""
        count = len(self.nothing.explanation.point)
        aways = [each.away[:count].tolist() for each in (self.nothing, self.table[explanation.key])]
        moves, still = (any(numbers.leaves_prior(away, count) for away in each) for each in aways)
        return moves and not still

    def without_shapes(self, evidence: Evidence) -> Evidence:
        """Returns the evidence of the explanation without its laws with a shape; if not fitted, that of `nothing`."""
        shaped = {part.name for part in evidence.explanation.effects} - evidence.explanation.offsets
        nothing = self.nothing.explanation.key
        return self.table.get(evidence.explanation.key - (shaped - nothing)) or self.table[nothing]

    def shape_error(self, evidence: Evidence) -> Array:
        """Returns (signals,): the squared error that wrong shapes of the laws may leave, in squared floors.

        This error is a share of the error that the laws with a shape remove. It justifies no further law with a shape.
        """
        excess = self.judge.excess
        return np.asarray(self.judge.shape * np.maximum(excess(self.without_shapes(evidence)) - excess(evidence), 0.0))

    def ranked(self, parts: int | None = None, forbidden: Collection[str] = ()) -> list[Evidence]:
        """Returns the explanations of `parts` parts (None: all) without `forbidden` parts, the best score first."""
        temperature = self.temperature
        chosen = [
            one for key, one in self.table.items() if (parts is None or len(key) == parts) and not key & set(forbidden)
        ]
        return sorted(chosen, key=lambda one: -one.log_weight(temperature))


@dataclass(frozen=True)
class Search:
    """A search, with its data, its source of parts and its limits.

    Attributes:
        base: the explanation to which parts are added, usually the calibrated nominal model.
    """

    data: Residual
    base: Explanation
    source: Source
    excitation: Excitation
    jobs: int
    deadline: Deadline
    tell: Tell

    def run(self, judge: Judge) -> Found:
        """Returns every explanation that is worth weighing."""
        nothing = judge.of_explanation(self.base)
        found = Found(judge, nothing, {self.base.key: nothing})
        base = len(self.base.parts)
        gained, no_offsets = True, [*RUN_KINDS, *(info.name for info in catalogue.effects() if not info.shapeless)]
        for count in range(1, self.source.most + 1):
            forbidden = [] if gained and self._may_gain(found) else no_offsets  # an offset makes other gains uncertain
            may_gain = not forbidden or (self.source.width.swapped and self._may_gain(found, without_shape=True))
            wanted = "offsets of readings" if forbidden else f"{self.source.word} {count}"
            if not may_gain or not self.deadline.allows(f"the search for {wanted}"):
                break
            self.tell(f"searching for {wanted}")
            for parent in self._parents(found, base + count - 1):
                found.add(self.beside(found, parent, forbidden), self.jobs)
            if count == 1 and (expected := self._as_expected()) is not None:
                found.add(self.beside(found, judge.of_explanation(expected), every=True), self.jobs)
            if count == 2 and self.source.width.paired and not forbidden:
                singles = found.ranked(base + 1)[: self.source.width.paired]
                found.add(self._pairs([one.explanation for one in singles]), self.jobs)
            self._prune(found)
            self._repair(found)
            gained = self._gained(found, base + count)
            if forbidden and not gained:
                break
        if len(found.table) > 1 and self.deadline.allows("the search for rivals"):
            self.tell("searching for rivals")
            self._rivals(found)
            self._repair(found)
        return found

    def _parents(self, found: Found, count: int) -> list[Evidence]:
        """Returns the explanations of `count` parts to extend: the best by score, and the best fit at any odds.

        If only three rare parts together explain a machine, the search must first keep two of these unlikely parts.
        """
        ranked = found.ranked(count)
        fitting = sorted(ranked, key=lambda one: _information(one.explanation))[:1]
        best = [one for one in _different(ranked) if one not in fitting]
        return best[:_BEAM] + fitting

    def _as_expected(self) -> Explanation | None:
        """Returns the base at stated and usual values if its fitted values are far from these values, otherwise None.

        Far values may stand in for an effect: a resistance near 0 gives a lag, a huge yaw inertia keeps a robot from
        turning. A descent from far values does not return to usual values. Unstated values are fitted with a prior of
        one decade about a usual value; the residual of the base sets the weights of the data.
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
        """Returns whether `count` parts surely predict better than fewer parts do, whatever the prior odds."""
        fewer = max(known.total for key, known in found.table.items() if len(key) < count)
        most = max((known.total for key, known in found.table.items() if len(key) == count), default=fewer)
        return most - fewer > found.temperature * numbers.CHANCE_NATS

    def _may_gain(self, found: Found, *, without_shape: bool = False) -> bool:
        """Returns whether one more part could raise the best score, even if it removed all error above white noise.

        A part gains by error that it removes; error that wrong shapes of laws may leave counts only for a part that is
        `without_shape`. A part also gains if values of the model, not of runs, move nearer to their priors.
        """
        best = found.ranked()[0]
        temperature = found.judge.law_error(max(found.table.values(), key=lambda one: one.total), found.nothing)
        of_model = best.away[[k for k, one in enumerate(best.explanation.plan.free) if not one.run]]
        surprise = min(best.explanation.log_odds - best.log_prior(temperature), evidence.surprise(of_model))
        own = np.zeros(1) if without_shape else found.shape_error(best)
        beyond = float(np.maximum(found.judge.excess(best) - own, 0.0).sum()) / 2
        left = max(found.judge.top - best.total, 0.0)  # noise may score above `top`, also in one signal alone
        left = beyond if without_shape else min(left, beyond if own.any() else left)
        return bool(left / temperature + surprise > -np.log(numbers.COMMON))

    def beside(
        self, found: Found, parent: Evidence, forbidden: Collection[str] = (), *, every: bool = False
    ) -> list[Explanation]:
        """Returns the best fits of `parent` with one more part that may raise the score above the best score so far.

        `every`: fits all such trials, not only the first ones: far from a good fit, the linear screen misleads.
        """
        current, temperature, best = parent.explanation, found.temperature, found.ranked()[0]
        here = Problem(self.data, current.plan).keeping(current.point, len(current.point))
        behind = best.log_weight(temperature) - parent.log_weight(temperature)

        def promises(trial: Trial) -> bool:
            gain = trial.gain / temperature + max(trial.prior_gain, 0.0)  # a fit moves values nearer to their priors
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
        rough = sorted({one.key: one for one in rough}.values(), key=_information)  # the best fit of each set of parts
        least = min(rough[0].cost, best.explanation.cost)
        worth = sum(one.cost < least + _NEAR * best.nat(temperature) for one in rough)
        count = min(max(worth, self.source.width.least), self.source.width.fine)
        return self._refined(rough[:count])

    def _possible(self, fits: Sequence[Explanation | None]) -> list[Explanation]:
        return [fitted for fitted in fits if fitted is not None and is_possible(fitted, self.excitation)]

    def _refined(self, fits: Sequence[Explanation]) -> list[Explanation]:
        return self._possible(refine(self.data, fits, self.jobs, self.deadline))

    def _rough(self, starts: Sequence[Explanation]) -> list[Explanation]:
        """Returns the ends of rough fits from `starts`, the best first."""

        def one(begin: Explanation) -> Explanation | None:
            here = Problem(self.data, begin.plan).keeping(begin.point, len(self.base.point))
            return fit(here, begin.parts, begin.plan, begin.point, ROUGH)

        return sorted(self._possible(before(self.deadline, one, starts, self.jobs)), key=_information)

    def _pairs(self, singles: Sequence[Explanation]) -> list[Explanation]:
        """Returns fits of the best pairs of `singles`, from both fits: a third part might imitate an unfitted pair."""
        pairs = [self._joined(*pair) for pair in itertools.combinations(singles, 2)]
        return self._refined(self._rough(pairs)[: self.source.width.fine // 2])

    def _joined(self, first: Explanation, second: Explanation) -> Explanation:
        """Returns an explanation with the parts of `first` and `second`, and with the mean of their nominal values."""
        count, part = len(self.base.point), second.parts[-1]
        both = joined(first, part, part.values_in(second.model))
        point = np.array(both.point)
        point[:count] = (first.point[:count] + second.point[:count]) / 2
        point[len(first.point) :] = second.point[count:]
        return Explanation(both.parts, both.plan, point)

    def _rivals(self, found: Found) -> None:
        """For each part that would be named, searches again without this part and the laws that contain it."""
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
        """Refits the best fit without each of its parts, as such sets may be badly fitted, and then with other laws."""
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
        """Returns `best` with one law replaced by another of its mechanism, or several laws replaced by their sum."""
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
        """Refits each explanation that costs more than a fit of some of its parts, from the values of that smaller fit.

        If the new fit also gains nothing, the old fit stays: the smaller explanation is the simpler answer.
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
        """Returns a fit of `found` from the best periods per turn near its own; [] if none nearby costs clearly less.

        A descent can end in a local minimum beside the right order, where the travel holds one period more or less.
        """
        orders = [k for k, free in enumerate(found.plan.free) if free.info.name == "order"]
        axes = np.eye(len(found.point))[orders]
        points = [found.point + offset * axis for axis in axes for offset in _ORDER_OFFSETS]
        costs = Problem(self.data, found.plan).costs(points)
        if min(costs, default=np.inf) > _LOWER * found.cost:
            return []
        return self._rough([dataclasses.replace(found, point=points[int(np.argmin(costs))])])


def _different(ranked: Sequence[Evidence]) -> list[Evidence]:
    """Returns `ranked` without explanations that contain a better explanation or consist of variants of its laws.

    The search would add the same parts to both explanations.
    """
    families = [frozenset(map(catalogue.family, one.explanation.names)) for one in ranked]
    return [
        one
        for index, one in enumerate(ranked)
        if not any(one.explanation.contains(other.explanation) for other in ranked[:index])
        and families[index] not in families[:index]
    ]


def _information(explanation: Explanation) -> float:
    """Returns the cost plus 1 for each parameter of the explanation's parts (Akaike 1974)."""
    return explanation.cost + explanation.parameter_count


def _from_part(smaller: Explanation, larger: Explanation) -> Explanation:
    """Returns `larger`, which has all parts of `smaller`, with the values of `smaller` for the shared parameters."""
    values = dict(zip((one.name for one in smaller.plan.free), smaller.point.tolist(), strict=True))
    point = [values.get(one.name, x) for one, x in zip(larger.plan.free, larger.point.tolist(), strict=True)]
    added = [part for part in larger.parts if part.name not in smaller.key]
    for index, free in enumerate(larger.plan.free):
        if any(part.owns(free) for part in added) and free.info.role == "size":
            # A tenth of a size: the fit starts near 0, but not at 0, where the cost may have no slope.
            point[index] = 0.1 * point[index] if free.signed else point[index] - float(np.log(10.0))
    return Explanation(larger.parts, larger.plan, np.array(point))
