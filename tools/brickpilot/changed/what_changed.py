"""`brickpilot changed`: from recordings of one machine to the differences of the later recordings.

    _structure   -> Parts       the effects that `discover` names in the first recording: all recordings have them
    _joint       -> Joint       both recordings as one data set, and one explanation of both without a difference
    _begun       -> Onset       the moment at which the later recording changes, if it does          (recordings.py)
    _verdict     -> Verdict     the verdict on differences in values that the machine always has, or in new effects if
                                the residual of one recording stays larger than that of the other    (differences.py)
    _changes     -> Change      each difference as a quantity of the machine, with its interval           (change.py)
    _result      -> Changed     with the values that all recordings share                         (shared_values.py)

The criterion and its numbers are those of `discover`. No run is held out: the evidence comes from stretches of time to
which an explanation was not fitted. A change has to exceed the spread between runs of one recording.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from brickpilot.changed import recordings
from brickpilot.changed.change import (
    Answer,
    Change,
    Changed,
    Constant,
    FitPercent,
    Trace,
    change_of,
    combinations,
    is_sure,
)
from brickpilot.changed.differences import MOST_DIFFERENCES, Difference, Differences, no_further
from brickpilot.changed.shared_values import Constants, shared_values, values_of
from brickpilot.data.dataset import Dataset
from brickpilot.data.signals import Array
from brickpilot.discover import numbers
from brickpilot.discover.deadline import NO_LIMIT, Stages
from brickpilot.discover.evidence import Judge, scale_of_rest
from brickpilot.discover.explanation import Explanation, joined, refine
from brickpilot.discover.finding import Step
from brickpilot.discover.parts import Part, library_parts
from brickpilot.discover.pipeline import explain_in_loop
from brickpilot.discover.prepare import Prepared, calibrate, in_closed_loop, prepare
from brickpilot.discover.row_meaning import with_known_timing
from brickpilot.discover.search import Found, Search
from brickpilot.discover.verdict import Verdict, weigh
from brickpilot.fit.descent import Progress
from brickpilot.fit.parameters import Plan
from brickpilot.fit.residual import Residual
from brickpilot.fit.robust import robust_size
from brickpilot.fit.uncertainty import assess
from brickpilot.vehicle.compared_runs import comparable
from brickpilot.vehicle.headline import headline
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay, in_recording

BEFORE = "before"
_LEFT = (
    "The best differences leave {:.2g} nats a value more error in one recording than in the other: a law is missing."
)
_RUNS = "Runs of one recording differ among themselves by as much."
_DRAWN = 2  # number of signals with a plot
_MOST_NAMED = 2  # largest number of effects that are named in BEFORE, without the dry friction that every machine has
_LITTLE = 0.03  # start of the fit of the dry friction that every machine has, as a share of its usual size


@dataclass(frozen=True, eq=False)
class Joint:
    """Two recordings as one data set, ready for fits.

    Attributes:
        base: the explanation of both recordings without a difference.
        alone: recording -> this recording alone, ready for fits, and its explanation by the parts of `base`.
        recording: the name of the later recording.
        old: the model of the machine before the change.
    """

    dataset: Dataset
    prepared: Prepared
    base: Explanation
    alone: Mapping[str, tuple[Prepared, Explanation]]
    recording: str
    old: Model

    @property
    def data(self) -> Residual:
        return self.prepared.coarse

    def rests(
        self, model_of: Mapping[str, Model], size: Callable[[Array, float], float]
    ) -> Mapping[str, Mapping[str, float]]:
        """Returns recording -> signal -> the size of the residual, SI.

        Args:
            model_of: recording -> the model that leaves the residual.
            size: takes an error (values,) and its floor, SI, and returns the size of the error, at least the floor.
        """
        data, by_recording = self.data, dict[str, dict[str, float]]()
        for name, model in model_of.items():
            error = data.error(model)
            for signal in data.signals:
                own = data.rows_of(name, signal)
                if own.any():
                    by_recording.setdefault(name, {})[signal] = size(error[own], data.floor(signal))
        return by_recording

    def worse(self, model_of: Mapping[str, Model]) -> dict[str, float]:
        """Returns recording -> log(residual / residual of the other recording), nats: the largest of all signals."""
        rests = self.rests(model_of, scale_of_rest)
        worse = {}
        for name, other in zip(rests, reversed(list(rests)), strict=True):
            shared = rests[name].keys() & rests[other].keys()
            worse[name] = max((math.log(rests[name][signal] / rests[other][signal]) for signal in shared), default=0.0)
        return worse

    @property
    def models_alone(self) -> dict[str, Model]:
        return {name: explanation.model for name, (_, explanation) in self.alone.items()}

    @cached_property
    def left_more(self) -> tuple[str, ...]:
        """The recordings whose residual is surely larger than the other recording's, if each is explained alone."""
        worse = self.worse(self.models_alone)
        return tuple(name for name, nats in worse.items() if nats > numbers.UNEXPLAINED_NATS)

    def usual(self) -> dict[str, float]:
        """Returns signal -> the usual error, SI: the residual of a recording that is explained well by itself."""
        rests = self.rests(self.models_alone, _robust)
        return _largest([rest for name, rest in rests.items() if name not in self.left_more] or list(rests.values()))

    def weighed(self, floors: Mapping[str, float]) -> Joint:
        """Returns these recordings with `floors`, signal -> SI: an error below a signal's floor shows no change."""
        noise = {name: max(floors.get(name, 0.0), scale.noise) for name, scale in self.data.scales.items()}
        coarse = self.data.with_floors(noise)
        base = (refine(coarse, [self.base], self.prepared.jobs) or [self.base])[0] if self.base.plan.free else self.base
        prepared = dataclasses.replace(self.prepared, coarse=coarse)
        return dataclasses.replace(self, prepared=prepared, base=base)


