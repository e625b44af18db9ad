"""The headers with values of plant, controllers, model coefficients, settings and instructions of the H8/300.

- sim_host/models/rcx_gen.h: the plant's presets, from the vehicle file `rcx.toml`.
- tests/numeric/controllers_gen.h: the controller's constants for both profiles, in SI units and not rounded.
- tests/numeric/model_sets_gen.h: sets of the model's coefficients, with the SI values from which they are made.
- firmware/app/settings_gen.h: the firmware's table of settings; the settings' names also go into brickpilot.dbc.
- hal/h8sim/states_gen.h: the memory accesses of each H8/300 instruction, for the simulator.
"""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.vehicle.coefficients import PROFILES, body
from brickpilot.vehicle.fixed_point import INDENT, QuantisationError, initialiser
from brickpilot.vehicle.settings import INT32, Setting, plain


def plant_presets(vehicle: Mapping[str, Any]) -> str:
    """Returns the header's text.

    Args:
        vehicle: the tables `parameters`, `rates` and `sensors.*` of a vehicle file; each entry is `{value, unit,
            basis}`.
    """
    tables = [("RCX", vehicle["parameters"]), ("RCX", vehicle["rates"])]
    tables += [(f"RCX_{sensor.upper()}", table) for sensor, table in vehicle["sensors"].items()]
    blocks = "\n".join(
        "".join(f"#define {prefix}_{name.upper()} {entry['value']!r}\n" for name, entry in table.items())
        for prefix, table in tables
    )
    return f"""/* The vehicle's values, in SI units. */
#ifndef BRICKPILOT_MODELS_RCX_GEN_H
#define BRICKPILOT_MODELS_RCX_GEN_H

{blocks}
#endif
"""


OF_THE_LOOP = ("lost_time", "watchdog_time", "silent_time", "telemetry_every")


def controllers(vehicle: Mapping[str, Any]) -> str:
    """Returns the header's text.

    Args:
        vehicle: a vehicle file's tables.
    """
    blocks = []
    for profile in PROFILES:
        own = plain(vehicle["controller"][profile])
        constants = {
            "acceptance": plain(vehicle["robot"])["length"] / 2,
            **{name: value for name, value in own.items() if name not in OF_THE_LOOP},
            "accel_filter_time": plain(vehicle["estimator"])["accel_filter_time"],
        }
        fields = [f"{INDENT}.{name} = {value!r},\n" for name, value in constants.items()]
        blocks.append(f"static const double_constants_t CONTROLLER_{profile.upper()} = {{\n{''.join(fields)}}};\n")
    text = "\n".join(blocks)
    return f"""/* The controller's constants, in SI units. */
#ifndef BRICKPILOT_TESTS_CONTROLLERS_GEN_H
#define BRICKPILOT_TESTS_CONTROLLERS_GEN_H

#include "double_controller.h"

{text}
#endif
"""


SEED = 2006
PERTURBED_SETS = 6
SPREAD = 0.25
FIXED = ("gravity", "air_density", "battery_voltage")


def value_sets(nominal: Mapping[str, float]) -> list[dict[str, float]]:
    """Returns the set of nominal values, then sets drawn within +-25 % of it. Constants and supply are not drawn."""
    draw = random.Random(SEED)
    sets = [dict(nominal)]
    for _ in range(PERTURBED_SETS):
        perturbed = {
            name: value if name in FIXED else float(f"{value * draw.uniform(1 - SPREAD, 1 + SPREAD):.6g}")
            for name, value in nominal.items()
        }
        # Eq. 16 and 17 follow from eq. 12: with inconsistent values, full voltage would brake.
        torque, volts = perturbed["torque_constant"], perturbed["battery_voltage"]
        perturbed["stall_torque"] = torque * volts / perturbed["resistance"]
        perturbed["no_load_speed"] = volts / perturbed["emf_constant"]
        sets.append(perturbed)
    return sets


