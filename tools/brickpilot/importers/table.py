"""Plain tables of numbers, with or without a header, turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from brickpilot.data.rows import DELIMITERS, CsvFormat, read_columns
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers.mapping import parse_mapping, units_of
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write

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
    for signal, source in sources.items():
        if source.index is not None or not (header or (source.name.isascii() and source.name.isdigit())):
            raise InputError(f"{source.name} is not a column number from 0", field=f"--map {signal}")
    columns = {signal: source.name if header else int(source.name) for signal, source in sources.items()}
    names = run_names(files)
    layout = CsvFormat(delimiter, header)
    runs = [NewRun(run, read_columns(file, columns, layout).values) for run, file in zip(names, files, strict=True)]
    new = NewDataset(name or out.resolve().name, vehicle, frame, units_of(sources), runs, nominal or {})
    return write(new, out, files[0])
