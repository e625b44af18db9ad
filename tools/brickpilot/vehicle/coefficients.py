"""Computes the coefficients of the firmware's model from SI values.

The discretisation is exact. The coefficients are in the firmware's units. No sum overflows: this is checked with every
term at its limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from brickpilot.vehicle.combinations import Values, difference_inertia, loss, mean_inertia
from brickpilot.vehicle.fixed_point import QuantisationError, Scale, scale, scale16

# How many counts of the fixed-point formats in firmware/model make one SI unit; q7 means 7 fractional bits.
CURRENT = 1e6 * 2**7  # uA q7
WHEEL_SPEED = 1e3 * 2**13  # mrad/s q13
YAW_RATE = 1e3 * 2**12  # mrad/s q12
SPEED = 1e3 * 2**17  # mm/s q17
THRUST = 1e3 * 2**24  # mm/s q24, change of speed per step
TRAVEL = 1e6 * 2**12  # um q12
SPEED_SQUARED = 1e6 * 2**2  # (mm/s)^2 q2
VOLTAGE = 1e3  # mV
BAM32 = 2**32 / (2 * math.pi)

# Largest values of the signals of firmware/model: V, rad/s (wheel), m/s, rad/s (yaw).
VOLTAGE_LIMIT = 16.383
WHEEL_SPEED_LIMIT = 96.0
SPEED_LIMIT = 8.19
YAW_RATE_LIMIT = 480.0
LOAD_LIMIT = 20.0  # rad/s per step
INT32 = 2**31 - 1

_SETTLED = 1e-6  # s: replaces an electrical time constant of 0; far below a control step of 3 ms


@dataclass(frozen=True)
class MotorStep:
    """x(k + 1) = transition x(k) + voltage V + torque T, with x = (current A, speed rad/s)."""

    transition: NDArray[np.float64]
    voltage: NDArray[np.float64]
    torque: NDArray[np.float64]


def motor_step(values: Values, inertia: float, step: float) -> MotorStep:
    """Returns the solution of eq. 12 and 14 over `step` s at constant voltage and torque, by the matrix exponential.

    If the inductance is 0, because the data do not show the inductance, the electrical time constant is `_SETTLED`.
    """
    resistance = values["resistance"]
    inductance = values["inductance"] or _SETTLED * resistance
    system = np.zeros((4, 4))
    system[0] = [-resistance / inductance, -values["emf_constant"] / inductance, 1 / inductance, 0]
    system[1] = [values["torque_constant"] / inertia, -loss(values) / inertia, 0, 1 / inertia]
    exact = np.asarray(expm(system * step), dtype=np.float64)
    return MotorStep(exact[:2, :2], exact[:2, 2], exact[:2, 3])


def _motor(exact: MotorStep, share: float, name: str) -> dict[str, dict[str, Scale]]:
    """Returns a motor's coefficients. `share`: factor on the input; 0.5 if it is a sum or difference of voltages."""
    transition, voltage = exact.transition, exact.voltage * share
    return {
        "current": {
            "from_current": scale(transition[0, 0], f"{name} current from current"),
            "from_speed": scale(transition[0, 1] * CURRENT / WHEEL_SPEED, f"{name} current from speed"),
            "from_voltage": scale16(voltage[0] * CURRENT / VOLTAGE, f"{name} current from voltage"),
        },
        "speed": {
            "from_current": scale(transition[1, 0] * WHEEL_SPEED / CURRENT, f"{name} speed from current"),
            "from_speed": scale(transition[1, 1] - 1, f"{name} speed from speed"),
            "from_voltage": scale16(voltage[1] * WHEEL_SPEED / VOLTAGE, f"{name} speed from voltage"),
        },
    }


def _fits(bound: float, name: str) -> None:
    if bound > INT32:
        raise QuantisationError(f"{name} may reach {bound / INT32:.3g} times what 32 bits hold")


def prove_motor(exact: MotorStep, name: str, wheels: int = 1) -> None:
    """Proves that a motor's sums fit 32 bits with every term at its limit. `wheels`: number of currents in a sum."""
    transition, voltage = np.abs(exact.transition), np.abs(exact.voltage)
    steady = (transition[0, 1] * WHEEL_SPEED_LIMIT + voltage[0] * VOLTAGE_LIMIT) / (1 - transition[0, 0])
    _fits(wheels * steady * CURRENT, f"{name} current")
    change = transition[1, 0] * steady + abs(exact.transition[1, 1] - 1) * WHEEL_SPEED_LIMIT
    change += voltage[1] * VOLTAGE_LIMIT + LOAD_LIMIT
    _fits((WHEEL_SPEED_LIMIT + change) * WHEEL_SPEED, f"{name} speed")


