"""Writes the plant's header of presets, `sim_host/models/rcx_gen.h`, from the vehicle file `rcx.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

HEADER = """/* rcx_gen.h: generated from rcx.toml by tools/brickpilot/gen/plant_presets.py. SI units. */
#ifndef BRICKPILOT_MODELS_RCX_GEN_H
#define BRICKPILOT_MODELS_RCX_GEN_H
"""


def _defines(prefix: str, table: dict[str, Any]) -> list[str]:
    return [f"#define {prefix}_{name.upper()} {entry['value']!r}" for name, entry in table.items()]


def render(vehicle_file: Path) -> str:
    """The header's text.

    Args:
        vehicle_file: a vehicle file with tables `parameters`, `rates` and `sensors.*` of `{value, unit, basis}`.
    """
    vehicle = tomllib.loads(vehicle_file.read_text(encoding="utf-8"))
    blocks = [_defines("RCX", vehicle["parameters"]), _defines("RCX", vehicle["rates"])]
    blocks += [_defines(f"RCX_{sensor.upper()}", table) for sensor, table in vehicle["sensors"].items()]
    body = "\n\n".join("\n".join(block) for block in blocks)
    return f"{HEADER}\n{body}\n\n#endif\n"
