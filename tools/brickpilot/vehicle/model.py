"""A model: nominal values, each with unit and basis, and the effects that are switched on.

`calibrate` and `discover` write `model.toml`, and `--model` takes it. The packaged model is `sim_host/models/rcx.toml`;
for `brickpilot firmware`, your model may also contain tables like those of the packaged model: `[robot]`, `[rates]`,
`[sensors]`, `[estimator]`, `[monitor]` and `[controller]`.

    name    = "bench-7"
    vehicle = "diff_drive"            # or "motor" or "skid_steer"
    profile = "coupled"               # or "paper"

    [parameters]                      # a value in SI, or with unit and basis; absent parameters keep their presets
    mass = { value = 0.9, unit = "kg", basis = "weighed" }
    wheel_radius = 0.0408             # and [effects.NAME] with the parameters of an effect in the same form
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.constants import RCX
from brickpilot.data.dataset import Dataset, Nominal
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.data.whole_files import write_whole
from brickpilot.errors import SimulationError
from brickpilot.vehicle import plant
from brickpilot.vehicle.plant import OpenLoopRun

_TOP_KEYS = (
    "name", "vehicle", "profile", "parameters", "effects", "robot", "rates", "sensors", "estimator", "monitor",
    "controller",
)  # fmt: skip

_ENTRY_KEYS = ("value", "unit", "basis")

# If an effect has more parameters than this, a file holds only the parameters that differ from their presets.
_SPELT_OUT = 8


@dataclass(frozen=True)
class Model:
    """The model of one vehicle.

    Attributes:
        name: the name for error messages and reports.
        vehicle: ``diff_drive``, ``motor`` or ``skid_steer``.
        profile: ``coupled`` or ``paper``.
        parameters: nominal parameter -> value in SI; an absent parameter keeps the plant's preset.
        effects: effect -> parameter -> value in SI; an absent parameter keeps its preset.
        basis: parameter, or ``effect.parameter``, -> source of its value.
        by_run: name of a value that differs from run to run (see `vehicle.replay`) -> run -> value. No model file has
            such values, because they belong to recordings.
    """

    name: str
    vehicle: str
    profile: str
    parameters: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    basis: Mapping[str, str] = field(default_factory=dict)
    by_run: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def nominal(self) -> dict[str, float]:
        """All nominal parameters, presets included."""
        return catalogue.presets(self.vehicle) | dict(self.parameters)


@cache
def rcx() -> Model:
    """Returns the packaged robot of the paper."""
    return load(RCX)


def of_dataset(dataset: Dataset, effects: Sequence[str] = ()) -> Model:
    """Returns the model that a data set states, with `effects` added. A value that is not stated is a preset."""
    stated = {name: {key: own.value for key, own in table.items()} for name, table in dataset.nominal_effects.items()}
    tables = {
        name: {info.name: info.preset for info in catalogue.effect(name).parameters} | stated.get(name, {})
        for name in dict.fromkeys([*stated, *effects])
    }
    values = _absent_values(dataset) | {name: nominal.value for name, nominal in dataset.nominal.items()}
    return Model(name=dataset.name, vehicle=dataset.vehicle, profile="coupled", parameters=values, effects=tables)


def _absent_values(dataset: Dataset) -> dict[str, float]:
    """Returns values for unstated parameters. A motor has one load: a mass if its input is a force, else an inertia."""
    absent = [info.name for info in catalogue.parameters() if info.zero_if_unstated]
    values = catalogue.presets(dataset.vehicle) | dict.fromkeys(absent, 0.0)
    if dataset.nominal.get("force_per_volt", Nominal(0.0)).value > 0:
        values |= {"mass": catalogue.parameter("mass").preset, "wheel_inertia": 0.0}
    elif dataset.vehicle == "motor" and {"position", "velocity", "force"} & dataset.signals.keys():
        values["wheel_radius"] = catalogue.parameter("wheel_radius").preset
    return values


def with_values(model: Model, values: Mapping[str, float]) -> Model:
    """Returns `model` with some values replaced. Keys: "mass", "effect.parameter", or "kind@run" for one run."""
    parameters = dict(model.parameters)
    effects = {name: dict(table) for name, table in model.effects.items()}
    by_run = {kind: dict(table) for kind, table in model.by_run.items()}
    for name, value in values.items():
        kind, at, run = name.partition("@")
        effect, dot, parameter = name.partition(".")
        if at:
            by_run[kind][run] = value
        elif dot:
            effects[effect][parameter] = value
        else:
            parameters[name] = value
    return dataclasses.replace(model, parameters=parameters, effects=effects, by_run=by_run)


def output_names(model: Model) -> frozenset[str]:
    """Returns the signals that the plant gives for this vehicle.

    A vehicle with a current loop gives no current; a motor whose input commands a force gives no angle.

    Raises:
        SimulationError: the vehicle has neither inertia nor mass.
        InputError: the plant refuses the model.
    """
    standing = OpenLoopRun(time=np.zeros(1), inputs=np.zeros((1, 1 if model.vehicle == "motor" else 2)))
    return frozenset(plant.simulate([(model, standing)])[0].outputs)


def unit_on(model: Model, info: ParameterInfo) -> str:
    """Returns a parameter's unit in this model: its `linear_unit` for a motor whose input commands a force."""
    return info.linear_unit if model.parameters.get("force_per_volt", 0.0) > 0 else info.unit


def entry_table(toml: TomlFile, key: Key, entry: object, unit: str) -> dict[str, Any]:
    """Returns an entry of a model file as a table of value, unit and basis; refuses a unit other than `unit`."""
    table = entry if isinstance(entry, dict) else {"value": entry}
    toml.known_keys(key, table, _ENTRY_KEYS)
    if "value" not in table:
        toml.refuse(key, "value is missing")
    if table.get("unit", unit) != unit:
        toml.refuse((*key, "unit"), f"{table['unit']!r} should be {unit!r}")
    return table


