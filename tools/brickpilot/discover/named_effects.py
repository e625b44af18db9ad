"""The effects of a finding, with intervals and with the explanations that the data cannot tell from them."""

from __future__ import annotations

from collections.abc import Mapping

from brickpilot import catalogue
from brickpilot.discover import gates
from brickpilot.discover.finding import NOMINAL_VALUES, Effect, Equivalent, Identified, Parameter
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.written import Written
from brickpilot.fit.parameters import value_of
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle.model import Model, unit_on


def named_effects(prepared: Prepared, verdict: Verdict, written: Written) -> tuple[Effect, ...]:
    """Returns the effects of the best explanation; they are claimed where the evidence allows it.

    Beside a composed term, effects are claimed whose intervals exclude zero. Where none does, as for any `unknown`, the
    best explanation without the term is listed if it removes enough of the gap to be worth a reader's time.
    """
    found = verdict.best if verdict.best.chosen else verdict.unclaimed
    if written.kind == "none" or found is None:
        return ()
    confidence = verdict.confidence
    if written.evidence is not None and written.evidence.draws is not None:
        confidence = min(confidence, written.evidence.draws)
    if written.kind in ("named", "ambiguous"):
        proved = written.evidence is not None and written.evidence.kind == "held_out"
        return _effects(verdict, found, written.estimates, written.model, confidence, claimed=proved)
    if verdict.removed_by(found) < gates.WORTH_LISTING:
        return ()
    if written.composed is not None and not written.composed.alone:
        effects = _effects(verdict, found, written.estimates, written.model, confidence, claimed=True)
        if sure := tuple(one for one in effects if _excludes_zero(one)):
            return sure
    estimates = assess(prepared.fine.with_plan(found.plan), found.model, found.plan.free).estimates
    return _effects(verdict, found, estimates, found.model, confidence, claimed=False)


def mechanism(effects: tuple[Effect, ...], written: Written) -> str | None:
    """Returns the kind of cause that explains most; None if nothing is missing or nothing points at one.

    A law that is not quite right still shows its mechanism: the best effect stands for it where that removes most of
    the gap. Else the composed term does: by the law of the library that it resembles, or by its own place and symbols.
    """
    if written.kind == "none":
        return None
    composed, first = written.composed, effects[0] if effects else None
    if composed is None or (first is not None and (first.claimed or first.removed > gates.SHOWS_MECHANISM)):
        return first.mechanism if first is not None else None
    nearest = composed.matches[0] if composed.matches else None
    if nearest is not None and nearest.correlation > gates.SHOWS_MECHANISM:
        return nearest.mechanism
    return composed.terms.terms[0].basis.mechanism


def _effects(
    verdict: Verdict,
    found: FittedModel,
    estimates: Mapping[str, Estimate],
    model: Model,
    confidence: float,
    *,
    claimed: bool,
) -> tuple[Effect, ...]:
    """Returns the effects of `found`, that which removes most alone first; the rivals stand with the first one."""
    equivalents = _equivalents(verdict)
    effects = []
    for candidate in sorted(found.chosen, key=lambda one: -verdict.alone.get(one.effect, 0.0)):
        info = catalogue.effect(candidate.effect)
        values = {}
        for name in candidate.free:
            estimate = estimates[f"{candidate.effect}.{name}"]
            unit = _unit(model, candidate.effect, name)
            values[name] = Parameter(estimate.value, unit, estimate.ci95, _identified(estimate))
        effects.append(
            Effect(
                name=candidate.effect,
                mechanism=catalogue.mechanism(candidate.effect, model.effects[candidate.effect]),
                law=catalogue.law(candidate.effect, model.effects[candidate.effect]),
                acts_on=info.acts_on,
                equation=info.equation,
                confidence=confidence,
                parameters=values,
                removed=verdict.removed_by(found),
                claimed=claimed,
                equivalents=equivalents,
            )
        )
        equivalents = ()
    return tuple(effects)


def _equivalents(verdict: Verdict) -> tuple[Equivalent, ...]:
    return tuple(
        Equivalent(
            " + ".join(one.names) or NOMINAL_VALUES,
            {
                (f"{c.effect}.{name}" if len(one.chosen) > 1 else name): Parameter(
                    value_of(one.model, f"{c.effect}.{name}"), _unit(one.model, c.effect, name), None
                )
                for c in one.chosen
                for name in c.free
            },
            one.penalised_cost - verdict.best.penalised_cost,
            dict(one.model.parameters),
            {name: dict(table) for name, table in one.model.effects.items()},
        )
        for one in verdict.rivals
    )


def _identified(estimate: Estimate) -> Identified | None:
    found = estimate.identified
    if found is None:
        return None
    sign = 1.0 if estimate.value >= 0 else -1.0
    low, high = sorted(sign * end for end in found.ci95)
    return Identified(found.name, found.formula, sign * found.value, found.unit, (low, high))


def _excludes_zero(effect: Effect) -> bool:
    return all(one.ci95 is not None and one.ci95[0] * one.ci95[1] > 0 for one in effect.parameters.values())


def _unit(model: Model, effect: str, parameter: str) -> str:
    return unit_on(model, next(one for one in catalogue.effect(effect).parameters if one.name == parameter))
