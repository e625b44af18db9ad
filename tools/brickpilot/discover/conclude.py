"""The last stage: makes the finding from the models as read back from their files, and from their simulations."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from scipy.signal import correlate

from brickpilot import catalogue
from brickpilot.data import gap
from brickpilot.data.dataset import Dataset
from brickpilot.data.periods import resolved_order
from brickpilot.discover import evidence, finding, numbers
from brickpilot.discover.compose import Composed
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.experiment import smallest_sizes
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import Experiment, Finding, Parameter, Predictor, VerdictKind
from brickpilot.discover.parts import Part, RunPart
from brickpilot.discover.prepare import Prepared, disturbances
from brickpilot.discover.seal import Proof
from brickpilot.discover.settle import Settled
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.yardstick import Yardstick
from brickpilot.fit.parameters import Plan, value_of
from brickpilot.fit.residual import Residual
from brickpilot.fit.uncertainty import Estimate
from brickpilot.vehicle.composed_terms import PLACES, equation, legend
from brickpilot.vehicle.model import Model, unit_on
from brickpilot.vehicle.replay import RUN_KINDS, Replay

_EFFECT_SHOWN = 1.0  # limit, in noise sd: an effect shows where it moves a signal by more, as an rms over 0.1 s
_LAGS = 20  # longest lag of an autocorrelation, bins
_BEYOND = 4  # a residual is white if its autocorrelation exceeds the bound at this many lags or fewer
_LARGEST_LOG = 700.0  # largest logarithm of a double
_ERROR_SHOWN = 1.5  # like `_EFFECT_SHOWN`, for an unexplained error, which contains noise; noise alone gives 1


@dataclasses.dataclass(frozen=True)
class Conclusion:
    """The results of all stages, from which `conclude` makes the finding.

    Attributes:
        steps: the stages that set or changed the verdict.
        best: the best explanation after its last fit, whether the verdict claims it or not.
        written: the model that is written to model.toml.
        nominal: the calibrated nominal model after its last fit.
    """

    steps: tuple[finding.Step, ...]
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

    @property
    def kind(self) -> VerdictKind:
        """The verdict after the seal was opened."""
        return self.steps[-1].verdict

    @property
    def claims(self) -> bool:
        """Whether the verdict claims the effects of the best explanation."""
        return self.kind in ("named", "ambiguous")

    @cached_property
    def totals(self) -> Mapping[frozenset[str], float]:
        """The evidence of each explanation that was weighed, by its key."""
        return {evidence.explanation.key: evidence.total for evidence in self.verdict.ranked}

    def removed(self, explanation: Explanation) -> float:
        """Returns an explanation's evidence on a scale from 0 (the nominal model) to 1 (a residual of noise alone)."""
        nothing = self.totals[self.verdict.nominal.key]
        way, gone = self.judge.top - nothing, self.totals.get(explanation.key, nothing) - nothing
        return float(np.clip(gone / way, 0.0, 1.0)) if way > 0 else 0.0


def conclude(prepared: Prepared, found: Conclusion) -> Finding:
    """Returns the finding. Its `elapsed_s` is 0; the pipeline sets it."""
    verdict, proof, model = found.verdict, found.proof, found.written.model
    effects, adequacy = _effects(found), verdict.adequacy
    mechanism = None if found.kind == "none" or found.composed is None else found.composed.mechanism
    if effects and (found.claims or found.composed is None):
        mechanism = effects[0].mechanism
    left = adequacy is not None and adequacy.leaves_more_than_noise
    beside = verdict.best if found.claims else verdict.nominal
    may_ask = prepared.deadline.allows("the smallest size of each effect that would show")
    power = smallest_sizes(prepared, found.judge, verdict.nominal, beside) if may_ask else {}
    return Finding(
        dataset=proof.opened.whole,
        verdict=found.kind,
        mechanism=mechanism,
        law_differs=left if found.claims else None,
        evidence=proof.evidence,
        effects=effects,
        explanations=tuple(
            finding.Share(one.explanation.names, round(one.weight, 4), _mechanisms(one.explanation))
            for one in verdict.held
        ),
        steps=found.steps,
        where=_places(prepared, found),
        yardstick=found.yardstick,
        gap=proof.gap,
        by_signal=proof.by_signal,
        nominal=_nominal_changes(prepared.plan, model),
        nominal_findings=_nominal_findings(prepared, found),
        next_experiment=found.experiment,
        ranking=tuple(_rank(one, found) for one in verdict.ranked),
        whiteness=_whiteness(prepared.fine, model),
        power=power,
        term=_term(prepared.dataset, found),
        nominal_model=found.nominal.model,
        augmented=model,
        simulated=proof.simulated,
        roles=prepared.roles.by_run,
        held_out_stretches=prepared.roles.stretches,
        faults=proof.opened.plain.measured.faults,
        notes=_notes(prepared, found),
        spread=found.written.spread,
        noise_sd=prepared.fine.sample_noise,
        run_values=_run_values(found.best),
        predictor=found.predictor,
        closed_loop=prepared.loop,
        disturbances=disturbances(prepared, found.best.model),
        predictable_left=None if adequacy is None else adequacy.predictable,
        elapsed_s=0.0,
        seed=prepared.seed,
    )


