"""Laws of `other_laws` in `planar_plant`. Each law acts at the same place as an effect of the library."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from hidden.by_run import place
from hidden.planar_electrics import coupled_inertia
from hidden.planar_plant import LEFT_RIGHT, PLAY, Plant, in_body
from hidden.recipe import GRAVITY, Floats

Parameters = Mapping[str, float]

FIRM_CREEP = 0.0024  # creep of a firm tyre times the vehicle's mass, m kg/(N s)
LUGRE_DAMPING = 0.3  # damping ratio of a wheel on its bristles


def _places(plant: Plant) -> Floats:
    return np.array([place(k) for k in range(plant.runs)])


# ---- timing and supply


def _start_delay_by_run(plant: Plant, p: Parameters) -> None:
    plant.late_start = p["delay"] * (1 + p["spread"] * _places(plant))


def _command_jitter(plant: Plant, p: Parameters) -> None:
    plant.frames = (p["delay"], p["jitter"])


def _discharge_settling(plant: Plant, p: Parameters) -> None:
    plant.falls.append(lambda plant: -p["drop"] * np.expm1(-(plant.age + plant.time) / p["time_constant"]))


def _sag_with_memory(plant: Plant, p: Parameters) -> None:
    """Thevenin's battery: a resistance in series with a parallel resistance and capacitor."""
    slow = plant.memory(1)[0]

    def fall(plant: Plant) -> Floats:
        slow[:] += plant.step / p["time_constant"] * (p["slow"] * plant.supply_current - slow)
        return np.asarray(p["resistance"] * plant.supply_current + slow)

    plant.falls.append(fall)


# ---- drive


def _slew_when_driving(plant: Plant, p: Parameters) -> None:
    """The magnitude of the voltage rises at a limited rate and falls at once."""
    most = plant.vehicle.battery_voltage / p["time"] * plant.step
    held = plant.memory(2)

    def hook(plant: Plant) -> None:
        same = plant.voltage * held > 0
        size = np.minimum(np.abs(plant.voltage), np.where(same, np.abs(held), 0.0) + most)
        held[:] = np.copysign(size, plant.voltage)
        plant.voltage[:] = held

    plant.drive.append(hook)


def _current_cut_softly(plant: Plant, p: Parameters) -> None:
    """Removes a share of that part of the winding's voltage which exceeds the limit."""

    def hook(plant: Plant) -> None:
        across = plant.voltage - plant.vehicle.emf_constant * plant.flux * plant.rotor
        plant.voltage -= p["share"] * (across - np.clip(across, -p["voltage"], p["voltage"]))

    plant.drive.append(hook)


def _deadband_sloped(plant: Plant, p: Parameters) -> None:
    half = p["voltage"]

    def hook(plant: Plant) -> None:
        size = np.abs(plant.voltage)
        plant.voltage[:] = np.copysign(np.minimum(np.maximum(2 * (size - half), 0.0), size), plant.voltage)

    plant.drive.append(hook)


def _soft_saturation(plant: Plant, p: Parameters) -> None:
    limit = plant.vehicle.battery_voltage / p["compression"]

    def hook(plant: Plant) -> None:
        plant.voltage[:] = limit * np.tanh(plant.voltage / limit)

    plant.drive.append(hook)


