"""A user's robot with all values that the firmware needs: a value for each entry of the packaged robot's file.

`[parameters]` and `[effects]` of the robot's model file describe the plant. `[robot]`, `[sensors.*]`, `[estimator*]`
and `[controller.coupled]` may state further values, with the names and units of sim_host/models/rcx.toml. Values that
are not stated follow from the rules below, or are the packaged robot's. The rules start from the packaged robot's tuned
constants.

A motor drives one degree of freedom of the coupled vehicle, the straight drive or the turn, as a first-order lag:
dv/dt = (gain V - v) / time (eq. 12 and 14 without inductance). The packaged robot's closed loops have the polynomials

    straight:  s^2 + (1 + gain kp) / time s + gain ki / time
    turn:      s^3 + (1 + gain kd) / time s^2 + gain kp / time s + gain ki / time

The gains of another robot give its loops the same polynomials, with all poles multiplied by one factor, the pace:

- If the robot accelerates less at full voltage than the packaged robot, the pace is the square root of the ratio of
  these accelerations. With this pace, a heading error demands the same share of the voltage from both robots.
- If the robot without control has more damping than the loop with this pace, the pace is larger, up to `FASTEST`.

Speeds scale with the steady speed at battery voltage, decelerations with the acceleration, lengths with the robot's
length. The voltage for turns scales with the battery, but stays within the gyro's range (`_within_gyro`). The rules
give the packaged robot its own constants.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from scipy.optimize import brentq

from brickpilot.constants import RCX
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.vehicle import compensation
from brickpilot.vehicle import model as models
from brickpilot.vehicle.combinations import (
    Values,
    difference_inertia,
    holding_voltage,
    mean_inertia,
    wheel_speed_per_volt,
)
from brickpilot.vehicle.drive_constants import two_wheeled
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.settings import constants, default, plain, settings

Tables = Mapping[str, Any]
Place = tuple[str, ...]

OWN = (
    ("robot",),
    ("sensors", "imu"),
    ("sensors", "encoder"),
    ("sensors", "battery"),
    ("estimator",),
    ("estimator", "coupled"),
    ("monitor",),
    ("controller", "coupled"),
)
"""The tables of a model file that describe a robot beside `[parameters]` and `[effects]`."""

_MOST = 1e6  # largest absolute value in SI; the range of a value's format is checked elsewhere
_LEAST_ABOVE_0 = 1e-6
_RANGES: Mapping[Place, tuple[float, float]] = {
    ("robot", "length"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "gyro_range"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "gyro_noise_sd"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "bits"): (1, 24),  # bits of the simulated converter
    ("sensors", "encoder", "counts_per_turn"): (_LEAST_ABOVE_0, _MOST),
    **{
        ("monitor", name): (_LEAST_ABOVE_0, _MOST)
        for name in ("false_alarm_time", "innovation_sd", "battery_sd", "friction")
    },
    ("controller", "coupled", "cruise"): (_LEAST_ABOVE_0, _MOST),
}
"""The ranges of values that the rules use as a divisor, or under a root or a power."""

ACCEPTANCE, FEEDFORWARD = "acceptance", "feedforward"
"""Settings that a vehicle file does not state: they are computed from the robot's length and losses."""

LONGEST_COUNT = 0.016
"""The longest travel of a wheel per encoder count, m: just below the limit of the format for this travel."""

_PACKAGED = "the packaged robot's"
_STATED = "stated"


@dataclass(frozen=True)
class Robot:
    """A complete robot.

    Attributes:
        model: the plant, with its effects.
        vehicle: the tables of a vehicle file; each entry is `{value, unit, basis}`.
        known: parameter of a compensation -> raw integer: the effects that the firmware compensates.
        remarks: a line for each difference from the firmware's model that the firmware cannot compensate.
        stated: place -> value in SI, for the values that the model file states.
        toml: the model file, for errors.
    """

    model: Model
    vehicle: dict[str, Any]
    known: Mapping[str, int]
    remarks: tuple[str, ...]
    stated: Mapping[Place, float]
    toml: TomlFile

    def value(self, *place: str) -> float:
        """Returns a value of the vehicle file, SI."""
        return float(entry(self.vehicle, place)["value"])

    @property
    def length(self) -> float:
        """The robot's length, m."""
        return self.value("robot", "length")


