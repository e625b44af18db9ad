"""The last stage: puts together the finding, from models as their files say and simulations of them."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset
from brickpilot.discover import locate, numbers
from brickpilot.discover.compose import Composed
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import (
    NOMINAL_VALUES,
    Effect,
    Equivalent,
    Experiment,
    Finding,
    Identified,
    NominalChange,
    NominalFinding,
    Parameter,
    Place,
    Predictor,
    Rank,
    RunValues,
    Share,
    Term,
    VerdictKind,
    Visible,
)
from brickpilot.discover.parts import Part, RunPart, library_parts
from brickpilot.discover.periods import Period, own_period, resolved_order
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import signature_strengths
from brickpilot.discover.seal import Proof
from brickpilot.discover.settle import Settled
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.yardstick import Yardstick
from brickpilot.fit.parameters import Plan, value_of
from brickpilot.fit.replay import RUN_KINDS, Replay
from brickpilot.fit.residual import Problem
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle.composed_terms import PLACES, equation
from brickpilot.vehicle.model import Model, unit_on

_EFFECT_SHOWN = 1.0  # noise sd, rms over a tenth of a second: from there an effect shows in a signal
_LARGEST_LOG = 700.0  # of a double
_ERROR_SHOWN = 1.5  # the same for an error without an explanation, which has the noise on it: noise alone has 1


@dataclasses.dataclass(frozen=True)
class Conclusion:
    """What the stages found, for `conclude`.

    Attributes:
        kind: the verdict behind the seal.
        best: the best explanation as it was settled, claimed or not.
        written: the model that is written.
        nominal: the calibrated nominal model, as it was settled.
    """

    kind: VerdictKind
    judge: Judge
    verdict: Verdict
    best: Settled
    written: Settled
    nominal: Settled
    composed: Composed | None
    proof: Proof
    experiment: Experiment | None
    yardstick: Yardstick
    predictor: Predictor | None


def file_names(dataset: Dataset) -> set[str]:
    """Returns the names of all files that the command may write for a data set."""
    return {"report.html", "verdict.json", "model.toml", "compensation.toml", f"{_term_name(dataset)}.c"}


def conclude(prepared: Prepared, found: Conclusion) -> Finding:
    """Returns the finding. Its `elapsed_s` is 0; the pipeline knows the time."""
    verdict, proof, model = found.verdict, found.proof, found.written.model
    effects = _effects(prepared, found)
    adequacy = verdict.adequacy
    return Finding(
        dataset=proof.opened.whole,
        verdict=found.kind,
        mechanism=_mechanism(effects, found),
        law_differs=None if found.kind not in ("named", "ambiguous") else _law_differs(found),
        evidence=proof.evidence,
        effects=effects,
        explanations=tuple(
            Share(one.explanation.names, round(one.weight, 4), tuple(dict.fromkeys(_mechanisms(one.explanation))))
            for one in verdict.held
        ),
        where=_places(prepared, found),
        yardstick=found.yardstick,
        gap=proof.gap,
        by_signal=proof.by_signal,
        nominal=_nominal_changes(prepared.plan, model),
        nominal_findings=_nominal_findings(prepared, found),
        next_experiment=found.experiment,
        ranking=_ranking(found),
        whiteness=locate.whiteness(prepared.fine, prepared.fine.scaled(model)),
        power=_power(prepared, found),
        term=_term(prepared, found),
        nominal_model=found.nominal.model,
        augmented=model,
        simulated=proof.simulated,
        roles=prepared.roles.by_run,
        held_out_stretches=prepared.roles.stretches,
        faults=proof.opened.measured.faults,
        notes=(*_notes(prepared, found), *found.yardstick.notes),
        spread=found.written.spread,
        noise_sd=prepared.fine.sample_noise,
        run_values=_run_values(found),
        predictor=found.predictor,
        closed_loop=prepared.loop,
        disturbances=_disturbances(prepared, found),
        predictable_left=None if adequacy is None else adequacy.predictable,
        elapsed_s=0.0,
        seed=prepared.seed,
    )


def _law_differs(found: Conclusion) -> bool:
    """Returns whether the claimed effects leave more than the tolerance between what counts as one nat and noise."""
    adequacy = found.verdict.adequacy
    return adequacy is not None and adequacy.nats_left > numbers.UNEXPLAINED_NATS


def _mechanisms(one: Explanation) -> list[str]:
    """Returns the mechanism of each part; an effect's own with its fitted values."""
    tables = one.model.effects
    return [
        catalogue.mechanism(part.effect, tables[part.effect]) if type(part) is Part else part.mechanism
        for part in one.parts
    ]


