"""Plain tables of numbers, with or without a header, turned into a data set."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from brickpilot.data.rows import DELIMITERS, CsvFormat, read_columns
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers.formula import Place, unknown_name
from brickpilot.importers.mapping import Mapped, Source, common_scalings, parse_mapping, read_formulas, take, units_of
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write

_NUMBERS = [str(number) for number in range(1000)]
_SPELLINGS = {"tab": "\t", r"\t": "\t"}


def import_table(
    files: Sequence[Path],
    out: Path,
    mapping: Sequence[str],
    *,
    vehicle: Vehicle,
    frame: Frame = "FRD",
    delimiter: str = ",",
    header: bool = False,
    nominal: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Imported:
    """Makes a data set of tables; each file becomes a run of the same name.

    Args:
        files: text files with the same columns.
        out: the new folder.
        mapping: ``SIGNAL=COLUMN[:UNIT]``; a column is its number from 0, or its name where there is a header.
        vehicle, frame, nominal, name: as in a data set; the default name is that of the folder.
        delimiter: one of `data.rows.DELIMITERS`; ``tab`` and ``\\t`` (two characters) stand for a tab.
        header: whether the first line names the columns.

    Raises:
        InputError: naming file, line and column, or the option. Nothing is written then.
    """
    check_out(out)
    sources = parse_mapping(mapping)
    delimiter = _SPELLINGS.get(delimiter, delimiter)
    if delimiter not in DELIMITERS:
        message = f"{delimiter!r} is not one of comma, semicolon, tab (tab or \\t), blank and bar"
        raise InputError(message, field="--delimiter")
    names = run_names(files)
    layout = CsvFormat(delimiter, header)
    logs = [_signals(file, sources, layout) for file in files]
    runs = [NewRun(run, log.columns) for run, log in zip(names, logs, strict=True)]
    scalings = common_scalings(logs, files)
    new = NewDataset(
        name or out.resolve().name, vehicle, frame, units_of(sources), runs, nominal or {}, scalings=scalings
    )
    return write(new, out, files[0])


def _signals(file: Path, sources: Mapping[str, Source], layout: CsvFormat) -> Mapped:
    names = _header(file, layout) if layout.header else []
    formulas = read_formulas(sources, names or _NUMBERS)
    places = {place: signal for signal, formula in reversed(formulas.items()) for place in formula.places}
    keys = {place: signal if len(formulas[signal].places) == 1 else place.name for place, signal in places.items()}
    columns = {keys[place]: _column(place, signal, names, file, layout) for place, signal in places.items()}
    values = read_columns(file, columns, layout).values
    return take(formulas, lambda _, place: values[keys[place]], file)


def _header(file: Path, layout: CsvFormat) -> list[str]:
    with file.open(encoding="utf-8-sig", errors="replace") as text:
        return [name.strip() for name in next(csv.reader(text, delimiter=layout.delimiter, skipinitialspace=True), [])]


def _column(place: Place, signal: str, names: Sequence[str], file: Path, layout: CsvFormat) -> str | int:
    if layout.header and place.name not in names:
        raise InputError(unknown_name("column", place.name, names), file=file, line=1, field=signal)
    if layout.header:
        return place.name
    number = place.name.removeprefix("c")
    if place.index is not None or not (number.isascii() and number.isdigit()):
        raise InputError(f"{place.name} is not a column number from 0", field=f"--map {signal}")
    return int(number)
