"""Converts real numbers to the firmware's fixed-point formats, and refuses those that would lose too much precision."""

from __future__ import annotations

import math
from dataclasses import dataclass

MANTISSA_BITS = 15
MAX_SHIFT = 31
NEGLIGIBLE = 2.0**-32
"""Multiplied by the largest 32-bit number, it is less than half a count."""


class QuantisationError(ValueError):
    """A value that its fixed-point format cannot hold well enough."""


@dataclass(frozen=True)
class Scale:
    """A `scale_t`: mantissa * 2^-(15 + shift), or mantissa * 2^-shift where it multiplies a 16-bit value."""

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
    """Returns the nearest `scale_t` for `scale_apply`: abs(value) below 1.

    It is within 3.1e-5 of the value; a value below `NEGLIGIBLE` becomes 0.

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
    """Returns the nearest `scale_t` for `scale_apply16`: abs(value) below 32767. Raises as `scale`."""
    return scale(value / 2**MANTISSA_BITS, name)


def integer(value: float, low: int, high: int, name: str) -> int:
    """Returns `value` rounded to an integer in low..high.

    Raises:
        QuantisationError: the value is outside, or is not zero but rounds to zero.
    """
    found = round(value)
    if not low <= found <= high:
        raise QuantisationError(f"{name}: {value:g} is outside {low}..{high}")
    if found == 0 and value != 0:
        raise QuantisationError(f"{name}: {value:g} rounds to 0")
    return found
