"""Hidden effects that act from step to step as forces, torques and friction, on the vehicle that MuJoCo moves.

Each function reads a `Step` and adds to its forces, torques or friction. Effects that are bodies, joints or contacts
are in `mujoco_model`, effects of supply, drive and motor in `electrics`, effects of sensors in `measure`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

Parameters = Mapping[str, float]


class Step:
    """The state at the start of a step and the forces in this step, in the paper's frame. Pairs are [left, right]."""

    __slots__ = (
        "age", "angles", "cosine", "dry", "force", "heading", "load", "mass", "moment", "motor_angles", "motor_speeds",
        "rate", "side", "sine", "speeds", "surge", "sway", "torque", "volts", "x", "y",
    )  # fmt: skip

    age: float  # s since power-on
    x: float  # m
    y: float  # m, to the right
    heading: float  # rad, clockwise
    cosine: float  # cosine of the heading
    sine: float
    surge: float  # m/s
    sway: float  # m/s, to the right
    rate: float  # rad/s, clockwise
    mass: float  # kg, with payload
    speeds: list[float]  # rad/s of the wheels
    angles: list[float]  # rad
    motor_speeds: list[float]  # rad/s of the rotors, at the wheel; equal to `speeds` without backlash
    motor_angles: list[float]  # rad
    volts: list[float]  # V, commands as they arrive at the drive
    torque: list[float]  # N m, torques of the motors
    load: list[float]  # N m, torques on the wheels themselves, behind any backlash
    dry: list[float]  # N m, limits of the wheels' dry friction
    force: float  # N forward, at the middle of the axle
    side: float  # N to the right
    moment: float  # N m clockwise


def _stiction_stribeck(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += p["coulomb"] + p["breakaway"] * math.exp(-((s.speeds[i] / p["stribeck_speed"]) ** 2))


def _rolling_sqrt(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += p["torque"] * math.sqrt(abs(s.speeds[i]))


def _load_friction(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += p["share"] * abs(s.torque[i])


def _viscous_loss(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.load[i] -= p["drag"] * s.speeds[i]


def _direction_asymmetry(s: Step, p: Parameters) -> None:
    """The torque part of the effect; the gain part acts in the drive."""
    for i in (0, 1):
        if s.speeds[i] * p["torque"] > 0:
            s.dry[i] += abs(p["torque"])
        s.load[i] -= 0.5 * p.get("drag", 0.0) * abs(s.speeds[i])


def _constant_offset(s: Step, p: Parameters) -> None:
    difference = p.get("difference", 0.0)
    s.load[0] -= p["torque"] + difference
    s.load[1] -= p["torque"] - difference


def _gravity_load(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.load[i] -= p["torque"] * math.cos(s.angles[i] - p["level"])


def _phases(s: Step, p: Parameters) -> tuple[float, float]:
    shift = 0.5 * p.get("phase_difference", 0.0)
    middle, order = p.get("phase", 0.0), p["order"]
    return math.sin(order * s.angles[0] + middle + shift), math.sin(order * s.angles[1] + middle - shift)


def _cogging(s: Step, p: Parameters) -> None:
    for i, wave in enumerate(_phases(s, p)):
        s.load[i] -= p["torque"] * wave


def _torque_ripple(s: Step, p: Parameters) -> None:
    for i, wave in enumerate(_phases(s, p)):
        s.torque[i] *= 1 + p["amplitude"] * wave


def _quadratic_drag(s: Step, p: Parameters) -> None:
    s.force -= p["drag"] * s.surge * abs(s.surge)


def _surge_drag(s: Step, p: Parameters) -> None:
    s.force -= p["drag"] * s.surge


def _viscous_scrub(s: Step, p: Parameters) -> None:
    s.moment -= p["drag"] * s.rate


def _curve_scrub(s: Step, p: Parameters) -> None:
    s.force -= p["coefficient"] * s.mass * s.surge * abs(s.rate)


def _carpet_nap(s: Step, p: Parameters) -> None:
    """The constant half of the force, along the pile. The other half is dry friction: a ball of `mujoco_model`."""
    s.force += 0.5 * (p["force_x"] * s.cosine + p["force_y"] * s.sine)
    s.side += 0.5 * (p["force_y"] * s.cosine - p["force_x"] * s.sine)


def _odd_periodic_force(s: Step, p: Parameters) -> None:
    s.force += p["force"] * math.sin(2 * math.pi * p["frequency"] * s.age)


def _odd_friction_with_voltage(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += p["slope"] * abs(s.volts[i])


def _odd_drag_patch(s: Step, p: Parameters) -> None:
    if p["from"] <= s.x <= p["to"]:
        s.force -= p["drag"] * s.surge


def _odd_angle_brake(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += 0.5 * p["torque"] * (1 + math.cos(2 * s.angles[i]))


def _odd_cubic_drag(s: Step, p: Parameters) -> None:
    s.force -= p["drag"] * s.surge**3


def _odd_yaw_by_speed(s: Step, p: Parameters) -> None:
    s.moment += p["moment"] * s.surge**2


def _odd_turn_force(s: Step, p: Parameters) -> None:
    s.force += p["share"] * s.mass * s.surge * s.rate


def _odd_load_ramp(s: Step, p: Parameters) -> None:
    for i in (0, 1):
        s.dry[i] += p["rate"] * s.age


def _odd_heading_spring(s: Step, p: Parameters) -> None:
    s.moment -= p["moment"] * math.sin(s.heading)


def _odd_tether(s: Step, p: Parameters) -> None:
    s.force -= p["stiffness"] * (s.x * s.cosine + s.y * s.sine)
    s.side -= p["stiffness"] * (s.y * s.cosine - s.x * s.sine)


EFFECTS: dict[str, Callable[[Step, Parameters], None]] = {
    act.__name__[1:]: act
    for act in (
        _stiction_stribeck, _rolling_sqrt, _direction_asymmetry, _constant_offset, _gravity_load, _cogging,
        _torque_ripple,
        _load_friction, _viscous_loss, _surge_drag, _viscous_scrub, _quadratic_drag, _curve_scrub, _carpet_nap,
        _odd_periodic_force, _odd_friction_with_voltage, _odd_drag_patch, _odd_angle_brake, _odd_cubic_drag,
        _odd_yaw_by_speed, _odd_turn_force, _odd_load_ramp, _odd_heading_spring, _odd_tether,
    )
}  # fmt: skip
