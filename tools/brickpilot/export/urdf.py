"""A model as URDF, the file format of robots in ROS: links with masses, joints with losses and limits.

URDF's frame has y to the left and z up, so y and yaw have the opposite sign of Brickpilot's y and yaw.
`base_footprint` lies on the floor, in the middle between the wheels; `base_link` lies above it on the axle.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as Xml

from brickpilot.errors import InputError
from brickpilot.export.machine import SIDES, Machine, RobotFile, bench, chassis, describe, losses, radii, robot_file
from brickpilot.vehicle.model import Model

_HEAD = "Made by Brickpilot. SI; y is to the left, yaw counter-clockwise."
_HOLDS = frozenset({"mass", "yaw_inertia", "com", "rim", "limit", "flux", "gain", "dry", "viscous", "imu"})
_WHEEL_SHARE = 1e-2  # mass of each wheel as a share of the robot's mass
_ELECTRIC = "motors: the file has only the limits of effort and velocity that follow from their constants"
_AIR = "the drag of the air"
_FLOOR = "wheels that roll without slip: the simulator computes the contact with the floor"
_PAPER = "the profile paper, whose wheels do not carry the body"


def write(model: Model) -> RobotFile:
    """Returns the model as URDF.

    Raises:
        InputError: the wheels alone have more yaw inertia than the robot.
    """
    machine, missing = describe(model, _HOLDS)
    left_out = [*missing, _ELECTRIC]
    left_out += [_AIR] if machine.air > 0 else []
    left_out += [_FLOOR] if model.vehicle != "motor" else []
    left_out += [_PAPER] if model.profile == "paper" else []
    root = Xml.Element("robot", name=model.name)
    if model.vehicle == "motor":
        _bench(root, machine)
    else:
        _robot(root, machine)
    return robot_file(root, _HEAD, left_out)


def _text(*numbers: float) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)


def _link(
    root: Xml.Element, name: str, mass: float, inertia: Sequence[float], centre: Sequence[float] = (0, 0, 0)
) -> Xml.Element:
    """Adds a link. `inertia`: the inertia about x, y and z at the link's centre of mass."""
    link = Xml.SubElement(root, "link", name=name)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "origin", xyz=_text(*centre), rpy="0 0 0")
    Xml.SubElement(inertial, "mass", value=_text(mass))
    xx, yy, zz = (_text(moment) for moment in inertia)
    Xml.SubElement(inertial, "inertia", {"ixx": xx, "ixy": "0", "ixz": "0", "iyy": yy, "iyz": "0", "izz": zz})
    return link


def _shape(link: Xml.Element, turn: str, kind: str, *, collides: bool = False, **size: str) -> None:
    for role in ("visual", "collision") if collides else ("visual",):
        shown = Xml.SubElement(link, role)
        Xml.SubElement(shown, "origin", xyz="0 0 0", rpy=turn)
        Xml.SubElement(Xml.SubElement(shown, "geometry"), kind, size)


def _joint(root: Xml.Element, name: str, kind: str, parent: str, child: str, place: Sequence[float]) -> Xml.Element:
    joint = Xml.SubElement(root, "joint", name=name, type=kind)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    Xml.SubElement(joint, "origin", xyz=_text(*place), rpy="0 0 0")
    return joint


def _robot(root: Xml.Element, machine: Machine) -> None:
    values, wheels, track = machine.values, radii(machine), machine.values["half_track"]
    axle = sum(wheels) / 2
    wheel, spin = _WHEEL_SHARE * machine.mass, values["wheel_inertia"]
    across = spin / 2
    mass, centre, inertia = chassis(machine, wheel, across)
    if inertia <= 0:
        raise InputError("is too small beside the inertia of the wheels", field="parameters.yaw_inertia")
    Xml.SubElement(root, "link", name="base_footprint")
    body = _link(root, "base_link", mass, [inertia] * 3, (*centre, 0))
    _shape(body, "0 0 0", "box", size=_text(2.4 * track, 1.4 * track, 0.6 * track))
    _joint(root, "base", "fixed", "base_footprint", "base_link", (0, 0, axle))
    for k, (side, y) in enumerate(zip(SIDES, (track, -track), strict=True)):
        link = _link(root, f"{side}_wheel", wheel, (across, spin, across))
        turned = "1.5707963267948966 0 0"
        _shape(link, turned, "cylinder", collides=True, radius=_text(wheels[k]), length=_text(0.3 * track))
        place = (0, y, wheels[k] - axle)
        joint = _joint(root, f"{side}_wheel_joint", "continuous", "base_link", f"{side}_wheel", place)
        Xml.SubElement(joint, "axis", xyz="0 1 0")
        _limits(joint, machine, k, losses(machine)[k])
    Xml.SubElement(root, "link", name="imu_link")
    _joint(root, "imu", "fixed", "base_link", "imu_link", (machine.imu[0], -machine.imu[1], 0))


def _limits(joint: Xml.Element, machine: Machine, k: int, damping: float) -> None:
    """Writes the motor's limits at the largest voltage: the torque at rest, and the speed without load."""
    values = machine.values
    volts = min(values["battery_voltage"] * machine.gain[k], machine.limit or float("inf"))
    torque, emf = values["torque_constant"] * machine.flux[k], values["emf_constant"] * machine.flux[k]
    per_volt = values["force_per_volt"] or values["torque_per_volt"]
    effort = per_volt * volts if per_volt > 0 else torque * volts / values["resistance"]
    fastest = effort / damping if damping > 0 else 0.0
    if per_volt <= 0 and torque * emf > 0:
        fastest = torque * volts / (torque * emf + damping * values["resistance"])
    Xml.SubElement(joint, "limit", effort=_text(effort), velocity=_text(fastest))
    Xml.SubElement(joint, "dynamics", damping=_text(damping), friction=_text(machine.dry[k]))


def _bench(root: Xml.Element, machine: Machine) -> None:
    """Adds a motor and its load: a joint that turns, or slides if the input commands a force."""
    linear, inertia, damping = bench(machine)
    Xml.SubElement(root, "link", name="base_link")
    load = _link(root, "load", inertia if linear else 1.0, [inertia] * 3)
    _shape(load, "0 0 0", "cylinder", radius="0.02", length="0.02")
    joint = _joint(root, "load_joint", "prismatic" if linear else "continuous", "base_link", "load", (0, 0, 0))
    Xml.SubElement(joint, "axis", xyz="0 0 1")
    _limits(joint, machine, 0, damping)
    if linear:
        limit = joint.find("limit")
        assert limit is not None
        limit.attrib.update({"lower": "-1000", "upper": "1000"})
