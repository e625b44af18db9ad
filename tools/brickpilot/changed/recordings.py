"""Recordings of one machine as one data set, in which each run has the name of its recording."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from brickpilot.data.dataset import Dataset, Run, with_all_runs
from brickpilot.data.motion import run_of
from brickpilot.errors import InputError
from brickpilot.fit.residual import Residual

_SEP = ": "  # between the names of a recording and of its run


def together(recordings: Mapping[str, Dataset]) -> Dataset:
    """Returns the runs of all recordings as fit runs of one data set, which is otherwise like the first recording.

    Other nominal values of a later recording are left out, because the data have to show what differs. A note says so.

    Args:
        recordings: name -> data set. A name contains no "@" and no ": ", and no run has the same name.

    Raises:
        InputError: a recording is of another vehicle, or has another input timing.
    """
    first, *others = recordings.values()
    notes = []
    for one in others:
        if one.vehicle != first.vehicle:
            raise InputError(f"is of a {one.vehicle}, {first.path} of a {first.vehicle}", file=one.path)
        if one.input_timing != first.input_timing:
            message = f"is {one.input_timing!r}, and that of {first.path} is {first.input_timing!r}"
            raise InputError(message, file=one.path, field="input_timing")
        if (one.nominal, one.nominal_effects) != (first.nominal, first.nominal_effects):
            notes.append(f"The nominal values of {first.name} are used: {one.name} states others.")
    joint = with_all_runs({f"{name}{_SEP}": one for name, one in recordings.items()})
    runs = (dataclasses.replace(run, role="fit", recording=run.name.partition(_SEP)[0]) for run in joint.runs)
    return dataclasses.replace(joint, runs=tuple(runs), notes=(*joint.notes, *notes))


def only(joint: Dataset, recording: str) -> Dataset:
    """Returns the runs of one recording."""
    return dataclasses.replace(joint, runs=tuple(run for run in joint.runs if run.recording == recording))


def own_name(run: str) -> str:
    """Returns the name that a run has in its own recording."""
    return run.partition(_SEP)[2]


def run_by_run(data: Residual) -> Residual:
    """Returns the same values, with each run as a recording of its own, which has the name of the run."""
    runs = tuple(dataclasses.replace(run, recording=run_of(run.name)) for run in data.replay.dataset.runs)
    dataset = dataclasses.replace(data.replay.dataset, runs=runs)
    return data.with_inputs(dataclasses.replace(data.replay, dataset=dataset))


def since(joint: Dataset, before: str, after: str, run: str, at_s: float) -> Dataset:
    """Returns the recordings, with all samples of `after` before a moment of `run` moved to `before`.

    This run is cut in two. The second part starts from the measured state at the moment.
    """
    found: list[Run] = []
    begun = False
    for one in joint.runs:
        if one.recording != after:
            found.append(one)
            continue
        if one.name != run:
            found.append(one if begun else dataclasses.replace(one, recording=before))
            continue
        begun = True
        cut = int((one.time < at_s).sum())
        if cut > 1:
            found.append(_rows(one, slice(0, cut), name=f"{one.name}, to {at_s:g} s", recording=before))
        found.append(_rows(one, slice(cut, None), name=f"{one.name}, from {at_s:g} s", initial={}, gap_s=0.0))
    return dataclasses.replace(joint, runs=tuple(found))


def _rows(run: Run, rows: slice, **changes: object) -> Run:
    tables = {
        name: {signal: values[rows] for signal, values in getattr(run, name).items()}
        for name in ("inputs", "outputs", "raw_outputs")
    }
    return dataclasses.replace(run, time=run.time[rows], replicate_of=None, **tables, **changes)  # type: ignore[arg-type]
