"""Effects of timing, supply, drive, motor and gear on `planar_plant`; `planar_effects` has the table."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hidden.planar_plant import LEFT_RIGHT, PLAY, Plant
from hidden.recipe import Floats, second_inertia

Parameters = Mapping[str, float]


# ---- timing and supply


def start_delay(plant: Plant, p: Parameters) -> None:
    plant.late_start = p["delay"]


def input_delay(plant: Plant, p: Parameters) -> None:
    plant.command_delay = p["delay"]


def battery_discharge(plant: Plant, p: Parameters) -> None:
    plant.supply_slope = p["slope"]


def battery_fade(plant: Plant, p: Parameters) -> None:
    plant.supply_fade = p["rate"]


def battery_sag(plant: Plant, p: Parameters) -> None:
    plant.supply_resistance = p["resistance"]


# ---- drive


def pwm_quantisation(plant: Plant, p: Parameters) -> None:
    step = p["step"]
    if step <= 0:
        return

    def hook(plant: Plant) -> None:
        unit = step * plant.supply
        level = np.copysign(np.floor(np.abs(plant.voltage) / unit + 0.5) * unit, plant.voltage)
        np.clip(level, -plant.supply, plant.supply, out=plant.voltage)

    plant.drive.append(hook)


def actuator_lag(plant: Plant, p: Parameters) -> None:
    if p["time_constant"] <= 0:
        return
    closed = -math.expm1(-plant.step / p["time_constant"])  # share of a difference that one step closes
    midway = 1 - closed * p["time_constant"] / plant.step  # mean of this share over the step
    lagged = plant.memory(2)

    def hook(plant: Plant) -> None:
        gap = plant.voltage - lagged
        plant.voltage[:] = lagged + midway * gap
        lagged[:] += closed * gap

    plant.drive.append(hook)


def slew_limit(plant: Plant, p: Parameters) -> None:
    if p["time_per_volt"] <= 0:
        return
    most = plant.step / p["time_per_volt"]
    held = plant.memory(2)

    def hook(plant: Plant) -> None:
        change = np.clip(plant.voltage - held, -most, most)
        plant.voltage[:] = held + 0.5 * change
        held[:] += change

    plant.drive.append(hook)


def actuator_deadband(plant: Plant, p: Parameters) -> None:
    half = p["voltage"]

    def hook(plant: Plant) -> None:
        plant.voltage -= np.clip(plant.voltage, -half, half)

    plant.drive.append(hook)


def voltage_compression(plant: Plant, p: Parameters) -> None:
    per_volt = p["compression"] / plant.vehicle.battery_voltage

    def hook(plant: Plant) -> None:
        plant.voltage /= 1 + per_volt * np.abs(plant.voltage)

    plant.drive.append(hook)


def motor_asymmetry(plant: Plant, p: Parameters) -> None:
    gain = 1 + 0.5 * p["difference"] * LEFT_RIGHT

    def hook(plant: Plant) -> None:
        plant.voltage *= gain

    plant.drive.append(hook)


def direction_asymmetry(plant: Plant, p: Parameters) -> None:
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


def supply_saturation(plant: Plant, p: Parameters) -> None:
    limit = p["voltage"]

    def hook(plant: Plant) -> None:
        np.clip(plant.voltage, -limit, limit, out=plant.voltage)

    plant.drive.append(hook)


def pwm_coast(plant: Plant, p: Parameters) -> None:
    """Each tick is a pulse or a pause, which first-order pulse-density modulation chooses."""
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


def zero_coast(plant: Plant, p: Parameters) -> None:
    share, zero, emf_constant = p["share"], 0.01 * plant.vehicle.battery_voltage, plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        emf = emf_constant * plant.flux * plant.rotor
        plant.voltage[:] = np.where(
            np.abs(plant.voltage) <= zero, (1 - share) * plant.voltage + share * emf, plant.voltage
        )

    plant.drive.append(hook)


def dead_time(plant: Plant, p: Parameters) -> None:
    lost, emf_constant = p["voltage"], plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        plant.voltage -= np.clip(plant.voltage - emf_constant * plant.flux * plant.rotor, -lost, lost)

    plant.drive.append(hook)


def current_limit(plant: Plant, p: Parameters) -> None:
    limit, emf_constant = p["voltage"], plant.vehicle.emf_constant

    def hook(plant: Plant) -> None:
        emf = emf_constant * plant.flux * plant.rotor
        plant.voltage[:] = emf + np.clip(plant.voltage - emf, -limit, limit)

    plant.drive.append(hook)


# ---- motor and gear


def torque_constant_asymmetry(plant: Plant, p: Parameters) -> None:
    plant.flux = 1 + 0.5 * p["difference"] * LEFT_RIGHT


def motor_heating(plant: Plant, p: Parameters) -> None:
    plant.heating = (p["thermal_resistance"], p["time_constant"])


def _phases(p: Parameters) -> Floats:
    return p.get("phase", 0.0) + 0.5 * p.get("phase_difference", 0.0) * LEFT_RIGHT


def torque_ripple(plant: Plant, p: Parameters) -> None:
    amplitude, order, phase = p["amplitude"], p["order"], _phases(p)

    def hook(plant: Plant) -> None:
        wave = amplitude * np.sin(order * plant.angle + phase)
        plant.gear += plant.vehicle.torque_constant * plant.flux * plant.current * wave

    plant.loads.append(hook)


def cogging(plant: Plant, p: Parameters) -> None:
    torque, order, phase = p["torque"], p["order"], _phases(p)

    def hook(plant: Plant) -> None:
        plant.gear -= torque * np.sin(order * plant.angle + phase)

    plant.loads.append(hook)


def gear_backlash(plant: Plant, p: Parameters) -> None:
    """The contact of the teeth is soft enough for the step size, damped so that no tooth bounces, and never pulls."""
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


def coupled_inertia(plant: Plant, p: Parameters) -> None:
    """Couples a second inertia to each wheel, by a spring and a damper."""
    second = second_inertia(plant.vehicle, p["share"], p["period"], p["damping"])
    twist, speed = plant.memory(2), plant.memory(2)

    def hook(plant: Plant) -> None:
        torque = second.stiffness * _hardened(twist, p) + second.damping * (plant.wheel - speed)
        plant.torque -= torque
        speed[:] += plant.step * torque / second.inertia
        twist[:] += plant.step * (plant.wheel - speed)

    plant.loads.append(hook)


def gravity_load(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.torque -= p["torque"] * np.cos(plant.angle - p["level"])

    plant.loads.append(hook)


def _hardened(twist: Floats, p: Parameters) -> Floats:
    """Returns the twist at which a linear spring has this torque. With `stretch` the spring stiffens like rubber."""
    return np.asarray(twist * (1 + (twist / p["stretch"]) ** 2)) if "stretch" in p else twist
