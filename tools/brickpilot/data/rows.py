"""Reads columns of numbers from a run's text file. Anything that is not a plain number is refused with its line."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.plain_rows import LONG_TEXT, read_plain
from brickpilot.errors import InputError

SIZE_LIMIT = 256 * 2**20
"""Bytes; a larger run file is refused before it is read."""

DELIMITERS = (",", ";", "\t", " ", "|")
"""A blank stands for any number of blanks and tabs; no cell can then be empty."""

_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\s*", re.ASCII).fullmatch


@dataclass(frozen=True)
class CsvFormat:
    """The layout of a data set's text files."""

    delimiter: str = ","
    header: bool = True


@dataclass(frozen=True)
class Columns:
    """Columns of a file.

    Attributes:
        values: signal -> values as written, without unit, scale or offset; NaN where blank.
        lines: the 1-based line of each row.
        source: the file.
    """

    values: dict[str, NDArray[np.float64]]
    lines: Sequence[int]
    source: Path

    def fault(self, message: str, row: int, field: str | None = None) -> InputError:
        """Returns the error that names the file, the line of a row, and the field."""
        return InputError(message, file=self.source, line=self.lines[row], field=field)


def read_columns(path: Path, columns: Mapping[str, str | int], layout: CsvFormat, *, much: bool = False) -> Columns:
    """Reads the named columns of a text file.

    Args:
        path: the file.
        columns: signal -> column name, or its number from 0 where the file has no header.
        layout: delimiter and header.
        much: whether it is one of many files, so that what reads long ones pays for a short one too.

    Raises:
        InputError: no readable UTF-8 text, a missing or double column, rows of different length, a cell that is not a
            number, or no rows.
    """
    text = _text(path)
    if (much or len(text) > LONG_TEXT) and (
        plain := read_plain(text, columns, layout.delimiter, layout.header)
    ) is not None:
        return Columns(plain, range(1 + layout.header, 1 + layout.header + len(next(iter(plain.values())))), path)
    rows, lines = _rows(path, text, layout.delimiter)
    names = _header(path, rows, lines) if layout.header else None
    if layout.header:
        del rows[0], lines[0]
    if not rows:
        raise InputError("holds no rows of data", file=path)
    width = len(names) if names is not None else len(rows[0])
    for cells, line in zip(rows, lines, strict=True):
        if len(cells) != width:
            raise InputError(f"has {len(cells)} cells instead of {width}", file=path, line=line)
    table = list(zip(*rows, strict=True))
    values = {}
    for signal, column in columns.items():
        position = _position(path, signal, column, names, width, lines[0])
        values[signal] = _numbers(path, f"{signal} (column {column})", table[position], lines)
    return Columns(values, lines, path)


def _text(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError("no such file" if not path.exists() else "is not a file", file=path)
        if path.stat().st_size > SIZE_LIMIT:
            raise InputError(f"is larger than {SIZE_LIMIT // 2**20} MiB", file=path)
        content = path.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=path) from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text", file=path, line=error.object[: error.start].count(b"\n") + 1) from error


def _rows(path: Path, text: str, delimiter: str) -> tuple[list[list[str]], list[int]]:
    rows: list[list[str]] = []
    lines: list[int] = []
    if delimiter == " ":
        rows = [line.split() for line in re.split(r"\r\n|\r|\n", text)]
        lines = list(range(1, len(rows) + 1))
    else:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True, strict=True)
        try:
            for cells in reader:
                rows.append(cells)
                lines.append(reader.line_num)
        except csv.Error as error:
            raise InputError(f"is not a table: {error}", file=path, line=max(reader.line_num, 1)) from error
    while rows and not rows[-1]:
        del rows[-1], lines[-1]
    return rows, lines


def _header(path: Path, rows: list[list[str]], lines: list[int]) -> list[str]:
    if not rows:
        raise InputError("is empty", file=path)
    names = [name.strip() for name in rows[0]]
    for name in names:
        if name and names.count(name) > 1:
            raise InputError("column occurs more than once in the header", file=path, line=lines[0], field=name)
    return names


def _position(path: Path, signal: str, column: str | int, names: list[str] | None, width: int, line: int) -> int:
    if names is None:
        position = int(column)
        if position >= width:
            raise InputError(
                f"no column {column}: the file has {width}, numbered from 0", file=path, line=line, field=signal
            )
        return position
    if column not in names:
        known = ", ".join(names[:20])
        raise InputError(f"no column {column!r} among {known}", file=path, line=1, field=signal)
    return names.index(str(column))


def _numbers(path: Path, field: str, cells: Sequence[str], lines: list[int]) -> NDArray[np.float64]:
    values = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if _NUMBER(cell):
            values[row] = float(cell)
        elif not cell or cell.isspace():
            values[row] = np.nan
        else:
            message = f"{cell[:40]!r} is not a number (leave the cell blank where there is no value)"
            raise InputError(message, file=path, line=lines[row], field=field)
    return values
