"""Reads the signals of one text file in order of time, and removes broken rows and overflows.

Overflows and restarts of the clock are found, and so are repeated and misread time stamps.

A jump of a counter is an overflow only if the jump, corrected by the counter's range, is as small as a usual step. Any
other jump is kept, because it may be real.

A log can be joined with a table of events at which its inputs change. A simulation holds an input from row to row. So
the log gets a row at each event between two of its rows; measured signals are blank in this row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import SIGNALS, SUMMED
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.channels import Vector
from brickpilot.importers.mapping import Formula, Scaling, Signals, Source, read_formulas, take, units_of
from brickpilot.importers.text_table import TextTable


def read_log(table: TextTable, sources: Mapping[str, Source]) -> Signals:
    """Returns the signals of a table.

    Raises:
        InputError: a formula is not valid, a column is missing or holds text, or too few rows are sound.
    """
    formulas = read_formulas(sources, table.formula_names)
    notes = list(table.notes)
    cells, sound = _cells(table, formulas, notes)
    if broken := np.count_nonzero(~sound):
        first = table.lines[int(np.argmin(sound))]
        notes.append(f"{broken} rows with cells that are no numbers are left out, the first is line {first}")
    lines = table.lines[sound]
    clock = formulas["time"]
    if clock.scaling is not None:
        time = cells[clock.places[0]][sound]
    else:
        time = take(table.file, {"time": clock}, {place: cells[place][sound] for place in clock.places})[0]["time"]
    kept, time = ordered(time, lines, cut_start=not table.header, notes=notes)
    rows = np.flatnonzero(sound)[kept]
    lines = table.lines[rows]
    columns, scalings = take(table.file, formulas, {place: values[rows] for place, values in cells.items()})
    columns["time"] = time
    if "yaw_angle" in columns:
        scale = scalings.get("yaw_angle", Scaling()).scale
        heading = unturn(columns["yaw_angle"], 2 * np.pi / abs(si_factor(sources["yaw_angle"].unit, "rad") * scale))
        columns["yaw_angle"] = heading.values
        if count := len(heading.rows):
            notes.append(f"yaw_angle jumps by a turn {count} times: it goes on from line {lines[heading.rows[0]]}")
    starts = set((np.flatnonzero(np.diff(time) < 0.0) + 1).tolist())
    for signal in (name for name in columns if name in SUMMED and name != "yaw_angle"):
        for row in resets(columns[signal]):
            if row not in starts:
                notes.append(f"{signal} is set to 0 in line {lines[row]}: a new run begins there")
            starts.add(row)
    return Signals(table.file, columns, scalings, units_of(sources), notes, sorted(starts))


def _cells(
    table: TextTable, formulas: Mapping[str, Formula], notes: list[str]
) -> tuple[dict[str, Vector], NDArray[np.bool_]]:
    """Returns the cells of each used column, counters without overflows, and which rows have no broken cell."""
    cells: dict[str, Vector] = {}
    sound = np.ones(table.lines.size, dtype=bool)
    for signal, formula in formulas.items():
        for place in formula.places:
            if place not in cells:
                cells[place], wrong = table.column(signal, place)
                sound &= ~wrong
    for place in {place for signal in SUMMED & set(formulas) for place in formulas[signal].places}:
        unwrapped = unwrap(np.where(sound, cells[place], np.nan))
        if unwrapped.rows:
            cells[place] = unwrapped.values
            where = ", ".join(str(table.lines[row]) for row in unwrapped.rows[:5])
            count = len(unwrapped.rows)
            notes.append(
                f"{place} is a counter, {unwrapped.kind}, that overflows {count} times: counted on from line "
                f"{where}{', ...' if count > 5 else ''}"
            )
    return cells, sound


def joined(log: Signals, events: Signals) -> Signals:
    """Returns a log whose inputs come from a table of events.

    Raises:
        InputError: the clock of the log or of the table starts again, so events and rows have no common order.
    """
    for table in (log, events):
        if np.any(np.diff(table.columns["time"]) <= 0.0):
            raise InputError("its clock starts again, so that --inputs cannot be joined", file=table.file)
    if log.scalings.get("time") != events.scalings.get("time"):
        raise InputError("its time is written otherwise than that of the log", file=events.file, field="time")
    measured = log.columns["time"]
    columns = with_events(log.columns, events.columns)
    starts = np.searchsorted(columns["time"], measured[list(log.starts)])
    added = columns["time"].size - measured.size
    first = events.columns["time"][0]
    notes = [*log.notes, *(f"{events.file.name}: {note}" for note in events.notes)]
    notes.append(f"{added} rows are added where an input of {events.file.name} changes between two rows")
    if first > measured[0]:
        notes.append(f"before the first event of {events.file.name} the inputs are taken as 0")
    units = {**log.units, **events.units}
    return Signals(log.file, columns, {**log.scalings, **events.scalings}, units, notes, starts.tolist())


def with_events(columns: Mapping[str, Vector], events: Mapping[str, Vector]) -> dict[str, Vector]:
    """Returns a log whose inputs come from a table of events; the log gets a row at each event within the log's time.

    Args:
        columns: the log's time, outputs and inputs; the inputs are replaced.
        events: time and inputs; an input is held from its event to the next. Before the first event, an input is 0.
    """
    time, at = columns["time"], events["time"]
    within = at[(at > time[0]) & (at <= time[-1])]
    union = np.union1d(time, within)
    place = np.searchsorted(at, union, side="right") - 1
    joined = {"time": union}
    for name, values in events.items():
        if name != "time":
            joined[name] = np.where(place < 0, 0.0, values[np.maximum(place, 0)])
    measured = np.searchsorted(union, time)
    for name, values in columns.items():
        if SIGNALS[name].kind == "output":
            joined[name] = np.full(union.size, np.nan)
            joined[name][measured] = values
    return joined


_STANDING = 0.5  # share of all rows: if fewer rows repeat the time of the row before, these rows are left out
_FIRST_STEP = 100.0  # limit, in usual steps: if the first step is longer, the first row's time has lost digits


def ordered(
    cells: Vector, lines: NDArray[np.int64], cut_start: bool, notes: list[str]
) -> tuple[NDArray[np.int64], Vector]:
    """Returns the rows of a log that have a sound time, and the times of these rows without overflows of the clock.

    Args:
        cells: the cells of the time, NaN where blank or broken.
        lines: the line of each row, for the notes.
        cut_start: whether the first line of the log may be incomplete.
        notes: list to which a sentence on each change, and on each restart of the clock, is added.
    """
    unwrapped = unwrap(cells, clock=True)
    notes += [
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
    starts = kept[1:][np.diff(time[kept]) < 0.0]
    notes += [f"time starts again in line {lines[start]}: a new run begins there" for start in starts]
    return kept, time[kept]


def _lone(time: Vector, cut_start: bool) -> NDArray[np.int64]:
    """Returns rows whose time is not between their neighbours' times, which are in order; also a cut first row."""
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


