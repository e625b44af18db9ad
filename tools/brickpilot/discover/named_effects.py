"""The effects of a finding, with intervals and with the explanations that the data cannot tell from them."""

from __future__ import annotations

from collections.abc import Mapping

from brickpilot import catalogue
from brickpilot.discover.compose import Composed
from brickpilot.discover.finding import Effect, Equivalent, Parameter, VerdictKind
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import value_of
from brickpilot.fit.uncertainty import Estimate
from brickpilot.vehicle.model import Model, unit_on


def named_effects(
    verdict: Verdict, kind: VerdictKind, composed: Composed | None, estimates: Mapping[str, Estimate], model: Model
) -> tuple[Effect, ...]:
    """Returns the effects that are named. Beside a composed term only those whose intervals exclude zero are.

    Args:
        estimates: "effect.parameter" -> estimate, of all free parameters of `model`.
    """
    if kind == "none" or (composed is not None and composed.alone):
        return ()
    effects = _effects(verdict, estimates, model)
    return tuple(one for one in effects if kind != "unknown" or _excludes_zero(one))


def _effects(verdict: Verdict, estimates: Mapping[str, Estimate], model: Model) -> tuple[Effect, ...]:
    """Returns the effects of the best explanation; the rivals stand with the first one."""
    equivalents = _equivalents(verdict)
    found = []
    for candidate in verdict.best.chosen:
        info = catalogue.effect(candidate.effect)
        values = {}
        for name in candidate.free:
            estimate = estimates[f"{candidate.effect}.{name}"]
            values[name] = Parameter(estimate.value, _unit(model, candidate.effect, name), estimate.ci95)
        found.append(Effect(candidate.effect, info.acts_on, info.equation, verdict.confidence, values, equivalents))
        equivalents = ()
    return tuple(found)


def _equivalents(verdict: Verdict) -> tuple[Equivalent, ...]:
    return tuple(
        Equivalent(
            " + ".join(one.names),
            {
                (f"{c.effect}.{name}" if len(one.chosen) > 1 else name): Parameter(
                    value_of(one.model, f"{c.effect}.{name}"), _unit(one.model, c.effect, name), None
                )
                for c in one.chosen
                for name in c.free
            },
            one.penalised_cost - verdict.best.penalised_cost,
        )
        for one in verdict.rivals
    )


def _excludes_zero(effect: Effect) -> bool:
    return all(one.ci95 is not None and one.ci95[0] * one.ci95[1] > 0 for one in effect.parameters.values())


def _unit(model: Model, effect: str, parameter: str) -> str:
    return unit_on(model, next(one for one in catalogue.effect(effect).parameters if one.name == parameter))
