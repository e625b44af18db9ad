"""The library that the peer of the blind test regresses on: what each effect adds, as text books write it.

Differential drives alone. A vehicle with wheels that roll moves in two modes, the mean and half the difference of its
wheel speeds; each is of first order: inertia w' = K_t / R (V - K_e w) - b w + torque. An effect is a torque at each
wheel, a force and a moment, a voltage, or an error of what a sensor says; each column is that for a size of 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brickpilot import catalogue
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_GRAVITY = catalogue.parameter("gravity").preset
_SMOOTH_SPEED, _SMOOTH_VOLTS, _SMOOTH_RATE = 0.5, 0.1, 0.1  # rad/s, V, rad/s: width of a smooth sign
_STRIBECK_SPEED = 1.0  # rad/s
_CASTER = 0.08  # m, from axle to caster
_LAG = 0.02  # s: size of a delay or lag at which its column is taken
_START = 0.1  # s
_HEATING_S = 25.0  # time constant of a winding
_COPPER = 0.00393  # 1/K
_KNOTS = (0.5, 0.6, 0.7, 0.8, 0.9)  # of the largest: where a saturation may begin

NOT_IN_LIBRARY = frozenset(
    {
        "direction_asymmetry", "encoder_scale", "sensor_delay", "torque_ripple", "cogging", "gear_backlash",
        "pwm_quantisation", "pwm_coast", "payload_mass",
    }
)  # fmt: skip
"""Effects that no column stands for: those with a free frequency, step or state, those that are others' columns (a
delay of all sensors is one of the input, friction of one direction is dry friction and an offset), and what a nominal
value all but stands for (a load for mass and its place, the encoders' scale for radius, drive and EMF)."""


@dataclass(frozen=True)
class Modes:
    """The nominal model as two modes. Inertias: kg m^2 at one wheel; `losses`: N m s/rad; `drive`: K_t / R, N m/V."""

    mass: float
    radius: float
    half_track: float
    yaw_inertia: float
    mean_inertia: float
    difference_inertia: float
    losses: float
    drive: float
    emf: float
    torque_constant: float
    resistance: float
    battery: float

    @property
    def decay(self) -> tuple[float, float]:
        """1/s, of mean and of difference."""
        stiffness = self.drive * self.emf + self.losses
        return stiffness / self.mean_inertia, stiffness / self.difference_inertia


def modes(model: Model) -> Modes:
    """Of the fitted nominal model; the rolling friction as eq. 14 uses it."""
    p = model.parameters
    square = p["wheel_radius"] ** 2
    return Modes(
        mass=p["mass"],
        radius=p["wheel_radius"],
        half_track=p["half_track"],
        yaw_inertia=p["yaw_inertia"],
        mean_inertia=p["wheel_inertia"] + 0.5 * p["mass"] * square,
        difference_inertia=p["wheel_inertia"] + 0.5 * p["yaw_inertia"] * square / p["half_track"] ** 2,
        losses=p["viscous_friction"] + p["mass"] * _GRAVITY * p["rolling_friction"] * square,
        drive=p["torque_constant"] / p["resistance"],
        emf=p["emf_constant"],
        torque_constant=p["torque_constant"],
        resistance=p["resistance"],
        battery=p["battery_voltage"],
    )


@dataclass(frozen=True)
class Motion:
    """One run as the library sees it: arrays (n,) on an even grid of `step` s, SI, the paper's frame.

    Speeds are smoothed measurements, where wheels were measured, else those of the nominal model; accelerations are
    the nominal model's. `age`: s since power-on; `charge`: A s drawn and `heat`: K (per K/W) when the run begins.
    """

    step: float
    left: Array
    right: Array
    volts_left: Array
    volts_right: Array
    left_rate: Array
    right_rate: Array
    surge_accel: Array
    sway_accel: Array
    yaw_accel: Array
    age: float
    charge: float
    heat: tuple[float, float]


@dataclass(frozen=True)
class Column:
    """What one term of an effect adds, for a size of 1.

    Attributes:
        mean, difference: (n,) rad/s^2: acceleration of the two modes.
        sensors: signal -> (n,): what an IMU's sensor says too much, SI.
    """

    mean: Array
    difference: Array
    sensors: Mapping[str, Array]


def library(of: Modes, run: Motion) -> dict[str, list[Column]]:
    """Every effect's columns for one run; the name "" holds the nominal model's own."""
    zero = np.zeros_like(run.left)
    u = of.radius * 0.5 * (run.left + run.right)
    r = of.radius / of.half_track * 0.5 * (run.left - run.right)
    heading = np.cumsum(r) * run.step
    time: Array = np.arange(len(u), dtype=float) * run.step
    speed = (run.left, run.right)
    volts = (run.volts_left, run.volts_right)
    amps = tuple((v - of.emf * w) / of.resistance for v, w in zip(volts, speed, strict=True))
    supply = np.abs(volts[0] * amps[0] + volts[1] * amps[1]) / of.battery
    mean_rate, difference_rate = 0.5 * (run.left_rate + run.right_rate), 0.5 * (run.left_rate - run.right_rate)

    def torque(left: Array, right: Array, **sensors: Array) -> Column:
        return Column(0.5 * (left + right) / of.mean_inertia, 0.5 * (left - right) / of.difference_inertia, sensors)

    def wheels(term: Callable[[Array], Array]) -> Column:
        return torque(term(run.left), term(run.right))

    def body(force: Array, moment: Array, **sensors: Array) -> Column:
        half = 0.5 * of.radius * force
        turning = 0.5 * of.radius / of.half_track * moment
        return torque(half + turning, half - turning, **sensors)

    def voltage(left: Array, right: Array) -> Column:
        return torque(of.drive * left, of.drive * right)

    def each(term: Callable[[Array], Array]) -> Column:
        return voltage(term(volts[0]), term(volts[1]))

    def sensor(**sensors: Array) -> Column:
        return Column(zero, zero, sensors)

    def sign(values: Array, width: float = _SMOOTH_SPEED) -> Array:
        return np.asarray(np.tanh(values / width))

    def rate(values: Array) -> Array:
        return np.asarray(np.gradient(values, run.step))

    def beyond(values: Array, limit: float) -> Array:
        return np.asarray(np.sign(values) * np.maximum(np.abs(values) - limit, 0.0))

    slip_share = of.mass * u * r  # N: side force of the tyres, and a slip of `creep` times it
    caster = np.sqrt(u**2 + (_CASTER * r) ** 2 + (0.5 * of.radius * _SMOOTH_SPEED) ** 2)
    coupling = 0.5 * (0.5 * of.mass + 0.5 * of.yaw_inertia / of.half_track**2) * of.radius**2
    heat = [_heat(i, of.resistance, start, run.step) for i, start in zip(amps, run.heat, strict=True)]
    charge = run.charge + np.cumsum(supply) * run.step
    cosine, sine = np.cos(heading), np.sin(heading)
    top_volts = float(max(np.abs(volts[0]).max(), np.abs(volts[1]).max(), 1e-9))
    top_rate = float(max(np.abs(r).max(), 1e-9))
    weight = of.mass * _GRAVITY
    return {
        "": [
            each(lambda v: v),
            wheels(lambda w: -w),
            voltage(volts[0] - volts[1], volts[1] - volts[0]),
            torque(-(run.left - run.right), run.left - run.right),
            sensor(yaw_rate=r, accel_surge=of.radius * mean_rate, accel_sway=2 * u * r),  # wheel_radius
            sensor(yaw_rate=-r, accel_sway=-u * r),  # half_track
        ],
        "coulomb_friction": [wheels(lambda w: -sign(w))],
        "stiction_stribeck": [wheels(lambda w: -sign(w) * np.exp(-((w / _STRIBECK_SPEED) ** 2)))],
        "rolling_sqrt": [wheels(lambda w: -sign(w) * np.sqrt(np.abs(w)))],
        "constant_offset": [torque(zero - 1, zero - 1), torque(zero - 1, zero + 1)],
        "yaw_scrub": [body(zero, -sign(r, _SMOOTH_RATE))],
        "curve_scrub": [body(-np.abs(slip_share) * sign(u, 0.5 * of.radius), zero)],
        "quadratic_drag": [body(-u * np.abs(u), zero)],
        "caster_drag": [body(-u / caster, -(_CASTER**2) * r / caster)],
        "floor_slope": [
            body(weight * cosine, zero, accel_surge=-_GRAVITY * cosine, accel_sway=_GRAVITY * sine),
            body(weight * sine, zero, accel_surge=-_GRAVITY * sine, accel_sway=-_GRAVITY * cosine),
        ],
        "carpet_nap": [body(0.5 * cosine, zero), body(0.5 * sine, zero)],
        "com_forward_offset": [body(of.mass * r**2, -of.mass * u * r)],
        "com_lateral_offset": [body(of.mass * run.yaw_accel, of.mass * of.radius * mean_rate)],
        "wheel_radius_mismatch": [
            torque(
                -coupling * difference_rate - coupling * mean_rate,
                -coupling * difference_rate + coupling * mean_rate,
                yaw_rate=0.5 * u / of.half_track,
                accel_surge=0.5 * of.radius * difference_rate,
                accel_sway=0.5 * (u**2 / of.half_track + r**2 * of.half_track),
            )
        ],
        "side_slip": [body(-of.mass * slip_share * r, zero, accel_surge=slip_share * r, accel_sway=-rate(slip_share))],
        "wheel_slip": [
            sensor(
                accel_surge=-0.5 * of.mass * rate(run.surge_accel),
                yaw_rate=-0.5 * of.yaw_inertia / of.half_track**2 * run.yaw_accel,
            )
        ],
        "battery_sag": [each(lambda v: -v * supply / of.battery)],
        "battery_discharge": [each(lambda v: -v * charge / of.battery)],
        "supply_saturation": [each(lambda v, k=k: -beyond(v, k * top_volts)) for k in _KNOTS],  # type: ignore[misc]
        "actuator_deadband": [each(lambda v: -sign(v, _SMOOTH_VOLTS))],
        "motor_asymmetry": [voltage(0.5 * volts[0], -0.5 * volts[1])],
        "torque_constant_asymmetry": [
            torque(
                0.5 * of.torque_constant * (amps[0] - of.emf * speed[0] / of.resistance),
                -0.5 * of.torque_constant * (amps[1] - of.emf * speed[1] / of.resistance),
            )
        ],
        "motor_heating": [voltage(*(-of.resistance * _COPPER * t * i for t, i in zip(heat, amps, strict=True)))],
        "input_delay": [each(lambda v: (_delayed(v, run.step) - v) / _LAG)],
        "actuator_lag": [each(lambda v: (_lagged(v, 1 / _LAG, run.step) - v) / _LAG)],
        "start_delay": [each(lambda v: np.where(time < _START, -v, 0.0))],
        "gyro_bias": [sensor(yaw_rate=zero + 1)],
        "gyro_scale": [sensor(yaw_rate=r)],
        "gyro_drift": [sensor(yaw_rate=run.age + time)],
        "gyro_saturation": [sensor(yaw_rate=-beyond(r, k * top_rate)) for k in _KNOTS],
        "accel_bias": [sensor(accel_surge=zero + 1), sensor(accel_sway=zero + 1)],
        "accel_misalignment": [sensor(accel_surge=run.sway_accel, accel_sway=-run.surge_accel)],
        "imu_lever_arm": [
            sensor(accel_surge=-(r**2), accel_sway=run.yaw_accel),
            sensor(accel_surge=-run.yaw_accel, accel_sway=-(r**2)),
        ],
        "imu_lag": [
            sensor(accel_surge=-rate(run.surge_accel), accel_sway=-rate(run.sway_accel), yaw_rate=-run.yaw_accel)
        ],
    }


def _lagged(values: Array, decay: float, step: float) -> Array:
    """Solution of y' = decay (values - y) from rest."""
    kept = np.exp(-decay * step)
    return np.asarray(lfilter([1 - kept], [1, -kept], values))


def _delayed(values: Array, step: float) -> Array:
    count = max(1, round(_LAG / step))
    return np.concatenate([np.zeros(count), values])[: len(values)]


def _heat(amps: Array, resistance: float, start: float, step: float) -> Array:
    """K above the surroundings, for a thermal resistance of 1 K/W."""
    kept = np.exp(-step / _HEATING_S)
    return np.asarray(lfilter([1 - kept], [1, -kept], resistance * amps**2, zi=[kept * start])[0])


def carried(of: Modes, run: Motion) -> tuple[float, tuple[float, float]]:
    """Charge and heat when `run` ends: what the next one begins with."""
    amps = [(v - of.emf * w) / of.resistance for v, w in ((run.volts_left, run.left), (run.volts_right, run.right))]
    supply = np.abs(run.volts_left * amps[0] + run.volts_right * amps[1]) / of.battery
    heat = [_heat(i, of.resistance, start, run.step)[-1] for i, start in zip(amps, run.heat, strict=True)]
    return run.charge + float(supply.sum()) * run.step, (float(heat[0]), float(heat[1]))
