"""Reads measured data sets: a folder with `dataset.toml` and one text file of columns per run, or DataFrames.

The values are converted to SI and to the paper's frame. Channels that are certainly wired wrongly are mended, and
damaged samples become NaN. DataFrames get the same checks as files.
"""

from __future__ import annotations

import numbers
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from brickpilot.constants import MOTOR_STEP_S
from brickpilot.data.audit.audit import audit
from brickpilot.data.audit.fault import Fault
from brickpilot.data.audit.view import Channels
from brickpilot.data.audit.wiring import mended, miswired, with_counts
from brickpilot.data.audit.wiring_motion import Miswired
from brickpilot.data.dataset import PRESET_BATTERY_VOLTAGE, Dataset, Run, battery
from brickpilot.data.description import Description, Signal, describe
from brickpilot.data.input_timing import with_linear_inputs
from brickpilot.data.nominal import lengths
from brickpilot.data.rows import Columns, read_columns
from brickpilot.data.signals import SIGNALS, Array, Frame, to_frd
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.errors import InputError

if TYPE_CHECKING:
    import pandas

__all__ = ["Dataset", "channels_of", "read"]

Column = str | tuple[str, str] | Mapping[str, Any]
"""A signal's column: a name (SI unit); (name, unit); or a mapping of the keys that a data set's file may state."""

_LONGEST_RUN_S = 1e6
_ARGUMENTS = {"role": "roles"}  # key -> its argument in `Dataset.from_frames`, if the names differ


def read(folder: Path | str) -> Dataset:
    """Reads a data set.

    Args:
        folder: the data set's folder, or the dataset.toml in it.

    Raises:
        InputError: a file cannot be read or is wrong; the message names file, line and field.
    """
    path = Path(folder)
    try:
        if path.is_dir():
            path = path / "dataset.toml"
        if not path.is_file():
            raise InputError("no such data set: a folder with a dataset.toml is needed", file=path)
        if path.suffix.lower() != ".toml":
            other = "`brickpilot why` answers from a log, and `brickpilot import` makes a data set of it"
            raise InputError(f"is no data set; {other}", file=path)
    except (OSError, ValueError) as error:
        raise InputError("cannot be read", file=path) from error
    description = describe(TomlFile(path))

    def columns(run: Run, wanted: Mapping[str, str | int]) -> Columns:
        return read_columns(run.file, wanted, description.layout)

    return _checked(path, description, columns)


def _of_frames(
    frames: Mapping[str, pandas.DataFrame],
    signals: Mapping[str, Column] | None,
    of_runs: Mapping[str, Mapping[str, Any]],
    stated: Mapping[str, Any],
    floats: bool,
) -> Dataset:
    """Returns a data set of DataFrames; `Dataset.from_frames` documents the arguments and errors.

    Args:
        of_runs: key of a run's table in a data set's file -> run -> value.
        stated: top-level key of that file -> value; None: not stated.
    """
    toml = _tables(frames, signals, of_runs, stated)

    def columns(run: Run, wanted: Mapping[str, str | int]) -> Columns:
        read = _read_frame(run.file, frames[run.name], wanted)
        for signal, values in read.values.items():
            blank = np.isnan(values)
            if signal.startswith(("voltage", "reference")) and not floats and blank.any():
                message = "is NaN; say floats=True if the motor floats there"
                raise read.fault(message, int(np.argmax(blank)), signal)
        return read

    return _checked(Path(str(stated["name"])), describe(toml), columns)


Dataset._of_frames = staticmethod(_of_frames)


class _StatedTables(TomlFile):
    """The arguments of `Dataset.from_frames`, as the tables that a dataset.toml would hold. Errors name no file."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.path = Path("from_frames")
        self.data = _plain(data)
        self._lines = {}
        self._check_integers((), self.data)

    def file_beside(self, key: Key, value: object) -> Path:
        """Returns the run's name as errors show it, because a frame has no file."""
        return Path(f"run {value}")


@dataclass(frozen=True)
class _FrameColumns(Columns):
    """Columns of a DataFrame; its rows count from 0, as in `frame.iloc`."""

    def fault(self, message: str, row: int, field: str | None = None) -> InputError:
        """Returns the error that names the run, the row and the field."""
        return InputError(message, file=f"{self.source}, row {row}", field=field)


