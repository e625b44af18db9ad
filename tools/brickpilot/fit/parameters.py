"""The parameters of a fit: which are free, their bounds, their priors, and the coordinates of the search."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.dataset import Dataset, Nominal
from brickpilot.errors import InputError
from brickpilot.vehicle.combinations import ADDS_TO, not_told_apart, signatures_of
from brickpilot.vehicle.model import Model, of_dataset, with_values

Array = NDArray[np.float64]

WIDE_SD = 3.0
"""Prior sd, for intervals only, of the logarithm of a parameter that is not stated: a factor of e^3 = 20 up or down."""

DECADE = 10.0
"""Prior sd of an effect's parameter, as a factor on the parameter's usual size on the vehicle."""

# Limit: if the relative sd of a stated value is smaller, the parameter is fixed. Its prior would outweigh all data.
_EXACT = 1e-6

# Value that stands for zero in a logarithmic coordinate, which has no zero; as a share of `Free.size`.
_FLOOR = 1e-9

# `Free.reach` of parameters that set a phase over a path or a time: a small change adds up to whole turns.
_TURNING = {"order": 1e-2, "frequency": 1e-2, "wavelength": 1e-2}


@dataclass(frozen=True)
class Free:
    """One free parameter.

    Attributes:
        name: "mass", "effect.parameter", or "kind@run" for a value of a single run.
        known: the parameter's value and sd in the data set; None: the data set states no value, so the prior is wide.
        unit: unit of the parameter's coordinate, SI; 0: `size` chooses the unit.
        keeps_sign: whether the coordinate is log(value / `unit`), so that the value keeps the sign of `unit`. If the
            data do not determine a vehicle's mass, the cost has a valley along which mass and forces grow together.
            This valley is straight only in logarithms.
        centred: for a value of a single run: whether a prior pulls the mean of this value over all runs to 0.
        natural: a usual size on this vehicle, SI, of a parameter that is not stated; 0: no prior. The prior has mean 0
            and sd 10 `natural`; if the coordinate is a logarithm, it has mean log(`natural`) and sd log(10).
    """

    name: str
    info: ParameterInfo
    known: Nominal | None
    unit: float = 0.0
    keeps_sign: bool = False
    natural: float = 0.0
    centred: bool = False

    @cached_property
    def effect(self) -> tuple[str, str] | None:
        head, dot, tail = self.name.partition("@" if "@" in self.name else ".")
        return (head, tail) if dot else None

    @cached_property
    def run(self) -> str:
        """The run to which the value belongs; empty for a parameter of the whole model."""
        return self.name.partition("@")[2]

    @property
    def signed(self) -> bool:
        return self.info.minimum < 0

    @cached_property
    def size(self) -> float:
        """The unit of the coordinate: the first of `unit`, the stated value, the preset and 1 that is not 0."""
        stated = abs(self.known.value) if self.known is not None else 0.0
        return abs(self.unit) or stated or abs(self.info.preset) or 1.0

    @property
    def reach(self) -> float:
        """The change of the coordinate up to which the simulated signals change about linearly."""
        return _TURNING.get(self.info.name, 1.0) if self.effect else 1.0

    @cached_property
    def load(self) -> str:
        """If this parameter is the lever arm of a load: the load, as "effect.parameter". Otherwise empty.

        Masses and torques are linear in a load and in its moment (load times arm), but not in the arm. So the moment is
        the coordinate. With the arm as coordinate, a descent sticks in a curved valley if mass and motors are free.
        """
        return f"{self.name.partition('.')[0]}.{self.info.arm_of}" if self.info.arm_of else ""

    @cached_property
    def _straight(self) -> bool:
        return self.signed or self.name in catalogue.loads()

    def away(self, coordinate: float) -> float | None:
        """Returns the distance, in prior sd, of a coordinate from the prior's centre; None: there is no prior."""
        if self.known is not None and self.known.sd is not None:
            return (self.to_value(coordinate) - self.known.value) / self.known.sd
        if self.natural == 0.0:
            return None
        if self._straight or self.keeps_sign:
            return self.to_value(coordinate) / (DECADE * self.natural)
        return (coordinate - self.to_coordinate(self.natural)) / math.log(DECADE)

    def to_coordinate(self, value: float) -> float:
        if self.keeps_sign:
            return math.log(max(value / self.unit, _FLOOR))
        return value / self.size if self._straight else math.log(max(value, self.size * _FLOOR))

    def to_value(self, coordinate: float) -> float:
        if self.keeps_sign:
            value = self.unit * math.exp(coordinate)
        else:
            value = coordinate * self.size if self._straight else math.exp(coordinate)
        return min(max(value, self.info.minimum), self.info.maximum)

    def bounds(self) -> tuple[float, float]:
        ends = self.to_coordinate(self.info.minimum), self.to_coordinate(self.info.maximum)
        return min(ends), max(ends)


