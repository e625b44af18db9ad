"""`brickpilot discover`: from a data set to a finding. Each stage is a module beside this one."""

from __future__ import annotations

import dataclasses
import re
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data import holdout
from brickpilot.data.audit import against_model
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, Nominal, motor_inputs
from brickpilot.discover import harmonics, locate, power
from brickpilot.discover.band import Band, angles_of, loosened, run_of, settled, windowed, with_rates
from brickpilot.discover.candidates import Seen
from brickpilot.discover.composition import Composition, composed, term_of
from brickpilot.discover.experiment import next_experiment
from brickpilot.discover.finding import (
    Effect,
    Equivalent,
    Experiment,
    Finding,
    NominalChange,
    Parameter,
    Rank,
    Term,
    Verdict,
)
from brickpilot.discover.select import Fitted, Selection, fit, select
from brickpilot.discover.verdict import Judged, judge
from brickpilot.errors import InputError
from brickpilot.fit import parameters
from brickpilot.fit.descent import Counter, Progress, search
from brickpilot.fit.parameters import Plan, value_of
from brickpilot.fit.replay import Replay
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.model import Model, unit_on

Array = NDArray[np.float64]

_STAGES = 9
_STRETCH_S = 0.6  # in which a wheel turns once or twice
_SEARCHED = 80  # stretches, at most, that a search looks at
_WINDOW_S = 1.0  # of a motor
_LEFT_PRIOR_SD = 3.0
# Of the cost above that of noise: what stretches must explain, how much more so, and where no term is looked for.
_MOSTLY, _CLEARLY, _NEARLY = 0.7, 0.1, 0.9
_ROUGH, _FINE = 1e-4, 1e-5


@dataclass(frozen=True)
class _Data:
    """What every stage works on.

    Attributes:
        dataset: made ready for fits.
        judged: what is fitted and compared: the runs, or a motor's in stretches, as its measured state is known.
        coarse, fine: over the fit runs.
    """

    measured: Dataset
    dataset: Dataset
    judged: Dataset
    roles: holdout.Roles
    plan: Plan
    coarse: Band
    fine: Band
    seen: Seen
    jobs: int


def files(dataset: Dataset) -> set[str]:
    """The names of all files that the command may write for a data set."""
    return {"report.html", "verdict.json", "model.toml", "compensation.toml", f"{_source_name(dataset)}.c"}


def _source_name(dataset: Dataset) -> str:
    """Of a composed term: a C identifier."""
    return "composed_for_" + ("_".join(re.findall("[a-z0-9]+", dataset.name.lower())) or "data")


def discover(
    dataset: Dataset,
    model: Model | None = None,
    *,
    seed: int = 0,
    jobs: int = 2,
    progress: Progress | None = None,
) -> Finding:
    """Finds what the simulator of `dataset` lacks.

    Args:
        model: start from this model and the effects that it holds, instead of from the data set's nominal values.
        seed: of the random starts, where nominal values are not given.
        jobs: fits at the same time.
        progress: called with (done, total, text).

    Raises:
        InputError: nothing measured that the model gives, or every run is held out.
        SimulationError: the plant diverges with the nominal values.
    """
    began = time.perf_counter()
    count = Counter(progress, _STAGES)
    data = _prepared(dataset, model, jobs)  # what is refused is refused before anything is told
    count("reading what was measured")
    count("calibrating the nominal model")
    selection, judged = _looked(data, seed, count)
    # Where the first look found what repeats, and was broken off for it, it is not to be beaten.
    least = _MOSTLY if selection.best.repeats else max(_MOSTLY, _removed(judged) + _CLEARLY)
    if not judged.adequate and least < 1 and (closer := _in_stretches(data)) is not None:
        count("looking again, from the measured state every so often")
        again = _looked(closer, seed, count)
        if _removed(again[1]) > least:
            data, (selection, judged) = closer, again
    term = None
    left_by_starts = data.seen.closely and _removed(judged) > _NEARLY  # as they are measured, with noise
    if not judged.adequate and not left_by_starts:
        count("composing a term for what is left")
        term = _convincing(data, judged, composed(data.coarse, data.fine, judged, count))
    count("intervals and what to do next")
    return _finding(data, selection, judged, term, seed, began)


