"""Reads tables in text files of loggers. A file may have lines before the header, repeated headers and broken lines.

The layout of the table is found first: the delimiter, the decimal sign, the number of columns, and the header. A note
counts the rows that are left out. Numbers are parsed as in a run's file (`data.rows`).
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.rows import CUT, DELIMITERS, NUMBER, joined, numbers, parse_rows
from brickpilot.data.units import si_factor
from brickpilot.data.whole_files import read_text
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector
from brickpilot.importers.mapping import unknown_name

if TYPE_CHECKING:
    import pyarrow


_MOST_COLUMNS = 1000  # column numbers in formulas are below this number
_MOST_BROKEN = 0.2  # largest share of broken lines; a file with a larger share is not a table
_STAMP = re.compile(r"\d\d:\d\d:\d\d(?:\.\d+)? -> ")
_PREFERRED = (";", "\t", ",", "|", " ")  # delimiters in the order in which they are tried
assert set(_PREFERRED) == set(DELIMITERS)


@dataclass(frozen=True, eq=False)
class TextTable:
    """The rows of a text file.

    Attributes:
        file: the file.
        names: the columns' names; if there is no header, the columns' numbers from 0 on.
        header: whether the file names its columns.
        first_line: the 1-based line of the header, or of the first row.
        lines: the 1-based line of each row.
        notes: sentences for the user on the text that was left out.
    """

    file: Path
    names: tuple[str, ...]
    header: bool
    first_line: int
    lines: NDArray[np.int64]
    notes: tuple[str, ...]
    _decimal: str
    _cells: pyarrow.Table

    @property
    def formula_names(self) -> list[str]:
        """The names that formulas may use; without a header, ``c0`` stands for column 0, because ``0`` is a number."""
        numbers = range(_MOST_COLUMNS)
        if self.header:
            return [*self.names, *map(str, numbers)]
        return [*map(str, numbers), *(f"c{number}" for number in numbers)]

    def column(self, signal: str, place: str) -> tuple[Vector, NDArray[np.bool_]]:
        """Returns the numbers of a column, NaN where blank, and for each row whether its cell is no number.

        Raises:
            InputError: there is no such column, or too many of its cells hold text.
        """
        position = self._position(signal, place)
        cells = self._cells.column(position)
        values, wrong = numbers(cells, BLANKS)
        if self._decimal != "." and wrong.any():  # a file with decimal commas may also have columns with decimal points
            with_commas = numbers(cells, BLANKS, self._decimal)
            values, wrong = min((values, wrong), with_commas, key=lambda read: np.count_nonzero(read[1]))
        wrong |= np.isinf(values)
        if wrong.all() and {word.lower() for word in cells.unique().to_pylist()} <= {"true", "false"}:
            return np.array([word.lower() == "true" for word in cells.to_pylist()], dtype=np.float64), ~wrong
        if np.count_nonzero(wrong) > _MOST_BROKEN * values.size:
            row = int(np.argmax(wrong))
            text = cells[row].as_py().strip(" ")[:40]
            message = f"{text!r} is not a number, and so it is in {np.count_nonzero(wrong)} of {values.size} rows"
            place_name = f"{signal} (column {self.names[position]})"
            raise InputError(message, file=self.file, line=int(self.lines[row]), field=place_name)
        values[wrong] = np.nan
        return values, wrong

    def _position(self, signal: str, place: str) -> int:
        if self.header and place in self.names:
            return self.names.index(place)
        number = place if self.header else place.removeprefix("c")
        if not (number.isascii() and number.isdigit()):
            if not self.header:
                raise InputError(f"{place} is not a column number from 0", field=f"--map {signal}")
            message = unknown_name("column", place, self.names)
            raise InputError(message, file=self.file, line=self.first_line, field=signal)
        if int(number) >= len(self.names):
            message = f"no column {number}: the file has {len(self.names)}, numbered from 0"
            raise InputError(message, file=self.file, line=self.first_line, field=signal)
        return int(number)


def read_table(file: Path, delimiter: str | None = None, header: bool = False) -> TextTable:
    """Returns the table in a text file.

    Args:
        file: the file, in UTF-8 or UTF-16; a line with bytes that are no text counts as broken.
        delimiter: the delimiter; None: the function finds the delimiter.
        header: whether the file must name its columns.

    Raises:
        InputError: there is no such file or no table in it, two column names are equal, or too many lines are broken.
    """
    text = read_text(file, damaged=True)
    lines = text.split("\n")
    notes: list[str] = []
    if sum(_STAMP.match(line) is not None for line in lines[:400]) > min(len(lines), 400) / 2:
        lines = [_STAMP.sub("", line, count=1) for line in lines]
        notes.append("the times of day that a serial monitor put before each line are left out")
    layout = find_layout(lines, _PREFERRED if delimiter is None else [delimiter])
    if layout is None:
        empty = "is empty" if not text.strip() else "holds no rows of data: no lines with two numbers or more"
        raise InputError(empty, file=file)
    header_at, names = find_header(lines, layout, header)
    twice = next((name for name, count in Counter(names).items() if name and count > 1), None)
    if header_at is not None and twice:
        raise InputError("column occurs more than once in the header", file=file, line=header_at + 1, field=twice)
    data = (index for index, line in enumerate(lines) if is_row(layout, line) and index != header_at)
    start = next(data, len(lines) - 1)
    rows, cells, left_out = _rows(lines, layout, start, header_at)
    _check_broken(file, lines, rows.size, left_out["broken lines"])
    before = [index for index in range(start) if lines[index].strip() and index != header_at]
    notes += _notes(lines, before, left_out)
    first_line = (start if header_at is None else header_at) + 1
    return TextTable(file, names, header_at is not None, first_line, rows + 1, tuple(notes), layout.decimal, cells)


def _rows(
    lines: Sequence[str], layout: Layout, start: int, header: int | None
) -> tuple[NDArray[np.int64], pyarrow.Table, dict[str, list[int]]]:
    """Returns the rows' line numbers from 0, the rows' cells, and kind of omitted line -> line numbers from 0.

    A last line without a line end may be cut off, so it is no row.
    """
    again = lines[header].strip() if header is not None else None
    rows = ["" if line.strip() == again else line for line in lines[start:-1]]
    rows.append("")
    if layout.delimiter == " " or layout.trailing or any('"' in line for line in rows):
        cells, others = parse_rows(joined(map(layout.split, rows)), CUT, layout.width)
    else:
        cells, others = parse_rows("\n".join(rows), layout.delimiter, layout.width)
    left_out: dict[str, list[int]] = {"repeated headers": [], "comments": [], "broken lines": [], "cut-off line": []}
    for index in (start + row for row, _ in others):
        line = lines[index].strip()
        if not line or index == header:
            continue
        if line == again:
            kind = "repeated headers"
        elif line[0] in "#%":
            kind = "comments"
        else:
            kind = "cut-off line" if index == len(lines) - 1 else "broken lines"
        left_out[kind].append(index)
    return np.delete(np.arange(start, len(lines)), [row for row, _ in others]), cells, left_out


def _check_broken(file: Path, lines: Sequence[str], rows: int, broken: Sequence[int]) -> None:
    if not rows:
        raise InputError("holds no rows of data", file=file)
    if len(broken) > _MOST_BROKEN * (rows + len(broken)):
        message = f"is no row of the table, as {len(broken)} of {rows + len(broken)} lines: {lines[broken[0]][:40]!r}"
        raise InputError(message, file=file, line=broken[0] + 1)


def _notes(lines: Sequence[str], before: Sequence[int], left_out: dict[str, list[int]]) -> list[str]:
    notes = []
    if before:
        first = lines[before[0]].strip()[:40]
        notes.append(f"{len(before)} lines before the first row are skipped, the first is {first!r}")
    for kind, indices in left_out.items():
        if kind == "cut-off line" and indices:
            notes.append(f"line {indices[0] + 1} is the last and has no end, so it may be cut off: left out")
        elif indices:
            notes.append(f"{len(indices)} {kind} are left out, the first is line {indices[0] + 1}")
    return notes


_MOST_LINES = 400  # number of lines that are read to find the layout
_NUMBER = re.compile(NUMBER).fullmatch
_NAME = re.compile(r"[^\W\d][^\ufffd\x00-\x1f]{0,60}").fullmatch
BLANKS = frozenset(
    ["", "nan", "na", "n/a", "null", "none", "-nan", "#n/a", "<na>", "#na", "#n/a n/a", "1.#ind", "-1.#ind", "1.#qnan",
     "-1.#qnan"]
)  # fmt: skip
"""Texts of cells, in lower case, that stand for a missing value."""


@dataclass(frozen=True)
class Layout:
    """How the rows of a table are written.

    Attributes:
        delimiter: one of `data.rows.DELIMITERS`; a blank stands for any number of blanks and tabs.
        decimal: "." or ",".
        width: how many cells a row has.
        trailing: whether a row ends with an extra delimiter.
    """

    delimiter: str
    decimal: str
    width: int
    trailing: bool

    def split(self, line: str) -> list[str]:
        """Returns the cells of a line, without blanks around them and without quotes."""
        if self.trailing:
            line = line.rstrip(" ").removesuffix(self.delimiter)
        return cells_of(line, self.delimiter)

    def is_number(self, cell: str) -> bool:
        """Returns whether a cell is a number or stands for a missing value."""
        number = cell if self.decimal == "." else cell.replace(self.decimal, ".", 1)
        return _NUMBER(number) is not None or cell.lower() in BLANKS


def cells_of(line: str, delimiter: str) -> list[str]:
    """Returns the cells of a line, without blanks around them and without quotes."""
    if delimiter == " ":
        cells = line.split()
    elif '"' in line:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        cells = line.split(delimiter)
    return [_unquoted(cell.strip()) for cell in cells]


def _unquoted(cell: str) -> str:
    """Returns a cell without the quotes around it; an unpaired quote stays, so that the cell is no number."""
    return cell[1:-1] if len(cell) > 1 and cell[0] in "\"'" and cell[-1] == cell[0] else cell


def find_layout(lines: Sequence[str], delimiters: Sequence[str]) -> Layout | None:
    """Returns the layout in which most lines are rows of two or more numbers; None: there is no such layout.

    Args:
        lines: the file's lines.
        delimiters: the delimiters to try; if two delimiters fit equally well, the first one is taken.
    """
    filled = [line for line in lines if line.strip()]
    sample = filled[:: max(1, len(filled) // _MOST_LINES)]
    best, most = None, 0.0
    for delimiter in delimiters:
        for decimal in ".," if delimiter != "," else ".":
            layout, score = _tried(sample, delimiter, decimal)
            if score > most:
                best, most = layout, score
    return best


def _tried(sample: Sequence[str], delimiter: str, decimal: str) -> tuple[Layout, float]:
    """Returns the layout with this delimiter, and its score: the sum over its rows of (share of numbers)^2."""
    ends = sum(line.rstrip(" ").endswith(delimiter) for line in sample)
    trailing = delimiter != " " and ends > 0.9 * len(sample)
    draft = Layout(delimiter, decimal, 0, trailing)
    numbers: dict[int, list[float]] = {}
    for line in sample:
        cells = draft.split(line)
        share = sum(draft.is_number(cell) for cell in cells) / len(cells) if cells else 0.0
        if len(cells) >= 2 and share >= 0.5 and any(cell for cell in cells):
            numbers.setdefault(len(cells), []).append(share)
    width = max(numbers, key=lambda count: sum(numbers[count]), default=0)
    shares = numbers.get(width, [])
    return Layout(delimiter, decimal, width, trailing), sum(share**2 for share in shares)


def is_row(layout: Layout, line: str) -> bool:
    """Returns whether a line has the width of a row and numbers in at least half of its cells."""
    cells = layout.split(line)
    return len(cells) == layout.width and 2 * sum(layout.is_number(cell) for cell in cells) >= len(cells)


def find_header(lines: Sequence[str], layout: Layout, needed: bool) -> tuple[int | None, tuple[str, ...]]:
    """Returns the line of the header, from 0, and the columns' names; without a header, None and the columns' numbers.

    The header is the last line of names above the rows; a line of units below it does not count. If no line of names is
    above the rows, the first line of names below a row is the header, because a logger may start again in a log.

    Args:
        lines: the file's lines.
        layout: the layout of the file's rows.
        needed: whether the first line with the width of a row is the header even if this line holds numbers.
    """
    first = next((index for index, line in enumerate(lines) if is_row(layout, line)), len(lines))
    above = [index for index in range(first) if _names(lines[index], layout)]
    if len(above) > 1 and above[-1] == above[-2] + 1 and all(map(_is_unit, _names(lines[above[-1]], layout))):
        above.pop()
    if not above:
        above = [
            index for index in range(first, len(lines))
            if lines[index][:1].isalpha() and all(_NAME(name) for name in _names(lines[index], layout) or ("",))
        ][:1]  # fmt: skip
    if above:
        return above[-1], _names(lines[above[-1]], layout)
    if needed:
        for index, line in enumerate(lines):
            if len(names := layout.split(line)) == layout.width:
                return index, tuple(names)
    return None, tuple(str(number) for number in range(layout.width))


def _names(line: str, layout: Layout) -> tuple[str, ...]:
    """Returns the names in a line that can be a header; (): the line cannot be a header."""
    cells = layout.split(line.lstrip("#%/ "))
    if len(cells) != layout.width and layout.trailing:
        cells = cells_of(line.lstrip("#%/ "), layout.delimiter)
    numbers = sum(layout.is_number(cell) for cell in cells)
    if len(cells) != layout.width or 2 * numbers >= len(cells):
        return ()
    return tuple(cells)


def _is_unit(cell: str) -> bool:
    """Returns whether a cell is blank or a unit, perhaps in parentheses."""
    unit = cell.strip("()[] ")
    try:
        return not unit or si_factor(unit, "1") > 0.0
    except ValueError as error:
        return "of another kind" in str(error)
