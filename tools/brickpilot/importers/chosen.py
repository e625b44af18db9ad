"""Makes a data set of the channels that the user chose from a log. All readers of logs with channels end here."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers import table_log
from brickpilot.importers.channels import Channel, Log, Reader
from brickpilot.importers.formula import Formula, FormulaError, Place, Scaling
from brickpilot.importers.mapping import Mapped, Source, common_scalings, parse_mapping, read_formulas
from brickpilot.importers.split import parse_split
from brickpilot.importers.table import runs_of
from brickpilot.importers.time_base import aligned, columns
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write

_CLOCK = {"time": Source("time", "s")}
_NEAREST = 4  # names that an error proposes
_ALIKE = 0.4  # of difflib: the least likeness to the name


class ChannelImporter(Protocol):
    """The function of a row in the table of importers, for a kind of log with channels.

    It makes a data set of logs; each file becomes a run of the same name.

    Args:
        files: logs with the same channels.
        out: the new folder.
        mapping: ``SIGNAL=CHANNEL[:UNIT]``, or a formula of channels; the default unit is the one that the file states,
            or else the SI unit.
        vehicle, frame, nominal, name: as in a data set; the default name is that of the folder, and the default frame
            the one that wheels and yaw show.
        as_wired: whether nothing is mended that looks swapped, reversed or scaled wrongly.
        rate: rows per second; None: the rows are the samples of the fastest output.
        split: ``rests``, or ``FROM,TO`` in s of the log's clock, repeatable; a part becomes a run.
        cut: whether a file that ends inside a record is read without that record.

    Raises:
        InputError: naming file and channel, or the option. Nothing is written then.
    """

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
    ) -> Imported: ...


@dataclass(frozen=True)
class _Read:
    """The content of one log: its signals on common rows, signal -> unit, and notes."""

    signals: Mapped
    units: dict[str, str]
    notes: list[str]


def channel_importer(read: Reader) -> ChannelImporter:
    """Returns the importer of the logs that `read` reads."""

    def import_channels(
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
        check_out(out)
        sources = parse_mapping(mapping, has_time=True)
        hertz, names, spans = _rate(rate), run_names(files), parse_split(split)
        logs = [_signals(file, read, sources, hertz, cut) for file in files]
        for file, log in zip(files, logs, strict=True):
            if log.units != logs[0].units:
                raise InputError(f"states other units than {files[0]}; give them in --map", file=file)
        runs, notes = list[NewRun](), list[str]()
        for file, log, run in zip(files, logs, names, strict=True):
            whole = table_log.Log(file, log.signals, (), ())
            made, told = runs_of(whole, _CLOCK, spans, (run, f"{run}_" if len(files) > 1 else ""))
            runs += made
            notes += [f"{file.name}: {note}" for note in (*log.notes, *told)]
        new = NewDataset(
            name or out.resolve().name,
            vehicle,
            frame,
            logs[0].units,
            runs,
            nominal or {},
            notes,
            common_scalings([log.signals for log in logs], files),
            sources=sources,
            as_wired=as_wired,
        )
        return write(new, out, files[0])

    return import_channels


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


def _signals(file: Path, read: Reader, sources: Mapping[str, Source], rate: float | None, cut: bool) -> _Read:
    log = read(file, [source.text for source in sources.values()])
    if log.cut and not cut:
        raise InputError("ends inside a record; --cut reads it up to there", file=file)
    formulas = _formulas(log, read, sources)
    chosen, notes = {}, list(log.notes)
    for signal, formula in formulas.items():
        channels = {place: _channel(log, place) for place in formula.places}
        chosen[signal] = _value(file, signal, formula, channels, notes)
    units = {signal: unit_of(file, signal, formulas[signal], one, sources[signal]) for signal, one in chosen.items()}
    try:
        made, told = columns(chosen, rate)
    except InputError as error:
        raise InputError(str(error), file=file) from error
    scalings = {
        signal: formula.scaling for signal, formula in formulas.items() if formula.scaling not in (None, Scaling())
    }
    return _Read(Mapped(made, scalings), {"time": "s"} | units, notes + told)


def _formulas(log: Log, read: Reader, sources: Mapping[str, Source]) -> dict[str, Formula]:
    names = [*log.channels, *log.aliases]
    for signal, source in sources.items():
        try:
            unknown = [one for one in read_formulas({signal: source}, names)[signal].places if _name(one) not in names]
        except InputError:
            if any(name in source.text for name in names):
                raise
            unknown = [Place(source.text)]
        if unknown:
            raise _unknown(log.file, _name(unknown[0]), list(read(log.file, None).channels))
    return read_formulas(sources, names)


def _name(place: Place) -> str:
    return place.name if place.index is None else f"{place.name}[{place.index}]"


def _channel(log: Log, place: Place) -> Channel:
    return log.channels[log.aliases.get(_name(place), _name(place))]


def _unknown(file: Path, name: str, names: list[str]) -> InputError:
    near = difflib.get_close_matches(name, names, _NEAREST, _ALIKE)
    if near:
        return InputError(f"no channel {name!r}; the nearest are {', '.join(near)}", file=file)
    return InputError(f"no channel {name!r}; `brickpilot import --list {file}` shows them", file=file)


def _value(file: Path, signal: str, formula: Formula, channels: Mapping[Place, Channel], notes: list[str]) -> Channel:
    """Returns the cells of a signal with their times: a channel as logged, or the values of a formula of several."""
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
    """Returns the unit of the map, or else the file's unit if the channel is taken unchanged, or else SI.

    Raises:
        InputError: the file states a unit, and it does not fit the signal, or the formula is more than the channel.
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