Parts = Sequence[tuple[Part, Mapping[str, float]]]
"""Effects, each with the values of its parameters."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Two recordings, and the verdict on what differs."""

    joint: Joint
    verdict: Verdict
    since: recordings.Onset | None = None


def what_changed(
    before: Dataset | Model, after: Mapping[str, Dataset], *, seed: int = 0, jobs: int = 2,
    progress: Progress | None = None,
) -> Changed:  # fmt: skip
    """Finds the differences of later recordings of a machine from an earlier recording.

    Args:
        before: the earlier recording, or a model of the machine before the change.
        after: name -> a later recording. No name is "before" or contains "@".
        seed: seed of the random starts from which nominal values that are not given are fitted.
        jobs: number of fits at the same time.
        progress: called with (done, total, text).

    Raises:
        InputError: a recording is of another vehicle, or has no signal that the model computes.
        SimulationError: the plant diverges with the nominal values.
    """
    with threadpool_limits(1, "blas"):
        tell = Stages(progress)
        tell("explaining what was before")
        parts = () if isinstance(before, Model) else _structure(before, seed, jobs)
        compared = [_compared(before, name, dataset, parts, seed, jobs, tell) for name, dataset in after.items()]
        tell("computing intervals")
        return _result(before, compared, seed)


def _structure(dataset: Dataset, seed: int, jobs: int) -> Parts:
    """Returns the effects, with their values, that `discover` names in a recording; empty: it names no effect."""
    known = with_known_timing(recordings.together({BEFORE: dataset}), None, seed=seed, jobs=jobs)
    prepared, _ = prepare(known, None, seed=seed, jobs=jobs)
    prepared, nominal = calibrate(prepared)
    prepared, nominal = in_closed_loop(prepared, nominal, None)
    base = (refine(prepared.coarse, [_shared(nominal, ())], jobs) or [nominal])[0]
    verdict = explain_in_loop(prepared, base, Stages(None), _MOST_NAMED).verdict
    more = verdict.best.effects[len(base.parts) :] if verdict.kind == "named" else ()
    return tuple((part, part.values_in(verdict.best.model)) for part in more if not part.is_periodic)


def _compared(
    before: Dataset | Model, name: str, after: Dataset, parts: Parts, seed: int, jobs: int, tell: Stages
) -> Compared:
    """Compares two recordings. If the later one changes at a moment, its data before this moment count as BEFORE."""
    model = before if isinstance(before, Model) else None
    both = {name: after} if isinstance(before, Model) else {BEFORE: before, name: after}
    dataset = with_known_timing(recordings.together(both), None, seed=seed, jobs=jobs)
    joint = _joint(dataset, name, model, parts, seed, jobs)
    if model is not None:  # without a recording of BEFORE, nothing shows how much error is usual
        return Compared(joint, weigh(_search(joint, (name,), tell)))
    begun = _begun(joint, parts, seed, jobs, tell)
    if begun is None:
        return Compared(*_verdict(joint, tell))
    first, cut = begun
    ready, verdict = _verdict(cut, tell)
    # The moment is estimated again, because `_begun` fits the data without new effects.
    moment = recordings.onset(joint.weighed(joint.usual()).data, joint.old, verdict.best.model, name)
    if moment is not None:
        run = recordings.own_name(first.run)
        why = f"The recording changes at {first.at_s:g} s of {run}: its earlier data count as data before the change."
        verdict = dataclasses.replace(verdict, steps=(Step("onset", verdict.kind, why), *verdict.steps))
    return Compared(ready, verdict, moment)


