"""Writes the plant's header of presets, `sim_host/models/rcx_gen.h`, from the vehicle file `rcx.toml`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

HEADER = """/* The vehicle's values, in SI units. */
#ifndef BRICKPILOT_MODELS_RCX_GEN_H
#define BRICKPILOT_MODELS_RCX_GEN_H
"""


def _defines(prefix: str, table: Mapping[str, Any]) -> list[str]:
    return [f"#define {prefix}_{name.upper()} {entry['value']!r}" for name, entry in table.items()]


def render(vehicle: Mapping[str, Any]) -> str:
    """Returns the header's text.

    Args:
        vehicle: tables `parameters`, `rates` and `sensors.*` of a vehicle file, of `{value, unit, basis}`.
    """
    blocks = [_defines("RCX", vehicle["parameters"]), _defines("RCX", vehicle["rates"])]
    blocks += [_defines(f"RCX_{sensor.upper()}", table) for sensor, table in vehicle["sensors"].items()]
    body = "\n\n".join("\n".join(block) for block in blocks)
    return f"{HEADER}\n{body}\n\n#endif\n"
