"""A robot as the firmware has to know it: every value of the packaged robot's file, for another robot.

`[parameters]` and `[effects]` of its model file are those of the plant. `[robot]`, `[sensors.*]`, `[estimator*]` and
`[controller.coupled]`, with the names and units of sim_host/models/rcx.toml, override what else follows by the rules of
`tuning`, or is the packaged robot's.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from brickpilot import catalogue
from brickpilot.constants import RCX
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.firmware import tuning
from brickpilot.vehicle import compensation
from brickpilot.vehicle import model as models
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.setting_defaults import constants, default, holding_voltage, plain
from brickpilot.vehicle.settings import settings

Tables = Mapping[str, Any]
Place = tuple[str, ...]

OWN = (
    ("robot",),
    ("sensors", "imu"),
    ("sensors", "encoder"),
    ("sensors", "battery"),
    ("estimator",),
    ("estimator", "coupled"),
    ("controller", "coupled"),
)
"""The tables of a model file that describe a robot beside `[parameters]` and `[effects]`."""

_MOST = 1e6  # of a value in SI, either sign; what its format holds is a matter of its own
_LEAST_ABOVE_0 = 1e-6
_RANGES: Mapping[Place, tuple[float, float]] = {
    ("robot", "length"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "gyro_range"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "gyro_noise_sd"): (_LEAST_ABOVE_0, _MOST),
    ("sensors", "imu", "bits"): (1, 24),  # of the simulated converter
    ("sensors", "encoder", "counts_per_turn"): (_LEAST_ABOVE_0, _MOST),
    ("controller", "coupled", "cruise"): (_LEAST_ABOVE_0, _MOST),
}
"""Of the values by which the rules divide, or of which they take a root or a power."""

_SEEN = ("imu", "encoder")
ACCEPTANCE, FEEDFORWARD = "acceptance", "feedforward"
"""Settings without a value of their own in a vehicle file: they follow from the robot's length and its losses."""

LONGEST_COUNT = 0.016
"""m: just below what the format of the travel per count holds."""

_PACKAGED = "the packaged robot's"
_STATED = "stated"


@dataclass(frozen=True)
class Robot:
    """A robot, complete.

    Attributes:
        model: the plant, with its effects.
        vehicle: the tables of a vehicle file, `{value, unit, basis}` each.
        known: parameter of a compensation -> raw integer: what the firmware undoes of the effects.
        remarks: a line for each difference that the firmware cannot undo.
        stated: place -> value, SI, of those that the model file states.
        toml: the model file, for errors.
    """

    model: Model
    vehicle: dict[str, Any]
    known: Mapping[str, int]
    remarks: tuple[str, ...]
    stated: Mapping[Place, float]
    toml: TomlFile

    def value(self, *place: str) -> float:
        """Returns a value of the vehicle file, SI."""
        return float(entry(self.vehicle, place)["value"])

    @property
    def length(self) -> float:
        """m."""
        return self.value("robot", "length")


@cache
def _file() -> Tables:
    return TomlFile(RCX).data


def packaged() -> dict[str, Any]:
    """Returns the tables of the packaged robot's file."""
    return copy.deepcopy(dict(_file()))


def load(path: Path) -> Robot:
    """Reads a model file, and completes it.

    Raises:
        InputError: as `model.load`; a vehicle that is no coupled diff_drive; an unknown name, unit or value.
    """
    model = models.load(path)
    toml = TomlFile(path)
    if model.vehicle != "diff_drive":
        toml.refuse(("vehicle",), f"{model.vehicle!r}: the firmware drives a diff_drive")
    if model.profile != "coupled":
        toml.refuse(("profile",), f"{model.profile!r}: firmware is made for the profile coupled")
    stated: dict[Place, float] = {
        ("parameters", name): model.parameters[name] for name in toml.data.get("parameters", {})
    }
    return complete(model, toml, stated | _stated(toml))


def entry(tables: Tables, place: Place) -> Any:
    """Returns what stands at a place of a vehicle file."""
    found: Any = tables
    for name in place:
        found = found[name]
    return found


def _stated(toml: TomlFile) -> dict[Place, float]:
    """Returns place -> value, SI, of what the file states in the tables of `OWN`."""
    known = packaged()
    found: dict[Place, float] = {}
    for place in OWN:
        names = entry(known, place)
        table: Any = toml.data
        for depth, name in enumerate(place):
            table = toml.table(place[: depth + 1], table.get(name, {}))
        below = {one[len(place)] for one in OWN if len(one) > len(place) and one[: len(place)] == place}
        toml.known_keys(place, table, names)
        for name in table.keys() - below - {"paper"}:  # another profile, which no firmware of one's own has
            found[*place, name] = _checked(toml, (*place, name), table[name], names[name]["unit"])
    return found


def _checked(toml: TomlFile, place: Place, given: Any, unit: str) -> float:
    table = given if isinstance(given, dict) else {"value": given}
    toml.known_keys(place, table, ("value", "unit", "basis"))
    if "value" not in table:
        toml.refuse(place, "value is missing")
    if table.get("unit", unit) != unit:
        toml.refuse((*place, "unit"), f"{table['unit']!r} should be {unit!r}")
    low, high = _RANGES.get(place, (-_MOST, _MOST))
    return toml.number(place, table["value"], low, high, "" if unit == "1" else unit)


