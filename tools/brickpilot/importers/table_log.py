"""Reads the signals of one text file in the order of time, without broken rows and overflows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import SIGNALS, SUMMED
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.counters import resets, unturn, unwrap
from brickpilot.importers.events import with_events
from brickpilot.importers.formula import Formula, Place, Scaling
from brickpilot.importers.mapping import Mapped, Source, read_formulas, take
from brickpilot.importers.row_order import ordered
from brickpilot.importers.text_table import TextTable

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """The signals of one file.

    Attributes:
        signals: in the order of time.
        starts: rows at which a new run has to begin, as a clock or a counter starts again.
        notes: what was left out or changed, a sentence each.
    """

    file: Path
    signals: Mapped
    starts: tuple[int, ...]
    notes: tuple[str, ...]


def read_log(table: TextTable, sources: Mapping[str, Source]) -> Log:
    """Returns the signals of a table.

    Raises:
        InputError: a formula is not valid, the table lacks a column or it holds text, or there are too few sound rows.
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
        time = take({"time": clock}, lambda _, place: cells[place][sound], table.file).columns["time"]
    order = ordered(time, lines, cut_start=not table.header)
    notes += order.notes
    rows = np.flatnonzero(sound)[order.kept]
    signals = take(formulas, lambda _, place: cells[place][rows], table.file)
    signals.columns["time"] = order.time[order.kept]
    if "yaw_angle" in signals.columns:
        notes += _unturned(signals, sources["yaw_angle"].unit, table.lines[rows])
    starts = set(order.starts)
    for signal, values in signals.columns.items():
        for row in resets(values) if signal in SUMMED and signal != "yaw_angle" else ():
            if row not in starts:
                notes.append(f"{signal} is set to 0 in line {table.lines[rows[row]]}: a new run begins there")
            starts.add(row)
    return Log(table.file, signals, tuple(sorted(starts)), tuple(notes))


def _unturned(signals: Mapped, unit: str, lines: NDArray[np.int64]) -> list[str]:
    """Removes jumps by a turn from the heading of `signals`, and returns notes."""
    scale = signals.scalings.get("yaw_angle", Scaling()).scale
    found = unturn(signals.columns["yaw_angle"], 2 * np.pi / abs(si_factor(unit, "rad") * scale))
    signals.columns["yaw_angle"] = found.values
    if not found.rows:
        return []
    return [f"yaw_angle jumps by a turn {len(found.rows)} times: it goes on from line {lines[found.rows[0]]}"]


def _cells(
    table: TextTable, formulas: Mapping[str, Formula], notes: list[str]
) -> tuple[dict[Place, Vector], NDArray[np.bool_]]:
    """Returns the cells of each column that is used, counters without overflows, and which rows have no broken cell."""
    cells: dict[Place, Vector] = {}
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
                f"{place.name} is a counter, {unwrapped.kind}, that overflows {count} times: counted on from line "
                f"{where}{', ...' if count > 5 else ''}"
            )
    return cells, sound


def joined(log: Log, events: Log) -> Log:
    """Returns a log whose inputs come from a table of events.

    Raises:
        InputError: the clock of one of them starts again, so that events and rows cannot be put in one order.
    """
    for one in (log, events):
        time = one.signals.columns["time"]
        if np.any(np.diff(time) <= 0.0):
            raise InputError("its clock starts again, so that --inputs cannot be joined", file=one.file)
    if log.signals.scalings.get("time") != events.signals.scalings.get("time"):
        raise InputError("its time is written otherwise than that of the log", file=events.file, field="time")
    measured = log.signals.columns["time"]
    columns = with_events(log.signals.columns, events.signals.columns)
    starts = np.searchsorted(columns["time"], measured[list(log.starts)])
    scalings = {
        **log.signals.scalings,
        **{name: one for name, one in events.signals.scalings.items() if SIGNALS[name].kind == "input"},
    }
    added = columns["time"].size - measured.size
    first = events.signals.columns["time"][0]
    notes = [*log.notes, *(f"{events.file.name}: {note}" for note in events.notes)]
    notes.append(f"{added} rows are added where an input of {events.file.name} changes between two rows")
    if first > measured[0]:
        notes.append(f"before the first event of {events.file.name} the inputs are taken as 0")
    return dataclasses.replace(
        log, signals=Mapped(columns, scalings), starts=tuple(starts.tolist()), notes=tuple(notes)
    )
