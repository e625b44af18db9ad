"""tests/numeric/controllers_gen.h: the controller's constants for both profiles, in SI units and not rounded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from brickpilot.vehicle.c_text import INDENT
from brickpilot.vehicle.coefficients import PROFILES

OF_THE_LOOP = ("lost_time", "watchdog_time", "silent_time", "telemetry_every")


def _constants(profile: str, vehicle: Mapping[str, Any]) -> dict[str, float]:
    own = vehicle["controller"][profile]
    return {
        "acceptance": float(vehicle["robot"]["length"]["value"]) / 2,
        **{name: float(entry["value"]) for name, entry in own.items() if name not in OF_THE_LOOP},
        "accel_filter_time": float(vehicle["estimator"]["accel_filter_time"]["value"]),
    }


def render(vehicle: Mapping[str, Any]) -> str:
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
