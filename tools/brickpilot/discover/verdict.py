"""The verdict: none, named, ambiguous or unknown, from what the search fitted, judged again at the measured samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.band import Band
from brickpilot.discover.candidates import sizes_of
from brickpilot.discover.finding import Verdict
from brickpilot.discover.select import Fitted, Selection, polish, pruned, without_parameter, worth
from brickpilot.fit.uncertainty import Estimate, assess

Array = NDArray[np.float64]

_LOOKED_AT = 5  # explanations that are fitted again at the measured samples
_NEAR_SHARE, _NEAR = 0.5, 100.0  # of the best one's cost, or of cost: those that the coarse search put so near to it
# Of charged cost, and of the cost: nearer than that the data cannot tell. Where even the best leaves more than a model
# is trusted to, a difference is worth so much less (a quasi-likelihood, McCullagh & Nelder 1989, ch. 9).
_MARGIN, _MARGIN_SHARE = 12.0, 0.02
_SAME = 0.1  # scales, rms: two simulations that differ by less say the same
_ADEQUATE = 1.3  # times the cost of noise alone: more than that is structure
_UNEXPLAINED = 1.6  # times the cost of noise: where more is left and nothing names it, something is missing still
_INDISPENSABLE = 1.25  # times the cost, without a size that has no interval: so much worse, it is there all the same
_DRAWS = 400
_STRETCH_S = 1.0


@dataclass(frozen=True)
class Judged:
    """The explanations at the measured samples.

    Attributes:
        nominal: the re-calibrated nominal model.
        best: what is kept; `nominal` itself where nothing is missing.
        rivals: those the data cannot tell from it, best first.
        ranked: all that were looked at again, best first, `best` included.
        noise: the cost that noise alone would leave.
        confidence: how often `best` is first when the stretches of time are drawn anew.
    """

    verdict: Verdict
    nominal: Fitted
    best: Fitted
    rivals: tuple[Fitted, ...]
    ranked: tuple[Fitted, ...]
    noise: float
    confidence: float

    @property
    def adequate(self) -> bool:
        """Whether what is left could be noise."""
        return self.best.cost <= _ADEQUATE * self.noise


def judge(band: Band, selection: Selection, jobs: int, unseen: Band | None) -> Judged:
    """Fits what the search found once more and decides.

    Args:
        band: at the measured samples, its floors those of the search.
        unseen: the held-out runs; None: there are none.
    """
    nominal = _first(polish(band, [selection.nominal], jobs), selection.nominal)
    noise = band.noise_cost()
    nothing: Verdict = "unknown" if nominal.cost > _UNEXPLAINED * noise else "none"
    if not selection.best.chosen:
        return Judged(nothing, nominal, nominal, (), (), noise, 1.0)
    best = _first(polish(band, [selection.best], jobs), selection.best)
    best = certain(band, pruned(band, best, jobs, unseen), jobs)
    if not best.chosen or not worth(band, nominal, best, unseen):
        return Judged(nothing, nominal, nominal, (), (best,), noise, 1.0)
    others = polish(band, _near(selection, best), jobs)
    ranked = tuple(sorted([best, *others], key=lambda one: one.charged))
    checked = ((one, one if one is best else certain(band, one, jobs)) for one in ranked)
    sure = (kept for one, kept in checked if kept.names == one.names)
    first = next(sure)
    limit = first.charged + max(_MARGIN, _MARGIN_SHARE * first.cost) * max(1.0, first.cost / band.trusted())
    near = _simplest([first, *takewhile(lambda one: one.charged <= limit, sure)])
    best, rivals = near[0], list[Fitted]()
    for one in near[1:]:
        if all(_another(one, kept) and not _nests(band, one, kept, jobs) for kept in (best, *rivals)):
            rivals.append(one)
    believable = [one for one in ranked if one.charged >= first.charged and _another(one, best)]
    confidence = _confidence(band, best, [nominal, *believable])
    return Judged("ambiguous" if rivals else "named", nominal, best, tuple(rivals), ranked, noise, confidence)


def _simplest(near: Sequence[Fitted]) -> list[Fitted]:
    """Those of `near`, which the data cannot tell apart, that hold no other's effects and more.

    What the data cannot tell from fewer effects is not known to be there.
    """
    return [one for one in near if not any(set(other.names) < set(one.names) for other in near)]


def certain(band: Band, found: Fitted, jobs: int) -> Fitted:
    """`found` without parameters whose interval holds zero, one at a time, the least certain first.

    What an effect has of them is not known to be there. An effect that is left without a size goes altogether. A size
    without an interval may be known but for its unit, as all forces are where nobody stated a mass: it stays where the
    data cannot do without it.
    """
    needed_all_the_same: set[tuple[str, str]] = set()
    while found.chosen:
        estimates = assess(band.with_plan(found.plan), found.model, found.plan.free).estimates
        doubts = [
            (_certainty(estimate), candidate, name)
            for candidate in found.chosen
            for name in sizes_of(candidate)
            if (candidate.effect, name) not in needed_all_the_same
            and not _apart(estimate := estimates[f"{candidate.effect}.{name}"])
        ]
        if not doubts:
            return found
        _, candidate, name = min(doubts, key=lambda one: one[0])
        shorter = polish(band, [without_parameter(found, candidate, name)], jobs)
        if not shorter:
            return found
        unbounded = estimates[f"{candidate.effect}.{name}"].ci95 is None
        if unbounded and shorter[0].charged > _INDISPENSABLE * found.charged:
            needed_all_the_same.add((candidate.effect, name))
            continue
        found = shorter[0]
    return found


def _apart(estimate: Estimate) -> bool:
    return estimate.ci95 is not None and (estimate.ci95[0] > 0 or estimate.ci95[1] < 0)


def _certainty(estimate: Estimate) -> float:
    if estimate.ci95 is None:
        return 0.0
    return abs(estimate.value) / max(estimate.ci95[1] - estimate.ci95[0], 1e-300)


def _near(selection: Selection, best: Fitted) -> list[Fitted]:
    """The other explanations that came near the best one, each set of effects once, the best way it was fitted."""
    limit = selection.best.charged + max(_NEAR, _NEAR_SHARE * selection.best.cost)
    found: dict[frozenset[str], Fitted] = {}
    for one in sorted((one for step in selection.steps for one in step.tried), key=lambda one: one.charged):
        if one.charged < limit and _another(one, best):
            found.setdefault(frozenset(one.names), one)
    return list(found.values())[:_LOOKED_AT]


def _another(one: Fitted, best: Fitted) -> bool:
    """Whether it is another explanation, not the same one with more to it."""
    return not set(one.names) >= set(best.names)


def _nests(band: Band, one: Fitted, other: Fitted, jobs: int) -> bool:
    """Whether it says what `other` says, with more parameters: stiction without a breakaway is Coulomb friction."""
    if _count(one) <= _count(other):
        return False
    beside = [candidate for candidate in one.chosen if candidate.effect not in other.names]
    smaller = [without_parameter(one, candidate, name) for candidate in beside for name in sizes_of(candidate)]
    versions = [one, *polish(band, [less for less in smaller if less.names == one.names], jobs)]
    simulated = band.predict([other.model, *(version.model for version in versions)])
    apart = np.sqrt(np.mean(((simulated[1:] - simulated[0]) * band.weight()) ** 2, axis=1))
    return bool(apart.min() < _SAME)


def _count(one: Fitted) -> int:
    return sum(len(candidate.free) for candidate in one.chosen)


def _first(found: Sequence[Fitted], fallback: Fitted) -> Fitted:
    return found[0] if found else fallback


def _confidence(band: Band, best: Fitted, others: Sequence[Fitted]) -> float:
    """Share of bootstrap draws of stretches of time in which `best` stays first (Efron & Tibshirani 1993, ch. 8)."""
    numbers, count = band.stretches_of(_STRETCH_S)
    sums = np.array([np.bincount(numbers, one.losses, count) for one in [best, *others]])
    fixed = np.array([one.charged - one.losses.sum() for one in [best, *others]])
    draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=_DRAWS)
    totals = draws @ sums.T + fixed
    return float(np.mean(np.argmin(totals, axis=1) == 0))
