"""Makes a data set of the signals that the user chose from logs. All readers except text and JSON use this module.

Channels with different times are put on the rows of one table.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, Reader, Vector, in_order
from brickpilot.importers.mapping import (
    Formula,
    FormulaError,
    Place,
    Signals,
    Source,
    common_scalings,
    parse_mapping,
    read_formulas,
    scalings_of,
)
from brickpilot.importers.split import parse_split, runs_of
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write

_NEAREST = 4  # largest number of names that an error proposes
_ALIKE = 0.4  # least similarity by difflib of a name that an error proposes


SignalReader = Callable[[Path, Mapping[str, Source], float | None, bool], Signals]
"""Function that reads the signals of a file: (file, signal -> source, rate, cut); see `SignalImporter`."""


def channel_importer(read: Reader) -> SignalImporter:
    """Returns the importer of logs whose channels have times of their own, which `read` reads."""
    return SignalImporter(partial(_signals, read), has_time=True)


@dataclass(frozen=True)
class SignalImporter:
    """The function that a row of `IMPORTERS` names, for a kind of log whose signals the user maps.

    Attributes:
        read: reads the signals of a file.
        has_time: whether the samples have their own times, so that the user maps no time.
        is_whole: whether a file is always one run; if not, a new run begins after each pause between rows.
    """

    read: SignalReader
    has_time: bool = False
    is_whole: bool = False

    def __call__(
        self,
        files: Sequence[Path],
        out: Path,
        mapping: Sequence[str],
        *,
        vehicle: Vehicle,
        frame: Frame | None = None,
        as_wired: bool = False,
        rate: str | None = None,
        split: Sequence[str] = (),
        cut: bool = False,
        nominal: Mapping[str, float] | None = None,
        name: str | None = None,
    ) -> Imported:
        """Makes a data set of logs; each file becomes a run of the same name, or several runs if it is split.

        Args:
            files: logs with the same channels, columns or variables.
            out: the new folder.
            mapping: ``SIGNAL=CHANNEL[:UNIT]``, or a formula of channels; the default unit is the file's unit, or else
                the SI unit. The module for this kind of log describes the channels' names.
            vehicle, frame, nominal, name: as in a data set; the default name is the folder's name, and the default
                frame is the frame that wheels and yaw show.
            as_wired: whether channels that look swapped, reversed or scaled wrongly are left as they are.
            rate: rows per second, for channels with times; None: a row for each sample of the fastest output.
            split: ``rests``, or one or more ``FROM,TO`` in s of the log's clock; each part becomes a run.
            cut: whether a file that ends inside a record is read without that record.

        Raises:
            InputError: the message names file and channel, or the option. Nothing is written then.
        """
        check_out(out)
        sources = parse_mapping(mapping, has_time=self.has_time)
        hertz, names, spans = _rate(rate), run_names(files), parse_split(split)
        logs = [self.read(file, sources, hertz, cut) for file in files]
        units = logs[0].units
        for file, log in zip(files, logs, strict=True):
            if log.units != units:
                raise InputError(f"states other units than {files[0]}; give them in --map", file=file)
        if self.is_whole:
            runs, notes = [NewRun(run, log.columns) for run, log in zip(names, logs, strict=True)], list[str]()
        else:
            runs, notes = runs_of(logs, spans, names)
        new = NewDataset(
            name or out.resolve().name,
            vehicle,
            frame,
            units,
            runs,
            nominal or {},
            notes,
            common_scalings(logs),
            sources=sources,
            as_wired=as_wired,
        )
        return write(new, out, files[0])


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
    formulas = _formulas(log, read, sources)
    chosen, notes = {}, list(log.notes)
    for signal, formula in formulas.items():
        channels = {place: log.channels[log.aliases.get(str(place), str(place))] for place in formula.places}
        chosen[signal] = _value(file, signal, formula, channels, notes)
    units = {}
    for signal, formula in formulas.items():
        first = str(formula.places[0])
        channel = log.channels[log.aliases.get(first, first)]
        units[signal] = unit_of(file, signal, formula, channel, sources[signal])
    try:
        made, row_notes = columns(chosen, rate)
    except InputError as error:
        raise InputError(str(error), file=file) from error
    return Signals(file, made, scalings_of(formulas), {"time": "s"} | units, notes + row_notes)


def _formulas(log: Log, read: Reader, sources: Mapping[str, Source]) -> dict[str, Formula]:
    names = [*log.channels, *log.aliases]
    for signal, source in sources.items():
        try:
            places = read_formulas({signal: source}, names)[signal].places
            unknown = [str(place) for place in places if str(place) not in names]
        except InputError:
            if any(name in source.text for name in names):
                raise
            unknown = [source.text]
        if unknown:
            near = difflib.get_close_matches(unknown[0], list(read(log.file, None).channels), _NEAREST, _ALIKE)
            advice = (
                f"the nearest are {', '.join(near)}" if near else f"`brickpilot import --list {log.file}` shows them"
            )
            raise InputError(f"no channel {unknown[0]!r}; {advice}", file=log.file)
    return read_formulas(sources, names)


def _value(file: Path, signal: str, formula: Formula, channels: Mapping[Place, Channel], notes: list[str]) -> Channel:
    """Returns the cells of a signal with their times: the cells of a channel as logged, or the values of a formula."""
    if formula.scaling is not None:
        return channels[formula.places[0]]
    time, values, shift = aligned(list(channels.values()), SIGNALS[signal].kind == "input")
    if shift:
        notes.append(f"{signal} puts samples together that are up to {1e3 * shift:.3g} ms apart")
    try:
        return Channel(formula.text, "formula", time, formula.values(dict(zip(channels, values, strict=True))))
    except FormulaError as error:
        raise InputError(str(error), file=file, field=signal) from error


def unit_of(file: Path, signal: str, formula: Formula, channel: Channel, source: Source) -> str:
    """Returns the unit that the user states; else the file's unit, if the channel is not scaled; else the SI unit.

    Raises:
        InputError: the file states a unit that does not fit the signal, or the formula scales or joins channels.
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


