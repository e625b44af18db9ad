"""Reads two options: where a signal stands in a log, `SIGNAL=SOURCE[INDEX]:UNIT`, and nominal values, `NAME=VALUE`."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from brickpilot.data.signals import SIGNALS
from brickpilot.data.units import si_factor
from brickpilot.errors import InputError

_ENTRY = re.compile(r"(?P<signal>\w+)=(?P<name>[^\[\]:=]+)(?:\[(?P<index>\d{1,5})\])?(?::(?P<unit>.+))?")


@dataclass(frozen=True)
class Source:
    """Where a signal stands in a log.

    Attributes:
        name: of a variable or column.
        index: which column of a matrix, from 0; None: the variable is a vector.
        unit: of the values in the log.
    """

    name: str
    index: int | None
    unit: str


def parse_mapping(entries: Sequence[str]) -> dict[str, Source]:
    """Returns signal -> source from entries like ``position=qm:mm`` or ``voltage=data[2]``. The default is the SI unit.

    Raises:
        InputError: an entry of another form, an unknown signal or unit, a signal given twice, or no time.
    """
    sources: dict[str, Source] = {}
    for entry in entries:
        found = _ENTRY.fullmatch(entry.strip())
        if not found:
            raise InputError("is not SIGNAL=NAME, SIGNAL=NAME[INDEX] or either with :UNIT", field=f"--map {entry}")
        signal, unit = found["signal"], found["unit"]
        if signal not in SIGNALS:
            raise InputError("unknown signal", field=f"--map {entry}")
        if signal in sources:
            raise InputError(f"{signal} is mapped already", field=f"--map {entry}")
        try:
            si_factor(unit or SIGNALS[signal].unit, SIGNALS[signal].unit)
        except ValueError as error:
            raise InputError(str(error), field=f"--map {entry}") from error
        index = None if found["index"] is None else int(found["index"])
        sources[signal] = Source(found["name"].strip(), index, unit or SIGNALS[signal].unit)
    if "time" not in sources:
        raise InputError("time is not mapped", field="--map")
    return sources


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


def units_of(sources: dict[str, Source]) -> dict[str, str]:
    """Returns signal -> unit."""
    return {signal: source.unit for signal, source in sources.items()}