_BITS = ((16, 1), (32, 1), (12, 2), (14, 2))  # (bits, overflows needed as a proof); angle sensors have 12 or 14 bits
_NEAR = 20  # number of steps on each side from which the usual step is computed
_USUAL = 3.0  # largest corrected step at an overflow, as a multiple of the largest step nearby
_LATE = 50.0  # longest pause of a clock at an overflow, in usual steps
_FAR_STEPS, _FAR_COUNTS = 10.0, 20.0  # limit of a value far from 0: so many usual steps plus so many smallest steps
_RETURNS = 5  # number of samples within which a misread counter returns; a reset counter does not return


@dataclass(frozen=True)
class Unwrapped:
    """A counter after overflows were removed. `rows`: each row after an overflow; `kind`: such as "unsigned 16-bit"."""

    values: Vector
    rows: tuple[int, ...] = ()
    kind: str = ""


def unwrap(values: Vector, clock: bool = False) -> Unwrapped:
    """Removes overflows of 12, 14, 16 or 32 bits, signed or unsigned, from a column of counts.

    Args:
        values: cells as logged; NaN where blank.
        clock: whether the counter counts time and therefore only rises.
    """
    known = np.flatnonzero(np.isfinite(values))
    counts = values[known]
    if counts.size < 3 or np.any(counts != np.round(counts)):
        return Unwrapped(values)
    low, high = counts.min(), counts.max()
    for bits, least in _BITS:
        span = 2.0**bits
        for kind, start in (("unsigned", 0.0), ("signed", -span / 2)):
            if low < start or high >= start + span:
                continue
            steps = _overflows(np.diff(counts), span, clock)
            if len(steps) >= least:
                return _continued(values, known, steps, span, f"{kind} {bits}-bit")
    return Unwrapped(values)


