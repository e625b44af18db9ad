"""Reads measured data sets: a folder with `dataset.toml` and one text file of columns per run, or DataFrames.

The values are converted to SI and to the paper's frame, channels that are surely wired wrongly are mended, and damaged
samples are blanked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import MOTOR_STEP_S
from brickpilot.data.audit.audit import audit
from brickpilot.data.audit.fault import Fault
from brickpilot.data.audit.view import Channels
from brickpilot.data.audit.wiring import mended, miswired, with_counts
from brickpilot.data.audit.wiring_motion import Miswired
from brickpilot.data.dataset import PRESET_BATTERY_VOLTAGE, Dataset, Run, battery
from brickpilot.data.description import Description, RunEntry, Signal, describe, described
from brickpilot.data.frames import Column, read_frame, tables
from brickpilot.data.input_timing import with_linear_inputs
from brickpilot.data.nominal import lengths
from brickpilot.data.rows import Columns, read_columns
from brickpilot.data.signals import SIGNALS, to_frd
from brickpilot.errors import InputError

if TYPE_CHECKING:
    import pandas

__all__ = ["Dataset", "channels_of", "read"]

Vector = NDArray[np.float64]

_LONGEST_RUN_S = 1e6


def read(folder: Path | str) -> Dataset:
    """Reads a data set.

    Args:
        folder: the data set's folder, or the dataset.toml in it.

    Raises:
        InputError: something is wrong; the message names file, line and field.
    """
    path = Path(folder)
    try:
        if path.is_dir():
            path = path / "dataset.toml"
        if not path.is_file():
            raise InputError("no such data set: a folder with a dataset.toml is needed", file=path)
        if path.suffix.lower() != ".toml":
            message = (
                "is no data set; `brickpilot why` answers from a log, and `brickpilot import` makes a data set of it"
            )
            raise InputError(message, file=path)
    except (OSError, ValueError) as error:
        raise InputError("cannot be read", file=path) from error
    description = describe(path)

    def columns(entry: RunEntry, wanted: Mapping[str, str | int]) -> Columns:
        return read_columns(entry.file, wanted, description.layout)

    return _checked(path, description, columns)


def _of_frames(
    frames: Mapping[str, pandas.DataFrame],
    signals: Mapping[str, Column] | None,
    of_runs: Mapping[str, Mapping[str, Any]],
    stated: Mapping[str, Any],
    floats: bool,
) -> Dataset:
    """Returns a data set of DataFrames; `Dataset.from_frames` has the arguments, an example, and the errors.

    Args:
        of_runs: statements on single runs, as their tables in a data set's file: key -> run -> value.
        stated: the top-level keys of that file.
    """
    toml = tables(frames, signals, of_runs, stated)

    def columns(entry: RunEntry, wanted: Mapping[str, str | int]) -> Columns:
        read = read_frame(entry.file, frames[entry.name], wanted)
        for signal in wanted:
            blank = np.isnan(read.values[signal])
            if signal.startswith(("voltage", "reference")) and not floats and blank.any():
                message = "is NaN; say floats=True if the motor floats there"
                raise read.fault(message, int(np.argmax(blank)), signal)
        return read

    return _checked(Path(str(stated["name"])), described(toml), columns)


Dataset._of_frames = staticmethod(_of_frames)


def _checked(
    path: Path, description: Description, columns: Callable[[RunEntry, Mapping[str, str | int]], Columns]
) -> Dataset:
    """Returns the audited data set; `columns` reads the columns of its runs."""
    measured = [_run(entry, description, columns) for entry in description.runs]
    wiring, guessed, wired = _wired(measured, description)
    kept = [f"kept as it is stated: {one.sentence}" for one in wiring if description.as_wired]
    wiring = () if description.as_wired else wiring
    runs, damaged, damage = _audited(wired, description)
    order = [run.name for run in runs]
    whole = [
        Fault(run.name, name, one.kind, float(run.time[0]), float(run.time[-1]), one.factor)
        for run in measured for one in wiring if one.is_mended and one.kind != "frozen" for name in one.signals
    ]  # fmt: skip
    faults = tuple(sorted([*whole, *damaged], key=lambda one: (order.index(one.run), one.from_s, one.signal)))
    runs, fewer = _decimated(runs)
    if description.input_timing == "linear":
        runs = tuple(with_linear_inputs(run) for run in runs)
    dataset = Dataset(
        name=description.name,
        path=path,
        vehicle=description.vehicle,
        frame=description.frame,
        signals=description.signals,
        nominal=description.nominal,
        nominal_effects=description.nominal_effects,
        runs=runs,
        gap_s=description.gap_s,
        faults=faults,
        notes=(*(f"wiring: {one.sentence}" for one in wiring), *kept, *description.notes, *damage, *fewer),
        input_timing=description.input_timing,
        wiring=wiring,
        guessed=guessed,
    )
    if not any(np.isfinite(values).any() for run in runs for values in run.raw_outputs.values()):
        raise InputError("no output is measured: all outputs of all runs are blank", file=path, field="signals")
    empty = not any(np.isfinite(values).any() for run in runs for values in run.outputs.values())
    none = ["no sound sample is left: every output of every run is damaged"] if empty else []
    return replace(dataset, notes=(*dataset.notes, *_battery_notes(dataset), *none))


def _battery_notes(dataset: Dataset) -> list[str]:
    if not any(name.startswith("duty") for name in dataset.signals):
        return []
    notes = []
    for run in dataset.runs:
        if repaired := battery(run, dataset)[1]:
            notes.append(f"run {run.name}: {repaired} battery readings were single-sample dropouts and were replaced")
    if "battery_voltage" not in dataset.signals and "battery_voltage" not in dataset.nominal:
        notes.append(f"no battery voltage is measured or stated: duty is multiplied by {PRESET_BATTERY_VOLTAGE:g} V")
    return notes


def _run(
    entry: RunEntry, description: Description, read: Callable[[RunEntry, Mapping[str, str | int]], Columns]
) -> Run:
    columns = read(entry, {name: signal.column for name, signal in description.signals.items()})
    values = {name: _to_si(columns, description, signal) for name, signal in description.signals.items()}
    _check_time(columns, values["time"])
    _check_duty(entry.file, values)
    outputs = {name: value for name, value in values.items() if SIGNALS[name].kind == "output"}
    return Run(
        name=entry.name,
        file=entry.file,
        role=entry.role,
        time=values["time"],
        inputs={name: value for name, value in values.items() if SIGNALS[name].kind == "input"},
        outputs=outputs,
        raw_outputs=outputs,
        gap_s=entry.gap_s,
        replicate_of=entry.replicate_of,
        initial=entry.initial,
    )


def channels_of(run: Run) -> Channels:
    """Returns the channels of a run with the damaged samples as measured."""
    return Channels(run.time, run.inputs, run.raw_outputs)


def _wired(runs: list[Run], description: Description) -> tuple[tuple[Miswired, ...], tuple[str, ...], list[Run]]:
    """Returns the wrong wiring in all runs, the guesses corrected by it, and the runs with sure faults mended."""
    channels = [Channels(run.time, run.inputs, _comparable(run, description)) for run in runs]
    nominal = lengths(description.nominal, description.vehicle)
    found = miswired(channels, nominal)
    if description.as_wired:
        return tuple(replace(one, is_open=True) for one in found), description.guessed, runs
    found, guessed = with_counts(found, description.guessed)
    if not any(one.is_mended for one in found):
        return found, guessed, runs
    right = [mended(channels_of(run), found) for run in runs]
    for one in right:
        for values in (one.time, *one.inputs.values(), *one.outputs.values()):
            values.setflags(write=False)
    return (
        found,
        guessed,
        [
            replace(run, time=one.time, inputs=one.inputs, outputs=one.outputs, raw_outputs=one.outputs)
            for run, one in zip(runs, right, strict=True)
        ],
    )


def _audited(runs: list[Run], description: Description) -> tuple[tuple[Run, ...], tuple[Fault, ...], tuple[str, ...]]:
    """Returns the runs with their damaged samples blanked, the faults, and the notes on them."""
    measured = [Channels(run.time, run.inputs, _comparable(run, description), run.name) for run in runs]
    nominal = lengths(description.nominal, description.vehicle)
    found = audit(measured, description.signals, description.frame, nominal)
    for outputs in found.outputs.values():
        for values in outputs.values():
            values.setflags(write=False)
    sound = [{**run.raw_outputs, **found.outputs[run.name]} for run in runs]
    audited = tuple(replace(run, outputs=outputs) for run, outputs in zip(runs, sound, strict=True))
    return audited, found.faults, found.notes


def _comparable(run: Run, description: Description) -> dict[str, Vector]:
    """Returns the outputs of a run, without sensors whose errors the data set states.

    For example, an unsigned sensor contradicts the other channels in each backward turn, but this is no fault.
    """
    return {name: values for name, values in run.raw_outputs.items() if not description.signals[name].stated}


def _decimated(runs: tuple[Run, ...]) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Returns the runs with no more rows than the plant can use, and a note if rows were merged.

    A simulation holds an input for at least a motor step, so faster rows only cost time and memory.
    """
    fewer = tuple(decimated(run) for run in runs)
    rows, kept = (sum(run.time.size for run in some) for some in (runs, fewer))
    note = (
        f"{rows:,} rows become {kept:,}: the plant moves its motors in steps of {1e3 * MOTOR_STEP_S:g} ms, and faster "
        "rows tell it nothing; inputs are averaged"
    )
    return fewer, (note,) if kept < rows else ()


