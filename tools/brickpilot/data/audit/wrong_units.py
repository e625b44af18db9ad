"""Factors by which a channel or a clock is wrong when its unit is mistaken for another."""

from __future__ import annotations

from math import pi

from brickpilot.data.signals import SIGNALS

FACTORS = (180 / pi, 30 / pi, 2 * pi, 1000.0, 100.0, 1 / 0.0254, 25.4)
"""Factors between units: degrees, rpm or turns instead of radians; mm, cm or inches instead of m; mA instead of A."""

GRAVITY = 9.80665
"""Factor between m/s^2 and multiples of g. It takes the place of 30 / pi, from which a ratio cannot tell it."""

_LENGTHS = (1000.0, 100.0, 1 / 0.0254, 25.4)
_USUAL = {
    "rad": (180 / pi, 2 * pi, 1000.0),
    "rad/s": (180 / pi, 30 / pi, 2 * pi, 1000.0),
    "m": _LENGTHS,
    "m/s": _LENGTHS,
    "m/s^2": (GRAVITY, *_LENGTHS),
}
_SAME = 1e-9  # relative difference of two equal factors

_CLOCK_UNITS = (1e3, 1e6)
CLOCK_FACTORS = tuple(one for unit in _CLOCK_UNITS for one in (unit, 1 / unit))
"""Factors between units of time: ms or microseconds in place of s, and their inverses."""

_INTERVAL_RATIO = (0.7, 1.4)  # ratio of two sampling intervals over the factor that explains it


def is_unit_factor(factor: float) -> bool:
    """Whether a factor, or its inverse, is one between two units."""
    return _is_one_of(factor, (1.0, GRAVITY, *FACTORS))


def usual_factors(name: str) -> tuple[float, ...]:
    """Returns the factors above 1 by which a channel's own unit is often mistaken."""
    return _USUAL.get(SIGNALS[name].unit if name in SIGNALS else "", (1000.0,))


def is_usual(name: str, factor: float) -> bool:
    """Whether a channel's own unit is often mistaken by this factor or its inverse."""
    return _is_one_of(factor, (1.0, *usual_factors(name)))


def is_clock_factor(factor: float) -> bool:
    """Whether a factor is one between two units of time."""
    return any(abs(factor / one - 1.0) < _SAME for one in CLOCK_FACTORS)


def clock_factors_of(ratio: float) -> list[float]:
    """Returns the factors between units of time that explain the ratio of two sampling intervals."""
    return [one for one in CLOCK_FACTORS if _INTERVAL_RATIO[0] < ratio / one < _INTERVAL_RATIO[1]]


def _is_one_of(factor: float, listed: tuple[float, ...]) -> bool:
    return any(abs(size / one - 1.0) < _SAME for one in listed for size in (abs(factor), 1 / abs(factor)))
