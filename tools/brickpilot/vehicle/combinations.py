"""Combinations of parameters that the step response of the speed identifies, even if it identifies no
single parameter.

If the data do not determine a parameter, its fit can end at any value, and later fits depend on that value. So if the
data determine only a sum of parameters, one parameter of the sum is fitted and the others are held (structural
identifiability: Bellman & Astrom 1970, Math. Biosciences 7, here from the rank of the sensitivities).

In the formulas, D = K_t K_e + R (b_s + sigma m g r^2). This follows from eqs. 12 to 14 once the current has settled.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.constants import STEP_S
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, with_values
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

Values = Mapping[str, float]
"""Nominal parameter, or "effect.parameter", -> value, SI."""

_Rule = Callable[[Values], float]


@dataclass(frozen=True)
class Formula:
    """A combination of parameters.

    Attributes:
        text: the formula in the paper's symbols.
        value_at: function from the values of all parameters to the value of the combination; NaN: undefined.
    """

    name: str
    text: str
    unit: str
    value_at: _Rule


def loss(values: Values) -> float:
    """Returns a wheel's viscous plus rolling friction under the whole weight, in N m s/rad (eq. 13 and 14)."""
    rolling = values["mass"] * values["gravity"] * values["rolling_friction"] * values["wheel_radius"] ** 2
    return values["viscous_friction"] + rolling


def mean_inertia(values: Values, wheels: int = 2) -> float:
    """Returns the inertia per wheel, kg m^2, if the speeds of `wheels` coupled wheels change by the same amount."""
    return values["wheel_inertia"] + values["mass"] * values["wheel_radius"] ** 2 / wheels


def difference_inertia(values: Values) -> float:
    """Returns the inertia per wheel, kg m^2, if the speeds of two coupled wheels change by opposite amounts."""
    return values["wheel_inertia"] + values["yaw_inertia"] * (values["wheel_radius"] / values["half_track"]) ** 2 / 2


def wheel_speed_per_volt(values: Values) -> float:
    """Returns the steady wheel speed per volt, rad/s per V (eq. 12 and 14)."""
    return 1 / (values["emf_constant"] + values["resistance"] * loss(values) / values["torque_constant"])


def holding_voltage(values: Values, losses: float | None = None) -> float:
    """Returns each motor's voltage per unit of steady speed on level ground, V s/m, without air drag.

    `losses`: the friction of a wheel, N m s/rad; None: the result of `loss`.
    """
    lost = values["resistance"] * (loss(values) if losses is None else losses) / values["torque_constant"]
    return (values["emf_constant"] + lost) / values["wheel_radius"]


def _steady(p: Values) -> float:
    """Returns D of the module's docstring, for one wheel."""
    return p["torque_constant"] * p["emf_constant"] + p["resistance"] * loss(p)


def _wheel_gain(p: Values) -> float:
    return p["torque_constant"] / _steady(p)


def _turn(p: Values) -> float:
    return p["wheel_radius"] / p["half_track"]


def _time(wheels: int) -> _Rule:
    return lambda p: p["resistance"] * mean_inertia(p, wheels) / _steady(p)


# kV and kA are the coefficients in u = kS sgn(w) + kV w + kA dw/dt, for a wheel of a vehicle that drives straight.
def _volts_per_speed(p: Values) -> float:
    return _steady(p) / p["torque_constant"]


def _volts_per_acceleration(wheels: int) -> _Rule:
    return lambda p: p["resistance"] * mean_inertia(p, wheels) / p["torque_constant"]


def _in_volts(effect: str, torque: ParameterInfo) -> Formula:
    """Returns the formula for the motor voltage that balances a torque at the wheel."""

    def value_at(p: Values) -> float:
        return p.get(f"{effect}.{torque.name}", np.nan) * p["resistance"] / p["torque_constant"]

    return Formula(torque.in_volts, f"{effect} R / K_t", "V", value_at)


_TORQUES = tuple(_in_volts(e.name, info) for e in catalogue.effects() for info in e.parameters if info.in_volts)

