"""Recordings of one machine as one data set: each run knows the recording that it belongs to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.motion import run_of
from brickpilot.errors import InputError
from brickpilot.fit.residual import Residual

_SEP = ": "  # between a recording and its run


def together(recordings: Mapping[str, Dataset]) -> Dataset:
    """Returns the runs of all recordings, all to be fitted, as one data set that is else like the first one.

    Args:
        recordings: name -> data set. A name holds no "@" and is no name of a run.

    Raises:
        InputError: one is of another vehicle, or has other inputs.
    """
    first, *others = recordings.values()
    for one in others:
        if one.vehicle != first.vehicle:
            raise InputError(f"is of a {one.vehicle}, {first.path} of a {first.vehicle}", file=one.path)
    runs = [
        dataclasses.replace(
            run,
            name=f"{name}{_SEP}{run.name}",
            role="fit",
            recording=name,
            replicate_of=run.replicate_of and f"{name}{_SEP}{run.replicate_of}",
        )
        for name, dataset in recordings.items()
        for run in dataset.runs
    ]
    signals = {name: signal for one in reversed(list(recordings.values())) for name, signal in one.signals.items()}
    faults = [
        dataclasses.replace(fault, run=f"{name}{_SEP}{fault.run}")
        for name, one in recordings.items()
        for fault in one.faults
    ]
    return dataclasses.replace(first, runs=tuple(runs), signals=signals, faults=tuple(faults))


def only(joint: Dataset, recording: str) -> Dataset:
    """Returns the runs of one recording."""
    return dataclasses.replace(joint, runs=tuple(run for run in joint.runs if run.recording == recording))


def own_name(run: str) -> str:
    """Returns the name that a run has in its own recording."""
    return run.partition(_SEP)[2]


def run_by_run(data: Residual) -> Residual:
    """Returns the same values, in which each run is a recording of its own, of its own name."""
    runs = tuple(dataclasses.replace(run, recording=run_of(run.name)) for run in data.replay.dataset.runs)
    dataset = dataclasses.replace(data.replay.dataset, runs=runs)
    return data.with_inputs(dataclasses.replace(data.replay, dataset=dataset))


def since(joint: Dataset, before: str, after: str, run: str, at_s: float) -> Dataset:
    """Returns the recordings with what comes before a moment of a run of `after` as part of `before`.

    That run is cut in two. The second part starts from what was measured at the moment.
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
