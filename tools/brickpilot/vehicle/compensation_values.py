"""Computes the compensation of a robot in SI, for the profile `coupled`.

The firmware is made for one robot, the believed one, and flies another. On each side it demands a voltage u that would
give the believed robot the demanded acceleration. The compensation turns u into

    V = (1 + gain) (u + emf v + offset + friction sign(v)) + deadband sign(V)        v: the side's speed over ground

so that the real robot drives straight like the believed one. The push per volt is K_t / (R r), the voltage that
holds a speed is K_e / r + b R / (K_t r), the inertia per wheel is M = J / r^2 + m / 2, and g is the gain of the drive.
With 0 for the believed robot,

    a = (M / M_0) (push_0 / push)        gain = a / g - 1        emf = hold / a - hold_0        friction = T R / (K_t a)

(eq. 12 to 14, solved for V). Yaw has an inertia of its own; the heading controller corrects the difference.

An effect's own C file adds to these quantities: see `bp_undoable`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

from brickpilot import catalogue
from brickpilot.vehicle import plant, scenario
from brickpilot.vehicle.coefficients import mean_inertia
from brickpilot.vehicle.combinations import loss
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import Undoable

LEFT, RIGHT = 0, 1


@cache
def _top_speed() -> float:
    """Returns the highest speed for which voltage is reserved, in m/s: the cruise speed of the packaged mission."""
    return scenario.load(scenario.packaged()["mission"]).cruise["coupled"]


def nominal(model: Model) -> dict[str, float]:
    """Returns all nominal parameters of a model, presets included."""
    return {**catalogue.presets(model.vehicle), **model.parameters}


def push(values: Mapping[str, float]) -> float:
    """Returns the force at the ground per volt of a motor at rest, N/V."""
    return values["torque_constant"] / (values["resistance"] * values["wheel_radius"])


def hold(values: Mapping[str, float], losses: float) -> float:
    """Returns the voltage per speed that holds this speed on level ground, V s/m."""
    lost = losses * values["resistance"] / values["torque_constant"]
    return (values["emf_constant"] + lost) / values["wheel_radius"]


def straight_inertia(values: Mapping[str, float]) -> float:
    """Returns the mass that each motor has to move, kg."""
    return mean_inertia(values) / values["wheel_radius"] ** 2


def _own(robot: Mapping[str, float], found: Undoable, side: int) -> dict[str, float]:
    """Returns the nominal parameters of one side."""
    flux, rim = found.flux[side], found.rim[side]
    factors = {"torque_constant": flux, "emf_constant": flux, "wheel_radius": rim}
    return {**robot, **{name: robot[name] * factor for name, factor in factors.items()}}


def _side(robot: Mapping[str, float], found: Undoable, believed: Mapping[str, float], side: int) -> dict[str, float]:
    own = _own(robot, found, side)
    share = straight_inertia(robot) / straight_inertia(believed) * push(believed) / push(own)
    volts = own["resistance"] / own["torque_constant"] / share  # per N m at the wheel
    # T sqrt(w) is close to a line from 0 to the wheel speed W of `_top_speed`: T sqrt(W) (4 / 15 + 4 / 5 w / W).
    root, fastest = found.root_torque[side], _top_speed() / own["wheel_radius"]
    losses = loss(own) + 0.8 * root / math.sqrt(fastest)
    return {
        "gain_q15": share / found.drive_gain[side] - 1,
        "emf_mv_q15": hold(own, losses) / share - hold(believed, loss(believed)),
        "friction_mv": (found.dry_torque[side] + 4 / 15 * root * math.sqrt(fastest)) * volts,
        "offset_mv": found.load[side] * volts,
    }


def _reserve(side: Mapping[str, float], deadband: float, battery: float) -> float:
    """Returns the part of the battery's voltage that is reserved for the compensation of this side."""
    most = (battery - deadband) / (1 + side["gain_q15"])
    return battery - most + side["friction_mv"] + abs(side["offset_mv"]) + max(side["emf_mv_q15"] * _top_speed(), 0.0)


def most_reserve(model: Model) -> float:
    """Returns the largest reserve that leaves the controllers enough voltage: half of the battery's."""
    return nominal(model)["battery_voltage"] / 2


def values(model: Model, believes: Model) -> dict[str, float]:
    """Returns each parameter of the compensation in SI, by its name in the firmware.

    Args:
        model: the real robot, a coupled diff_drive.
        believes: the robot that the firmware believes in; its effects are ignored.
    """
    robot, believed = nominal(model), nominal(believes)
    found, battery = plant.undoable(model), robot["battery_voltage"]
    left, right = (_side(robot, found, believed, side) for side in (LEFT, RIGHT))
    reserve = max(_reserve(side, found.lost_voltage, battery) for side in (left, right))
    turning = any(side["emf_mv_q15"] or side["friction_mv"] for side in (left, right))
    radius = robot["wheel_radius"] / believed["wheel_radius"]
    return {
        **{f"left_{name}": value for name, value in left.items()},
        **{f"right_{name}": value for name, value in right.items()},
        "deadband_mv": found.lost_voltage,
        "reserve_mv": max(reserve, 0.0),
        "half_track_m_q14": robot["half_track"] if turning else 0.0,
        "battery_sags": float(found.supply_resistance > 0),
        "gyro_bias_mrad_s": found.gyro_offset,
        "gyro_scale_q15": 1 / found.gyro_gain - 1,
        "travel_scale_q15": radius / found.travel_gain - 1,
        "count_mismatch_q15": (found.rim[LEFT] - found.rim[RIGHT]) / 2,
    }


@cache
def undone(effect: str) -> tuple[str, ...]:
    """Returns the parameters of an effect that `values` undoes: those that change the effect's `Undoable`."""
    infos = catalogue.effect(effect).parameters
    presets = {info.name: info.preset for info in infos}

    def undoable(table: Mapping[str, float]) -> Undoable:
        return plant.undoable(Model("one effect", "diff_drive", "coupled", {}, {effect: table}))

    elsewhere = {info.name: info.minimum if info.preset != info.minimum else info.maximum for info in infos}
    at_presets = undoable(presets)
    return tuple(name for name, value in elsewhere.items() if undoable({**presets, name: value}) != at_presets)


def left_out(model: Model) -> tuple[str, ...]:
    """Returns the effects of `model`, and the parameters of effects, that `values` does not undo."""
    found = []
    for name, on in model.effects.items():
        used = undone(name)
        others = [f"{name}.{parameter}" for parameter, value in on.items() if parameter not in used and value]
        found += others if used else [name]
    return tuple(found)
