"""Plain tables of numbers, with or without a header, turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from brickpilot.data.rows import DELIMITERS, CsvFormat, read_columns
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers.mapping import parse_mapping, units_of
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, write

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
    """Makes a data set of tables; each file is a run named after it.

    Args:
        files: text files, all laid out alike.
        out: the new folder.
        mapping: ``SIGNAL=COLUMN[:UNIT]``; a column is its number from 0, or its name where there is a header.
        vehicle, frame, nominal, name: as in a data set; the name is by default the folder's.
        delimiter: one of `dataset_rows.DELIMITERS`; ``tab`` and ``\\t`` (two characters) stand for a tab.
        header: whether the first line names the columns.

    Raises:
        InputError: naming file, line and column, or the option. Nothing is written then.
    """
    check_out(out)
    sources = parse_mapping(mapping)
    delimiter = _SPELLINGS.get(delimiter, delimiter)
    if delimiter not in DELIMITERS:
        message = f"{delimiter!r} is none of comma, semicolon, tab (tab or \\t), blank and bar"
        raise InputError(message, field="--delimiter")
    for signal, source in sources.items():
        if source.index is not None or not (header or (source.name.isascii() and source.name.isdigit())):
            raise InputError(f"{source.name} is no column number from 0", field=f"--map {signal}")
    columns = {signal: source.name if header else int(source.name) for signal, source in sources.items()}
    names = run_names(files)
    layout = CsvFormat(delimiter, header)
    runs = [NewRun(run, read_columns(file, columns, layout).values) for run, file in zip(names, files, strict=True)]
    new = NewDataset(name or out.resolve().name, vehicle, frame, units_of(sources), runs, nominal or {})
    return write(new, out, files[0])


def run_names(files: Sequence[Path]) -> list[str]:
    """One run name a file: the file's name without its ending.

    Raises:
        InputError: no file, or two of the same name.
    """
    if not files:
        raise InputError("no file to import", field="FILE")
    names = [file.stem for file in files]
    for position, name in enumerate(names):
        if name in names[:position]:
            raise InputError(f"two files would both make run {name!r}", file=files[position])
    return names
