"""The vehicle as a MuJoCo model: bodies, joints, contacts. Positions: m from the middle of the axle, y to the left."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np

from hidden.recipe import GRAVITY, Hidden, Vehicle

DT = 0.001
GRIP = 4.0  # friction of wheel on floor, for a vehicle that must not slip
FIRM = 300.0  # ratio of the friction in the firm direction to the friction in the slipping direction
SIDE_SLIP_RETURN = 1.5
"""Factor by which a step corrects the side slip of a wheel: 1 stops the slip, 2 reverses the slip. The vehicle turns in
each step, so factor 1 dissipates energy (a drag of m u r^2 DT / 2 in curves). Factor 2 dissipates no energy, but the
slip never settles. Factor 1.5 leaves a third of the drag."""
# A dragged ball is light, has a low friction coefficient and a large load, because the friction cone of a contact lifts
# a sliding body by grip^2 times speed times mass.
CASTER_MASS = 5e-5
CASTER_GRIP = 0.3
WHEEL_SHARE = 0.04  # mass of each wheel as a share of the vehicle's mass

EFFECTS = frozenset(
    {"coulomb_friction", "gear_backlash", "carpet_nap", "caster_drag", "yaw_scrub", "floor_slope", "com_forward_offset",
     "com_lateral_offset", "payload_mass", "wheel_radius_mismatch", "wheel_slip", "side_slip", "tyre_grip",
     "backlash_soft", "tyre_deflating", "payload_sprung"}
)  # fmt: skip
"""The effects that are modelled by bodies, joints or contacts."""


@dataclass(frozen=True)
class Slip:
    """How the tyres slip: along or across the vehicle, without slip in the other direction, or equally in both."""

    across: bool
    creep: float  # slip speed per force of one tyre, m/(N s)
    limit: float  # largest force of one tyre, N
    both: bool = False


@dataclass
class Names:
    """Indices into MuJoCo's arrays. Pairs are (left, right)."""

    wheel_dof: tuple[int, int] = (6, 7)
    motor_dof: tuple[int, int] = (6, 7)
    wheel_angle: tuple[int, int] = (7, 8)
    motor_angle: tuple[int, int] = (7, 8)
    slides: tuple[int, ...] = ()
    loads: dict[int, float] = field(default_factory=dict)  # dof -> constant force, N
    coulomb: float = 0.0  # N m, constant dry friction of each wheel
    mass: float = 0.0  # kg, with payload
    slip: Slip | None = None


