"""The kinds of vehicle, and the constants of the packaged robot that are no parameters of the plant.

The constants are read from `models/rcx.toml`.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal, get_args

Vehicle = Literal["diff_drive", "motor", "skid_steer"]
VEHICLES: tuple[Vehicle, ...] = get_args(Vehicle)
"""The kinds of vehicle, in the order of their numbers in C."""

SIDES = ("left", "right")
"""The sides of a vehicle. Every pair of values is in this order."""

RCX = Path(__file__).parent / "models" / "rcx.toml"
"""The packaged robot's file."""

ROBOT: dict[str, Any] = tomllib.loads(RCX.read_text(encoding="utf-8"))
"""The tables of the packaged robot's file."""


def robot_value(*keys: str) -> float:
    """Returns a value of the packaged robot's file, SI. `keys`: the names of its tables, then the value's name."""
    entry: Any = ROBOT
    for key in keys:
        entry = entry[key]
    return float(entry["value"])


STEP_S = robot_value("rates", "body_step")
"""s: a control step of the firmware on this machine, and the plant's longest body step."""

STEP_MS = round(1e3 * STEP_S)

MOTOR_STEP_S = robot_value("rates", "motor_step")
"""s: the plant's longest motor step."""

ACCEPTANCE_M = robot_value("robot", "length") / 2
"""m: the acceptance radius: the controller takes a waypoint as reached within this distance of its estimate."""

SILENT_S = robot_value("controller", "coupled", "silent_time")
"""s: the motors stop after this time without a command."""

ACCEL_RANGE = robot_value("sensors", "imu", "accel_range")
GYRO_RANGE = robot_value("sensors", "imu", "gyro_range")
"""m/s^2 and rad/s: the largest values that the IMU measures, in both directions."""

COUNTS_PER_TURN = round(robot_value("sensors", "encoder", "counts_per_turn"))
"""Counts of a rotation sensor per turn of its wheel."""