def _switching_loss(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        lost = p["voltage"] * np.clip(plant.current / p["current"], -1.0, 1.0)
        plant.voltage -= lost * (plant.voltage != 0)

    plant.drive.append(hook)


def _brake_late(plant: Plant, p: Parameters) -> None:
    """At a command of zero the motor first floats; after the time `after` the drive short-circuits the motor."""
    at_zero = plant.memory(2)

    def hook(plant: Plant) -> None:
        at_zero[:] = np.where(plant.command == 0, at_zero + plant.step, 0.0)
        floats = (at_zero > 0) & (at_zero <= p["after"])
        plant.current[floats] = 0.0
        emf = plant.vehicle.emf_constant * plant.flux * plant.rotor
        plant.voltage[:] = np.where(floats, emf, plant.voltage)

    plant.drive.append(hook)


def _levels_cut_off(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        unit = p["step"] * plant.supply
        plant.voltage[:] = np.trunc(plant.voltage / unit + 1e-9 * np.sign(plant.voltage)) * unit

    plant.drive.append(hook)


def _one_side_drop(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.voltage[1] -= np.clip(plant.voltage[1], -p["drop"], p["drop"])

    plant.drive.append(hook)


# ---- motor and gear


def _one_motor_saturates(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        current = plant.current[0]
        kept = 1 / (1 + p["loss"] * np.abs(current))
        plant.gear[0] -= plant.vehicle.torque_constant * current * (1 - kept)

    plant.loads.append(hook)


def _ripple_rectified(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        wave = 0.5 * math.pi * np.abs(np.sin(0.5 * p["order"] * plant.angle)) - 1
        plant.gear += plant.vehicle.torque_constant * plant.current * p["amplitude"] * wave

    plant.loads.append(hook)


def _cogging_sharp(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        angle = p["order"] * plant.angle
        plant.gear -= p["torque"] * (np.sin(angle) + 0.5 * np.sin(2 * angle))

    plant.loads.append(hook)


def _backlash_soft(plant: Plant, p: Parameters) -> None:
    half = 0.5 * p["gap"]
    plant.rotor_share = p["rotor_share"]

    def hook(plant: Plant) -> None:
        beyond = plant.state[PLAY] - np.clip(plant.state[PLAY], -half, half)
        push = p["stiffness"] * beyond + p["damping"] * (plant.rotor - plant.wheel) * (beyond != 0)
        plant.torque += push
        plant.gear -= push

    plant.loads.append(hook)


def _inertia_on_rubber(plant: Plant, p: Parameters) -> None:
    """Couples a second inertia to each wheel by rubber, which stiffens as it is twisted."""
    coupled_inertia(plant, p)


def _ballast_on_spring(plant: Plant, p: Parameters) -> None:
    """An elastically mounted weight on each wheel: gravity changes its angle on the wheel."""

    def hook(plant: Plant) -> None:
        plant.torque -= p["torque"] * np.cos(plant.angle - p["give"] * np.cos(plant.angle))

    plant.loads.append(hook)


# ---- bearing


def _coulomb_tanh(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.torque -= p["torque"] * np.tanh(plant.wheel / p["speed"])

    plant.loads.append(hook)


def _bristles(plant: Plant, stiffness: float, damping: float, bound: Callable[[Floats], Floats | float]) -> None:
    """Adds bristle friction: z' = w - stiffness |w| z / bound(w), torque = stiffness z + damping z'.

    LuGre: Canudas de Wit et al. 1995, IEEE TAC 40(3). Without damping and with a constant bound: Dahl 1968.
    """
    bent = plant.memory(2)

    def hook(plant: Plant) -> None:
        wheel = plant.wheel
        yields = stiffness * np.abs(wheel) / bound(wheel)
        kept = np.exp(-yields * plant.step)
        end = np.divide(wheel, yields, out=np.zeros_like(wheel), where=yields > 0)
        plant.torque -= stiffness * bent + damping * (wheel - yields * bent)
        bent[:] = np.where(yields > 0, end + (bent - end) * kept, bent)

    plant.loads.append(hook)


def _friction_dahl(plant: Plant, p: Parameters) -> None:
    _bristles(plant, p["torque"] / p["stretch"], 0.0, lambda _: p["torque"])


def _friction_lugre(plant: Plant, p: Parameters) -> None:
    stiffness = (p["coulomb"] + p["breakaway"]) / p["stretch"]
    damping = LUGRE_DAMPING * 2 * math.sqrt(stiffness * plant.vehicle.wheel_inertia)
    _bristles(
        plant, stiffness, damping,
        lambda w: p["coulomb"] + p["breakaway"] * np.exp(-((w / p["stribeck_speed"]) ** 2)),
    )  # fmt: skip


def _friction_by_load(plant: Plant, p: Parameters) -> None:
    """Dry friction that grows with the transmitted torque, mostly near rest: similar to model M4 of Duclusaud et al.
    2025, Extended friction models for the physics simulation of servo actuators."""

    def hook(plant: Plant) -> None:
        rest = 0.3 + 0.7 * np.exp(-((plant.wheel / p["speed"]) ** 2))
        plant.bound += p["share"] * plant.vehicle.torque_constant * np.abs(plant.current) * rest

    plant.bounds.append(hook)


def _loss_that_levels_off(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.torque += p["torque"] * np.sign(plant.wheel) * np.expm1(-np.abs(plant.wheel) / p["speed"])

    plant.loads.append(hook)


def _loss_one_way(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.torque -= p["torque"] * (np.maximum(plant.wheel, 0.0) / p["speed"]) ** 2

    plant.loads.append(hook)


def _offset_by_run(plant: Plant, p: Parameters) -> None:
    torque = p["torque"] * (1 + p["spread"] * _places(plant))

    def hook(plant: Plant) -> None:
        plant.torque -= torque

    plant.loads.append(hook)


# ---- tyre


class _Midway:
    """Extrapolates a force to the middle of the step, so that the force can cancel nearly all of a linear force."""

    def __init__(self, before: Floats) -> None:
        self.before = before

    def __call__(self, now: Floats) -> Floats:
        middle = 1.5 * now - 0.5 * self.before
        self.before[:] = now
        return middle


def _slip(plant: Plant) -> Floats:
    return np.asarray(plant.radius * plant.wheel - (plant.surge + plant.vehicle.half_track * LEFT_RIGHT * plant.yaw))


def _take_away(plant: Plant, missing: Floats) -> None:
    """Adds `missing` (2, runs), N, to the forces of the tyres along the vehicle."""
    plant.torque -= plant.radius * missing
    plant.force[0] += missing[0] + missing[1]
    plant.force[2] += plant.vehicle.half_track * (missing[0] - missing[1])


def _grip_circle(plant: Plant, p: Parameters) -> None:
    """Each tyre is firm until its resultant force, along and across, reaches friction times load."""
    plant.creep["wheel"] = plant.creep["side"] = creep = FIRM_CREEP / plant.mass
    along, aside = _Midway(plant.memory(2)), _Midway(plant.memory(2))

    def hook(plant: Plant) -> None:
        most = 0.5 * p["friction"] * plant.mass * GRAVITY
        ahead, across = _slip(plant) / creep, -0.5 * plant.sway / creep * np.ones((2, 1))
        lost = np.maximum(1 - most / np.maximum(np.hypot(ahead, across), 1e-30), 0.0)
        _take_away(plant, along(-lost * ahead))
        plant.force[1] += aside(-lost * across).sum(axis=0)

    plant.loads.append(hook)


def _grip_that_fades(plant: Plant, p: Parameters) -> None:
    """A creeping tyre whose friction falls with its slip speed."""
    creep = plant.creep["wheel"] = p["creep"]
    midway = _Midway(plant.memory(2))

    def hook(plant: Plant) -> None:
        slip = _slip(plant)
        friction = p["friction"] * (1 + p["fade"] * np.expm1(-np.abs(slip) / p["speed"]))
        most = 0.5 * friction * plant.mass * GRAVITY
        linear = slip / creep
        _take_away(plant, midway(linear * (1 / np.sqrt(1 + (linear / most) ** 2) - 1)))

    plant.loads.append(hook)


def _side_skid(plant: Plant, p: Parameters) -> None:
    """Tyres are firm across until they skid; then their side force is constant."""
    creep = plant.creep["side"] = FIRM_CREEP / plant.mass
    midway = _Midway(plant.memory(1))

    def hook(plant: Plant) -> None:
        across = -plant.sway / creep
        lost = np.maximum(1 - p["friction"] * plant.mass * GRAVITY / np.maximum(np.abs(across), 1e-30), 0.0)
        plant.force[1] += midway(-lost * across)[0]

    plant.loads.append(hook)


def _caster_viscous(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        aside = p["drag"] * (plant.sway + p["forward"] * plant.yaw)
        plant.force[0] -= p["drag"] * plant.surge
        plant.force[1] -= aside
        plant.force[2] -= p["forward"] * aside

    plant.loads.append(hook)


def _scrub_smooth(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        plant.force[2] -= p["moment"] * np.tanh(plant.yaw / p["rate"])

    plant.loads.append(hook)


def _curve_drag(plant: Plant, p: Parameters) -> None:
    """Induced drag: grows with the square of the tyres' side force."""

    def hook(plant: Plant) -> None:
        side = plant.surge * plant.yaw
        plant.force[0] -= p["share"] * plant.mass * side**2 / GRAVITY * np.sign(plant.surge)

    plant.loads.append(hook)


# ---- body and floor


def _drag_power(plant: Plant, p: Parameters) -> None:
    """Drag with exponent 1.5 in speed, between linear and quadratic drag."""

    def hook(plant: Plant) -> None:
        plant.force[0] -= p["drag"] * plant.surge * np.sqrt(np.abs(plant.surge))

    plant.loads.append(hook)


def _nap_viscous(plant: Plant, p: Parameters) -> None:
    def hook(plant: Plant) -> None:
        lean = in_body(plant, p["force_x"], p["force_y"])
        plant.force[:2] += np.array(lean) - p["drag"] * plant.state[4:6]

    plant.loads.append(hook)


def _floor_wavy(plant: Plant, p: Parameters) -> None:
    """The floor rises and falls along x. Accelerometers also measure its slope."""
    plant.needs_position = True
    plant.waves = (p["slope"], p["wave"])

    def hook(plant: Plant) -> None:
        fall = p["slope"] * np.sin(2 * math.pi * plant.position[0] / p["wave"])
        plant.force[:2] += plant.mass * GRAVITY * np.array(in_body(plant, fall, 0.0))

    plant.loads.append(hook)


LAWS: dict[str, Callable[[Plant, Parameters], None]] = {
    act.__name__[1:]: act
    for act in (
        _start_delay_by_run, _command_jitter, _discharge_settling, _sag_with_memory, _slew_when_driving,
        _current_cut_softly, _deadband_sloped,
        _soft_saturation, _switching_loss, _brake_late, _levels_cut_off, _one_side_drop, _one_motor_saturates,
        _ripple_rectified, _cogging_sharp, _backlash_soft, _inertia_on_rubber, _ballast_on_spring, _coulomb_tanh,
        _friction_dahl,
        _friction_lugre, _friction_by_load, _loss_that_levels_off, _loss_one_way, _offset_by_run, _grip_circle,
        _grip_that_fades, _side_skid, _caster_viscous, _scrub_smooth, _curve_drag, _drag_power, _nap_viscous,
        _floor_wavy,
    )
}  # fmt: skip
"""The laws in the order in which they change a command."""