def _begun(joint: Joint, parts: Parts, seed: int, jobs: int, tell: Stages) -> tuple[recordings.Onset, Joint] | None:
    """Returns the moment of a change in the later recording, and the recordings with a cut there; None: no moment."""
    usual = joint.weighed(joint.usual())
    first = recordings.suspected(usual.data, joint.old, joint.recording)
    if first is None:
        return None
    tell("searching for the moment")
    name = joint.recording

    def at(moment: recordings.Onset) -> Joint:
        cut = recordings.since(joint.dataset, BEFORE, name, moment.run, moment.at_s)
        return _joint(cut, name, None, parts, seed, jobs, innovations=joint.prepared.innovations)

    behind = at(first).models_alone[name]
    moment = recordings.onset(usual.data, joint.old, behind, name)
    if moment is None:
        return None
    cut = at(moment)
    whole, longer = (both.rests({BEFORE: both.models_alone[BEFORE]}, scale_of_rest)[BEFORE] for both in (joint, cut))
    # If BEFORE fits worse together with the data before the moment, these data belong to the change, too.
    grown = max(math.log(longer[signal] / size) for signal, size in whole.items())
    return (moment, cut) if grown <= numbers.UNEXPLAINED_NATS else None


def _joint(
    dataset: Dataset, recording: str, model: Model | None, parts: Parts, seed: int, jobs: int,
    innovations: bool | None = None,
) -> Joint:  # fmt: skip
    """Returns two recordings ready for fits, with the explanation that both recordings share.

    Args:
        innovations: whether a feedback loop biases free runs. None: it does if the noise of both recordings is
            correlated in time. If the noise of only one recording is correlated, the cause may be a new effect.
    """
    prepared, _ = prepare(dataset, model, seed=seed, jobs=jobs)
    # Each constant may differ by itself, so no constant is held.
    plan = dataclasses.replace(prepared.plan, free=prepared.plan.uncertain, held=())
    prepared, nominal = calibrate(dataclasses.replace(prepared, plan=plan))
    if model is not None:
        prepared, _ = in_closed_loop(prepared, nominal, nominal)
        torques = [key.split(".") for key in combinations() if "." in key]  # the dry friction that every machine has
        effects = {**{effect: {name: 0.0} for effect, name in torques}, **model.effects}
        base = Explanation((), Plan(dataclasses.replace(model, effects=effects), (), ()), np.empty(0))
        return Joint(dataset, prepared, base, {}, recording, model)
    base = _shared(nominal, parts)
    alone = {name: _alone(recordings.only(dataset, name), base, seed, jobs) for name in (BEFORE, recording)}
    noisy = alone if innovations is False else {name: in_closed_loop(*own, own[1]) for name, own in alone.items()}
    if all(own.innovations for own, _ in noisy.values()):
        alone = noisy
        prepared, nominal = in_closed_loop(prepared, nominal, nominal)
        base = _shared(nominal, parts)
    return Joint(dataset, prepared, base, alone, recording, alone[BEFORE][1].model)


def _shared(nominal: Explanation, parts: Parts) -> Explanation:
    """Returns the nominal model with the effects of BEFORE and with the dry friction that every machine has."""
    base = nominal
    for part, values in parts:
        base = joined(base, part, values)
    covered = base.key.union(*(part.contains for part in base.parts))
    for part in library_parts(base.model):
        (name, *others), infos = part.free, part.infos
        if infos[name].in_volts and not others and part.name not in covered:
            size = part.starting(base.plan, {}).free[-1].natural
            base = joined(base, part, {name: _LITTLE * size})
    return base


def _alone(dataset: Dataset, base: Explanation, seed: int, jobs: int) -> tuple[Prepared, Explanation]:
    """Returns one recording alone, ready for fits, and the explanation of its free runs by the parts of `base`."""
    prepared, _ = prepare(dataset, None, seed=seed, jobs=jobs)
    prepared, _ = calibrate(prepared)
    return prepared, (refine(prepared.coarse, [base], jobs) or [base])[0]


