"""Reads long files that hold plain numbers alone, many times faster than cell by cell."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

LONG_TEXT = 1_000_000
"""Characters; loading pandas takes longer than reading a shorter file cell by cell."""

_PLAIN = re.compile(r"[-+.\deE,;\t|\n]*", re.ASCII)


def read_plain(
    text: str, columns: Mapping[str, str | int], delimiter: str, header: bool
) -> dict[str, NDArray[np.float64]] | None:
    """Returns signal -> values, NaN where blank; None: the file has to be read cell by cell, which names what is wrong.

    Args:
        text: of the file.
        columns: signal -> column name, or its number from 0 without a header.
        delimiter: comma, semicolon, tab or bar; with a blank the result is None.
        header: whether the first line names the columns.
    """
    import pandas

    text = text.replace("\r\n", "\n").removesuffix("\n")
    first, _, rest = text.partition("\n") if header else ("", "", text)
    if delimiter == " " or '"' in first or not _PLAIN.fullmatch(rest) or "\n\n" in rest:
        return None
    names = [name.strip() for name in first.split(delimiter)] if header else []
    width = len(names) if header else rest.partition("\n")[0].count(delimiter) + 1
    wanted = [names.index(column) if column in names else None if header else column for column in columns.values()]
    known = all(isinstance(position, int) and position < width for position in wanted)
    if not known or len(set(names)) < len(names) or not _rectangular(rest, delimiter, width):
        return None
    try:
        table = pandas.read_csv(
            io.StringIO(rest), sep=delimiter, header=None, names=range(width), dtype=np.float64, skip_blank_lines=False
        )
    except ValueError:  # a cell such as 1e or --1
        return None
    return {signal: table[position].to_numpy() for signal, position in zip(columns, wanted, strict=True)}


def _rectangular(text: str, delimiter: str, width: int) -> bool:
    """Returns whether each line has `width` cells."""
    marks = np.frombuffer(text.encode("ascii"), dtype=np.uint8)
    ends = np.append(np.flatnonzero(marks == ord("\n")), marks.size)
    cuts = np.searchsorted(np.flatnonzero(marks == ord(delimiter)), ends)
    return bool(np.all(np.diff(cuts, prepend=0) == width - 1))