def _whiteness(data: Residual, model: Model) -> dict[str, finding.Whiteness]:
    """Returns signal -> the autocorrelation of a model's residual, and whether it is white."""
    left, found = data.scaled(model), {}
    for signal in data.signals:
        parts = [part - part.mean() for part in data.parts(left, signal) if len(part) > 2 * _LAGS]
        if parts:
            products = np.sum([correlate(one, one)[len(one) - 1 : len(one) + _LAGS] for one in parts], axis=0)
            lags = tuple((products[1:] / (products[0] or 1.0)).tolist())
            bound = 1.96 / math.sqrt(sum(map(len, parts)))
            white = sum(abs(one) > bound for one in lags) <= _BEYOND
            found[signal] = finding.Whiteness(numbers.BIN_S, lags, bound, white)
    return found


def _mechanisms(explanation: Explanation) -> tuple[str, ...]:
    """Returns the mechanisms of the parts, each once. An effect's mechanism depends on its fitted values."""
    tables = explanation.model.effects
    found = (
        catalogue.mechanism(part.effect, tables[part.effect]) if type(part) is Part else part.mechanism
        for part in explanation.parts
    )
    return tuple(dict.fromkeys(found))


def _effects(found: Conclusion) -> tuple[finding.Effect, ...]:
    """Returns the effects of the best explanation, the effect with most weight first.

    Effects are claimed if the verdict is `named` or `ambiguous`, or if a composed term stands beside them in the model.
    """
    beside = found.composed is not None and bool(found.written.explanation.effects)
    best = found.written if beside else found.best
    if found.kind == "none":
        return ()
    equivalents = _equivalents(found) if found.verdict.kind == "ambiguous" else ()
    weights, removed = _shares(found), found.removed(found.best.explanation)
    parts = sorted(best.explanation.effects, key=lambda one: -weights.get(one.name, 0.0))
    return tuple(
        finding.Effect(
            name=part.effect,
            mechanism=catalogue.mechanism(part.effect, best.model.effects[part.effect]),
            law=catalogue.law(part.effect, best.model.effects[part.effect]),
            acts_on=catalogue.effect(part.effect).acts_on,
            confidence=round(weights.get(part.name, 0.0), 4),
            parameters={name: _parameter(best.model, part.effect, name, best.estimates) for name in part.free},
            removed=removed,
            claimed=found.claims or beside,
            equivalents=equivalents if part is parts[0] else (),
        )
        for part in parts
    )


def _shares(found: Conclusion) -> dict[str, float]:
    """Returns a part's name -> the share of the weight of `verdict.held` that explanations with this part hold."""
    held = {one.explanation.key: one.weight for one in found.verdict.held}
    table = [one for one in found.verdict.ranked if one.explanation.key in held]
    weights = np.array([held[one.explanation.key] for one in table])
    return evidence.held_by(table, weights / weights.sum())