FORMULAS: dict[str, tuple[Formula, ...]] = {
    "diff_drive": (
        Formula("speed per volt", "r K_t / D", "m/s/V", lambda p: p["wheel_radius"] * _wheel_gain(p)),
        Formula("wheel speed per volt", "K_t / D", "rad/s/V", _wheel_gain),
        Formula("straight time constant", "R (J + m r^2 / 2) / D", "s", _time(2)),
        Formula("spin rate per volt", "r K_t / (half_track D)", "rad/s/V", lambda p: _turn(p) * _wheel_gain(p)),
        Formula(
            "spin time constant",
            "R (J + J_z (r / half_track)^2 / 2) / D",
            "s",
            lambda p: p["resistance"] * difference_inertia(p) / _steady(p),
        ),
        Formula("kV", "D / K_t", "V s/rad", _volts_per_speed),
        Formula("kA", "R (J + m r^2 / 2) / K_t", "V s^2/rad", _volts_per_acceleration(2)),
        *_TORQUES,
    ),
    "motor": (
        Formula("speed per volt", "K_t / D", "rad/s/V", _wheel_gain),
        Formula("time constant", "R (J + m r^2) / D", "s", _time(1)),
        Formula("kV", "D / K_t", "V s/rad", _volts_per_speed),
        Formula("kA", "R (J + m r^2) / K_t", "V s^2/rad", _volts_per_acceleration(1)),
        *_TORQUES,
    ),
}

FORMULAS["skid_steer"] = tuple(formula for formula in FORMULAS["diff_drive"] if not formula.name.startswith("spin"))
"""A skid steer has no formula of a spin, because its contacts brake a spin more than its motors do."""


def _volts_per_torque(p: Values) -> float:
    return p["resistance"] / p["torque_constant"]


# A factor that multiplies a parameter: its formula as text, and the function that returns its value.
_Factor = tuple[str, _Rule]
_TORQUE: _Factor = ("R / K_t", _volts_per_torque)
_FORCE: _Factor = ("r R / (2 K_t)", lambda p: p["wheel_radius"] / 2 * _volts_per_torque(p))
_MOMENT: _Factor = (
    "r R / (2 half_track K_t)", lambda p: p["wheel_radius"] / (2 * p["half_track"]) * _volts_per_torque(p)
)  # fmt: skip
_SLIP: _Factor = ("K_t / (R r)", lambda p: 1 / (p["wheel_radius"] * _volts_per_torque(p)))
_BY_INERTIA: _Factor = ("1 / J", lambda p: 1 / p["wheel_inertia"])
_BY_MASS: _Factor = ("1 / m", lambda p: 1 / p["mass"])
_BY_YAW_INERTIA: _Factor = ("1 / J_z", lambda p: 1 / p["yaw_inertia"])

# (what the effect acts on, unit of its parameter) -> forms in which the parameter is reported: (name, unit, factor).
# The first form that the data determine is taken.
_FORMS: Mapping[tuple[str, str], tuple[tuple[str, str, _Factor], ...]] = {
    ("wheel", "N m"): (("voltage", "V", _TORQUE), ("angular acceleration", "rad/s^2", _BY_INERTIA)),
    ("wheel", "N m s/rad"): (("voltage per speed", "V s/rad", _TORQUE), ("inverse time constant", "1/s", _BY_INERTIA)),
    ("wheel", "m/(N s)"): (("slip speed per volt", "m/s/V", _SLIP),),
    ("body", "N"): (("voltage", "V", _FORCE), ("acceleration", "m/s^2", _BY_MASS)),
    ("body", "N m"): (("voltage", "V", _MOMENT), ("angular acceleration", "rad/s^2", _BY_YAW_INERTIA)),
    ("body", "N s/m"): (("voltage per speed", "V s/m", _FORCE), ("inverse time constant", "1/s", _BY_MASS)),
    ("body", "N m s/rad"): (
        ("voltage per yaw rate", "V s/rad", _MOMENT),
        ("inverse time constant", "1/s", _BY_YAW_INERTIA),
    ),
    ("body", "N s^2/m^2"): (("voltage per speed squared", "V s^2/m^2", _FORCE), ("inverse length", "1/m", _BY_MASS)),
    ("body", "kg"): (("share of the mass", "1", _BY_MASS),),
    ("body", "m/(N s)"): (("slip speed per volt", "m/s/V", _SLIP),),
}


