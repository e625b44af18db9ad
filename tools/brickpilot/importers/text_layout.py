"""Finds how a text file holds a table: the delimiter, the decimal sign, the number of columns, and the header."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from brickpilot.data.rows import NUMBER
from brickpilot.data.units import si_factor

_MOST_LINES = 400  # that are read to find the layout
_NUMBER = re.compile(NUMBER).fullmatch
_NAME = re.compile(r"[^\W\d][^\ufffd\x00-\x1f]{0,60}").fullmatch
BLANK_WORDS = frozenset(
    ["", "nan", "na", "n/a", "null", "none", "-nan", "#n/a", "<na>", "#na", "#n/a n/a", "1.#ind", "-1.#ind", "1.#qnan",
     "-1.#qnan"]
)  # fmt: skip
"""Cells, in lower case, that stand for a missing value."""


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
        """Returns whether a cell is a number, or stands for a missing one."""
        number = cell if self.decimal == "." else cell.replace(self.decimal, ".", 1)
        return _NUMBER(number) is not None or cell.lower() in BLANK_WORDS


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
    """Returns a cell without the quotes round it; a single quote is damage, which makes the cell no number."""
    return cell[1:-1] if len(cell) > 1 and cell[0] in "\"'" and cell[-1] == cell[0] else cell


def find_layout(lines: Sequence[str], delimiters: Sequence[str]) -> Layout | None:
    """Returns the layout in which most lines are rows of two numbers or more; None: in none of them.

    Args:
        lines: of the file.
        delimiters: those that are tried; of two that fit equally the first is taken.
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
    """Returns the layout with this delimiter, and the number of its rows times the share of numbers in them."""
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
    """Returns whether a line has the width of a row and numbers in half of its cells."""
    cells = layout.split(line)
    return len(cells) == layout.width and 2 * sum(layout.is_number(cell) for cell in cells) >= len(cells)


def find_header(lines: Sequence[str], layout: Layout, needed: bool) -> tuple[int, tuple[str, ...]] | None:
    """Returns the line of the header and its names; None: there is none.

    The header is the last line of names above the rows; a line of units below it does not count. If the logger started
    again during a log, there are rows above the header.

    Args:
        lines: of the file.
        layout: of its rows.
        needed: whether the first line of a row's width is the header even if it holds numbers.
    """
    first = next((index for index, line in enumerate(lines) if is_row(layout, line)), len(lines))
    above = [index for index in range(first) if _names(lines[index], layout)]
    if len(above) > 1 and above[-1] == above[-2] + 1 and _all_units(_names(lines[above[-1]], layout)):
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
    return None


def _names(line: str, layout: Layout) -> tuple[str, ...]:
    """Returns the names in a line that can be a header, else ()."""
    cells = layout.split(line.lstrip("#%/ "))
    if len(cells) != layout.width and layout.trailing:
        cells = cells_of(line.lstrip("#%/ "), layout.delimiter)
    numbers = sum(layout.is_number(cell) for cell in cells)
    if len(cells) != layout.width or 2 * numbers >= len(cells):
        return ()
    return tuple(cells)


def _all_units(cells: Sequence[str]) -> bool:
    return all(_is_unit(cell.strip("()[] ")) for cell in cells)


def _is_unit(cell: str) -> bool:
    if not cell:
        return True
    try:
        si_factor(cell, "1")
    except ValueError as error:
        return "of another kind" in str(error)
    return True


def doubled(names: Sequence[str]) -> str | None:
    """Returns a name that occurs more than once, else None."""
    return next((name for name, count in Counter(names).items() if name and count > 1), None)