def _equivalents(found: Conclusion) -> tuple[finding.Equivalent, ...]:
    made, best = [], found.totals[found.verdict.best.key]
    for rival in found.verdict.rivals:
        model, several = rival.model, len(rival.parts) > 1
        values = {
            f"{part.effect}.{name}" if several else name: _parameter(model, part.effect, name, {})
            for part in rival.effects
            for name in part.free
        }
        effects = {name: dict(table) for name, table in model.effects.items()}
        worse_by = (best - found.totals[rival.key]) / found.verdict.temperature
        name = " + ".join(rival.names) or finding.NOMINAL_VALUES
        made.append(finding.Equivalent(name, values, worse_by, dict(model.parameters), effects))
    return tuple(made)


def _parameter(model: Model, effect: str, name: str, estimates: Mapping[str, Estimate]) -> Parameter:
    """Returns a parameter of an effect, with its interval if known; `identified` gets the sign of the value."""
    known = estimates.get(f"{effect}.{name}")
    unit = unit_on(model, next(row for row in catalogue.effect(effect).parameters if row.name == name))
    if known is None:
        return Parameter(value_of(model, f"{effect}.{name}"), unit, None)
    form = known.identified
    if form is not None and known.value < 0:
        form = dataclasses.replace(form, value=-form.value, ci95=(-form.ci95[1], -form.ci95[0]))
    return Parameter(known.value, unit, known.ci95, form)


def _run_values(best: Settled) -> tuple[finding.RunValues, ...]:
    """Returns the values that differ from run to run, for each kind of such values in the best explanation."""
    made = []
    for part in best.explanation.parts:
        if isinstance(part, RunPart):
            kind = RUN_KINDS[part.effect]
            known = {run: best.estimates[f"{part.effect}@{run}"] for run in part.free}
            values = {run: (one.value, one.ci95 or (math.nan, math.nan)) for run, one in known.items()}
            made.append(finding.RunValues(part.effect, kind.words, kind.unit, values))
    return tuple(made)


def _rank(one: Evidence, found: Conclusion) -> finding.Rank:
    """Returns the rank of a refined explanation, with a sentence on why it was chosen or not."""
    explanation, verdict, temperature = one.explanation, found.verdict, found.verdict.temperature
    best = next((other for other in verdict.ranked if other.explanation.key == verdict.best.key), verdict.ranked[0])
    names = [free.name for free in explanation.plan.free if any(part.owns(free) for part in explanation.parts)]
    worse, rarer = (best.total - one.total) / temperature, best.log_prior(temperature) - one.log_prior(temperature)
    held = sum(other.weight for other in verdict.held if other.explanation.key == explanation.key)
    why = f"It holds {100 * held:.0f} % of the weight."
    if any(explanation.key <= key for key in verdict.refuted):
        why = "It leaves too much to be an answer."
    elif one is not best:
        predicts = f"predicts {'worse' if worse > 0 else 'better'} by {abs(worse):.1f}"
        was = f"was {'less' if rarer > 0 else 'more'} likely beforehand by {abs(rarer):.1f}"
        why = f"{why} Beside the best it {predicts}, and {was}; {numbers.CHANCE_NATS:.0f} is sure."
    left = max(found.judge.top - one.total, 0.0) / len(found.judge.data.measured)
    values = {name: value_of(explanation.model, name) for name in names}
    error = math.exp(min(left, _LARGEST_LOG))
    return finding.Rank(explanation.names, values, error, found.removed(explanation), why)


def _places(prepared: Prepared, found: Conclusion) -> tuple[gap.Place, ...]:
    """Returns the places where the added effects show, or where the nominal model errs if no effect was added."""
    dataset, noise_sd, proof = found.proof.opened.whole, prepared.fine.sample_noise, found.proof
    if found.kind == "none":
        return ()
    motion, model = proof.simulated["augmented"], found.written.model
    known = prepared.plan.model.effects
    effects = {name: table for name, table in model.effects.items() if name in known}
    if len(effects) == len(model.effects):
        measured = {run.name: run.outputs for run in dataset.runs}
        return gap.places(dataset, measured, motion, motion, noise_sd, _ERROR_SHOWN)
    plain = Replay(dataset).simulate([dataclasses.replace(model, effects=effects)], threads=prepared.jobs)[0]
    return gap.places(dataset, motion, plain, motion, noise_sd, _EFFECT_SHOWN)


