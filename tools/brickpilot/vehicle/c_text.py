"""C initialisers for the firmware's structs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from brickpilot.vehicle.coefficients import Coefficients
from brickpilot.vehicle.quantise import Scale

INDENT = "    "


def comment(text: str) -> str:
    """Returns the C comment of a text, which may come from a file: no text can end the comment or begin another."""
    inside = text
    for mark in ("*/", "/*"):
        inside = inside.replace(mark, f"{mark[0]} {mark[1]}")
    return f"/* {inside} */"


def initialiser(value: Any, depth: int) -> str:
    """Returns the C initialiser of a Scale, bool, int, name (str), list of these, or mapping from field to these."""
    if isinstance(value, Scale):
        return f"{{{value.mantissa}, {value.shift}}}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value) if abs(value) <= 32767 else f"{value}{'U' if value <= 65535 else 'UL'}"
    if isinstance(value, str):
        return value
    inner, outer = INDENT * (depth + 1), INDENT * depth
    if isinstance(value, Mapping):
        fields = [f"{inner}.{name} = {initialiser(entry, depth + 1)},\n" for name, entry in value.items()]
    else:
        fields = [f"{inner}{initialiser(entry, depth + 1)},\n" for entry in value]
    return "{\n" + "".join(fields) + outer + "}"


def body_initialiser(profile: str, coefficients: Coefficients, depth: int) -> str:
    """Returns the initialiser of a `body_coefficients_t`."""
    return initialiser({"profile": f"BODY_{profile.upper()}", **coefficients}, depth)
