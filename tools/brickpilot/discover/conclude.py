"""The last stage: puts together the finding, from models as their files say and simulations of them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset
from brickpilot.discover import gates, locate, power
from brickpilot.discover.finding import (
    Experiment,
    Finding,
    NominalChange,
    NominalFinding,
    Place,
    Term,
    TermMatch,
    Visible,
)
from brickpilot.discover.harmonics import resolved_order
from brickpilot.discover.named_effects import mechanism, named_effects
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.ranking import ranking
from brickpilot.discover.sampling import sampling_note
from brickpilot.discover.search import Searched
from brickpilot.discover.terms import c_source
from brickpilot.discover.terms.basis import PLACES
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.written import Written
from brickpilot.discover.yardstick import Yardstick
from brickpilot.fit.parameters import Plan, value_of
from brickpilot.fit.replay import Replay
from brickpilot.vehicle.model import Model, unit_on

Array = NDArray[np.float64]


def file_names(dataset: Dataset) -> set[str]:
    """Returns the names of all files that the command may write for a data set."""
    return {"report.html", "verdict.json", "model.toml", "compensation.toml", f"{_term_name(dataset)}.c"}


def conclude(
    prepared: Prepared,
    searched: Searched,
    verdict: Verdict,
    written: Written,
    experiment: Experiment | None,
    yardstick: Yardstick,
) -> Finding:
    """Returns the finding. Its `elapsed_s` is 0; the pipeline knows the time."""
    nominal_model = verdict.nominal.model
    effects = named_effects(prepared, verdict, written)
    return Finding(
        dataset=prepared.dataset,
        verdict=written.kind,
        mechanism=mechanism(effects, written),
        law_differs=_law_differs(prepared, verdict, written),
        evidence=written.evidence,
        effects=effects,
        where=_places(prepared, written),
        yardstick=yardstick,
        gap=written.gap,
        by_signal=written.by_signal,
        nominal=_nominal_changes(prepared.plan, nominal_model if written.kind == "none" else written.model),
        nominal_findings=_nominal_findings(prepared, verdict),
        next_experiment=experiment,
        ranking=ranking(verdict, searched),
        whiteness=locate.whiteness(prepared.fine, prepared.fine.residual_of(written.model)),
        power=_power(prepared, verdict),
        term=_term(prepared.dataset, written),
        nominal_model=nominal_model,
        augmented=written.model,
        simulated=written.simulated,
        roles=prepared.roles.by_run,
        held_out_stretches=prepared.roles.stretches,
        faults=prepared.measured.faults,
        notes=(*_notes(prepared, verdict, written), *yardstick.notes),
        spread=written.spread,
        noise_sd=prepared.fine.sample_noise,
        elapsed_s=0.0,
        seed=prepared.seed,
    )


def _law_differs(prepared: Prepared, verdict: Verdict, written: Written) -> bool | None:
    """Returns whether the claimed effects leave more than noise, on the fit runs or on held-out runs."""
    if written.kind not in ("named", "ambiguous"):
        return None
    held_out = prepared.held_out()
    if not verdict.adequate or held_out is None:
        return not verdict.adequate
    return bool(held_out.losses(verdict.best.model).sum() > gates.ADEQUATE * held_out.noise_cost())


def _power(prepared: Prepared, verdict: Verdict) -> Mapping[str, Visible]:
    """Returns the smallest size of each effect that would show; nothing if there is no time left."""
    if not prepared.deadline.allows("the smallest size of each effect that would show"):
        return {}
    return power.smallest(prepared.coarse, verdict.best, prepared.excitation)


def _places(prepared: Prepared, written: Written) -> tuple[Place, ...]:
    """Returns where what was added to the model shows; where nothing was, where the nominal model leaves an error."""
    dataset, noise_sd = prepared.dataset, prepared.fine.sample_noise
    if written.kind == "none":
        return ()
    motion = written.simulated["augmented"]
    known = prepared.plan.model.effects
    effects = {name: table for name, table in written.model.effects.items() if name in known}
    if len(effects) == len(written.model.effects):
        measured = {run.name: run.outputs for run in dataset.runs}
        return locate.places(dataset, measured, motion, motion, noise_sd, gates.ERROR_SHOWN)
    without = dataclasses.replace(written.model, effects=effects)
    plain = Replay(dataset).simulate([without], threads=prepared.jobs)[0]
    return locate.places(dataset, motion, plain, motion, noise_sd, gates.EFFECT_SHOWN)


def _term_name(dataset: Dataset) -> str:
    """Returns the name of the composed term's C file, without its ending: a C identifier."""
    return "composed_for_" + ("_".join(re.findall("[a-z0-9]+", dataset.name.lower())) or "data")


