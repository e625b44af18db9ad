"""Reads two options: the source of a signal in a log, `SIGNAL=FORMULA:UNIT`, and nominal values, `NAME=VALUE`."""

from __future__ import annotations

import difflib
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.wiring_motion import Taken
from brickpilot.data.signals import SIGNALS
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError
from brickpilot.importers.formula import Formula, FormulaError, Place, Scaling, parse_formula

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """The source of a signal in a log.

    Attributes:
        text: a column's name, ``name[index]``, or a formula (`formula`).
        unit: the unit of the formula's value.
        states_unit: whether the user stated the unit; otherwise `unit` is the SI unit.
    """

    text: str
    unit: str
    states_unit: bool = True


@dataclass(frozen=True)
class Mapped:
    """The signals of one log.

    Attributes:
        columns: signal -> its cells. A formula that is linear in one column leaves the cells as logged.
        scalings: signal -> conversion of its cells to values in the signal's unit; without signals of scale 1 and
            offset 0.
    """

    columns: dict[str, Vector]
    scalings: dict[str, Scaling]


def parse_mapping(entries: Sequence[str], *, has_time: bool = False, partly: bool = False) -> dict[str, Source]:
    """Returns signal -> source from entries like ``position=qm:mm`` or ``duty_left=pwmL*1/255``.

    The default unit is the SI unit. Formulas are read later, when the names of the log's columns are known.

    Args:
        entries: the entries as the user wrote them.
        has_time: whether the samples of the log have times of their own, so that no time is mapped.
        partly: whether the time may be missing, because the other signals are guessed.

    Raises:
        InputError: an entry of another form, an unknown signal or unit, a signal given twice, or no time.
    """
    sources: dict[str, Source] = {}
    for entry in entries:
        signal, equals, rest = (part.strip() for part in entry.partition("="))
        text, unit = _unit_apart(rest)
        if not (signal and equals and text) or unit == "":
            message = "is not SIGNAL=NAME, SIGNAL=NAME[INDEX], SIGNAL=FORMULA or one of these with :UNIT"
            raise InputError(message, field=f"--map {entry}")
        if signal not in SIGNALS:
            alike = difflib.get_close_matches(signal, list(SIGNALS), 1)
            raise InputError(f"unknown signal{f'; did you mean {alike[0]}?' if alike else ''}", field=f"--map {entry}")
        if signal in sources:
            raise InputError(f"{signal} is mapped already", field=f"--map {entry}")
        try:
            si_factor(unit or SIGNALS[signal].unit, SIGNALS[signal].unit)
        except ValueError as error:
            raise InputError(str(error), field=f"--map {entry}") from error
        sources[signal] = Source(text, unit or SIGNALS[signal].unit, unit is not None)
    if has_time and "time" in sources:
        raise InputError("the samples of this log have times of their own: leave time out", field="--map")
    if not (has_time or partly or "time" in sources):
        raise InputError("time is not mapped", field="--map")
    return sources


def _unit_apart(text: str) -> tuple[str, str | None]:
    """Returns formula and unit, split at the last colon. No unit begins with a slash: ``NT:/drive/left`` has none."""
    head, colon, unit = text.rpartition(":")
    if not colon or unit.startswith("/"):
        return text, None
    return head.strip(), unit.strip()


def read_formulas(sources: Mapping[str, Source], names: Sequence[str]) -> dict[str, Formula]:
    """Returns signal -> formula, for a log that has the columns `names`.

    A formula may name an unknown column; the reader of the log refuses it later (`formula.unknown_name`).

    Raises:
        InputError: a text that is no formula.
    """
    formulas = {}
    for signal, source in sources.items():
        try:
            formulas[signal] = parse_formula(source.text, names)
        except FormulaError as error:
            raise InputError(str(error), field=f"--map {signal}={source.text}") from error
    return formulas


def take(formulas: Mapping[str, Formula], column: Callable[[str, Place], Vector], file: Path) -> Mapped:
    """Returns the signals of one log.

    Args:
        formulas: the result of `read_formulas`.
        column: function that returns the cells of a place for a signal, NaN where blank, or raises an InputError.
        file: the log, which errors name.

    Raises:
        InputError: a formula that has no finite value in some rows.
    """
    columns, scalings = {}, {}
    for signal, formula in formulas.items():
        cells = {place: column(signal, place) for place in formula.places}
        if formula.scaling is not None:
            columns[signal] = cells[formula.places[0]]
            if formula.scaling != Scaling():
                scalings[signal] = formula.scaling
            continue
        try:
            columns[signal] = formula.values(cells)
        except FormulaError as error:
            raise InputError(str(error), file=file, field=signal) from error
    return Mapped(columns, scalings)


def common_scalings(logs: Sequence[Mapped], files: Sequence[Path]) -> dict[str, Scaling]:
    """Returns signal -> scaling of all the logs of a data set.

    Raises:
        InputError: a formula has another meaning in one log, because its columns have other names.
    """
    for log, file in zip(logs, files, strict=True):
        if log.scalings != logs[0].scalings:
            raise InputError(f"its columns are named otherwise than those of {files[0]}", file=file)
    return dict(logs[0].scalings)


def parse_nominal(entries: Sequence[str]) -> dict[str, float]:
    """Returns parameter -> value in SI from entries like ``mass=0.6``.

    Names and ranges are checked later, when the data set is written.

    Raises:
        InputError: an entry that is not of this form; the message names it.
    """
    nominal: dict[str, float] = {}
    for entry in entries:
        name, _, text = entry.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not name.strip() or not math.isfinite(value):
            raise InputError("is not NAME=NUMBER", field=f"--nominal {entry}")
        nominal[name.strip()] = value
    return nominal


def mending(sources: Mapping[str, Source], taken: Mapping[str, Taken]) -> str:
    """Returns the options of `import` that give each signal its right source; "": no options can."""
    found = []
    for signal, one in taken.items():
        if one.source not in sources or not math.isfinite(one.factor):
            continue
        was = sources[one.source]
        unit = f":{was.unit}" if was.states_unit and was.unit != SIGNALS[signal].unit else ""
        found.append(f"--map {shlex.quote(f'{signal}={_times(was.text, one.factor)}{unit}')}")
    return " ".join(found)


def _times(text: str, factor: float) -> str:
    """Returns a formula times a factor, as "encL/1440" of "encL/960"."""
    column, slash, number = text.partition("/")
    try:
        counts = float(number) / factor if slash else math.nan
    except ValueError:
        counts = math.nan
    if math.isfinite(counts):
        return f"{column}/{round(counts) if abs(counts) >= 100 else float(f'{counts:.6g}'):g}"
    if factor == 1.0:
        return text
    plain = text if re.fullmatch(r"[\w./\[\]]+", text) else f"({text})"
    return f"-{plain}" if factor == -1.0 else f"{plain}*{factor:.6g}"


def units_of(sources: Mapping[str, Source]) -> dict[str, str]:
    """Returns signal -> unit."""
    return {signal: source.unit for signal, source in sources.items()}