def _verdict(joint: Joint, tell: Stages) -> tuple[Joint, Verdict]:
    """Returns the recordings with the floors that were used, and the verdict on the differences.

    Each recording is first explained alone. The residual of this explanation is no change: it counts as noise. If this
    residual is surely larger in one recording than in the other, the recording with the larger residual may have a new
    effect, and only the other recording's residual counts as noise. If no new effect is found, the answer is a
    difference in values that the machine always has. If several of these values differ, one new effect may explain all
    differences. For example, a gyro that reads 10 % more looks like a narrower robot that turns more easily. The new
    effect is the answer if it has the best score. The verdict is "unknown" if the residual stays too large.
    """
    ready, verdict = joint, None
    if joint.left_more:
        ready = joint.weighed(joint.usual())
        verdict = weigh(_search(ready, joint.left_more, tell))
    if verdict is None or not any(part.is_new for part in _differences(verdict.best)):
        ready = joint.weighed(_largest(list(joint.rests(joint.models_alone, _robust).values())))
        found = _search(ready, (), tell)
        verdict = weigh(found)
        if len(_differences(verdict.best)) > 1:
            found.table |= _search(ready, (BEFORE, joint.recording), tell, most=1).table
            if any(part.is_new for part in _differences(found.ranked()[0].explanation)):
                verdict = weigh(found)
    left, gap = (
        max(joint.worse(dict.fromkeys(joint.alone, model)).values()) for model in (verdict.best.model, joint.old)
    )
    if joint.left_more and left > max(numbers.UNEXPLAINED_NATS, gap / 2):  # more error is left than removed
        verdict = verdict.turned(Step("adequacy", "unknown", _LEFT.format(left)))
    return ready, verdict


def _robust(error: Array, floor: float) -> float:
    return max(robust_size(error), floor)