@cache
def _file() -> dict[str, Any]:
    return TomlFile(RCX).data


def packaged() -> dict[str, Any]:
    """Returns the tables of the packaged robot's file."""
    return copy.deepcopy(_file())


def load(path: Path) -> Robot:
    """Reads a model file, and completes it.

    Raises:
        InputError: as `model.load`; or the vehicle is a motor, its profile is not coupled, or an entry is not valid.
    """
    model = models.load(path)
    toml = TomlFile(path)
    if model.vehicle == "motor":
        toml.refuse(("vehicle",), "'motor': the firmware drives a diff_drive or skid_steer")
    if model.profile != "coupled":
        toml.refuse(("profile",), f"{model.profile!r}: firmware is made for the profile coupled")
    stated: dict[Place, float] = {
        ("parameters", name): model.parameters[name] for name in toml.data.get("parameters", {})
    }
    return complete(model, toml, stated | _stated(toml))


def entry(tables: Tables, place: Place) -> Any:
    """Returns the entry at a place of a vehicle file."""
    below: Any = tables
    for name in place:
        below = below[name]
    return below


def _stated(toml: TomlFile) -> dict[Place, float]:
    """Returns place -> value in SI, for the values that the file states in the tables of `OWN`."""
    known = packaged()
    stated: dict[Place, float] = {}
    for place in OWN:
        names = entry(known, place)
        table: Any = toml.data
        for depth, name in enumerate(place):
            table = toml.table(place[: depth + 1], table.get(name, {}))
        below = {other[len(place)] for other in OWN if len(other) > len(place) and other[: len(place)] == place}
        toml.known_keys(place, table, names)
        for name in table.keys() - below - {"paper"}:  # only the project's firmware has `paper`
            key, unit = (*place, name), names[name]["unit"]
            value = models.entry_table(toml, key, table[name], unit)["value"]
            stated[key] = toml.number(key, value, *_RANGES.get(key, (-_MOST, _MOST)), "" if unit == "1" else unit)
    return stated


def complete(model: Model, toml: TomlFile, stated: Mapping[Place, float]) -> Robot:
    """Returns the robot of a model whose file states the values `stated`; the other values follow by rules.

    Raises:
        InputError: the compensation refuses the model.
    """
    vehicle = packaged()
    vehicle["name"] = model.name
    vehicle["controller"] = {"coupled": vehicle["controller"]["coupled"]}
    del vehicle["estimator"]["paper"]
    believed = two_wheeled(dataclasses.replace(model, effects={}))
    nominal = believed.nominal
    for name in vehicle["parameters"]:
        basis = believed.basis.get(name) or (_STATED if ("parameters", name) in stated else _PACKAGED)
        vehicle["parameters"][name] |= {"value": nominal[name], "basis": basis}
    _put(vehicle, {place: Chosen(value, _STATED) for place, value in stated.items() if place[0] != "parameters"})
    _put(vehicle, {place: chosen for place, chosen in _chosen(vehicle, stated).items() if place not in stated})
    undone = compensation.from_model(model, believed, controller=plain(vehicle["controller"]["coupled"]))
    known = {} if undone is None else undone.raw
    remarks = () if undone is None else undone.remarks
    return Robot(model, vehicle, known, remarks, dict(stated), toml)


def changed(robot: Robot, values: Mapping[Place, float]) -> Robot:
    """Returns the robot as if its file stated these `values`."""
    own = {place[1]: value for place, value in values.items() if place[0] == "parameters"}
    model = dataclasses.replace(robot.model, parameters={**robot.model.parameters, **own})
    return complete(model, robot.toml, {**robot.stated, **values})


