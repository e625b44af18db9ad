"""The description of a robot for rigid-body simulators: masses, wheels, motors, losses and sensors, with effects.

Frame of Brickpilot: x forward, y right, yaw clockwise. Pairs are left and right; for a motor only the first value is
used.

Each effect that can be expressed has one function, with the law of the effect's row in C. An effect without a function,
such as battery sag or gyro bias, has no counterpart in the simulators. The writer of a file lists such effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, fields, replace

from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model

Pair = tuple[float, float]


@dataclass(frozen=True)
class Machine:
    """The description of one robot, in SI.

    Attributes:
        values: the nominal parameters.
        com: m, centre of mass ahead and to the right of the axle's middle.
        rim: radius of each wheel over the nominal one.
        flux: factor of each motor's torque constant and back-EMF constant.
        gain: factor of each commanded voltage.
        limit: V, the largest voltage that a drive reaches; None: no limit.
        delay, lag: s, dead time and time constant of the command.
        dry, viscous: N m and N m s/rad at each wheel, in addition to the nominal losses.
        load: N m at each wheel, against forward motion.
        body_drag, air: N s/m and N s^2/m^2 on the body.
        yaw_drag, yaw_dry: N m s/rad and N m on the body.
        slope: sine of the angle by which the floor falls along x and along y.
        imu: m, place of the accelerometers.
        late: s, the delay of the sensors.
    """

    values: Mapping[str, float]
    mass: float
    yaw_inertia: float
    com: Pair = (0.0, 0.0)
    rim: Pair = (1.0, 1.0)
    flux: Pair = (1.0, 1.0)
    gain: Pair = (1.0, 1.0)
    limit: float | None = None
    delay: float = 0.0
    lag: float = 0.0
    dry: Pair = (0.0, 0.0)
    viscous: Pair = (0.0, 0.0)
    load: Pair = (0.0, 0.0)
    body_drag: float = 0.0
    air: float = 0.0
    yaw_drag: float = 0.0
    yaw_dry: float = 0.0
    slope: Pair = (0.0, 0.0)
    imu: Pair = (0.0, 0.0)
    late: float = 0.0


@dataclass(frozen=True)
class RobotFile:
    """A file for another program, and one line for each part of the model that the file lacks."""

    text: str
    left_out: tuple[str, ...]


def nominal(model: Model) -> Machine:
    """Returns the robot without its effects."""
    values = catalogue.presets(model.vehicle) | dict(model.parameters)
    air = 0.5 * values["air_density"] * values["drag_area"]
    return Machine(values, values["mass"], values["yaw_inertia"], air=air)


def radii(machine: Machine) -> Pair:
    """Returns the radius of each wheel, m."""
    return machine.values["wheel_radius"] * machine.rim[0], machine.values["wheel_radius"] * machine.rim[1]


def losses(machine: Machine) -> Pair:
    """Returns the losses of each wheel that are linear in its speed, N m s/rad: eq. 13 in eq. 14 of the paper."""
    values = machine.values
    weight = machine.mass * values["gravity"]
    left, right = (
        values["viscous_friction"] + weight * values["rolling_friction"] * radius**2 + more
        for radius, more in zip(radii(machine), machine.viscous, strict=True)
    )
    return left, right


Values = Mapping[str, float]
Told = Callable[[Machine, Values], Machine]
"""Function that returns the machine with an effect added."""

_EVERYTHING = frozenset(field.name for field in fields(Machine))


def tell(model: Model, holds: Container[str] = _EVERYTHING) -> tuple[Machine, list[str]]:
    """Returns the robot with every effect that can be expressed, and the other effects' names, in the table's order.

    Args:
        holds: the attributes of `Machine` that the file can contain; effects on other attributes are left out.

    Raises:
        InputError: the vehicle is a skid steer.
    """
    if model.vehicle == "skid_steer":
        message = "is a skid_steer, whose four contacts MJCF and URDF files cannot say here; an FMU can (export fmu)"
        raise InputError(message, file=model.name, field="vehicle")
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
    """Returns the factors, changed so that the left one exceeds the right one by the share `difference`."""
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
