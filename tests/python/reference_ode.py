"""The plant's equations as text-book ODEs for a stiff solver, written from the paper, not from the plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Slope = Callable[[float, Array, float, float], list[float]]

COLUMNS = (
    "current_left",
    "current_right",
    "wheel_speed_left",
    "wheel_speed_right",
    "x",
    "y",
    "yaw_angle",
    "surge",
    "sway",
    "yaw_rate",
)


def _current_slope(p: Mapping[str, float], voltage: float, current: float, speed: float) -> float:
    if math.isnan(voltage):
        return 0.0
    return (voltage - p["resistance"] * current - p["emf_constant"] * speed) / p["inductance"]


def _wheel_torque(p: Mapping[str, float], current: float, speed: float) -> float:
    rolling = p["mass"] * p["gravity"] * p["rolling_friction"] * p["wheel_radius"] * abs(speed)
    return (
        p["torque_constant"] * current
        - p["viscous_friction"] * speed
        - math.copysign(rolling * p["wheel_radius"], speed)
    )


def _air(p: Mapping[str, float], speed: float) -> float:
    return 0.5 * p["drag_area"] * p["air_density"] * speed * abs(speed)


def coupled(p: Mapping[str, float]) -> Slope:
    """Returns the equations of motion. The tyre forces F_l and F_r take the values with which no wheel slips."""
    radius, track = p["wheel_radius"], p["half_track"]
    # Unknowns w_l', w_r', F_l, F_r: two wheel equations, the body's surge and its yaw.
    matrix = np.array(
        [
            [p["wheel_inertia"], 0, radius, 0],
            [0, p["wheel_inertia"], 0, radius],
            [p["mass"] * radius / 2, p["mass"] * radius / 2, -1, -1],
            [p["yaw_inertia"] * radius / (2 * track), -p["yaw_inertia"] * radius / (2 * track), -track, track],
        ]
    )

    def slope(_: float, s: Array, left: float, right: float) -> list[float]:
        i_l, i_r, w_l, w_r, _x, _y, heading, surge = s[:8]
        known = [_wheel_torque(p, i_l, w_l), _wheel_torque(p, i_r, w_r), -_air(p, surge), 0.0]
        a_l, a_r = np.linalg.solve(matrix, known)[:2]
        rate = radius * (w_l - w_r) / (2 * track)
        return [
            _current_slope(p, left, i_l, w_l),
            _current_slope(p, right, i_r, w_r),
            a_l,
            a_r,
            surge * math.cos(heading),
            surge * math.sin(heading),
            rate,
            radius * (a_l + a_r) / 2,
            0.0,
            radius * (a_l - a_r) / (2 * track),
        ]

    return slope


def paper(p: Mapping[str, float]) -> Slope:
    """Returns eq. 1 to 19 of the paper. Below 0.1 mm/s the direction of motion is undefined: the heading is used."""

    def thrust(voltage: float, speed: float) -> float:
        if math.isnan(voltage):
            return 0.0
        t_max = voltage / p["battery_voltage"] * p["stall_torque"]
        return (t_max - p["stall_torque"] / p["no_load_speed"] * speed) / p["wheel_radius"]

    def slope(_: float, s: Array, left: float, right: float) -> list[float]:
        i_l, i_r, w_l, w_r, _x, _y, heading, u, v, r = s
        f_l, f_r = thrust(left, w_l), thrust(right, w_r)
        speed = math.hypot(u, v)
        beta = math.asin(v / speed) if speed >= 1e-4 else 0.0
        return [
            _current_slope(p, left, i_l, w_l),
            _current_slope(p, right, i_r, w_r),
            _wheel_torque(p, i_l, w_l) / p["wheel_inertia"],
            _wheel_torque(p, i_r, w_r) / p["wheel_inertia"],
            u * math.cos(heading) - v * math.sin(heading),
            u * math.sin(heading) + v * math.cos(heading),
            r,
            ((f_l + f_r) * math.cos(beta) - _air(p, u)) / p["mass"] + v * r,
            ((f_l + f_r) * math.sin(beta) - _air(p, v)) / p["mass"] - u * r,
            (f_l - f_r) * p["half_track"] / p["yaw_inertia"],
        ]

    return slope


def solve(slope: Slope, time: Array, inputs: Array, start: Array | None = None) -> dict[str, Array]:
    """Returns state -> values (samples,). An input is held until the next; a floating motor has no current at once."""
    rows = [np.zeros(len(COLUMNS)) if start is None else start]
    changes = [0, *(np.flatnonzero(np.any(~_same(inputs[1:], inputs[:-1]), axis=1)) + 1), len(time) - 1]
    for begin, end in pairwise(changes):
        left, right = inputs[begin]
        first = rows[-1].copy()
        first[:2][np.isnan(inputs[begin])] = 0.0
        solution = solve_ivp(
            slope,
            (time[begin], time[end]),
            first,
            "Radau",
            time[begin + 1 : end + 1],
            args=(left, right),
            rtol=1e-9,
            atol=1e-11,
        )
        rows.extend(solution.y.T)
    return dict(zip(COLUMNS, np.array(rows).T, strict=True))


def _same(a: Array, b: Array) -> NDArray[np.bool_]:
    return (a == b) | (np.isnan(a) & np.isnan(b))
