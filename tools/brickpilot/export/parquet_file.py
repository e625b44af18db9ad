"""A run as Parquet: the columns of log.csv and of ticks.csv, each with its unit."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

from brickpilot.export.run_read import Array, Run, unit


def tables(run: Run) -> dict[str, bytes]:
    """Returns ending of the file's name -> Parquet file: that of the log, and `-ticks` of a flight over a link.

    The metadata of a column has its `unit`; that of the log's table has `summary.json`.
    """
    found = {"": _file(run.log, {"summary.json": run.summary})}
    return found | ({"-ticks": _file(run.ticks, {})} if run.ticks else {})


def _file(columns: Mapping[str, Array], more: Mapping[str, bytes]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields: list[Any] = [pa.field(name, pa.float64(), metadata={"unit": unit(name)}) for name in columns]
    table = pa.table(list(columns.values()), schema=pa.schema(fields, metadata=dict(more)))
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()
