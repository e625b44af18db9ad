"""Reads the table in a text file as loggers write it: with lines before the header, repeated headers and broken lines.

What is left out is counted and said. The numbers are parsed by pandas.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from brickpilot.data.rows import DELIMITERS, SIZE_LIMIT
from brickpilot.errors import InputError
from brickpilot.importers.formula import Place, unknown_name
from brickpilot.importers.text_layout import BLANK_WORDS, Layout, doubled, find_header, find_layout, is_row

Vector = NDArray[np.float64]

_MOST_COLUMNS = 1000  # that have a number; a higher one is refused as a column that the file lacks
_MOST_BROKEN = 0.2  # share of the rows; a file with more broken lines is not what it was taken for
_LONGEST_NUMBER = 300  # characters; a double ends at 1.8e308
_STAMP = re.compile(r"\d\d:\d\d:\d\d(?:\.\d+)? -> ")
_PREFERRED = (";", "\t", ",", "|", " ")
assert set(_PREFERRED) == set(DELIMITERS)


@dataclass(frozen=True, eq=False)
class TextTable:
    """The rows of a text file.

    Attributes:
        file: the file.
        names: of the columns; without a header their numbers from 0.
        header: whether the file names its columns.
        first_line: the 1-based line of the header, or of the first row.
        lines: the 1-based line of each row.
        notes: what was left out, a sentence each.
    """

    file: Path
    names: tuple[str, ...]
    header: bool
    first_line: int
    lines: NDArray[np.int64]
    notes: tuple[str, ...]
    _cells: pd.DataFrame

    @property
    def formula_names(self) -> list[str]:
        """The names that formulas may use; a column's number is ``c0`` in a formula, as ``0`` there is a number."""
        numbers = range(_MOST_COLUMNS)
        if self.header:
            return [*self.names, *map(str, numbers)]
        return [*map(str, numbers), *(f"c{number}" for number in numbers)]

    def column(self, signal: str, place: Place) -> tuple[Vector, NDArray[np.bool_]]:
        """Returns the numbers of a column, NaN where blank, and the rows whose cell is no number.

        Raises:
            InputError: no such column, or one that mostly holds text.
        """
        position = self._position(signal, place)
        cells = self._cells[position]
        if pd.api.types.is_numeric_dtype(cells):
            values = cells.to_numpy(dtype=np.float64, copy=True)
            wrong = np.isinf(values)
        else:
            values = _numbers(cells)
            wrong = np.isinf(values) | (np.isnan(values) & cells.notna().to_numpy())
        if np.count_nonzero(wrong) > _MOST_BROKEN * values.size:
            row = int(np.argmax(wrong))
            text = str(cells.iloc[row])[:40]
            message = f"{text!r} is not a number, and so it is in {np.count_nonzero(wrong)} of {values.size} rows"
            place_name = f"{signal} (column {self.names[position]})"
            raise InputError(message, file=self.file, line=int(self.lines[row]), field=place_name)
        values[wrong] = np.nan
        return values, wrong

    def _position(self, signal: str, place: Place) -> int:
        if place.index is not None:
            raise InputError("a column of a table has no index", field=f"--map {signal}={place.name}[{place.index}]")
        if self.header and place.name in self.names:
            return self.names.index(place.name)
        number = place.name if self.header else place.name.removeprefix("c")
        if not (number.isascii() and number.isdigit()):
            if not self.header:
                raise InputError(f"{place.name} is not a column number from 0", field=f"--map {signal}")
            message = unknown_name("column", place.name, self.names)
            raise InputError(message, file=self.file, line=self.first_line, field=signal)
        if int(number) >= len(self.names):
            message = f"no column {number}: the file has {len(self.names)}, numbered from 0"
            raise InputError(message, file=self.file, line=self.first_line, field=signal)
        return int(number)


def _numbers(cells: pd.Series) -> Vector:
    """Returns the numbers of cells of text; NaN where one is blank, no number, or longer than `_LONGEST_NUMBER`."""
    try:
        found = pd.to_numeric(cells, errors="coerce")
    except OverflowError:  # pandas reads a whole number of any length, and cannot make a double of it
        found = pd.to_numeric(cells.mask(cells.astype(str).str.len() > _LONGEST_NUMBER), errors="coerce")
    return np.array(found, dtype=np.float64)