def _largest(rests: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Returns signal -> the largest size of the signal's residual in `rests`."""
    signals = dict.fromkeys(signal for rest in rests for signal in rest)
    return {signal: max(rest.get(signal, 0.0) for rest in rests) for signal in signals}


def _search(joint: Joint, new_in: Sequence[str], tell: Stages, most: int = MOST_DIFFERENCES) -> Found:
    prepared = joint.prepared
    nominal = [free.name for free in prepared.plan.uncertain if free.effect is None]
    source = Differences(nominal, joint.recording, prepared.excitation, new_in, most)
    search = Search(prepared.coarse, joint.base, source, prepared.excitation, prepared.jobs, NO_LIMIT, tell)
    # The laws are the same in both recordings, and the floors include the error in the shape of these laws.
    return search.run(Judge.of(prepared.coarse, prepared.seed, shape=0.0))


def _result(before: Dataset | Model, pairs: Sequence[Compared], seed: int) -> Changed:
    """Returns the result. A difference that is no larger than the spread between runs of one recording is no change."""
    verdicts, steps = dict[str, Answer](), dict[str, tuple[Step, ...]]()
    changes, constants, new = list[Change](), Constants(), list[tuple[Difference, Model]]()
    for compared in pairs:
        name = compared.joint.recording
        alone = values_of(compared.joint.alone, compared.joint.dataset.vehicle)
        for key, constant in alone.items():
            constants.setdefault(key, constant)
        own = _changes(compared, alone)
        verdicts[name], steps[name] = _KINDS[compared.verdict.kind], _steps(compared)
        sure = [change for change in own if is_sure(change.change)]
        if own and not sure:
            verdicts[name] = "nothing"
            steps[name] = (*steps[name], Step("runs", "none", _RUNS))
        changes += sure
        named = {change.parameter for change in sure}
        new += [
            (part, compared.verdict.best.model)
            for part in _differences(compared.verdict.best)
            if part.is_new and part.free[0] in named
        ]
    if new and len(pairs) > 1:
        each = {name: own for compared in pairs for name, own in compared.joint.alone.items()}
        constants = values_of(each, pairs[0].joint.dataset.vehicle, new, pairs[0].joint.prepared.jobs)
    return Changed(
        before=before.name,
        after=tuple(verdicts),
        dataset=recordings.only(pairs[0].joint.dataset, pairs[0].joint.recording),
        verdicts=verdicts,
        changes=tuple(sorted(changes, key=lambda change: -change.weight)),
        fits={pair.joint.recording: _fits(pair) for pair in pairs},
        constants=tuple(constants.values()),
        shared=shared_values(list(constants.values())),
        traces={pair.joint.recording: _traces(pair) for pair in pairs},
        steps=steps,
        notes=tuple(dict.fromkeys(note for pair in pairs for note in pair.joint.dataset.notes)),
        seed=seed,
    )


def _steps(compared: Compared) -> tuple[Step, ...]:
    """Returns the stages that set or changed a verdict; their texts omit the effects that both recordings share."""
    shared = "".join(f"{name} + " for name in compared.joint.base.names)
    return tuple(
        dataclasses.replace(step, why=step.why.replace(shared, "").replace("@", " of "))
        for step in compared.verdict.steps
    )


_KINDS: Mapping[str, Answer] = {"none": "nothing", "named": "changed", "ambiguous": "ambiguous", "unknown": "unknown"}


def _changes(compared: Compared, alone: Mapping[tuple[str, str], Constant]) -> list[Change]:
    """Returns the differences of the best explanation as changes, each with the differences of the rivals."""
    joint, verdict = compared.joint, compared.verdict
    if verdict.kind not in ("named", "ambiguous"):
        return []
    best = verdict.best
    model = no_further(best.model, joint.recording)
    spread = assess(joint.data, model, best.plan.uncertain).spread
    moment = compared.since
    both = {
        what: (constant, alone[joint.recording, what])
        for (recording, what), constant in alone.items()
        if recording == BEFORE and (joint.recording, what) in alone
    }
    other_fields: dict[str, Any] = {
        "since": moment and dataclasses.replace(moment, run=recordings.own_name(moment.run)),
        "rivals": tuple(tuple(part.what for part in _differences(rival)) for rival in verdict.rivals),
    }
    correlated = Judge.of(joint.data, 0).correlation(next(e for e in verdict.ranked if e.explanation.key == best.key))
    return [
        change_of(
            part, model, spread, recordings.sd_between_recordings(joint.data, best, part, correlated), BEFORE,
            joint.recording, both,
            weight=min(sum(held.weight for held in verdict.held if held.explanation.says(part)), 1.0), **other_fields,
        )
        for part in _differences(best)
    ]  # fmt: skip


def _differences(explanation: Explanation) -> list[Difference]:
    return [part for part in explanation.parts if isinstance(part, Difference)]


def _fits(compared: Compared) -> dict[str, FitPercent]:
    """Returns signal -> how much of the signal the models before and after the change explain in free runs."""
    joint, recording = compared.joint, compared.joint.recording
    sets = {name: recordings.only(joint.dataset, name) for name in (BEFORE, recording)}
    after = in_recording(compared.verdict.best.model, recording, [run.name for run in sets[recording].runs])
    ready = {name: comparable(dataset) for name, dataset in sets.items() if dataset.runs}
    headlines = [
        headline(ready[name], model) if name in ready else None
        for name, model in ((BEFORE, joint.old), (recording, joint.old), (recording, after))
    ]
    fits = [{} if one is None else {name: one.of(name, "fit").fit_percent for name in one.signals} for one in headlines]
    return {name: FitPercent(*(fit.get(name) for fit in fits)) for name in dict.fromkeys(itertools.chain(*fits))}


def _traces(compared: Compared) -> list[Trace]:
    """Returns traces of the signals that the changes explain best, each in the run where the changes explain most."""
    joint, name = compared.joint, compared.joint.recording
    later = recordings.only(joint.dataset, name)
    after = in_recording(compared.verdict.best.model, name, [run.name for run in later.runs])
    old, explained = Replay(later).simulate([joint.old, after])
    best: dict[str, tuple[float, Trace]] = {}
    for run in later.runs:
        for signal in run.outputs.keys() & old[run.name].keys() - {"battery_voltage"}:
            simulated = old[run.name][signal], explained[run.name][signal]
            trace = Trace(recordings.own_name(run.name), signal, run.time, run.outputs[signal], *simulated)
            first, last = (float(np.nansum((trace.measured - values) ** 2)) for values in simulated)
            if first - last > best.get(signal, (0.0,))[0]:
                best[signal] = (first - last, trace)

    def share(gained: tuple[float, Trace]) -> float:
        gain, trace = gained
        return gain / max(float(np.nanstd(trace.measured)) ** 2 * len(trace.time), 1e-30)

    return [trace for _, trace in sorted(best.values(), key=share, reverse=True)[:_DRAWN]]