def _mechanism(effects: tuple[Effect, ...], found: Conclusion) -> str | None:
    """Returns the kind of cause that explains most; None if nothing is missing or nothing points at one."""
    if found.kind == "none":
        return None
    if effects and (effects[0].claimed or found.composed is None):
        return effects[0].mechanism
    return None if found.composed is None else found.composed.mechanism


def _effects(prepared: Prepared, found: Conclusion) -> tuple[Effect, ...]:
    """Returns the effects of the best explanation, the one that most explanations share first.

    They are claimed where the verdict is `named` or `ambiguous`. For `unknown` they are the best names, not claimed.
    """
    explanation = found.best.explanation
    if found.kind == "none" or not explanation.effects:
        return ()
    claimed = found.kind in ("named", "ambiguous")
    estimates, model = found.best.estimates, found.best.model
    removed = _removed(found, explanation)
    equivalents = _equivalents(found) if found.verdict.kind == "ambiguous" else ()
    weight = _weights(found)
    effects: list[Effect] = []
    for part in sorted(explanation.effects, key=lambda one: -weight.get(one.name, 0.0)):
        info = catalogue.effect(part.effect)
        values = {}
        for name in part.free:
            estimate = estimates[f"{part.effect}.{name}"]
            values[name] = Parameter(
                estimate.value, _unit(model, part.effect, name), estimate.ci95, _identified(estimate)
            )
        effects.append(
            Effect(
                name=part.effect,
                mechanism=catalogue.mechanism(part.effect, model.effects[part.effect]),
                law=catalogue.law(part.effect, model.effects[part.effect]),
                acts_on=info.acts_on,
                equation=info.equation,
                confidence=round(weight.get(part.name, 0.0), 4),
                parameters=values,
                removed=removed,
                claimed=claimed,
                equivalents=equivalents if not effects else (),
            )
        )
    return tuple(effects)


def _weights(found: Conclusion) -> dict[str, float]:
    """Returns part -> the share of the explanations of the set that say it, by weight."""
    held = found.verdict.held
    total = max(sum(one.weight for one in held), 1e-9)
    parts = {part.name: part for one in held for part in one.explanation.parts}
    said = {name: sum(one.weight for one in held if one.explanation.says(part)) for name, part in parts.items()}
    return {name: min(1.0, weight / total) for name, weight in said.items()}


def _removed(found: Conclusion, one: Explanation) -> float:
    """Returns the share of the way from the nominal model to noise that an explanation goes, in evidence, 0..1."""
    by_key = {other.explanation.key: other for other in found.verdict.ranked}
    nothing = by_key[found.verdict.nominal.key].total
    way, known = found.judge.top - nothing, by_key.get(one.key)
    return float(min(1.0, max(0.0, (known.total - nothing) / way))) if known is not None and way > 0 else 0.0


def _equivalents(found: Conclusion) -> tuple[Equivalent, ...]:
    by_key = {other.explanation.key: other.total for other in found.verdict.ranked}
    best = by_key[found.verdict.best.key]
    return tuple(
        Equivalent(
            " + ".join(one.names) or NOMINAL_VALUES,
            {
                (f"{part.effect}.{name}" if len(one.parts) > 1 else name): Parameter(
                    value_of(one.model, f"{part.effect}.{name}"), _unit(one.model, part.effect, name), None
                )
                for part in one.effects
                for name in part.free
            },
            (best - by_key[one.key]) / found.verdict.temperature,
            dict(one.model.parameters),
            {name: dict(table) for name, table in one.model.effects.items()},
        )
        for one in found.verdict.rivals
    )


def _identified(estimate: Estimate) -> Identified | None:
    found = estimate.identified
    if found is None:
        return None
    sign = 1.0 if estimate.value >= 0 else -1.0
    low, high = sorted(sign * end for end in found.ci95)
    return Identified(found.name, found.formula, sign * found.value, found.unit, (low, high))


def _unit(model: Model, effect: str, parameter: str) -> str:
    return unit_on(model, next(one for one in catalogue.effect(effect).parameters if one.name == parameter))


def _disturbances(prepared: Prepared, found: Conclusion) -> dict[str, Period]:
    """Returns signal -> a disturbance with a period of its own in what free runs of the fit runs leave, in a loop.

    Without one the commands' own periods would be taken for it.
    """
    if prepared.loop is None:
        return {}
    runs = [run for run in prepared.dataset.runs if run.outputs]
    simulated = Replay(prepared.dataset).simulate([found.best.model], threads=prepared.jobs)[0]
    made = {
        signal: own_period(
            [(run.time, run.outputs[signal] - simulated[run.name][signal]) for run in runs if signal in run.outputs]
        )
        for signal in prepared.fine.signals
        if all(signal in simulated[run.name] for run in runs)
    }
    return {signal: one for signal, one in made.items() if one is not None}


