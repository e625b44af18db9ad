"""`brickpilot discover`: from a data set to a finding.

Each stage is a function in a module beside this one. What it makes is a frozen dataclass that the next stages take.

    with_known_timing -> Dataset      what the inputs do between two rows, where the data set does not know
    prepare          -> Prepared      the runs ready for fits, their roles, and the residual that is compared
    calibrate        -> FittedModel   the calibrated nominal model
    search           -> Searched      the best set of effects, and every set that was tried
    judge            -> Verdict       none, named, ambiguous or unknown, with the rivals     (verdict.py)
    values_that_differ -> RunValues   what differs from run to run beside that; all is explained again with it
    compose          -> Composed      a term without a name, where it explains more than the named effects; found by the
                                      same search (search.py) with other candidates (terms/source.py, effect_source.py)
    write            -> Written       the augmented model, and what held-out runs say of it  (written.py)
    measure          -> Yardstick     fit in percent before, after and attainable            (yardstick/)
    follow_whole_runs -> Written      the same model, fitted to free runs of whole runs     (long_horizon.py)
    plan_experiment  -> Experiment    the manoeuvre that separates the rivals                (experiment.py)
    conclude         -> Finding       parameters with intervals, gaps, places, ranking, and the augmented model

Every number that decides a verdict stands in gates.py, with the reason for it.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from brickpilot.data.dataset import Dataset
from brickpilot.discover import gates
from brickpilot.discover.calibrate import calibrate
from brickpilot.discover.compose import Composed, compose
from brickpilot.discover.conclude import conclude
from brickpilot.discover.deadline import COMPOSED, FIRST_EFFECT, JUDGED, SEARCHED, Deadline
from brickpilot.discover.effect_source import EffectSource
from brickpilot.discover.estimate import Span, Stages, estimate
from brickpilot.discover.experiment import plan_experiment
from brickpilot.discover.finding import Budget, Experiment, Finding
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.input_timing import with_known_timing
from brickpilot.discover.long_horizon import follow_whole_runs
from brickpilot.discover.predictability import settled
from brickpilot.discover.prepare import Prepared, prepare, prepare_windows
from brickpilot.discover.run_values import pays, values_that_differ, with_run_values
from brickpilot.discover.search import Searched, search
from brickpilot.discover.verdict import Verdict, judge, share_windows_must_remove, suspected_in_windows
from brickpilot.discover.written import Written, write
from brickpilot.discover.yardstick import Yardstick, measure, reference
from brickpilot.fit.descent import Progress
from brickpilot.fit.run_values import KINDS, RunValues
from brickpilot.vehicle.model import Model


@dataclass(frozen=True)
class Explained:
    """Prepared data with what the search found in them and the verdict on it.

    Attributes:
        composed: the term that explains them, where one was composed already.
    """

    prepared: Prepared
    searched: Searched
    verdict: Verdict
    composed: Composed | None = None


def discover(
    dataset: Dataset,
    model: Model | None = None,
    *,
    seed: int = 0,
    jobs: int = 2,
    budget_s: float | None = None,
    progress: Progress | None = None,
) -> Finding:
    """Finds what the simulator of `dataset` lacks.

    Args:
        model: the search starts from this model and its effects. None: from the data set's nominal values.
        seed: seed of the random starts. They are used where nominal values are not given.
        jobs: number of fits at the same time.
        budget_s: the answer is the best one so far after this time. What has to be done at any rate may take longer.
            None: no limit.
        progress: called with (done, total, text).

    Raises:
        InputError: no measured signal is one that the model gives, or every run is held out.
        SimulationError: the plant diverges with the nominal values.

    A motor with dry friction as large as 0.6 V, or 0.009 N m, of which the nominal values say nothing:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 3.0, 0.01)
    >>> def bench(volts):
    ...     driven = 3 * (abs(volts) - 0.6) * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15))
    ...     coasting = np.maximum((driven[200] + 1.8) * np.exp(-(time - 2) / 0.15) - 1.8, 0)
    ...     speed = np.sign(volts) * np.where(time < 2, driven, coasting)
    ...     voltage = np.where((time > 0.195) & (time < 1.995), volts, 0.0)
    ...     noise = np.random.default_rng(1).normal(0, 0.02, time.size)
    ...     return pd.DataFrame({"time": time, "voltage": voltage, "speed": speed + noise})
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "inductance": 0.0}
    >>> runs = {"low": bench(3.0), "back": bench(-5.0), "high": bench(6.0)}
    >>> roles = {"low": "fit", "back": "fit", "high": "held_out"}
    >>> finding = bp.discover(bp.Dataset.from_frames(runs, vehicle="motor", nominal=known, roles=roles))
    >>> finding.verdict
    'named'
    >>> [one.mechanism for one in finding.effects]
    ['bearing']
    >>> finding.to_frame()[["parameter", "value", "unit"]].round(3)
      parameter  value unit
    0    torque  0.009  N m
    """
    # Fits run side by side already, and their matrices are small: threads of BLAS would only wait for each other.
    with threadpool_limits(1, "blas"):
        deadline = Deadline(budget_s)
        known: Dataset = with_known_timing(dataset, model, seed=seed, jobs=jobs)
        prepared: Prepared = prepare(known, model, seed=seed, jobs=jobs, deadline=deadline)
        return _find(prepared, Stages(progress))


def _find(prepared: Prepared, tell: Stages) -> Finding:
    """Runs the stages behind `prepare`."""
    deadline = prepared.deadline
    tell("preparing the data")  # after it, so that bad input gets one line and no other
    tell("calibrating the nominal model")
    nominal: FittedModel = calibrate(prepared)
    estimated: Span = estimate(prepared, nominal)
    tell.announce(f"estimate: {estimated}")
    explained: Explained = _explain(prepared, nominal, tell)
    explained = _explain_in_windows(explained, tell)
    explained, run_values = _explain_with_run_values(explained, tell)
    composed: Composed | None = explained.composed or compose(explained.prepared, explained.verdict, tell)
    tell("computing intervals and the next experiment")
    written: Written = write(explained.prepared, explained.verdict, composed)
    if deadline.until(COMPOSED).allows("the fit to whole runs"):
        tell("fitting whole runs")
        written = follow_whole_runs(explained.prepared, explained.verdict, written)
    experiment: Experiment | None = plan_experiment(explained.prepared, explained.verdict, written)
    tell("measuring what is attainable")
    held: Yardstick = _attainable(explained, written)
    written = dataclasses.replace(written, kind=settled(explained.verdict, written, held))
    finding: Finding = conclude(explained.prepared, explained.searched, explained.verdict, written, experiment, held)
    elapsed_s, skipped = round(time.perf_counter() - deadline.began, 2), tuple(deadline.left_out)
    budget = (
        None
        if deadline.budget_s is None
        else Budget(deadline.budget_s, round(estimated.middle, 1), bool(skipped), skipped)
    )
    return dataclasses.replace(finding, run_values=run_values, elapsed_s=elapsed_s, budget=budget)


def _attainable(explained: Explained, written: Written) -> Yardstick:
    """Returns what a model without physics attains on the same data; nothing if there is no time left."""
    prepared = explained.prepared
    if not prepared.deadline.allows("what is attainable"):
        return Yardstick()
    return measure(reference(prepared, explained.verdict.nominal.model), written.model)


def _explain(prepared: Prepared, nominal: FittedModel, tell: Stages) -> Explained:
    """Searches on the coarse grid for effects beside the nominal model, and judges at the measured samples."""
    searched: Searched = search(
        prepared, EffectSource(prepared.excitation), nominal, tell, prepared.until(SEARCHED), FIRST_EFFECT
    )
    tell("fitting at the measured samples")
    verdict: Verdict = judge(prepared, searched)
    return Explained(prepared, searched, verdict)


def _explain_in_windows(whole: Explained, tell: Stages) -> Explained:
    """Explains the runs again, cut into short windows; returns `whole` unless the windows explain clearly more.

    Each window starts from the measured state. An effect that depends on the angle of a wheel makes two simulations
    drift apart over a whole run, so that no size of it fits there. It fits over a window of one or two turns. Such an
    effect is suspected, without a claim, where whole runs show none and its law explains a part of the windows.
    """
    least = share_windows_must_remove(whole.searched, whole.verdict)
    if whole.verdict.adequate or least >= 1:
        return whole
    windows = prepare_windows(whole.prepared)
    if windows is None or not windows.until(SEARCHED).allows("the search in short windows"):
        return whole
    tell("searching again in short windows")
    again = _explain(windows, calibrate(windows), tell)
    if again.verdict.removed > least:
        return _simpler_term(whole, again, tell) or again
    if not whole.verdict.best.chosen and (suspected := suspected_in_windows(again.verdict)) is not None:
        return dataclasses.replace(again, verdict=suspected)
    return whole


def _simpler_term(whole: Explained, windows: Explained, tell: Stages) -> Explained | None:
    """Returns whole runs with a term that explains them with fewer parameters than windows need; None: no such term.

    A sensor's error is in the measured start of each window too, where many effects patch it up.
    """
    named = windows.verdict.best
    if len(named.chosen) < gates.MANY_EFFECTS:
        return None
    composed = compose(whole.prepared, whole.verdict, tell)
    if composed is None or not composed.alone:
        return None
    fitted, noise = composed.terms.fitted, whole.verdict.noise
    simpler = fitted.parameter_count < named.parameter_count and fitted.cost <= gates.ADEQUATE * noise
    return dataclasses.replace(whole, composed=composed) if simpler else None


def _explain_with_run_values(explained: Explained, tell: Stages) -> tuple[Explained, tuple[RunValues, ...]]:
    """Explains the runs again with values of their own, where what differs from run to run is left unexplained.

    Values of a kind that takes the place of an effect are found and not applied: the effect keeps its name. Effects
    without a claim that explain more than the values do keep their place too.
    """
    kinds, found = list(KINDS), list[RunValues]()
    while kinds:
        prepared, best = explained.prepared, explained.verdict.best
        if not prepared.until(JUDGED).allows("values that differ from run to run"):
            break
        values = values_that_differ(prepared, best, kinds)
        if values is None or values.removed <= explained.verdict.removed_unclaimed:
            break
        if values.applied and not prepared.until(SEARCHED / 2).allows("the explanation with values of the runs"):
            values = dataclasses.replace(values, applied=False)
        if values.applied:
            tell("explaining the runs again, each with its own values")
            own = with_run_values(prepared, values)
            again = _explain(own, calibrate(own), tell)
            if not pays(again.prepared, best, again.verdict.best, values):
                break
            explained = again
        found.append(values)
        kinds.remove(values.kind)
        if not values.applied:
            break
    return explained, tuple(found)