def build(vehicle: Vehicle, hidden: Hidden) -> tuple[mujoco.MjModel, Names]:
    """Returns the compiled model of `vehicle`, with the hidden effects that are bodies, joints and contacts."""

    def p(effect: str, parameter: str) -> float:
        return hidden.get(effect, {}).get(parameter, 0.0)

    radius, track, mass = vehicle.wheel_radius, vehicle.half_track, vehicle.mass
    payload, sprung = p("payload_mass", "mass"), hidden.get("payload_sprung")
    names = Names(mass=mass + payload + p("payload_sprung", "mass"), coulomb=p("coulomb_friction", "torque"))
    ahead, right = p("com_forward_offset", "forward"), p("com_lateral_offset", "right")

    wheel_mass = WHEEL_SHARE * mass
    spin = min(0.5 * wheel_mass * radius**2, 0.5 * vehicle.wheel_inertia)
    across = 0.6 * spin
    casters = _casters(hidden, radius)
    chassis = mass - 2 * wheel_mass - CASTER_MASS * len(casters)
    # centre of mass of the chassis alone, chosen so that the whole vehicle has the stated centre of mass and inertia
    centre_x, centre_y = mass * ahead / chassis, -mass * right / chassis
    others = 2 * (across + wheel_mass * (track**2 + ahead**2 + right**2))
    others += chassis * ((centre_x - ahead) ** 2 + (centre_y + right) ** 2)
    turning = vehicle.yaw_inertia - others
    if turning <= 0:
        raise ValueError("the wheels alone have more yaw inertia than the vehicle")
    low = -0.4 * radius
    backlash = hidden.get("gear_backlash") or hidden.get("backlash_soft")
    rotor = (backlash or {}).get("rotor_share", 0.0) * vehicle.wheel_inertia
    armature = vehicle.wheel_inertia - spin - rotor
    if armature < 0:
        raise ValueError("rotor_share leaves the wheel less than its rim")
    mismatch = 0.5 * p("wheel_radius_mismatch", "mismatch")
    radii = (radius * (1 + mismatch), radius * (1 - mismatch))
    reach = 1.2 * track
    skid = 0.3 * radius

    bodies = []
    for side, (name, y) in enumerate((("left", track), ("right", -track))):
        damping = vehicle.wheel_damping(names.mass, radii[side])
        bodies.append(f"""
      <body pos="0 {y:.12g} {radii[side] - radius:.12g}">
        <joint name="{name}" axis="0 1 0" armature="{armature:.12g}" damping="{damping:.12g}"
               frictionloss="{names.coulomb:.12g}"/>
        <inertial pos="0 0 0" mass="{wheel_mass:.12g}" diaginertia="{across:.12g} {spin:.12g} {across:.12g}"/>
        <geom name="{name}" type="sphere" size="{radii[side]:.12g}"/>
      </body>""")
    if payload > 0:
        x, y = p("payload_mass", "forward"), -p("payload_mass", "right")
        tiny = 1e-9
        bodies.append(f"""
      <body pos="{x:.12g} {y:.12g} {low:.12g}">
        <inertial pos="0 0 0" mass="{payload:.12g}" diaginertia="{tiny} {tiny} {tiny}"/>
      </body>""")
    tendon = ""
    if backlash:
        for name, y in (("left", track), ("right", -track)):
            bodies.append(f"""
      <body pos="0 {y:.12g} 0">
        <joint name="rotor_{name}" axis="0 1 0" armature="{rotor:.12g}"/>
        <inertial pos="0 0 0" mass="1e-6" diaginertia="1e-10 1e-10 1e-10"/>
      </body>""")
        tendon = _play(0.5 * backlash["gap"]) if "gear_backlash" in hidden else ""  # `mujoco_laws` models soft teeth
        names.motor_dof, names.motor_angle = (8, 9), (9, 10)
    pairs = ""
    first = 8 + (2 if backlash else 0)
    for index, (x, force) in enumerate(casters):
        name = f"caster{index}"
        bodies.append(f"""
      <body pos="{x:.12g} 0 {skid - radius:.12g}">
        <joint name="{name}" type="slide" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="{CASTER_MASS}" diaginertia="1e-9 1e-9 1e-9"/>
        <geom name="{name}" type="sphere" size="{skid:.12g}"/>
      </body>""")
        names.loads[first + index] = CASTER_MASS * GRAVITY - force / CASTER_GRIP
        names.slides = (*names.slides, first + 1 + index)
        pairs += (
            f'<pair name="{name}" geom1="floor" geom2="{name}" condim="3" friction="{CASTER_GRIP} {CASTER_GRIP} 0 0 0"'
        )
        pairs += ' solreffriction="0.004 1"/>'
    if sprung:
        bodies.append(_sprung(sprung, low))
    slope_x, slope_y = p("floor_slope", "slope_x"), p("floor_slope", "slope_y")
    down = math.sqrt(1 - slope_x**2 - slope_y**2)
    # MuJoCo does not use the first number, but a 0 there would select another format
    grip = f'solreffriction="-0.0001 {-SIDE_SLIP_RETURN / DT:.12g}"'
    names.slip = _slip(hidden, names.mass)
    xml = f"""
<mujoco>
  <option timestep="{DT}" integrator="implicitfast" cone="elliptic" impratio="100" tolerance="1e-12"
          gravity="{GRAVITY * slope_x:.12g} {-GRAVITY * slope_y:.12g} {-GRAVITY * down:.12g}"/>
  <default>
    <geom contype="0" conaffinity="0"/>
    <joint solreffriction="0.002 1" solimpfriction="0.999 0.999 0.001"/>
    <pair solref="0.004 1" solimp="0.99 0.999 0.001"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body name="chassis" pos="0 0 {radius:.12g}">
      <freejoint/>
      <inertial pos="{centre_x:.12g} {centre_y:.12g} {low:.12g}" mass="{chassis:.12g}"
                diaginertia="{0.6 * turning:.12g} {0.7 * turning:.12g} {turning:.12g}"/>
      <geom name="front" type="sphere" size="{skid:.12g}" pos="{reach:.12g} 0 {skid - radius:.12g}"/>
      <geom name="rear" type="sphere" size="{skid:.12g}" pos="{-reach:.12g} 0 {skid - radius:.12g}"/>{"".join(bodies)}
    </body>
  </worldbody>
  <contact>
    <pair name="left" geom1="floor" geom2="left" condim="3" friction="{GRIP} {GRIP} 0 0 0" {grip}/>
    <pair name="right" geom1="floor" geom2="right" condim="3" friction="{GRIP} {GRIP} 0 0 0" {grip}/>
    <pair geom1="floor" geom2="front" condim="1" solref="0.012 1" solimp="0.98 0.98 0.001"/>
    <pair geom1="floor" geom2="rear" condim="1" solref="0.012 1" solimp="0.98 0.98 0.001"/>
    {pairs}
  </contact>
  {tendon}
</mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    moment = p("yaw_scrub", "moment")
    if moment > 0:
        model.dof_frictionloss[5] = moment
        model.dof_solref[5] = (0.002, 1)
        model.dof_solimp[5, :2] = 0.999
    return model, names


def _sprung(load: Mapping[str, float], low: float) -> str:
    """Returns the XML of a load that slides along the vehicle on a spring and a damper, beside its middle line."""
    omega = 2 * math.pi * load["frequency"]
    spring, damper = load["mass"] * omega**2, 2 * load["damping"] * omega * load["mass"]
    return f"""
      <body pos="0 {-load["right"]:.12g} {low:.12g}">
        <joint name="sprung" type="slide" axis="1 0 0" stiffness="{spring:.12g}" damping="{damper:.12g}"/>
        <inertial pos="0 0 0" mass="{load["mass"]:.12g}" diaginertia="1e-9 1e-9 1e-9"/>
      </body>"""


def deflate(model: mujoco.MjModel, vehicle: Vehicle, hidden: Hidden, age: float) -> None:
    """Sets the radii of the wheels for a run that starts `age` s after power-on, if a tyre loses air."""
    if "tyre_deflating" not in hidden:
        return
    half = 0.5 * hidden["tyre_deflating"]["rate"] * age
    for name, share in (("left", 1 + half), ("right", 1 - half)):
        radius, geom = share * vehicle.wheel_radius, model.geom(name)
        geom.size[0] = model.geom_rbound[geom.id] = radius
        model.body_pos[geom.bodyid[0], 2] = radius - vehicle.wheel_radius


def _play(half_gap: float) -> str:
    """Returns the XML of tendons that let each rotor turn ahead of its wheel, or behind, by up to `half_gap` rad."""
    limits = f'limited="true" range="{-half_gap:.12g} {half_gap:.12g}" solreflimit="0.002 1"'
    fixed = [
        f"""<fixed {limits} solimplimit="0.99 0.999 0.001">
      <joint joint="rotor_{name}" coef="1"/><joint joint="{name}" coef="-1"/></fixed>"""
        for name in ("left", "right")
    ]
    return f"<tendon>{''.join(fixed)}</tendon>"


def _casters(hidden: Hidden, radius: float) -> list[tuple[float, float]]:
    """Returns (position ahead in m, friction in N) of each dragged ball: a caster, one for half a carpet's force."""
    out = []
    if "caster_drag" in hidden:
        out.append((hidden["caster_drag"]["forward"], hidden["caster_drag"]["force"]))
    if "carpet_nap" in hidden:
        nap = hidden["carpet_nap"]
        out.append((0.0, 0.5 * math.hypot(nap["force_x"], nap["force_y"])))
    return out