def model_sets(nominal: Mapping[str, float], step: float) -> str:
    """Returns the header's text."""
    blocks = []
    for values in value_sets(nominal):
        numbers = ", ".join(f"{values[name]!r}" for name in nominal)
        bodies = [f".{profile} = {initialiser(body(profile, values, step), 1)}" for profile in PROFILES]
        blocks.append("    {.value = {" + numbers + "},\n     " + ",\n     ".join(bodies) + "},")
    quoted, sets = ", ".join(f'"{name}"' for name in nominal), "\n".join(blocks)
    return f"""/* Vehicles in SI units, and the firmware's coefficients:
 * the nominal vehicle, then {PERTURBED_SETS} up to {SPREAD:.0%} off. */
#ifndef BRICKPILOT_TESTS_MODEL_SETS_GEN_H
#define BRICKPILOT_TESTS_MODEL_SETS_GEN_H

#include "model/body.h"

enum {{ MODEL_SETS = {PERTURBED_SETS + 1}, MODEL_SET_VALUES = {len(nominal)} }};

static const char *const MODEL_SET_NAME[MODEL_SET_VALUES] = {{{quoted}}};

static const struct {{
    double value[MODEL_SET_VALUES];
    body_coefficients_t coupled;
    body_coefficients_t paper;
}} MODEL_SET[MODEL_SETS] = {{
{sets}
}};

#endif
"""


RANGES_MOST = 16
"""Largest number of ranges: parameters.c has 4 bits for the number of a range."""

_VALUE_TABLE = re.compile(r"^VAL_ 256 parameter .*;$", re.MULTILINE)


def ranges(settings: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """Returns the different ranges, (low, high); ranges without negative values come first.

    Raises:
        QuantisationError: there are more ranges than the firmware's table has bits for.
    """
    pairs = sorted({(one.low, one.high) for one in settings.values()}, key=lambda pair: (pair[0] < 0, pair))
    if len(pairs) > RANGES_MOST:
        raise QuantisationError(f"{len(pairs)} ranges: parameters.c has bits for {RANGES_MOST}")
    return pairs


def settings_table(settings: Mapping[str, Setting]) -> str:
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


PLACES = ("nothing", "stack", "register", "short", "word", "displaced", "stepped")
"""Where an instruction's data are, as in the table; nothing: the instruction has no data."""


@dataclass(frozen=True)
class Cost:
    """Accesses of an instruction: ``code`` words, and ``words`` and ``data_bytes`` at ``place``; and ``own`` states."""

    code: int
    words: int
    data_bytes: int
    own: int
    place: str


def h8_costs(text: str) -> dict[int, Cost]:
    """Returns first byte of an H8/300 instruction -> memory accesses, from the text of `hal/h8sim/states.toml`.

    An instruction's number of states depends neither on the data nor on whether a branch is taken. The only exception
    is `eepmov`, whose number of states depends on its count, so `eepmov` is not in the table.
    """
    costs: dict[int, Cost] = {}
    for row in tomllib.loads(text)["instruction"]:
        words, data_bytes, own = (row.get(key, 0) for key in ("words", "bytes", "own"))
        cost = Cost(row["code"], words, data_bytes, own, row.get("at", "nothing"))
        for first in row["first"]:
            begin, end = first if isinstance(first, list) else (first, first)
            costs.update(dict.fromkeys(range(begin, end + 1), cost))
    return costs


_H8_HEAD = """#ifndef BRICKPILOT_H8SIM_STATES_GEN_H
#define BRICKPILOT_H8SIM_STATES_GEN_H

#include <stdint.h>

/* Where the data of an instruction lie. */
enum {
%s
};

/* Accesses by the first byte of an instruction: words of code, words and bytes at `where`; and its own states.
 * All 0: the sum is not fixed. */
typedef struct {
    uint8_t code, words, bytes, own, where;
} instruction_t;

static const instruction_t INSTRUCTIONS[256] = {
%s
};

#endif
"""


def h8_states(table: str) -> str:
    """Returns the header's text; `table`: the text of states.toml."""
    kinds = ",\n".join(f"    AT_{place.upper()}" for place in PLACES)
    rows = [
        f"    [0x{first:02X}] = {{{cost.code}, {cost.words}, {cost.data_bytes}, {cost.own}, AT_{cost.place.upper()}}}"
        for first, cost in sorted(h8_costs(table).items())
    ]
    return _H8_HEAD % (kinds, ",\n".join(rows))
