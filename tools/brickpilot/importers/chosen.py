"""Makes a data set of the signals that the user chose from logs. An importer without ``import_KIND`` uses this module.

Channels with different times are put into the rows of one table.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, Reader, Vector, in_order
from brickpilot.importers.mapping import (
    Formula,
    FormulaError,
    Signals,
    Source,
    common_scalings,
    parse_mapping,
    read_formulas,
    scalings_of,
    take,
    unknown_name,
)
from brickpilot.importers.split import parse_split, runs_of
from brickpilot.importers.writer import NewDataset, NewRun, run_names

_NEAREST = 4  # largest number of names that an error proposes
_ALIKE = 0.4  # least similarity by difflib of a proposed name to the wrong name


def channels_dataset(
    read: Reader,
    files: Sequence[Path],
    mapping: Sequence[str] = (),
    *,
    vehicle: Vehicle,
    frame: Frame | None = None,
    as_wired: bool = False,
    rate: str | None = None,
    split: Sequence[str] | None = None,
    cut: bool = False,
) -> NewDataset:
    """Returns a data set of logs; each file becomes a run of the same name, or several runs if it is split.

    Args:
        read: reads one log.
        files: logs with the same channels, columns or variables.
        mapping: ``SIGNAL=CHANNEL[:UNIT]``, or a formula of channels; the default unit is the file's unit, or else the
            SI unit. The module for this kind of log describes the channels' names.
        vehicle, frame: the kind of vehicle, and the data set's frame; frame None: found from wheels and yaw.
        as_wired: whether channels that look swapped, reversed or scaled wrongly are left as they are.
        rate: rows per second, for channels with times; None: a row for each sample of the fastest output.
        split: ``rests``, or ``FROM,TO`` in s of the log's clock, repeatable; each piece becomes a run. Empty: a new run
            begins after each pause between rows. None: a file is always one run.
        cut: whether a file that ends inside a record is read without that record.

    Raises:
        InputError: the message names file and channel, or the option.
    """
    sources = parse_mapping(mapping, needs_time=False)
    hertz, names, spans = _rate(rate), run_names(files), parse_split(split or ())
    logs = [_signals(read, file, sources, hertz, cut) for file in files]
    units = logs[0].units
    for file, log in zip(files, logs, strict=True):
        if log.units != units:
            raise InputError(f"states other units than {files[0]}; give them in --map", file=file)
    if split is None:
        runs, notes = [NewRun(run, log.columns) for run, log in zip(names, logs, strict=True)], list[str]()
    else:
        runs, notes = runs_of(logs, spans, names)
    return NewDataset(
        vehicle, frame, units, runs, notes=notes, scalings=common_scalings(logs), sources=sources, as_wired=as_wired
    )


def _rate(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0 < rate < math.inf:
        raise InputError(f"{text!r} is not a number of rows per second", field="--rate")
    return rate


def _signals(read: Reader, file: Path, sources: Mapping[str, Source], rate: float | None, cut: bool) -> Signals:
    log = read(file, [source.text for source in sources.values()])
    if log.cut and not cut:
        raise InputError("ends inside a record; --cut reads it up to there", file=file)
    is_table = log.of != "channel"
    if is_table != ("time" in sources):
        own = "the samples of this log have times of their own: leave time out"
        raise InputError("time is not mapped" if is_table else own, field="--map")
    formulas = _formulas(log, read, sources)
    places = [place for formula in formulas.values() for place in formula.places]
    used = {place: log.channels[log.aliases.get(place, place)] for place in places}
    units = {
        signal: _unit(file, signal, formula, used[formula.places[0]], sources[signal])
        for signal, formula in formulas.items()
    }
    if is_table:
        cells = {place: channel.values for place, channel in used.items()}
        samples = cells[formulas["time"].places[0]].size
        for signal, formula in formulas.items():
            if wrong := [cells[place].size for place in formula.places if cells[place].size != samples]:
                raise InputError(f"has {wrong[0]} values where time has {samples}", file=file, field=signal)
        return Signals(file, *take(file, formulas, cells), units, log.notes)
    notes = list(log.notes)
    chosen = {signal: _value(file, signal, formula, used, notes) for signal, formula in formulas.items()}
    try:
        made, row_notes = columns(chosen, rate)
    except InputError as error:
        raise InputError(str(error), file=file) from error
    return Signals(file, made, scalings_of(formulas), {"time": "s"} | units, notes + row_notes)


def _formulas(log: Log, read: Reader, sources: Mapping[str, Source]) -> dict[str, Formula]:
    """Returns signal -> formula, after checking that the log has the channels of the formulas."""
    is_table = log.of != "channel"
    names = [*log.channels, *log.aliases]
    formulas: dict[str, Formula] = {}
    for signal, source in sources.items():
        try:
            formulas |= read_formulas({signal: source}, names)
            unknown = [place for place in formulas[signal].places if place not in names]
        except InputError:
            if is_table or any(name in source.text for name in names):
                raise
            unknown = [source.text]
        if unknown:
            message = _unknown(unknown[0], read(log.file, None))
            raise InputError(message, file=log.file, field=signal if is_table else None)
    return formulas


def _unknown(place: str, log: Log) -> str:
    """Returns the message that a log has no channel, column or variable `place`, with advice."""
    if log.of == "channel":
        near = difflib.get_close_matches(place, list(log.channels), _NEAREST, _ALIKE)
        advice = f"the nearest are {', '.join(near)}" if near else f"`brickpilot import --list {log.file}` shows them"
        return f"no channel {place!r}; {advice}"
    name, _, index = place.removesuffix("]").rpartition("[")
    if place in log.others:
        return f"{place!r} {log.others[place]}"
    if f"{place}[0]" in log.channels:
        return f"{place!r} is a matrix; name a column: {place}[0]"
    if f"{name}[0]" in log.channels:
        return f"{name!r} has no column {index}, counted from 0"
    return unknown_name(log.of, place, log.channels)


def _value(file: Path, signal: str, formula: Formula, channels: Mapping[str, Channel], notes: list[str]) -> Channel:
    """Returns the cells of a signal with their times: the cells of a channel as logged, or the values of a formula."""
    if formula.scaling is not None:
        return channels[formula.places[0]]
    time, values, shift = aligned([channels[place] for place in formula.places], SIGNALS[signal].kind == "input")
    if shift:
        notes.append(f"{signal} puts samples together that are up to {1e3 * shift:.3g} ms apart")
    try:
        return Channel(formula.text, "formula", time, formula.values(dict(zip(formula.places, values, strict=True))))
    except FormulaError as error:
        raise InputError(str(error), file=file, field=signal) from error


def _unit(file: Path, signal: str, formula: Formula, channel: Channel, source: Source) -> str:
    """Returns the unit that the user states; else the file's unit, if the channel is not scaled; else the SI unit.

    Raises:
        InputError: the file's unit does not fit the signal, or the formula changes the unit by scaling or joining.
    """
    if source.states_unit or channel.unit is None:
        return source.unit
    give = f"give one: {signal}={source.text}:UNIT"
    if formula.scaling is None or abs(formula.scaling.scale) != 1.0 or formula.scaling.offset:
        raise InputError(
            f"{channel.name} is in {channel.unit}, and so the formula has no clear unit; {give}", file=file
        )
    try:
        si_factor(channel.unit, SIGNALS[signal].unit)
    except ValueError as error:
        raise InputError(f"{channel.name} states a unit that does not fit: {error}; {give}", file=file) from error
    return channel.unit


_SAME = 0.01  # limit, as a share of a row's duration: a note names a larger shift of a sample to its row
_ROWS = 10_000_000  # a table with more rows is refused: --rate is too high


def columns(channels: Mapping[str, Channel], rate: float | None) -> tuple[dict[str, Vector], list[str]]:
    """Returns signal -> values on common rows, with `time`, and notes for the user.

    The rows are at the times of the output with most samples, or at `rate`. A sample of an output is put into the row
    nearest to its time, at most half a row away; the other rows are blank, because nothing is interpolated. An input is
    held until it changes. Without `rate`, a row is added where an input changes between two rows; measured signals are
    blank there. With `rate`, an input changes in the nearest row. In the first row, all inputs are known.

    Args:
        channels: signal -> channel with times; at least one signal is an output.
        rate: rows per second; None: a row for each sample of the fastest output.

    Raises:
        InputError: there is no output or no row, or a channel has no samples.
    """
    tracks = {signal: _track(channel) for signal, channel in channels.items()}
    inputs = {signal: track for signal, track in tracks.items() if SIGNALS[signal].kind == "input"}
    outputs = {signal: track for signal, track in tracks.items() if SIGNALS[signal].kind == "output"}
    if not outputs:
        raise InputError("no output is mapped, so that there is nothing to compare with a simulation", field="--map")
    rows = _rows(outputs, rate)
    half = 0.5 * _step(rows)
    late = half if rate is not None else _SAME * 2 * half
    rows = rows[rows > max((time[0] for time, _ in inputs.values()), default=-np.inf) - late]
    if rows.size < 2:
        raise InputError("inputs and outputs share fewer than two rows of time", field="--map")
    changes = _changes(inputs, rows, late) if rate is None else np.empty(0)
    with_changes = np.union1d(rows, changes)
    measured = np.searchsorted(with_changes, rows)
    notes = [f"{changes.size} rows are added where an input changes between two rows"] if changes.size else []
    made: dict[str, Vector] = {"time": with_changes}
    for signal in channels:
        time, values = tracks[signal]
        if signal in inputs:
            made[signal] = _held(time, values, with_changes, late)
            continue
        made[signal] = np.full(with_changes.size, np.nan)
        made[signal][measured], shift = _placed(time, values, rows, half)
        if shift > _SAME * 2 * half:
            notes.append(f"{signal} is up to {1e3 * shift:.3g} ms from the time of its row; --rate gives finer rows")
    return made, notes


def _changes(inputs: Mapping[str, tuple[Vector, Vector]], rows: Vector, late: float) -> Vector:
    """Returns the times at which an input changes between two rows, without times within `late` s of a row."""
    times = [np.empty(0)]
    for time, values in inputs.values():
        same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
        times.append(time[1:][~same])
    at = np.unique(np.concatenate(times))
    at = at[(at > rows[0]) & (at < rows[-1])]
    right = np.searchsorted(rows, at)
    at = at[(at - rows[right - 1] > late) & (rows[right] - at > late)]
    alone: Vector = at[np.diff(at, prepend=-np.inf) > late]  # inputs that change together get one row
    return alone


def aligned(channels: Sequence[Channel], held: bool) -> tuple[Vector, list[Vector], float]:
    """Returns the times of the fastest channel, each channel's values at these times, and the largest shift in s.

    `held`: a value, such as a command, is held until the next value. Otherwise a value is put at the nearest time, and
    the other times are blank.
    """
    tracks = [_track(channel) for channel in channels]
    rows = max((time for time, _ in tracks), key=lambda time: time.size)
    half = 0.5 * _step(rows)
    values, shifts = [], [0.0]
    for time, samples in tracks:
        if held:
            values.append(_held(time, samples, rows, half))
        else:
            column, shift = _placed(time, samples, rows, half)
            values.append(column)
            shifts.append(shift)
    shift = max(shifts)
    return rows, values, shift if shift > _SAME * 2 * half else 0.0


def _track(channel: Channel) -> tuple[Vector, Vector]:
    assert channel.time is not None
    finite = np.isfinite(channel.time)
    if not finite.any():
        raise InputError(f"channel {channel.name!r} has no samples")
    return in_order(channel.time[finite], channel.values[finite])


def _rows(outputs: Mapping[str, tuple[Vector, Vector]], rate: float | None) -> Vector:
    if rate is None:
        return max((time for time, _ in outputs.values()), key=lambda time: time.size)
    first = min(time[0] for time, _ in outputs.values())
    last = max(time[-1] for time, _ in outputs.values())
    if (last - first) * rate > _ROWS:
        raise InputError(f"would make more than {_ROWS:,} rows", field="--rate")
    return np.asarray(first + np.arange(int(np.floor((last - first) * rate)) + 1) / rate)


def _step(rows: Vector) -> float:
    return float(np.median(np.diff(rows))) if rows.size > 1 else 0.0


def _held(time: Vector, values: Vector, rows: Vector, half: float) -> Vector:
    """Returns a value for each row: the last sample before (the row's time + `half`); NaN before the first sample."""
    last = np.searchsorted(time, rows + half, side="left") - 1
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def _placed(time: Vector, values: Vector, rows: Vector, half: float) -> tuple[Vector, float]:
    """Returns a column with each value in the row nearest to its time, and the largest distance from a row in s."""
    column = np.full(rows.size, np.nan)
    right = np.clip(np.searchsorted(rows, time), 1, rows.size - 1)
    nearest = np.where(time - rows[right - 1] <= rows[right] - time, right - 1, right)
    distance = np.abs(time - rows[nearest])
    far_first = np.argsort(-distance, kind="stable")  # the sample nearest to a row is written last and so is kept
    kept = far_first[distance[far_first] <= half * (1 + 1e-9)]
    column[nearest[kept]] = values[kept]
    return column, float(distance[kept].max()) if kept.size else 0.0