def _term(dataset: Dataset, written: Written) -> Term | None:
    """Returns the composed term for the page and the files; None if the model holds none."""
    if written.composed is None:
        return None
    found, name = written.composed.terms, _term_name(dataset)
    source = c_source.render(found.terms, found.settings, name=name, vehicle=dataset.vehicle)
    equation = found.equation
    return Term(
        ", ".join(PLACES[place] for place in found.places),
        f"{equation.text}. {equation.legend}",
        f"{equation.mathml}<p>{equation.legend}</p>",
        f"{name}.c",
        source,
        written.evidence.removed_held_out if written.evidence is not None else None,
        tuple(
            TermMatch(one.effect, one.law, one.mechanism, one.correlation, one.is_equal)
            for one in written.composed.matches
        ),
    )


def _nominal_changes(plan: Plan, model: Model) -> dict[str, NominalChange]:
    """Returns what became of each nominal value that was stated and fitted."""
    changes = {}
    for free in plan.free:
        if free.effect is not None or free.known is None:
            continue
        value, sd = value_of(model, free.name), free.known.sd
        shift = abs(value - free.known.value) / sd if sd else 0.0
        changes[free.name] = NominalChange(
            free.known.value, value, unit_on(model, free.info), sd, shift > gates.PRIOR_LEFT_SD
        )
    return changes


def _nominal_findings(prepared: Prepared, verdict: Verdict) -> tuple[NominalFinding, ...]:
    """Returns the nominal values that the calibrated model had to move beyond what is stated of them.

    Where an effect was added that leaves them as stated, they are no finding.
    """
    explained = verdict.best if verdict.kind == "named" else verdict.nominal
    rivals = tuple(" + ".join(one.names) for one in verdict.nominal_rivals)
    return tuple(
        NominalFinding(name, one.before, one.after, one.unit, abs(one.after - one.before) / one.sd, rivals)
        for name, one in _nominal_changes(prepared.plan, explained.model).items()
        if one.leaves_prior and one.sd
    )


def _notes(prepared: Prepared, verdict: Verdict, written: Written) -> tuple[str, ...]:
    notes = [prepared.roles.note, *prepared.plan.notes, *prepared.measured.notes, *prepared.fine.notes, *written.notes]
    if (sampled := sampling_note(prepared, verdict.best)) is not None:
        notes.append(sampled)
    timed = any(one.mechanism == "timing" for one in catalogue.effects_of(verdict.best.names))
    if timed and (order := resolved_order(prepared.measured)) is not None:
        notes.append(
            f"The samples show ripples of up to {order:.0f} periods per turn, where wheels turn slowly. A ripple of "
            "more periods can look like dead time; only faster samples would tell."
        )
    left_out = prepared.deadline.left_out
    if left_out:
        notes.append(f"The budget of {prepared.deadline.budget_s:g} s left out: {'; '.join(left_out)}.")
    if written.evidence is not None and written.evidence.kind == "fitted_only":
        notes.append(f"The best explanation is not claimed. {written.evidence.sentence}")
    if written.kind in ("named", "ambiguous") and not verdict.adequate and not left_out:
        notes.append(
            f"The residual is not noise alone: its cost is {verdict.best.cost / verdict.noise:.1f} times that of "
            "noise. No further effect and no composed term removes the rest."
        )
    if not verdict.best.chosen and not verdict.adequate and not left_out:
        notes.append(
            f"The residual is not noise alone: its cost is {verdict.nominal.cost / verdict.noise:.1f} times that of "
            "noise. But no effect of the library removes enough of it to be believed."
        )
    return tuple(dict.fromkeys(notes))