def pose(step: float) -> dict[str, Scale]:
    """Returns the coefficients that `body_step()` needs in addition to those of `body_predict()`.

    Raises:
        QuantisationError: `step` is 6 ms or more, so that a coefficient exceeds its format.
    """
    return {
        "travel_from_speed": scale(step * TRAVEL / SPEED, "travel_from_speed"),
        "heading_from_yaw_rate": scale(step * BAM32 / YAW_RATE, "heading_from_yaw_rate"),
    }


Coefficients = dict[str, Scale | list[dict[str, dict[str, Scale]]]]


def coupled(values: Values, step: float) -> Coefficients:
    """Returns the `body_coefficients_t` of the coupled profile, without the field `profile` and the pose.

    Args:
        values: nominal parameters, SI, by the names of the vehicle file.
        step: the control step, s.

    Raises:
        QuantisationError: the firmware's formats cannot hold a value, or a sum may overflow.
    """
    mean = motor_step(values, mean_inertia(values), step)
    difference = motor_step(values, difference_inertia(values), step)
    radius, half_track = values["wheel_radius"], values["half_track"]
    air = values["air_density"] * values["drag_area"] / 2
    drag = mean.torque[1] * radius / 2 * air
    for exact, name in ((mean, "mean"), (difference, "difference")):
        prove_motor(exact, name, wheels=2)
    _fits(drag * SPEED_LIMIT**2 * INT32 / LOAD_LIMIT, "air drag")
    _fits(WHEEL_SPEED_LIMIT * radius / half_track * YAW_RATE, "yaw rate")
    _fits(WHEEL_SPEED_LIMIT * radius / SPEED_LIMIT * INT32, "surge")
    return {
        "motor": [_motor(mean, 0.5, "mean"), _motor(difference, 0.5, "difference")],
        "drag": scale(drag * WHEEL_SPEED / SPEED_SQUARED, "drag"),
        "surge_from_wheel": scale(radius * SPEED / WHEEL_SPEED, "surge_from_wheel"),
        "quarter_wheel_from_surge": scale(WHEEL_SPEED / (radius * SPEED) / 4, "quarter_wheel_from_surge"),
        "yaw_rate_from_wheel": scale(radius / half_track * YAW_RATE / WHEEL_SPEED, "yaw_rate_from_wheel"),
    }


def paper(values: Values, step: float) -> Coefficients:
    """Returns the `body_coefficients_t` of the paper's profile: eq. 15 to 17 for the body, eq. 14 for each wheel."""
    wheel = motor_step(values, values["wheel_inertia"], step)
    push = step * values["stall_torque"] / (values["wheel_radius"] * values["mass"])
    from_voltage, from_wheel = push / values["battery_voltage"], push / values["no_load_speed"]
    drag = step * values["air_density"] * values["drag_area"] / 2 / values["mass"]
    turn = values["mass"] * values["half_track"] / values["yaw_inertia"]
    prove_motor(wheel, "wheel")
    thrust = 2 * (from_voltage * VOLTAGE_LIMIT + from_wheel * WHEEL_SPEED_LIMIT)
    _fits(thrust * THRUST, "thrust")
    _fits((YAW_RATE_LIMIT + thrust * turn) * YAW_RATE, "change of yaw rate")
    _fits((SPEED_LIMIT + 2 * (thrust + drag * SPEED_LIMIT**2)) * SPEED, "velocity")
    motor = _motor(wheel, 1.0, "wheel")
    return {
        "motor": [motor, motor],
        "drag": scale(drag * SPEED / SPEED_SQUARED, "drag"),
        "thrust_from_voltage": scale16(from_voltage * THRUST / VOLTAGE, "thrust_from_voltage"),
        "thrust_from_wheel": scale(from_wheel * THRUST / WHEEL_SPEED, "thrust_from_wheel"),
        "yaw_rate_from_thrust": scale(turn * YAW_RATE / THRUST, "yaw_rate_from_thrust"),
    }


PROFILES = {"coupled": coupled, "paper": paper}


def body(profile: str, values: Values, step: float, with_pose: bool = True) -> dict[str, Any]:
    """Returns a `body_coefficients_t` with its profile; `with_pose` adds the pose. Arguments as for `coupled`."""
    made = {"profile": f"BODY_{profile.upper()}", **PROFILES[profile](values, step)}
    return {**made, **pose(step)} if with_pose else made