def with_gains(robot: Robot, gains: Gains) -> Robot:
    """Returns the robot with these gains in its controller: the firmware's constants hold the gains' raw integers.

    Raises:
        InputError: a gain cannot be set, because it is computed from another value of the robot.
    """
    held: dict[Place, float] = {
        ("controller", "coupled", name): gains.value(name)
        for name in gains.raw
        if name not in (ACCEPTANCE, FEEDFORWARD)
    }
    if FEEDFORWARD in gains.raw:
        share = gains.value(FEEDFORWARD) / holding_voltage(plain(robot.vehicle["parameters"]))
        held["controller", "coupled", "feedforward_share"] = share
    made = changed(robot, held)
    _put(made.vehicle, {place: Chosen(value, f"gain set {gains.name}") for place, value in held.items()})
    own = constants(made.vehicle, "coupled")
    for name, raw in gains.raw.items():
        has = default(settings()[name], own, "coupled")
        if has != raw:
            follows = f"{own[name]:.4g} {settings()[name].format.unit} follows from the robot's model file"
            raise InputError(f"raw {raw} cannot be compiled in: {follows}", file=gains.name, field=name)
    return made


def _put(vehicle: dict[str, Any], values: Mapping[Place, Chosen]) -> None:
    for place, chosen in values.items():
        entry(vehicle, place).update({"value": chosen.value, "basis": chosen.rule})


def _chosen(vehicle: dict[str, Any], stated: Mapping[Place, float]) -> dict[Place, Chosen]:
    """Returns every value that a rule gives; writes length and counts per turn into `vehicle`, for later rules."""
    reference = packaged()
    own, other = plain(vehicle["parameters"]), plain(reference["parameters"])
    chosen: dict[Place, Chosen] = {}
    if ("robot", "length") not in stated:
        length = plain(reference["robot"])["length"] * own["half_track"] / other["half_track"]
        chosen["robot", "length"] = Chosen(length, "as the half-track")
    counts = ("sensors", "encoder", "counts_per_turn")
    finer = float(math.ceil(2 * math.pi * own["wheel_radius"] / LONGEST_COUNT))  # a large wheel needs more counts
    if counts not in stated and finer > entry(vehicle, counts)["value"]:
        chosen[counts] = Chosen(finer, "a count of 16 mm, the longest that has a format")
    _put(vehicle, chosen)
    constants = plain(reference["controller"]["coupled"])
    for name, by_rule in tuned_controller(_size(vehicle), _size(reference), constants).items():
        chosen["controller", "coupled", name] = by_rule
    common, coupled = plain(reference["estimator"]), plain(reference["estimator"]["coupled"])
    for name, by_rule in tuned_estimator(_seen(vehicle), _seen(reference), {**common, **coupled}).items():
        chosen[("estimator", name) if name in common else ("estimator", "coupled", name)] = by_rule
    return chosen


def _size(vehicle: Tables) -> Size:
    gyro_range = plain(vehicle["sensors"]["imu"])["gyro_range"]
    return Size(plain(vehicle["parameters"]), plain(vehicle["robot"])["length"], gyro_range)


def _seen(vehicle: Tables) -> dict[str, float]:
    """Returns the sensors' values that `tuned_estimator` needs."""
    values, sensors = plain(vehicle["parameters"]), vehicle["sensors"]
    imu, encoder = plain(sensors["imu"]), plain(sensors["encoder"])
    return {
        "travel_per_count": values["wheel_radius"] / encoder["counts_per_turn"],
        "gyro_resolution": 2 * imu["gyro_range"] / 2 ** imu["bits"],
        "gyro_noise_sd": imu["gyro_noise_sd"],
    }


FASTEST = 2.0
"""Largest factor on the packaged robot's poles; with it, the fastest pole (21 rad/s) times a step of 9 ms is 0.2."""

NOTHING = 0.01
"""A loop gain up to this value is set to 0, because it hardly changes the damping."""