def unturn(values: Vector, turn: float) -> Unwrapped:
    """Removes jumps by a whole turn from a heading, such as from 359 to 0 degrees or from 180 to -180.

    Args:
        values: cells as logged; NaN where blank.
        turn: one turn in the unit of `values`.
    """
    known = np.flatnonzero(np.isfinite(values))
    return _continued(values, known, _overflows(np.diff(values[known]), turn, clock=False), turn, "heading")


def _continued(values: Vector, known: NDArray[np.int64], steps: NDArray[np.int64], span: float, kind: str) -> Unwrapped:
    """Returns `values` without overflows by `span`, which happen at the `steps` between the `known` rows."""
    turns = np.zeros(known.size)
    turns[steps + 1] = -np.sign(np.diff(values[known])[steps])
    continued = values.copy()
    continued[known] += span * np.cumsum(turns)
    return Unwrapped(continued, tuple(known[steps + 1].tolist()), kind)


def _overflows(steps: Vector, span: float, clock: bool) -> NDArray[np.int64]:
    """Returns the indices of those steps of a counter at which its range `span` overflows."""
    large = np.abs(steps) > span / 2
    overflows = []
    for index in np.flatnonzero(large):
        true = steps[index] - np.sign(steps[index]) * span
        if clock:
            usual = float(np.median(steps[~large])) if (~large).any() else 0.0
            sound = steps[index] < 0 and 0 < true <= _LATE * usual
        else:
            near = slice(max(0, index - _NEAR), index + _NEAR + 1)
            others = np.abs(steps[near][~large[near]])
            sound = bool(others.size) and abs(true) <= min(_USUAL * float(others.max()) + 1.0, span / 8)
        if sound:
            overflows.append(index)
    return np.array(overflows, dtype=np.int64)


def resets(values: Vector) -> list[int]:
    """Returns the rows at which a counter jumps from a value far from 0 to a value near 0, and stays there."""
    known = np.flatnonzero(np.isfinite(values))
    counts = values[known]
    steps = np.diff(counts)
    moved = np.abs(steps[steps != 0.0])
    if not moved.size:
        return []
    smallest = float(moved.min())
    rows = []
    for index in np.flatnonzero(np.abs(steps) > _FAR_COUNTS * smallest):
        near = np.abs(np.delete(steps, index)[max(0, index - _NEAR) : index + _NEAR])
        usual = float(np.quantile(near, 0.9)) if near.size else 0.0
        before, after = counts[index], counts[index + 1 : index + 1 + _RETURNS]
        far = abs(before) > _FAR_STEPS * usual + _FAR_COUNTS * smallest
        zero = abs(after[0]) <= _USUAL * usual + smallest
        if far and zero and np.all(np.abs(after - before) > abs(before) / 2):
            rows.append(int(known[index + 1]))
    return rows
