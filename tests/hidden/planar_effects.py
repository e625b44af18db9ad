"""The effects that may be hidden in `planar_plant`, each with the parameters that ``brickpilot effects`` states."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from hidden import planar_laws, sensor_laws
from hidden import planar_oddities as odd
from hidden.planar_plant import LEFT_RIGHT, PLAY, Plant, in_body
from hidden.recipe import GRAVITY, Floats, Hidden

Parameters = Mapping[str, float]

ELSEWHERE = (
    "imu_lever_arm", "accel_misalignment", "imu_lag", "accel_bias", "gyro_scale", "gyro_bias", "gyro_drift",
    "gyro_saturation", "encoder_scale", "speed_lag", "speed_delay", "gyro_delay",
    "sensor_delay", "odd_gyro_cubic", *sensor_laws.LAWS,
)  # fmt: skip
"""Sensor effects: they change what is measured, not what happens."""


def install(plant: Plant, hidden: Hidden) -> None:
    """Puts the hidden effects into `plant`, in the order in which a command passes them.

    Raises:
        ValueError: an effect that this plant does not know.
        KeyError: a parameter is missing; of some, at the first step.
    """
    for name in hidden:
        if name not in EFFECTS and name not in ELSEWHERE:
            raise ValueError(f"{name}: no such effect")
    for name, put in EFFECTS.items():
        if name in hidden:
            put(plant, hidden[name])


# ---- timing and supply


def _start_delay(plant: Plant, p: Parameters) -> None:
    plant.late_start = p["delay"]


def _input_delay(plant: Plant, p: Parameters) -> None:
    plant.command_delay = p["delay"]


def _battery_discharge(plant: Plant, p: Parameters) -> None:
    plant.supply_slope = p["slope"]


def _battery_fade(plant: Plant, p: Parameters) -> None:
    plant.supply_fade = p["rate"]


def _battery_sag(plant: Plant, p: Parameters) -> None:
    plant.supply_resistance = p["resistance"]


# ---- drive


def _pwm_quantisation(plant: Plant, p: Parameters) -> None:
    step = p["step"]
    if step <= 0:
        return

    def hook(plant: Plant) -> None:
        unit = step * plant.supply
        level = np.copysign(np.floor(np.abs(plant.voltage) / unit + 0.5) * unit, plant.voltage)
        np.clip(level, -plant.supply, plant.supply, out=plant.voltage)

    plant.drive.append(hook)


def _actuator_lag(plant: Plant, p: Parameters) -> None:
    if p["time_constant"] <= 0:
        return
    closed = -math.expm1(-plant.step / p["time_constant"])  # share of the difference that one step closes
    midway = 1 - closed * p["time_constant"] / plant.step  # and on average over it
    lagged = plant.memory(2)

    def hook(plant: Plant) -> None:
        gap = plant.voltage - lagged
        plant.voltage[:] = lagged + midway * gap
        lagged[:] += closed * gap

    plant.drive.append(hook)


def _actuator_deadband(plant: Plant, p: Parameters) -> None:
    half = p["voltage"]

    def hook(plant: Plant) -> None:
        plant.voltage -= np.clip(plant.voltage, -half, half)

    plant.drive.append(hook)


def _voltage_compression(plant: Plant, p: Parameters) -> None:
    per_volt = p["compression"] / plant.vehicle.battery_voltage

    def hook(plant: Plant) -> None:
        plant.voltage /= 1 + per_volt * np.abs(plant.voltage)

    plant.drive.append(hook)


def _motor_asymmetry(plant: Plant, p: Parameters) -> None:
    gain = 1 + 0.5 * p["difference"] * LEFT_RIGHT

    def hook(plant: Plant) -> None:
        plant.voltage *= gain

    plant.drive.append(hook)


def _direction_asymmetry(plant: Plant, p: Parameters) -> None:
    torque, drag, gain = p["torque"], 0.5 * p.get("drag", 0.0), 0.5 * p.get("gain", 0.0)
    plant.against[0 if torque > 0 else 1] += abs(torque)
    if gain:

        def favour(plant: Plant) -> None:
            plant.voltage += gain * np.abs(plant.voltage)

        plant.drive.append(favour)
    if drag:

        def brake(plant: Plant) -> None:
            change = np.where(plant.wheel > 0, drag, -drag)
            plant.torque -= np.maximum(change, -plant.losses()) * plant.wheel

        plant.loads.append(brake)


def _supply_saturation(plant: Plant, p: Parameters) -> None:
    limit = p["voltage"]

    def hook(plant: Plant) -> None:
        np.clip(plant.voltage, -limit, limit, out=plant.voltage)

    plant.drive.append(hook)


def _pwm_coast(plant: Plant, p: Parameters) -> None:
    """Each tick is a pulse or a pause: first-order density."""
    period, brakes = p.get("period", 0.001), p.get("brakes", 0.0) >= 0.5
    due, on, tick = plant.memory(2), plant.memory(2), plant.memory(1)
    tick -= 1
    emf_constant = plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        volts = plant.voltage
        now = math.floor((plant.time + 0.5 * plant.step) / period)
        if now != tick[0, 0]:
            tick[:] = now
            due[:] += np.minimum(np.abs(volts) / plant.supply, 1.0)
            on[:] = due >= 1 - 1e-9
            due[:] -= on
        pulse = np.where(on > 0, np.copysign(plant.supply, volts), 0.0)
        pulse[volts == 0] = 0.0
        if not brakes:
            floats = (on == 0) & (volts != 0)
            plant.current[floats] = 0.0
            pulse = np.where(floats, emf_constant * plant.flux * plant.rotor, pulse)
        volts[:] = pulse

    plant.drive.append(hook)


def _zero_coast(plant: Plant, p: Parameters) -> None:
    share, zero, emf_constant = p["share"], 0.01 * plant.vehicle.battery_voltage, plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        emf = emf_constant * plant.flux * plant.rotor
        plant.voltage[:] = np.where(
            np.abs(plant.voltage) <= zero, (1 - share) * plant.voltage + share * emf, plant.voltage
        )

    plant.drive.append(hook)


def _dead_time(plant: Plant, p: Parameters) -> None:
    lost, emf_constant = p["voltage"], plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        plant.voltage -= np.clip(plant.voltage - emf_constant * plant.flux * plant.rotor, -lost, lost)

    plant.drive.append(hook)


# ---- motor and gear


def _torque_constant_asymmetry(plant: Plant, p: Parameters) -> None:
    plant.flux = 1 + 0.5 * p["difference"] * LEFT_RIGHT


def _motor_heating(plant: Plant, p: Parameters) -> None:
    plant.heating = (p["thermal_resistance"], p["time_constant"])


def _phases(p: Parameters) -> Floats:
    return p.get("phase", 0.0) + 0.5 * p.get("phase_difference", 0.0) * LEFT_RIGHT


def _torque_ripple(plant: Plant, p: Parameters) -> None:
    amplitude, order, phase = p["amplitude"], p["order"], _phases(p)

    def hook(plant: Plant) -> None:
        wave = amplitude * np.sin(order * plant.angle + phase)
        plant.gear += plant.vehicle.torque_constant * plant.flux * plant.current * wave

    plant.loads.append(hook)


def _cogging(plant: Plant, p: Parameters) -> None:
    torque, order, phase = p["torque"], p["order"], _phases(p)

    def hook(plant: Plant) -> None:
        plant.gear -= torque * np.sin(order * plant.angle + phase)

    plant.loads.append(hook)


def _gear_backlash(plant: Plant, p: Parameters) -> None:
    """Teeth meet softly enough for the step, are damped so that they do not bounce, and never pull."""
    half = 0.5 * p["gap"]
    plant.rotor_share = p["rotor_share"]

    def hook(plant: Plant) -> None:
        spring, damper = plant.teeth
        beyond = plant.state[PLAY] - np.clip(plant.state[PLAY], -half, half)
        push = spring * beyond + damper * (plant.rotor - plant.wheel)
        push = np.where(beyond > 0, np.maximum(push, 0.0), np.where(beyond < 0, np.minimum(push, 0.0), 0.0))
        plant.torque += push
        plant.gear -= push

    plant.loads.append(hook)


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
    """What the limit of a tyre takes away from the linear creep in the plant's matrix.

    Extrapolated to the middle of the step: where nearly all is taken away, the two must cancel.
    """

    def __init__(self, before: Floats) -> None:
        self.before = before

    def __call__(self, linear: Floats, most: float) -> Floats:
        """Returns (n, runs) N from the forces of a linear law and the largest force that the tyre bears."""
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
    """What the circle takes away from the linear creep along and across, each wheel by its own slip."""
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
    """Makes one body of two: parallel axes about the common centre."""
    mass, place = p["mass"], np.array([p.get("forward", 0.0), p.get("right", 0.0)])
    total = plant.mass + mass
    common = (plant.mass * plant.com + mass * place) / total
    plant.yaw_inertia += plant.mass * np.sum((plant.com - common) ** 2) + mass * np.sum((place - common) ** 2)
    plant.mass, plant.com = total, common


EFFECTS: dict[str, Callable[[Plant, Parameters], None]] = {
    "start_delay": _start_delay,
    "input_delay": _input_delay,
    "battery_discharge": _battery_discharge,
    "battery_fade": _battery_fade,
    "battery_sag": _battery_sag,
    "odd_crosstalk": odd.crosstalk,
    "pwm_quantisation": _pwm_quantisation,
    "actuator_lag": _actuator_lag,
    "actuator_deadband": _actuator_deadband,
    "voltage_compression": _voltage_compression,
    "motor_asymmetry": _motor_asymmetry,
    "direction_asymmetry": _direction_asymmetry,
    "odd_voltage_gain": odd.voltage_gain,
    "supply_saturation": _supply_saturation,
    "pwm_coast": _pwm_coast,
    "zero_coast": _zero_coast,
    "dead_time": _dead_time,
    "torque_constant_asymmetry": _torque_constant_asymmetry,
    "motor_heating": _motor_heating,
    "torque_ripple": _torque_ripple,
    "cogging": _cogging,
    "gear_backlash": _gear_backlash,
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
"""In the order in which a command passes them; `odd_...` and those of `planar_laws` are in no library."""
