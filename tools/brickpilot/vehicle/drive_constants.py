"""Constants of a vehicle for other programs, computed from simulated drives of a model with its effects.

Feed-forward is in volts: V = kS sgn(v) + kV v + kA a, as WPILib defines it (docs.wpilib.org, "Feedforward control").
Odometry has the constants of diff_drive_controller in ros2_control: an effective radius of each wheel, and the wheel
separation that is effective when the vehicle turns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.005
_LEVELS = (0.3, 0.45, 0.6, 0.75, 0.9)  # shares of the battery's voltage, each held forward and backward
_HELD_S = 2.0
_NOTHING = 1e-6  # share of the battery's voltage: a smaller kS is a rounding error, and becomes 0
_MOVING = 0.1  # share of the top speed: slower samples hold little information, and are left out
_SETTLED = 0.5  # share of a drive's duration, after which the drive counts as steady
_DRIVE_S = 3.0
_LEVEL, _CURVE = 0.6, 0.4  # shares of the battery's voltage: in a straight drive, and at a curve's inner wheel
_TURNS = "as the skid steer turns in a curve, which is as if its track were wider"
_ROUNDS = 3  # rounds in which the radii and the separation are fitted in turn


@dataclass(frozen=True)
class FeedForward:
    """V = ks sgn(v) + kv v + ka dv/dt for each motor, if all motors get the same voltage.

    Attributes:
        ks, kv, ka: in V, V s/unit and V s^2/unit.
        unit: "m" or "rad": v is in m/s or rad/s.
    """

    ks: float
    kv: float
    ka: float
    unit: str


@dataclass(frozen=True)
class Odometry:
    """The constants that turn wheel angles into a track.

    Attributes:
        radius, separation: the stated wheel radius and wheel separation, m.
        left, right: ratio of each wheel's effective radius to the stated radius.
        turning: ratio of the effective separation to the stated separation.
    """

    radius: float
    separation: float
    left: float
    right: float
    turning: float


@dataclass(frozen=True)
class Drives:
    """Results of a simulated straight drive of a vehicle.

    Attributes:
        top_speed: the speed at the battery's full voltage, in m/s, or in rad/s for a bare motor.
        stop: the travel until rest, after the voltage falls from the battery's full voltage to 0, m or rad.
        veer: curvature of the path at equal voltages, rad/m clockwise; None for a motor.
    """

    top_speed: float
    stop: float
    veer: float | None


def feed_forward(model: Model) -> FeedForward:
    """Returns the feed-forward constants of a model, by least squares over steps of voltage in both directions."""
    volts = _battery(model)
    levels = [sign * share for share in _LEVELS for sign in (1.0, -1.0)]
    time = np.arange(0.0, _HELD_S * len(levels), _STEP_S)
    command = volts * np.array(levels)[np.minimum((time / _HELD_S).astype(int), len(levels) - 1)]
    speed = _speed(model, _simulated(model, time, command, command))
    rate = np.gradient(speed, _STEP_S)
    moving = (np.abs(speed) > _MOVING * np.abs(speed).max()) & (np.sign(speed) == np.sign(command))
    columns = np.column_stack([np.sign(speed), speed, rate])[moving]
    ks, kv, ka = np.linalg.lstsq(columns, command[moving], rcond=None)[0]
    ks = 0.0 if abs(ks) < _NOTHING * volts else float(ks)
    return FeedForward(ks, float(kv), float(ka), "rad" if _turns(model) else "m")


def odometry(model: Model, stated: Mapping[str, float]) -> Odometry | None:
    """Returns the effective radii and separation relative to `stated` wheel_radius and half_track; None for a motor.

    The radii come from a straight drive, the separation from a curve. The motors get 60 % of the battery's voltage; the
    inner motor of the curve gets 40 %.
    """
    if model.vehicle == "motor":
        return None
    volts = _battery(model) * _LEVEL
    time = np.arange(0.0, _DRIVE_S, _STEP_S)
    late = time > _SETTLED * _DRIVE_S
    straight = _simulated(model, time, np.full(time.size, volts), np.full(time.size, volts))
    curve = _simulated(model, time, np.full(time.size, volts), np.full(time.size, _CURVE / _LEVEL * volts))
    separation = stated_separation = 2 * stated["half_track"]
    radii = np.full(2, stated["wheel_radius"])
    for _ in range(_ROUNDS):
        ahead, turn, wheels = straight["surge"][late], _turn(straight)[late], _wheels(straight)[late]
        ground = np.column_stack([ahead + turn * separation / 2, ahead - turn * separation / 2])
        radii = ground.mean(axis=0) / wheels.mean(axis=0)
        turn, wheels = _turn(curve)[late], _wheels(curve)[late]
        separation = float(np.mean(wheels @ (radii * [1, -1])) / np.mean(turn))
    left, right = (radii / stated["wheel_radius"]).tolist()
    return Odometry(stated["wheel_radius"], stated_separation, left, right, separation / stated_separation)


def two_wheeled(model: Model) -> Model:
    """Returns a skid_steer as a diff_drive that turns in the same way: with the effective track, without contacts.

    The firmware assumes a diff_drive, because it does not model slip. Any other vehicle is returned unchanged.
    """
    if model.vehicle != "skid_steer":
        return model
    values = {name: model.parameters.get(name, preset) for name, preset in catalogue.presets("diff_drive").items()}
    effective = odometry(model, values)
    assert effective is not None  # only a motor has no odometry
    values["half_track"] *= effective.turning
    basis = {**model.basis, "half_track": _TURNS}
    return dataclasses.replace(model, vehicle="diff_drive", parameters=values, basis=basis)


def drives(model: Model) -> Drives:
    """Returns how a model drives straight at full voltage, and how it stops."""
    time = np.arange(0.0, 2 * _DRIVE_S, _STEP_S)
    command = np.where(time < _DRIVE_S, _battery(model), 0.0)
    outputs = _simulated(model, time, command, command)
    speed, driven = _speed(model, outputs), time < _DRIVE_S
    stop = float(np.sum(np.abs(speed[~driven])) * _STEP_S)
    last = int(np.flatnonzero(driven)[-1])
    if model.vehicle == "motor":
        return Drives(float(speed[last]), stop, None)
    way = float(np.sum(np.abs(speed[driven])) * _STEP_S)
    return Drives(float(speed[last]), stop, float(_heading(outputs)[last]) / way if way > 0 else 0.0)


def _battery(model: Model) -> float:
    return model.parameters.get("battery_voltage") or rcx().parameters["battery_voltage"]


def _turns(model: Model) -> bool:
    """Returns whether the model's speed is an angular speed: that of a bare motor without a wheel."""
    return model.vehicle == "motor" and not model.parameters.get("wheel_radius")


def _simulated(model: Model, time: Array, left: Array, right: Array) -> Mapping[str, Array]:
    inputs = left[:, np.newaxis] if model.vehicle == "motor" else np.column_stack([left, right])
    return plant.simulate([(model, OpenLoopRun(time=time, inputs=inputs))])[0].outputs


def _speed(model: Model, outputs: Mapping[str, Array]) -> Array:
    return outputs["surge" if model.vehicle != "motor" else "speed" if _turns(model) else "velocity"]


def _wheels(outputs: Mapping[str, Array]) -> Array:
    return np.column_stack([outputs["wheel_speed_left"], outputs["wheel_speed_right"]])


def _heading(outputs: Mapping[str, Array]) -> Array:
    """Returns (n,): the heading of a forward drive, rad clockwise, from x and y, which have no sensor errors."""
    ahead, aside = np.gradient(outputs["x"]), np.gradient(outputs["y"])
    moving = np.hypot(ahead, aside) > 1e-6
    heading = np.unwrap(np.where(moving, np.arctan2(aside, ahead), 0.0))
    return np.asarray(heading - heading[0])


def _turn(outputs: Mapping[str, Array]) -> Array:
    return np.gradient(_heading(outputs), _STEP_S)
