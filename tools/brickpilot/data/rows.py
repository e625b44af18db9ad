"""Reads columns of numbers from text files by pyarrow, for run files and for logs (`importers.text_table`).

In a run's file a cell that is not a plain number is refused, and the error names its line.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.whole_files import read_text
from brickpilot.errors import InputError

if TYPE_CHECKING:
    import pyarrow

DELIMITERS = (",", ";", "\t", " ", "|")
"""The delimiter " " stands for any number of blanks and tabs; with it, no cell can be empty."""

NUMBER = "[+-]?(?:[0-9]+[.]?[0-9]*|[.][0-9]+)(?:[eE][+-]?[0-9]+)?"
"""The pattern of a plain number, for Python and pyarrow."""

CUT = "\x1f"
"""The separator that `joined` puts between the cells of a row."""

_EMPTY = " "  # replaces an empty line: pyarrow reads this text as a row of blank cells
_NO_CUT = str.maketrans(f"{CUT}\n", "  ")


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


def read_columns(path: Path, columns: Mapping[str, str | int], layout: CsvFormat) -> Columns:
    """Reads the named columns of a text file.

    Args:
        path: the file.
        columns: signal -> column name, or column number from 0 if the file has no header.
        layout: delimiter and header.

    Raises:
        InputError: the file is no readable UTF-8 text, a column is missing or double, rows differ in length, a cell is
            not a number, or there are no rows.
    """
    text, delimiter = read_text(path).rstrip("\n"), layout.delimiter
    lines: Sequence[int] = range(1, text.count("\n") + 2)
    first = text.partition("\n")[0].split(delimiter)
    if delimiter == " " or '"' in text:
        rows, lines = _cut(path, text, delimiter)
        first = rows[0] if rows else []
        text, delimiter = joined(rows).rstrip("\n"), CUT
    names = None
    if layout.header:
        if not text:
            raise InputError("is empty", file=path)
        names = [name.strip() for name in first]
        for name in names:
            if name and names.count(name) > 1:
                raise InputError("column occurs more than once in the header", file=path, line=lines[0], field=name)
        text, lines = text.partition("\n")[2], lines[1:]
    if not text:
        raise InputError("holds no rows of data", file=path)
    width = max(len(first), 1)
    table, others = parse_rows(text, delimiter, width)
    if others:
        row, count = others[0]
        raise InputError(f"has {count} cells instead of {width}", file=path, line=lines[row])
    read = Columns({}, lines, path)
    for signal, column in columns.items():
        position = _position(path, signal, column, names, width, lines[0])
        read.values[signal], wrong = numbers(table.column(position))
        if wrong.any():
            row = int(np.argmax(wrong))
            cell = table.column(position)[row].as_py().lstrip(" ")[:40]
            message = f"{cell!r} is not a number (leave the cell blank where there is no value)"
            raise read.fault(message, row, f"{signal} (column {column})")
    return read


def joined(rows: Iterable[Sequence[str]]) -> str:
    """Returns rows as text that `parse_rows` reads with the delimiter `CUT`."""
    return "\n".join(CUT.join([cell.translate(_NO_CUT) for cell in row]) for row in rows)


def parse_rows(rows: str, delimiter: str, width: int) -> tuple[pyarrow.Table, list[tuple[int, int]]]:
    """Returns the cells as a table of text, and (index from 0, number of cells) of each row without `width` cells.

    The table does not contain these other rows.

    Args:
        rows: text with a line for each row, without quotes. An empty line has no cells.
        delimiter: one character.
        width: the number of cells that a row has to have.
    """
    import pyarrow
    from pyarrow.csv import ConvertOptions, ParseOptions, ReadOptions, read_csv

    others: list[tuple[int, int]] = []

    def left_out(row: pyarrow.csv.InvalidRow) -> str:
        others.append((row.number - 1, row.actual_columns if row.text != _EMPTY else 0))
        return "skip"

    content = f"\n{rows}\n".replace("\n\n", f"\n{_EMPTY}\n").replace("\n\n", f"\n{_EMPTY}\n")[1:].encode()
    names = [str(column) for column in range(width)]
    table = read_csv(
        pyarrow.BufferReader(content),
        # One block, because no row may lie in two blocks; one thread, because only then pyarrow numbers the rows.
        ReadOptions(column_names=names, use_threads=False, block_size=len(content)),
        ParseOptions(delimiter=delimiter, quote_char=False, invalid_row_handler=left_out),
        ConvertOptions(column_types=dict.fromkeys(names, pyarrow.string())),
    )
    return table, others


def numbers(
    cells: pyarrow.ChunkedArray, blanks: Collection[str] = ("",), decimal: str = "."
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Returns the numbers in cells of text (NaN: no number), and whether each cell is neither a number nor blank.

    A number too large for a double is infinite.

    Args:
        cells: the texts; blanks around a number are ignored.
        blanks: texts, in lower case, that mean "no value".
        decimal: the decimal sign.
    """
    import pyarrow
    from pyarrow import compute

    text = compute.ascii_trim_whitespace(cells)
    is_number = compute.match_substring_regex(text, f"^{NUMBER.replace('.', decimal)}$")
    plain = text if decimal == "." else compute.replace_substring(text, decimal, ".")
    values = compute.if_else(is_number, plain, None).cast(pyarrow.float64()).to_numpy().copy()
    wrong = ~is_number.to_numpy()
    words = compute.utf8_lower(compute.utf8_trim_whitespace(text.filter(compute.invert(is_number))))
    wrong[wrong] = ~compute.is_in(words, value_set=pyarrow.array(sorted(blanks))).to_numpy()
    return values, wrong


def _cut(path: Path, text: str, delimiter: str) -> tuple[list[list[str]], list[int]]:
    """Returns each row's cells and the line where the row ends; a quoted cell may hold a delimiter or a line end."""
    if delimiter == " ":
        rows = [line.split() for line in text.split("\n")]
        return rows, list(range(1, len(rows) + 1))
    reader = csv.reader(io.StringIO(text), delimiter=delimiter, skipinitialspace=True, strict=True)
    try:
        numbered = [(cells, reader.line_num) for cells in reader]
    except csv.Error as error:
        raise InputError(f"is not a table: {error}", file=path, line=max(reader.line_num, 1)) from error
    return [cells for cells, _ in numbered], [line for _, line in numbered]


def _position(path: Path, signal: str, column: str | int, names: list[str] | None, width: int, line: int) -> int:
    if names is None:
        position = int(column)
        if position >= width:
            message = f"no column {column}: the file has {width}, numbered from 0"
            raise InputError(message, file=path, line=line, field=signal)
        return position
    if column not in names:
        raise InputError(f"no column {column!r} among {', '.join(names[:20])}", file=path, line=1, field=signal)
    return names.index(str(column))
