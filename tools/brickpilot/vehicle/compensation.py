"""A compensation: what the firmware knows of one robot and undoes, in fixed point.

The firmware's constants are those of the packaged robot. A compensation converts the firmware's voltages into those
that another robot's motors need, and that robot's readings into those of the packaged robot
(`firmware/app/parameters`). It works in the profile `coupled`. `discover` writes `compensation.toml`, and so does
`from_model(model).save(path)`:

    name      = "bench-7"
    left_out  = []      # effects, or EFFECT.PARAMETER, that the firmware cannot compensate
    limited   = []      # parameters that their format limits
    remarks   = []      # a line for each difference that no setting can undo: which value, and how far off it is

    [parameters]        # names, formats and ranges: hal/wire/settings.toml; an absent one is 0
    left_friction_mv = { raw = 564, format = "mV", value = 0.564, unit = "V", from = ["nominal values"] }

The firmware gets `raw`; `value` is the same in SI and has to agree. `from` names the effects that each need this
parameter, or says that nominal values differ from the packaged robot's. The comment at the end has the same parameters
in C. `summary.json` of a flight repeats the file as `compensation`. firmware/README.md shows the improvement.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.data.whole_files import write_whole
from brickpilot.vehicle import compensation_limits, compensation_values, plant
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.settings import Setting, compensations

NOMINAL = "nominal values"
"""A source of compensation beside the effects: nominal values that differ from the packaged robot's."""


FORMATS: Mapping[str, Setting] = compensations()
"""The setting of each parameter, by the parameter's name in the file."""


@dataclass(frozen=True)
class Compensation:
    """Parameters for the firmware.

    Attributes:
        name: of the model from which they were made.
        raw: parameter -> integer as the firmware holds it; all of `FORMATS`.
        sources: parameter -> the effects that need it, each even by itself, or `NOMINAL`; one of 0 may be missing.
        left_out: effects of the model, or `effect.parameter`, that the firmware cannot undo.
        limited: parameters that exceed the range of the firmware's format, or half of the battery's voltage.
        remarks: a line for each difference that the firmware cannot undo: which value, and how far off.
    """

    name: str
    raw: Mapping[str, int]
    sources: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    limited: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def undone(self) -> tuple[str, ...]:
        """The effects that are undone, without `NOMINAL`."""
        names = {source: None for sources in self.sources.values() for source in sources}
        return tuple(name for name in names if name != NOMINAL)

    def value(self, parameter: str) -> float:
        """Returns the value of a parameter in the firmware, SI."""
        return FORMATS[parameter].value(self.raw[parameter])

    def save(self, path: Path | str) -> None:
        """Writes the file as a whole (`write_whole`)."""
        write_whole(path, render(self))


def _quantised(model: Model, believed: Model) -> tuple[dict[str, float], dict[str, int], tuple[str, ...]]:
    """Returns the parameters in SI as the robot needs them, the firmware's integers, and the names of those cut."""
    wanted = compensation_values.values(model, believed)
    exact = {name: wanted[name] * how.format.per_unit for name, how in FORMATS.items()}
    most = {name: how.high for name, how in FORMATS.items()}
    most["reserve_mv"] = min(most["reserve_mv"], FORMATS["reserve_mv"].raw(compensation_values.most_reserve(model)))
    raw = {name: min(max(round(exact[name]), how.low), most[name]) for name, how in FORMATS.items()}
    return wanted, raw, tuple(name for name in FORMATS if abs(exact[name] - raw[name]) > 1)


def from_model(
    model: Model, believed: Model | None = None, controller: Mapping[str, float] | None = None
) -> Compensation | None:
    """Returns the compensation with which the firmware flies the robot of `model` like the robot it was made for.

    Args:
        model: the robot as the data show it, with the effects found. Effects that the brick cannot undo are listed in
            `left_out`.
        believed: the robot from which the firmware's constants were made; default the packaged robot.
        controller: the constants of its controllers, SI; default the packaged robot's.

    Returns:
        None: nothing can be undone, or the model is a motor, has the profile `paper`, or motors without torque. If only
        nominal values differ, `undone` is empty.
    """
    if model.vehicle != "diff_drive" or model.profile != "coupled" or model.parameters.get("torque_constant") == 0:
        return None
    believed = believed or rcx()
    wanted, raw, limited = _quantised(model, believed)
    if not any(raw.values()):
        return None
    left_out = compensation_values.left_out(model)
    held = {name: how.value(raw[name]) for name, how in FORMATS.items()}
    remarks = [
        *compensation_limits.of_settings(wanted, held, FORMATS, limited),
        *compensation_limits.of_effects(left_out),
        *compensation_limits.of_loads(plant.undoable(model)),
        *compensation_limits.of_robot(
            compensation_values.nominal(model), compensation_values.nominal(believed), controller
        ),
    ]
    return Compensation(model.name, raw, _sources(model, believed, raw), left_out, limited, tuple(remarks))


