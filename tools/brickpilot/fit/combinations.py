"""Combinations of parameters that are identifiable from steady speed and its onset, even where single ones are not.

Once the current has settled, eqs. 12 to 14 describe a wheel by D = K_t K_e + R (b_s + sigma m g r^2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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


def _volts_per_speed(p: Values) -> float:
    """Returns kV of u = kS sgn(w) + kV w + kA dw/dt, at the wheel."""
    return _steady(p) / p["torque_constant"]


def _straight_volts(p: Values) -> float:
    """Returns kA of the same for a vehicle that drives straight."""
    return p["resistance"] * (p["wheel_inertia"] + p["mass"] * p["wheel_radius"] ** 2 / 2) / p["torque_constant"]


def _motor_volts(p: Values) -> float:
    return p["resistance"] * (p["wheel_inertia"] + p["mass"] * p["wheel_radius"] ** 2) / p["torque_constant"]


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
        Formula("kV", "D / K_t", "V s/rad", _volts_per_speed),
        Formula("kA", "R (J + m r^2 / 2) / K_t", "V s^2/rad", _straight_volts),
        *_TORQUES,
    ),
    "motor": (
        Formula("speed per volt", "K_t / D", "rad/s/V", _wheel_gain),
        Formula("time constant", "R (J + m r^2) / D", "s", _motor_time),
        Formula("kV", "D / K_t", "V s/rad", _volts_per_speed),
        Formula("kA", "R (J + m r^2) / K_t", "V s^2/rad", _motor_volts),
        *_TORQUES,
    ),
}


_Factor = Callable[[Values], float]


def _volts_per_torque(p: Values) -> float:
    return p["resistance"] / p["torque_constant"]


def _volts_per_force(p: Values) -> float:
    return p["wheel_radius"] / 2 * _volts_per_torque(p)


def _volts_per_moment(p: Values) -> float:
    return p["wheel_radius"] / (2 * p["half_track"]) * _volts_per_torque(p)


# (what the effect acts on, unit of the parameter) -> (what it becomes, formula beside the parameter, unit, factor).
# The first one that the data determine is taken. A drive that commands a force has parameters in N and N s/m.
_FORMS: Mapping[tuple[str, str], tuple[tuple[str, str, str, _Factor], ...]] = {
    ("wheel", "N m"): (
        ("voltage", "R / K_t", "V", _volts_per_torque),
        ("angular acceleration", "1 / J", "rad/s^2", lambda p: 1 / p["wheel_inertia"]),
    ),
    ("wheel", "N m s/rad"): (
        ("voltage per speed", "R / K_t", "V s/rad", _volts_per_torque),
        ("inverse time constant", "1 / J", "1/s", lambda p: 1 / p["wheel_inertia"]),
    ),
    ("wheel", "m/(N s)"): (
        ("slip speed per volt", "K_t / (R r)", "m/s/V", lambda p: 1 / (p["wheel_radius"] * _volts_per_torque(p))),
    ),
    ("body", "N"): (
        ("voltage", "r R / (2 K_t)", "V", _volts_per_force),
        ("acceleration", "1 / m", "m/s^2", lambda p: 1 / p["mass"]),
    ),
    ("body", "N m"): (
        ("voltage", "r R / (2 half_track K_t)", "V", _volts_per_moment),
        ("angular acceleration", "1 / J_z", "rad/s^2", lambda p: 1 / p["yaw_inertia"]),
    ),
    ("body", "N s/m"): (
        ("voltage per speed", "r R / (2 K_t)", "V s/m", _volts_per_force),
        ("inverse time constant", "1 / m", "1/s", lambda p: 1 / p["mass"]),
    ),
    ("body", "N m s/rad"): (
        ("voltage per yaw rate", "r R / (2 half_track K_t)", "V s/rad", _volts_per_moment),
        ("inverse time constant", "1 / J_z", "1/s", lambda p: 1 / p["yaw_inertia"]),
    ),
    ("body", "N s^2/m^2"): (
        ("voltage per speed squared", "r R / (2 K_t)", "V s^2/m^2", _volts_per_force),
        ("inverse length", "1 / m", "1/m", lambda p: 1 / p["mass"]),
    ),
    ("body", "kg"): (("share of the mass", "1 / m", "1", lambda p: 1 / p["mass"]),),
    ("body", "m/(N s)"): (
        ("slip speed per volt", "K_t / (R r)", "m/s/V", lambda p: 1 / (p["wheel_radius"] * _volts_per_torque(p))),
    ),
}


def forms(name: str) -> Iterator[Formula]:
    """Yields the forms in which the size `name`, "effect.parameter", may be identifiable, the plainest first."""
    head, _, tail = name.partition(".")
    effect = catalogue.effect(head)
    unit = next(one.unit for one in effect.parameters if one.name == tail)
    for words, text, found, factor in _FORMS.get((effect.acts_on, unit), ()):
        yield Formula(words, f"{tail} {text}", found, _scaled(name, factor))


def _scaled(name: str, factor: _Factor) -> Callable[[Values], float]:
    return lambda p: abs(p[name]) * factor(p)