def _tables(
    frames: Mapping[str, pandas.DataFrame],
    signals: Mapping[str, Column] | None,
    of_runs: Mapping[str, Mapping[str, Any]],
    stated: Mapping[str, Any],
) -> _StatedTables:
    """Returns the tables that a dataset.toml for these frames would hold.

    Raises:
        InputError: there is no frame, a frame is no DataFrame, or an argument names an unknown run.
    """
    import pandas

    if not isinstance(frames, Mapping) or not frames:
        got = "an empty mapping" if isinstance(frames, Mapping) else f"a {type(frames).__name__}"
        raise InputError(f"got {got}: needs at least one run, {{name: DataFrame}}", field="from_frames")
    for name, frame in frames.items():
        if not isinstance(frame, pandas.DataFrame):
            raise InputError(f"is a {type(frame).__name__}, not a DataFrame", file=f"run {name}")
    for key, values in of_runs.items():
        argument = f"from_frames: {_ARGUMENTS.get(key, key)}"
        if not isinstance(values, Mapping):
            raise InputError(f"{values!r} is not a mapping of runs to values", field=argument)
        for name in values:
            if name not in frames:
                raise InputError(f"no run {name!r}; the runs are {', '.join(map(str, frames))}", field=argument)
    if signals is None:
        first = next(iter(frames.values()))
        signals = {name: name for name in SIGNALS if name in first.columns or name == first.index.name}
    columns = {"time": "time"} | dict(signals)
    runs = [
        {"name": name, "file": name} | {key: values[name] for key, values in of_runs.items() if name in values}
        for name in frames
    ]
    given = {key: value for key, value in stated.items() if value is not None}
    return _StatedTables(given | {"signals": {name: _signal(name, of) for name, of in columns.items()}, "runs": runs})


def _read_frame(run: Path, frame: pandas.DataFrame, wanted: Mapping[str, str | int]) -> _FrameColumns:
    """Returns the columns `wanted` (signal -> column) of a frame; a named index of the frame is a column, too.

    Raises:
        InputError: a missing or double column, a cell that is not a number, or no rows. The message names `run`.
    """
    names = [str(name) for name in frame.columns]
    if not len(frame):
        raise InputError("holds no rows of data", file=run)
    columns = _FrameColumns({}, range(len(frame)), run)
    for signal, column in wanted.items():
        count = names.count(str(column))
        if count > 1:
            raise InputError("column occurs more than once", file=run, field=str(column))
        if count == 1:
            cells = frame.iloc[:, names.index(str(column))]
        elif column == frame.index.name:
            cells = frame.index.to_series()
        else:
            raise InputError(f"no column {column!r} among {', '.join(names[:20])}", file=run, field=signal)
        columns.values[signal] = _numbers(columns, f"{signal} (column {column})", cells)
    return columns


def _signal(name: str, column: Column) -> dict[str, Any]:
    """Returns the table of a signal; an unknown signal is refused later, by the checks for files."""
    unit = SIGNALS[name].unit if name in SIGNALS else "1"
    if isinstance(column, Mapping):
        return {"unit": unit, **column}
    if isinstance(column, tuple) and len(column) == 2:
        return {"column": column[0], "unit": column[1]}
    return {"column": column, "unit": unit}


def _numbers(columns: _FrameColumns, field: str, cells: pandas.Series) -> Array:
    """Returns the cells as numbers; NaN where a cell is missing."""
    if cells.dtype.kind in "iuf":
        return np.array(cells.to_numpy(dtype=np.float64, na_value=np.nan))
    if cells.dtype.kind in "mM":
        raise InputError(f"holds {cells.dtype}; give it as a number", file=columns.source, field=field)
    missing = cells.isna().to_numpy()
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if missing[row]:
            continue
        if isinstance(cell, bool | np.bool_) or not isinstance(cell, numbers.Real):
            raise columns.fault(f"{str(cell)[:40]!r} is not a number (None or NaN: no value)", row, field)
        values[row] = float(cell)
    return values


def _plain(value: Any) -> Any:
    """Returns the value in the types of a TOML reader: dicts, lists, and numbers instead of numpy scalars."""
    if isinstance(value, Mapping):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def _checked(
    path: Path, description: Description, columns: Callable[[Run, Mapping[str, str | int]], Columns]
) -> Dataset:
    """Returns the audited data set; `columns` reads the columns of a run."""
    stated = description.dataset
    measured = [_run(run, stated, columns) for run in stated.runs]
    wiring, guessed, wired = _wired(measured, description)
    before = "kept as it is stated" if description.as_wired else "wiring"
    notes = [f"{before}: {fault.sentence}" for fault in wiring]
    wiring = () if description.as_wired else wiring
    nominal = lengths(stated.nominal, stated.vehicle)
    audited = audit(_channels(wired, stated), stated.signals, stated.frame, nominal)
    runs = [replace(run, outputs={**run.raw_outputs, **audited.outputs[run.name]}) for run in wired]
    order = [run.name for run in runs]
    whole = [
        Fault(run.name, name, fault.kind, float(run.time[0]), float(run.time[-1]), fault.factor)
        for run in measured for fault in wiring if fault.is_mended and fault.kind != "frozen" for name in fault.signals
    ]  # fmt: skip
    faults = sorted([*whole, *audited.faults], key=lambda fault: (order.index(fault.run), fault.from_s, fault.signal))
    fewer = [decimated(run) for run in runs]
    rows, kept = (sum(run.time.size for run in chosen) for chosen in (runs, fewer))
    merged = (
        f"{rows:,} rows become {kept:,}: the plant simulates its motors in steps of {1e3 * MOTOR_STEP_S:g} ms, and so "
        "cannot use faster rows; inputs are averaged"
    )
    if stated.input_timing == "linear":
        fewer = [with_linear_inputs(run) for run in fewer]
    dataset = replace(
        stated,
        path=path,
        runs=tuple(fewer),
        faults=tuple(faults),
        notes=(*notes, *stated.notes, *audited.notes, *([merged] if kept < rows else [])),
        wiring=wiring,
        guessed=guessed,
    )
    if not any(np.isfinite(values).any() for run in fewer for values in run.raw_outputs.values()):
        raise InputError("no output is measured: all outputs of all runs are blank", file=path, field="signals")
    empty = not any(np.isfinite(values).any() for run in fewer for values in run.outputs.values())
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


