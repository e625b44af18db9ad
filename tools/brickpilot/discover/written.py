"""The stage that writes the augmented model and proves it: the last check, on the model as its file says.

Nothing is chosen after it. What the held-out runs do not confirm is not claimed, and what makes free runs of them worse
is not written.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from brickpilot.discover import gates, locate
from brickpilot.discover.compose import Composed
from brickpilot.discover.evidence import confirm
from brickpilot.discover.finding import Evidence, Gap, VerdictKind
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search_round import largest_prior_shift
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import Plan
from brickpilot.fit.replay import Outputs, Replay
from brickpilot.fit.spread import Spread
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model

_PATCHED = (
    "They do so only with nominal values that leave what is stated of them: a law is not quite right, and the other "
    "effects may only patch it."
)


@dataclass(frozen=True)
class Written:
    """The model that is written, and what was measured on it.

    Attributes:
        kind: the verdict that the evidence allows.
        plan: what of the model was fitted.
        model: as read back from its file, with the basis of each value.
        composed: the composed term that it holds; None: none.
        estimates: of all fitted parameters, by name.
        simulated: "nominal", "augmented" -> run -> outputs, over whole runs.
        gap: "fit", "held_out" -> gap. `by_signal` is over all runs.
        evidence: None if nothing was added to the nominal model and nothing was tried.
        notes: on how it was fitted, one sentence each.
        spread: how the fitted parameters may lie about their estimates, all together; None: nothing was fitted.
    """

    kind: VerdictKind
    plan: Plan
    model: Model
    composed: Composed | None
    estimates: Mapping[str, Estimate]
    simulated: Mapping[str, Mapping[str, Outputs]]
    gap: Mapping[str, Gap]
    by_signal: Mapping[str, Gap]
    evidence: Evidence | None
    notes: tuple[str, ...] = ()
    spread: Spread | None = None


def write(prepared: Prepared, verdict: Verdict, composed: Composed | None) -> Written:
    """Returns the first of these models that does not make free runs of the held-out runs worse.

    The model with the composed term, that with the effects of the verdict, and the calibrated nominal model.
    """
    tried: Evidence | None = None
    for kind, plan, model, term in _models(verdict, composed):
        written = _written(prepared, verdict, kind, plan, model, term)
        if plan is verdict.nominal.plan:
            break
        evidence, writable = confirm(
            prepared, verdict.nominal.model, written.model, written.simulated, written.gap["held_out"]
        )
        tried = tried or evidence
        if writable:
            if kind == "named" and _is_patched(prepared, verdict):
                evidence = dataclasses.replace(evidence, sentence=_PATCHED)
                return dataclasses.replace(written, kind="unknown", evidence=evidence)
            return dataclasses.replace(written, kind=_allowed(kind, evidence), evidence=evidence)
    return dataclasses.replace(written, kind=verdict.kind if tried is None else "unknown", evidence=tried)


def confirmed_again(prepared: Prepared, verdict: Verdict, before: Written, after: Written) -> Written | None:
    """Returns `after`, the same model with other values, with what proves it now; None if that is less than before."""
    if before.evidence is None or before.plan is verdict.nominal.plan:
        return after
    evidence, writable = confirm(prepared, verdict.nominal.model, after.model, after.simulated, after.gap["held_out"])
    if not writable or (before.evidence.kind, evidence.kind) == ("held_out", "fitted_only"):
        return None
    return dataclasses.replace(
        after, evidence=dataclasses.replace(evidence, kind=before.evidence.kind, sentence=before.evidence.sentence)
    )


def _allowed(kind: VerdictKind, evidence: Evidence) -> VerdictKind:
    """Returns the verdict that the evidence allows: a name needs proof, rivals need that nothing contradicts them."""
    if kind == "named":
        return "named" if evidence.kind == "held_out" else "unknown"
    return "unknown" if evidence.contradicted else kind


def _is_patched(prepared: Prepared, verdict: Verdict) -> bool:
    """Returns whether several effects explain the runs only with nominal values that leave what is stated of them.

    Where a law is not quite right, others beside it and moved nominal values take up what it leaves.
    """
    several = len(verdict.best.chosen) > 1
    return several and largest_prior_shift(prepared.fine, verdict.best) > gates.PRIOR_LEFT_SD


def _models(verdict: Verdict, composed: Composed | None) -> Iterator[tuple[VerdictKind, Plan, Model, Composed | None]]:
    """Yields the models that may be written, the one that explains most first, each with the verdict it stands for."""
    if composed is not None:
        yield "unknown", composed.plan, composed.model, composed
    if verdict.best.chosen:
        yield verdict.kind, verdict.best.plan, verdict.best.model, None
    yield "unknown", verdict.nominal.plan, verdict.nominal.model, None


def _written(
    prepared: Prepared, verdict: Verdict, kind: VerdictKind, plan: Plan, model: Model, composed: Composed | None
) -> Written:
    """Returns the model as read back from its file, without evidence."""
    known = assess(prepared.fine.with_plan(plan), model, plan.free) if plan.free else None
    estimates = {} if known is None else known.estimates
    basis = {key: f"fitted to {prepared.dataset.name}: {estimate.basis}" for key, estimate in estimates.items()}
    read = read_back(dataclasses.replace(model, basis=basis))
    outputs = Replay(prepared.dataset).simulate([verdict.nominal.model, read], threads=prepared.jobs)
    simulated = dict(zip(("nominal", "augmented"), outputs, strict=True))
    gap, by_signal = locate.gaps(prepared.dataset, simulated, prepared.roles, prepared.fine.sample_noise)
    return Written(
        kind,
        plan,
        read,
        composed,
        estimates,
        simulated,
        gap,
        by_signal,
        None,
        spread=None if known is None else known.spread,
    )


def read_back(model: Model) -> Model:
    """Returns the model as it is read back from its file: what is shown is simulated from what is written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        model_file.save(model, path)
        return model_file.load(path)
