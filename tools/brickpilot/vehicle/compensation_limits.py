"""Names the differences of a robot from the believed one that no compensation can undo, with their size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cache

from brickpilot.constants import RCX
from brickpilot.data.toml_file import TomlFile
from brickpilot.vehicle.coefficients import difference_inertia, mean_inertia
from brickpilot.vehicle.combinations import loss
from brickpilot.vehicle.compensation_values import hold, push, straight_inertia
from brickpilot.vehicle.plant import Undoable
from brickpilot.vehicle.settings import Setting

LEAST_DAMPING = 0.46
"""Damping ratio of the heading controller, below which turns overshoot and the mission loses waypoints. Measured on the
packaged robot, 6 seeds each: at 0.49 (yaw inertia 3 times as large) it reaches 8 of 8, at 0.455 (3.5 times) 7."""

HIGHEST_BATTERY, HIGHEST_OWN = 20.0, 32.0
"""V: the most that packaged images measure, and the most that any mixer allows, VOLTAGE_MAX_MV of firmware/mixer."""

Values = Mapping[str, float]


@cache
def _controller() -> Values:
    """Returns the constants of the firmware's controllers, profile `coupled`, in SI."""
    table = TomlFile(RCX).data["controller"]["coupled"]
    return {name: float(entry["value"]) for name, entry in table.items()}


def heading_damping(robot: Values, believed: Values, controller: Values | None = None) -> float:
    """Returns the damping ratio of the heading controller on a robot whose straight drive is compensated.

    To a difference of the voltages such a robot reacts as if its motors had the believed push and hold, and a side the
    inertia M' = M_0 M_yaw / M. With PD control of the heading the loop is of second order.

    Args:
        robot, believed: nominal parameters.
        controller: the constants of the firmware's controllers, SI; None: the packaged robot's.
    """
    held = hold(believed, loss(believed))
    inertia = straight_inertia(believed) * difference_inertia(robot) / mean_inertia(robot)
    time_constant, arm = inertia / (push(believed) * held), held * robot["half_track"]
    known = controller or _controller()
    return (1 + known["heading_kd"] / arm) / (2 * math.sqrt(time_constant * known["heading_kp"] / arm))


def of_settings(wanted: Values, held: Values, formats: Mapping[str, Setting], limited: Iterable[str]) -> list[str]:
    """Returns a line for each parameter that its setting limits.

    Args:
        wanted, held: parameter -> value in SI that the robot needs, and that the firmware gets.
    """
    return [
        f"{name}: this robot needs {wanted[name]:.3g} {formats[name].format.unit} ({formats[name].meaning}), "
        f"but {held[name]:.3g} is the limit"
        for name in limited
    ]


def of_effects(left_out: Iterable[str]) -> list[str]:
    """Returns a line for each effect, or `effect.parameter`, that no setting undoes."""
    return [f"{name}: no setting of the firmware undoes it" for name in left_out]


def of_loads(found: Undoable) -> list[str]:
    """Returns a line for each side whose constant load is larger than its dry friction."""
    return [
        f"{side}_offset_mv: a load of {abs(load):.3g} N m exceeds the dry friction of {friction:.3g} N m, so the robot "
        "moves at rest, while the firmware learns the gyro's bias"
        for side, load, friction in zip(("left", "right"), found.load, found.dry_torque, strict=True)
        if abs(load) > friction
    ]


def of_robot(robot: Values, believed: Values, controller: Values | None = None) -> list[str]:
    """Returns a line for each nominal value that no setting undoes and that is too far off for the controllers."""
    lines = []
    damping = heading_damping(robot, believed, controller)
    if damping < LEAST_DAMPING:
        own = heading_damping(believed, believed, controller)
        lines.append(
            f"yaw_inertia: {robot['yaw_inertia']:.3g} kg m^2 at a half-track of {robot['half_track']:.3g} m give turns "
            f"a damping ratio of {damping:.2f} (the believed robot: {own:.2f}); below {LEAST_DAMPING:g} they overshoot"
        )
    battery, floor = robot["battery_voltage"], (controller or _controller())["battery_floor"]
    highest = HIGHEST_BATTERY if controller is None else HIGHEST_OWN
    if not floor <= battery <= highest:
        lines.append(
            f"battery_voltage: {battery:.3g} V is outside the {floor:g} to {highest:g} V that the firmware reckons with"
        )
    return lines
