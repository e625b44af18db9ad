"""Logs of robots under a digital speed controller: set points and wheel speeds, and no voltage.

The module does not use the plant: it integrates by Euler steps of 0.1 ms, with a controller that acts every 10 ms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Vector = NDArray[np.float64]

RADIUS, HALF_TRACK, EMF = 0.033, 0.08, 0.31
NOMINAL = {
    "mass": 1.4, "wheel_radius": RADIUS, "half_track": HALF_TRACK, "emf_constant": EMF, "torque_constant": EMF,
    "yaw_inertia": {"value": 0.012, "sd": 0.002},
}  # fmt: skip
ROW_S, _CONTROL_S, _STEP_S, _LASTS_S = 0.02, 0.01, 1e-4, 6.0
_RESISTANCE, _INERTIA, _VISCOUS, _SUPPLY = 2.2, 4e-4, 8e-4, 12.0
_MASS, _YAW_INERTIA = 1.4, 0.012


@dataclass(frozen=True)
class Controller:
    """A PI controller of each wheel: V = EMF (feedforward wanted + proportional error + integral (sum of error dt))."""

    feedforward: float = 1.0
    proportional: float = 0.5
    integral: float = 6.0
    delay_s: float = 0.0


def demands(seed: int) -> Mapping[str, tuple[Vector, Vector]]:
    """Returns run -> forward velocity (m/s) and yaw rate (rad/s, counter-clockwise), one row per 20 ms."""
    time = np.arange(0.0, _LASTS_S, ROW_S)
    drives, draw = ((time > 0.5) & (time < 4.5)).astype(float), np.random.default_rng(seed)
    fast = draw.uniform(0.25, 0.5, 4)
    return {
        "ahead": (fast[0] * drives, 0.0 * time),
        "back": (-fast[1] * drives, 0.0 * time),
        "slow": (0.08 * drives, 0.0 * time),
        "ramp": (fast[2] * np.interp(time, [0.5, 2.5, 4.5], [0.0, 1.0, 0.0]), 0.0 * time),
        "bend": (fast[3] * drives, 1.2 * ((time > 2.0) & (time < 3.5))),
        "right": (fast[0] * drives, -0.8 * drives),
        "spin": (0.0 * time, 2.5 * drives),
    }


def logs(controller: Controller, dry_friction: float = 0.0, seed: int = 1) -> dict[str, pd.DataFrame]:
    """Returns run -> its log: set points of the body, wheel speeds (rad/s) and yaw rate with noise; y to the left.

    Args:
        dry_friction: dry friction of each wheel, N m.
    """
    asked = demands(seed)
    velocity, yaw_rate = (np.array(one) for one in zip(*asked.values(), strict=True))
    measured = _driven(velocity, yaw_rate, controller, dry_friction)
    turn = (measured[..., 1] - measured[..., 0]) * RADIUS / (2 * HALF_TRACK)
    noise = np.random.default_rng(seed + 1)
    measured = measured + noise.normal(0.0, 0.05, measured.shape)
    turn = turn + noise.normal(0.0, 0.01, turn.shape)
    return {
        name: pd.DataFrame(
            {
                "time": ROW_S * np.arange(velocity.shape[1]),
                "reference_velocity": velocity[k],
                "reference_yaw_rate": yaw_rate[k],
                "wheel_speed_left": measured[k, :, 0],
                "wheel_speed_right": measured[k, :, 1],
                "yaw_rate": turn[k],
            }
        )
        for k, name in enumerate(asked)
    }


def _driven(velocity: Vector, yaw_rate: Vector, controller: Controller, dry_friction: float) -> Vector:
    """Returns the wheel speeds in rad/s, (runs, rows, 2), for set points of shape (runs, rows)."""
    forward, turn = _MASS * RADIUS**2 / 4, _YAW_INERTIA * RADIUS**2 / (4 * HALF_TRACK**2)
    both = np.array([[_INERTIA + forward + turn, forward - turn], [forward - turn, _INERTIA + forward + turn]])
    per_torque, every = np.linalg.inv(both), round(_CONTROL_S / _STEP_S)
    wanted = np.stack([velocity - HALF_TRACK * yaw_rate, velocity + HALF_TRACK * yaw_rate], axis=-1) / RADIUS
    speed = summed = volts = np.zeros((len(velocity), 2))
    rows = []
    for step in range(round(_LASTS_S / _STEP_S)):
        now = step * _STEP_S
        if step % round(ROW_S / _STEP_S) == 0:
            rows.append(speed)
        if step % every == 0:
            row = int((now - controller.delay_s) / ROW_S + 1e-9)
            asked = wanted[:, row] if now >= controller.delay_s else np.zeros_like(speed)
            summed = summed + controller.integral * (asked - speed) * _CONTROL_S
            told = controller.feedforward * asked + controller.proportional * (asked - speed) + summed
            volts = np.clip(EMF * told, -_SUPPLY, _SUPPLY)
        torque = EMF * (volts - EMF * speed) / _RESISTANCE - _VISCOUS * speed
        turns = np.abs(speed) > 1e-3
        friction = np.where(turns, np.sign(speed) * dry_friction, np.clip(torque, -dry_friction, dry_friction))
        after = speed + _STEP_S * (torque - friction) @ per_torque
        speed = np.where((speed * after < 0) & (np.abs(torque) < dry_friction), 0.0, after)
    return np.stack(rows, axis=1)