def decimated(run: Run) -> Run:
    """Returns the run with rows merged to about one per motor step; the run itself if its rows are not faster.

    An input becomes the mean of its rows, and floats if it floats in one of them. An output is the first reading in
    these rows, so that a channel that is logged less often loses no reading.
    """
    step = float(np.median(np.diff(run.time)))
    together = int(MOTOR_STEP_S / step * (1 + 1e-6))
    if together < 2:
        return run
    group = np.floor((run.time - run.time[0]) / (together * step) + 1e-6).astype(np.int64)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    rows = np.diff(np.append(first, run.time.size))
    if first.size < 2:
        return run

    def mean(values: Vector) -> Vector:
        return _fixed(np.add.reduceat(values, first) / rows)

    def reading(values: Vector) -> Vector:
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            return _fixed(values[first])
        found = known[np.minimum(np.searchsorted(known, first), known.size - 1)]
        return _fixed(np.where(group[found] == group[first], values[found], np.nan))

    return replace(
        run,
        time=_fixed(run.time[first]),
        inputs={name: mean(values) for name, values in run.inputs.items()},
        outputs={name: reading(values) for name, values in run.outputs.items()},
        raw_outputs={name: reading(values) for name, values in run.raw_outputs.items()},
    )


def _fixed(values: Vector) -> Vector:
    values.setflags(write=False)
    return values


