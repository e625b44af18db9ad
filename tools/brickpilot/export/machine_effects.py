"""The effects that a rigid-body simulator can be told: one function each, with the law of the effect's row in C.

What is not in this list, such as a battery that sags or a gyro with a bias, has no counterpart there. Whoever writes
the file says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import fields, replace

from brickpilot import catalogue
from brickpilot.export.machine import Machine, Pair, nominal
from brickpilot.vehicle.model import Model

Values = Mapping[str, float]
Told = Callable[[Machine, Values], Machine]
"""Returns the machine with the effect in it."""

_EVERYTHING = frozenset(field.name for field in fields(Machine))


def tell(model: Model, holds: Container[str] = _EVERYTHING) -> tuple[Machine, list[str]]:
    """Returns the robot with every effect that can be told, and the names of the others, in the table's order.

    Args:
        holds: the attributes of `Machine` that the file has a place for; an effect on another one is not told.
    """
    machine, untold = nominal(model), []
    for effect in catalogue.effects_of(model.effects):
        presets = {info.name: info.preset for info in effect.parameters}
        act = _TOLD.get(effect.name)
        changed = act(machine, presets | dict(model.effects[effect.name])) if act else None
        if changed is None or any(one not in holds for one in _differing(machine, changed)):
            untold.append(effect.name)
        else:
            machine = changed
    return machine, untold


def _differing(one: Machine, other: Machine) -> list[str]:
    return [field.name for field in fields(Machine) if getattr(one, field.name) != getattr(other, field.name)]


def _more(pair: Pair, left: float, right: float) -> Pair:
    return pair[0] + left, pair[1] + right


def _apart(pair: Pair, difference: float) -> Pair:
    """Returns factors of which the left one is larger by a share."""
    return pair[0] * (1 + 0.5 * difference), pair[1] * (1 - 0.5 * difference)


def _payload(machine: Machine, values: Values) -> Machine:
    ahead, right = values["forward"] - machine.com[0], values["right"] - machine.com[1]
    total = machine.mass + values["mass"]
    share = values["mass"] / total if total > 0 else 0.0
    inertia = machine.yaw_inertia + share * machine.mass * (ahead**2 + right**2)
    return replace(machine, mass=total, yaw_inertia=inertia, com=_more(machine.com, share * ahead, share * right))


def _limit(machine: Machine, values: Values) -> Machine:
    return replace(machine, limit=min(values["voltage"], machine.limit or math.inf))


_TOLD: dict[str, Told] = {
    "input_delay": lambda m, v: replace(m, delay=v["delay"]),
    "actuator_lag": lambda m, v: replace(m, lag=v["time_constant"]),
    "motor_asymmetry": lambda m, v: replace(m, gain=_apart(m.gain, v["difference"])),
    "supply_saturation": _limit,
    "torque_constant_asymmetry": lambda m, v: replace(m, flux=_apart(m.flux, v["difference"])),
    "coulomb_friction": lambda m, v: replace(m, dry=_more(m.dry, v["torque"], v["torque"])),
    "viscous_loss": lambda m, v: replace(m, viscous=_more(m.viscous, v["drag"], v["drag"])),
    "constant_offset": lambda m, v: replace(
        m, load=_more(m.load, v["torque"] + v["difference"], v["torque"] - v["difference"])
    ),
    "yaw_scrub": lambda m, v: replace(m, yaw_dry=m.yaw_dry + v["moment"]),
    "viscous_scrub": lambda m, v: replace(m, yaw_drag=m.yaw_drag + v["drag"]),
    "surge_drag": lambda m, v: replace(m, body_drag=m.body_drag + v["drag"]),
    "quadratic_drag": lambda m, v: replace(m, air=m.air + v["drag"]),
    "floor_slope": lambda m, v: replace(m, slope=_more(m.slope, v["slope_x"], v["slope_y"])),
    "com_forward_offset": lambda m, v: replace(m, com=_more(m.com, v["forward"], 0.0)),
    "com_lateral_offset": lambda m, v: replace(m, com=_more(m.com, 0.0, v["right"])),
    "payload_mass": _payload,
    "wheel_radius_mismatch": lambda m, v: replace(m, rim=_apart(m.rim, v["mismatch"])),
    "imu_lever_arm": lambda m, v: replace(m, imu=_more(m.imu, v["x"], v["y"])),
    "sensor_delay": lambda m, v: replace(m, late=m.late + v["delay"]),
}
