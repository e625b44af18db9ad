"""The fourth stage: judges what the search found, at the measured samples: none, named, ambiguous or unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover import gates
from brickpilot.discover.backward import passes_gates, prune
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import sizes_of
from brickpilot.discover.deadline import FIRST_EFFECT, JUDGED, RIVALS
from brickpilot.discover.determined import drop_undetermined
from brickpilot.discover.effect_source import EffectSource
from brickpilot.discover.finding import VerdictKind
from brickpilot.discover.fitting import FittedModel, best_first, refine, without_parameter
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search import Searched
from brickpilot.discover.search_round import (
    agrees_with_its_name,
    ends_at_a_bound,
    instead_of_moved_values,
    largest_prior_shift,
)

Array = NDArray[np.float64]

_REFITTED = 5  # explanations that are fitted again at the measured samples
_NEAR_SHARE, _NEAR = 0.5, 100.0  # of the best one's cost, or of cost: those that the coarse search put so near to it
_DRAWS = 400  # of the bootstrap
_DRAWN_S = 1.0


@dataclass(frozen=True)
class Verdict:
    """The verdict, and the explanations at the measured samples.

    Attributes:
        nominal: the calibrated nominal model.
        best: the explanation that is kept; `nominal` itself if nothing is missing.
        rivals: explanations that the data cannot tell from it, the best first.
        ranked: all explanations that were fitted again, the best first, with `best`.
        noise: the cost that noise alone would leave.
        confidence: how often `best` comes first when stretches of time are drawn again, 0..1.
        unclaimed: where nothing passed the gates, the explanation that fits the fit runs best; None: there is none.
        alone: effect -> the cost that it takes away alone, as the search found.
        nominal_rivals: where nominal values leave what is stated of them, the explanations that need not move them.
    """

    kind: VerdictKind
    nominal: FittedModel
    best: FittedModel
    rivals: tuple[FittedModel, ...]
    ranked: tuple[FittedModel, ...]
    noise: float
    confidence: float
    unclaimed: FittedModel | None = None
    nominal_rivals: tuple[FittedModel, ...] = ()
    alone: Mapping[str, float] = field(default_factory=dict)

    @property
    def adequate(self) -> bool:
        """Whether the residual of the best explanation could be noise."""
        return self.best.cost <= gates.ADEQUATE * self.noise

    @property
    def removed(self) -> float:
        """The share of the cost above that of noise that the best explanation takes away."""
        return self.removed_by(self.best)

    @property
    def removed_unclaimed(self) -> float:
        """The share that the explanation without a claim takes away; 0 where there is none."""
        return 0.0 if self.unclaimed is None else self.removed_by(self.unclaimed)

    def removed_by(self, one: FittedModel) -> float:
        """Returns the share of the cost above that of noise that an explanation takes away, 0..1."""
        return float(np.clip((self.nominal.cost - one.cost) / max(self.nominal.cost - self.noise, 1e-9), 0.0, 1.0))


def judge(prepared: Prepared, searched: Searched) -> Verdict:
    """Fits what the search found at the measured samples, with the noise floors of the search, and decides."""
    error, jobs = prepared.fine, prepared.jobs
    error.adopt_scales(prepared.coarse)
    held_out = prepared.held_out()
    nominal = _first(refine(error, [searched.nominal], jobs), searched.nominal)
    noise = error.noise_cost()
    nothing: VerdictKind = "unknown" if nominal.cost > gates.UNEXPLAINED * noise else "none"
    if FIRST_EFFECT in prepared.deadline.left_out:
        nothing = "unknown"
    if not searched.best.chosen:
        rivals = _instead_of_moved_values(prepared, searched, nominal)
        if rivals and rivals[0].penalised_cost < nominal.penalised_cost:
            confidence = _confidence(error, rivals[0], [nominal, *rivals[1:]])
            others = (nominal, *rivals[1:])
            return Verdict("ambiguous", nominal, rivals[0], others, rivals, noise, confidence, nominal_rivals=rivals)
        return Verdict(nothing, nominal, nominal, (), rivals, noise, 1.0, nominal_rivals=rivals)
    best = _first(refine(error, [searched.best], jobs), searched.best)
    best = drop_undetermined(error, prune(error, nominal, best, jobs, held_out), jobs)
    stays = bool(best.chosen) and passes_gates(error, nominal, nominal, best, held_out)
    near = _near_best(searched, best if stays else None)
    refitted = refine(error, near, jobs) if near and prepared.until(JUDGED).allows(RIVALS) else []
    found = [one for one in [best, *refitted] if one.chosen]
    ranked = tuple(best_first(found))
    determined = _determined(prepared, nominal, best, ranked, held_out)
    if not determined:
        unclaimed = ranked[0] if ranked else None
        return Verdict(nothing, nominal, nominal, (), ranked, noise, 1.0, unclaimed)
    first, near = _rank(error, determined)
    best, rivals = near[0], _rivals(error, near, jobs)
    later = [one for one in ranked if one.penalised_cost >= first.penalised_cost and _is_another(one, best)]
    confidence = _confidence(error, best, [nominal, *later])
    kind: VerdictKind = "unknown" if _cut_short(prepared, best, noise) else "ambiguous" if rivals else "named"
    return Verdict(kind, nominal, best, rivals, ranked, noise, confidence, alone=_alone(searched))


def _is_possible(prepared: Prepared, found: FittedModel) -> bool:
    """Returns whether its effects can have the values that were fitted at the measured samples."""
    return not ends_at_a_bound(found) and agrees_with_its_name(found, prepared.excitation)


def _cut_short(prepared: Prepared, best: FittedModel, noise: float) -> bool:
    """Returns whether what the budget left out may have been a better explanation than `best`."""
    left_out = prepared.deadline.left_out
    rest_unsearched = bool(left_out) and best.cost > gates.ADEQUATE * noise
    return FIRST_EFFECT in left_out or RIVALS in left_out or rest_unsearched


def _alone(searched: Searched) -> dict[str, float]:
    """Returns effect -> the cost that it takes away alone, as the search found."""
    found: dict[str, float] = {}
    for one in [one for step in searched.rounds for one in step.tried if len(one.chosen) == 1]:
        found[one.names[0]] = max(found.get(one.names[0], 0.0), searched.nominal.cost - one.cost)
    return found


def share_windows_must_remove(searched: Searched, verdict: Verdict) -> float:
    """Returns the share of the gap that an explanation of windows has to remove to replace that of whole runs.

    A search that ended at a periodic effect was broken off, so that its share is not to be beaten.
    """
    if searched.best.is_periodic:
        return gates.WINDOWS_REMOVE
    return max(gates.WINDOWS_REMOVE, verdict.removed + gates.WINDOWS_REMOVE_MORE)


def suspected_in_windows(verdict: Verdict) -> Verdict | None:
    """Returns the verdict without a claim, if its periodic explanation removes enough of the gap in windows."""
    if not verdict.best.is_periodic or verdict.removed < gates.WINDOWS_SUSPECT:
        return None
    return replace(verdict, kind="unknown", best=verdict.nominal, rivals=(), unclaimed=verdict.best)


def _instead_of_moved_values(prepared: Prepared, searched: Searched, nominal: FittedModel) -> tuple[FittedModel, ...]:
    """Returns the explanations that fit as well as moved nominal values do, and leave those as stated; the best first.

    A payload is a mass that nobody stated. Where no nominal value left what is stated of it, there is none.
    """
    error = prepared.fine
    if largest_prior_shift(error, nominal) <= gates.PRIOR_LEFT_SD:
        return ()
    deadline = prepared.until(JUDGED)
    if FIRST_EFFECT in deadline.left_out or not deadline.allows("explanations with the nominal values as stated"):
        return ()
    limit = gates.rival_margin(nominal.penalised_cost, nominal.cost, error.floor_cost())
    source = EffectSource(prepared.excitation)
    found = instead_of_moved_values(prepared.coarse, source, searched.nominal, prepared.jobs, deadline)
    fits = refine(error, found, prepared.jobs)
    kept = [drop_undetermined(error, one, prepared.jobs) for one in fits if one.penalised_cost < limit]
    first = {one.names: one for one in reversed(best_first(kept)) if one.chosen and one.penalised_cost < limit}
    return tuple(best_first(list(first.values())))


def _near_best(searched: Searched, best: FittedModel | None) -> list[FittedModel]:
    """Returns the other explanations near the best one of the search, each set of effects once, as fitted best.

    Args:
        best: what is left of that one at the measured samples; it with further effects is not another one. None: it
            did not pass the gates, so what holds its effects may.
    """
    limit = searched.best.penalised_cost + max(_NEAR, _NEAR_SHARE * searched.best.cost)
    found: dict[frozenset[str], FittedModel] = {}
    for one in best_first([one for step in searched.rounds for one in step.tried]):
        if one.chosen and one.penalised_cost < limit and (best is None or _is_another(one, best)):
            found.setdefault(frozenset(one.names), one)
    return list(found.values())[:_REFITTED]


def _rank(error: BinnedOutputError, determined: Sequence[FittedModel]) -> tuple[FittedModel, list[FittedModel]]:
    """Returns the first of `determined`, and those within its margin without needless effects."""
    first = determined[0]
    limit = gates.rival_margin(first.penalised_cost, first.cost, error.floor_cost())
    return first, _simplest(list(takewhile(lambda one: one.penalised_cost <= limit, determined)))


def _determined(
    prepared: Prepared,
    nominal: FittedModel,
    best: FittedModel,
    ranked: Sequence[FittedModel],
    held_out: BinnedOutputError | None,
) -> list[FittedModel]:
    """Returns those of `ranked` that pass the gates, the best first, without parameters that are undetermined.

    What is left of an explanation after those are dropped has to pass the gates too. It may be one of fewer effects,
    which the search did not follow.
    """
    error, jobs = prepared.fine, prepared.jobs

    def passes(one: FittedModel) -> bool:
        return bool(one.chosen) and _is_possible(prepared, one) and passes_gates(error, nominal, nominal, one, held_out)

    passing = [one for one in ranked if passes(one)]
    left = [one if one is best else drop_undetermined(error, one, jobs) for one in passing]
    first = {frozenset(one.names): one for one in reversed(best_first(left))}
    return [one for one in best_first(list(first.values())) if one in passing or passes(one)]


def _simplest(near: Sequence[FittedModel]) -> list[FittedModel]:
    """Returns those of `near` that do not hold all effects of another one and more.

    The data cannot tell them from fewer effects, so nobody knows that the further effects are there.
    """
    return [one for one in near if not any(set(other.names) < set(one.names) for other in near)]


def _rivals(error: BinnedOutputError, near: Sequence[FittedModel], jobs: int) -> tuple[FittedModel, ...]:
    """Returns those of `near` that say something else than the first one and than each other."""
    kept = [near[0]]
    for one in near[1:]:
        if all(_is_another(one, other) and not _imitates(error, one, other, jobs) for other in kept):
            kept.append(one)
    return tuple(kept[1:])


def _is_another(one: FittedModel, best: FittedModel) -> bool:
    """Returns whether `one` is another explanation, not the same one with further effects."""
    return not set(one.names) >= set(best.names)


def _imitates(error: BinnedOutputError, one: FittedModel, other: FittedModel, jobs: int) -> bool:
    """Returns whether `one` says the same as `other` with more parameters, as stiction without a breakaway does."""
    if one.parameter_count <= other.parameter_count:
        return False
    beside = [candidate for candidate in one.chosen if candidate.effect not in other.names]
    smaller = [without_parameter(one, candidate, name) for candidate in beside for name in sizes_of(candidate)]
    versions = [one, *refine(error, [less for less in smaller if less.names == one.names], jobs)]
    simulated = error.predict([other.model, *(version.model for version in versions)])
    differences = np.sqrt(np.mean(((simulated[1:] - simulated[0]) * error.weight()) ** 2, axis=1))
    return bool(differences.min() < gates.SAME_SCALES)


def _first(found: Sequence[FittedModel], fallback: FittedModel) -> FittedModel:
    return found[0] if found else fallback


def _confidence(error: BinnedOutputError, best: FittedModel, others: Sequence[FittedModel]) -> float:
    """Returns the share of bootstrap draws of stretches of time in which `best` stays first.

    See Efron & Tibshirani 1993, ch. 8.
    """
    numbers, count = error.stretches_of(_DRAWN_S)
    sums = np.array([np.bincount(numbers, one.losses, count) for one in [best, *others]])
    fixed = np.array([one.penalised_cost - one.losses.sum() for one in [best, *others]])
    draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=_DRAWS)
    totals = draws @ sums.T + fixed
    return float(np.mean(np.argmin(totals, axis=1) == 0))
