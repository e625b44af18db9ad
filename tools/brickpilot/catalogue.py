"""The tables of the compiled plant: nominal parameters, effects and output signals, each with unit and range.

The tables exist only in C: `sim_host/plant/model.c`, `sim_host/effects` and `sim_host/plant/output.c`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from itertools import count, takewhile
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
        linear_unit: the parameter's unit for a motor whose input commands a force.
        odd: whether the value changes its sign if left and right are swapped.
        scan: sizes that a search tries one by one; empty: none.
        limits: the signal that this value limits; empty: no signal.
        arm_of: the parameter of the same effect that is the load on this lever arm; empty: this is no lever arm.
        only_with: the parameter of the same effect to which this parameter adds; empty: no parameter.
        in_volts: for a torque at the wheel, the name of the voltage `torque * R / K_t`; empty: no such torque.
        variation: how the effect's law differs if this value is not 0, as words after "but"; empty: no difference.
        mechanism: the mechanism if only this parameter is not 0; empty: the effect's mechanism.
        same_as: the nominal parameter to which this parameter adds; empty: none.
        says: the meaning of a value above 0, as a clause with {} for the value's size; empty: no clause.
        says_below: the same for a value below 0; not used if `odd`.
        over_mean: whether the value is `(left - right) / (mean of left and right)`.
        run_value: the name, in `replay.RUN_KINDS`, of a value of each run that adds to this parameter; empty: none.
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
    run_value: str = ""


@dataclass(frozen=True)
class EffectInfo:
    """One effect of the library: a row of the C table, whose header explains every field.

    Attributes:
        acts_on: the place in the equations: supply, drive, motor, gear, wheel, body, sensor or timing.
        words: a noun phrase that can complete "The simulator lacks ...".
        summary: one sentence for a reader who does not know the name.
        mechanism: the part of the vehicle: supply, drive, timing, motor, gear, bearing, tyre, body, floor or sensor.
        prior: how often the simulator of a wheeled robot or a motor lacks this effect, before any data.
        prior_reason: one sentence on the reason for the prior.
        advice: one sentence on what to do; if the effect's first `odd` size is below 0, use `mirrored(advice)`.
        motor_step: the longest motor step in s that still resolves the effect; 0: no limit.
        carries_over: whether the charge or heat at the end of one run changes the next run.
        composed: whether the effect is a sum of terms that discovery composes, and never a candidate by itself.
        shapeless: whether the effect adds a constant to a reading in any motion, so that its law has no wrong shape.
        variant_of: the better known effect of which this one is a variant; empty: none.
        variation: how the effect's law differs from that of `variant_of`, as words after "but"; empty: no difference.
        contains: the effects whose laws are special cases of this law. There, some parameters of this law are 0, one
            period per turn, or equal to each other.
        made_of: the effects whose sum is this law, each effect with a size of its own.
        stated_by: how a data set states the effect: for an effect on sensors, a key of a rotation sensor's channel; for
            an effect on drives, the beginning of the inputs' names. Empty: a data set cannot state the effect.
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
    shapeless: bool
    variant_of: str
    variation: str
    contains: tuple[str, ...]
    made_of: tuple[str, ...]
    stated_by: str

    @property
    def is_searched(self) -> bool:
        """Whether discovery searches for the effect. False: it is composed from terms, or the data set states it."""
        return not self.composed and (not self.stated_by or self.acts_on == "sensor")


def _text(value: Any) -> str:
    return interface()[0].string(value).decode() if value else ""  # type: ignore[union-attr]


def _constant(kind: str, value: int, names: Sequence[Any]) -> Any:
    """Returns the name in `names` whose C constant BP_KIND_NAME has this value, such as "size" for BP_ROLE_SIZE."""
    return next(name for name in names if getattr(interface()[1], f"BP_{kind}_{name.upper()}") == value)


def _same_named(row: Any, record: type) -> dict[str, Any]:
    """Returns field -> value for the texts, numbers and flags of a row in C that are also fields of `record`."""
    convert: dict[Any, Callable[[Any], Any]] = {"str": _text, "float": float, "bool": bool}
    return {
        field.name: convert[field.type](getattr(row, field.name)) for field in fields(record) if field.type in convert
    }


def _parameter(row: Any) -> ParameterInfo:
    values = _same_named(row, ParameterInfo)
    values["linear_unit"] = values["linear_unit"] or values["unit"]
    scan = tuple(np.geomspace(row.scan_from, row.scan_to, row.scan_count).tolist()) if row.scan_count else ()
    return ParameterInfo(**values, role=_constant("ROLE", row.role, get_args(Role)), scan=scan)