_SAME = 0.01  # least shift with a note, as a share of a row's duration
_ROWS = 10_000_000  # a table with more rows is refused: --rate is too high


def columns(channels: Mapping[str, Channel], rate: float | None) -> tuple[dict[str, Vector], list[str]]:
    """Returns signal -> values on common rows, with `time`, and notes for the user.

    The rows are the times of the output with most samples, or follow `rate`. A sample of an output is put into the row
    nearest to its time, at most half a row away; the other rows are blank, because nothing is interpolated. An input is
    held until it changes. Without `rate`, a row is added where an input changes between two rows; measured signals are
    blank there. With `rate`, an input changes in the nearest row. The first row is the first with all inputs known.

    Args:
        channels: signal -> channel with times, and with at least one output.
        rate: rows per second; None: a row for each sample of the fastest output.

    Raises:
        InputError: there is no output or no row, or a channel has no samples.
    """
    tracks = {signal: _track(one) for signal, one in channels.items()}
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
    """Returns the times at which an input changes between two rows, if they are more than `late` s from both rows."""
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

    A command is held. A measured value is put at the nearest time; at the other times it is blank.
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
    """Returns a value for each row: each sample is held from the row nearest to its time on. Before it, NaN."""
    last = np.searchsorted(time, rows + half, side="left") - 1
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def _placed(time: Vector, values: Vector, rows: Vector, half: float) -> tuple[Vector, float]:
    """Puts each value into the row nearest to its time; returns these rows and the largest distance in s."""
    column = np.full(rows.size, np.nan)
    right = np.clip(np.searchsorted(rows, time), 1, rows.size - 1)
    nearest = np.where(time - rows[right - 1] <= rows[right] - time, right - 1, right)
    distance = np.abs(time - rows[nearest])
    far_first = np.argsort(-distance, kind="stable")  # the sample nearest to a row is written last and so is kept
    kept = far_first[distance[far_first] <= half * (1 + 1e-9)]
    column[nearest[kept]] = values[kept]
    return column, float(distance[kept].max()) if kept.size else 0.0
