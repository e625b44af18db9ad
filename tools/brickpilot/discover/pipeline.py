"""`brickpilot discover`: from a data set to a finding.

Each stage is a function in a module beside this one. It returns a frozen record that the next stages take.

    with_known_timing -> Dataset      what the inputs do between two rows, if the data set does not state it
    prepare          -> Prepared, Sealed   the fit runs and their residual; the held-out data, sealed
    calibrate        -> Explanation   the calibrated nominal model: the explanation without parts
    in_closed_loop   -> Prepared      innovations in place of the residual, if a feedback loop biases free runs;
                                      the noise may be known only after a first search
    Search.run       -> Found         every explanation that was fitted, with its evidence           (search.py)
    weigh            -> Verdict       none, named or ambiguous, by the evidence alone                (verdict.py)
    adequate         -> Verdict       the same among adequate explanations; if none: `unknown`       (verdict.py)
    prepare_windows  -> Prepared      for `unknown`: the search again in short windows, for periodic effects
    compose          -> Composed      still `unknown`: a law of few terms without a name             (compose.py)
    confirmed        -> Verdict       whether the measured samples confirm a name                    (verdict.py)
    settle           -> Settled       the last fit, with intervals, as read back from its file       (settle.py)
    best_predictor   -> Settled       on request: the model that predicts best, without claims       (settle.py)
    prove            -> Proof         the seal is opened, once: held-out runs may withdraw the name  (seal.py)
    plan_experiment  -> Experiment    the manoeuvre that separates the rivals                        (experiment.py)
    measure          -> Yardstick     fit in percent before, after and attainable                    (yardstick.py)
    conclude         -> Finding       effects with intervals, gaps, places, ranking                  (conclude.py)

`weigh` gives the first verdict. The functions below may change it; `Finding.steps` lists each change by its stage:

    stage     function   verdict    if                                                     by (numbers.py)
    adequacy  adequate   another    a black box predicts the error that the best           SHARED_REST, UNEXPLAINED_NATS
                                    explanation leaves, or more error is left than removed;
                                    other explanations hold more than 5 % of the weight
                         unknown    the same, but no others hold more than 5 %             SURE
    budget    explain    unknown    time ran out before all was searched                   SEARCHED, in deadline.py
    runs      confirmed  none       only values of runs differ
    samples   confirmed  unknown    the measured samples do not surely show the effect     CHANCE_NATS
                         none       the same, and the nominal error is near the noise      UNEXPLAINED_NATS
    seal      _prove     unknown    the error of held-out runs surely grows, or most       CHANCE_NATS, SURE
                                    draws of their stretches favour the nominal model
                         ambiguous  held-out runs neither confirm nor refute the name      SURE

Every number that decides a verdict stands in numbers.py, with its reason. The sentences of a verdict are made in
report/discover_text.py.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from functools import cache

from threadpoolctl import threadpool_limits

from brickpilot.data.dataset import Dataset
from brickpilot.discover import numbers
from brickpilot.discover.adequacy import Adequacy, adequacy
from brickpilot.discover.compose import Composed, compose
from brickpilot.discover.conclude import Conclusion, conclude
from brickpilot.discover.deadline import SEARCHED, Deadline, Span, Stages, estimate
from brickpilot.discover.evidence import Judge
from brickpilot.discover.experiment import plan_experiment
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import Budget, Finding, Step
from brickpilot.discover.prepare import Prepared, calibrate, in_closed_loop, prepare, prepare_windows
from brickpilot.discover.row_meaning import with_known_sampling, with_known_timing
from brickpilot.discover.seal import Sealed, prove, unproved
from brickpilot.discover.search import MOST_PARTS, PARTS_IN_WINDOWS, Found, Library, Search
from brickpilot.discover.settle import Settled, at_samples, best_predictor, better_predictor, settle
from brickpilot.discover.verdict import Verdict, adequate, best_so_far, confirmed
from brickpilot.discover.yardstick import Yardstick, as_predictor, measure
from brickpilot.fit.descent import Progress
from brickpilot.vehicle.model import Model

_NO_TIME = "The time was up before everything was searched."


@dataclass(frozen=True, eq=False)
class Explained:
    """Prepared data, the explanations that were found in them, and the verdict."""

    prepared: Prepared
    found: Found
    verdict: Verdict


def discover(
    dataset: Dataset,
    model: Model | None = None,
    *,
    seed: int = 0,
    jobs: int = 2,
    budget_s: float | None = None,
    predictor: bool = False,
    progress: Progress | None = None,
) -> Finding:
    """Finds what the simulator of `dataset` lacks.

    Args:
        model: the search starts from this model and its effects. None: from the data set's nominal values.
        seed: seed of the random starts, which are used if nominal values are not given.
        jobs: number of fits at the same time.
        budget_s: time after which the best answer so far is returned. Work that cannot be left out may take longer.
            None: no limit.
        predictor: whether to also find the model that predicts best, `Finding.predictor`. Its parts are no findings.
        progress: called with (done, total, text).

    Raises:
        InputError: the model gives none of the measured signals, or every run is held out.
        SimulationError: the plant diverges with the nominal values.

    `brickpilot.discover` has an example.
    """
    # Fits run side by side already, and their matrices are small: threads of BLAS would only wait for each other.
    with threadpool_limits(1, "blas"):
        deadline = Deadline(budget_s)
        known: Dataset = with_known_timing(dataset, model, seed=seed, jobs=jobs)
        prepared, sealed = prepare(known, model, seed=seed, jobs=jobs, deadline=deadline)
        tell = Stages(progress)
        tell("preparing the data")  # after `prepare`, so that bad input prints only its error line
        tell("calibrating the nominal model")
        prepared, nominal = calibrate(prepared)
        sampled = with_known_sampling(known, prepared, nominal)
        if sampled is not None:
            prepared, sealed = prepare(sampled, model, seed=seed, jobs=jobs, deadline=deadline)
            prepared, nominal = calibrate(prepared)
        prepared, nominal = in_closed_loop(prepared, nominal, None)
        return _find(prepared, nominal, sealed, tell, predictor=predictor)


def _find(prepared: Prepared, nominal: Explanation, sealed: Sealed, tell: Stages, *, predictor: bool) -> Finding:
    """Runs the stages after `calibrate`."""
    estimated: Span = estimate(prepared, nominal)
    tell.expect(estimated)
    explained: Explained = explain_in_loop(prepared, nominal, tell)
    if explained.verdict.kind == "unknown":
        explained = _explain_in_windows(explained, tell)
    composed: Composed | None = None
    if explained.verdict.kind == "unknown":
        composed = compose(explained.prepared, explained.found.judge, explained.verdict, tell)
    conclusion: Conclusion = _prove(explained, composed, sealed, tell, predictor=predictor)
    finding: Finding = conclude(explained.prepared, conclusion)
    limit, left_out = prepared.deadline.budget_s, tuple(prepared.deadline.left_out)
    elapsed_s = round(time.perf_counter() - prepared.deadline.began, 2)
    budget = None if limit is None else Budget(limit, round(estimated.middle, 1), bool(left_out), left_out)
    return dataclasses.replace(finding, elapsed_s=elapsed_s, budget=budget)


def explain(prepared: Prepared, nominal: Explanation, tell: Stages, most: int = MOST_PARTS) -> Explained:
    """Searches for explanations on the coarse grid, weighs them, and checks whether their residuals are adequate."""
    judge = Judge.of(prepared.coarse, prepared.seed)
    library, until = Library(prepared.excitation, most), prepared.deadline.until(SEARCHED)
    search = Search(prepared.coarse, nominal, library, prepared.excitation, prepared.jobs, until, tell)
    found: Found = search.run(judge)

    @cache
    def left_of(one: Explanation) -> Adequacy:
        plain = found.table.get(found.nothing.explanation.key | one.offsets, found.nothing)
        return adequacy(judge, found.table[one.key], found.nothing, plain, prepared.seed)

    verdict: Verdict = adequate(found, left_of)
    if prepared.deadline.left_out and verdict.kind != "unknown":
        best = best_so_far(found) if verdict.kind == "none" else verdict.best
        verdict = verdict.turned(Step("budget", "unknown", _NO_TIME), best=best)
    return Explained(prepared, found, verdict)


def explain_in_loop(prepared: Prepared, nominal: Explanation, tell: Stages, most: int = MOST_PARTS) -> Explained:
    """Explains free runs; if a feedback loop biases them, explains the data again by innovations: see `in_closed_loop`.

    The residual of the explanation with the best score counts as noise: other residuals also contain a missing law.
    This explanation is chosen by score and not by cost, because a cost depends on where a descent ends.
    """
    free_runs = explain(prepared, nominal, tell, most)
    if prepared.loop is None or prepared.innovations:
        return free_runs
    again, nominal = in_closed_loop(prepared, nominal, free_runs.found.ranked()[0].explanation)
    if not again.innovations:
        return free_runs
    tell("searching again by innovations, as a feedback loop is around the data")
    return explain(again, nominal, tell, most)


def _explain_in_windows(whole: Explained, tell: Stages) -> Explained:
    """Explains the runs again in short windows; returns `whole` if no periodic effect is named there.

    Over a whole run, a wheel's simulated angle drifts from the measured angle, so an effect that depends on the angle
    fits at no phase. A window of one or two turns starts from the measured state, so one phase fits.
    """
    windows = prepare_windows(whole.prepared)
    if windows is None or not windows.deadline.until(SEARCHED).allows("the search in short windows"):
        return whole
    tell("searching again in short windows")
    ready, nominal = calibrate(windows)
    again = explain(ready, nominal, tell, PARTS_IN_WINDOWS)
    periodic = again.verdict.kind in ("named", "ambiguous") and again.verdict.best.is_periodic
    if not periodic:
        return whole
    steps = (*whole.verdict.steps, *again.verdict.steps)
    return dataclasses.replace(again, verdict=dataclasses.replace(again.verdict, steps=steps))


def _prove(
    explained: Explained, composed: Composed | None, sealed: Sealed, tell: Stages, *, predictor: bool
) -> Conclusion:
    """Makes the last fit of the verdict's model, opens the seal, and returns the conclusion."""
    tell("computing intervals and the next experiment")
    prepared = explained.prepared
    samples: Found = at_samples(prepared, explained.verdict.nominal, explained.verdict.best)
    verdict = confirmed(explained.verdict, samples, numbers.UNEXPLAINED_NATS * len(prepared.fine.measured))
    nominal: Settled = settle(prepared, samples.nothing.explanation)
    best = settle(prepared, samples.table[verdict.best.key].explanation) if verdict.best.parts else nominal
    written = best if verdict.kind in ("named", "ambiguous") else nominal
    if composed is not None:
        written = settle(prepared, composed.explanation)
        composed = Composed.of(written.explanation)
    predicts: Settled | None = None
    if predictor:
        predicts = better_predictor(prepared, best_predictor(prepared, best.explanation, tell), written)
    proof = prove(prepared, sealed, nominal.model, written.model, written.explanation.model.by_run)
    said = proof.evidence.sentence if proof.evidence else ""
    if verdict.kind == "named" and not (proof.is_confirmed or proof.is_contradicted):
        verdict = verdict.turned(Step("seal", "ambiguous", said), rivals=(verdict.nominal,))
    steps = verdict.steps
    if proof.is_contradicted:
        steps += (Step("seal", "unknown", said),)
        composed, written, proof = (None, nominal, unproved(proof, nominal.model))
    experiment = plan_experiment(prepared, verdict)
    tell("measuring what is attainable")
    yardstick = Yardstick()
    if prepared.deadline.allows("what is attainable"):
        yardstick = measure(prepared, proof, nominal.model, written.model)
    predicted = None if predicts is None else as_predictor(prepared, proof, predicts)
    judge = explained.found.judge
    return Conclusion(steps, judge, verdict, best, written, nominal, composed, proof, experiment, yardstick, predicted)
