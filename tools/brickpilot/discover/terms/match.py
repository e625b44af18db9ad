"""Matches composed terms with the effects of the library: which law does the same to the data?

A term and an effect are compared by what they do to the simulated signals, in scales, with everything projected out
that the nominal parameters could take up. So an effect matches a term that acts at another place, if the data cannot
tell the two apart.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brickpilot import catalogue
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, candidates
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.gates import TERM_EQUALS_EFFECT
from brickpilot.discover.probes import fit_amplitudes, probes_of, values_at
from brickpilot.discover.projection import Projection
from brickpilot.discover.terms.basis import EFFECT
from brickpilot.discover.terms.composed import ComposedTerms
from brickpilot.fit.parameters import Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_FITTED = 4  # effects that lead the screen and are fitted to the term
_EVALUATIONS = 15  # of a fit; its parameters are few, and it starts near
_INSIDE = 1e-9  # of the bounds, in coordinates
_STEP = 1e-4  # of finite differences, in coordinates: the simulated change is free of noise


@dataclass(frozen=True)
class Match:
    """An effect of the library that was fitted to a composed term.

    Attributes:
        effect: its name.
        values: its parameters, SI.
        correlation: 0 to 1, cosine between what it and what the term do to the signals, whitened and projected.
    """

    effect: str
    values: Mapping[str, float]
    correlation: float

    @property
    def is_equal(self) -> bool:
        """Whether the term is this law under another name."""
        return self.correlation >= TERM_EQUALS_EFFECT

    @property
    def law(self) -> str:
        """What the law is called, as in "FAMILY, but DIFFERENCE"."""
        return catalogue.law(self.effect, self.values)

    @property
    def mechanism(self) -> str:
        return catalogue.mechanism(self.effect, self.values)


def matches(error: BinnedOutputError, base: FittedModel, found: ComposedTerms, excitation: Excitation) -> list[Match]:
    """Returns the effects that do to the data nearly what `found` does, the best first.

    Args:
        error: the data.
        base: the model that the terms were added to.
        found: the terms.
        excitation: how far the vehicle was driven.

    Each effect of the library is simulated at a few sizes beside the model without the terms; the best few are then
    fitted to the term, not to the measured signals. Nothing here is random.
    """
    comparison = _Comparison(error, base, found)
    screened: dict[str, tuple[Candidate, Match]] = {}
    for candidate in candidates(comparison.without):
        one = _screened(comparison, candidate, excitation)
        if one is not None and one.correlation > _correlation_of(screened.get(candidate.effect)):
            screened[candidate.effect] = candidate, one
    best = sorted(screened.values(), key=lambda pair: -pair[1].correlation)[:_FITTED]
    return sorted((_fitted(comparison, *pair) for pair in best), key=lambda one: -one.correlation)


class _Comparison:
    """What the terms do to the signals, and what other models do to them.

    Attributes:
        without: the model without the terms.
        target: (samples + parameters,) the projected change that the terms make.
    """

    def __init__(self, error: BinnedOutputError, base: FittedModel, found: ComposedTerms) -> None:
        effects = {name: values for name, values in found.fitted.model.effects.items() if name != EFFECT}
        if own := base.model.effects.get(EFFECT):
            effects[EFFECT] = own
        self.without: Model = dataclasses.replace(found.fitted.model, effects=effects)
        self._error = error.with_plan(base.plan)
        self._projection = Projection(self._error, found.fitted.point[: len(base.point)])
        self._plain = self._error.residual_of(self.without)
        self.target = self.changes([found.fitted.model])[:, 0]

    def changes(self, models: Sequence[Model]) -> Array:
        """Returns (samples + parameters, models); NaN where the plant diverges."""
        return self._projection.signatures(self._plain - one for one in self._error.residuals_of(models))

    def correlation(self, change: Array) -> float:
        size = float(np.linalg.norm(change) * np.linalg.norm(self.target))
        return float(change @ self.target) / size if size > 0 and np.isfinite(size) else 0.0


def _correlation_of(pair: tuple[Candidate, Match] | None) -> float:
    return 0.0 if pair is None else pair[1].correlation


def _screened(comparison: _Comparison, candidate: Candidate, excitation: Excitation) -> Match | None:
    """Returns a candidate at the size that comes nearest to the terms; None if it changes nothing."""
    plan = Plan(comparison.without, (), ())
    best: Match | None = None
    for probe in probes_of(candidate, comparison.without, excitation):
        changes = comparison.changes([candidate.starting(plan, values).model for values in probe.values])
        if not np.isfinite(changes).all() or not np.any(changes):
            continue
        amplitudes = fit_amplitudes(probe, changes, comparison.target)
        correlation = comparison.correlation(changes @ amplitudes)
        if best is None or correlation > best.correlation:
            best = Match(candidate.effect, values_at(probe, amplitudes), correlation)
    return best


def _fitted(comparison: _Comparison, candidate: Candidate, start: Match) -> Match:
    """Returns the effect with its free parameters fitted to the change that the terms make."""
    plan = candidate.starting(Plan(comparison.without, (), ()), start.values)
    low, high = (np.array(side) for side in zip(*(one.bounds() for one in plan.free), strict=True))
    scale = float(np.linalg.norm(comparison.target))

    def apart(point: Array) -> Array:
        change = comparison.changes([plan.at(point)])[:, 0]
        return np.where(np.isfinite(change), change - comparison.target, scale)

    point = np.clip(plan.start(), low + _INSIDE, high - _INSIDE)
    steps = np.full(len(point), _STEP)
    found = least_squares(apart, point, bounds=(low, high), diff_step=steps, max_nfev=_EVALUATIONS)
    fitted = plan.at(np.asarray(found.x))
    correlation = comparison.correlation(comparison.changes([fitted])[:, 0])
    return Match(candidate.effect, fitted.effects[candidate.effect], correlation)
