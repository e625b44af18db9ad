"""tests/numeric/model_sets_gen.h: the model's coefficients, beside the SI values that they were made from."""

from __future__ import annotations

import random
from collections.abc import Mapping

from brickpilot.vehicle.c_text import body_initialiser
from brickpilot.vehicle.coefficients import PROFILES, pose

SEED = 2006
PERTURBED_SETS = 6
SPREAD = 0.25
FIXED = ("gravity", "air_density", "battery_voltage")


def _follow_from_the_motor(values: dict[str, float]) -> None:
    """Computes the values of eq. 16 and 17 from those of eq. 12. If they disagreed, full voltage would brake."""
    values["stall_torque"] = values["torque_constant"] * values["battery_voltage"] / values["resistance"]
    values["no_load_speed"] = values["battery_voltage"] / values["emf_constant"]


def value_sets(nominal: Mapping[str, float]) -> list[dict[str, float]]:
    """Returns the nominal values, then sets drawn within +-25 %. Constants, the supply and derived values stay."""
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


def render(nominal: Mapping[str, float], step: float) -> str:
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
