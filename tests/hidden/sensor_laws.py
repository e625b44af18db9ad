"""Sensor errors whose laws are not in the library. They act on an engine's track, so they work with both engines."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter

from hidden.by_run import place
from hidden.recipe import Floats, Hidden, Track

Parameters = Mapping[str, float]


@dataclass
class Readings:
    """The readings of ideal sensors in one run, (n,) each, sampled every `step` s. The laws change these in turn."""

    surge: Floats
    sway: Floats
    rate: Floats
    left: Floats
    right: Floats
    step: float
    time: Floats  # s since power-on
    number: int  # number of the run


def read(track: Track, hidden: Hidden, age: float, number: int) -> Readings:
    """Returns the readings of a run with the laws of `hidden` applied.

    Args:
        age: s from power-on to the run's start.
    """
    readings = Readings(
        track.accel_surge, track.accel_sway, track.yaw_rate, track.wheel_speed_left, track.wheel_speed_right,
        track.oversample_s, age + track.time, number,
    )  # fmt: skip
    for name, act in LAWS.items():
        if name in hidden:
            act(readings, hidden[name], track)
    return readings


def _second_order(values: Floats, omega: float, damping: float, step: float) -> Floats:
    """Returns the values after a second-order low-pass that starts settled (zero-order hold)."""
    filtered = cont2discrete((np.array([omega**2]), np.array([1.0, 2 * damping * omega, omega**2])), step, method="zoh")
    first = values[0]
    return np.asarray(lfilter(filtered[0].ravel(), filtered[1], values - first) + first, dtype=float)


def _arm_on_mast(r: Readings, p: Parameters, track: Track) -> None:
    """The IMU is on a flexible mast off the axle: a resonance filters the accelerations due to the lever arm."""
    turn = track.yaw_rate - 0.5 * r.step * track.yaw_accel
    omega = 2 * math.pi * p["frequency"]
    ahead = -(turn**2) * p["x"] - track.yaw_accel * p["y"]
    aside = -(turn**2) * p["y"] + track.yaw_accel * p["x"]
    r.surge = r.surge + _second_order(ahead, omega, p["damping"], r.step)
    r.sway = r.sway + _second_order(aside, omega, p["damping"], r.step)


def _accel_cross_axis(r: Readings, p: Parameters, _: Track) -> None:
    """The surge axis also measures a share of the sway acceleration. The sway axis measures no surge acceleration."""
    r.surge = r.surge + p["share"] * r.sway


def _imu_second_order(r: Readings, p: Parameters, _: Track) -> None:
    omega, damping = 1 / p["time"], math.sqrt(0.5)
    r.surge, r.sway, r.rate = (_second_order(one, omega, damping, r.step) for one in (r.surge, r.sway, r.rate))


def _accel_bias_fading(r: Readings, p: Parameters, _: Track) -> None:
    left = np.exp(-r.time / p["time_constant"])
    r.surge, r.sway = r.surge + p["surge"] * left, r.sway + p["sway"] * left


def _gyro_scale_bent(r: Readings, p: Parameters, _: Track) -> None:
    r.rate = (1 + p["error"]) * r.rate + p["cubic"] * r.rate**3


def _gyro_curved_one_way(r: Readings, p: Parameters, _: Track) -> None:
    """The gain grows with the square of the rate, only in turns to the right."""
    r.rate = r.rate + p["cubic"] * np.maximum(r.rate, 0.0) ** 3


def _gyro_bias_by_run(r: Readings, p: Parameters, _: Track) -> None:
    r.rate = r.rate + p["bias"] * (1 + p["spread"] * place(r.number))


def _gyro_warming_up(r: Readings, p: Parameters, _: Track) -> None:
    r.rate = r.rate - p["bias"] * np.expm1(-r.time / p["time_constant"])


def _gyro_soft_limit(r: Readings, p: Parameters, _: Track) -> None:
    r.rate = p["limit"] * np.tanh(r.rate / p["limit"])


def _encoder_eccentric(r: Readings, p: Parameters, _: Track) -> None:
    """The code wheels are eccentric: the reading varies once per turn, in opposite phase at the two wheels."""
    left, right = np.cumsum(r.left) * r.step, np.cumsum(r.right) * r.step
    r.left, r.right = r.left * (1 + p["share"] * np.cos(left)), r.right * (1 - p["share"] * np.cos(right))


def _encoder_one_side(r: Readings, p: Parameters, _: Track) -> None:
    r.left = r.left * (1 + p["error"])


def _speed_signed_by_command(r: Readings, p: Parameters, track: Track) -> None:
    """Each wheel has one light barrier. Its counts get the sign of the command; at command zero the last sign holds."""

    def told(true: Floats, command: Floats) -> Floats:
        last = np.maximum.accumulate(np.where(command != 0, np.arange(len(command)), 0))
        sign = np.where(command[last] < 0, -1.0, 1.0)
        return true + p["share"] * (np.abs(true) * sign - true)

    r.left, r.right = told(r.left, track.command_left), told(r.right, track.command_right)


def _wheel_speed_counted(r: Readings, p: Parameters, _: Track) -> None:
    """Speeds are means over the past window, because the encoder counts pulses over this window."""
    count = max(1, round(p["window"] / r.step))
    r.left, r.right = (
        np.asarray(lfilter(np.ones(count) / count, [1.0], one), dtype=float) for one in (r.left, r.right)
    )


def _wheel_speed_smoothed(r: Readings, p: Parameters, _: Track) -> None:
    omega, damping = 1 / p["time"], math.sqrt(0.5)
    r.left, r.right = (_second_order(one, omega, damping, r.step) for one in (r.left, r.right))


def _gyro_smoothed(r: Readings, p: Parameters, _: Track) -> None:
    r.rate = _second_order(r.rate, 1 / p["time"], math.sqrt(0.5), r.step)


LAWS: dict[str, Callable[[Readings, Parameters, Track], None]] = {
    act.__name__[1:]: act
    for act in (
        _arm_on_mast, _accel_cross_axis, _imu_second_order, _accel_bias_fading, _gyro_scale_bent,
        _gyro_curved_one_way, _gyro_bias_by_run,
        _gyro_warming_up, _gyro_soft_limit, _encoder_eccentric, _encoder_one_side,
        _speed_signed_by_command, _wheel_speed_counted,
        _wheel_speed_smoothed, _gyro_smoothed,
    )
}  # fmt: skip
"""The laws in the order in which they change a reading."""
