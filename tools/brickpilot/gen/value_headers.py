"""The headers of values: the plant's presets, the controllers, the sets of a model, and the firmware's settings.

- sim_host/models/rcx_gen.h: the plant's presets, from the vehicle file `rcx.toml`.
- tests/numeric/controllers_gen.h: the controller's constants for both profiles, in SI units and not rounded.
- tests/numeric/model_sets_gen.h: sets of the model's coefficients, with the SI values from which they are made.
- firmware/app/settings_gen.h: the firmware's table of settings; and their names in brickpilot.dbc.
"""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from typing import Any

from brickpilot.vehicle.coefficients import PROFILES, pose
from brickpilot.vehicle.fixed_point import INDENT, QuantisationError, body_initialiser
from brickpilot.vehicle.settings import INT32, Setting

_PRESETS_HEAD = """/* The vehicle's values, in SI units. */
#ifndef BRICKPILOT_MODELS_RCX_GEN_H
#define BRICKPILOT_MODELS_RCX_GEN_H
"""


def _defines(prefix: str, table: Mapping[str, Any]) -> list[str]:
    return [f"#define {prefix}_{name.upper()} {entry['value']!r}" for name, entry in table.items()]


def plant_presets(vehicle: Mapping[str, Any]) -> str:
    """Returns the header's text.

    Args:
        vehicle: tables `parameters`, `rates` and `sensors.*` of a vehicle file, of `{value, unit, basis}`.
    """
    blocks = [_defines("RCX", vehicle["parameters"]), _defines("RCX", vehicle["rates"])]
    blocks += [_defines(f"RCX_{sensor.upper()}", table) for sensor, table in vehicle["sensors"].items()]
    body = "\n\n".join("\n".join(block) for block in blocks)
    return f"{_PRESETS_HEAD}\n{body}\n\n#endif\n"


OF_THE_LOOP = ("lost_time", "watchdog_time", "silent_time", "telemetry_every")


def _constants(profile: str, vehicle: Mapping[str, Any]) -> dict[str, float]:
    own = vehicle["controller"][profile]
    return {
        "acceptance": float(vehicle["robot"]["length"]["value"]) / 2,
        **{name: float(entry["value"]) for name, entry in own.items() if name not in OF_THE_LOOP},
        "accel_filter_time": float(vehicle["estimator"]["accel_filter_time"]["value"]),
    }


def controllers(vehicle: Mapping[str, Any]) -> str:
    """Returns the header's text.

    Args:
        vehicle: a vehicle file's tables.
    """
    blocks = []
    for profile in PROFILES:
        fields = [f"{INDENT}.{name} = {value!r},\n" for name, value in _constants(profile, vehicle).items()]
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


def _follow_from_the_motor(values: dict[str, float]) -> None:
    """Computes the values of eq. 16 and 17 from those of eq. 12; with inconsistent values, full voltage would brake."""
    values["stall_torque"] = values["torque_constant"] * values["battery_voltage"] / values["resistance"]
    values["no_load_speed"] = values["battery_voltage"] / values["emf_constant"]


def value_sets(nominal: Mapping[str, float]) -> list[dict[str, float]]:
    """Returns the nominal values, then sets drawn within +-25 %. Constants and the supply are not drawn."""
    draw = random.Random(SEED)
    sets = [dict(nominal)]
    for _ in range(PERTURBED_SETS):
        perturbed = {
            name: value if name in FIXED else float(f"{value * draw.uniform(1 - SPREAD, 1 + SPREAD):.6g}")
            for name, value in nominal.items()
        }
        _follow_from_the_motor(perturbed)
        sets.append(perturbed)
    return sets


def model_sets(nominal: Mapping[str, float], step: float) -> str:
    """Returns the header's text."""
    names = list(nominal)
    blocks = []
    for values in value_sets(nominal):
        numbers = ", ".join(f"{values[name]!r}" for name in names)
        bodies = [
            f".{profile} = {body_initialiser(profile, {**make(values, step), **pose(step)}, 1)}"
            for profile, make in PROFILES.items()
        ]
        blocks.append("    {.value = {" + numbers + "},\n     " + ",\n     ".join(bodies) + "},")
    quoted = ", ".join(f'"{name}"' for name in names)
    return (
        f"""/* Vehicles in SI units, and the firmware's coefficients:
 * the nominal vehicle, then {PERTURBED_SETS} up to {SPREAD:.0%} off. */
#ifndef BRICKPILOT_TESTS_MODEL_SETS_GEN_H
#define BRICKPILOT_TESTS_MODEL_SETS_GEN_H

#include "model/body.h"

enum {{ MODEL_SETS = {PERTURBED_SETS + 1}, MODEL_SET_VALUES = {len(names)} }};

static const char *const MODEL_SET_NAME[MODEL_SET_VALUES] = {{{quoted}}};

static const struct {{
    double value[MODEL_SET_VALUES];
    body_coefficients_t coupled;
    body_coefficients_t paper;
}} MODEL_SET[MODEL_SETS] = {{
"""
        + "\n".join(blocks)
        + "\n};\n\n#endif\n"
    )


RANGES_MOST = 16
"""parameters.c has 4 bits for the number of a range."""

_VALUE_TABLE = re.compile(r"^VAL_ 256 parameter .*;$", re.MULTILINE)


def ranges(settings: Mapping[str, Setting]) -> list[tuple[int, int]]:
    """Returns the different ranges, (low, high); ranges without negative values come first.

    Raises:
        QuantisationError: there are more ranges than the firmware's table has bits for.
    """
    found = sorted({(one.low, one.high) for one in settings.values()}, key=lambda pair: (pair[0] < 0, pair))
    if len(found) > RANGES_MOST:
        raise QuantisationError(f"{len(found)} ranges: parameters.c has bits for {RANGES_MOST}")
    return found


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
