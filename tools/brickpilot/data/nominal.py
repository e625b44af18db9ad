"""Reads `[nominal]` of a data set: the values that the experimenter knows. The C tables give names and ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.data.toml_file import Key, TomlFile

# Lateral values of an effect on a sensor or the body change their sign with the frame. Parameters named left or right
# keep their sign.
_IN_AXES = frozenset({"sensor", "body"})
_SIDES = frozenset({"left", "right"})

_FINEST_SD = 1e-15
_FINEST_SHARE = 1e-9  # least ratio of sd to value: no measurement is more precise
_WIDEST_SD = 1e9


@dataclass(frozen=True)
class Nominal:
    """A known value in SI with its sd; ``sd`` is None if not stated."""

    value: float
    sd: float | None = None


def read_nominal(toml: TomlFile, table: Mapping[str, Any], vehicle: Vehicle) -> dict[str, Nominal]:
    """Returns the nominal parameters, after a check of their names and of their physical ranges.

    Raises:
        InputError: the message names the parameter's line.
    """
    known = {info.name: info for info in catalogue.parameters()}
    nominal = {}
    for name, entry in table.items():
        if name == "effects":
            continue
        key = ("nominal", name)
        if name not in known:
            toml.refuse(key, "unknown nominal parameter")
        if name not in catalogue.presets(vehicle):
            toml.refuse(key, f"belongs to a skid_steer, not to a {vehicle}")
        nominal[name] = _entry(toml, key, entry, known[name])
    _check_drive(toml, nominal, vehicle)
    return nominal


def read_nominal_effects(toml: TomlFile, table: Mapping[str, Any], frame: Frame) -> dict[str, dict[str, Nominal]]:
    """Returns the effects that the experimenter's model already contains.

    Values are read in the file's frame and returned in the paper's frame. If the file is in FLU, lateral and yaw values
    of a sensor or the body change their sign, like lateral and yaw signals. Values named left or right keep their sign.

    Raises:
        InputError: the message names the effect's line.
    """
    known = {effect.name: effect for effect in catalogue.effects()}
    effects: dict[str, dict[str, Nominal]] = {}
    for name, entries in table.items():
        key = ("nominal", "effects", name)
        if name not in known:
            toml.refuse(key, "unknown effect")
        if not isinstance(entries, dict) or not entries:
            toml.refuse(key, "needs a table with at least one parameter")
        effects[name] = {}
        ranges = {info.name: info for info in known[name].parameters}
        for parameter, entry in entries.items():
            if parameter not in ranges:
                toml.refuse((*key, parameter), f"unknown parameter; known: {', '.join(ranges)}")
            stated = _entry(toml, (*key, parameter), entry, ranges[parameter])
            if frame == "FLU" and turns_with_frame(name, parameter):
                stated = replace(stated, value=0.0 - stated.value)
            effects[name][parameter] = stated
    return effects


def turns_with_frame(effect: str, parameter: str) -> bool:
    """Returns whether a parameter's sign depends on the frame; False if the effect has no such parameter."""
    for row in catalogue.effects_of((effect,)):
        odd = any(info.odd for info in row.parameters if info.name == parameter)
        return odd and row.acts_on in _IN_AXES and parameter not in _SIDES
    return False


def lengths(nominal: Mapping[str, Nominal], vehicle: Vehicle) -> dict[str, float]:
    """Returns the stated nominal values, without the half track of a skid steer because slip changes how it turns."""
    return {n: known.value for n, known in nominal.items() if (vehicle, n) != ("skid_steer", "half_track")}


def _entry(toml: TomlFile, key: Key, entry: object, info: ParameterInfo) -> Nominal:
    low, high, unit = info.minimum, info.maximum, info.unit
    if not isinstance(entry, dict):
        return Nominal(toml.number(key, entry, low, high, unit))
    toml.known_keys(key, entry, {"value", "sd"})
    if "value" not in entry:
        toml.refuse(key, "value is missing")
    value = toml.number((*key, "value"), entry["value"], low, high, unit)
    if "sd" not in entry:
        return Nominal(value)
    sd = toml.positive((*key, "sd"), entry["sd"], unit)
    if not max(_FINEST_SD, _FINEST_SHARE * abs(value)) <= sd <= min(high - low, _WIDEST_SD):
        toml.refuse((*key, "sd"), f"{sd:g} is not a plausible uncertainty of {value:g} {unit}".rstrip())
    return Nominal(value, sd)


def _check_drive(toml: TomlFile, nominal: Mapping[str, Nominal], vehicle: Vehicle) -> None:
    closed = [name for name in nominal if name in {"force_per_volt", "torque_per_volt"}]
    for name in closed:
        if vehicle != "motor":
            toml.refuse(("nominal", name), f"belongs to a motor, not to a {vehicle}")
        if nominal[name].value == 0.0:
            toml.refuse(("nominal", name), "is 0: leave it out of a motor that is driven by voltage")
    if len(closed) > 1:
        toml.refuse(("nominal", closed[1]), f"conflicts with {closed[0]}: the drive commands one or the other")
