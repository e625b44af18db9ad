"""Simulates whether a law, with some of its parameters 0 or equal to each other, acts as another law."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

import numpy as np
from brickpilot import catalogue
from brickpilot.catalogue import EffectInfo, ParameterInfo
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, Simulated

DRIVE = [(7, 7), (7, 3), (-4, 6), (np.nan, 2), (0, 0), (-3, -6), (1, 0.3), (np.nan, np.nan)]
"""Left and right voltages, V: curves, stops, reversal, and floating motors."""


@cache
def machines() -> tuple[Model, ...]:
    """Returns a robot of each profile, a motor with a voltage as input, and a motor with a force as input."""
    motor = {**catalogue.presets("motor"), "mass": 0.5, "wheel_radius": 0.03, "wheel_inertia": 1e-4}
    axis = {**catalogue.presets("motor"), "mass": 100.0, "force_per_volt": 50.0}
    return (
        rcx(),
        dataclasses.replace(rcx(), profile="paper"),
        Model("motor", "motor", "coupled", motor),
        Model("axis", "motor", "coupled", axis),
    )


def is_contained(other: EffectInfo, law: EffectInfo) -> bool:
    """Returns whether `law`, with some parameters 0 or equal, acts as `other` on every machine on which `other` acts.

    If `law` is a load, the load's mass is taken from the body, because a load may stand for part of the vehicle's own
    mass and inertia.
    """
    given = {one.name: _visible(one) for one in other.parameters}
    if len(law.parameters) <= len(other.parameters) or _is_off(other.name, given):
        return False
    if any(one.arm_of for one in law.parameters):
        return all(_is_load(machine, other.name, given, law.name) for machine in machines())
    return any(_same(other.name, given, law.name, values) for values in _special_cases(law, other, given))


def is_made_of(law: EffectInfo, others: Sequence[EffectInfo]) -> bool:
    """Returns whether `law`, of which only the first parameter is set, acts as all `others` together.

    The first parameter of each other law is set, up to its sign, to the same value or to half of this value.
    """
    size = _visible(law.parameters[0])
    alone = (law.name, ((law.parameters[0].name, size),))
    sizes = [[sign * share * size for share in (0.5, 1.0) for sign in (1, -1)] for _ in others]

    def is_it(values: Sequence[float]) -> bool:
        together = [(one.name, ((one.parameters[0].name, value),)) for one, value in zip(others, values, strict=True)]
        return all(_alike(_flown(machine, alone), _flown(machine, *together)) for machine in machines())

    possible = [one for one in itertools.product(*sizes) if _in_range(others, one)]
    return any(is_it(values) for values in possible)


def _in_range(effects: Sequence[EffectInfo], values: Sequence[float]) -> bool:
    return all(one.parameters[0].minimum <= value for one, value in zip(effects, values, strict=True))


def _is_load(machine: Model, other: str, given: Mapping[str, float], law: str) -> bool:
    """Returns whether half the body's mass, carried as the load `law` at twice the arm of `other`, acts as `other`."""
    if machine.vehicle == "motor":
        return _alike(_flown(machine), _flown(machine, (other, tuple(given.items()))))
    arm = {name: 2 * given.get(name, 0.0) for name in ("forward", "right")}
    mass, inertia = machine.parameters["mass"], machine.parameters["yaw_inertia"]
    turned = inertia - mass / 4 * (arm["forward"] ** 2 + arm["right"] ** 2)
    lighter = {**machine.parameters, "mass": mass / 2, "yaw_inertia": turned}
    body = dataclasses.replace(machine, name=f"{machine.name}, lighter for {other}", parameters=lighter)
    return _alike(
        _flown(machine, (other, tuple(given.items()))), _flown(body, (law, (("mass", mass / 2), *arm.items())))
    )


def _visible(one: ParameterInfo) -> float:
    return one.preset or one.trial or (0.0 if one.role == "switch" else min(0.1, one.maximum))


def _special_cases(law: EffectInfo, other: EffectInfo, given: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Yields parameters of `law`. Each is 0 or a value of `other` in the same unit, or the preset if none is in range.

    An order may also be 1 (one period per turn). An angle may also be pi/2 minus an angle of `other`, for a
    sine in place of a cosine.
    """
    choices = []
    for one in law.parameters:
        own = [(given[two.name], two.name) for two in other.parameters if two.unit == one.unit]
        able = [(0.0, ""), *own, *((math.pi / 2 - value, name) for value, name in own if one.unit == "rad")]
        able += [(1.0, "")] if one.name == "order" else []
        choices.append([each for each in able if one.minimum <= each[0] <= one.maximum] or [(one.preset, "")])
    wanted = {name for name, value in given.items() if value != 0}
    for chosen in itertools.product(*(dict.fromkeys(able) for able in choices)):
        if wanted <= {name for _, name in chosen}:
            yield {one.name: value for one, (value, _) in zip(law.parameters, chosen, strict=True)}


def _same(other: str, given: Mapping[str, float], law: str, values: Mapping[str, float]) -> bool:
    effects = ((other, tuple(given.items())), (law, tuple(values.items())))
    flown = ((_flown(machine), *(_flown(machine, one) for one in effects)) for machine in machines())
    return all(_alike(one, two) for plain, one, two in flown if not _alike(plain, one))


def _is_off(name: str, given: Mapping[str, float]) -> bool:
    return all(_alike(_flown(machine), _flown(machine, (name, tuple(given.items())))) for machine in machines())


def _alike(one: Simulated, other: Simulated) -> bool:
    return all(
        np.allclose(one.outputs[name], other.outputs[name], rtol=1e-9, atol=1e-12, equal_nan=True)
        for name in one.outputs
    )


_KEPT: dict[tuple[object, ...], Simulated] = {}


def _flown(machine: Model, *effects: tuple[str, tuple[tuple[str, float], ...]]) -> Simulated:
    """Returns `machine` with only these effects, simulated over DRIVE from a start with some age and charge."""
    key = (machine.name, machine.profile, effects)
    if key not in _KEPT:
        model = dataclasses.replace(machine, effects={name: dict(values) for name, values in effects})
        inputs = np.repeat(np.array(DRIVE, dtype=float), 30, axis=0)
        if machine.vehicle == "motor":
            inputs = inputs[:, :1]
        start = {"age": 20.0, "charge": 3.0, "surge": 0.1 if machine.vehicle == "diff_drive" else 0.0}
        run = OpenLoopRun(0.01 * np.arange(len(inputs)), inputs, start, motor_step=0.001)
        _KEPT[key] = plant.simulate([(model, run)])[0]
    return _KEPT[key]
