"""The verdict that the evidence gives on all explanations found. See `pipeline` for what may change it later.

The explanations that hold 95 % of the weight are kept. If a kept explanation contains another, the data do not need
its further parts, so the simpler one stands for both. An effect is sure if the explanations with this
effect hold 95 % of the weight. The verdict is `named` for one minimal explanation (it contains no other) of sure
effects, `ambiguous` for several, `none` for the nominal model. An explanation that leaves too much error is refuted
(see `adequacy`): it is no answer, and its weight supports no other. If all are refuted, the verdict is `unknown`.
Measured samples (`confirmed`), held-out runs (`seal`) or a time limit may also turn it to `unknown`. If only stated
values, which may be wrong, support an effect, the effect is not named.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brickpilot.discover import evidence, numbers
from brickpilot.discover.adequacy import Adequacy
from brickpilot.discover.evidence import Evidence
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import Step, VerdictKind
from brickpilot.discover.search import Found

_ONE = "{} holds 95 % of the weight."
_SEVERAL = "{} explanations hold 95 % of the weight together, the heaviest {}; none of them contains another."
_NOTHING = "The nominal model is among the explanations that hold 95 % of the weight."
_RUNS = "No law is missing: runs differ in what reaches the motors, and when."
_UNSURE = "The measured samples do not surely show it."
_STATED = "Only the stated nominal values support an effect: the data alone do not."


@dataclass(frozen=True, eq=False)
class Weighed:
    """One of the explanations that together hold 95 % of the weight, with its own weight."""

    explanation: Explanation
    weight: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """The verdict of the fit runs.

    Attributes:
        nominal: the calibrated nominal model.
        best: the explanation that is reported; the nominal model if no part is needed.
        rivals: the other minimal explanations (none contains another), the heaviest first.
        held: the explanations that together hold 95 % of the weight, the heaviest first.
        sure: the names of the parts that are sure: all explanations with such a part together hold 95 % of the weight.
        temperature: the number of nats that count as one nat.
        adequacy: the error that the best explanation leaves; None: not computed.
        ranked: the evidence of all weighed explanations, the heaviest first.
        steps: the stages that set or changed `kind`.
        refuted: the keys of explanations that leave too much error.
    """

    kind: VerdictKind
    nominal: Explanation
    best: Explanation
    rivals: tuple[Explanation, ...]
    held: tuple[Weighed, ...]
    sure: frozenset[str]
    temperature: float
    adequacy: Adequacy | None
    ranked: tuple[Evidence, ...]
    steps: tuple[Step, ...]
    refuted: frozenset[frozenset[str]] = frozenset()

    def turned(self, by: Step, **changes: Any) -> Verdict:
        """Returns the verdict after the step `by`, which sets its kind; `changes` sets other fields."""
        return dataclasses.replace(self, kind=by.verdict, steps=(*self.steps, by), **changes)


def _said(one: Explanation, held: Sequence[Weighed]) -> float:
    """Returns the weight of an explanation plus that of all explanations that contain it."""
    return sum(other.weight for other in held if other.explanation.key == one.key or other.explanation.contains(one))


def _least(some: Sequence[Weighed], held: Sequence[Weighed]) -> list[Explanation]:
    """Returns the explanations of `some` that contain no other of `some`, the heaviest in `held` first."""
    least = [one.explanation for one in some if not any(one.explanation.contains(other.explanation) for other in some)]
    return sorted(least, key=lambda one: -_said(one, held))


def weigh(found: Found) -> Verdict:
    """Returns the verdict of the evidence alone, before adequacy is checked."""
    verdict = _among(found, ())
    assert verdict is not None  # nothing is refuted
    return verdict


def adequate(found: Found, left_of: Callable[[Explanation], Adequacy]) -> Verdict:
    """Returns the verdict of the evidence among the explanations that are adequate by `left_of`.

    If a black box predicts an explanation's residual, the explanation is not the whole answer and is refuted. The other
    explanations are weighed again if they hold more than 5 % of the weight. Otherwise the verdict is `unknown`.
    """
    first, refuted, fails = (verdict := weigh(found)), set[frozenset[str]](), None
    while failed := [
        one for one in (verdict.best, *verdict.rivals) if one.key not in refuted and not left_of(one).is_adequate
    ]:
        refuted, fails = refuted | {one.key for one in failed}, fails or failed[0]
        again = _among(found, refuted)
        if again is None:
            best = best_so_far(found) if first.kind == "none" else first.best
            by = Step("adequacy", "unknown", next(text for one in failed if (text := left_of(one).sentence)))
            return first.turned(by, best=best, adequacy=left_of(first.best))
        verdict = again
    left = left_of(verdict.best)
    if fails is None:
        return dataclasses.replace(verdict, adequacy=left)
    why = f"Not {' + '.join(fails.names) or 'the nominal model'}: {left_of(fails).sentence} {verdict.steps[-1].why}"
    step = Step("adequacy", verdict.kind, why)
    return dataclasses.replace(verdict, adequacy=left, steps=(*first.steps, step), refuted=frozenset(refuted))


def _among(found: Found, refuted: Collection[frozenset[str]]) -> Verdict | None:
    """Returns the verdict without refuted sets of parts and their subsets; None if these hold 95 % of the weight."""
    temperature = found.temperature
    fails = {one for one in found.table if any(one <= key for key in refuted)}  # fewer parts leave more error
    needed = _needed(found.ranked(), found, fails)
    ranked, weight = [*needed], evidence.weigh([*needed.values()], temperature)
    weight[[one.explanation.key in fails for one in ranked]] = 0.0
    if weight.sum() <= 1 - numbers.SURE:
        return None
    weight /= weight.sum()
    order = np.argsort(-weight, kind="stable")
    last = int(np.searchsorted(np.cumsum(weight[order]), numbers.SURE))
    held = [Weighed(ranked[index].explanation, float(weight[index])) for index in order[: last + 1].tolist()]
    held_by = evidence.held_by(ranked, weight)
    sure = frozenset(name for name, share in held_by.items() if share >= numbers.SURE)
    least, nothing = _least(held, held), found.nothing.explanation
    best = next((one for one in least if one.effects), least[0])  # values of runs are no missing law
    # Held-out runs can confirm an effect that the data support, but not one that only stated values support.
    data_tell, called = found.is_sure(best), " + ".join(best.names)
    if any(one.key == nothing.key for one in least):
        # The nominal fit moved a value from its stated value. Either the stated value is wrong or a law is missing: the
        # data do not tell which.
        least = [*_least([one for one in held if found.keeps_stated(one.explanation)], held), nothing]
        best = least[0]
        said = Step("weigh", "ambiguous", _STATED) if len(least) > 1 else Step("weigh", "none", _NOTHING)
    elif len(least) == 1 and best.key - nothing.key <= sure:
        least = least if data_tell else [best, nothing]
        said = Step("weigh", "named", _ONE.format(called)) if data_tell else Step("weigh", "ambiguous", _STATED)
    else:
        said = Step("weigh", "ambiguous", _SEVERAL.format(len(least), called))
    rivals = tuple(one for one in least if one is not best)
    return Verdict(said.verdict, nothing, best, rivals, tuple(held), sure, temperature, None, tuple(ranked), (said,))


def confirmed(verdict: Verdict, samples: Found, enough: float) -> Verdict:
    """Returns `verdict`, changed if the measured samples do not confirm it.

    Args:
        samples: evidence, at the samples, of nominal model, best explanation, and best explanation without each part.
        enough: how far, in nats, the nominal model's evidence may be below that of noise for the verdict `none`.
    """
    if verdict.kind not in ("named", "ambiguous"):
        return verdict
    if not any(one.effects for one in (verdict.best, *verdict.rivals)):
        return verdict.turned(Step("runs", "none", _RUNS))
    if verdict.kind == "ambiguous":
        return verdict
    said = _among(samples, verdict.refuted) if samples.is_sure(verdict.best) else None
    if said is None or said.kind == "none":
        if samples.judge.top - samples.nothing.total <= enough:
            return verdict.turned(Step("samples", "none", _UNSURE), best=verdict.nominal)
        return verdict.turned(Step("samples", "unknown", _UNSURE))
    best = said.best if said.kind == "named" else samples.ranked()[0].explanation
    if best.key == verdict.best.key:  # smaller explanations that score less are no answer
        return verdict
    weighed = {one.explanation.key for one in said.ranked}
    ranked = (*said.ranked, *(one for one in verdict.ranked if one.explanation.key not in weighed))
    by = Step("samples", said.kind, f"The measured samples ask for {' + '.join(said.best.names)} alone.")
    return verdict.turned(by, best=said.best, rivals=said.rivals, held=said.held, sure=said.sure, ranked=ranked)


def best_so_far(found: Found) -> Explanation:
    """Returns the explanation to report if something is missing but no explanation has enough weight.

    It is the single part that predicts best, or the nominal model if no part surely predicts better.
    """
    nothing = found.nothing
    alone = found.ranked(len(nothing.explanation.parts) + 1)
    best = max(alone, key=lambda single: single.total, default=nothing)
    gain = best.total - nothing.total
    return best.explanation if gain > numbers.CHANCE_NATS * found.judge.correlation(best) else nothing.explanation


def _needed(ranked: Sequence[Evidence], found: Found, refuted: Collection[frozenset[str]]) -> dict[Evidence, Evidence]:
    """Returns the explanations that are weighed, each with the evidence that sets its weight.

    If a simpler explanation is kept, a larger one is left out in two cases:

    - The larger one contains the simpler one, but the error that it removes is smaller than the error that remains.
      Error is the squared error above noise plus the distance of fitted values from stated values.
    - The larger one has more parts, but no better evidence and no better prior. Without this rule, the many large sets
      of parts would together outweigh a name.

    Laws of a wrong shape may leave error in a signal: a share of the error that they remove beyond values of runs and
    offsets of readings. A larger explanation gains nothing if it removes such error by a further law with a shape. If
    it does not surely remove more, no part is missing, and the simpler one gets the better evidence of the two.

    A refuted nominal model leaves no explanation out, because a law is missing. A refuted explanation with laws leaves
    others out unless a larger one removes enough: an added law may only imitate the right shape of its laws.
    """
    temperature = found.temperature
    prior = {one: one.log_prior(temperature) for one in ranked}
    excess = {one: found.judge.excess(one) for one in ranked}
    shape = {one: found.shape_error(one) for one in ranked}
    moved = {one: temperature * evidence.surprise(one.away) for one in ranked}
    best, stands, left_out = {one: one for one in ranked}, list[Evidence](), set[Evidence]()
    larger = {one: [each for each in ranked if each.explanation.contains(one.explanation)] for one in ranked}
    contained = {one: sum(one in others for others in larger.values()) for one in ranked}

    def own_error(simpler: Evidence, bigger: Evidence) -> Any:
        """Returns (signals,): the error of wrong shapes in `simpler`; 0 if `bigger` adds only offsets of readings."""
        return shape[simpler] * bool(bigger.explanation.key - bigger.explanation.offsets - simpler.explanation.key)

    def gain(simpler: Evidence, bigger: Evidence) -> float:
        """Returns the error of `simpler` that `bigger` removes, without error that wrong shapes of laws may leave."""
        gone, own = excess[simpler] - excess[bigger], own_error(simpler, bigger)
        return float((gone - np.clip(gone, 0.0, own)).sum()) / 2 + moved[simpler] - moved[bigger]

    def sure(simpler: Evidence, bigger: Evidence) -> float:
        """Returns the least gain that is sure if wrong shapes may leave error; 0 if they leave none."""
        return temperature * numbers.CHANCE_NATS * bool(own_error(simpler, bigger).any())

    def removes_enough(simpler: Evidence, bigger: Evidence) -> bool:
        """Returns whether `bigger` removes at least as much error of `simpler` as it leaves, and surely some error."""
        return gain(simpler, bigger) >= max(float(excess[bigger].sum()) / 2 + moved[bigger], sure(simpler, bigger))

    def counts(simpler: Evidence) -> bool:
        """Returns whether `simpler` may leave out other explanations."""
        is_refuted, laws = simpler.explanation.key in refuted, simpler.explanation.laws
        return not is_refuted or (bool(laws) and not any(removes_enough(simpler, other) for other in larger[simpler]))

    for other in sorted(ranked, key=lambda one: (len(one.explanation.parts), contained[one])):  # contained first
        for one in stands:
            if other in larger[one]:
                if (least := sure(one, other)) and gain(one, other) < least:
                    best[one] = max(best[one], other, key=lambda each: prior[each] + each.total / temperature)
                if not removes_enough(one, other):
                    left_out.add(other)
            fewer = len(one.explanation.parts) < len(other.explanation.parts)
            if fewer and prior[one] >= prior[other] and one.total >= other.total:
                left_out.add(other)
        if other not in left_out and counts(other):
            stands.append(other)
    needed = [one for one in ranked if one not in left_out]
    first = {one.explanation.laws: one for one in reversed(needed)}  # explanations of the same laws count as one
    return {one: best[one] for one in needed if first[one.explanation.laws] is one}
