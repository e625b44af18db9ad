"""Turns Parquet files into a data set; pyarrow reads them. Each file holds a table, like the text files of `table`.

A field of a struct is ``column.field``. Time stamps are converted to s since the earliest stamp of their column,
and durations to s.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import compute, parquet

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, Vector, by_name, check_file, is_wanted


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the columns that hold numbers, times or truth values.

    Raises:
        InputError: there is no such file, or it is no Parquet file.
    """
    check_file(file, b"PAR1", "a Parquet file")
    try:
        content = parquet.ParquetFile(file)
        top = [name for name in content.schema_arrow.names if is_wanted(name, texts)]
        table = content.read(columns=top)
    except (pyarrow.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"is a damaged Parquet file: {error}", file=file) from error
    while any(pyarrow.types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    channels = list(_channels(table))
    others = sorted(set(table.column_names) - {channel.name for channel in channels})
    notes = (f"without numbers: {', '.join(others)}",) if others and texts is None else ()
    return Log(file, by_name(channels), notes=notes, of="column")


def _channels(table: pyarrow.Table) -> Iterator[Channel]:
    types = pyarrow.types
    for field, column in zip(table.schema, table.columns, strict=True):
        kind = field.type
        if types.is_timestamp(kind) or types.is_duration(kind):
            ticks = column.cast(pyarrow.int64()).combine_chunks()
            if types.is_timestamp(kind) and len(ticks):
                ticks = compute.subtract(ticks, compute.min(ticks))
            per_second = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
            yield Channel(field.name, str(kind), None, _floats(ticks) / per_second, "s")
        elif types.is_boolean(kind) or types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            unit = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
            yield Channel(field.name, str(kind), None, _floats(column), unit or None)


def _floats(column: Any) -> Vector:
    """Returns the numbers of a column, with NaN for null."""
    if pyarrow.types.is_boolean(column.type):
        column = column.cast(pyarrow.int8())
    return np.asarray(column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False), dtype=np.float64)