def forms(name: str) -> Iterator[Formula]:
    """Yields the size `name` ("effect.parameter") times each of its factors; the data may determine such a product."""
    effect_name, _, parameter = name.partition(".")
    effect = catalogue.effect(effect_name)
    unit = next(info.unit for info in effect.parameters if info.name == parameter)
    for form, form_unit, (text, factor) in _FORMS.get((effect.acts_on, unit), ()):
        yield Formula(form, f"{parameter} {text}", form_unit, _scaled(name, factor))


def _scaled(name: str, factor: _Rule) -> _Rule:
    return lambda p: abs(p[name]) * factor(p)


ADDS_TO = {"wheel_inertia": "mass", "viscous_friction": "emf_constant", "rolling_friction": "emf_constant"}
"""Parameter -> its partner. Data identify only their sum, such as mass + 2 wheel_inertia / wheel_radius^2.

If the parameter is held and its partner is fitted, their ratio stays constant.
"""

_FITTED_FIRST = ("emf_constant", "mass", "yaw_inertia", "half_track", "wheel_radius", "wheel_inertia")
"""Where data determine only a sum, the first of these in the sum is fitted: it alone can give the sum any value."""

_CURVES_V = (3.0, 1.0), (6.0, 5.0)  # (left, right) V of two curves: at one voltage, friction looks like a smaller gain
_CURVE_S, _SAMPLES = 20.0, 60
_TOLD_APART = 1e-2  # limit: a smaller share of a signature outside the span of the others is numerical error


def signatures_of(model: Model, measured: Collection[str], stated: Collection[str]) -> dict[str, Array]:
    """Returns nominal parameter -> signature, (values,): the change of the signals if the parameter changes a little.

    The signals of two curves are simulated; a change is relative to the signal's rms. The first sample of a curve is
    one control step after the start. At the last sample, a vehicle of any size has reached its speed. A parameter
    without influence has a signature of zeros.

    Args:
        measured: names of the measured signals; only these count.
        stated: parameters to include although their role is "fixed".
    """
    after = np.geomspace(STEP_S, _CURVE_S, _SAMPLES)
    time = np.concatenate([[0.0], after, _CURVE_S + after])
    inputs = np.repeat(np.array(_CURVES_V), [_SAMPLES, _SAMPLES + 1], axis=0)
    inputs = inputs[:, : 1 if model.vehicle == "motor" else 2]
    values = {
        info.name: _beside(model.parameters[info.name], info)
        for info in catalogue.parameters()
        if info.name in model.parameters and (info.role != "fixed" or info.name in stated)
    }
    models = [model, *(with_values(model, {name: value}) for name, value in values.items())]
    run = OpenLoopRun(time=time, inputs=inputs)
    reference, *others = (simulated.outputs for simulated in plant.simulate([(changed, run) for changed in models]))
    signals = [name for name in reference if name in measured and name != "battery_voltage"]
    rms = {name: float(np.sqrt(np.nanmean(reference[name] ** 2))) or 1.0 for name in signals}
    return {
        name: np.array([np.nan_to_num(other[signal] - reference[signal]) / rms[signal] for signal in signals]).ravel()
        for name, other in zip(values, others, strict=True)
    }


def _beside(value: float, info: ParameterInfo) -> float:
    """Returns `value` changed by a thousandth, within the parameter's range; if `value` is 0, a tenth of the preset."""
    larger = 1.001 * value or 0.1 * info.preset
    return larger if larger <= info.maximum else 0.999 * value


def not_told_apart(signatures: Mapping[str, Array]) -> set[str]:
    """Returns the parameters whose signatures are linear combinations of others. No signature may be all 0."""
    basis, held = list[Array](), set()
    order = [name for name in _FITTED_FIRST if name in signatures]
    for name in dict.fromkeys((*order, *signatures)):
        rest = signatures[name] / np.linalg.norm(signatures[name])
        for direction in basis:
            rest = rest - (direction @ rest) * direction
        length = float(np.linalg.norm(rest))
        if length < _TOLD_APART:
            held.add(name)
        else:
            basis.append(rest / length)
    return held
