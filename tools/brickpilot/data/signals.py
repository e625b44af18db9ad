"""The signals that a data set may hold, with the kind, the SI unit and the vehicles of each signal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import VEHICLES as VEHICLES
from brickpilot.constants import Vehicle as Vehicle

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)
Frame = Literal["FLU", "FRD"]
Kind = Literal["time", "input", "output"]

TURNS_WITH_FRAME = frozenset({"accel_sway", "sway", "yaw_rate", "yaw_angle", "reference_yaw_rate"})


@dataclass(frozen=True)
class SignalType:
    """A known signal.

    Attributes:
        unit: SI unit of the signal's values after reading.
        largest: the largest accepted magnitude, in `unit`; a larger cell is an error in the file. The limit is far
            above the values of any machine, so that a wrong reading of a sensor is accepted and later counts as a
            sensor fault.
    """

    unit: str
    kind: Kind
    largest: float
    vehicles: frozenset[Vehicle]


_ALL: frozenset[Vehicle] = frozenset(VEHICLES)
_SIDED: frozenset[Vehicle] = frozenset({"diff_drive", "skid_steer"})
_MOTOR: frozenset[Vehicle] = frozenset({"motor"})


def _sides(name: str, unit: str, kind: Kind, largest: float) -> dict[str, SignalType]:
    return {f"{name}_{side}": SignalType(unit, kind, largest, _SIDED) for side in ("left", "right")}


SIGNALS: dict[str, SignalType] = {
    "time": SignalType("s", "time", 1e11, _ALL),
    **_sides("voltage", "V", "input", 1e5),
    **_sides("duty", "1", "input", 1e5),
    "duty_mean": SignalType("1", "input", 1e5, _SIDED),
    "duty_diff": SignalType("1", "input", 1e5, _SIDED),
    **_sides("reference_wheel_speed", "rad/s", "input", 1e6),
    "reference_velocity": SignalType("m/s", "input", 1e6, _SIDED),
    "reference_yaw_rate": SignalType("rad/s", "input", 1e6, _SIDED),
    "reference_speed": SignalType("rad/s", "input", 1e6, _MOTOR),
    "voltage": SignalType("V", "input", 1e5, _MOTOR),
    "duty": SignalType("1", "input", 1e5, _MOTOR),
    "accel_surge": SignalType("m/s^2", "output", 1e6, _SIDED),
    "accel_sway": SignalType("m/s^2", "output", 1e6, _SIDED),
    "yaw_rate": SignalType("rad/s", "output", 1e6, _SIDED),
    "yaw_angle": SignalType("rad", "output", 1e9, _SIDED),
    **_sides("wheel_speed", "rad/s", "output", 1e6),
    **_sides("wheel_angle", "rad", "output", 1e9),
    **_sides("wheel_travel", "m", "output", 1e9),
    **_sides("wheel_velocity", "m/s", "output", 1e6),
    **_sides("current", "A", "output", 1e6),
    "battery_voltage": SignalType("V", "output", 1e5, _ALL),
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
INPUT_SETS["skid_steer"] = INPUT_SETS["diff_drive"]
"""Vehicle -> its sets of inputs: a data set has all inputs of one set, and no input of another set."""

INITIAL_UNITS: dict[Vehicle, dict[str, str]] = {
    "diff_drive": {
        "surge": "m/s", "sway": "m/s", "yaw_rate": "rad/s", "yaw_angle": "rad",
        "wheel_speed_left": "rad/s", "wheel_speed_right": "rad/s",
        "wheel_angle_left": "rad", "wheel_angle_right": "rad",
        "current_left": "A", "current_right": "A",
    },
    "motor": {"speed": "rad/s", "angle": "rad", "position": "m", "velocity": "m/s", "current": "A"},
}  # fmt: skip
INITIAL_UNITS["skid_steer"] = INITIAL_UNITS["diff_drive"]
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
    """Returns the input of each motor, in the inputs' unit: (n, 2) left and right, or (n, 1). NaN: the motor floats.

    Args:
        inputs: signal -> (n,), in SI and the paper's frame.
        half_track: m, used to convert a velocity and a yaw rate to the velocities of two wheels.
    """
    names = input_names(inputs)
    columns = np.column_stack([inputs[name] for name in names])
    arm = {"duty_mean": 0.5, "reference_velocity": half_track}.get(names[0])
    if arm is None:
        return columns
    return np.column_stack([columns[:, 0] + arm * columns[:, 1], columns[:, 0] - arm * columns[:, 1]])


def to_frd(signal: str, values: Number, frame: Frame) -> Number:
    """Returns the value or values of `signal` in the paper's frame (x forward, y right, clockwise positive).

    FLU is this frame after half a turn about x. So lateral and yaw values change sign; signals named left or right do
    not.
    """
    return -values if frame == "FLU" and signal in TURNS_WITH_FRAME else values
