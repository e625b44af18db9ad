"""The last fit: free runs over their whole length, with the signals as measured.

The search compares short windows and changes, because a wrong force moves a velocity for seconds and a position for
ever. What is written must also follow a whole run. So all free parameters are fitted again to whole runs, and effects
of the library join where the free run of the fit runs asks for them. They join the model that is written and are not
claimed: the verdict is that of the search.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.discover import gates, locate
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.deadline import COMPOSED
from brickpilot.discover.effect_source import EffectSource
from brickpilot.discover.fitting import FittedModel, rated, refine, unfitted
from brickpilot.discover.prepare import Prepared, part
from brickpilot.discover.search_round import try_candidates
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.written import Written, confirmed_again, read_back
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.headline import headline_of, simulated_at
from brickpilot.fit.horizons import track
from brickpilot.fit.parameters import Plan
from brickpilot.fit.replay import Outputs, Replay
from brickpilot.fit.start_state import with_averaged_starts
from brickpilot.fit.uncertainty import assess
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_ROUNDS = 2  # of weighing the signals by their residuals and fitting again
_KEPT = "A fit to whole runs did not make free runs better, so the fit of the search was kept."


@dataclass(frozen=True)
class _Followed:
    """Whole runs as measured, and their residual on the fit runs, on a coarse grid and at the samples."""

    dataset: Dataset
    coarse: BinnedOutputError
    fine: BinnedOutputError


def follow_whole_runs(prepared: Prepared, verdict: Verdict, written: Written) -> Written:
    """Returns `written` with its model fitted to free runs of whole runs, where that makes them better.

    All is fitted and ordered on the fit runs alone. The held-out runs only veto: a model is kept if it makes the free
    runs of the fit runs better and those of the held-out runs not worse; see `free_run_errors`. Where nothing is held
    out, nothing can veto an effect, so none joins.
    """
    if written.kind == "none" or not written.plan.free:
        return written
    try:
        data = _whole_runs(prepared, written.plan)
        stages = _extended(prepared, data, _fitted(data, written, verdict, prepared.jobs))
        found = _last_accepted(prepared, data, written.model, stages)
    except (InputError, SimulationError):
        found = None
    if found is None:
        return dataclasses.replace(written, notes=(*written.notes, _KEPT))
    known = assess(data.fine.with_plan(found.plan), found.model, found.plan.free)
    estimates = known.estimates
    name = prepared.dataset.name
    basis = {key: f"fitted to free runs of {name}: {estimate.basis}" for key, estimate in estimates.items()}
    model = read_back(dataclasses.replace(found.model, basis=basis))
    outputs = Replay(prepared.dataset).simulate([model], threads=prepared.jobs)[0]
    simulated = {**written.simulated, "augmented": outputs}
    gap, by_signal = locate.gaps(prepared.dataset, simulated, prepared.roles, prepared.fine.sample_noise)
    followed = dataclasses.replace(
        written,
        plan=found.plan,
        model=model,
        estimates=estimates,
        spread=known.spread,
        simulated=simulated,
        gap=gap,
        by_signal=by_signal,
        notes=(*written.notes, *_notes(prepared, written.model, model)),
    )
    return confirmed_again(prepared, verdict, written, followed) or dataclasses.replace(
        written, notes=(*written.notes, _KEPT)
    )


def free_run_errors(prepared: Prepared, outputs: Mapping[str, Outputs]) -> dict[str, dict[str, float]]:
    """Returns role -> signal -> rms of measured less simulated over the spread of the signal, at the samples.

    The spread is the rms about each run's mean. A signal that does not vary is left out.
    """
    found: dict[str, dict[str, float]] = {}
    for role, names in (("fit", prepared.roles.fit()), ("held_out", prepared.roles.tested())):
        sums: dict[str, Array] = {}
        for run in prepared.measured.runs:
            if run.name not in names:
                continue
            tested = prepared.roles.samples(run, role)
            for signal in sorted(tested.outputs.keys() & outputs[run.name].keys() - {"battery_voltage"}):
                measured = tested.outputs[signal]
                known = np.isfinite(measured)
                if known.any():
                    left = measured[known] - outputs[run.name][signal][known]
                    both = np.array([np.sum(left**2), np.sum((measured[known] - measured[known].mean()) ** 2)])
                    sums[signal] = sums.get(signal, np.zeros(2)) + both
        found[role] = {signal: float(np.sqrt(left / all_)) for signal, (left, all_) in sums.items() if all_ > 0}
    return found


def _whole_runs(prepared: Prepared, plan: Plan) -> _Followed:
    measured = prepared.measured
    dataset = dataclasses.replace(measured, nominal=prepared.dataset.nominal)
    dataset = with_averaged_starts(dataset, {run.name: motor_inputs(run, dataset) for run in dataset.runs})
    samples, runs = part(dataset, prepared.roles, "fit"), prepared.roles.fit()
    coarse, fine = (
        BinnedOutputError(dataset, plan, runs, coarse=grid, threads=prepared.jobs, samples=samples, as_measured=True)
        for grid in (True, False)
    )
    return _Followed(dataset, coarse, fine)


def _fitted(data: _Followed, written: Written, verdict: Verdict, jobs: int) -> FittedModel:
    """Returns the model that is written, fitted to whole runs from where it stands."""
    chosen = verdict.best.chosen if written.composed is None and written.plan is verdict.best.plan else ()
    plan = _loosened(data.dataset, written.plan, written.model)
    found = unfitted(chosen, plan, plan.start())
    for _ in range(_ROUNDS):
        data.coarse.with_plan(found.plan).weigh_by_residual(found.point)
        found = (refine(data.coarse, [found], jobs) or [found])[0]
    if not np.isfinite(found.cost):
        raise SimulationError("the plant diverges over whole runs")
    return found


def _loosened(dataset: Dataset, plan: Plan, model: Model) -> Plan:
    """Returns the plan from `model` on, in which a prior holds only where the data set states a value."""
    free = []
    for one in plan.free:
        stated = dataset.nominal_effects.get(one.effect[0], {}).get(one.effect[1]) if one.effect else one.known
        free.append(dataclasses.replace(one, known=stated))
    return Plan(model, tuple(free), plan.notes)


def _extended(prepared: Prepared, data: _Followed, found: FittedModel) -> list[FittedModel]:
    """Returns `found` and, after it, models with one more effect each that free runs of the fit runs ask for."""
    error, stages, deadline = data.coarse, [found], prepared.until(COMPOSED)
    effects = EffectSource(prepared.excitation)
    most = gates.MOST_FREE_RUN_EFFECTS if prepared.roles.tested() else 0
    while len(stages) <= most and not deadline.passed:
        error.with_plan(found.plan).weigh_by_residual(found.point)
        found = rated(error, found)
        tried = try_candidates(error, effects, found, prepared.jobs, deadline)
        if not tried or tried[0].penalised_cost > (1 - gates.FREE_RUN_GAIN_SHARE) * found.penalised_cost:
            break
        found = tried[0]
        stages.append(found)
    data.fine.adopt_scales(error)
    return stages


def _last_accepted(
    prepared: Prepared, data: _Followed, before: Model, stages: Sequence[FittedModel]
) -> FittedModel | None:
    """Returns the last of `stages` that is better than `before` and than every stage that was accepted before it.

    It is fitted at the measured samples; the values of the coarse grid stay where those at the samples are worse.
    Returns None if no stage is better.
    """
    best, now = None, _errors(prepared, data, [before])[0]
    for stage, errors in zip(stages, _errors(prepared, data, [one.model for one in stages]), strict=True):
        if _is_better(now, errors):
            best, now = stage, errors
    if best is None:
        return None
    finer = (refine(data.fine, [best], prepared.jobs) or [best])[0]
    return finer if _is_better(now, _errors(prepared, data, [finer.model])[0]) else best


def _errors(prepared: Prepared, data: _Followed, models: Sequence[Model]) -> list[dict[str, dict[str, float]]]:
    outputs = Replay(data.dataset).simulate(models, threads=prepared.jobs)
    return [free_run_errors(prepared, one) for one in outputs]


def _is_better(before: Mapping[str, Mapping[str, float]], after: Mapping[str, Mapping[str, float]]) -> bool:
    """Returns whether free runs get better on the fit runs, and not worse on the held-out ones."""
    changes = {role: _change(before[role], after[role]) for role in before}
    return changes["fit"] < 1 and changes["held_out"] <= 1


def _change(before: Mapping[str, float], after: Mapping[str, float]) -> float:
    """Returns how many times as large the error becomes, as the geometric mean over the signals."""
    ratios = [after[signal] / before[signal] for signal in before if before[signal] > 0 and after[signal] > 0]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0


def _notes(prepared: Prepared, before: Model, after: Model) -> list[str]:
    """Returns what the fit to whole runs changed, one sentence each."""
    compared = track(prepared.plain.measured, prepared.plain.started, after, {})
    numbers = [
        headline_of(compared, simulated_at(compared, model, threads=prepared.jobs), prepared.roles)
        for model in (before, after)
    ]
    fits = {signal: [one.of(signal, "fit").fit_percent for one in numbers] for signal in compared.signals}
    said = ", ".join(f"{signal} {a:.1f} to {b:.1f} %" for signal, (a, b) in fits.items() if None not in (a, b))
    notes = [f"The values are those of a fit to whole runs. The fit of the fit runs in free runs: {said}."]
    joined = [name for name in after.effects if name not in before.effects]
    if joined:
        words = ", ".join(catalogue.effect(name).words for name in joined)
        notes.append(f"The model also holds what free runs ask for and the search does not claim: {words}.")
    return notes
