"""Combinations of parameters that are identifiable from steady speed and its onset, even where single ones are not.

Once the current has settled, eqs. 12 to 14 describe a wheel by D = K_t K_e + R (b_s + sigma m g r^2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo

Values = Mapping[str, float]


@dataclass(frozen=True)
class Formula:
    """A combination of parameters.

    Attributes:
        text: the formula in the paper's symbols.
        value_at: takes all parameters, "mass" or "effect.parameter", and returns the value; NaN: undefined.
    """

    name: str
    text: str
    unit: str
    value_at: Callable[[Values], float]


def _steady(p: Values) -> float:
    """Returns D of the module's docstring, for one wheel."""
    loss = p["viscous_friction"] + p["rolling_friction"] * p["mass"] * p["gravity"] * p["wheel_radius"] ** 2
    return p["torque_constant"] * p["emf_constant"] + p["resistance"] * loss


def _wheel_gain(p: Values) -> float:
    return p["torque_constant"] / _steady(p)


def _turn(p: Values) -> float:
    return p["wheel_radius"] / p["half_track"]


def _straight_time(p: Values) -> float:
    return p["resistance"] * (p["wheel_inertia"] + p["mass"] * p["wheel_radius"] ** 2 / 2) / _steady(p)


def _spin_time(p: Values) -> float:
    return p["resistance"] * (p["wheel_inertia"] + p["yaw_inertia"] * _turn(p) ** 2 / 2) / _steady(p)


def _motor_time(p: Values) -> float:
    return p["resistance"] * (p["wheel_inertia"] + p["mass"] * p["wheel_radius"] ** 2) / _steady(p)


def _in_volts(effect: str, torque: ParameterInfo) -> Formula:
    """Returns the formula of the voltage at the motor that holds a torque at the wheel."""

    def value_at(p: Values) -> float:
        return p.get(f"{effect}.{torque.name}", np.nan) * p["resistance"] / p["torque_constant"]

    return Formula(torque.in_volts, f"{effect} R / K_t", "V", value_at)


_TORQUES = tuple(_in_volts(e.name, info) for e in catalogue.effects() for info in e.parameters if info.in_volts)

FORMULAS: dict[str, tuple[Formula, ...]] = {
    "diff_drive": (
        Formula("speed per volt", "r K_t / D", "m/s/V", lambda p: p["wheel_radius"] * _wheel_gain(p)),
        Formula("wheel speed per volt", "K_t / D", "rad/s/V", _wheel_gain),
        Formula("straight time constant", "R (J + m r^2 / 2) / D", "s", _straight_time),
        Formula("spin rate per volt", "r K_t / (half_track D)", "rad/s/V", lambda p: _turn(p) * _wheel_gain(p)),
        Formula("spin time constant", "R (J + J_z (r / half_track)^2 / 2) / D", "s", _spin_time),
        *_TORQUES,
    ),
    "motor": (
        Formula("speed per volt", "K_t / D", "rad/s/V", _wheel_gain),
        Formula("time constant", "R (J + m r^2) / D", "s", _motor_time),
        *_TORQUES,
    ),
}