def _to_si(columns: Columns, description: Description, signal: Signal) -> Vector:
    raw = columns.values[signal.name]
    with np.errstate(over="ignore", invalid="ignore"):
        values = signal.to_si * (signal.scale * raw + signal.offset)
    beyond = np.isinf(values) | (np.isnan(values) & ~np.isnan(raw))
    if beyond.any():
        place = f"{signal.name} (column {signal.column})"
        raise columns.fault("is too large for a number", int(np.argmax(beyond)), place)
    limit = SIGNALS[signal.name].largest
    with np.errstate(invalid="ignore"):
        beyond = np.abs(values) > limit
    if beyond.any():
        row = int(np.argmax(beyond))
        message = f"{values[row]:.4g} {SIGNALS[signal.name].unit} is beyond what is physical, {limit:g}"
        place = f"{signal.name} (column {signal.column})"
        raise columns.fault(message, row, place)
    values = np.asarray(to_frd(signal.name, values, description.frame), dtype=np.float64)
    values.setflags(write=False)
    return values


def _check_time(columns: Columns, time: Vector) -> None:
    blank = np.isnan(time)
    if blank.any():
        raise columns.fault("is blank", int(np.argmax(blank)), "time")
    if time.size < 2:
        raise columns.fault("a run needs at least two samples", 0)
    stuck = np.diff(time) <= 0.0
    if stuck.any():
        row = int(np.argmax(stuck)) + 1
        message = f"does not increase: {time[row]:.9g} s after {time[row - 1]:.9g} s"
        raise columns.fault(message, row, "time")
    if (span := float(time[-1] - time[0])) > _LONGEST_RUN_S:
        message = f"a run of {span:.4g} s is longer than {_LONGEST_RUN_S:g} s; is the unit of time right?"
        raise columns.fault(message, time.size - 1, "time")


def _check_duty(file: Path, values: Mapping[str, Vector]) -> None:
    for name, duty in values.items():
        limit = 2.0 if name == "duty_diff" else 1.0
        driven = np.abs(duty[np.isfinite(duty) & (duty != 0.0)])
        if name.startswith("duty") and driven.size and np.median(driven) > limit * 1.01:
            raise InputError(f"is mostly beyond -{limit:g}..{limit:g}; is its unit percent?", file=file, field=name)
