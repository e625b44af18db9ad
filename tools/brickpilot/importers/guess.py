"""Guesses which signal each column of a log is, from its name and its values, and says why.

A column that neither the name nor the values explain is left out, with a note. Nothing is guessed in a log without a
header.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.wiring import COUNTS_A_TURN
from brickpilot.data.signals import INPUT_SETS, SIGNALS, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.column_rules import Taken, column_of, taken_for
from brickpilot.importers.formula import Place
from brickpilot.importers.mapping import Source, parse_mapping
from brickpilot.importers.text_table import TextTable

Vector = NDArray[np.float64]

_LOOKED_AT = 200_000  # rows, so that the guess for a long log is fast


@dataclass(frozen=True)
class Guess:
    """The guessed signals of a log's columns.

    Attributes:
        sources: signal -> column, formula and unit.
        vehicle: None: neither stated nor guessed.
        reasons: signal -> the reason of the guess.
        notes: for the user, a sentence each.
        guessed: unstated numbers that everything depends on, such as "960 counts a turn".
    """

    sources: dict[str, Source]
    vehicle: Vehicle | None
    reasons: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    guessed: tuple[str, ...] = ()


def guess(table: TextTable, mapping: Sequence[str], vehicle: Vehicle | None) -> Guess:
    """Returns the guessed signals of a table's columns.

    Args:
        table: with a header.
        mapping: entries of ``--map``, which are kept.
        vehicle: None: a log with a column of the left or the right is a diff_drive's, any other a motor's.

    Raises:
        InputError: no header, a bad entry of `mapping`, or neither time nor input is found.
    """
    if not table.header:
        raise InputError("needs a header that names the columns", file=table.file, field="--guess")
    stated = parse_mapping(mapping, partly=True)
    columns = [column_of(name, _values(table, name)) for name in table.names if name]
    if vehicle is None:
        turns = any(one.words >= {"cmd", "vel"} for one in columns)  # a demand to a vehicle
        vehicle = "diff_drive" if turns or any(one.side for one in columns) else "motor"
    sources, reasons = dict(stated), {signal: "stated by --map" for signal in stated}
    left_out: list[str] = []
    asked: list[str] = []
    driven = any(one.words & {"pwm", "duty"} for one in columns)
    for column in columns:
        found = taken_for(column, columns, driven)
        problem = found if isinstance(found, str) else _problem(found, sources, vehicle)
        if isinstance(found, str) or problem:
            if not any(column.name in one.text for one in stated.values()):
                left_out.append(f"{column.name} is left out: {problem}")
                asked += [found] if isinstance(found, str) and "--map 'duty" in found else []
            continue
        sources[found.signal] = Source(found.formula, found.unit)
        reasons[found.signal] = found.reason
    left_out += _one_input_set(sources, reasons, vehicle)
    _check_found(table, sources, asked)
    notes = [f"guessed: {signal} is {one.text}, in {one.unit}: {reasons[signal]}" for signal, one in sources.items()]
    bases, loud = _guessed_bases({signal: one for signal, one in sources.items() if signal not in stated})
    return Guess(sources, vehicle, reasons, (*notes, *loud, *left_out), tuple(bases))


def _guessed_bases(sources: Mapping[str, Source]) -> tuple[list[str], list[str]]:
    """Returns each unstated number that every speed or voltage depends on, and a note on it in capitals."""
    bases, notes = [], []
    for stems, base, what, spoiled, form in (
        (("wheel_angle", "angle"), COUNTS_A_TURN, "how many counts a turn has", "speed", "COUNTS:rotation"),
        (("duty",), " as full drive", "which number is full drive", "voltage", "FULL"),
    ):
        scaled = [one.text.split("/") for name, one in sources.items() if name.startswith(stems) and "/" in one.text]
        if scaled:
            columns, number = " and ".join(column for column, _ in scaled), scaled[0][1]
            bases.append(f"{number}{base}")
            notes.append(
                f"NOBODY SAID {what}: {number} IS A GUESS for {columns}, and every {spoiled} is wrong by as much as it "
                f"is; state it with --map SIGNAL=COLUMN/{form}"
            )
    return bases, notes


def _values(table: TextTable, name: str) -> Vector:
    """Returns the numbers of a column, or none where it holds text."""
    try:
        return table.column(name, Place(name))[0][:_LOOKED_AT]
    except InputError:
        return np.empty(0)


def _problem(found: Taken, sources: Mapping[str, Source], vehicle: Vehicle) -> str | None:
    if found.signal in sources:
        return f"{sources[found.signal].text} is {found.signal} already"
    if found.signal not in SIGNALS or vehicle not in SIGNALS[found.signal].vehicles:
        return f"a {vehicle} has no signal {found.signal}"
    try:
        si_factor(found.unit, SIGNALS[found.signal].unit)
    except ValueError as error:
        return f"it looks like {found.signal}, but {error}"
    return None


def _one_input_set(sources: dict[str, Source], reasons: dict[str, str], vehicle: Vehicle) -> list[str]:
    """Keeps one complete set of inputs in `sources`, and returns the others."""
    sets = INPUT_SETS[vehicle]
    stated = {signal for signal in sources if SIGNALS[signal].kind == "input" and reasons[signal] == "stated by --map"}
    complete = [names for names in sets if all(name in sources for name in names)]
    complete.sort(key=lambda names: (not stated & set(names), not names[0].startswith("duty")))
    chosen = complete[0] if complete else ()
    others = [signal for signal in sources if SIGNALS[signal].kind == "input" and signal not in chosen]
    beside = f"{' and '.join(chosen)} is the input" if chosen else "the other side is not found"
    return [f"{sources.pop(signal).text} is left out: {beside}" for signal in others]


def _check_found(table: TextTable, sources: Mapping[str, Source], asked: Sequence[str]) -> None:
    """Refuses a log without time, input or output; `asked`: what has to be stated of drives that are not guessed."""
    known = ", ".join(table.names[:20])
    kinds = {SIGNALS[signal].kind for signal in sources}
    for kind, example in (("time", "time=COLUMN:ms"), ("input", "duty_left=COLUMN/255"), ("output", "yaw_rate=COLUMN")):
        if kind not in kinds:
            message = f"finds no {'time' if kind == 'time' else f'complete {kind}'} among {known}; add --map {example}"
            message = asked[0] if asked and kind == "input" else message
            raise InputError(message, file=table.file, line=table.first_line, field="--guess")