@dataclass(frozen=True)
class Plan:
    """The parameters of a fit.

    Attributes:
        model: every fixed value, and the start of every free value.
        notes: sentences on choices that a user should know of.
        held: parameters that the measured signals cannot tell from the free parameters. They have no coordinates,
            because a fit would drift. Their values are as uncertain as those of the free parameters.
    """

    model: Model
    free: tuple[Free, ...]
    notes: tuple[str, ...]
    held: tuple[Free, ...] = ()

    @property
    def uncertain(self) -> tuple[Free, ...]:
        """Every parameter with an uncertain value: the free and the held parameters."""
        return (*self.free, *self.held)

    def joined(self, model: Model, added: Sequence[Free]) -> Plan:
        """Returns the plan with another model, and with the free parameters `added` at the end."""
        return dataclasses.replace(self, model=model, free=(*self.free, *added), notes=())

    def at(self, coordinates: Array) -> Model:
        """Returns the model at a point of the search."""
        values = {free.name: free.to_value(float(x)) for free, x in zip(self.free, coordinates, strict=True)}
        for free, x in zip(self.free, coordinates, strict=True):
            if (load := values.get(free.load, 0.0)) > 0:
                values[free.name] = free.to_value(float(x) / load)
        start = self.model.parameters
        for held in self.held:
            if (other := ADDS_TO.get(held.name)) in values:
                share = start[held.name] * values[other] / start[other]
                values[held.name] = min(max(share, held.info.minimum), held.info.maximum)
        return with_values(self.model, values)

    def start(self) -> Array:
        """Returns the coordinates of `model`."""
        values = {free.name: value_of(self.model, free.name) for free in self.free}
        loads = np.array([values.get(free.load, 0.0) or 1.0 for free in self.free])
        return loads * [free.to_coordinate(values[free.name]) for free in self.free]


def value_of(model: Model, name: str) -> float:
    """Returns the value of "mass", of "effect.parameter" or, for a value of a single run, of "kind@run"."""
    if "@" in name:
        kind, _, run = name.partition("@")
        return float(model.by_run[kind][run])
    effect, dot, parameter = name.partition(".")
    return float(model.effects[effect][parameter] if dot else model.parameters[name])


def values_of(model: Model) -> dict[str, float]:
    """Returns name -> value for all values of a model; the names are those of `value_of`."""
    values = {f"{kind}@{run}": value for kind, table in model.by_run.items() for run, value in table.items()}
    values |= {f"{effect}.{name}": value for effect, table in model.effects.items() for name, value in table.items()}
    return values | dict(model.parameters)


def plan(dataset: Dataset, *, effects: Sequence[str] = (), free: Sequence[str] = ()) -> Plan:
    """Decides which parameters are fitted.

    A plain value of [nominal] is fixed, and so is {value, sd} with an sd below 1e-6 of the value. Any other {value, sd}
    is fitted with this prior. An absent parameter of this vehicle's equations is fitted with a wide prior. It is left
    out of the fit (`Plan.held`) if the measured signals cannot tell it from other absent parameters.

    Args:
        effects: effects to switch on; all their parameters are free, except switches (see `settings`).
        free: nominal parameters to fit although the data set gives them as plain values.

    Raises:
        InputError: the plant does not know an effect or a name in `free`, or a name in `free` cannot be fitted.
    """
    infos = {info.name: info for info in catalogue.parameters()}
    effect_infos = {effect.name: effect for effect in catalogue.effects()}
    for name in effects:
        if name not in effect_infos:
            raise InputError(f"no such effect; known: {', '.join(effect_infos)}", field=name)
    for name in free:
        if name not in infos or infos[name].role == "fixed":
            raise InputError("is not a nominal parameter that can be fitted", field=name)
    model = of_dataset(dataset, effects)
    infos = {name: info for name, info in infos.items() if name in model.parameters}
    stated = {name: table for name, table in model.effects.items() if name in dataset.nominal_effects}
    signatures = signatures_of(dataclasses.replace(model, effects=stated), dataset.signals, dataset.nominal)
    entering = {name for name, one in signatures.items() if one.any()}
    chosen = [
        Free(n, info, dataset.nominal.get(n))
        for n, info in infos.items()
        if n in entering and _is_free(info, model, dataset, free)
    ]
    held = not_told_apart({one.name: signatures[one.name] for one in chosen if one.known is None})
    fitted = [one for one in chosen if one.name not in held]
    for name in model.effects:
        for info in effect_infos[name].parameters:
            known = dataset.nominal_effects.get(name, {}).get(info.name)
            if info.role != "switch" and (known is None or _is_open(known, info)):
                fitted.append(Free(f"{name}.{info.name}", info, known))
    absent = [n for n, v in model.parameters.items() if v == 0 and n in entering and n not in dataset.nominal]
    notes = (f"Not given, so set to 0: {', '.join(absent)}.",) if absent else ()
    return Plan(model, tuple(fitted), notes, tuple(one for one in chosen if one.name in held))


def stated_beside(chosen: Plan, model: Model, dataset: Dataset) -> tuple[Free, ...]:
    """Returns the nominal parameters with a stated sd that influence the signals only through the effects of `model`.

    They are not fitted, but their sd widens an effect's interval, because the effect's size may be relative to them.
    The loss of a drive, for example, is relative to the battery's voltage, which has no influence without this effect.
    """
    known = {one.name for one in chosen.uncertain}
    infos = {info.name: info for info in catalogue.parameters()}
    signatures = signatures_of(model, dataset.signals, dataset.nominal) if model.effects else {}
    return tuple(
        Free(name, infos[name], dataset.nominal[name])
        for name, one in signatures.items()
        if name not in known and name in dataset.nominal and one.any()
        if _is_open(dataset.nominal[name], infos[name])
    )


def settings(chosen: Plan, dataset: Dataset) -> list[Plan]:
    """Returns copies of the plan, one for each combination of switch positions that the data set does not state."""
    switches = {
        f"{name}.{info.name}": (info.minimum, info.maximum)
        for name in chosen.model.effects
        for info in catalogue.effect(name).parameters
        if info.role == "switch" and info.name not in dataset.nominal_effects.get(name, {})
    }
    each = [dict(zip(switches, values, strict=True)) for values in itertools.product(*switches.values())]
    return [dataclasses.replace(chosen, model=with_values(chosen.model, one)) for one in each]


def _is_open(known: Nominal, info: ParameterInfo) -> bool:
    """Whether a stated value is fitted, because it has an sd that is not negligible."""
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
