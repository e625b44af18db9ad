"""The library of the peer: what each effect adds to a differential drive, as text books write it.

A vehicle whose wheels roll moves in two modes, the mean and half the difference of its wheel speeds. Each is of first
order: inertia w' = K_t / R (V - K_e w) - b w + torque. An effect is a torque at each wheel, a force and a moment, a
voltage, or the error of a sensor. Its column is that for a size of 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brickpilot.benchmark.sindy_motion import GRAVITY, Modes, Motion, winding_heat

Array = NDArray[np.float64]

_SMOOTH_SPEED, _SMOOTH_VOLTS, _SMOOTH_RATE = 0.5, 0.1, 0.1  # rad/s, V, rad/s: width of a smooth sign
_STRIBECK_SPEED = 1.0  # rad/s
_CASTER = 0.08  # m, from axle to caster
_LAG = 0.02  # s: a delay and a lag are linearised by a difference of this size
_START = 0.1  # s
_COPPER = 0.00393  # 1/K
_KNOTS = (0.5, 0.6, 0.7, 0.8, 0.9)  # of the largest value: where a saturation may begin

NOT_IN_LIBRARY = frozenset(
    {
        "direction_asymmetry", "encoder_scale", "sensor_delay", "torque_ripple", "cogging", "gear_backlash",
        "pwm_quantisation", "pwm_coast", "payload_mass",
    }
)  # fmt: skip
"""Effects without a column. Some have a free frequency, step or state. Some have the columns of others: a delay of all
sensors is a delay of the input, and friction of one direction is dry friction and an offset. Some are nearly a change
of nominal values: a load changes the mass, the scale of the encoders changes radius, drive and EMF."""


@dataclass(frozen=True)
class Column:
    """What one term of an effect adds, for a size of 1.

    Attributes:
        mean, difference: (n,) rad/s^2: acceleration of the two modes.
        sensors: signal -> (n,): error of an IMU's sensor, SI.
    """

    mean: Array
    difference: Array
    sensors: Mapping[str, Array]


def library(of: Modes, run: Motion) -> dict[str, list[Column]]:
    """Returns every effect's columns for one run. The name "" holds those of the nominal model itself."""
    make = _Columns(of, run)
    return {"": make.nominal(), **make.friction(), **make.body_effects(), **make.supply(), **make.sensor_effects()}


