"""Checks a robot against the ranges of the firmware's fixed-point formats, and says which value has to change.

A coefficient of the model depends on several values of the robot at once. Where one does not fit, each value alone is
moved until the constants can be made; the one that needs the least is named, with the range in which all others fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NoReturn

from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.firmware import params_header, robot
from brickpilot.firmware.params_header import BATTERY_MOST, VOLTAGE_MOST
from brickpilot.firmware.robot import Place, Robot
from brickpilot.vehicle.quantise import QuantisationError
from brickpilot.vehicle.setting_defaults import constants, plain
from brickpilot.vehicle.settings import settings

READING_MOST = 32.767  # m/s^2 or rad/s: a reading of hal.h in mm/s^2 or mrad/s has 16 bits
ROUNDING = 0.005  # of the travel per count: the share of it by which the firmware may be off
COUNT_UM_Q2 = 4e6  # counts of the format of the travel per count, per m
COUNT_MOST = 65535
FLOOR = 1.0  # V: the least that the mixer reckons with
FLOOR_AT = ("controller", "coupled", "battery_floor")
_STEP, _FURTHEST = 2.0, 20  # a value is moved by factors of this, so many times
_BISECTIONS = 12


@dataclass(frozen=True)
class Limit:
    """A value that has a range of its own, SI."""

    place: Place
    value: float
    low: float
    high: float
    unit: str
    because: str


def header(one: Robot, step: float) -> str:
    """Returns the constants of a robot at a control step of `step` s, as C.

    Raises:
        InputError: a value that a format cannot hold; names file, line, value and range.
    """
    _check_limits(one)
    try:
        return _made(one, step)
    except QuantisationError as error:
        _refuse(one, step, str(error))


def _made(one: Robot, step: float) -> str:
    if not one.value("parameters", "torque_constant") > 0:
        raise QuantisationError("the motors have no torque")
    return params_header.render_own(one.vehicle, settings(), step, one.known)


def _limits(one: Robot) -> Iterator[Limit]:
    imu, wheel = plain(one.vehicle["sensors"]["imu"]), one.value("parameters", "wheel_radius")
    turn = 2 * math.pi * wheel * COUNT_UM_Q2
    battery = one.value("parameters", "battery_voltage")
    least = FLOOR if FLOOR_AT in one.stated else FLOOR * battery / one.value(*FLOOR_AT)
    ends = f"charged it has a tenth more, voltages end at {VOLTAGE_MOST:g} V, and battery_floor follows it"
    yield Limit(("parameters", "battery_voltage"), battery, least, BATTERY_MOST, "V", ends)
    for name, unit in (("gyro_range", "rad/s"), ("accel_range", "m/s^2")):
        yield Limit(("sensors", "imu", name), imu[name], 0.1, READING_MOST, unit, "a reading has 16 bits")
    counts = one.value("sensors", "encoder", "counts_per_turn")
    rounded = f"a count is up to 16.4 mm, and rounded by {ROUNDING:.1%} of it at most"
    yield Limit(("sensors", "encoder", "counts_per_turn"), counts, turn / COUNT_MOST, turn * 2 * ROUNDING, "", rounded)
    own = constants(one.vehicle, "coupled")
    for setting in settings().values():
        place = ("controller", "coupled", setting.name)
        if place in one.stated:
            low, high = setting.value(setting.low), setting.value(setting.high)
            yield Limit(place, own[setting.name], low, high, setting.format.unit, "its format ends there")


def _check_limits(one: Robot) -> None:
    for limit in _limits(one):
        if not limit.low <= limit.value <= limit.high:
            unit = "" if limit.unit == "1" else limit.unit
            _out_of_range(one, limit.place, limit.value, (limit.low, limit.high), unit, limit.because)


def _out_of_range(
    one: Robot, place: Place, value: float, range_: tuple[float, float], unit: str, because: str
) -> NoReturn:
    low, high = range_
    one.toml.refuse(place, f"{value:.4g} is outside {low:.3g}..{high:.3g} {unit}".rstrip() + f": {because}")


def _refuse(one: Robot, step: float, reason: str) -> NoReturn:
    """Names the value that has to change least for the constants to be made."""
    found = min(_ways_out(one, step), key=lambda way: way[0], default=None)
    if found is None:
        raise InputError(f"this robot does not fit into the firmware's formats: {reason}", file=one.toml.path)
    _, place, good = found
    value, unit = one.value(*place), str(robot.entry(one.vehicle, place)["unit"])

    def fits(candidate: float) -> bool:
        return _fits(one, step, place, candidate)

    edges = sorted((_edge(fits, good, value), _far_edge(fits, good, good / value)))
    _out_of_range(one, place, value, (edges[0], edges[1]), "" if unit == "1" else unit, reason)


def _ways_out(one: Robot, step: float) -> Iterator[tuple[int, Place, float]]:
    """Yields (steps, place, value): the nearest value of each parameter alone with which the constants can be made."""
    for place in _movable(one):
        value = one.value(*place)
        for number in range(1, _FURTHEST):
            good = next((v for v in (value * _STEP**number, value / _STEP**number) if _fits(one, step, place, v)), None)
            if good is not None:
                yield number, place, good
                break


def _movable(one: Robot) -> list[Place]:
    """Returns the values that a person may have got wrong: those that the file states, above 0."""
    numeric = [place for place in sorted(one.stated) if place[0] in ("parameters", "sensors", "robot")]
    used = one.vehicle["parameters"]
    return [place for place in numeric if (place[0] != "parameters" or place[1] in used) and one.value(*place) > 0]


def _fits(one: Robot, step: float, place: Place, value: float) -> bool:
    parameters = {info.name: info for info in catalogue.parameters()}
    info = parameters.get(place[-1]) if place[0] == "parameters" else None
    if info is not None and not info.minimum <= value <= info.maximum:
        return False
    try:
        _made(robot.changed(one, {place: value}), step)
    except (QuantisationError, InputError, ArithmeticError, ValueError):
        return False
    return True


def _edge(fits: Callable[[float], bool], good: float, bad: float) -> float:
    """Returns the last value that fits, between one that does and one that does not."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if fits(middle) else (good, middle)
    return good


def _far_edge(fits: Callable[[float], bool], good: float, away: float) -> float:
    """Returns the other end of the range, in the direction of the factor `away`."""
    factor = _STEP if away > 1 else 1 / _STEP
    for _ in range(4 * _FURTHEST):
        if not fits(good * factor):
            return _edge(fits, good, good * factor)
        good *= factor
    return good
