"""Parquet files turned into a data set. pyarrow reads them; each holds a table, like the text files of `table`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers import table_log
from brickpilot.importers.channels import Channel, Log, Vector, check_file, is_wanted, libraries
from brickpilot.importers.chosen import unit_of
from brickpilot.importers.formula import Place, unknown_name
from brickpilot.importers.mapping import Mapped, Source, common_scalings, parse_mapping, read_formulas, take
from brickpilot.importers.split import parse_split
from brickpilot.importers.table import runs_of
from brickpilot.importers.writer import Imported, NewDataset, check_out, run_names, write


def import_parquet(
    files: Sequence[Path],
    out: Path,
    mapping: Sequence[str],
    *,
    vehicle: Vehicle,
    frame: Frame | None = None,
    as_wired: bool = False,
    split: Sequence[str] = (),
    nominal: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Imported:
    """Makes a data set of Parquet files; each file becomes a run of the same name.

    Args:
        files: Parquet files with the same columns.
        out: the new folder.
        mapping: ``SIGNAL=COLUMN[:UNIT]``, or a formula of columns; a field of a struct is ``column.field``. A column of
            time stamps is in s from its first value, a column of durations in s.
        vehicle, frame, nominal, name: as in a data set; the default name is that of the folder, and the default frame
            the one that wheels and yaw show.
        as_wired: whether nothing is mended that looks swapped, reversed or scaled wrongly.
        split: ``rests``, or ``FROM,TO`` in s of the log's clock, repeatable; a part becomes a run.

    Raises:
        InputError: naming file and column, or the option. Nothing is written then.
    """
    check_out(out)
    sources = parse_mapping(mapping)
    spans, names = parse_split(split), run_names(files)
    tables = [_signals(file, sources) for file in files]
    for file, (_, units) in zip(files, tables, strict=True):
        if units != tables[0][1]:
            raise InputError(f"states other units than {files[0]}; give them in --map", file=file)
    logs = [log for log, _ in tables]
    clock = {"time": Source("time", tables[0][1]["time"])}
    whole = [table_log.Log(file, log, (), ()) for file, log in zip(files, logs, strict=True)]
    runs, notes = runs_of(whole, clock, spans, names)
    scalings = common_scalings(logs, files)
    new = NewDataset(name or out.resolve().name, vehicle, frame, tables[0][1], runs, nominal or {}, notes, scalings,
                     sources=sources, as_wired=as_wired)  # fmt: skip
    return write(new, out, files[0])


def _signals(file: Path, sources: Mapping[str, Source]) -> tuple[Mapped, dict[str, str]]:
    """Returns the signals, and signal -> unit."""
    log = read(file, [source.text for source in sources.values()])
    known = list(log.channels)
    formulas = read_formulas(sources, known)

    def column(signal: str, place: Place) -> Vector:
        if place.index is not None or place.name not in log.channels:
            text = place.name if place.index is None else f"{place.name}[{place.index}]"
            raise InputError(unknown_name("column", text, read(file).channels), file=file, field=signal)
        return log.channels[place.name].values

    mapped = take(formulas, column, file)
    units = {
        signal: unit_of(file, signal, formula, log.channels[formula.places[0].name], sources[signal])
        for signal, formula in formulas.items()
    }
    return mapped, units


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the columns that hold numbers, times or truth values.

    Raises:
        InputError: no such file, or no Parquet file.
    """
    check_file(file, b"PAR1", "a Parquet file")
    with libraries("parquet"):
        import pyarrow as arrow
        from pyarrow import parquet
    try:
        content = parquet.ParquetFile(file)
        top = [name for name in content.schema_arrow.names if is_wanted(name, texts)]
        table = content.read(columns=top)
    except (arrow.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"is a damaged Parquet file: {error}", file=file) from error
    while any(arrow.types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    channels = list(_channels(table, arrow))
    others = sorted(set(table.column_names) - {one.name for one in channels})
    notes = (f"without numbers: {', '.join(others)}",) if others and texts is None else ()
    return Log(file, {one.name: one for one in channels}, notes=notes)


def _channels(table: Any, arrow: Any) -> Iterator[Channel]:
    types = arrow.types
    for field, column in zip(table.schema, table.columns, strict=True):
        kind = field.type
        if types.is_timestamp(kind) or types.is_duration(kind):
            ticks = column.cast(arrow.int64()).combine_chunks()
            if types.is_timestamp(kind) and len(ticks):
                ticks = arrow.compute.subtract(ticks, arrow.compute.min(ticks))
            per_second = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
            yield Channel(field.name, str(kind), None, _floats(ticks, arrow) / per_second, "s")
        elif types.is_boolean(kind) or types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            yield Channel(field.name, str(kind), None, _floats(column, arrow), _unit(field))


def _floats(column: Any, arrow: Any) -> Vector:
    """Returns numbers; NaN where null."""
    if arrow.types.is_boolean(column.type):
        column = column.cast(arrow.int8())
    return np.asarray(column.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False), dtype=np.float64)


def _unit(field: Any) -> str | None:
    stated = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
    return stated or None