class _Columns:
    """Makes the columns of one run, by where the effects act."""

    def __init__(self, of: Modes, run: Motion) -> None:
        self.of, self.run = of, run
        self.zero = np.zeros_like(run.left)
        self.u = of.radius * 0.5 * (run.left + run.right)
        self.r = of.radius / of.half_track * 0.5 * (run.left - run.right)
        self.time: Array = np.arange(len(self.u), dtype=float) * run.step
        self.speed = (run.left, run.right)
        self.volts = (run.volts_left, run.volts_right)
        self.amps = tuple((v - of.emf * w) / of.resistance for v, w in zip(self.volts, self.speed, strict=True))
        self.mean_rate = 0.5 * (run.left_rate + run.right_rate)
        self.difference_rate = 0.5 * (run.left_rate - run.right_rate)
        self.side_force = of.mass * self.u * self.r  # N, of the tyres; their slip is a creep times it

    def nominal(self) -> list[Column]:
        run, volts, u, r = self.run, self.volts, self.u, self.r
        return [
            self._each_motor(lambda v: v),
            self._each_wheel(lambda w: -w),
            self._voltage(volts[0] - volts[1], volts[1] - volts[0]),
            self._torque(-(run.left - run.right), run.left - run.right),
            self._sensor(yaw_rate=r, accel_surge=self.of.radius * self.mean_rate, accel_sway=2 * u * r),  # wheel_radius
            self._sensor(yaw_rate=-r, accel_sway=-u * r),  # half_track
        ]

    def friction(self) -> dict[str, list[Column]]:
        of, u, r, zero = self.of, self.u, self.r, self.zero
        caster = np.sqrt(u**2 + (_CASTER * r) ** 2 + (0.5 * of.radius * _SMOOTH_SPEED) ** 2)
        return {
            "coulomb_friction": [self._each_wheel(lambda w: -_sign(w))],
            "stiction_stribeck": [self._each_wheel(lambda w: -_sign(w) * np.exp(-((w / _STRIBECK_SPEED) ** 2)))],
            "rolling_sqrt": [self._each_wheel(lambda w: -_sign(w) * np.sqrt(np.abs(w)))],
            "constant_offset": [self._torque(zero - 1, zero - 1), self._torque(zero - 1, zero + 1)],
            "yaw_scrub": [self._body(zero, -_sign(r, _SMOOTH_RATE))],
            "curve_scrub": [self._body(-np.abs(self.side_force) * _sign(u, 0.5 * of.radius), zero)],
            "quadratic_drag": [self._body(-u * np.abs(u), zero)],
            "caster_drag": [self._body(-u / caster, -(_CASTER**2) * r / caster)],
        }

    def body_effects(self) -> dict[str, list[Column]]:
        of, run, u, r, zero = self.of, self.run, self.u, self.r, self.zero
        heading = np.cumsum(r) * run.step
        cosine, sine = np.cos(heading), np.sin(heading)
        weight = of.mass * GRAVITY
        return {
            "floor_slope": [
                self._body(weight * cosine, zero, accel_surge=-GRAVITY * cosine, accel_sway=GRAVITY * sine),
                self._body(weight * sine, zero, accel_surge=-GRAVITY * sine, accel_sway=-GRAVITY * cosine),
            ],
            "carpet_nap": [self._body(0.5 * cosine, zero), self._body(0.5 * sine, zero)],
            "com_forward_offset": [self._body(of.mass * r**2, -of.mass * u * r)],
            "com_lateral_offset": [self._body(of.mass * run.yaw_accel, of.mass * of.radius * self.mean_rate)],
            "wheel_radius_mismatch": [self._radius_mismatch()],
            "side_slip": [
                self._body(
                    -of.mass * self.side_force * r,
                    zero,
                    accel_surge=self.side_force * r,
                    accel_sway=-self._rate(self.side_force),
                )
            ],
            "wheel_slip": [
                self._sensor(
                    accel_surge=-0.5 * of.mass * self._rate(run.surge_accel),
                    yaw_rate=-0.5 * of.yaw_inertia / of.half_track**2 * run.yaw_accel,
                )
            ],
        }

    def _radius_mismatch(self) -> Column:
        of = self.of
        coupling = 0.5 * (0.5 * of.mass + 0.5 * of.yaw_inertia / of.half_track**2) * of.radius**2
        return self._torque(
            -coupling * self.difference_rate - coupling * self.mean_rate,
            -coupling * self.difference_rate + coupling * self.mean_rate,
            yaw_rate=0.5 * self.u / of.half_track,
            accel_surge=0.5 * of.radius * self.difference_rate,
            accel_sway=0.5 * (self.u**2 / of.half_track + self.r**2 * of.half_track),
        )

    def supply(self) -> dict[str, list[Column]]:
        """Battery, drive, motors and timing."""
        of, run, volts, amps = self.of, self.run, self.volts, self.amps
        current = np.abs(volts[0] * amps[0] + volts[1] * amps[1]) / of.battery
        charge = run.charge + np.cumsum(current) * run.step
        heat = [winding_heat(i, of.resistance, start, run.step) for i, start in zip(amps, run.heat, strict=True)]
        top = float(max(np.abs(volts[0]).max(), np.abs(volts[1]).max(), 1e-9))
        saturation = [self._each_motor(lambda v, k=k: -_beyond(v, k * top)) for k in _KNOTS]  # type: ignore[misc]
        return {
            "battery_sag": [self._each_motor(lambda v: -v * current / of.battery)],
            "battery_discharge": [self._each_motor(lambda v: -v * charge / of.battery)],
            "supply_saturation": saturation,
            "actuator_deadband": [self._each_motor(lambda v: -_sign(v, _SMOOTH_VOLTS))],
            "motor_asymmetry": [self._voltage(0.5 * volts[0], -0.5 * volts[1])],
            "torque_constant_asymmetry": [
                self._torque(
                    0.5 * of.torque_constant * (amps[0] - of.emf * self.speed[0] / of.resistance),
                    -0.5 * of.torque_constant * (amps[1] - of.emf * self.speed[1] / of.resistance),
                )
            ],
            "motor_heating": [
                self._voltage(*(-of.resistance * _COPPER * t * i for t, i in zip(heat, amps, strict=True)))
            ],
            "input_delay": [self._each_motor(lambda v: (_delayed(v, run.step) - v) / _LAG)],
            "actuator_lag": [self._each_motor(lambda v: (_lagged(v, 1 / _LAG, run.step) - v) / _LAG)],
            "start_delay": [self._each_motor(lambda v: np.where(self.time < _START, -v, 0.0))],
        }

    def sensor_effects(self) -> dict[str, list[Column]]:
        run, r, one = self.run, self.r, self.zero + 1
        top = float(max(np.abs(r).max(), 1e-9))
        return {
            "gyro_bias": [self._sensor(yaw_rate=one)],
            "gyro_scale": [self._sensor(yaw_rate=r)],
            "gyro_drift": [self._sensor(yaw_rate=run.age + self.time)],
            "gyro_saturation": [self._sensor(yaw_rate=-_beyond(r, k * top)) for k in _KNOTS],
            "accel_bias": [self._sensor(accel_surge=one), self._sensor(accel_sway=one)],
            "accel_misalignment": [self._sensor(accel_surge=run.sway_accel, accel_sway=-run.surge_accel)],
            "imu_lever_arm": [
                self._sensor(accel_surge=-(r**2), accel_sway=run.yaw_accel),
                self._sensor(accel_surge=-run.yaw_accel, accel_sway=-(r**2)),
            ],
            "imu_lag": [
                self._sensor(
                    accel_surge=-self._rate(run.surge_accel),
                    accel_sway=-self._rate(run.sway_accel),
                    yaw_rate=-run.yaw_accel,
                )
            ],
        }

    def _torque(self, left: Array, right: Array, **sensors: Array) -> Column:
        of = self.of
        return Column(0.5 * (left + right) / of.mean_inertia, 0.5 * (left - right) / of.difference_inertia, sensors)

    def _each_wheel(self, term: Callable[[Array], Array]) -> Column:
        return self._torque(term(self.run.left), term(self.run.right))

    def _body(self, force: Array, moment: Array, **sensors: Array) -> Column:
        half = 0.5 * self.of.radius * force
        turning = 0.5 * self.of.radius / self.of.half_track * moment
        return self._torque(half + turning, half - turning, **sensors)

    def _voltage(self, left: Array, right: Array) -> Column:
        return self._torque(self.of.drive * left, self.of.drive * right)

    def _each_motor(self, term: Callable[[Array], Array]) -> Column:
        return self._voltage(term(self.volts[0]), term(self.volts[1]))

    def _sensor(self, **sensors: Array) -> Column:
        return Column(self.zero, self.zero, sensors)

    def _rate(self, values: Array) -> Array:
        return np.asarray(np.gradient(values, self.run.step))


def _sign(values: Array, width: float = _SMOOTH_SPEED) -> Array:
    return np.asarray(np.tanh(values / width))


def _beyond(values: Array, limit: float) -> Array:
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - limit, 0.0))


def _lagged(values: Array, decay: float, step: float) -> Array:
    """Returns the solution of y' = decay (values - y) from rest."""
    kept = np.exp(-decay * step)
    return np.asarray(lfilter([1 - kept], [1, -kept], values))


def _delayed(values: Array, step: float) -> Array:
    count = max(1, round(_LAG / step))
    return np.concatenate([np.zeros(count), values])[: len(values)]