def _run(run: Run, stated: Dataset, read: Callable[[Run, Mapping[str, str | int]], Columns]) -> Run:
    """Returns a stated run with its samples."""
    columns = read(run, {name: signal.column for name, signal in stated.signals.items()})
    values = {name: _to_si(columns, stated.frame, signal) for name, signal in stated.signals.items()}
    _check_time(columns, values["time"])
    _check_duty(run.file, values)
    inputs, outputs = (
        {name: value for name, value in values.items() if SIGNALS[name].kind == kind} for kind in ("input", "output")
    )
    return replace(run, time=values["time"], inputs=inputs, outputs=outputs, raw_outputs=outputs)


def channels_of(run: Run) -> Channels:
    """Returns the channels of a run with the damaged samples as measured."""
    return Channels(run.time, run.inputs, run.raw_outputs)


def _channels(runs: list[Run], stated: Dataset) -> list[Channels]:
    """Returns the channels of runs, without the sensors for which the data set states an effect.

    Such an effect is no fault: an unsigned sensor, for example, contradicts the other channels whenever its wheel turns
    backward.
    """
    sound = {name for name, signal in stated.signals.items() if not signal.stated}

    def outputs(run: Run) -> dict[str, Array]:
        return {name: values for name, values in run.raw_outputs.items() if name in sound}

    return [Channels(run.time, run.inputs, outputs(run), run.name) for run in runs]


def _wired(runs: list[Run], description: Description) -> tuple[tuple[Miswired, ...], tuple[str, ...], list[Run]]:
    """Returns the wiring faults, the corrected guesses of numbers, and the runs in which sure faults are mended."""
    stated = description.dataset
    faults = miswired(_channels(runs, stated), lengths(stated.nominal, stated.vehicle))
    if description.as_wired:
        return tuple(replace(fault, is_open=True) for fault in faults), stated.guessed, runs
    faults, guessed = with_counts(faults, stated.guessed)
    if not any(fault.is_mended for fault in faults):
        return faults, guessed, runs
    right = []
    for run in runs:
        now = mended(channels_of(run), faults)
        right.append(replace(run, time=now.time, inputs=now.inputs, outputs=now.outputs, raw_outputs=now.outputs))
    return faults, guessed, right


def decimated(run: Run) -> Run:
    """Returns the run with rows merged to about one per motor step of the plant; a run with slower rows is unchanged.

    An input becomes the mean over the merged rows; if the motor floats in one of these rows, it floats in the new row.
    An output becomes the first reading in these rows, so that a channel with fewer readings than rows loses no reading.
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

    def reading(values: Array) -> Array:
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            return values[first]
        nearest = known[np.minimum(np.searchsorted(known, first), known.size - 1)]
        return np.where(group[nearest] == group[first], values[nearest], np.nan)

    return replace(
        run,
        time=run.time[first],
        inputs={name: np.add.reduceat(values, first) / rows for name, values in run.inputs.items()},
        outputs={name: reading(values) for name, values in run.outputs.items()},
        raw_outputs={name: reading(values) for name, values in run.raw_outputs.items()},
    )


def _to_si(columns: Columns, frame: Frame, signal: Signal) -> Array:
    """Returns a column in SI and the paper's frame; refuses infinite and unphysical values."""
    raw, kind, place = columns.values[signal.name], SIGNALS[signal.name], f"{signal.name} (column {signal.column})"
    with np.errstate(over="ignore", invalid="ignore"):
        values = signal.to_si * (signal.scale * raw + signal.offset)
        infinite = np.isinf(values) | (np.isnan(values) & ~np.isnan(raw))
        beyond = np.abs(values) > kind.largest
    if infinite.any():
        raise columns.fault("is too large for a number", int(np.argmax(infinite)), place)
    if beyond.any():
        row = int(np.argmax(beyond))
        message = f"{values[row]:.4g} {kind.unit} is beyond what is physical, {kind.largest:g}"
        raise columns.fault(message, row, place)
    return to_frd(signal.name, values, frame)


def _check_time(columns: Columns, time: Array) -> None:
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


def _check_duty(file: Path, values: Mapping[str, Array]) -> None:
    for name, duty in values.items():
        limit = 2.0 if name == "duty_diff" else 1.0
        driven = np.abs(duty[np.isfinite(duty) & (duty != 0.0)])
        if name.startswith("duty") and driven.size and np.median(driven) > limit * 1.01:
            raise InputError(f"is mostly beyond -{limit:g}..{limit:g}; is its unit percent?", file=file, field=name)
