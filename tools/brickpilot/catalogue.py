"""The tables of the compiled plant: nominal parameters, effects and output signals, each with unit and range.

Each table is written once, in C: `sim_host/plant/model.c`, `sim_host/effects` and `sim_host/plant/output.c`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Literal, get_args

import numpy as np

from brickpilot.compiled import interface
from brickpilot.constants import VEHICLES

VEHICLE_CODES: dict[str, int] = {name: number for number, name in enumerate(VEHICLES)}
PROFILE_CODES = {"coupled": 0, "paper": 1}

Role = Literal["size", "shape", "place", "switch", "limit", "fixed"]
Prior = Literal["common", "usual", "rare"]


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of the nominal model or of an effect, SI: a row of the C table, whose header explains every field.

    Attributes:
        linear_unit: the unit where the input of a motor commands a force.
        odd: its sign changes when left and right are swapped.
        scan: sizes that a search tries one by one; empty: none.
        limits: the signal that does not go beyond this value; empty: none.
        arm_of, only_with: the parameter of the same effect whose lever arm this is, or that it adds to; empty: none.
        in_volts: the name of the voltage R / K_t times this torque; empty: there is none.
        variation: how the effect's law differs if this is not 0, worded to follow "but"; empty: it does not.
        mechanism: that of the law with this parameter alone; empty: the effect's mechanism.
        same_as: the nominal parameter that this one adds to; empty: none.
        says, says_below: what a value above and below 0 means, as a clause with {} for its size; empty: none.
        over_mean: the value is left less right, over their mean.
    """

    name: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    preset: float
    odd: bool
    role: Role
    linear_unit: str
    optional: bool
    trial: float
    scan: tuple[float, ...]
    limits: str
    arm_of: str
    only_with: str
    in_volts: str
    zero_if_unstated: bool
    variation: str
    mechanism: str
    same_as: str
    says: str = ""
    says_below: str = ""
    over_mean: bool = False


@dataclass(frozen=True)
class EffectInfo:
    """One effect of the library: a row of the C table, whose header explains every field.

    Attributes:
        acts_on: supply, drive, motor, gear, wheel, body, sensor or timing.
        words: a noun phrase, as in "The simulator lacks ...".
        summary: one sentence for a reader who does not know the name.
        mechanism: supply, drive, timing, motor, gear, bearing, tyre, body, floor or sensor.
        prior: how often the simulator of a wheeled robot or a motor lacks it, before any data.
        prior_reason: one sentence that says why.
        advice: one sentence on what to do if the first odd size is above 0; if it is below 0, left and right swap.
        motor_step: s, the longest motor step that still resolves the effect; 0: it sets no limit.
        carries_over: charge or heat that one run leaves changes the next.
        composed: a sum of terms that discovery composes, never a candidate of its own.
        variant_of: the better known effect of which this one is a variant; empty: none.
        variation: how its law differs from that of `variant_of`, worded to follow "but"; empty: none.
        contains: the effects whose laws this law becomes if some of its parameters are 0, one period a turn or equal to
            each other.
        made_of: the effects that together give this law, each with its own size.
        stated_by: how a data set states it: for an effect on sensors, a key of a rotation sensor's channel; for an
            effect on drives, how the names of the inputs begin; empty: in neither way.
    """

    name: str
    acts_on: str
    equation: str
    source: str
    parameters: tuple[ParameterInfo, ...]
    words: str
    summary: str
    mechanism: str
    prior: Prior
    prior_reason: str
    advice: str
    motor_step: float
    carries_over: bool
    composed: bool
    variant_of: str
    variation: str
    contains: tuple[str, ...]
    made_of: tuple[str, ...]
    stated_by: str

    @property
    def is_searched(self) -> bool:
        """Whether discovery searches for it: not if it is composed, or if the kind of the inputs states it."""
        return not self.composed and (not self.stated_by or self.acts_on == "sensor")


def _text(value: Any) -> str:
    if not value:
        return ""
    raw = interface()[0].string(value)
    return raw.decode() if isinstance(raw, bytes) else str(raw)


@cache
def _roles() -> dict[int, Role]:
    """Returns number -> name of the constants BP_ROLE_SIZE and so on in C."""
    library = interface()[1]
    return {getattr(library, f"BP_ROLE_{role.upper()}"): role for role in get_args(Role)}


@cache
def _priors() -> dict[int, Prior]:
    """Returns number -> name of the constants BP_PRIOR_COMMON and so on in C."""
    library = interface()[1]
    return {getattr(library, f"BP_PRIOR_{prior.upper()}"): prior for prior in get_args(Prior)}


def _same_named(row: Any, record: type) -> dict[str, Any]:
    """Returns those texts, numbers and flags of a row in C whose names are fields of `record`."""
    convert: dict[Any, Callable[[Any], Any]] = {"str": _text, "float": float, "bool": bool}
    return {one.name: convert[one.type](getattr(row, one.name)) for one in fields(record) if one.type in convert}


