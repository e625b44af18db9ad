"""The last fit: fits the verdict's explanation to the measured samples and to whole runs, and computes intervals.

The search compares short windows, and changes of signals, because a wrong force shifts a velocity for seconds and a
position for ever. But the written model must follow a whole run. So the same explanation is fitted again to free runs,
without a new part. The new values are kept if they fit the fit runs better.

On request, the best predictor is fitted too: the explanation with every part that surely improves the prediction of
left-out whole runs, whether the verdict names the part or not. It serves users who want to predict, not to explain.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.motion import MOTOR_RATE_OF
from brickpilot.data.signals import SUMMED
from brickpilot.discover import numbers
from brickpilot.discover.deadline import COMPOSED
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation, refine, without
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search import Found, Library, Search, Tell
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.parameters import stated_beside
from brickpilot.fit.residual import Residual, of_bins
from brickpilot.fit.uncertainty import Estimate, assess
from brickpilot.vehicle.model import Model, read_back
from brickpilot.vehicle.replay import Replay
from brickpilot.vehicle.spread import Spread

Array = NDArray[np.float64]

_ROUNDS = 2  # rounds of weighing the signals by their residuals and fitting again
_MOST_JOINED = 5  # largest number of parts that a predictor adds to its start explanation
_WHOLE = "The values are those of a fit to whole runs."


@dataclass(frozen=True)
class Settled:
    """An explanation after its last fit, and its model as written.

    Attributes:
        explanation: the explanation as fitted.
        model: the model as read back from its file, with the basis of each value.
        estimates: the estimates of all fitted parameters, by name.
        spread: the joint uncertainty of all fitted parameters; None: nothing was fitted.
        notes: sentences on the kind of fit.
    """

    explanation: Explanation
    model: Model
    estimates: Mapping[str, Estimate]
    spread: Spread | None
    notes: tuple[str, ...] = ()


def settle(prepared: Prepared, found: Explanation) -> Settled:
    """Returns an explanation fitted to the end at the measured samples, or to whole runs if this lowers their error.

    There is no fit to whole runs if the samples already compare whole runs, or if a feedback loop biases free runs.
    """
    found = (refine(prepared.fine, [found], prepared.jobs) or [found])[0]
    compares_parts = prepared.dataset.vehicle == "motor" or not SUMMED.isdisjoint(prepared.fine.signals)
    whole = whole_runs(prepared) if compares_parts and not prepared.innovations else None
    best, data, notes = found, prepared.fine, tuple[str, ...]()
    if whole is not None:
        with suppress(SimulationError):
            followed = follow(whole, found, prepared.jobs)
            if _is_better(prepared, followed[1].model, found.model):
                data, best, notes = *followed, (_WHOLE,)
    return written(prepared, data, best, notes)


def at_samples(prepared: Prepared, nominal: Explanation, best: Explanation) -> Found:
    """Returns the evidence, at the measured samples, of `nominal`, of `best`, and of `best` without each of its parts.

    The search compared explanations on a coarse grid. A second part may explain only the error of that grid.
    """
    judge, added = Judge.of(prepared.fine, prepared.seed), best.parts[len(nominal.parts) :]
    fewer = [without(best, part) for part in added] if len(added) > 1 else []
    wanted = {one.key: one for one in (nominal, best, *fewer)}
    fitted = wanted | {one.key: one for one in refine(prepared.fine, list(wanted.values()), prepared.jobs)}
    found = Found(judge, judge.of_explanation(fitted[nominal.key]))
    found.add(list(fitted.values()), prepared.jobs)
    return found


def written(prepared: Prepared, data: Residual, found: Explanation, notes: tuple[str, ...] = ()) -> Settled:
    """Returns the model of an explanation as read back from its file, with intervals computed from `data`."""
    plan = found.plan
    beside = stated_beside(plan, found.model, prepared.dataset)
    known = assess(data, found.model, plan.uncertain, beside) if plan.free else None
    estimates = {} if known is None else known.estimates
    name = prepared.dataset.name
    basis = {key: f"fitted to {name}: {estimate.basis}" for key, estimate in estimates.items() if "@" not in key}
    model = read_back(dataclasses.replace(found.model, basis=basis, by_run={}))
    return Settled(found, model, estimates, None if known is None else known.spread, notes)


def whole_runs(prepared: Prepared) -> Residual | None:
    """Returns the residual of whole runs, with positions as measured; None if there is too little to compare."""
    names = [run.name for run in prepared.dataset.runs if run.outputs]
    try:
        return of_bins(
            prepared.dataset,
            prepared.plan.model,
            names,
            width_s=numbers.BIN_S,
            coarse=True,
            samples=prepared.measured,
            as_measured=True,
            threads=prepared.jobs,
        )
    except InputError:
        return None


def follow(whole: Residual, found: Explanation, jobs: int) -> tuple[Residual, Explanation]:
    """Returns `whole`, each signal weighed by the size of its residual, and the explanation fitted to `whole`.

    Raises:
        SimulationError: the plant diverges over whole runs.
    """
    for _ in range(_ROUNDS):
        whole = whole.weighed_by_size(found.model)
        fits = refine(whole, [found], jobs)
        if not fits or not np.isfinite(fits[0].cost):
            raise SimulationError("the plant diverges over whole runs")
        found = fits[0]
    return whole, found


def error_changes(prepared: Prepared, before: Model, after: Model) -> dict[str, float]:
    """Returns signal -> the ratio of its squared errors, `after` to `before`, in free runs of the fit runs.

    Raises:
        SimulationError: a model diverges.
    """
    outputs, sums = Replay(prepared.dataset).simulate([before, after], threads=prepared.jobs), dict[str, Array]()
    for run in prepared.measured.runs:
        for signal in sorted(run.outputs.keys() & outputs[0][run.name].keys() - {"battery_voltage"}):
            errors = [run.outputs[signal] - one[run.name][signal] for one in outputs]
            sums[signal] = sums.get(signal, np.zeros(2)) + np.nansum(np.square(errors), axis=1)
    return {signal: float(then / first) for signal, (first, then) in sums.items() if first > 0 and then > 0}


def _is_better(prepared: Prepared, model: Model, than: Model) -> bool:
    """Returns whether `model` has less error than `than` on the fit runs: the mean log error over signals decides."""
    return sum(map(math.log, error_changes(prepared, than, model).values())) < 0


def best_predictor(prepared: Prepared, start: Explanation, tell: Tell) -> Settled:
    """Returns `start` with the parts that reduce the error in whole left-out runs most: the best predictor.

    The predictor's parts are no findings: prior odds do not count, and the data may not tell some of its parts apart.
    The fit is to free runs even in a feedback loop, which biases fitted values but not simulations. A periodic part is
    added only if a wheel's angle is measured: otherwise the phase in a new run is not known.
    """
    whole = whole_runs(prepared)
    if whole is None:
        return _as_predictor(written(prepared, prepared.coarse, start))
    deadline, data, current = prepared.deadline.until(COMPOSED), whole, start
    periodic = any(name in run.outputs for run in prepared.measured.runs for name in MOTOR_RATE_OF)
    library = Library(prepared.excitation, periodic=periodic)
    try:
        data, current = follow(whole, start, prepared.jobs)
        for _ in range(_MOST_JOINED):
            if deadline.passed:
                break
            tell("searching for the best predictor")
            judge = Judge.of(data, prepared.seed).leaving_out_runs()
            now = judge.of_explanation(current)
            found = Found(judge, now, {current.key: now})
            search = Search(data, current, library, prepared.excitation, prepared.jobs, deadline, tell)
            found.add(search.beside(found, now), prepared.jobs)
            changes = {key: judge.changes(now.left_out, one.left_out) for key, one in found.table.items()}
            best = min(changes, key=lambda key: float(changes[key][0]))
            if np.mean(changes[best] < 0) < numbers.SURE:
                break
            data, current = follow(data, found.table[best].explanation, prepared.jobs)
    except SimulationError:
        data, current = whole, start
    return _as_predictor(written(prepared, data, current))


def better_predictor(prepared: Prepared, grown: Settled, explained: Settled) -> Settled:
    """Returns the model with less error on the fit runs: the predictor with added parts, or the written explanation.

    The descent on whole runs may leave the predictor at worse values than those of the explanation.
    """
    return grown if _is_better(prepared, grown.model, explained.model) else _as_predictor(explained)


def _as_predictor(made: Settled) -> Settled:
    return dataclasses.replace(made, model=dataclasses.replace(made.model, name=f"{made.model.name}, predictor"))
