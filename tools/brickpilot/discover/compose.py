"""The fifth stage: lets a composed term compete with the named effects where they leave structure."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

from brickpilot.discover import gates
from brickpilot.discover.deadline import COMPOSED, Deadline
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.terms.composed import ComposedTerms, find_terms
from brickpilot.discover.terms.match import Match, matches
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import Plan
from brickpilot.vehicle.model import Model

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Composed:
    """A composed term that explains the data better than the named effects do.

    Attributes:
        terms: what was composed.
        alone: the term stands without named effects beside it.
        matches: the effects of the library that do nearly the same to the data, the best first.
    """

    terms: ComposedTerms
    alone: bool
    matches: tuple[Match, ...] = ()

    @property
    def model(self) -> Model:
        """The model with the term."""
        return self.terms.fitted.model

    @property
    def plan(self) -> Plan:
        """Its free parameters, from `model` on."""
        return dataclasses.replace(self.terms.fitted.plan, model=self.model)


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
    composed = _best_composed(prepared, verdict, tell, deadline)
    if composed is None or not _holds_on_held_out_runs(prepared, verdict, composed):
        return None
    tell("matching the term with the laws of the library")
    base = verdict.nominal if composed.alone else verdict.best
    found = matches(prepared.coarse, base, composed.terms, prepared.excitation)
    return dataclasses.replace(composed, matches=tuple(found))


def _best_composed(prepared: Prepared, verdict: Verdict, tell: Tell, deadline: Deadline) -> Composed | None:
    """Returns the best term, beside no effect or beside the named ones; None if it does not pass the gates."""
    bases = [verdict.nominal] if verdict.best is verdict.nominal else [verdict.nominal, verdict.best]
    tried = [(find_terms(prepared, base, tell=tell, deadline=deadline), base is verdict.nominal) for base in bases]
    found = [Composed(terms, alone) for terms, alone in tried if terms is not None]
    if not found:
        return None
    best = min(found, key=lambda one: one.terms.fitted.penalised_cost)
    penalised = best.terms.fitted.penalised_cost
    if not gates.gains_enough(verdict.best.penalised_cost, penalised, prepared.fine.floor_cost()):
        return None
    explained = verdict.nominal.cost - verdict.best.cost
    shakes_names = verdict.best.penalised_cost - penalised >= gates.TERM_SHARE_OF_EFFECTS * explained
    return best if shakes_names else None


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