FASTEST_CRUISE = 1.6
"""The fastest cruise speed, m/s: four fifths of the largest speed that the format holds."""

LONGEST_TURN = math.pi
"""The largest heading error, rad: half a turn."""

GYRO_SHARE = 0.9
"""Share of the gyro's range that a turn may reach; the rest is a margin for bias, noise and stronger motors."""


@dataclass(frozen=True)
class Motion:
    """One degree of freedom: dv/dt = (gain V - v) / time. The gain is in m/s or rad/s per V, the time in s."""

    gain: float
    time: float

    def acceleration(self, volts: float) -> float:
        """Returns the acceleration from rest, m/s^2 or rad/s^2."""
        return self.gain * volts / self.time


@dataclass(frozen=True)
class Chosen:
    """A constant that a rule gives, SI, and the rule in a few words."""

    value: float
    rule: str


def straight(values: Values) -> Motion:
    """Returns the motion of a robot in straight drive, from its nominal parameters."""
    lag = _lag(values, mean_inertia(values))
    return Motion(lag.gain * values["wheel_radius"], lag.time)


def turn(values: Values) -> Motion:
    """Returns the motion in a turn on the spot, driven by half the difference of the voltages."""
    lag = _lag(values, difference_inertia(values))
    return Motion(lag.gain * values["wheel_radius"] / values["half_track"], lag.time)


def _lag(values: Values, inertia: float) -> Motion:
    """Returns the motion of a wheel with this inertia; its speed is in rad/s."""
    resistance, torque = values["resistance"], values["torque_constant"]
    volts_per_speed = 1 / wheel_speed_per_volt(values)
    return Motion(1 / volts_per_speed, inertia * resistance / (torque * volts_per_speed))


def _pace(own: Motion, acceleration_ratio: float, damping: float) -> float:
    """Returns the factor on the packaged robot's poles. `damping`: minus the sum of these poles, in 1/s."""
    slowed = min(1.0, math.sqrt(acceleration_ratio))
    return min(max(slowed, 1 / (own.time * damping)), FASTEST)


def _loop_gain(wanted: float) -> float:
    """Returns the loop gain `wanted`, or 0 if it is at most `NOTHING`: then the robot's own damping is enough."""
    return wanted if wanted > NOTHING else 0.0


def _speed_gains(own: Motion, packaged: Motion, gains: Values, acceleration_ratio: float) -> dict[str, float]:
    damping = (1 + packaged.gain * gains["speed_kp"]) / packaged.time
    pace = _pace(own, acceleration_ratio, damping)
    stiffness = packaged.gain * gains["speed_ki"] / packaged.time * pace**2
    return {
        "speed_kp": _loop_gain(pace * damping * own.time - 1) / own.gain,
        "speed_ki": stiffness * own.time / own.gain,
    }


def _heading_gains(own: Motion, packaged: Motion, gains: Values, acceleration_ratio: float) -> dict[str, float]:
    damping = (1 + packaged.gain * gains["heading_kd"]) / packaged.time
    pace = _pace(own, acceleration_ratio, damping)
    factor = packaged.gain / packaged.time * own.time / own.gain
    return {
        "heading_kp": gains["heading_kp"] * factor * pace**2,
        "heading_ki": gains["heading_ki"] * factor * pace**3,
        "heading_kd": _loop_gain(pace * damping * own.time - 1) / own.gain,
    }


def _within_gyro(motion: Motion, gyro_range: float) -> float:
    """Returns the voltage at which half a turn from rest ends with a yaw rate of `GYRO_SHARE` times the gyro's range.

    At the voltage V, a first-order lag has the rate `gain * V * (1 - e)` at the angle `gain * V * time * (x - 1 + e)`,
    where x is the elapsed time over the lag's time constant, and e = exp(-x). A light robot reaches its final rate,
    `gain * V`, almost at once; a heavy robot does not reach it within the turn.
    """
    rate = GYRO_SHARE * gyro_range

    def beyond(x: float) -> float:
        return rate * motion.time * (x + math.expm1(-x)) + LONGEST_TURN * math.expm1(-x)

    x = float(brentq(beyond, 1e-9, 2 + LONGEST_TURN / (rate * motion.time)))
    return rate / (motion.gain * -math.expm1(-x))


