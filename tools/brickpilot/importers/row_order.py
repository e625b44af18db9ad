"""Puts the rows of a log in the order of time: it handles overflows, repeated or misread stamps, and restarts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.importers.counters import unwrap

Vector = NDArray[np.float64]

_STANDING = 0.5  # share of rows: a clock that stands still in more rows is no clock
_FIRST_STEP = 100.0  # times the usual step: in a first row at this distance from the second the time was cut off


@dataclass(frozen=True)
class Clock:
    """The time of a log.

    Attributes:
        time: cells without overflows, for all rows.
        kept: the rows whose time is sound, in order.
        starts: positions in `kept` at which the logger's clock starts again.
        notes: what was done, a sentence each.
    """

    time: Vector
    kept: NDArray[np.int64]
    starts: tuple[int, ...]
    notes: tuple[str, ...]


def ordered(cells: Vector, lines: NDArray[np.int64], cut_start: bool) -> Clock:
    """Returns the clock of a log.

    Args:
        cells: of the time, NaN where blank or broken.
        lines: of each row, for the notes.
        cut_start: whether the log may begin in the middle of a line.
    """
    unwrapped = unwrap(cells, clock=True)
    notes = [
        f"time is a counter, {unwrapped.kind}, that overflows in line {lines[row]}: counted on from there"
        for row in unwrapped.rows
    ]
    time = unwrapped.values
    kept = np.flatnonzero(np.isfinite(time))
    _count(notes, lines, np.flatnonzero(np.isnan(time)), "have no time")
    standing = np.flatnonzero(np.diff(time[kept]) == 0.0) + 1
    if len(standing) < _STANDING * len(kept):
        _count(notes, lines, kept[standing], "have the time of the row before")
        kept = np.delete(kept, standing)
    lone = _lone(time[kept], cut_start)
    _count(notes, lines, kept[lone], "have a time out of line with the rows around them")
    kept = np.delete(kept, lone)
    starts = np.flatnonzero(np.diff(time[kept]) < 0.0) + 1
    notes += [f"time starts again in line {lines[kept[start]]}: a new run begins there" for start in starts]
    return Clock(time, kept, tuple(starts.tolist()), tuple(notes))


def _lone(time: Vector, cut_start: bool) -> NDArray[np.int64]:
    """Returns the single rows whose time does not lie between those of their neighbours, which are in order."""
    if time.size < 3:
        return np.empty(0, dtype=np.int64)
    step = np.diff(time)
    wrong = np.flatnonzero(((step[:-1] <= 0.0) | (step[1:] <= 0.0)) & (time[2:] > time[:-2])) + 1
    usual = float(np.median(np.abs(step)))
    cut = cut_start and (step[0] > _FIRST_STEP * usual or (step[0] < 0.0 and step[1] > 0.0))
    return np.append([0], wrong) if cut else wrong


def _count(notes: list[str], lines: NDArray[np.int64], rows: NDArray[np.int64], what: str) -> None:
    if rows.size:
        notes.append(f"{rows.size} rows {what} and are left out, the first is line {lines[rows[0]]}")
