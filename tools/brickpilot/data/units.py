"""Units of measured columns, by pint with its own registry.

pint's default registry treats angles as plain numbers: it would accept "1/s" or "Hz" as a turn rate, which would be
wrong by a factor of 2 pi. Here the angle is a dimension, and only units that occur in logs are known. Standard gravity
is "g0"; "g" is the gram.
"""

from __future__ import annotations

import re
from functools import cache

import pint

_DEFINITIONS = """
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
meter = [length] = m = metre
second = [time] = s = sec
gram = [mass] = g
ampere = [current] = A = amp
radian = [angle] = rad
minute = 60 * second = min
hour = 60 * minute = h
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft = feet
degree = 0.017453292519943295 * radian = deg = °
turn = 6.283185307179586 * radian = _ = rotation = revolution = rev
rpm = turn / minute
percent = 0.01 = %
standard_gravity = 9.80665 * meter / second ** 2 = g0 = g_0
newton = kilogram * meter / second ** 2 = N
volt = newton * meter / second / ampere = V
"""
# The only numbers in a unit are small exponents, so that pint has no arithmetic to do in a user's text.
_FACTOR = r"(?:1|%|[A-Za-zµμ°][A-Za-z0µμ°_]*)(?:(?:\^|\*\*)-?[1-4])?"
_UNIT = re.compile(rf"\s*{_FACTOR}(?:\s*[*/·\s]\s*{_FACTOR})*\s*")
_HINTS = {
    "g": "it is the gram; standard gravity is g0",
    "count": 'give the unit of scale * count, e.g. unit = "rad" with a scale',
    "counts": 'give the unit of scale * count, e.g. unit = "rad" with a scale',
    "Hz": 'write "rotation/s", "rpm" or "rad/s"',
    "1/s": 'write "rotation/s", "rpm" or "rad/s"',
}


@cache
def _registry() -> pint.UnitRegistry[float]:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry


@cache
def si_factor(unit: str, si_unit: str) -> float:
    """Returns the factor from `unit` to `si_unit`.

    Args:
        unit: as written in a data set, e.g. ``deg/s``, ``mm``, ``g0``, ``1``.
        si_unit: a unit of the same dimension, e.g. ``rad/s``.

    Raises:
        ValueError: an unknown unit, or a unit of another dimension. The message is for the user.
    """
    hint = f"; {_HINTS[unit.strip()]}" if unit.strip() in _HINTS else ""
    if len(unit) > 40 or not _UNIT.fullmatch(unit):
        raise ValueError(f"{unit!r} is not a unit; {si_unit} would do")
    registry = _registry()
    try:
        return float(registry.Quantity(1.0, registry.parse_units(unit)).to(si_unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"{unit!r} is of another kind than {si_unit}{hint}") from error
    except (pint.PintError, ArithmeticError, ValueError) as error:
        raise ValueError(f"unknown unit {unit!r}; {si_unit} would do{hint}") from error
