"""The signals that a data set may hold: kind, SI unit and vehicle of each; and the units of measured columns.

Units are read by pint with its own registry. pint's default registry treats angles as plain numbers: "1/s" or "Hz"
would be accepted as a turn rate, with an error by a factor of 2 pi. Here the angle is a dimension, and only units that
occur in logs are known. Standard gravity is "g0"; "g" is the gram.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
import pint
from numpy.typing import NDArray

Vehicle = Literal["diff_drive", "motor"]
Frame = Literal["FLU", "FRD"]
Kind = Literal["time", "input", "output"]

TURNS_WITH_FRAME = frozenset({"accel_sway", "sway", "yaw_rate", "yaw_angle", "reference_yaw_rate"})


@dataclass(frozen=True)
class SignalType:
    """A known signal.

    Attributes:
        unit: SI unit of its values after reading.
        largest: magnitude beyond which a cell is refused. It is far above any machine and sensor, so that a single
            wrong reading is a fault of the sensor and not of the file.
    """

    unit: str
    kind: Kind
    largest: float
    vehicles: frozenset[Vehicle]


_BOTH: frozenset[Vehicle] = frozenset({"diff_drive", "motor"})
_DIFF: frozenset[Vehicle] = frozenset({"diff_drive"})
_MOTOR: frozenset[Vehicle] = frozenset({"motor"})


def _sides(name: str, unit: str, kind: Kind, largest: float) -> dict[str, SignalType]:
    return {f"{name}_{side}": SignalType(unit, kind, largest, _DIFF) for side in ("left", "right")}


SIGNALS: dict[str, SignalType] = {
    "time": SignalType("s", "time", 1e11, _BOTH),
    **_sides("voltage", "V", "input", 1e5),
    **_sides("duty", "1", "input", 1e5),
    "duty_mean": SignalType("1", "input", 1e5, _DIFF),
    "duty_diff": SignalType("1", "input", 1e5, _DIFF),
    **_sides("reference_wheel_speed", "rad/s", "input", 1e6),
    "reference_velocity": SignalType("m/s", "input", 1e6, _DIFF),
    "reference_yaw_rate": SignalType("rad/s", "input", 1e6, _DIFF),
    "reference_speed": SignalType("rad/s", "input", 1e6, _MOTOR),
    "voltage": SignalType("V", "input", 1e5, _MOTOR),
    "duty": SignalType("1", "input", 1e5, _MOTOR),
    "accel_surge": SignalType("m/s^2", "output", 1e6, _DIFF),
    "accel_sway": SignalType("m/s^2", "output", 1e6, _DIFF),
    "yaw_rate": SignalType("rad/s", "output", 1e6, _DIFF),
    "yaw_angle": SignalType("rad", "output", 1e9, _DIFF),
    **_sides("wheel_speed", "rad/s", "output", 1e6),
    **_sides("wheel_angle", "rad", "output", 1e9),
    **_sides("wheel_travel", "m", "output", 1e9),
    **_sides("wheel_velocity", "m/s", "output", 1e6),
    **_sides("current", "A", "output", 1e6),
    "battery_voltage": SignalType("V", "output", 1e5, _BOTH),
    "speed": SignalType("rad/s", "output", 1e6, _MOTOR),
    "angle": SignalType("rad", "output", 1e9, _MOTOR),
    "position": SignalType("m", "output", 1e9, _MOTOR),
    "velocity": SignalType("m/s", "output", 1e6, _MOTOR),
    "current": SignalType("A", "output", 1e6, _MOTOR),
    "force": SignalType("N", "output", 1e9, _MOTOR),
}

INPUT_SETS: dict[Vehicle, tuple[tuple[str, ...], ...]] = {
    "diff_drive": (
        ("voltage_left", "voltage_right"),
        ("duty_left", "duty_right"),
        ("duty_mean", "duty_diff"),
        ("reference_wheel_speed_left", "reference_wheel_speed_right"),
        ("reference_velocity", "reference_yaw_rate"),
    ),
    "motor": (("voltage",), ("duty",), ("reference_speed",)),
}
"""The inputs of a vehicle: exactly one of these sets, complete."""

INITIAL_UNITS: dict[Vehicle, dict[str, str]] = {
    "diff_drive": {
        "surge": "m/s", "sway": "m/s", "yaw_rate": "rad/s", "yaw_angle": "rad",
        "wheel_speed_left": "rad/s", "wheel_speed_right": "rad/s",
        "wheel_angle_left": "rad", "wheel_angle_right": "rad",
        "current_left": "A", "current_right": "A",
    },
    "motor": {"speed": "rad/s", "angle": "rad", "position": "m", "velocity": "m/s", "current": "A"},
}  # fmt: skip
"""The state that a run's ``initial`` may give, in SI and in the data set's frame."""

RATE_OF: dict[str, str] = {"angle": "speed", "position": "velocity"} | {
    f"wheel_{summed}_{side}": f"wheel_{rate}_{side}"
    for summed, rate in (("angle", "speed"), ("travel", "velocity"))
    for side in ("left", "right")
}
"""Angle, position or travel -> its rate, which the same sensor measures."""

SUMMED = frozenset(RATE_OF) | {"yaw_angle"}
"""Signals that sum up motion from an arbitrary origin: only their change since the first sample has a meaning."""


def input_names(inputs: Mapping[str, object]) -> tuple[str, ...]:
    """Returns the names of a complete set of inputs, in the order of `INPUT_SETS`."""
    return next(names for sets in INPUT_SETS.values() for names in sets if names[0] in inputs)


def of_motors(inputs: Mapping[str, NDArray[np.float64]], half_track: float) -> NDArray[np.float64]:
    """Returns what each motor is given, in the inputs' unit: (n, 2) left and right, or (n, 1). NaN: it floats.

    Args:
        inputs: signal -> (n,), in SI and the paper's frame.
        half_track: m, with which a velocity and a yaw rate become the velocities of two wheels.
    """
    names = input_names(inputs)
    columns = np.column_stack([inputs[name] for name in names])
    arm = {"duty_mean": 0.5, "reference_velocity": half_track}.get(names[0])
    if arm is None:
        return columns
    return np.column_stack([columns[:, 0] + arm * columns[:, 1], columns[:, 0] - arm * columns[:, 1]])


def to_frd(signal: str, values: NDArray[np.float64], frame: Frame) -> NDArray[np.float64]:
    """Returns the values of `signal` in the paper's frame (x forward, y right, clockwise positive).

    FLU differs by half a turn about x: lateral and yaw values change sign; left and right remain.
    """
    return -values if frame == "FLU" and signal in TURNS_WITH_FRAME else values


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
# The only numbers are small powers: a unit contains no arithmetic.
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
        ValueError: an unknown unit, or one of another dimension. The message is for the user.
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
