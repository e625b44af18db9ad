"""The last stage: puts together the finding, from models as their files say and simulations of them."""

from __future__ import annotations

import dataclasses
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset
from brickpilot.discover import gates, locate, power
from brickpilot.discover.compose import Composed
from brickpilot.discover.finding import Experiment, Finding, NominalChange, Term, VerdictKind
from brickpilot.discover.named_effects import named_effects
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.ranking import ranking
from brickpilot.discover.search import Searched
from brickpilot.discover.terms import c_source
from brickpilot.discover.terms.basis import PLACES
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import Plan, value_of
from brickpilot.fit.replay import Outputs, Replay
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model, unit_on

Array = NDArray[np.float64]


def file_names(dataset: Dataset) -> set[str]:
    """Returns the names of all files that the command may write for a data set."""
    return {"report.html", "verdict.json", "model.toml", "compensation.toml", f"{_term_name(dataset)}.c"}


def conclude(
    prepared: Prepared,
    searched: Searched,
    verdict: Verdict,
    composed: Composed | None,
    experiment: Experiment | None,
) -> Finding:
    """Returns the finding. Its `elapsed_s` is 0; the pipeline knows the time."""
    kind: VerdictKind = verdict.kind if composed is None else "unknown"
    plan = verdict.best.plan if composed is None else composed.plan
    nominal_model = verdict.nominal.model
    model, estimates = _augmented(prepared, plan, verdict.best.model if composed is None else composed.model)
    simulated = _simulated(prepared, nominal_model, model)
    everything = prepared.all_runs(plan)
    before, after = everything.losses(nominal_model), everything.losses(model)
    noise_sd = prepared.fine.sample_noise
    by_role, by_signal = locate.gaps(prepared.dataset, simulated, prepared.roles, noise_sd)
    where = locate.places(everything, prepared.dataset, before, after, simulated["augmented"])
    return Finding(
        dataset=prepared.dataset,
        verdict=kind,
        effects=named_effects(verdict, kind, composed, estimates, model),
        where=where if kind != "none" else (),
        gap=by_role,
        by_signal=by_signal,
        nominal=_nominal_changes(prepared.plan, nominal_model if kind == "none" else model),
        next_experiment=experiment,
        ranking=ranking(verdict, searched),
        whiteness=locate.whiteness(prepared.fine, prepared.fine.residual_of(model)),
        power=power.smallest(prepared.coarse, verdict.best, prepared.excitation),
        term=None if composed is None else _term(composed, prepared, nominal_model, model),
        nominal_model=nominal_model,
        augmented=model,
        simulated=simulated,
        roles=prepared.roles.by_run,
        held_out_stretches=prepared.roles.stretches,
        faults=prepared.measured.faults,
        notes=_notes(prepared, verdict, kind),
        noise_sd=noise_sd,
        elapsed_s=0.0,
        seed=prepared.seed,
    )


def _augmented(prepared: Prepared, plan: Plan, model: Model) -> tuple[Model, Mapping[str, Estimate]]:
    """Returns the model as its written file says, with the basis of each value; and the estimates by name."""
    estimates = assess(prepared.fine.with_plan(plan), model, plan.free).estimates if plan.free else {}
    name = prepared.dataset.name
    basis = {key: f"fitted to {name}: {estimate.basis}" for key, estimate in estimates.items()}
    return _written(dataclasses.replace(model, basis=basis)), estimates


def _written(model: Model) -> Model:
    """Returns the model as it is read back from its file: what is shown is simulated from what is written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        model_file.save(model, path)
        return model_file.load(path)


def _simulated(prepared: Prepared, nominal: Model, augmented: Model) -> dict[str, dict[str, Outputs]]:
    """Returns "nominal", "augmented" -> run -> outputs, over whole runs."""
    outputs = Replay(prepared.dataset).simulate([nominal, augmented], threads=prepared.jobs)
    return dict(zip(("nominal", "augmented"), outputs, strict=True))


def _term_name(dataset: Dataset) -> str:
    """Returns the name of the composed term's C file, without its ending: a C identifier."""
    return "composed_for_" + ("_".join(re.findall("[a-z0-9]+", dataset.name.lower())) or "data")


def _term(composed: Composed, prepared: Prepared, nominal: Model, augmented: Model) -> Term:
    """Returns the composed term for the page and the files."""
    held_out, removed = prepared.held_out(), float("nan")
    if held_out is not None:
        noise = held_out.noise_cost()
        before, after = (float(held_out.losses(one).sum()) - noise for one in (nominal, augmented))
        removed = 1 - max(after, 0.0) / before if before > 0 else removed
    found, name = composed.terms, _term_name(prepared.dataset)
    source = c_source.render(found.terms, found.settings, name=name, vehicle=prepared.dataset.vehicle)
    equation = found.equation
    return Term(
        ", ".join(PLACES[place] for place in found.places),
        f"{equation.text}. {equation.legend}",
        f"{equation.mathml}<p>{equation.legend}</p>",
        f"{name}.c",
        source,
        removed,
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


def _notes(prepared: Prepared, verdict: Verdict, kind: VerdictKind) -> tuple[str, ...]:
    notes = [prepared.roles.note, *prepared.plan.notes, *prepared.measured.notes, *prepared.fine.notes]
    if kind in ("named", "ambiguous") and not verdict.adequate:
        notes.append(
            f"The residual is not noise alone: its cost is {verdict.best.cost / verdict.noise:.1f} times that of "
            "noise. No further effect and no composed term removes the rest."
        )
    if not verdict.best.chosen and not verdict.adequate:
        notes.append(
            f"The residual is not noise alone: its cost is {verdict.nominal.cost / verdict.noise:.1f} times that of "
            "noise. But no effect of the library removes enough of it to be believed."
        )
    return tuple(dict.fromkeys(notes))
