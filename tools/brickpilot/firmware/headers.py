"""The headers that stand in the place of the project's when an image is built for a robot of one's own."""

from __future__ import annotations

import math
import re
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.firmware import params_header, ranges
from brickpilot.firmware.boards import Board
from brickpilot.firmware.robot import Robot
from brickpilot.vehicle.c_text import comment
from brickpilot.vehicle.scenario import Scenario

MILLI = 1e3

_AXIS = re.compile(
    r"(static const board_axis_t BOARD_(GYRO|SURGE|SWAY) = \{\d+, )\d+, \d+(, (?:true|false)\};)(?: /\* range: .*\*/)?"
)
_PER_COUNT_Q8 = re.compile(r"(#define BOARD_(GYRO|SURGE|SWAY)_PER_COUNT_Q8 )\d+(?: /\*.*\*/)?")
_COUNTS = re.compile(r"\d+ edges a turn of the wheel|16 counts per turn, geared up 1:3 from the wheel")
_BITS = re.compile(r"(#define MOTOR_VOLTAGE_BITS )\d+")
_BATTERY = re.compile(r"(#define BOARD_BATTERY_FULL_MV )(\d+)")
_IMU = re.compile(r"(#define BOARD_IMU )BOARD_ANALOGUE\b")
LIMITS = "model/limits.h"
ANALOGUE = "analogue"
IMUS = {ANALOGUE: "BOARD_ANALOGUE", "mpu6050": "BOARD_MPU6050", "lsm6ds": "BOARD_LSM6DS"}
"""An Arduino's IMU -> its name in board.h."""
_DIGITAL = {"gyro_range": math.radians(1000.0), "accel_range": 2 * 9.80665}  # as the port sets these chips
_RANGES = {"GYRO": "gyro_range", "SURGE": "accel_range", "SWAY": "accel_range"}


def write(
    robot: Robot, mission: Scenario, board: Board, step: float, folder: Path, root: Path, imu: str = ANALOGUE
) -> None:
    """Writes the headers of a robot into `folder`: constants, route, and the board's wiring with this robot's scales.

    Raises:
        InputError: a value that a format cannot hold; an IMU that the board does not have, or a range beyond it.
    """
    _check_imu(imu, robot, board)
    texts = {"app/params_gen.h": _named(ranges.header(robot, step), robot), "app/mission.h": _mission(mission)}
    texts |= of_model(robot, root)
    if board.wiring:
        texts[board.wiring] = _IMU.sub(
            rf"\g<1>{IMUS[imu]}", _wiring((root / "hal" / board.wiring).read_text(encoding="utf-8"), robot)
        )
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def _check_imu(imu: str, robot: Robot, board: Board) -> None:
    if imu not in IMUS:
        raise InputError(f"{imu!r} is not one of {', '.join(IMUS)}", field="--imu")
    if imu == ANALOGUE:
        return
    if not board.library:
        raise InputError(f"{board.name} reads no IMU on I2C: the Arduino boards do", field=f"--imu {imu}")
    for name, most in _DIGITAL.items():
        if (stated := robot.value("sensors", "imu", name)) > most * (1 + 1e-3):
            robot.toml.refuse(("sensors", "imu", name), f"{stated:g} is beyond the {most:.4g} of an IMU on I2C")


def of_model(robot: Robot, root: Path) -> dict[str, str]:
    """Returns header -> text of the model's formats, where they are not the packaged ones."""
    bits = params_header.voltage_bits(robot.vehicle)
    if bits == 0:
        return {}
    text = (root / "firmware" / LIMITS).read_text(encoding="utf-8")
    return {LIMITS: _BITS.sub(rf"\g<1>{bits}", text)}


def _named(constants: str, robot: Robot) -> str:
    return f"{comment(f'Made by `brickpilot firmware` of robot.toml, for {robot.model.name}.')}\n{constants}"


def _mission(mission: Scenario) -> str:
    points = ",\n".join(f"    {{{round(x * MILLI)}, {round(y * MILLI)}}}" for x, y in mission.waypoints)
    return f"""/* mission.h: the route that a brick flies until a host uploads another one. */
#ifndef BRICKPILOT_APP_MISSION_H
#define BRICKPILOT_APP_MISSION_H

#include "app/commands.h"

{comment(f"{mission.title}, in mm.")}
static const route_waypoint_t MISSION[] = {{
{points}}};

#endif
"""


def _wiring(text: str, robot: Robot) -> str:
    """Returns the header of a port with the scales of this robot's sensors, and its counts a turn in words.

    A count is one of 1024, over twice the range. The RCX's header has it as a whole part and 256ths, that of the AVR
    chips in 256ths.
    """
    counts = {axis: 2 * robot.value("sensors", "imu", name) * MILLI / 1024 for axis, name in _RANGES.items()}
    q8 = {axis: round(count * 256) for axis, count in counts.items()}
    found = set(_AXIS.findall(text)) | set(_PER_COUNT_Q8.findall(text))
    if len(found) != len(_RANGES) or max(q8.values()) > 65535:
        raise InputError("has no scales that can be written for another robot", file="board.h")
    text = _with_battery(text, robot)
    turn = f"{robot.value('sensors', 'encoder', 'counts_per_turn'):g} counts a turn of the wheel"
    text, said = _COUNTS.subn(turn, text)
    if not said:
        raise InputError("does not say how many counts a turn of the wheel has", file="board.h")
    text = _AXIS.sub(lambda axis: f"{axis[1]}{q8[axis[2]] // 256}, {q8[axis[2]] % 256}{axis[3]}", text)
    return _PER_COUNT_Q8.sub(lambda axis: f"{axis[1]}{q8[axis[2]]}", text)


def _with_battery(text: str, robot: Robot) -> str:
    """Returns the header with a range for the battery that holds this one when it is charged."""
    nominal = robot.value("parameters", "battery_voltage")
    found = _BATTERY.search(text)
    measured = int(found[2]) / MILLI if found else params_header.RCX_BATTERY
    if nominal / params_header.BATTERY_MOST * params_header.VOLTAGE_MOST <= measured:
        return text
    if found is None:
        robot.toml.refuse(
            ("parameters", "battery_voltage"), f"{nominal:g} V is more than this board measures: {measured:g} V charged"
        )
    return _BATTERY.sub(rf"\g<1>{params_header.MILLIVOLTS} /* another divider than the packaged robot's */", text)