def _parameter(info: Any) -> ParameterInfo:
    found = _same_named(info, ParameterInfo)
    found["linear_unit"] = found["linear_unit"] or found["unit"]
    scan = tuple(np.geomspace(info.scan_from, info.scan_to, info.scan_count).tolist()) if info.scan_count else ()
    return ParameterInfo(**found, role=_roles()[info.role], scan=scan)


@cache
def parameters() -> tuple[ParameterInfo, ...]:
    """Returns the nominal parameters; the presets are those of the packaged robot."""
    library = interface()[1]
    found: list[ParameterInfo] = []
    while info := library.bp_parameter(len(found)):
        found.append(_parameter(info))
    return tuple(found)


def parameter(name: str) -> ParameterInfo:
    """Returns the nominal parameter of that name; raises StopIteration where there is none."""
    return next(info for info in parameters() if info.name == name)


@cache
def effects() -> tuple[EffectInfo, ...]:
    """Returns the effect library; the presets are clearly visible sizes."""
    library = interface()[1]
    found: list[EffectInfo] = []
    while info := library.bp_effect(len(found)):
        effect = EffectInfo(
            **_same_named(info, EffectInfo),
            parameters=tuple(_parameter(info.parameters[k]) for k in range(info.parameter_count)),
            prior=_priors()[info.prior],
            contains=tuple(_text(info.contains).split()),
            made_of=tuple(_text(info.made_of).split()),
        )
        found.append(effect)
    return tuple(found)


def effects_of(names: Container[str]) -> list[EffectInfo]:
    """Returns the effects that are in `names`, in the table's order."""
    return [effect for effect in effects() if effect.name in names]


@cache
def effect(name: str) -> EffectInfo:
    """Returns the effect of that name; raises KeyError where there is none."""
    found = effects_of((name,))
    if not found:
        raise KeyError(name)
    return found[0]


def family(name: str) -> str:
    """Returns the effect of which `name` is a variant, or `name` itself: the laws of a family differ in one respect.

    A name that is no effect, such as a kind of value that differs from run to run, is its own family.
    """
    return next((one.variant_of for one in effects_of((name,))), "") or name


def law(name: str, values: Mapping[str, float]) -> str:
    """Returns what the law of effect `name` with these parameters is called: "FAMILY, but DIFFERENCE and DIFFERENCE".

    Parameters that are absent from `values` count as 0.
    """
    info = effect(name)
    differences = [info.variation] if info.variant_of else []
    differences += [one.variation for one in info.parameters if one.variation and values.get(one.name, 0.0) != 0]
    return f"{family(name)}, but {' and '.join(differences)}" if differences else name


def mirrored(text: str) -> str:
    """Returns a text in which left and right have changed places."""
    return re.sub(r"\b(left|right)\b", lambda found: "right" if found[0] == "left" else "left", text)


def says(name: str, parameter: str, value: float) -> str:
    """Returns what a value of a parameter of effect `name` means, a clause with {} for its size; empty: no clause."""
    info = next(one for one in effect(name).parameters if one.name == parameter)
    if value >= 0.0:
        return info.says
    return mirrored(info.says) if info.odd else info.says_below


def advice(name: str, values: Mapping[str, float]) -> str:
    """Returns a sentence on what to do about effect `name` with these parameters."""
    info = effect(name)
    odd = [values.get(one.name, 0.0) for one in info.parameters if one.odd and one.role == "size"]
    return mirrored(info.advice) if odd and odd[0] < 0.0 else info.advice


def mechanism(name: str, values: Mapping[str, float]) -> str:
    """Returns the mechanism of effect `name` with these parameters: that of its only nonzero size if that has one."""
    info = effect(name)
    acting = [one for one in info.parameters if one.role == "size" and values.get(one.name, 0.0) != 0]
    return next((one.mechanism for one in acting if len(acting) == 1 and one.mechanism), info.mechanism)


@cache
def loads() -> frozenset[str]:
    """Returns the parameters, as "effect.parameter", whose lever arm is another parameter."""
    return frozenset(f"{one.name}.{info.arm_of}" for one in effects() for info in one.parameters if info.arm_of)


@cache
def output_table() -> tuple[tuple[str, str], ...]:
    library = interface()[1]
    found: list[tuple[str, str]] = []
    while name := library.bp_output_name(len(found)):
        found.append((_text(name), _text(library.bp_output_unit(len(found)))))
    return tuple(found)


def outputs() -> dict[str, str]:
    """Returns name -> unit of every output signal of all vehicles."""
    return dict(output_table())


def presets(vehicle: str) -> dict[str, float]:
    """Returns the preset of every nominal parameter that a vehicle has; a motor has no mass or wheel."""
    return dict(_presets(vehicle))


@cache
def _presets(vehicle: str) -> dict[str, float]:
    ffi, library = interface()
    built = ffi.gc(library.bp_model_new(VEHICLE_CODES[vehicle], 0), library.bp_model_free)
    value = ffi.new("double *")
    found = {}
    for info in parameters():
        if library.bp_model_get(built, info.name.encode(), value) == 0:
            found[info.name] = value[0]
    return found