def _prepared(dataset: Dataset, model: Model | None, jobs: int) -> _Data:
    based = dataset if model is None else _starting_from(dataset, model)
    wrong = _contradictions(based)
    dataset, based = against_model.leave_out(dataset, wrong), loosened(against_model.leave_out(based, wrong))
    inputs = {run.name: motor_inputs(run, based) for run in based.runs}
    roles = holdout.assign(based, inputs)
    if not roles.fit():
        raise InputError("every run is held out: there is none to fit", file=dataset.path, field="runs.role")
    ready = settled(with_rates(based) if based.vehicle == "motor" else based, inputs)
    plan = parameters.plan(ready)
    judged = windowed(ready, inputs, _WINDOW_S) if ready.vehicle == "motor" else None
    judged = judged or ready
    fitted = _played(judged, roles, "fit")
    coarse = Band(judged, plan, fitted, coarse=True, threads=jobs)
    fine = Band(judged, plan, fitted, threads=jobs)
    largest = {"voltage": max(float(np.nanmax(np.abs(values), initial=0.0)) for values in inputs.values())}
    for name in dict.fromkeys(name for run in ready.runs for name in run.outputs):
        values = [run.outputs[name] for run in ready.runs if name in run.outputs]
        largest[name] = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in values)
    wheels = all(angles_of(run) is not None for run in ready.runs)
    return _Data(
        dataset,
        ready,
        judged,
        roles,
        plan,
        coarse,
        fine,
        Seen(largest, harmonics.orders(based), _least_order(based), wheels=wheels, closely=judged is not ready),
        jobs,
    )


def _contradictions(dataset: Dataset) -> tuple[Fault, ...]:
    """Channels that no machine can have measured, for all that its stated values say: a fault, not an effect."""
    stated = parameters.plan(dataset)
    simulated = Replay(dataset).simulate([stated.at(stated.start())])[0]
    return against_model.contradictions(dataset, simulated)


def _least_order(dataset: Dataset) -> float:
    """See `Seen`: of a drive that commands a force the order is in rad/m, over the way it goes."""
    way = [
        np.ptp(run.outputs["position"][np.isfinite(run.outputs["position"])])
        for run in dataset.runs
        if "position" in run.outputs
    ]
    if "force_per_volt" not in dataset.nominal or not way:
        return 0.9
    return 3 * np.pi / max(float(max(way)), 1e-9)


def _played(judged: Dataset, roles: holdout.Roles, role: str) -> list[str]:
    """The names of the runs, or stretches of runs, that have a role."""
    return [run.name for run in judged.runs if roles.by_run[run_of(run.name)] == role]


def _looked(data: _Data, seed: int, count: Counter) -> tuple[Selection, Judged]:
    nominal = _calibrated(data, seed)
    selection = select(data.coarse, nominal, seen=data.seen, jobs=data.jobs, tell=count)
    count("judging at the measured samples")
    data.fine.adopt_floors(data.coarse)
    return selection, judge(data.fine, selection, data.jobs, _unseen(data))


def _removed(judged: Judged) -> float:
    """Share of the cost above that of noise that the best explanation takes away."""
    return (judged.nominal.cost - judged.best.cost) / max(judged.nominal.cost - judged.noise, 1e-9)


def _unseen(data: _Data) -> Band | None:
    """The held-out runs, weighed as the fitted ones are."""
    if not data.roles.held_out():
        return None
    band = Band(data.judged, data.plan, _played(data.judged, data.roles, "held_out"), threads=data.jobs)
    band.adopt_floors(data.fine)
    return band


