"""Recordings of one machine as one data set: the moment of a change in a recording, and how much runs differ.

The gain of a compared value says how much better the value is predicted with a change than without. The sum of the
gains from a moment to the end is largest at the moment of the change (Page 1954, Biometrika 41: the CUSUM of a change
point). A first estimate of this moment takes the growth of the old model's error as the gain, because the old model is
correct until the change. The final estimate takes the gain of the model with the differences. Every model explains a
machine at rest, so data at rest do not show when a difference began.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.changed.differences import Difference
from brickpilot.data.dataset import Dataset, Run, with_all_runs
from brickpilot.data.motion import run_of
from brickpilot.data.signals import Array
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Judge, scale_of_rest
from brickpilot.discover.explanation import ROUGH, Explanation, fit
from brickpilot.errors import InputError
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual
from brickpilot.fit.robust import correlation_time
from brickpilot.vehicle.model import Model

_SEP = ": "  # between the names of a recording and of its run
_STEP_S = 0.1  # resolution, s, of the moment of a change
_FAR = 5.0  # in units of an error's scale: a larger error is clipped to this
_LEAST_DEGREES = 2  # least degrees of freedom of a spread: the number of runs, less one for each recording


def together(recordings: Mapping[str, Dataset]) -> Dataset:
    """Returns the runs of all recordings as fit runs of one data set, which is otherwise like the first recording.

    A run's name begins with the name of its recording. If a later recording states other nominal values, these are not
    used, and a note says so: the data have to show the difference.

    Args:
        recordings: name -> data set. A name contains no "@" and no ": ", and is not the name of a run.

    Raises:
        InputError: a later recording is of another vehicle than the first, or has another input timing.
    """
    first, *others = recordings.values()
    notes = []
    for other in others:
        if other.vehicle != first.vehicle:
            raise InputError(f"is of a {other.vehicle}, {first.path} of a {first.vehicle}", file=other.path)
        if other.input_timing != first.input_timing:
            message = f"is {other.input_timing!r}, and that of {first.path} is {first.input_timing!r}"
            raise InputError(message, file=other.path, field="input_timing")
        if (other.nominal, other.nominal_effects) != (first.nominal, first.nominal_effects):
            notes.append(f"The nominal values of {first.name} are used: {other.name} states others.")
    joint = with_all_runs({f"{name}{_SEP}": dataset for name, dataset in recordings.items()})
    runs = (dataclasses.replace(run, role="fit", recording=run.name.partition(_SEP)[0]) for run in joint.runs)
    return dataclasses.replace(joint, runs=tuple(runs), notes=(*joint.notes, *notes))


def only(joint: Dataset, recording: str) -> Dataset:
    """Returns the runs of one recording."""
    return dataclasses.replace(joint, runs=tuple(run for run in joint.runs if run.recording == recording))


def own_name(run: str) -> str:
    """Returns the name of a run without the name of its recording."""
    return run.partition(_SEP)[2]


def since(joint: Dataset, before: str, after: str, run: str, at_s: float) -> Dataset:
    """Returns the recordings, but all samples of `after` up to the moment `at_s` of `run` now belong to `before`.

    `run` is cut in two at this moment. The later piece starts from the measured state at the moment.
    """
    runs: list[Run] = []
    begun = False
    for whole in joint.runs:
        if whole.recording != after:
            runs.append(whole)
        elif whole.name != run:
            runs.append(whole if begun else dataclasses.replace(whole, recording=before))
        else:
            begun = True
            cut = int((whole.time < at_s).sum())
            if cut > 1:
                runs.append(whole.rows(slice(0, cut), name=f"{whole.name}, to {at_s:g} s", recording=before))
            runs.append(whole.rows(slice(cut, None), name=f"{whole.name}, from {at_s:g} s", initial={}, gap_s=0.0))
    return dataclasses.replace(joint, runs=tuple(runs))


@dataclass(frozen=True)
class Onset:
    """The moment at which a difference begins.

    Attributes:
        run: the name of the run.
        at_s: the moment, s on the clock of the run.
        ci95: the first and the last moment of this run that explain the data about as well as `at_s`, s.
    """

    run: str
    at_s: float
    ci95: tuple[float, float]


def suspected(data: Residual, old: Model, recording: str) -> Onset | None:
    """Returns the moment from which on the old model's error in a recording is larger than usual; None: no moment.

    Args:
        data: the residual; its floors say how large a usual error is.
    """
    error, gains = data.error(old), np.zeros(len(data.measured))
    for signal in data.signals:
        own, usual = data.rows_of(recording, signal), data.floor(signal)
        if own.any():
            large = scale_of_rest(error[own], usual)
            squares = np.clip(error[own] / usual, -_FAR * large / usual, _FAR * large / usual) ** 2
            gains[own] = (squares * (1 - (usual / large) ** 2)) / 2 - np.log(large / usual)
    return _onset(data, gains / _correlated(data, error, recording), recording)


def onset(data: Residual, old: Model, changed: Model, recording: str) -> Onset | None:
    """Returns the moment from which on `changed` explains a recording better than `old`; None: from the start.

    Args:
        data: the residual; its floors say how large a usual error is.
        changed: the model of the data after the change.
    """
    error = data.error(old)
    by_value = Judge(data, np.arange(len(error)), len(error), 0.0)
    gains = by_value.rises(error, data.error(changed))
    return _onset(data, gains / _correlated(data, error, recording), recording)


def _correlated(data: Residual, error: Array, recording: str) -> float:
    """Returns the longest correlation time, in values, of any signal's error outside the recording `recording`.

    Inside the recording, the change itself makes the error correlated.
    """
    outside = np.where(data.rows_of(recording), np.nan, error)
    longest = 1.0
    for signal in data.signals:
        parts = [np.clip(part / data.floor(signal), -_FAR, _FAR) for part in data.parts(outside, signal)]
        known = [part for part in parts if np.isfinite(part).all()]
        if known:
            longest = max(longest, correlation_time(known, about_mean=False))
    return longest


def _onset(data: Residual, gains: Array, recording: str) -> Onset | None:
    """Returns the moment from which the sum of `gains`, (values,), to the end is largest; None: it may be chance."""
    stretch, count = data.stretches(_STEP_S)
    here = data.rows_of(recording)
    total = np.bincount(stretch[here], gains[here], count)
    place: dict[int, tuple[str, float]] = {}  # number of a stretch -> its run, and its first time on the run's clock
    for block in data.blocks:
        numbers_of = stretch[block.place]
        for number in np.unique(numbers_of[here[block.place]]).tolist():
            first = float(block.middle[numbers_of == number].min())
            place[number] = (run_of(block.run), min(first, place.get(number, ("", np.inf))[1]))
    order = list(dict.fromkeys(run_of(run.name) for run in data.replay.dataset.runs))
    moments = sorted(place, key=lambda number: (order.index(place[number][0]), place[number][1]))
    if len(moments) < 2:
        return None
    rest = np.cumsum(total[moments][::-1])[::-1]  # from each moment to the end
    best = int(np.argmax(rest))
    if rest[best] - rest[0] < numbers.CHANCE_NATS + np.log(len(moments)):  # any of the moments may win by chance
        return None
    run, at_s = place[moments[best]]
    near = [
        place[moment][1]
        for moment, gain in zip(moments, rest.tolist(), strict=True)
        if gain > rest[best] - numbers.CHANCE_NATS and place[moment][0] == run
    ]
    return Onset(run, at_s, (min(near), max(near)))


def sd_between_recordings(data: Residual, best: Explanation, part: Difference, correlated: float) -> float:
    """Returns the sd of the difference of a value between two recordings of an unchanged machine, in the value's unit.

    The value is the first free value of `part`; it is fitted to each run separately. If the values of the runs scatter
    more than their uncertainty explains, the rest is the spread between runs (random effects: DerSimonian & Laird 1986,
    Controlled Clinical Trials 7). A recording's value is the mean over its runs. The sd is 0 if there are too few runs,
    or if the value cannot be negative.

    Args:
        data: the residual of both recordings.
        correlated: the correlation time of the residual, in values.
    """
    key = part.free[0]
    info = part.infos[key]
    recordings = {run_of(run.name): run.recording for run in data.replay.dataset.runs if run.name in data.runs}
    groups: dict[str, list[str]] = {}
    for run, recording in recordings.items():
        groups.setdefault(recording, []).append(run)
    if info.minimum >= 0 or sum(len(runs) - 1 for runs in groups.values()) < _LEAST_DEGREES:
        return 0.0
    by_run = {
        kind: {run: table.get(recording, 0.0) for run, recording in recordings.items()}
        for kind, table in best.model.by_run.items()
    }
    model = dataclasses.replace(best.model, by_run=by_run)
    plan = Plan(model, tuple(Free(f"{key}@{run}", info, None, unit=info.trial) for run in recordings), ())
    problem = Problem(_run_by_run(data), plan)
    fitted = fit(problem, (), plan, plan.start(), ROUGH)
    if fitted is None:
        return 0.0
    count = len(data.measured)
    slopes = problem.jacobian(fitted.point)[:count]
    information = np.sum(slopes**2, axis=0) / (max(2 * fitted.cost / count, 1.0) * correlated)
    values = dict(zip(recordings, zip(fitted.point.tolist(), information.tolist(), strict=True), strict=True))
    return info.trial * spread_of([[values[run] for run in runs] for runs in groups.values()])


def _run_by_run(data: Residual) -> Residual:
    """Returns the same residual, but each run is a separate recording that has the name of the run."""
    runs = tuple(dataclasses.replace(run, recording=run_of(run.name)) for run in data.replay.dataset.runs)
    dataset = dataclasses.replace(data.replay.dataset, runs=runs)
    return data.with_inputs(dataclasses.replace(data.replay, dataset=dataset))


def spread_of(groups: list[list[tuple[float, float]]]) -> float:
    """Returns the sd of the difference between the means of two groups of runs of an unchanged machine.

    Args:
        groups: for each recording, the value and the information (1 / variance) of each run.
    """
    return float(np.sqrt(variance_between(groups) * sum(1 / len(group) for group in groups)))


def variance_between(groups: Sequence[Sequence[tuple[float, float]]]) -> float:
    """Returns the part of a value's variance within a group that the uncertainty of the members does not explain.

    Source: DerSimonian & Laird 1986, eq. 8, summed over the groups.

    Args:
        groups: the value and the information (1 / variance) of each member.
    """
    excess = weight = 0.0
    for group in groups:
        values, known = np.array(group).T
        if len(values) > 1 and known.sum() > 0:
            mean = float(known @ values / known.sum())
            excess += float(known @ (values - mean) ** 2) - (len(values) - 1)
            weight += float(known.sum() - known @ known / known.sum())
    return max(excess / weight, 0.0) if weight > 0 else 0.0
