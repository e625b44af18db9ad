"""firmware/app/settings_gen.h: the firmware's table of settings; and their names in brickpilot.dbc."""

from __future__ import annotations

import re
from collections.abc import Mapping

from brickpilot.vehicle.quantise import QuantisationError
from brickpilot.vehicle.settings import INT32, Setting

RANGES_MOST = 16
"""parameters.c has 4 bits for the number of a range."""

_VALUE_TABLE = re.compile(r"^VAL_ 256 parameter .*;$", re.MULTILINE)


def ranges(settings: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """Returns the different ranges, (low, high): those without negative values first.

    Raises:
        QuantisationError: more than the firmware's table has bits for.
    """
    found = sorted({(one.low, one.high) for one in settings.values()}, key=lambda pair: (pair[0] < 0, pair))
    if len(found) > RANGES_MOST:
        raise QuantisationError(f"{len(found)} ranges: parameters.c has bits for {RANGES_MOST}")
    return found


def render(settings: Mapping[str, Setting]) -> str:
    """Returns the header's text."""
    known = ranges(settings)
    unsigned = sum(low >= 0 for low, _ in known)
    spans = [(low, 0 if high == INT32 else high - low) for low, high in known]
    bounds = "".join(f" \\\n    X({0 if not span else low}, {span}U)" for low, span in spans)
    rows = "".join(
        f" \\\n    X({one.field}, {known.index((one.low, one.high))}, {int(bool(one.compensation))}) /* {one.name} */"
        for one in settings.values()
    )
    return f"""#ifndef BRICKPILOT_APP_SETTINGS_GEN_H
#define BRICKPILOT_APP_SETTINGS_GEN_H

/* Ranges: the least value, and how far above it the largest is. 0, 0 is that of a field of 32 bits: 1..{INT32}. */
#define SETTINGS_RANGES(X){bounds}

/* From this range on a value may be negative. */
enum {{ SETTINGS_SIGNED_RANGE = {unsigned} }};

enum {{ SETTINGS_COUNT = {len(settings)} }};

/* By number: field of parameters_t, number of its range, and 1 where it is not to be written while the robot drives. */
#define SETTINGS(X){rows}

#endif
"""


def name_in(dbc: str, settings: Mapping[str, Setting]) -> str:
    """Returns the DBC's text with the names of the settings in the value table of PARAMETER_REQUEST."""
    names = " ".join(f'{one.number} "{one.name}"' for one in settings.values())
    text, count = _VALUE_TABLE.subn(f"VAL_ 256 parameter {names} ;", dbc)
    if count != 1:
        raise ValueError("brickpilot.dbc has no line `VAL_ 256 parameter ... ;`")
    return text
