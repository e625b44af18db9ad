"""Reads a run folder of `brickpilot run` or `hil`, and converts columns with their units to Parquet."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from brickpilot.errors import InputError

Array = NDArray[np.float64]

TIME = "time_s"
_UNITS = {
    "_rad_s": "rad/s", "_m_s2": "m/s^2", "_m_s": "m/s", "_rad": "rad", "_ms": "ms", "_m": "m", "_s": "s", "_a": "A",
    "_v": "V", "_c": "C",
}  # fmt: skip
"""Ending of a column's name -> the column's unit, longer endings first."""


@dataclass(frozen=True)
class Run:
    """The contents of a run folder.

    Attributes:
        log: column -> its values (rows,), as in log.csv.
        ticks: column -> its values (rows,), as in ticks.csv; empty: the run was not flown over a link.
        summary: the text of summary.json.
    """

    log: Mapping[str, Array]
    ticks: Mapping[str, Array]
    summary: bytes


def read(folder: Path) -> Run:
    """Returns the run in a folder.

    Raises:
        InputError: `folder` is no run folder, or a file in it is damaged.
    """
    if not (folder / "log.csv").is_file() or not (folder / "summary.json").is_file():
        raise InputError(
            "is no run folder: it has no log.csv with a summary.json, as `run` and `hil` write", file=folder
        )
    ticks = folder / "ticks.csv"
    return Run(_table(folder / "log.csv"), _table(ticks) if ticks.is_file() else {}, _bytes(folder / "summary.json"))


def unit(column: str) -> str:
    """Returns the unit that a column's name shows; 1 for a share, a count or a flag."""
    return next((unit for ending, unit in _UNITS.items() if column.endswith(ending)), "1")


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from error


def _check_whole(path: Path, content: bytes) -> None:
    """Raises InputError if a line has another number of cells than the header, or the last line has no line end.

    The check is needed: pandas fills a short line with NaN, and uses the first column as an index if all lines are
    longer than the header.
    """
    *lines, rest = content.split(b"\n")
    for number, line in enumerate(lines, 1):
        if line.count(b",") != lines[0].count(b","):
            have, wanted = (cells.count(b",") + 1 for cells in (line, lines[0]))
            raise InputError(f"is no table of numbers: {have} cells under {wanted} names", file=path, line=number)
    if rest:
        raise InputError("ends inside a line: it is cut off", file=path, line=len(lines) + 1)


def _table(path: Path) -> dict[str, Array]:
    """Returns the columns of a table of numbers, rounded to the nearest double. NaN counts as a number."""
    content = _bytes(path)
    _check_whole(path, content)
    try:
        frame = pd.read_csv(
            io.BytesIO(content),
            float_precision="round_trip",
            keep_default_na=False,
            na_values=["nan"],
            dtype=np.float64,
        )
    except ValueError as error:
        raise InputError(f"is no table of numbers: {error}", file=path) from error
    if len(frame) == 0 or TIME not in frame.columns:
        raise InputError(f"has no rows or no column {TIME}", file=path)
    times = frame[TIME].to_numpy()
    if not (np.isfinite(times).all() and (np.diff(times) >= 0).all() and times[0] >= 0):
        raise InputError("has times that fall or are not numbers", file=path, field=TIME)
    return {str(name): frame[name].to_numpy() for name in frame.columns}


def parquet_tables(run: Run) -> dict[str, bytes]:
    """Returns suffix of a file's name -> its bytes: "" for the log, "-ticks" for the ticks of a flight over a link.

    A column's metadata contain its `unit`; the metadata of the log's table contain `summary.json`.
    """
    tables = {"": _file(run.log, {"summary.json": run.summary})}
    return tables | ({"-ticks": _file(run.ticks, {})} if run.ticks else {})


def _file(columns: Mapping[str, Array], more: Mapping[str, bytes]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields: list[Any] = [pa.field(name, pa.float64(), metadata={"unit": unit(name)}) for name in columns]
    table = pa.table(list(columns.values()), schema=pa.schema(fields, metadata=dict(more)))
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()
