"""What a firmware that believes in one robot has to do otherwise on another one, in SI; profile `coupled`.

Each side is told to turn a wanted voltage u, with which the believed robot would speed up as it should, into

    V = (1 + gain) (u + emf v + offset + friction sign(v)) + deadband sign(V)        v: the side's speed over ground

such that this robot's straight course is the believed one's. With the push K_t / (R r) per volt, the voltage
K_e / r + b R / (K_t r) that holds a speed, the inertia M = J / r^2 + m / 2 per wheel, 0 for the believed robot, and the
gain g of the drive,

    a = (M / M_0) (push_0 / push)        gain = a / g - 1        emf = hold / a - hold_0        friction = T R / (K_t a)

(eq. 12 to 14, solved for V). Yaw has its own inertia: what this leaves there is the heading controller's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from brickpilot import catalogue
from brickpilot.vehicle.coefficients import loss, mean_inertia
from brickpilot.vehicle.model import Model

TOP_SPEED = 0.5  # m/s: the fastest that voltage is reserved for, the mission's cruise speed

USED: Mapping[str, tuple[str, ...]] = {
    "battery_sag": ("resistance",),
    "actuator_deadband": ("voltage",),
    "motor_asymmetry": ("difference",),
    "torque_constant_asymmetry": ("difference",),
    "coulomb_friction": ("torque",),
    "stiction_stribeck": ("coulomb",),
    "rolling_sqrt": ("torque",),
    "constant_offset": ("torque", "difference"),
    "direction_asymmetry": ("torque",),
    "wheel_radius_mismatch": ("mismatch",),
    "gyro_scale": ("error",),
    "gyro_bias": ("bias",),
    "encoder_scale": ("error",),
}
"""Effect -> those of its parameters that are undone."""


@dataclass(frozen=True)
class _Robot:
    """A robot's values: nominal parameters, and the parameters of its effects by `effect.parameter`, 0 where off."""

    nominal: Mapping[str, float]
    effects: Mapping[str, float]


def _robot(model: Model) -> _Robot:
    presets = {e.name: {info.name: info.preset for info in e.parameters} for e in catalogue.effects()}
    effects: dict[str, float] = {}
    for name, parameters in USED.items():
        on = {**presets[name], **model.effects[name]} if name in model.effects else {}
        effects |= {f"{name}.{parameter}": on.get(parameter, 0.0) for parameter in parameters}
    return _Robot({**catalogue.presets(model.vehicle), **model.parameters}, effects)


def _push(values: Mapping[str, float]) -> float:
    """Force at the ground per volt of a motor at rest, N/V."""
    return values["torque_constant"] / (values["resistance"] * values["wheel_radius"])


def _hold(values: Mapping[str, float], losses: float) -> float:
    """Voltage per speed that holds it on level ground, V s/m."""
    lost = losses * values["resistance"] / values["torque_constant"]
    return (values["emf_constant"] + lost) / values["wheel_radius"]


def _inertia(values: Mapping[str, float]) -> float:
    """Mass that each motor has to move, kg."""
    return mean_inertia(values) / values["wheel_radius"] ** 2


def _own(robot: _Robot, sign: int) -> dict[str, float]:
    """The nominal parameters as one side has them; sign: 1 left, -1 right."""
    flux = 1 + sign * robot.effects["torque_constant_asymmetry.difference"] / 2
    rim = 1 + sign * robot.effects["wheel_radius_mismatch.mismatch"] / 2
    factors = {"torque_constant": flux, "emf_constant": flux, "wheel_radius": rim}
    return {**robot.nominal, **{name: robot.nominal[name] * factor for name, factor in factors.items()}}


def _side(robot: _Robot, believed: Mapping[str, float], sign: int) -> dict[str, float]:
    own, effect = _own(robot, sign), robot.effects
    share = _inertia(robot.nominal) / _inertia(believed) * _push(believed) / _push(own)
    volts = own["resistance"] / own["torque_constant"] / share  # per N m at the wheel
    drive = 1 + sign * effect["motor_asymmetry.difference"] / 2
    lopsided = effect["direction_asymmetry.torque"]  # half of it on both directions, half as a load
    # T sqrt(w) is next to a line from 0 to the wheel speed W of TOP_SPEED: T sqrt(W) (4 / 15 + 4 / 5 w / W).
    root, fastest = effect["rolling_sqrt.torque"], TOP_SPEED / own["wheel_radius"]
    dry = effect["coulomb_friction.torque"] + effect["stiction_stribeck.coulomb"] + abs(lopsided) / 2
    load = effect["constant_offset.torque"] + sign * effect["constant_offset.difference"] + lopsided / 2
    losses = loss(own) + 0.8 * root / math.sqrt(fastest)
    return {
        "gain_q15": share / drive - 1,
        "emf_mv_q15": _hold(own, losses) / share - _hold(believed, loss(believed)),
        "friction_mv": (dry + 4 / 15 * root * math.sqrt(fastest)) * volts,
        "offset_mv": load * volts,
    }


def _reserve(side: Mapping[str, float], deadband: float, battery: float) -> float:
    """What of the battery's voltage cannot be wanted, so that this side can still be given what it needs."""
    most = (battery - deadband) / (1 + side["gain_q15"])
    return battery - most + side["friction_mv"] + abs(side["offset_mv"]) + max(side["emf_mv_q15"] * TOP_SPEED, 0.0)


def values(model: Model, nominal: Model) -> dict[str, float]:
    """Each parameter of the firmware's compensation, SI, by its name there.

    Args:
        model: a coupled diff_drive, as the data say it is.
        nominal: what the firmware believes in; its effects do not count.
    """
    robot, believed = _robot(model), _robot(nominal).nominal
    left, right = (_side(robot, believed, sign) for sign in (1, -1))
    deadband, battery = robot.effects["actuator_deadband.voltage"], believed["battery_voltage"]
    reserve = max(_reserve(side, deadband, battery) for side in (left, right))
    turning = any(side["emf_mv_q15"] or side["friction_mv"] for side in (left, right))
    radius = robot.nominal["wheel_radius"] / believed["wheel_radius"]
    return {
        **{f"left_{name}": value for name, value in left.items()},
        **{f"right_{name}": value for name, value in right.items()},
        "deadband_mv": deadband,
        "reserve_mv": min(max(reserve, 0.0), battery / 2),
        "half_track_m_q14": robot.nominal["half_track"] if turning else 0.0,
        "battery_sags": float(robot.effects["battery_sag.resistance"] > 0),
        "gyro_bias_mrad_s": robot.effects["gyro_bias.bias"],
        "gyro_scale_q15": 1 / (1 + robot.effects["gyro_scale.error"]) - 1,
        "travel_scale_q15": radius / (1 + robot.effects["encoder_scale.error"]) - 1,
        "count_mismatch_q15": robot.effects["wheel_radius_mismatch.mismatch"] / 2,
    }


def left_out(model: Model) -> tuple[str, ...]:
    """Effects, and parameters of effects, that are on in `model` and that `values` does not undo."""
    found = []
    for name, on in model.effects.items():
        others = [
            f"{name}.{parameter}" for parameter, value in on.items() if parameter not in USED.get(name, ()) and value
        ]
        found += others if name in USED else [name]
    return tuple(found)