def read_table(file: Path, delimiter: str | None = None, header: bool = False) -> TextTable:
    """Returns the table in a text file.

    Args:
        file: UTF-8 or UTF-16 text; bytes that are no text make their line a broken one.
        delimiter: None: it is found.
        header: whether the file must name its columns.

    Raises:
        InputError: no such file, no table in it, a column's name twice, or too many broken lines.
    """
    text = _text(file)
    lines = text.split("\n")
    notes: list[str] = []
    if sum(_STAMP.match(line) is not None for line in lines[:400]) > min(len(lines), 400) / 2:
        lines = [_STAMP.sub("", line, count=1) for line in lines]
        notes.append("the times of day that a serial monitor put before each line are left out")
    layout = find_layout(lines, _PREFERRED if delimiter is None else [delimiter])
    if layout is None:
        empty = "is empty" if not text.strip() else "holds no rows of data: no lines with two numbers or more"
        raise InputError(empty, file=file)
    found = find_header(lines, layout, header)
    names = found[1] if found else tuple(str(number) for number in range(layout.width))
    if found and (twice := doubled(names)):
        raise InputError("column occurs more than once in the header", file=file, line=found[0] + 1, field=twice)
    start = next(index for index, line in enumerate(lines) if is_row(layout, line) and (not found or index != found[0]))
    kept, left_out = _rows(lines, layout, start, found[0] if found else None)
    rows = np.array(kept, dtype=np.int64)
    _check_broken(file, lines, rows.size, left_out["broken lines"])
    cells = _parsed([lines[index] for index in kept], layout)
    before = [index for index in range(start) if lines[index].strip() and (not found or index != found[0])]
    notes += _notes(lines, before, left_out)
    return TextTable(file, names, found is not None, (found[0] if found else start) + 1, rows + 1, tuple(notes), cells)


def _text(file: Path) -> str:
    try:
        if not file.is_file():
            raise InputError("no such file" if not file.exists() else "is not a file", file=file)
        if file.stat().st_size > SIZE_LIMIT:
            raise InputError(f"is larger than {SIZE_LIMIT // 2**20} MiB", file=file)
        content = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from error
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _rows(
    lines: Sequence[str], layout: Layout, start: int, header: int | None
) -> tuple[list[int], dict[str, list[int]]]:
    """Returns the lines that are rows, and what is left out: kind -> lines. Lines are counted from 0."""
    wide = layout.width - 1 + layout.trailing
    delimiter = layout.delimiter
    again = lines[header].strip() if header is not None else None
    left_out: dict[str, list[int]] = {"repeated headers": [], "comments": [], "broken lines": [], "cut-off line": []}
    kept = []
    last = len(lines) - 1
    for index in range(start, len(lines)):
        line = lines[index]
        cells = len(line.split()) - 1 if delimiter == " " else line.count(delimiter)
        if cells == wide and '"' not in line and index not in (header, last):
            kept.append(index)
        elif not line.strip() or index == header:
            continue
        elif line.strip() == again:
            left_out["repeated headers"].append(index)
        elif line.lstrip()[0] in "#%":
            left_out["comments"].append(index)
        elif index == last:
            left_out["cut-off line"].append(index)
        elif len(layout.split(line)) == layout.width:
            kept.append(index)
        else:
            left_out["broken lines"].append(index)
    if again is not None:
        repeated = {index for index in kept if lines[index].strip() == again}
        left_out["repeated headers"] = sorted({*left_out["repeated headers"], *repeated})
        kept = [index for index in kept if index not in repeated]
    return kept, left_out


def _check_broken(file: Path, lines: Sequence[str], rows: int, broken: Sequence[int]) -> None:
    if not rows:
        raise InputError("holds no rows of data", file=file)
    if len(broken) > _MOST_BROKEN * (rows + len(broken)):
        message = f"is no row of the table, as {len(broken)} of {rows + len(broken)} lines: {lines[broken[0]][:40]!r}"
        raise InputError(message, file=file, line=broken[0] + 1)


def _parsed(rows: list[str], layout: Layout) -> pd.DataFrame:
    if layout.delimiter == " ":
        rows = [" ".join(line.split()) for line in rows]
    elif any('"' in line for line in rows):
        joined = (layout.split(line) for line in rows)
        rows = [layout.delimiter.join(cell.replace(layout.delimiter, " ") for cell in cells) for cells in joined]
        layout = Layout(layout.delimiter, layout.decimal, layout.width, False)
    return pd.read_csv(
        io.StringIO("\n".join(rows)), sep=layout.delimiter, decimal=layout.decimal, header=None,
        names=list(range(layout.width + layout.trailing)), index_col=False, quoting=csv.QUOTE_NONE, low_memory=False,
        skipinitialspace=True, skip_blank_lines=False, na_values=sorted({*BLANK_WORDS, "-NaN"}),
    )  # fmt: skip


def _notes(lines: Sequence[str], before: Sequence[int], left_out: dict[str, list[int]]) -> list[str]:
    notes = []
    if before:
        first = lines[before[0]].strip()[:40]
        notes.append(f"{len(before)} lines before the first row are skipped, the first is {first!r}")
    for kind, found in left_out.items():
        if kind == "cut-off line" and found:
            notes.append(f"line {found[0] + 1} is the last and has no end, so it may be cut off: left out")
        elif found:
            notes.append(f"{len(found)} {kind} are left out, the first is line {found[0] + 1}")
    return notes