def _run_values(found: Conclusion) -> tuple[RunValues, ...]:
    """Returns what differs from run to run, each kind that the best explanation holds."""
    made = []
    for part in found.best.explanation.parts:
        if isinstance(part, RunPart):
            kind = RUN_KINDS[part.effect]
            known = {run: found.best.estimates[f"{part.effect}@{run}"] for run in part.free}
            values = {run: (one.value, one.ci95 or (math.nan, math.nan)) for run, one in known.items()}
            made.append(RunValues(part.effect, kind.words, kind.unit, values))
    return tuple(made)


def _ranking(found: Conclusion) -> tuple[Rank, ...]:
    """Returns every explanation that was fitted to the end, the best first."""
    verdict = found.verdict
    held = {one.explanation.key: one.weight for one in verdict.held}
    best = verdict.ranked[0]
    return tuple(_rank(one, found, held, best) for one in verdict.ranked)


def _rank(one: Evidence, found: Conclusion, held: Mapping[frozenset[str], float], best: Evidence) -> Rank:
    explanation = one.explanation
    names = [free.name for free in explanation.plan.free if any(part.owns(free) for part in explanation.parts)]
    temperature = found.verdict.temperature
    worse, rarer = (best.total - one.total) / temperature, best.log_prior(temperature) - one.log_prior(temperature)
    if explanation.key in held:
        why = f"It holds {100 * held[explanation.key]:.0f} % of the weight."
    else:
        why = f"It predicts worse by {worse:.1f}, where {numbers.CHANCE_NATS:.0f} is sure."
        if worse <= 0 or worse < min(rarer, numbers.CHANCE_NATS):
            why = "It predicts as well, but needs more that is rare, or values other than stated."
    left = max(found.judge.top - one.total, 0.0) / len(found.judge.data.measured)
    return Rank(
        explanation.names,
        {name: value_of(explanation.model, name) for name in names},
        math.exp(min(left, _LARGEST_LOG)),
        _removed(found, explanation),
        why,
    )


def nats_needed(temperature: float, part: Part) -> float:
    """Returns by how many nats a part has to predict better to be named: what counts as sure, and its prior odds."""
    return temperature * (numbers.CHANCE_NATS - part.log_odds)


def smallest_sizes(prepared: Prepared, best: Explanation, temperature: float) -> dict[str, Visible]:
    """Returns effect -> the size at which it would be named beside `best`: what a verdict of `none` is worth.

    The size is extrapolated from the nearest simulated size. Effects that nothing here excites are left out.
    """
    here = Problem(prepared.coarse, best.plan).keeping(best.point, len(best.point))
    found: dict[str, tuple[float, Visible]] = {}
    chosen = library_parts(best.model, here.data.signals)
    for part, values, strength in signature_strengths(here, best.point, chosen, excitation=prepared.excitation):
        name = part.free[0]
        size = abs(values[name]) * math.sqrt(nats_needed(temperature, part) / max(strength, 1e-12))
        away = abs(math.log(size / abs(values[name]))) if values[name] and size else math.inf
        info = next(one for one in catalogue.effect(part.effect).parameters if one.name == name)
        if size > info.maximum or not math.isfinite(away):
            continue
        if part.effect not in found or away < found[part.effect][0]:
            found[part.effect] = (away, Visible(name, size, info.unit))
    return {name: visible for name, (_, visible) in sorted(found.items())}


def _power(prepared: Prepared, found: Conclusion) -> Mapping[str, Visible]:
    """Returns the smallest size of each effect that would show; nothing if there is no time left."""
    if not prepared.deadline.allows("the smallest size of each effect that would show"):
        return {}
    claimed = found.kind in ("named", "ambiguous")
    best = found.verdict.best if claimed else found.verdict.nominal
    judge = Judge.of(prepared.fine, prepared.seed)
    settled = [
        judge.of_explanation(one.explanation) for one in (found.best if claimed else found.nominal, found.nominal)
    ]
    return smallest_sizes(prepared, best, judge.temperature(*settled))