def _sources(model: Model, believed: Model, raw: Mapping[str, int]) -> dict[str, tuple[str, ...]]:
    """Returns parameter -> the effects that need it, each even by itself, or `NOMINAL`."""
    alone = {
        name: dataclasses.replace(model, parameters=believed.parameters, effects={name: on})
        for name, on in model.effects.items()
    }
    alone[NOMINAL] = dataclasses.replace(model, effects={})
    parts = {source: _quantised(part, believed)[1] for source, part in alone.items()}
    return {name: tuple(source for source, part in parts.items() if part[name]) for name in raw}


def c_calls(compensation: Compensation) -> list[str]:
    """Returns the C statements that write the parameters into the firmware's `parameters_t`."""
    return [
        f"parameters_write(&parameters, {how.number}, {compensation.raw[name]}, false); /* {how.name} */"
        for name, how in FORMATS.items()
    ]


def render(compensation: Compensation) -> str:
    """Returns the file's text, which `load` reads back to an equal compensation. Its last comment has the same in C."""
    document = tomlkit.document()
    document.add(tomlkit.comment("What the firmware knows of this robot: brickpilot run --compensation FILE"))
    document["name"] = compensation.name
    document["left_out"] = list(compensation.left_out)
    document["limited"] = list(compensation.limited)
    remarks = tomlkit.array()
    for remark in compensation.remarks:
        remarks.add_line(remark)
    document["remarks"] = remarks.multiline(bool(compensation.remarks))
    table = tomlkit.table()
    for name, how in FORMATS.items():
        entry = tomlkit.inline_table()
        entry.update({"raw": compensation.raw[name], "format": how.format.text, "value": compensation.value(name)})
        entry.update({"unit": how.format.unit, "from": list(compensation.sources.get(name, ()))})
        table[name] = entry
        table[name].comment(how.meaning)
    document["parameters"] = table
    document.add(tomlkit.nl())
    document.add(tomlkit.comment("The same in C, after parameters_start() of firmware/app:"))
    for line in c_calls(compensation):
        document.add(tomlkit.comment(line))
    return tomlkit.dumps(document)


def _texts(toml: TomlFile, key: Key, value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        toml.refuse(key, f"{value!r} is not a list of texts")
    return tuple(value)


def _raw(toml: TomlFile, name: str, entry: object) -> tuple[int, tuple[str, ...]]:
    key, how = ("parameters", name), FORMATS[name]
    table = toml.table(key, entry)
    toml.known_keys(key, table, ("raw", "format", "value", "unit", "from"))
    raw = table.get("raw")
    if isinstance(raw, bool) or not isinstance(raw, int):
        toml.refuse((*key, "raw"), "is missing" if raw is None else f"{raw!r} is not a whole number")
    toml.number((*key, "raw"), raw, how.low, how.high)
    for field, right in (("format", how.format.text), ("unit", how.format.unit)):
        if table.get(field, right) != right:
            toml.refuse((*key, field), f"{table[field]!r} should be {right!r}")
    value = toml.number((*key, "value"), table.get("value", how.value(raw)), -1e9, 1e9, how.format.unit)
    if abs(value * how.format.per_unit - raw) > 0.5:
        toml.refuse((*key, "value"), f"{value:g} {how.format.unit} does not agree with raw = {raw}")
    return raw, _texts(toml, (*key, "from"), table.get("from", []))


def load(path: Path | str) -> Compensation:
    """Reads a compensation file; a parameter that it leaves out is 0.

    Raises:
        InputError: not TOML, an unknown key, a number outside its format, or a value that contradicts its raw number.
            The message names file, line and field.
    """
    toml = TomlFile(Path(path))
    toml.known_keys((), toml.data, ("name", "left_out", "limited", "remarks", "parameters"))
    for key in ("name", "parameters"):
        if key not in toml.data:
            toml.refuse((key,), "is missing")
    given = toml.table(("parameters",), toml.data["parameters"])
    toml.known_keys(("parameters",), given, FORMATS)
    found = {name: _raw(toml, name, entry) for name, entry in given.items()}
    lists = ("left_out", "limited", "remarks")
    left_out, limited, remarks = (_texts(toml, (key,), toml.data.get(key, [])) for key in lists)
    return Compensation(
        name=toml.file_name(("name",), toml.data["name"]),
        raw={name: found[name][0] if name in found else 0 for name in FORMATS},
        sources={name: sources for name, (_, sources) in found.items()},
        left_out=left_out,
        limited=limited,
        remarks=remarks,
    )
