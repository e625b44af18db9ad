"""The fifth stage: lets a composed term compete with the named effects where they leave structure."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover import gates
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.deadline import COMPOSED, Deadline
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.segment import Segment
from brickpilot.discover.terms.basis import EFFECT, parameters
from brickpilot.discover.terms.match import Match, matches
from brickpilot.discover.terms.search import ComposedTerms, find_terms
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Tell = Callable[[str], None]

_OUTPUTS = ("wheel_angle_left", "wheel_angle_right", "angle", "x", "position")


@dataclass(frozen=True)
class Composed:
    """A composed term that explains the data better than the named effects do.

    Attributes:
        model, plan: the model with the term, and its free parameters.
        terms: what was composed.
        alone: the term stands without named effects beside it.
        matches: the effects of the library that do nearly the same to the data, the best first.
    """

    model: Model
    plan: Plan
    terms: ComposedTerms
    alone: bool
    matches: tuple[Match, ...] = ()


def compose(prepared: Prepared, verdict: Verdict, tell: Tell) -> Composed | None:
    """Returns a composed term, where the best explanation is not adequate and a term explains more.

    Where windows are explained so far that only the noise of their start states remains, no term is composed.
    """
    nearly_explained = prepared.excitation.windowed and verdict.removed > gates.WINDOWS_EXPLAINED
    if verdict.adequate or nearly_explained:
        return None
    deadline = prepared.until(COMPOSED)
    if not deadline.allows("a composed term"):
        return None
    tell("composing a term for the rest")
    composed = _best_composed(prepared.coarse, prepared.fine, verdict, tell, deadline)
    if composed is None or not _holds_on_held_out_runs(prepared, verdict, composed):
        return None
    tell("matching the term with the laws of the library")
    base = View(prepared.coarse, verdict.nominal if composed.alone else verdict.best)
    return dataclasses.replace(composed, matches=tuple(matches(base, composed.terms, prepared.excitation)))


class View:
    """The residual as terms are fitted to it: see `terms.problem.Problem`."""

    def __init__(self, error: BinnedOutputError, found: FittedModel) -> None:
        self._error = error.with_plan(found.plan)
        self._point = found.point
        self.base: Model = found.model
        self.free: Sequence[Free] = found.plan.free

    @cached_property
    def sensitivities(self) -> Array:
        return self._error.sensitivity(self._point) * self._error.weight()[:, np.newaxis]

    @cached_property
    def segments(self) -> Sequence[Segment]:
        return self._error.segments(self.base, _OUTPUTS)

    def residual(self, models: Sequence[Model]) -> Array:
        return self._error.whiten(self._error.predict(models))


def _best_composed(
    coarse: BinnedOutputError, fine: BinnedOutputError, verdict: Verdict, tell: Tell, deadline: Deadline
) -> Composed | None:
    """Returns the best term, beside no effect or beside the named ones; None if it does not pass the gates."""
    bases = [verdict.nominal] if verdict.best is verdict.nominal else [verdict.nominal, verdict.best]
    found: list[tuple[float, bool, ComposedTerms]] = []
    for base in bases:
        one = find_terms(View(fine, base), rough=View(coarse, base), tell=tell, deadline=deadline)
        if one is not None:
            each = gates.parameter_cost(one.cost_after, fine.floor_cost())
            penalised = one.cost_after + each * (len(one.terms) + len(one.settings))
            penalised += base.penalised_cost - base.cost
            found.append((penalised, base is verdict.nominal, one))
    if not found:
        return None
    penalised, alone, best = min(found, key=lambda one: one[0])
    if not gates.gains_enough(verdict.best.penalised_cost, penalised, fine.floor_cost()):
        return None
    explained = verdict.nominal.cost - verdict.best.cost
    if verdict.best.penalised_cost - penalised < gates.TERM_SHARE_OF_EFFECTS * explained:
        return None
    base = verdict.nominal if alone else verdict.best
    return Composed(best.model, _plan(base.plan, best), best, alone)


def _holds_on_held_out_runs(prepared: Prepared, verdict: Verdict, composed: Composed) -> bool:
    """Returns whether the term removes enough of the gap on the held-out runs; True if no run is held out.

    It also has to leave less of it than the named effects alone do.
    """
    held_out = prepared.held_out()
    if held_out is None:
        return True
    noise, models = held_out.noise_cost(), (verdict.nominal.model, verdict.best.model, composed.model)
    before, named, after = (float(held_out.losses(model).sum()) - noise for model in models)
    return after < gates.TERM_HELD_OUT * before and (not verdict.best.chosen or after < named)


def _plan(base: Plan, found: ComposedTerms) -> Plan:
    """Returns the plan of the base model with the term's own parameters free. The clock is a choice, not a size."""
    names = {term.basis.name for term in found.terms} | found.settings.keys() - {"clock"}
    added = tuple(Free(f"{EFFECT}.{info.name}", info, None) for info in parameters() if info.name in names)
    model = dataclasses.replace(base.model, effects={**base.model.effects, EFFECT: found.model.effects[EFFECT]})
    return Plan(model, (*base.free, *added), ())
