"""The effects that may be missing from a model, each with the parameters that are fitted."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from brickpilot import catalogue
from brickpilot.catalogue import EffectInfo, ParameterInfo
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

_COMMAND = "voltage"  # the limited signal that is a command, not a reading


@dataclass(frozen=True)
class Candidate:
    """What a search may add to a model: an effect with some of its parameters free. The others stay at `fixed`."""

    effect: str
    free: tuple[str, ...]
    fixed: Mapping[str, float] = field(hash=False)

    @property
    def is_periodic(self) -> bool:
        """Whether it repeats with the angle of a wheel, at an order that is fitted."""
        return "order" in self.free

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        """Returns `base` with this effect at `values`. Its free parameters come last."""
        infos = catalogue.effect(self.effect).parameters
        table = {one.name: values.get(one.name, self.fixed.get(one.name, one.preset)) for one in infos}
        model = dataclasses.replace(base.model, effects={**base.model.effects, self.effect: table})
        added = tuple(Free(f"{self.effect}.{one.name}", one, None) for one in infos if one.name in self.free)
        return Plan(model, (*base.free, *added), ())

    def removed_from(self, model: Model) -> Model:
        """Returns `model` without what `starting` added."""
        effects = {name: table for name, table in model.effects.items() if name != self.effect}
        return dataclasses.replace(model, effects=effects)

    def penalty(self, beside: Sequence[Candidate], cost: float) -> float:
        """Returns the penalty beside that for its parameters, in a model that leaves `cost`: none for a known law.

        Args:
            beside: what was added to the model before it.
        """
        return 0.0


def candidates(base: Model, measured: Collection[str] | None = None) -> list[Candidate]:
    """Returns every effect that `base` lacks, once for each set of parameters worth freeing.

    Args:
        measured: the signals that are compared; an effect on sensors that gave none of them is no candidate. None: all.
    """
    found = []
    for info in catalogue.effects():
        if info.name in base.effects or info.composed or (info.acts_on == "supply" and _has_current_loop(base)):
            continue
        if info.acts_on == "sensor" and measured is not None and not readings_of(info.name, base.vehicle) & {*measured}:
            continue
        usable = [one for one in info.parameters if _adds_something(one, base)]
        for free in _sets_of_parameters(usable):
            off = {one.name: one.preset if one.role == "shape" else 0.0 for one in usable if one.name not in free}
            found.append(Candidate(info.name, free, off))
    return found


def _adds_something(one: ParameterInfo, base: Model) -> bool:
    """Returns whether a parameter can say more than `base` does: it has two sides, and nothing that does the same."""
    sided = base.vehicle == "diff_drive" or not one.odd
    return sided and not (one.same_as and base.parameters.get(one.same_as, 0.0) != 0)


@cache
def readings_of(effect: str, vehicle: str) -> frozenset[str]:
    """Returns the signals that an effect on sensors changes, from a lively run of the compiled plant with it."""
    time = np.arange(0.0, 1.0, 0.01)
    wave = 9.0 * np.sign(np.sin(9.0 * time))
    inputs = np.column_stack([wave, -0.3 * wave])[:, : 1 if vehicle == "motor" else 2]
    fast = State(surge=0.5, yaw_rate=20.0, wheel_speed=(40.0, 10.0), wheel_angle=(2.0, 1.0))
    table = {one.name: one.preset or one.trial for one in catalogue.effect(effect).parameters}
    with_metres = catalogue.presets(vehicle) | {"wheel_radius": catalogue.parameter("wheel_radius").preset}
    base = Model("lively", vehicle, "coupled", with_metres)
    run = OpenLoopRun(time=time, inputs=inputs, initial=fast)
    models = (base, dataclasses.replace(base, effects={effect: table}))
    plain, changed = (one.outputs for one in plant.simulate([(model, run) for model in models]))
    return frozenset(name for name in plain.keys() & changed.keys() if np.any(plain[name] != changed[name]))


def _has_current_loop(base: Model) -> bool:
    """Returns whether the drive commands a force or a torque: its current loop makes up for the supply."""
    return base.parameters.get("force_per_volt", 0) + base.parameters.get("torque_per_volt", 0) != 0


def _sets_of_parameters(usable: list[ParameterInfo]) -> list[tuple[str, ...]]:
    """Returns the sets of an effect's parameters that are freed together.

    An optional parameter is freed beside the others, and alone where it needs none of them. Where one effect holds
    three laws, each is tried alone.
    """
    main = tuple(one.name for one in usable if not one.optional and one.role != "switch")
    optional = [one.name for one in usable if one.optional]
    signed = all(is_signed(one) for one in usable)
    sets = [main, *((name,) for name in optional if signed)]
    if not signed or len(usable) == 2:
        sets += [(*main, name) for name in optional]
    return list(dict.fromkeys(one for one in sets if one))


def sizes_of(candidate: Candidate) -> list[str]:
    """Returns its free parameters that say how large it is and may be zero."""
    infos = {one.name: one for one in catalogue.effect(candidate.effect).parameters}
    return [name for name in candidate.free if infos[name].role != "shape" and infos[name].minimum <= 0]


def is_signed(one: ParameterInfo) -> bool:
    """Returns whether a parameter is a size that may be negative."""
    return one.minimum < 0 and one.role != "shape"


def read_limits(candidate: Candidate) -> list[tuple[str, str]]:
    """Returns the parameters of a candidate that limit what a sensor reads, each with the signal."""
    infos = catalogue.effect(candidate.effect).parameters
    return [(one.name, one.limits) for one in infos if one.limits not in ("", _COMMAND)]


def limit_of(candidate: Candidate) -> ParameterInfo | None:
    """Returns the parameter that is the end of a range; None if the effect has none."""
    return next((one for one in catalogue.effect(candidate.effect).parameters if one.role == "limit"), None)


def scanned_parameter(candidate: Candidate) -> ParameterInfo | None:
    """Returns the parameter whose sizes are tried one by one, because the effect comes and goes with it; or None."""
    return next((one for one in catalogue.effect(candidate.effect).parameters if one.scan), None)


def switch_settings(effect: EffectInfo) -> list[dict[str, float]]:
    """Returns the settings of an effect's switches that are tried: all off, and each one on alone."""
    return [{}, *({one.name: one.maximum} for one in effect.parameters if one.role == "switch")]