@dataclass(frozen=True)
class Size:
    """The input of the rules: a robot's nominal parameters, its length in m, and the range of its gyro in rad/s."""

    values: Values
    length: float
    gyro_range: float

    @property
    def battery(self) -> float:
        return self.values["battery_voltage"]


def tuned_controller(own: Size, packaged: Size, constants: Values) -> dict[str, Chosen]:
    """Returns the constants of `[controller.coupled]` that follow from the robot; the other constants stay as packaged.

    Args:
        constants: the constants of the packaged robot.
    """
    own_straight, packaged_straight = straight(own.values), straight(packaged.values)
    own_turn, packaged_turn = turn(own.values), turn(packaged.values)
    battery_ratio, length_ratio = own.battery / packaged.battery, own.length / packaged.length
    acceleration_ratio = own_straight.acceleration(own.battery) / packaged_straight.acceleration(packaged.battery)
    turn_ratio = own_turn.acceleration(own.battery) / packaged_turn.acceleration(packaged.battery)
    speed_ratio = own_straight.gain * battery_ratio / packaged_straight.gain
    cruise = min(constants["cruise"] * min(speed_ratio, math.sqrt(acceleration_ratio * length_ratio)), FASTEST_CRUISE)
    cruise_ratio = cruise / constants["cruise"]
    turning = min(constants["heading_limit"] * battery_ratio, _within_gyro(own_turn, own.gyro_range))
    gains = {
        **_speed_gains(own_straight, packaged_straight, constants, acceleration_ratio),
        **_heading_gains(own_turn, packaged_turn, constants, turn_ratio),
    }
    others = {
        "cruise": (
            cruise,
            "as the speed that the battery holds, and no faster than the robot brakes within its length",
        ),
        "creep": (constants["creep"] * cruise_ratio, "as cruise"),
        "decel": (constants["decel"] * acceleration_ratio, "as the acceleration at full voltage"),
        "speed_limit": (constants["speed_limit"] * battery_ratio, "as the battery"),
        "heading_limit": (turning, "as the battery, and no faster than nine tenths of the gyro's range in half a turn"),
        "bearing_hold": (constants["bearing_hold"] * length_ratio, "as the length"),
        "overshoot": (constants["overshoot"] * length_ratio, "as the length"),
        "leg_timeout": (
            constants["leg_timeout"] * max(length_ratio, 1.0) / min(cruise_ratio, 1.0),
            "as length over cruise",
        ),
        "battery_floor": (constants["battery_floor"] * battery_ratio, "as the battery"),
    }
    chosen = {name: (value, "the packaged robot's poles, see robot.py") for name, value in gains.items()} | others
    return {name: Chosen(value, rule) for name, (value, rule) in chosen.items()}


def tuned_estimator(own: Values, packaged: Values, constants: Values) -> dict[str, Chosen]:
    """Returns the constants of `[estimator]` and `[estimator.coupled]` that follow from the sensors.

    Args:
        own, packaged: `travel_per_count` in m, `gyro_resolution` and `gyro_noise_sd` in rad/s.
        constants: the constants of the packaged robot, of both tables.
    """
    coarser = own["travel_per_count"] / packaged["travel_per_count"]
    noisier = max(own[name] / packaged[name] for name in ("gyro_resolution", "gyro_noise_sd"))
    return {
        "gyro_quiet": Chosen(constants["gyro_quiet"] * noisier, "as the gyro's resolution or noise"),
        "observer_bandwidth": Chosen(
            constants["observer_bandwidth"] * min(1.0, 1 / coarser), "a count makes no more ripple of the speed"
        ),
    }