def _slip(hidden: Hidden, mass: float) -> Slip | None:
    if len(hidden.keys() & {"wheel_slip", "side_slip", "tyre_grip"}) > 1:
        raise ValueError("a contact has one law: wheel_slip, side_slip or tyre_grip")
    half = 0.5 * mass * GRAVITY
    if "wheel_slip" in hidden:
        return Slip(False, hidden["wheel_slip"]["creep"], hidden["wheel_slip"]["friction"] * half)
    if "side_slip" in hidden:
        return Slip(True, 2 * hidden["side_slip"]["creep"], hidden["side_slip"]["friction"] * half)
    if "tyre_grip" in hidden:
        return Slip(False, hidden["tyre_grip"]["creep"], hidden["tyre_grip"]["friction"] * half, both=True)
    return None


def soften(model: mujoco.MjModel, data: mujoco.MjData, slip: Slip) -> None:
    """Makes tangent 1 (or both tangents) of the wheels' contacts soft, for the contact loads in `data`.

    A contact creeps at R / B times its force; B is the contact's damping and, in tangent 1, R = R_normal / impratio.
    """
    if any(model.pair(i).name.startswith("caster") for i in range(model.npair)):
        raise ValueError("impratio belongs to the whole model: no ball that drags beside a tyre that slips")
    loads, resistance = [], 0.0
    force = np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        if contact.dim == 3:
            mujoco.mj_contactForce(model, data, i, force)
            loads.append(float(force[0]))
            resistance = float(data.efc_R[contact.efc_address])
    load = sum(loads) / len(loads)
    damping = SIDE_SLIP_RETURN / DT / model.pair_solimp[0, 1]
    model.opt.impratio = resistance / (slip.creep * damping)
    friction = slip.limit / load
    for name in ("left", "right"):
        model.pair(name).friction[:2] = friction, friction if slip.both else FIRM * friction