def complete(model: Model, toml: TomlFile, stated: Mapping[Place, float]) -> Robot:
    """Returns the robot of a model whose file states the values `stated`; the rest follows by rules.

    Raises:
        InputError: the compensation refuses the model.
    """
    vehicle = packaged()
    vehicle["name"] = model.name
    vehicle["controller"] = {"coupled": vehicle["controller"]["coupled"]}
    del vehicle["estimator"]["paper"]
    nominal = {**catalogue.presets(model.vehicle), **model.parameters}
    for name in vehicle["parameters"]:
        basis = model.basis.get(name) or (_STATED if ("parameters", name) in stated else _PACKAGED)
        vehicle["parameters"][name] |= {"value": nominal[name], "basis": basis}
    _put(vehicle, {place: (value, _STATED) for place, value in stated.items() if place[0] != "parameters"})
    chosen = {place: (one.value, one.rule) for place, one in _chosen(vehicle, stated).items() if place not in stated}
    _put(vehicle, chosen)
    believed = dataclasses.replace(model, effects={})
    undone = compensation.from_model(model, believed, controller=plain(vehicle["controller"]["coupled"]))
    known = {} if undone is None else undone.raw
    remarks = () if undone is None else undone.remarks
    return Robot(model, vehicle, known, remarks, dict(stated), toml)


def changed(one: Robot, values: Mapping[Place, float]) -> Robot:
    """Returns the robot whose file would state other `values`."""
    own = {place[1]: value for place, value in values.items() if place[0] == "parameters"}
    model = dataclasses.replace(one.model, parameters={**one.model.parameters, **own})
    return complete(model, one.toml, {**one.stated, **values})


def with_gains(one: Robot, gains: Gains) -> Robot:
    """Returns the robot whose controller has these gains: its constants hold their raw integers.

    Raises:
        InputError: a gain that follows from another value of the robot.
    """
    held: dict[Place, float] = {
        ("controller", "coupled", name): gains.value(name)
        for name in gains.raw
        if name not in (ACCEPTANCE, FEEDFORWARD)
    }
    if FEEDFORWARD in gains.raw:
        share = gains.value(FEEDFORWARD) / holding_voltage(plain(one.vehicle["parameters"]))
        held["controller", "coupled", "feedforward_share"] = share
    made = changed(one, held)
    _put(made.vehicle, {place: (value, f"gain set {gains.name}") for place, value in held.items()})
    own = constants(made.vehicle, "coupled")
    for name, raw in gains.raw.items():
        has = default(settings()[name], own, "coupled")
        if has != raw:
            follows = f"{own[name]:.4g} {settings()[name].format.unit} follows from the robot's model file"
            raise InputError(f"raw {raw} cannot be compiled in: {follows}", file=gains.name, field=name)
    return made


def _put(vehicle: dict[str, Any], values: Mapping[Place, tuple[float, str]]) -> None:
    for place, (value, basis) in values.items():
        entry(vehicle, place).update({"value": value, "basis": basis})


def _chosen(vehicle: dict[str, Any], stated: Mapping[Place, float]) -> dict[Place, tuning.Chosen]:
    """Returns what the rules say of everything that they have a rule for; `vehicle` gets its length on the way."""
    reference = packaged()
    own, other = plain(vehicle["parameters"]), plain(reference["parameters"])
    found: dict[Place, tuning.Chosen] = {}
    if ("robot", "length") not in stated:
        length = plain(reference["robot"])["length"] * own["half_track"] / other["half_track"]
        found["robot", "length"] = tuning.Chosen(length, "as the half-track")
        vehicle["robot"]["length"]["value"] = length
    counts = ("sensors", "encoder", "counts_per_turn")
    if counts not in stated:
        finer = _counts(own["wheel_radius"], entry(vehicle, counts)["value"])
        if finer != entry(vehicle, counts)["value"]:
            found[counts] = tuning.Chosen(finer, "a count of 16 mm, the longest that has a format")
            entry(vehicle, counts)["value"] = finer
    constants = plain(reference["controller"]["coupled"])
    found |= {
        ("controller", "coupled", name): one
        for name, one in tuning.controller(_size(vehicle), _size(reference), constants).items()
    }
    common, coupled = plain(reference["estimator"]), plain(reference["estimator"]["coupled"])
    for name, one in tuning.estimator(_seen(vehicle), _seen(reference), {**common, **coupled}).items():
        found[("estimator", name) if name in common else ("estimator", "coupled", name)] = one
    return found


def _counts(radius: float, packaged: float) -> float:
    """Returns the counts of a turn where nobody states them: the packaged robot's, or more for a large wheel."""
    return max(packaged, float(math.ceil(2 * math.pi * radius / LONGEST_COUNT)))


def _size(vehicle: Tables) -> tuning.Size:
    gyro_range = plain(vehicle["sensors"]["imu"])["gyro_range"]
    return tuning.Size(plain(vehicle["parameters"]), plain(vehicle["robot"])["length"], gyro_range)


def _seen(vehicle: Tables) -> dict[str, float]:
    """Returns what `tuning.estimator` asks of the sensors."""
    values, imu, encoder = (plain(one) for one in (vehicle["parameters"], *map(vehicle["sensors"].get, _SEEN)))
    return {
        "travel_per_count": values["wheel_radius"] / encoder["counts_per_turn"],
        "gyro_resolution": 2 * imu["gyro_range"] / 2 ** imu["bits"],
        "gyro_noise_sd": imu["gyro_noise_sd"],
    }
