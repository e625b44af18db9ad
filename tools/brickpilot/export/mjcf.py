"""A model as MJCF, the file format of MuJoCo: the same robot as far as MuJoCo can represent it.

The robot moves on a plane: it slides along x, y and z and turns about z, and its wheels roll on the floor with
the stiffest contacts that MuJoCo allows. MuJoCo's frame has y to the left and z up, so y and yaw have the opposite
sign of Brickpilot's y and yaw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as Xml

from brickpilot.constants import MOTOR_STEP_S
from brickpilot.errors import InputError
from brickpilot.export.machine import SIDES, Machine, RobotFile, bench, chassis, describe, losses, radii, robot_file
from brickpilot.vehicle.model import Model

_HEAD = "Made by Brickpilot. It needs MuJoCo 3.8 or newer. y is to the left, yaw counter-clockwise."
_AIR_M = 1e-3  # m: radius of the ball on which the air's drag acts; a ball of this size has hardly any added mass
_WHEEL_SHARE = 1e-4  # mass of a wheel as a share of the robot's mass; the joint's armature has the wheel's inertia
_FIRM = "0.9999 0.9999 0.001"
_GRIP = 100.0
_FLOATS = "a motor that floats: a control is a voltage, and 0 V shorts the motor"


def write(model: Model) -> RobotFile:
    """Returns the model as MJCF.

    Raises:
        InputError: the profile is `paper`, whose wheels do not carry the body; MuJoCo's wheels do.
    """
    if model.profile != "coupled":
        raise InputError(
            "has wheels that do not carry the body, which MuJoCo cannot represent; use coupled", field="profile"
        )
    machine, missing = describe(model)
    left_out = [*missing, *_combinations(model, machine), _FLOATS]
    root = Xml.Element("mujoco", model=model.name)
    Xml.SubElement(root, "compiler", angle="radian")
    _option(root, model, machine)
    world = Xml.SubElement(root, "worldbody")
    if model.vehicle == "motor":
        _bench(world, machine)
    else:
        _robot(world, machine)
        _contacts(root)
    sides = SIDES[:1] if model.vehicle == "motor" else SIDES
    _actuators(root, machine, sides)
    _sensors(root, model, machine, sides)
    return robot_file(root, _HEAD, left_out)


def _combinations(model: Model, machine: Machine) -> list[str]:
    """Returns a line for each property of the robot that MuJoCo cannot represent together with another property."""
    left_out = []
    if machine.lag > 0 and machine.values["inductance"] > 0:
        left_out.append("inductance, because the command has a lag and a motor of MuJoCo has only one state")
    if machine.lag > 0 and machine.limit is not None:
        left_out.append("the limit of the voltage after the lag: the command is limited before the lag")
    if model.vehicle == "motor" and machine.air > 0:
        left_out.append("the air's drag on the load of a motor")
    return left_out


def _text(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _option(root: Xml.Element, model: Model, machine: Machine) -> None:
    x, y = machine.slope
    gravity = machine.values["gravity"]
    down = (0.0, 0.0, 0.0) if model.vehicle == "motor" else (x, -y, -math.sqrt(max(0.0, 1 - x * x - y * y)))
    attributes = {
        "timestep": _text(MOTOR_STEP_S),
        "integrator": "implicitfast",
        "cone": "elliptic",
        "impratio": "10",
        "tolerance": "1e-14",
        "gravity": _text(*(gravity * share for share in down)),
        "density": _text(1.0 if machine.air > 0 and model.vehicle != "motor" else 0.0),
    }
    Xml.SubElement(root, "option", attributes)


def _body(
    parent: Xml.Element, name: str, place: str, mass: float, inertia: Sequence[float], centre: str
) -> Xml.Element:
    body = Xml.SubElement(parent, "body", name=name, pos=place)
    Xml.SubElement(body, "inertial", pos=centre, mass=_text(mass), diaginertia=_text(*inertia))
    return body


def _joint(
    body: Xml.Element, name: str, kind: str, axis: str, damping: float = 0, dry: float = 0, rotor: float = 0
) -> None:
    attributes = {"name": name, "type": kind, "axis": axis, "damping": _text(damping), "armature": _text(rotor)}
    if dry > 0:
        firm = {"solreffriction": _text(2 * MOTOR_STEP_S, 1), "solimpfriction": _FIRM}
        attributes |= {"frictionloss": _text(dry), **firm}
    Xml.SubElement(body, "joint", attributes)


def _robot(world: Xml.Element, machine: Machine) -> None:
    values, wheels = machine.values, radii(machine)
    wheel_mass, track = _WHEEL_SHARE * machine.mass, values["half_track"]
    mass, centre, inertia = chassis(machine, wheel_mass)
    if inertia <= 0:
        raise InputError("is too small for the mass of the wheels", field="parameters.yaw_inertia")
    Xml.SubElement(world, "geom", _without_collisions("floor", "plane", "0 0 1"))
    body = _body(world, "chassis", "0 0 0", mass, [inertia] * 3, _text(*centre, 0))
    for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")):
        _joint(body, name, "slide", axis, machine.body_drag if name != "z" else 0)
    _joint(body, "yaw", "hinge", "0 0 1", machine.yaw_drag, machine.yaw_dry)
    deck = _without_collisions("deck", "box", _text(1.2 * track, 0.7 * track, 0.3 * track))
    Xml.SubElement(body, "geom", deck | {"pos": _text(0, 0, 2 * max(wheels)), "rgba": "0.9 0.8 0.2 1"})
    if machine.air > 0:
        drag = machine.air / (math.pi * _AIR_M**2)
        ball = _without_collisions("air", "sphere", _text(_AIR_M))
        Xml.SubElement(body, "geom", ball | {"fluidshape": "ellipsoid", "fluidcoef": _text(drag, 0, 0, 0, 0)})
    Xml.SubElement(body, "site", name="imu", pos=_text(machine.imu[0], -machine.imu[1], 0))
    for k, (side, y) in enumerate(zip(SIDES, (track, -track), strict=True)):
        tiny = 1e-9 * values["wheel_inertia"]
        wheel = _body(body, side, _text(0, y, wheels[k]), wheel_mass, [tiny] * 3, "0 0 0")
        _joint(wheel, side, "hinge", "0 1 0", losses(machine)[k], machine.dry[k], values["wheel_inertia"] - tiny)
        tread = _without_collisions(side, "sphere", _text(wheels[k])) | {"rgba": "0 0 0 0"}
        Xml.SubElement(wheel, "geom", tread)
        shown = _without_collisions(f"{side}_wheel", "cylinder", _text(wheels[k], 0.15 * track))
        Xml.SubElement(wheel, "geom", shown | {"zaxis": "0 1 0", "rgba": "0.2 0.2 0.2 1"})


def _without_collisions(name: str, kind: str, size: str) -> dict[str, str]:
    """Returns a geom that collides only within an explicit contact pair."""
    return {"name": name, "type": kind, "size": size, "contype": "0", "conaffinity": "0"}


def _contacts(root: Xml.Element) -> None:
    """Adds the contacts of wheels and floor, with the least time constant that MuJoCo accepts: two steps."""
    contact = Xml.SubElement(root, "contact")
    for side in SIDES:
        firm = {"condim": "3", "friction": _text(_GRIP, _GRIP, 0, 0, 0), "solref": _text(2 * MOTOR_STEP_S, 1)}
        Xml.SubElement(contact, "pair", {"geom1": "floor", "geom2": side, **firm, "solimp": _FIRM})


def _bench(world: Xml.Element, machine: Machine) -> None:
    """Adds a motor and its load: one joint, which turns, or slides if the input commands a force."""
    linear, inertia, damping = bench(machine)
    tiny = 1e-6 * inertia
    body = _body(world, "load", "0 0 0", tiny if linear else inertia, [tiny] * 3, "0 0 0")
    _joint(body, "left", "slide" if linear else "hinge", "0 0 1", damping, machine.dry[0], inertia - tiny)
    Xml.SubElement(body, "geom", _without_collisions("load", "cylinder", "0.02 0.01"))


def _actuators(root: Xml.Element, machine: Machine, sides: Sequence[str]) -> None:
    actuator = Xml.SubElement(root, "actuator")
    for k, side in enumerate(sides):
        head = {"name": side, "joint": side}
        head |= _delay(machine.delay)
        if machine.limit is not None:
            end = machine.limit / machine.gain[k]
            head |= {"ctrllimited": "true", "ctrlrange": _text(-end, end)}
        _motor(actuator, head, machine, k)
    for k, side in enumerate(sides):
        if machine.load[k] != 0:
            constant = {"gainprm": "0", "biastype": "affine", "biasprm": _text(-machine.load[k], 0, 0)}
            Xml.SubElement(actuator, "general", {"name": f"load_{side}", "joint": side, **constant})


def _delay(delay: float) -> dict[str, str]:
    """Returns the attributes for a delay in s: whole steps minus half a step, so that rounding never adds a step."""
    steps = round(delay / MOTOR_STEP_S)
    return {"delay": _text((steps - 0.5) * MOTOR_STEP_S), "nsample": str(steps + 1)} if steps > 0 else {}


def _motor(actuator: Xml.Element, head: dict[str, str], machine: Machine, k: int) -> None:
    """Adds a direct-current motor. MuJoCo has one constant for torque and back EMF. A motor with `K_t` and `K_e` equals
    a motor with `K_e` for both, and `K_e / K_t` times the resistance and inductance. A gain `g` of the voltage
    divides the constant by `g`, and resistance and inductance by `g^2`."""
    values = machine.values
    per_volt = values["force_per_volt"] or values["torque_per_volt"]
    torque, emf = values["torque_constant"] * machine.flux[k], values["emf_constant"] * machine.flux[k]
    gain = machine.gain[k]
    lag = {"dyntype": "filterexact", "dynprm": _text(machine.lag)} if machine.lag > 0 else {}
    if per_volt > 0:
        Xml.SubElement(actuator, "general", {**head, "gainprm": _text(per_volt * gain), **lag})
    elif lag or torque * emf <= 0:
        stiff = torque / values["resistance"]
        bias = {"biastype": "affine", "biasprm": _text(0, 0, -stiff * emf)}
        Xml.SubElement(actuator, "general", {**head, "gainprm": _text(stiff * gain), **bias, **lag})
    else:
        like = emf / gain
        scale = like / (torque * gain)
        motor = {"motorconst": _text(like, like), "resistance": _text(values["resistance"] * scale)}
        inductance = {"inductance": _text(values["inductance"] * scale, 0)} if values["inductance"] > 0 else {}
        Xml.SubElement(actuator, "dcmotor", {**head, **motor, **inductance})


def _sensors(root: Xml.Element, model: Model, machine: Machine, sides: Sequence[str]) -> None:
    sensor = Xml.SubElement(root, "sensor")
    late = _delay(machine.late)
    if model.vehicle != "motor":
        Xml.SubElement(sensor, "gyro", {"name": "gyro", "site": "imu", **late})
        Xml.SubElement(sensor, "accelerometer", {"name": "accelerometer", "site": "imu", **late})
    for side in sides:
        Xml.SubElement(sensor, "jointpos", {"name": f"wheel_angle_{side}", "joint": side, **late})
        Xml.SubElement(sensor, "jointvel", {"name": f"wheel_speed_{side}", "joint": side, **late})