def _rows(row_of: Callable[[int], Any]) -> Iterator[Any]:
    """Yields the rows of a table in C, until its function returns NULL."""
    return takewhile(bool, map(row_of, count()))


@cache
def parameters() -> tuple[ParameterInfo, ...]:
    """Returns the nominal parameters; the presets are those of the packaged robot."""
    return tuple(map(_parameter, _rows(interface()[1].bp_parameter)))


def parameter(name: str) -> ParameterInfo:
    """Returns the nominal parameter `name`; raises StopIteration if there is none."""
    return next(info for info in parameters() if info.name == name)


@cache
def effects() -> tuple[EffectInfo, ...]:
    """Returns the effect library. An effect at its presets shows clearly in a run."""
    return tuple(
        EffectInfo(
            **_same_named(row, EffectInfo),
            parameters=tuple(_parameter(row.parameters[k]) for k in range(row.parameter_count)),
            prior=_constant("PRIOR", row.prior, get_args(Prior)),
            contains=tuple(_text(row.contains).split()),
            made_of=tuple(_text(row.made_of).split()),
        )
        for row in _rows(interface()[1].bp_effect)
    )


def effects_of(names: Container[str]) -> list[EffectInfo]:
    """Returns the effects that are in `names`, in the table's order."""
    return [effect for effect in effects() if effect.name in names]


@cache
def effect(name: str) -> EffectInfo:
    """Returns the effect `name`; raises KeyError if there is none."""
    return {info.name: info for info in effects()}[name]


def family(name: str) -> str:
    """Returns the effect of which `name` is a variant, or else `name`. The laws of a family differ in one respect.

    A name that is not an effect's, such as a name in `replay.RUN_KINDS`, is returned unchanged.
    """
    return next((info.variant_of for info in effects_of((name,))), "") or name


def law(name: str, values: Mapping[str, float]) -> str:
    """Returns the law of effect `name` with these parameters in words: "FAMILY, but DIFFERENCE and DIFFERENCE".

    Parameters that are absent from `values` count as 0.
    """
    info = effect(name)
    differences = [info.variation] if info.variant_of else []
    differences += [row.variation for row in info.parameters if row.variation and values.get(row.name, 0.0) != 0]
    return f"{family(name)}, but {' and '.join(differences)}" if differences else name


def mirrored(text: str) -> str:
    """Returns a text in which the words left and right are exchanged."""
    return re.sub(r"\b(left|right)\b", lambda match: "right" if match[0] == "left" else "left", text)


def says(name: str, parameter: str, value: float) -> str:
    """Returns the meaning of a parameter's value in effect `name`: a clause with {} for the size; empty: no clause."""
    info = next(row for row in effect(name).parameters if row.name == parameter)
    if value >= 0.0:
        return info.says
    return mirrored(info.says) if info.odd else info.says_below


def advice(name: str, values: Mapping[str, float]) -> str:
    """Returns a sentence on what to do about effect `name` with these parameters."""
    info = effect(name)
    odd = [values.get(row.name, 0.0) for row in info.parameters if row.odd and row.role == "size"]
    return mirrored(info.advice) if odd and odd[0] < 0.0 else info.advice


def mechanism(name: str, values: Mapping[str, float]) -> str:
    """Returns the mechanism of effect `name`, or of its only nonzero size in `values` if that size has a mechanism."""
    info = effect(name)
    acting = [row for row in info.parameters if row.role == "size" and values.get(row.name, 0.0) != 0]
    return acting[0].mechanism or info.mechanism if len(acting) == 1 else info.mechanism


@cache
def loads() -> frozenset[str]:
    """Returns the loads, as "effect.parameter": parameters whose lever arm is another parameter (`arm_of`)."""
    return frozenset(f"{info.name}.{row.arm_of}" for info in effects() for row in info.parameters if row.arm_of)


@cache
def outputs() -> dict[str, str]:
    """Returns name -> unit of every output signal of all vehicles, in the order of C."""
    library = interface()[1]
    names = enumerate(_rows(library.bp_output_name))
    return {_text(name): _text(library.bp_output_unit(number)) for number, name in names}


def presets(vehicle: str) -> dict[str, float]:
    """Returns the preset of every nominal parameter that a vehicle has; a motor has no mass or wheel."""
    ffi, library = interface()
    model, value = ffi.gc(library.bp_model_new(VEHICLE_CODES[vehicle], 0), library.bp_model_free), ffi.new("double *")
    names = [info.name for info in parameters()]
    return {name: value[0] for name in names if library.bp_model_get(model, name.encode(), value) == 0}