def _places(prepared: Prepared, found: Conclusion) -> tuple[Place, ...]:
    """Returns where what was added to the model shows; where nothing was, where the nominal model leaves an error."""
    dataset, noise_sd, proof = found.proof.opened.whole, prepared.fine.sample_noise, found.proof
    if found.kind == "none":
        return ()
    motion, model = proof.simulated["augmented"], found.written.model
    known = prepared.plan.model.effects
    effects = {name: table for name, table in model.effects.items() if name in known}
    if len(effects) == len(model.effects):
        measured = {run.name: run.outputs for run in dataset.runs}
        return locate.places(dataset, measured, motion, motion, noise_sd, _ERROR_SHOWN)
    plain = Replay(dataset).simulate([dataclasses.replace(model, effects=effects)], threads=prepared.jobs)[0]
    return locate.places(dataset, motion, plain, motion, noise_sd, _EFFECT_SHOWN)


def _term_name(dataset: Dataset) -> str:
    """Returns the name of the composed term's C file, without its ending: a C identifier."""
    return "composed_for_" + ("_".join(re.findall("[a-z0-9]+", dataset.name.lower())) or "data")


def _term(prepared: Prepared, found: Conclusion) -> Term | None:
    """Returns the composed term for the page and the files; None if the model holds none."""
    composed = found.composed
    if composed is None:
        return None
    written = equation(composed.terms, composed.settings)
    places = dict.fromkeys(term.basis.place for term in composed.terms)
    evidence = found.proof.evidence
    return Term(
        ", ".join(PLACES[place] for place in places),
        f"{written.text}. {written.legend}",
        f"{_term_name(prepared.dataset)}.c",
        composed.terms,
        composed.settings,
        evidence.removed_held_out if evidence is not None else None,
    )


def _nominal_changes(plan: Plan, model: Model) -> dict[str, NominalChange]:
    """Returns what became of each nominal value that was stated and fitted."""
    fitted = [free for free in plan.free if free.effect is None and free.known is not None]
    changes = {}
    for free in fitted:
        assert free.known is not None
        value, sd = value_of(model, free.name), free.known.sd
        away = abs(value - free.known.value) / sd if sd else 0.0
        left = numbers.leaves_prior(away, len(fitted))
        changes[free.name] = NominalChange(free.known.value, value, unit_on(model, free.info), sd, left)
    return changes


def _nominal_findings(prepared: Prepared, found: Conclusion) -> tuple[NominalFinding, ...]:
    """Returns the nominal values that the model had to move beyond what is stated of them, where the data tell them.

    Where an effect was added that leaves them as stated, they are no finding. A value of which the data tell a
    combination alone is none either: the combination moved, and nobody knows by which of its values.
    """
    settled = found.written if found.kind == "named" else found.nominal
    if not settled.explanation.plan.free:
        return ()
    told = assess(prepared.fine, settled.explanation.model, settled.explanation.plan.free).estimates
    verdict = found.verdict
    others = verdict.rivals if found.kind == "none" else (verdict.best,) if verdict.nominal in verdict.rivals else ()
    rivals = tuple(" + ".join(one.names) for one in others)
    return tuple(
        NominalFinding(name, one.before, one.after, one.unit, abs(one.after - one.before) / one.sd, rivals)
        for name, one in _nominal_changes(prepared.plan, settled.model).items()
        if one.leaves_prior and one.sd and name in told and told[name].identifiable
    )


def _notes(prepared: Prepared, found: Conclusion) -> tuple[str, ...]:
    proof, verdict = found.proof, found.verdict
    notes = [prepared.roles.note, *prepared.plan.notes, *proof.opened.measured.notes, *prepared.fine.notes]
    notes += found.written.notes
    timed = any("timing" in _mechanisms(one) for one in (verdict.best, *verdict.rivals))
    if timed and (order := resolved_order(prepared.dataset)) is not None:
        notes.append(
            f"The samples show ripples of up to {order:.0f} periods per turn, where wheels turn slowly. A ripple of "
            "more periods can look like dead time; only faster samples would tell."
        )
    if prepared.loop is not None:
        fitted = (
            "Innovations of a noise model were fitted"
            if prepared.is_biased
            else "It tells little, and free runs were fitted"
        )
        notes.append(f"{prepared.loop.sentence}. {fitted}.")
    left_out = prepared.deadline.left_out
    if left_out:
        notes.append(f"The budget of {prepared.deadline.budget_s:g} s left out: {'; '.join(left_out)}.")
    if proof.evidence is not None and proof.evidence.kind == "fitted_only":
        unclaimed = "The best explanation is not claimed. " if found.kind == "unknown" else ""
        notes.append(f"{unclaimed}{proof.evidence.sentence}")
    if verdict.adequacy is not None and verdict.adequacy.sentence:
        notes.append(verdict.adequacy.sentence)
    return tuple(dict.fromkeys(notes))
