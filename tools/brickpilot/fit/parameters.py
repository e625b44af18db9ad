"""The parameters of a fit: which are free, their bounds, what is known of them, and the coordinates they move in."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.dataset import Dataset, Nominal
from brickpilot.errors import InputError
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

WIDE_SD = 3.0
"""Of a parameter nobody said anything about, in its logarithm: a factor of e^3 = 20 each way. For intervals alone."""

# An sd below this share of the value says that it is known; a prior so narrow would be all that a fit sees.
_EXACT = 1e-6

# A parameter that may be zero moves in its logarithm too; this far below its natural size it has no effect.
_FLOOR = 1e-9

# What is a phase when multiplied by the way gone: a hundredth of it is turns after a few revolutions.
_TURNING = {"order": 1e-2}


@dataclass(frozen=True)
class Free:
    """One free parameter.

    Attributes:
        name: "mass", or "effect.parameter".
        known: what the data set says of it; None: nothing, and the prior is wide.
    """

    name: str
    info: ParameterInfo
    known: Nominal | None

    @property
    def effect(self) -> tuple[str, str] | None:
        head, dot, tail = self.name.partition(".")
        return (head, tail) if dot else None

    @property
    def signed(self) -> bool:
        return self.info.minimum < 0

    @property
    def size(self) -> float:
        """What the coordinate is measured in: the stated value, else the preset, else 1."""
        stated = abs(self.known.value) if self.known is not None else 0.0
        return stated or abs(self.info.preset) or 1.0

    @property
    def reach(self) -> float:
        """A change of the coordinate beyond which a signal is another one."""
        return _TURNING.get(self.info.name, 1.0) if self.effect else 1.0

    @property
    def load(self) -> str:
        """The parameter that this one is the lever arm of, as "effect.parameter"; empty: none.

        Masses and torques are linear in a load and its moments, not in its arms. In other coordinates the valley of a
        fit that also moves the vehicle's own mass and motors is curved, and a descent creeps along it without an end.
        """
        return f"{self.name.partition('.')[0]}.{self.info.arm_of}" if self.info.arm_of else ""

    @property
    def _straight(self) -> bool:
        return self.signed or self.name in catalogue.loads()

    def to_coordinate(self, value: float) -> float:
        return value / self.size if self._straight else math.log(max(value, self.size * _FLOOR))

    def to_value(self, coordinate: float) -> float:
        value = coordinate * self.size if self._straight else math.exp(coordinate)
        return min(max(value, self.info.minimum), self.info.maximum)

    def bounds(self) -> tuple[float, float]:
        return self.to_coordinate(self.info.minimum), self.to_coordinate(self.info.maximum)


@dataclass(frozen=True)
class Plan:
    """What is fitted: `model` holds every fixed value and every start; `notes`: choices a user should know of."""

    model: Model
    free: tuple[Free, ...]
    notes: tuple[str, ...]

    def at(self, coordinates: Array) -> Model:
        values = {free.name: free.to_value(float(x)) for free, x in zip(self.free, coordinates, strict=True)}
        for free, x in zip(self.free, coordinates, strict=True):
            if (load := values.get(free.load, 0.0)) > 0:
                values[free.name] = free.to_value(float(x) / load)
        return with_values(self.model, values)

    def start(self) -> Array:
        values = {free.name: value_of(self.model, free.name) for free in self.free}
        loads = np.array([values.get(free.load, 0.0) or 1.0 for free in self.free])
        return loads * [free.to_coordinate(values[free.name]) for free in self.free]


def value_of(model: Model, name: str) -> float:
    effect, dot, parameter = name.partition(".")
    return float(model.effects[effect][parameter] if dot else model.parameters[name])


def with_values(model: Model, values: Mapping[str, float]) -> Model:
    """A copy of `model` with some nominal ("mass") or effect ("effect.parameter") values replaced."""
    parameters = dict(model.parameters)
    effects = {name: dict(table) for name, table in model.effects.items()}
    for name, value in values.items():
        effect, dot, parameter = name.partition(".")
        if dot:
            effects[effect][parameter] = value
        else:
            parameters[name] = value
    return dataclasses.replace(model, parameters=parameters, effects=effects)


def plan(dataset: Dataset, *, effects: Sequence[str] = (), free: Sequence[str] = ()) -> Plan:
    """Decides what is fitted.

    A plain value of [nominal] is fixed, and so is {value, sd} with an sd below 1e-6 of the value; else {value, sd} is
    fitted with that prior. What is absent and enters this vehicle's equations is fitted with a wide one. `effects` are
    switched on with all their parameters free. `free` names nominal parameters to be fitted although the data set gives
    them as plain values.

    Raises:
        InputError: an effect or a name in `free` that the plant does not know or that cannot be fitted.
    """
    infos = {info.name: info for info in catalogue.parameters()}
    effect_infos = {effect.name: effect for effect in catalogue.effects()}
    for name in effects:
        if name not in effect_infos:
            raise InputError(f"no such effect; known: {', '.join(effect_infos)}", field=name)
    for name in free:
        if name not in infos or infos[name].role == "fixed":
            raise InputError("no nominal parameter that can be fitted", field=name)
    values = _absent_values(dataset, infos) | {name: nominal.value for name, nominal in dataset.nominal.items()}
    stated = dataset.nominal_effects
    tables = {
        name: {
            info.name: stated.get(name, {}).get(info.name, Nominal(info.preset)).value
            for info in effect_infos[name].parameters
        }
        for name in dict.fromkeys([*stated, *effects])
    }
    model = Model(name=dataset.name, vehicle=dataset.vehicle, profile="coupled", parameters=values, effects=tables)
    entering = _entering(model, dataset)
    chosen = [
        Free(n, info, dataset.nominal.get(n))
        for n, info in infos.items()
        if n in entering and _is_free(info, model, dataset, free)
    ]
    for name in tables:
        for info in effect_infos[name].parameters:
            known = stated.get(name, {}).get(info.name)
            if known is None or _is_open(known, info):
                chosen.append(Free(f"{name}.{info.name}", info, known))
    return Plan(model, tuple(chosen), _notes(dataset, model, entering))


def _absent_values(dataset: Dataset, infos: Mapping[str, ParameterInfo]) -> dict[str, float]:
    """A vehicle nobody said anything about. A motor has one load: a mass where force drives it, else an inertia."""
    absent = [info.name for info in infos.values() if info.zero_if_unstated]
    values = catalogue.presets(dataset.vehicle) | dict.fromkeys(absent, 0.0)
    if dataset.nominal.get("force_per_volt", Nominal(0.0)).value > 0:
        values |= {"mass": infos["mass"].preset, "wheel_inertia": 0.0}
    elif dataset.vehicle == "motor" and {"position", "velocity", "force"} & dataset.signals.keys():
        values["wheel_radius"] = infos["wheel_radius"].preset
    return values


def _is_open(known: Nominal, info: ParameterInfo) -> bool:
    """Whether a stated value is known with an sd that leaves a fit something to do."""
    size = abs(known.value) or abs(info.preset) or 1.0
    return known.sd is not None and known.sd > _EXACT * size


def _is_free(info: ParameterInfo, model: Model, dataset: Dataset, asked: Sequence[str]) -> bool:
    name = info.name
    if name in asked:
        return True
    known = dataset.nominal.get(name)
    if known is not None:
        return _is_open(known, info)
    if name == "inductance":
        return any(signal.startswith("current") for signal in dataset.signals)
    return info.role != "fixed" and name != "battery_voltage" and model.parameters[name] != 0


def _notes(dataset: Dataset, model: Model, entering: set[str]) -> tuple[str, ...]:
    absent = [n for n, v in model.parameters.items() if v == 0 and n in entering and n not in dataset.nominal]
    return (f"Not given and taken to be 0: {', '.join(absent)}.",) if absent else ()


def _beside(value: float, info: ParameterInfo) -> float:
    """Another value, a tenth away, that is physical too."""
    larger = 1.1 * value or 0.1 * info.preset
    return larger if larger <= info.maximum else 0.9 * value


def _entering(model: Model, dataset: Dataset) -> set[str]:
    """The nominal parameters that change anything measured, in a short lopsided manoeuvre of such a vehicle."""
    time = np.linspace(0.0, 0.3, 31)
    inputs = np.tile(np.array([[3.0, 1.0]])[:, : 1 if model.vehicle == "motor" else 2], (len(time), 1))
    base = dataclasses.replace(model, effects={})
    names = {
        info.name: _beside(base.parameters[info.name], info)
        for info in catalogue.parameters()
        if info.role != "fixed" or info.name in dataset.nominal
    }
    changed = [with_values(base, {name: value}) for name, value in names.items()]
    run = OpenLoopRun(time=time, inputs=inputs)
    reference, *others = plant.simulate([(one, run) for one in [base, *changed]], threads=1)
    judged = [name for name in reference.outputs if name in dataset.signals and name != "battery_voltage"]
    return {
        name
        for name, other in zip(names, others, strict=True)
        if any(not np.array_equal(other.outputs[o], reference.outputs[o], equal_nan=True) for o in judged)
    }
