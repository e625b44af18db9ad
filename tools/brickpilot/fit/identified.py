"""The size of an effect in what the data identify, where its own unit is not identifiable.

Without a mass or a motor constant no torque is known in N m. The voltage that makes up for it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from brickpilot import catalogue
from brickpilot.fit.combinations import Formula, Values

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
