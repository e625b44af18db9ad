"""Turns tables of numbers in loggers' text files into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from brickpilot.data.input_timing import InputTiming
from brickpilot.data.rows import DELIMITERS
from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log
from brickpilot.importers.guess import Guess, guess
from brickpilot.importers.mapping import Signals, Source, common_scalings, parse_mapping, units_of
from brickpilot.importers.split import parse_split, runs_of
from brickpilot.importers.table_log import joined, read_log
from brickpilot.importers.text_table import TextTable, read_table
from brickpilot.importers.writer import NewDataset, run_names

_SPELLINGS = {"tab": "\t", r"\t": "\t"}


def import_table(
    files: Sequence[Path],
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
) -> NewDataset:
    """Returns a data set of tables; a file becomes a run of the same name, or several runs if it is split.

    Args:
        files: text files with the same columns.
        mapping: ``SIGNAL=COLUMN[:UNIT]`` or ``SIGNAL=FORMULA[:UNIT]``; COLUMN is a name, or a number from 0 on.
        vehicle, frame: the kind of vehicle, and the data set's frame; frame None: found from wheels and yaw.
        as_wired: whether channels that look swapped, reversed or scaled wrongly are left as they are.
        delimiter: one of `data.rows.DELIMITERS`; ``tab`` and ``\\t`` (two characters) mean a tab; None: it is found.
        header: whether the first line names the columns even if it looks like numbers.
        guessed: whether signals that `mapping` does not name, and the vehicle, are guessed from the first file.
        split: ``rests``, or ``FROM,TO`` in s of the log's clock, repeatable.
        inputs: a file with a table of time and inputs, for a log that is slower than its commands.
        input_timing: how an input goes from one row to the next; ``unknown``: `check` and `discover` find it out.

    Raises:
        InputError: the message names file, line and column, or the option.
    """
    spans = parse_split(split)
    delimiter = _delimiter(delimiter)
    names = run_names(files)
    sources = parse_mapping(mapping, needs_time=not guessed)
    tables = [read_table(file, delimiter, header) for file in files]
    if guessed:
        chosen = guess(tables[0], sources, vehicle)
        sources = chosen.sources
    else:
        assert vehicle is not None  # `options_taken` refuses a call without vehicle and guess
        chosen = Guess(sources, vehicle)
    if inputs is None:
        logs = [read_log(table, sources) for table in tables]
    else:
        logs = _joined_logs(tables, sources, read_table(Path(inputs), delimiter, header))
    scalings = common_scalings(logs)
    runs, notes = runs_of(logs, spans, names)
    return NewDataset(
        chosen.vehicle, frame, units_of(sources), runs, notes=[*chosen.notes, *notes], scalings=scalings,
        reasons=chosen.reasons, input_timing=input_timing, sources=sources, guessed=chosen.guessed, as_wired=as_wired,
    )  # fmt: skip


def _delimiter(text: str | None) -> str | None:
    delimiter = _SPELLINGS.get(text, text) if text is not None else None
    if delimiter is not None and delimiter not in DELIMITERS:
        message = f"{delimiter!r} is not one of comma, semicolon, tab (tab or \\t), blank and bar"
        raise InputError(message, field="--delimiter")
    return delimiter


def _joined_logs(tables: Sequence[TextTable], sources: Mapping[str, Source], inputs: TextTable) -> list[Signals]:
    """Returns the log with its inputs taken from a table of events; there may be only one log."""
    if len(tables) > 1:
        raise InputError("belongs to one log; import one file at a time", field="--inputs")
    events = read_log(inputs, {name: source for name, source in sources.items() if SIGNALS[name].kind != "output"})
    measured = {name: source for name, source in sources.items() if SIGNALS[name].kind != "input"}
    return [joined(read_log(table, measured), events) for table in tables]


def read(file: Path) -> Log:
    """Reads the columns that hold numbers.

    Raises:
        InputError: there is no such file, or no table in the file.
    """
    table = read_table(file)
    channels: dict[str, Channel] = {}
    others = []
    for name in table.names:
        try:
            channels[name] = Channel(name, "number", None, table.column(name, name)[0])
        except InputError:
            others.append(name)
    notes = (f"without numbers: {', '.join(others)}",) if others else ()
    return Log(file, channels, notes=(*table.notes, *notes))