def composed_file(dataset: Dataset) -> str:
    """Returns the name of the composed term's C file; without its extension it is a C identifier."""
    return f"composed_for_{'_'.join(re.findall('[a-z0-9]+', dataset.name.lower())) or 'data'}.c"


def _term(dataset: Dataset, found: Conclusion) -> finding.Term | None:
    """Returns the composed term for the report and the files; None if no term was composed."""
    composed, proved = found.composed, found.proof.evidence
    if composed is None:
        return None
    return finding.Term(
        acts_on=", ".join(dict.fromkeys(PLACES[term.basis.place] for term in composed.terms)),
        equation=". ".join(write(composed.terms, composed.settings) for write in (equation, legend)),
        source=composed_file(dataset),
        law=composed.terms,
        settings=composed.settings,
        removed_held_out=None if proved is None else proved.removed_held_out,
    )


def _nominal_changes(plan: Plan, model: Model) -> dict[str, finding.NominalChange]:
    """Returns the change of each nominal value that was both stated and fitted."""
    fitted = [free for free in plan.free if free.effect is None and free.known is not None]
    changes = {}
    for free in fitted:
        assert free.known is not None
        value, sd = value_of(model, free.name), free.known.sd
        away = abs(value - free.known.value) / sd if sd else 0.0
        left = numbers.leaves_prior(away, len(fitted))
        changes[free.name] = finding.NominalChange(free.known.value, value, unit_on(model, free.info), sd, left)
    return changes


def _nominal_findings(prepared: Prepared, found: Conclusion) -> tuple[finding.NominalFinding, ...]:
    """Returns the identifiable nominal values whose fit is further from the stated value than chance explains.

    If a fit with the claimed effects keeps a value as stated, the value is no finding: a fit without these effects
    changed it only to imitate them. A value is also no finding if the data determine only its combination with other
    values: the data do not tell which of these is wrong.
    """
    verdict = found.verdict
    is_rival = verdict.nominal in verdict.rivals  # then either an effect is missing or a value is stated wrongly
    settled = found.written if found.claims and not is_rival else found.nominal
    others = verdict.rivals if found.kind == "none" else (verdict.best,) if is_rival else ()
    told, rivals = settled.estimates, tuple(" + ".join(one.names) for one in others)
    return tuple(
        finding.NominalFinding(name, one.before, one.after, one.unit, abs(one.after - one.before) / one.sd, rivals)
        for name, one in _nominal_changes(prepared.plan, settled.model).items()
        if one.leaves_prior and one.sd and name in told and told[name].identifiable
    )


def _notes(prepared: Prepared, found: Conclusion) -> tuple[str, ...]:
    """Returns sentences on what was assumed, left out or not proved, each once."""
    proof, verdict, left_out = found.proof, found.verdict, prepared.deadline.left_out
    notes = [prepared.roles.note, *prepared.plan.notes, *proof.opened.plain.measured.notes, *prepared.fine.notes]
    notes += found.written.notes
    timed = any("timing" in _mechanisms(one) for one in (verdict.best, *verdict.rivals))
    if timed and (order := resolved_order(prepared.dataset)) is not None:
        notes.append(
            f"The samples show ripples of up to {order:.0f} periods per turn, where wheels turn slowly. A ripple of "
            "more periods can look like dead time; only faster samples would tell."
        )
    if prepared.loop is not None:
        plain = "It has none here, or the loop tells little: free runs were fitted"
        fitted = "Innovations of a noise model were fitted" if prepared.innovations else plain
        notes.append(f"{prepared.loop.sentence}. {fitted}.")
    if left_out:
        notes.append(f"The budget of {prepared.deadline.budget_s:g} s left out: {'; '.join(left_out)}.")
    if proof.evidence is not None and proof.evidence.kind == "fitted_only":
        unclaimed = "The best explanation is not claimed. " if found.kind == "unknown" else ""
        notes.append(f"{unclaimed}{proof.evidence.sentence}")
    if verdict.adequacy is not None and verdict.adequacy.sentence:
        notes.append(verdict.adequacy.sentence)
    return tuple(dict.fromkeys([*notes, *found.yardstick.notes]))