def _in_stretches(data: _Data) -> _Data | None:
    """The data cut into short stretches; None where they are judged so already, or no wheel was measured.

    What hangs on a wheel's angle, or on which side of its play it is, drives two simulations apart for good that differ
    a little: over whole runs no size of it fits. From the measured state, for a turn or two, it does.
    """
    if data.judged is not data.dataset:
        return None
    ready = data.dataset
    cut = windowed(ready, {run.name: motor_inputs(run, ready) for run in ready.runs}, _STRETCH_S)
    if cut is None:
        return None
    fitted = _played(cut, data.roles, "fit")
    some = fitted[:: -(-len(fitted) // _SEARCHED)]
    coarse = Band(cut, data.plan, some, coarse=True, threads=data.jobs)
    fine = Band(cut, data.plan, fitted, threads=data.jobs)
    seen = dataclasses.replace(data.seen, closely=True)
    return dataclasses.replace(data, judged=cut, coarse=coarse, fine=fine, seen=seen)


def _starting_from(dataset: Dataset, model: Model) -> Dataset:
    """`dataset` with the values and the effects of `model` for what is known; stated sds stay.

    Raises:
        InputError: the model is of another vehicle.
    """
    if model.vehicle != dataset.vehicle:
        raise InputError(
            f"is of a {model.vehicle}, the data set of a {dataset.vehicle}", file=model.name, field="vehicle"
        )
    nominal = {
        name: Nominal(value, dataset.nominal[name].sd if name in dataset.nominal else None)
        for name, value in model.parameters.items()
        if name in dataset.nominal or value != catalogue.presets(model.vehicle)[name]
    }
    effects = {
        effect: {name: Nominal(value, abs(value) * 0.1 or None) for name, value in table.items()}
        for effect, table in model.effects.items()
    }
    return dataclasses.replace(dataset, nominal=nominal, nominal_effects={**dataset.nominal_effects, **effects})


def _calibrated(data: _Data, seed: int) -> Fitted:
    """The nominal model fitted, from several starts where nothing is known of some value."""
    start = data.plan.start()
    if any(one.known is None for one in data.plan.free):
        start, _ = search(data.coarse, np.random.default_rng(seed), Counter(None, 1))
    found = fit(data.coarse, (), data.plan, start, _ROUGH)
    if found is None:
        raise InputError(
            "the plant diverges with these values: are units and nominal values right?",
            file=data.measured.path,
            field="nominal",
        )
    data.coarse.raise_floors(found.point)
    return fit(data.coarse, (), data.plan, found.point, _FINE) or found


def _finding(
    data: _Data, selection: Selection, judged: Judged, term: Composition | None, seed: int, began: float
) -> Finding:
    nominal_model = judged.nominal.model
    best, verdict = judged.best, judged.verdict
    model, plan = best.model, best.plan
    if term is not None:
        verdict, model, plan = "unknown", term.model, term.plan
    final = data.fine.with_plan(plan)
    estimates = assess(final, model, plan.free).estimates if plan.free else {}
    model = dataclasses.replace(
        model,
        basis={name: f"fitted to {data.dataset.name}: {estimate.basis}" for name, estimate in estimates.items()},
    )
    everything = Band(data.judged, plan, [run.name for run in data.judged.runs], threads=data.jobs)
    everything.adopt_floors(data.fine)
    model = _written(model)
    replay = Replay(data.dataset)
    outputs = dict(
        zip(("nominal", "augmented"), replay.simulate([nominal_model, model], threads=data.jobs), strict=True)
    )
    before, after = (everything.losses(one) for one in (nominal_model, model))
    by_role, by_signal = locate.gaps(data.dataset, outputs, data.roles.by_run, data.fine.sample_noise)
    named = () if verdict == "unknown" and term is not None and term.alone else best.chosen
    effects = _effects(judged, named, estimates, model) if verdict != "none" else ()
    effects = tuple(one for one in effects if verdict != "unknown" or _apart_from_zero(one))
    return Finding(
        dataset=data.dataset,
        verdict=verdict,
        effects=effects,
        where=locate.places(everything, data.dataset, before, after, outputs["augmented"]) if verdict != "none" else (),
        gap=by_role,
        by_signal=by_signal,
        nominal=_nominal_changes(data.plan, nominal_model if verdict == "none" else model),
        next_experiment=_experiment(data, judged) if verdict == "ambiguous" else None,
        ranking=_ranking(judged, selection),
        whiteness=locate.whiteness(data.fine, data.fine.left(model)),
        power=power.smallest(data.coarse, best, data.seen),
        term=None if term is None else _term(term, data, before, after, everything),
        nominal_model=nominal_model,
        augmented=model,
        simulated=outputs,
        roles=data.roles.by_run,
        faults=data.measured.faults,
        notes=_notes(data, judged, verdict),
        noise_sd=data.fine.sample_noise,
        elapsed_s=round(time.perf_counter() - began, 2),
        seed=seed,
    )


def _written(model: Model) -> Model:
    """The model as its file says: what is shown is simulated from what was written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        model_file.save(model, path)
        return model_file.load(path)


def _convincing(data: _Data, judged: Judged, term: Composition | None) -> Composition | None:
    """The term, unless it leaves more than half of the gap on the runs it has not seen."""
    unseen = _unseen(data)
    if term is None or unseen is None:
        return term
    noise = unseen.noise_cost()
    before, after = (float(unseen.losses(model).sum()) - noise for model in (judged.nominal.model, term.model))
    return term if after < 0.5 * before else None


def _term(term: Composition, data: _Data, before: Array, after: Array, everything: Band) -> Term:
    """`removed_held_out`: of the loss above that of noise, on the runs it has not seen."""
    unseen = [block.place for block in everything.blocks if data.roles.by_run[run_of(block.run)] == "held_out"]
    noise = everything.noise_cost() / len(everything.measured)
    lost = [
        sum(float(one[place].sum() - noise * (place.stop - place.start)) for place in unseen) for one in (before, after)
    ]
    removed = 1 - max(lost[1], 0.0) / lost[0] if unseen and lost[0] > 0 else float("nan")
    return term_of(term.found, data.dataset.vehicle, _source_name(data.dataset), removed)


def _effects(
    judged: Judged, named: Sequence[object], estimates: Mapping[str, Estimate], model: Model
) -> tuple[Effect, ...]:
    """The named effects; explanations that the data cannot tell from them stand with the first that they replace."""
    equivalents = [
        Equivalent(
            " + ".join(one.names),
            {
                (f"{c.effect}.{name}" if len(one.chosen) > 1 else name): Parameter(
                    value_of(one.model, f"{c.effect}.{name}"), _unit(model, c.effect, name), None
                )
                for c in one.chosen
                for name in c.free
            },
            one.charged - judged.best.charged,
        )
        for one in judged.rivals
    ]
    found = []
    for candidate in judged.best.chosen if named else ():
        info = catalogue.effect(candidate.effect)
        values = {}
        for name in candidate.free:
            estimate = estimates[f"{candidate.effect}.{name}"]
            values[name] = Parameter(estimate.value, _unit(model, candidate.effect, name), estimate.ci95)
        found.append(
            Effect(candidate.effect, info.acts_on, info.equation, judged.confidence, values, tuple(equivalents))
        )
        equivalents = []
    return tuple(found)


def _apart_from_zero(effect: Effect) -> bool:
    return all(one.ci95 is not None and one.ci95[0] * one.ci95[1] > 0 for one in effect.parameters.values())


def _unit(model: Model, effect: str, parameter: str) -> str:
    return unit_on(model, next(one for one in catalogue.effect(effect).parameters if one.name == parameter))


def _nominal_changes(plan: Plan, model: Model) -> dict[str, NominalChange]:
    changes = {}
    for free in plan.free:
        if free.effect is not None or free.known is None:
            continue
        value, sd = value_of(model, free.name), free.known.sd
        away = abs(value - free.known.value) / sd if sd else 0.0
        changes[free.name] = NominalChange(
            free.known.value, value, unit_on(model, free.info), sd, away > _LEFT_PRIOR_SD
        )
    return changes


def _experiment(data: _Data, judged: Judged) -> Experiment:
    rivals = {" + ".join(one.names): one.model for one in (judged.best, *judged.rivals)}
    return next_experiment(rivals, list(data.fine.sample_noise), data.fine.sample_noise, data.seen.largest["voltage"])


def _ranking(judged: Judged, selection: Selection) -> tuple[Rank, ...]:
    """Every set of effects that was fitted, the best way it was: those judged again first, then those of the search."""
    found = [_rank(one, judged, judged.nominal.cost, _why(one, judged)) for one in judged.ranked]
    for step in selection.steps:
        for one in step.tried:
            by = one.charged - selection.best.charged
            why = _WORSE.format(max(by, 1.0)) if by > 0 else "Takes away too little beside what was taken already."
            found.append(_rank(one, judged, selection.nominal.cost, why))
    first: dict[tuple[str, ...], Rank] = {}
    for rank in found:
        first.setdefault(rank.names, rank)
    return tuple(first.values())


_WORSE = "Fits worse by {:.0f} units of log likelihood."


def _why(one: Fitted, judged: Judged) -> str:
    if one is judged.best:
        return "Taken: it explains the runs best."
    if one in judged.rivals:
        return "The data cannot tell it from the best one."
    by = one.charged - judged.best.charged
    return _WORSE.format(max(by, 1.0)) if by > 0 else "Does better by no more than chance, and with more effects."


def _rank(one: Fitted, judged: Judged, before: float, why: str) -> Rank:
    removed = (before - one.cost) / max(before - judged.noise, 1e-9)
    values = {f"{c.effect}.{name}": value_of(one.model, f"{c.effect}.{name}") for c in one.chosen for name in c.free}
    gap = float(np.sqrt(max(one.cost, 0.0) / max(judged.noise, 1e-9)))
    return Rank(one.names, values, gap, float(np.clip(removed, 0.0, 1.0)), why)


def _notes(data: _Data, judged: Judged, verdict: Verdict) -> tuple[str, ...]:
    notes = [data.roles.note, *data.plan.notes, *data.measured.notes, *data.fine.notes]
    if verdict in ("named", "ambiguous") and not judged.adequate:
        notes.append(
            f"Something remains: {judged.best.cost / judged.noise:.1f} times what noise alone would leave. No named "
            "effect and no composed term takes it away."
        )
    if not judged.best.chosen and not judged.adequate:
        notes.append(
            f"What is left is {judged.nominal.cost / judged.noise:.1f} times what noise alone would leave, but no "
            "named effect takes enough of it away to be believed."
        )
    return tuple(dict.fromkeys(notes))
