"""The effects that may be hidden in `planar_plant`. Their parameters are those that ``brickpilot effects`` states.

This module has the effects of wheels and body; `planar_electrics` has the effects of supply, drive and motor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from hidden import planar_electrics as electrics
from hidden import planar_laws, sensor_laws
from hidden import planar_oddities as odd
from hidden.planar_plant import LEFT_RIGHT, Plant, in_body
from hidden.recipe import GRAVITY, Floats, Hidden

Parameters = Mapping[str, float]

ELSEWHERE = (
    "imu_lever_arm", "accel_misalignment", "imu_lag", "accel_bias", "gyro_scale", "gyro_asymmetry", "gyro_bias",
    "gyro_drift", "gyro_saturation", "encoder_scale", "speed_lag", "unsigned_sensor", "speed_delay", "gyro_delay",
    "sensor_delay", "odd_gyro_cubic", *sensor_laws.LAWS,
)  # fmt: skip
"""Effects of the sensors: they change the measurements and not the motion, so `install` skips them."""


def install(plant: Plant, hidden: Hidden) -> None:
    """Adds the hidden effects to `plant`, in the order of `EFFECTS`.

    Raises:
        ValueError: this plant does not know an effect.
        KeyError: a parameter is missing; some effects raise it only at the first step.
    """
    for name in hidden:
        if name not in EFFECTS and name not in ELSEWHERE:
            raise ValueError(f"{name}: no such effect")
    for name, put in EFFECTS.items():
        if name in hidden:
            put(plant, hidden[name])


# ---- wheels


def _coulomb_friction(plant: Plant, p: Parameters) -> None:
    plant.against += p["torque"]


def _stiction_stribeck(plant: Plant, p: Parameters) -> None:
    plant.against += p["coulomb"]

    def hook(plant: Plant) -> None:
        plant.bound += p["breakaway"] * np.exp(-((plant.wheel / p["stribeck_speed"]) ** 2))

    plant.bounds.append(hook)


def _rolling_sqrt(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.bound += p["torque"] * np.sqrt(np.abs(plant.wheel))

    plant.bounds.append(hook)


def _load_friction(plant: Plant, p: Parameters) -> None:
    share = p["share"]

    def hook(plant: Plant) -> None:
        plant.bound += share * np.abs(plant.vehicle.torque_constant * plant.flux * plant.current)

    plant.bounds.append(hook)


def _viscous_loss(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.torque -= p["drag"] * plant.wheel

    plant.loads.append(hook)


def _constant_offset(plant: Plant, p: Parameters) -> None:
    torque = p["torque"] + p.get("difference", 0.0) * LEFT_RIGHT

    def hook(plant: Plant) -> None:
        plant.torque -= torque

    plant.loads.append(hook)


def _wheel_radius_mismatch(plant: Plant, p: Parameters) -> None:
    plant.radius = plant.vehicle.wheel_radius * (1 + 0.5 * p["mismatch"] * LEFT_RIGHT)


class _Limit:
    """Computes a tyre's limited force minus the linear creep force, which the plant's matrix already contains.

    The difference is extrapolated to the middle of the step: only then can it cancel nearly all of the linear force.
    """

    def __init__(self, before: Floats) -> None:
        self.before = before

    def __call__(self, linear: Floats, most: float) -> Floats:
        """Returns the difference (n, runs), N. `linear`: (n, runs), linear creep forces; `most`: limit of one force."""
        now = linear * (1 / np.sqrt(1 + (linear / most) ** 2) - 1)
        middle = 1.5 * now - 0.5 * self.before
        self.before[:] = now
        return middle


def _wheel_slip(plant: Plant, p: Parameters) -> None:
    creep = plant.creep["wheel"] = p["creep"]
    limit, track = _Limit(plant.memory(2)), plant.vehicle.half_track

    def hook(plant: Plant) -> None:
        slip = plant.radius * plant.wheel - (plant.surge + track * LEFT_RIGHT * plant.yaw)
        missing = limit(slip / creep, 0.5 * p["friction"] * plant.mass * GRAVITY)
        plant.torque -= plant.radius * missing
        plant.force[0] += missing[0] + missing[1]
        plant.force[2] += track * (missing[0] - missing[1])

    plant.loads.append(hook)


def _side_slip(plant: Plant, p: Parameters) -> None:
    creep = plant.creep["side"] = p["creep"]
    limit = _Limit(plant.memory(1))

    def hook(plant: Plant) -> None:
        plant.force[1] += limit(-plant.sway / creep, p["friction"] * plant.mass * GRAVITY)[0]

    plant.loads.append(hook)


def _tyre_grip(plant: Plant, p: Parameters) -> None:
    """Limits the linear creep force of each tyre, longitudinal and lateral together, to the friction circle."""
    creep = p["creep"]
    plant.creep["wheel"], plant.creep["side"] = creep, 0.5 * creep
    before, track = plant.memory(4), plant.vehicle.half_track

    def hook(plant: Plant) -> None:
        most = 0.5 * p["friction"] * plant.mass * GRAVITY
        along = (plant.radius * plant.wheel - (plant.surge + track * LEFT_RIGHT * plant.yaw)) / creep
        across = np.broadcast_to(-plant.sway / creep, along.shape)
        kept = 1 / np.sqrt(1 + (along**2 + across**2) / most**2)
        now = np.concatenate([along, across]) * (np.concatenate([kept, kept]) - 1)
        missing = 1.5 * now - 0.5 * before
        before[:] = now
        plant.torque -= plant.radius * missing[:2]
        plant.force[0] += missing[0] + missing[1]
        plant.force[1] += missing[2] + missing[3]
        plant.force[2] += track * (missing[0] - missing[1])

    plant.loads.append(hook)


# ---- body


def _carpet_nap(plant: Plant, p: Parameters) -> None:
    half = 0.5 * math.hypot(p["force_x"], p["force_y"])
    pile = plant.slider("point")

    def hook(plant: Plant) -> None:
        lean = in_body(plant, 0.5 * p["force_x"], 0.5 * p["force_y"])
        plant.force[:2] += pile.planar(plant.state[4:6], half) + np.array(lean)

    plant.loads.append(hook)


def _caster_drag(plant: Plant, p: Parameters) -> None:
    force, forward = p["force"], p["forward"]
    ball = plant.slider("point", forward)

    def hook(plant: Plant) -> None:
        drag = ball.planar(np.stack([plant.surge, plant.sway + forward * plant.yaw]), force)
        plant.force[:2] += drag
        plant.force[2] += forward * drag[1]

    plant.loads.append(hook)


def _yaw_scrub(plant: Plant, p: Parameters) -> None:
    moment = p["moment"]
    patch = plant.slider("yaw")

    def hook(plant: Plant) -> None:
        plant.force[2] += patch.force(plant.yaw, moment, moment)

    plant.loads.append(hook)


def _curve_scrub(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[0] -= p["coefficient"] * plant.mass * plant.surge * np.abs(plant.yaw)

    plant.loads.append(hook)


def _quadratic_drag(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        velocity = plant.state[4:6]
        plant.force[:2] -= p["drag"] * velocity * np.abs(velocity)

    plant.loads.append(hook)


def _surge_drag(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[0] -= p["drag"] * plant.surge

    plant.loads.append(hook)


def _viscous_scrub(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[2] -= p["drag"] * plant.yaw

    plant.loads.append(hook)


def _floor_slope(plant: Plant, p: Parameters) -> None:
    plant.downhill = (p["slope_x"], p["slope_y"])

    def hook(plant: Plant) -> None:
        ahead, aside = in_body(plant, p["slope_x"], p["slope_y"])
        weight = plant.mass * GRAVITY
        forward, right = plant.com
        plant.force[0] += weight * ahead
        plant.force[1] += weight * aside
        plant.force[2] += weight * (forward * aside - right * ahead)

    plant.loads.append(hook)


def _com_forward_offset(plant: Plant, p: Parameters) -> None:
    plant.com[0] += p["forward"]


def _com_lateral_offset(plant: Plant, p: Parameters) -> None:
    plant.com[1] += p["right"]


def _payload_mass(plant: Plant, p: Parameters) -> None:
    """Joins vehicle and payload to one body; the parallel-axis theorem gives the inertia about the common centre."""
    mass, place = p["mass"], np.array([p.get("forward", 0.0), p.get("right", 0.0)])
    total = plant.mass + mass
    common = (plant.mass * plant.com + mass * place) / total
    plant.yaw_inertia += plant.mass * np.sum((plant.com - common) ** 2) + mass * np.sum((place - common) ** 2)
    plant.mass, plant.com = total, common


EFFECTS: dict[str, Callable[[Plant, Parameters], None]] = {
    "start_delay": electrics.start_delay,
    "input_delay": electrics.input_delay,
    "battery_discharge": electrics.battery_discharge,
    "battery_fade": electrics.battery_fade,
    "battery_sag": electrics.battery_sag,
    "odd_crosstalk": odd.crosstalk,
    "pwm_quantisation": electrics.pwm_quantisation,
    "actuator_lag": electrics.actuator_lag,
    "slew_limit": electrics.slew_limit,
    "actuator_deadband": electrics.actuator_deadband,
    "voltage_compression": electrics.voltage_compression,
    "motor_asymmetry": electrics.motor_asymmetry,
    "direction_asymmetry": electrics.direction_asymmetry,
    "odd_voltage_gain": odd.voltage_gain,
    "supply_saturation": electrics.supply_saturation,
    "pwm_coast": electrics.pwm_coast,
    "zero_coast": electrics.zero_coast,
    "dead_time": electrics.dead_time,
    "current_limit": electrics.current_limit,
    "torque_constant_asymmetry": electrics.torque_constant_asymmetry,
    "motor_heating": electrics.motor_heating,
    "torque_ripple": electrics.torque_ripple,
    "cogging": electrics.cogging,
    "gear_backlash": electrics.gear_backlash,
    "coupled_inertia": electrics.coupled_inertia,
    "gravity_load": electrics.gravity_load,
    "coulomb_friction": _coulomb_friction,
    "stiction_stribeck": _stiction_stribeck,
    "load_friction": _load_friction,
    "viscous_loss": _viscous_loss,
    "rolling_sqrt": _rolling_sqrt,
    "constant_offset": _constant_offset,
    "carpet_nap": _carpet_nap,
    "caster_drag": _caster_drag,
    "yaw_scrub": _yaw_scrub,
    "viscous_scrub": _viscous_scrub,
    "curve_scrub": _curve_scrub,
    "surge_drag": _surge_drag,
    "quadratic_drag": _quadratic_drag,
    "floor_slope": _floor_slope,
    "com_forward_offset": _com_forward_offset,
    "com_lateral_offset": _com_lateral_offset,
    "payload_mass": _payload_mass,
    "wheel_radius_mismatch": _wheel_radius_mismatch,
    "wheel_slip": _wheel_slip,
    "side_slip": _side_slip,
    "tyre_grip": _tyre_grip,
    "odd_periodic_force": odd.periodic_force,
    "odd_friction_with_voltage": odd.friction_with_voltage,
    "odd_drag_patch": odd.drag_patch,
    "odd_angle_brake": odd.angle_brake,
    "odd_cubic_drag": odd.cubic_drag,
    "odd_yaw_by_speed": odd.yaw_by_speed,
    "odd_turn_force": odd.turn_force,
    "odd_load_ramp": odd.load_ramp,
    "odd_heading_spring": odd.heading_spring,
    "odd_tether": odd.tether,
} | planar_laws.LAWS
"""Name -> function that adds the effect to the plant. The order is that in which the effects change a command. Only the
effects named `odd_...` and those of `planar_laws` are not in the library of Brickpilot."""
