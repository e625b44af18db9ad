"""Converts real numbers to the firmware's fixed-point formats, and writes C initialisers of the firmware's structs.

A value that would lose too much precision is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MANTISSA_BITS = 15
MAX_SHIFT = 31
NEGLIGIBLE = 2.0**-32
"""A smaller factor becomes 0: its product with the largest 32-bit number is less than half a count."""


class QuantisationError(ValueError):
    """A value that its fixed-point format cannot hold with enough precision."""


@dataclass(frozen=True)
class Scale:
    """A `scale_t`: mantissa * 2^-(15 + shift), or mantissa * 2^-shift if it multiplies a 16-bit value."""

    mantissa: int
    shift: int

    @property
    def factor(self) -> float:
        """The real number that `scale_apply` multiplies by."""
        return self.mantissa * 2.0 ** -(MANTISSA_BITS + self.shift)

    @property
    def factor16(self) -> float:
        """The real number that `scale_apply16` multiplies by."""
        return self.mantissa * 2.0**-self.shift


def scale(value: float, name: str) -> Scale:
    """Returns the nearest `scale_t` for `scale_apply`; abs(value) has to be below 1.

    The relative error of the result is at most 3.1e-5; a value below `NEGLIGIBLE` becomes 0.

    Raises:
        QuantisationError: the value is too large.
    """
    if abs(value) < NEGLIGIBLE:
        return Scale(0, 0)
    exponent = math.frexp(abs(value))[1]
    shift = min(-exponent, MAX_SHIFT)
    mantissa = round(math.ldexp(value, MANTISSA_BITS + shift))
    if abs(mantissa) > 2**MANTISSA_BITS - 1:
        mantissa, shift = round(math.ldexp(value, MANTISSA_BITS + shift - 1)), shift - 1
    if shift < 0:
        raise QuantisationError(f"{name}: {value:g} is not below 1")
    return Scale(mantissa, shift)


def scale16(value: float, name: str) -> Scale:
    """Returns the nearest `scale_t` for `scale_apply16`; abs(value) has to be below 32767. Raises as `scale`."""
    return scale(value / 2**MANTISSA_BITS, name)


def integer(value: float, low: int, high: int, name: str) -> int:
    """Returns `value` rounded to an integer in low..high.

    Raises:
        QuantisationError: the rounded value is outside low..high, or a value other than 0 rounds to 0.
    """
    rounded = round(value)
    if not low <= rounded <= high:
        raise QuantisationError(f"{name}: {value:g} is outside {low}..{high}")
    if rounded == 0 and value != 0:
        raise QuantisationError(f"{name}: {value:g} rounds to 0")
    return rounded


INDENT = "    "


def comment(text: str) -> str:
    """Returns `text` as a C comment. A text from a file may contain comment marks, so these are broken up."""
    return f"/* {text.replace('*/', '* /').replace('/*', '/ *')} */"


def initialiser(value: Any, depth: int) -> str:
    """Returns a C initialiser. `value`: a Scale, bool, int or name (str), or a list or mapping (by field) of values."""
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
