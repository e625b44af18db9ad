"""Tables of numbers in text files, as loggers write them, turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.input_timing import InputTiming
from brickpilot.data.rows import DELIMITERS
from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.formula import Scaling
from brickpilot.importers.guess import Guess, guess
from brickpilot.importers.mapping import Source, common_scalings, parse_mapping, units_of
from brickpilot.importers.split import manoeuvres, parse_split, pauses, split_log
from brickpilot.importers.table_log import Log, joined, read_log
from brickpilot.importers.text_table import TextTable, read_table
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write

Vector = NDArray[np.float64]

_SPELLINGS = {"tab": "\t", r"\t": "\t"}


def import_table(
    files: Sequence[Path],
    out: Path,
    mapping: Sequence[str] = (),
    *,
    vehicle: Vehicle | None = None,
    frame: Frame | None = None,
    as_wired: bool = False,
    delimiter: str | None = None,
    header: bool = False,
    guessed: bool = False,
    split: Sequence[str] = (),
    inputs: str | None = None,
    input_timing: InputTiming = "held",
    nominal: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Imported:
    """Makes a data set of tables; a file becomes a run of the same name, or several runs if it is split.

    Args:
        files: text files with the same columns.
        out: the new folder.
        mapping: ``SIGNAL=COLUMN[:UNIT]`` or ``SIGNAL=FORMULA[:UNIT]``; a column is its name, or its number from 0.
        vehicle, frame, nominal, name: as in a data set; the default name is that of the folder, and the default frame
            the one that wheels and yaw show.
        as_wired: whether channels that look swapped, reversed or scaled wrongly are left as they are.
        delimiter: one of `data.rows.DELIMITERS`; ``tab`` and ``\\t`` (two characters) stand for a tab; None: found.
        header: whether the first line names the columns even if it looks like numbers.
        guessed: whether signals that `mapping` does not name, and the vehicle, are guessed from the first file.
        split: ``rests``, or ``FROM,TO`` in s of the log's clock, repeatable.
        inputs: a table of time and inputs, for a log that is slower than its commands.
        input_timing: what an input does between two rows; if ``unknown``, `check` and `discover` estimate it.

    Raises:
        InputError: the message names file, line and column, or the option. Nothing is written then.
    """
    check_out(out)
    spans = parse_split(split)
    delimiter = _delimiter(delimiter)
    names = run_names(files)
    if not guessed:
        parse_mapping(mapping)  # a fault in an option is reported before a fault in a file
    tables = [read_table(file, delimiter, header) for file in files]
    found = guess(tables[0], mapping, vehicle) if guessed else Guess(parse_mapping(mapping), vehicle)
    if found.vehicle is None:
        raise InputError("is needed to import a table, or --guess", field="--vehicle")
    sources = found.sources
    if inputs is None:
        logs = [read_log(table, sources) for table in tables]
    else:
        logs = _joined_logs(tables, sources, read_table(Path(inputs), delimiter, header))
    scalings = common_scalings([log.signals for log in logs], files)
    runs, told = runs_of(logs, sources, spans, names)
    notes = [*found.notes, *told]
    new = NewDataset(
        name or out.resolve().name, found.vehicle, frame, units_of(sources), runs, nominal or {}, notes, scalings,
        found.reasons, input_timing, sources, found.guessed, as_wired,
    )  # fmt: skip
    return write(new, out, files[0])


def _delimiter(text: str | None) -> str | None:
    delimiter = _SPELLINGS.get(text, text) if text is not None else None
    if delimiter is not None and delimiter not in DELIMITERS:
        message = f"{delimiter!r} is not one of comma, semicolon, tab (tab or \\t), blank and bar"
        raise InputError(message, field="--delimiter")
    return delimiter


def _joined_logs(tables: Sequence[TextTable], sources: Mapping[str, Source], inputs: TextTable) -> list[Log]:
    """Returns the logs with the inputs of a table of events."""
    if len(tables) > 1:
        raise InputError("belongs to one log; import one file at a time", field="--inputs")
    events = read_log(inputs, {name: one for name, one in sources.items() if SIGNALS[name].kind != "output"})
    measured = {name: one for name, one in sources.items() if SIGNALS[name].kind != "input"}
    return [joined(read_log(table, measured), events) for table in tables]


def runs_of(
    logs: Sequence[Log],
    sources: Mapping[str, Source],
    spans: Sequence[tuple[float, float]] | None,
    names: Sequence[str],
) -> tuple[list[NewRun], list[str]]:
    """Returns the runs of logs, and notes, each of which names its file.

    Args:
        logs: the logs' signals, with the time.
        sources: signal -> source, for the unit of time.
        spans: the result of `split.parse_split`.
        names: for each log, the name of the run of the whole log. With several logs, the names of a log's parts begin
            with it.
    """
    runs, notes = list[NewRun](), list[str]()
    for log, name in zip(logs, names, strict=True):
        made, told = _runs_of(log, sources, spans, (name, f"{name}_" if len(logs) > 1 else ""))
        runs += made
        notes += [f"{log.file.name}: {note}" for note in (*log.notes, *told)]
    return runs, notes


def _runs_of(
    log: Log, sources: Mapping[str, Source], spans: Sequence[tuple[float, float]] | None, names: tuple[str, str]
) -> tuple[list[NewRun], list[str]]:
    """Returns the runs of a log, and notes; `names`: the name of the whole log, and the prefix of its parts' names."""
    columns, scalings = log.signals.columns, log.signals.scalings
    signals = {name: _value(cells, scalings.get(name, Scaling())) for name, cells in columns.items()}
    time = signals.pop("time") * si_factor(sources["time"].unit, "s")
    whole, prefix = names
    runs: list[NewRun] = []
    before: int | None = None
    paused = pauses(time)
    for part in split_log(time, signals, sorted({*log.starts, *paused}), spans):
        first, last = part.rows.start, part.rows.stop - 1
        pause = None if before is None else float(time[first] - time[before])
        gap_s = None if pause is None or pause < 0.0 else round(pause, 6)
        cells = {name: values[part.rows] for name, values in columns.items()}
        runs.append(NewRun(f"{prefix}{part.name}" if part.name else whole, cells, gap_s))
        before = last
    notes = []
    if paused and not spans:
        longest = max(float(time[row] - time[row - 1]) for row in paused)
        notes.append(
            f"pauses between its rows: {len(paused)}, of {longest:.3g} s at most; a new run begins behind each"
        )
    return runs, notes + _split_notes(log, time, signals, spans, runs)


def _split_notes(
    log: Log, time: Vector, signals: Mapping[str, Vector], spans: Sequence[tuple[float, float]] | None,
    runs: Sequence[NewRun],
) -> list[str]:  # fmt: skip
    rows = sum(run.columns["time"].size for run in runs)
    if spans is None:
        return [f"it is split at its rests into {len(runs)} runs, which hold {rows} of {time.size} rows"]
    in_order = bool(np.all(np.diff(time) > 0.0))
    if not spans and in_order and (count := len(manoeuvres(time, signals))) > 1:
        return [f"it holds {count} manoeuvres with rests between them; --split rests makes a run of each"]
    return []


def _value(cells: Vector, scaling: Scaling) -> Vector:
    return scaling.scale * cells + scaling.offset
