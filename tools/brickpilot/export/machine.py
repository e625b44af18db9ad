"""The description of a robot for rigid-body simulators: masses, wheels, motors, losses, sensors and effects.

The frame is Brickpilot's: x forward, y right, yaw clockwise. A pair is (left, right), except for positions and the
slope. A bare motor uses only the first value of a pair.

An effect that these simulators can represent has one function here, with the same law as in C. Other effects, such as
battery sag and gyro bias, have no function. Each written file lists the effects that it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from xml.etree import ElementTree as Xml

from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model

SIDES = ("left", "right")

Pair = tuple[float, float]


@dataclass(frozen=True)
class Machine:
    """The description of one robot, in SI.

    Attributes:
        values: the nominal parameters.
        com: m, position of the centre of mass from the axle's middle, (ahead, right).
        rim: ratio of each wheel's radius to the nominal radius.
        flux: factor on each motor's torque constant and back-EMF constant.
        gain: factor on each commanded voltage.
        limit: V, the largest voltage that a drive reaches; None: no limit.
        delay, lag: s, dead time and time constant of the command.
        dry, viscous: dry friction in N m and drag in N m s/rad at each wheel, in addition to the nominal losses.
        load: N m, constant torque at each wheel against forward motion.
        body_drag, air: linear drag in N s/m and quadratic drag in N s^2/m^2 on the body's motion.
        yaw_drag, yaw_dry: linear drag in N m s/rad and dry friction in N m on the body's yaw.
        slope: sine of the angle by which the floor falls, (along x, along y).
        imu: m, position of the accelerometers from the axle's middle, (ahead, right).
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


def robot_file(root: Xml.Element, head: str, left_out: Sequence[str]) -> RobotFile:
    """Returns an XML tree as a file that begins with a comment: `head`, and a line for each part that is left out."""
    remarks = "\n     ".join([head, "Not in this file:", *(f"  {line}" for line in left_out)]).replace("--", "- -")
    root.insert(0, Xml.Comment(f"{remarks} "))
    Xml.indent(root)
    return RobotFile(Xml.tostring(root, encoding="unicode") + "\n", tuple(left_out))


def radii(machine: Machine) -> Pair:
    """Returns the radius of each wheel in m."""
    return machine.values["wheel_radius"] * machine.rim[0], machine.values["wheel_radius"] * machine.rim[1]


def losses(machine: Machine) -> Pair:
    """Returns the loss of each wheel that is linear in its speed, in N m s/rad: eq. 14 of the paper with eq. 13."""
    values = machine.values
    weight = machine.mass * values["gravity"]
    left, right = (
        values["viscous_friction"] + weight * values["rolling_friction"] * radius**2 + more
        for radius, more in zip(radii(machine), machine.viscous, strict=True)
    )
    return left, right


def chassis(machine: Machine, wheel: float, across: float = 0.0) -> tuple[float, Pair, float]:
    """Returns mass, centre of mass and yaw inertia of the chassis, so that chassis plus wheels have the robot's values.

    The centre of mass is given as (ahead, left) of the axle's middle. If the wheels alone have at least the robot's
    inertia, the inertia of the chassis is 0 or negative.

    Args:
        machine: the robot.
        wheel: kg, the mass of a wheel.
        across: kg m^2, the inertia of a wheel about its vertical axis.
    """
    mass = machine.mass - 2 * wheel
    com_ahead, com_right = machine.com
    ahead, left = com_ahead * machine.mass / mass, -com_right * machine.mass / mass
    of_wheels = 2 * (across + wheel * (machine.values["half_track"] ** 2 + com_ahead**2 + com_right**2))
    inertia = machine.yaw_inertia - of_wheels - mass * ((ahead - com_ahead) ** 2 + (left + com_right) ** 2)
    return mass, (ahead, left), inertia


def bench(machine: Machine) -> tuple[bool, float, float]:
    """Returns whether a motor's load slides (then the input commands a force), and the load's inertia and damping.

    Inertia and damping are in kg m^2 and N m s/rad. For a load that slides, they are in kg and N s/m.
    """
    values = machine.values
    linear = values["force_per_volt"] > 0
    lever = 1.0 if linear else values["wheel_radius"]
    inertia = (0.0 if linear else values["wheel_inertia"]) + machine.mass * lever**2
    weight = machine.mass * values["gravity"] * values["rolling_friction"] * lever**2
    damping = values["viscous_friction"] + weight + machine.viscous[0] + machine.body_drag * lever**2
    return linear, inertia, damping


Values = Mapping[str, float]
Law = Callable[[Machine, Values], Machine]
"""A function that adds an effect to a machine: (machine, parameters of the effect) -> the changed machine."""

_EVERYTHING = frozenset(field.name for field in fields(Machine))


def describe(model: Model, holds: Container[str] = _EVERYTHING) -> tuple[Machine, list[str]]:
    """Returns the robot with every effect that the file can express, and the names of the other effects.

    Args:
        holds: the attributes of `Machine` that the file can contain; effects that change other attributes are left out.

    Raises:
        InputError: the vehicle is a skid steer.
    """
    if model.vehicle == "skid_steer":
        message = "is a skid_steer, whose four contacts Brickpilot cannot write as MJCF or URDF; export it as an FMU"
        raise InputError(message, file=model.name, field="vehicle")
    values = model.nominal
    air = 0.5 * values["air_density"] * values["drag_area"]
    machine, missing = Machine(values, values["mass"], values["yaw_inertia"], air=air), []
    for effect in catalogue.effects_of(model.effects):
        presets = {info.name: info.preset for info in effect.parameters}
        law = _LAWS.get(effect.name)
        changed = law(machine, presets | dict(model.effects[effect.name])) if law else None
        if changed is None or any(
            field.name not in holds
            for field in fields(Machine)
            if getattr(machine, field.name) != getattr(changed, field.name)
        ):
            missing.append(effect.name)
        else:
            machine = changed
    return machine, missing


def _more(pair: Pair, left: float, right: float) -> Pair:
    return pair[0] + left, pair[1] + right


def _apart(pair: Pair, difference: float) -> Pair:
    """Changes a pair of factors so that the left factor exceeds the right factor by the share `difference`."""
    return pair[0] * (1 + 0.5 * difference), pair[1] * (1 - 0.5 * difference)


def _payload(machine: Machine, values: Values) -> Machine:
    ahead, right = values["forward"] - machine.com[0], values["right"] - machine.com[1]
    total = machine.mass + values["mass"]
    share = values["mass"] / total if total > 0 else 0.0
    inertia = machine.yaw_inertia + share * machine.mass * (ahead**2 + right**2)
    return replace(machine, mass=total, yaw_inertia=inertia, com=_more(machine.com, share * ahead, share * right))


def _limit(machine: Machine, values: Values) -> Machine:
    return replace(machine, limit=min(values["voltage"], machine.limit or math.inf))


_LAWS: dict[str, Law] = {
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