def read_values(
    toml: TomlFile, key: tuple[str, ...], given: object, infos: Iterable[ParameterInfo], basis: dict[str, str],
    may_be_0: Collection[str] = (),
) -> dict[str, float]:  # fmt: skip
    """Returns parameter -> value of the table at `key`, and adds the sources of the values to `basis`.

    `may_be_0`: parameters that may be 0 although 0 is outside their range, because a vehicle may lack the part.
    """
    table, known = toml.table(key, given), {info.name: info for info in infos}
    toml.known_keys(key, table, known)
    values = {}
    for name, entry in table.items():
        place, info = (*key, name), known[name]
        row = entry_table(toml, place, entry, info.unit)
        why = row.get("basis", "")
        if not isinstance(why, str) or not why.isprintable():
            toml.refuse((*place, "basis"), "must be printable text")
        if why:
            basis[".".join(place[1:])] = why
        is_0 = name in may_be_0 and row["value"] == 0 and not isinstance(row["value"], bool)
        values[name] = 0.0 if is_0 else toml.number(place, row["value"], info.minimum, info.maximum, info.unit)
    return values


def _parameters(toml: TomlFile, vehicle: str, basis: dict[str, str]) -> dict[str, float]:
    presets = catalogue.presets(vehicle)
    infos = [info for info in catalogue.parameters() if info.name in presets]
    absent = [name for name, value in presets.items() if value == 0 or (vehicle, name) == ("motor", "wheel_inertia")]
    return presets | read_values(toml, ("parameters",), toml.data.get("parameters", {}), infos, basis, absent)


def read_effects(toml: TomlFile, basis: dict[str, str]) -> dict[str, dict[str, float]]:
    """Returns effect -> parameter -> value of `[effects.NAME]`, presets included, and adds the sources to `basis`."""
    known = {effect.name: effect.parameters for effect in catalogue.effects()}
    table = toml.table(("effects",), toml.data.get("effects", {}))
    toml.known_keys(("effects",), table, known)
    return {
        name: {info.name: info.preset for info in known[name]}
        | read_values(toml, ("effects", name), entries, known[name], basis)
        for name, entries in table.items()
    }


def load(path: Path | str) -> Model:
    """Reads a model file. Parameters that the file leaves out get the presets of `catalogue.presets`.

    Raises:
        InputError: not TOML, an unknown key, unit or effect, a value outside its range, or a motor with neither inertia
            nor mass. The message names file, line and field.
    """
    toml = TomlFile(Path(path))
    toml.known_keys((), toml.data, _TOP_KEYS, ("name", "vehicle", "profile"))
    basis: dict[str, str] = {}
    vehicle = toml.choice(("vehicle",), toml.data["vehicle"], catalogue.VEHICLE_CODES)
    if vehicle == "skid_steer" and toml.data["profile"] == "paper":
        toml.refuse(("profile",), "'paper' has no contacts with the floor: a skid_steer is of the profile coupled")
    model = Model(
        name=toml.file_name(("name",), toml.data["name"]),
        vehicle=vehicle,
        profile=toml.choice(("profile",), toml.data["profile"], catalogue.PROFILE_CODES),
        parameters=_parameters(toml, vehicle, basis),
        effects=read_effects(toml, basis),
        basis=basis,
    )
    try:
        output_names(model)
    except SimulationError:  # a motor that has nothing to move
        given = toml.data.get("parameters", {})
        if model.parameters["force_per_volt"] > 0:
            to_blame, message = "mass", "a motor whose input commands a force needs a mass above 0"
        else:
            to_blame, message = "wheel_inertia", "0 leaves nothing to move without a mass at a wheel_radius"
        toml.refuse(("parameters", to_blame if to_blame in given else "force_per_volt"), message)
    return model


def _entry(value: float, unit: str, basis: str | None) -> tomlkit.items.InlineTable:
    entry = tomlkit.inline_table()
    entry.update({"value": float(value), "unit": unit} | ({"basis": basis} if basis else {}))
    return entry


def render(model: Model) -> str:
    """Returns the model file's text. `load` reads it back to an equal model."""
    document = tomlkit.document()
    frame = "" if model.vehicle == "motor" else "; frame FRD: x forward, y to the right, yaw clockwise positive"
    document.add(tomlkit.comment(f"SI units{frame}"))
    document.update({"name": model.name, "vehicle": model.vehicle, "profile": model.profile})
    units = {info.name: info.unit for info in catalogue.parameters()}
    table = tomlkit.table()
    for name, value in model.nominal.items():
        table[name] = _entry(value, units[name], model.basis.get(name))
    document["parameters"] = table
    if model.effects:
        document["effects"] = tomlkit.table(is_super_table=True)
    for name, chosen in model.effects.items():
        table, infos = tomlkit.table(), catalogue.effect(name).parameters
        spelt_out = len(infos) <= _SPELT_OUT
        for info in infos:
            value = chosen.get(info.name, info.preset)
            if spelt_out or value != info.preset:
                table[info.name] = _entry(value, info.unit, model.basis.get(f"{name}.{info.name}"))
        document["effects"][name] = table
    return tomlkit.dumps(document)


def save(model: Model, path: Path | str) -> None:
    """Writes the model file as a whole (`write_whole`).

    Raises:
        InputError: the plant does not know a parameter or an effect of the model, or refuses a value.
    """
    plant.build(model)
    write_whole(path, render(model))


def read_back(model: Model) -> Model:
    """Saves the model, and returns the loaded model, so that results are simulated from the values in the file.

    Raises:
        InputError: as `save`.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        save(model, path)
        return load(path)
