"""A compensation: the fixed-point parameters with which the firmware corrects how one robot differs from another.

The firmware's constants are those of the packaged robot. A compensation converts the firmware's voltages into the
voltages that another robot's motors need, and the readings of that robot into readings of the packaged robot
(`firmware/app/parameters`). It works in the profile `coupled`. `discover` writes `compensation.toml`, and so does
`from_model(model).save(path)`:

    name      = "bench-7"
    left_out  = []      # effects, or EFFECT.PARAMETER, that the firmware cannot compensate
    limited   = []      # parameters that their format limits
    remarks   = []      # a line for each difference that no setting can undo: the value, and by how much it differs

    [parameters]        # names, formats and ranges: hal/wire/settings.toml; an absent parameter is 0
    left_friction_mv = { raw = 564, format = "mV", value = 0.564, unit = "V", from = ["nominal values"] }

The firmware gets `raw`; `value` is the same in SI and has to agree. `from` names the effects that need this parameter;
"nominal values" means values other than the packaged robot's. The comment at the end has the same parameters in
C. `summary.json` of a flight repeats the file as `compensation`. firmware/README.md shows how much flights improve.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import tomlkit

from brickpilot import catalogue
from brickpilot.constants import ROBOT, SIDES
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.data.whole_files import write_whole
from brickpilot.vehicle import plant, scenario
from brickpilot.vehicle.combinations import Values, difference_inertia, holding_voltage, loss, mean_inertia
from brickpilot.vehicle.drive_constants import two_wheeled
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import Undoable
from brickpilot.vehicle.settings import Setting, plain, read_raw, settings

NOMINAL = "nominal values"
"""The name of the one source that is not an effect: nominal values that differ from the packaged robot's."""

FORMATS: Mapping[str, Setting] = {row.compensation: row for row in settings().values() if row.compensation}
"""The setting of each parameter, by the parameter's name in the file."""


@dataclass(frozen=True)
class Compensation:
    """The parameters with which the firmware corrects the differences of one robot.

    Attributes:
        name: the name of the model from which the parameters were made.
        raw: parameter -> integer as the firmware holds it, for all of `FORMATS`.
        sources: parameter -> the sources that need it: effects, and `NOMINAL`. A parameter that is 0 may be missing.
        left_out: effects of the model, or `effect.parameter`, that the firmware cannot undo.
        limited: parameters that exceed the range of the firmware's format, or half of the battery's voltage.
        remarks: a line for each difference that the firmware cannot undo: the value, and by how much it differs.
    """

    name: str
    raw: Mapping[str, int]
    sources: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    limited: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def undone(self) -> tuple[str, ...]:
        """The effects that the compensation undoes, without `NOMINAL`."""
        names = {source: None for sources in self.sources.values() for source in sources}
        return tuple(name for name in names if name != NOMINAL)

    def value(self, parameter: str) -> float:
        """Returns the value of a parameter in the firmware, SI."""
        return FORMATS[parameter].value(self.raw[parameter])

    def save(self, path: Path | str) -> None:
        """Writes the file as a whole (`write_whole`)."""
        write_whole(path, render(self))


def _quantised(model: Model, believed: Model) -> tuple[dict[str, float], dict[str, int], tuple[str, ...]]:
    """Returns the parameters in SI as the robot needs them, the firmware's integers, and the limited parameters."""
    wanted = si_values(model, believed)
    exact = {name: wanted[name] * setting.format.per_unit for name, setting in FORMATS.items()}
    most = {name: setting.high for name, setting in FORMATS.items()}
    half = model.nominal["battery_voltage"] / 2  # a larger reserve leaves the controllers too little voltage
    most["reserve_mv"] = min(most["reserve_mv"], FORMATS["reserve_mv"].raw(half))
    raw = {name: min(max(round(exact[name]), setting.low), most[name]) for name, setting in FORMATS.items()}
    return wanted, raw, tuple(name for name in FORMATS if abs(exact[name] - raw[name]) > 1)


def from_model(model: Model, believed: Model | None = None, controller: Values | None = None) -> Compensation | None:
    """Returns the compensation with which the firmware flies the robot of `model` like the robot of `believed`.

    Args:
        model: the model that was fitted to the robot's data, with its effects. The result lists in `left_out` the
            effects that the firmware cannot undo.
        believed: the robot from which the firmware's constants were made; default: the packaged robot.
        controller: the constants of the firmware's controllers, SI; default: those of the packaged robot.

    Returns:
        None: nothing can be undone, or the model is a motor, has the profile `paper`, or has motors without torque. If
        only nominal values differ, `undone` of the result is empty.
    """
    model = two_wheeled(model)
    if model.vehicle == "motor" or model.profile != "coupled" or model.parameters.get("torque_constant") == 0:
        return None
    believed = believed or rcx()
    wanted, raw, limited = _quantised(model, believed)
    if not any(raw.values()):
        return None
    left_out = never_undone(model)
    remarks = [
        f"{name}: this robot needs {wanted[name]:.3g} {FORMATS[name].format.unit} ({FORMATS[name].meaning}), "
        f"but {FORMATS[name].value(raw[name]):.3g} is the limit"
        for name in limited
    ]
    remarks += [f"{name}: no setting of the firmware undoes it" for name in left_out]
    remarks += [
        *limits_of_loads(plant.undoable(model)),
        *limits_of_robot(model.nominal, believed.nominal, controller),
    ]
    return Compensation(model.name, raw, _sources(model, believed, raw), left_out, limited, tuple(remarks))


def _sources(model: Model, believed: Model, raw: Mapping[str, int]) -> dict[str, tuple[str, ...]]:
    """Returns parameter -> the sources that need the parameter: effects, and `NOMINAL`."""
    alone = {
        name: dataclasses.replace(model, parameters=believed.parameters, effects={name: on})
        for name, on in model.effects.items()
    }
    alone[NOMINAL] = dataclasses.replace(model, effects={})
    parts = {source: _quantised(part, believed)[1] for source, part in alone.items()}
    return {name: tuple(source for source, part in parts.items() if part[name]) for name in raw}


def render(compensation: Compensation) -> str:
    """Returns the file's text, which `load` reads back to an equal compensation. A comment has the parameters in C."""
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
    for name, setting in FORMATS.items():
        entry = tomlkit.inline_table()
        entry.update({"raw": compensation.raw[name], "format": setting.format.text, "value": compensation.value(name)})
        entry.update({"unit": setting.format.unit, "from": list(compensation.sources.get(name, ()))})
        table[name] = entry
        table[name].comment(setting.meaning)
    document["parameters"] = table
    document.add(tomlkit.nl())
    document.add(tomlkit.comment("The same in C, after parameters_start() of firmware/app:"))
    for name, setting in FORMATS.items():
        write = f"parameters_write(&parameters, {setting.number}, {compensation.raw[name]}, false)"
        document.add(tomlkit.comment(f"{write}; /* {setting.name} */"))
    return tomlkit.dumps(document)


def _texts(toml: TomlFile, key: Key, value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        toml.refuse(key, f"{value!r} is not a list of texts")
    return tuple(value)


def _raw(toml: TomlFile, name: str, entry: object) -> tuple[int, tuple[str, ...]]:
    key, setting = ("parameters", name), FORMATS[name]
    table = toml.table(key, entry)
    toml.known_keys(key, table, ("raw", "format", "value", "unit", "from"), ("raw",))
    if table.get("format", setting.format.text) != setting.format.text:
        toml.refuse((*key, "format"), f"{table['format']!r} should be {setting.format.text!r}")
    return read_raw(toml, key, table, setting), _texts(toml, (*key, "from"), table.get("from", []))


def load(path: Path | str) -> Compensation:
    """Reads a compensation file; a parameter that it leaves out is 0.

    Raises:
        InputError: not TOML, an unknown key, a number outside its format, or a value that contradicts its raw number.
            The message names file, line and field.
    """
    toml = TomlFile(Path(path))
    toml.known_keys((), toml.data, ("name", "left_out", "limited", "remarks", "parameters"), ("name", "parameters"))
    given = toml.table(("parameters",), toml.data["parameters"])
    toml.known_keys(("parameters",), given, FORMATS)
    entries = {name: _raw(toml, name, entry) for name, entry in given.items()}
    lists = ("left_out", "limited", "remarks")
    left_out, limited, remarks = (_texts(toml, (key,), toml.data.get(key, [])) for key in lists)
    return Compensation(
        name=toml.file_name(("name",), toml.data["name"]),
        raw={name: entries[name][0] if name in entries else 0 for name in FORMATS},
        sources={name: sources for name, (_, sources) in entries.items()},
        left_out=left_out,
        limited=limited,
        remarks=remarks,
    )


LEFT, RIGHT = 0, 1


@cache
def _top_speed() -> float:
    """Returns the highest speed for which voltage is reserved, in m/s: the cruise speed of the packaged mission."""
    return scenario.load(scenario.packaged()["mission"]).cruise["coupled"]


def push(values: Values) -> float:
    """Returns the force that a motor at rest applies to the ground per volt, N/V."""
    return values["torque_constant"] / (values["resistance"] * values["wheel_radius"])


def straight_inertia(values: Values) -> float:
    """Returns the mass that each motor has to move, kg."""
    return mean_inertia(values) / values["wheel_radius"] ** 2


def _side(robot: Values, of_effects: Undoable, believed: Values, side: int) -> dict[str, float]:
    flux, rim = of_effects.flux[side], of_effects.rim[side]
    factors = {"torque_constant": flux, "emf_constant": flux, "wheel_radius": rim}
    own = {**robot, **{name: robot[name] * factor for name, factor in factors.items()}}
    share = straight_inertia(robot) / straight_inertia(believed) * push(believed) / push(own)
    volts = own["resistance"] / own["torque_constant"] / share  # V per N m at the wheel
    # From w = 0 to the wheel speed W of `_top_speed`, T sqrt(w) is close to the line `T sqrt(W) (4/15 + 4/5 w/W)`.
    root, fastest = of_effects.root_torque[side], _top_speed() / own["wheel_radius"]
    losses = loss(own) + 0.8 * root / math.sqrt(fastest)
    return {
        "gain_q15": share / of_effects.drive_gain[side] - 1,
        "emf_mv_q15": holding_voltage(own, losses) / share - holding_voltage(believed),
        "friction_mv": (of_effects.dry_torque[side] + 4 / 15 * root * math.sqrt(fastest)) * volts,
        "offset_mv": of_effects.load[side] * volts,
    }


def _reserve(side: Values, deadband: float, battery: float) -> float:
    """Returns the part of the battery's voltage, V, that is reserved for the compensation of this side."""
    most = (battery - deadband) / (1 + side["gain_q15"])
    return battery - most + side["friction_mv"] + abs(side["offset_mv"]) + max(side["emf_mv_q15"] * _top_speed(), 0.0)


def si_values(model: Model, believes: Model) -> dict[str, float]:
    """Returns each parameter of the compensation in SI, by its name in the firmware.

    The firmware is made for one robot, the believed one, and flies another robot. On each side, the firmware demands a
    voltage u that would give the believed robot the demanded acceleration. The compensation turns u into

        V = (1 + gain) (u + emf v + offset + friction sign(v)) + deadband sign(V)        v: the side's speed over ground

    so that the real robot drives straight like the believed one. The force per volt is push = K_t / (R r), the voltage
    per steady speed is hold = K_e / r + b R / (K_t r), the mass per wheel is M = J / r^2 + m / 2. A wheel has the
    losses b and the dry friction T, and its drive has the gain g. The index 0 marks the believed robot:

        a = (M / M_0) (push_0 / push)      gain = a / g - 1      emf = hold / a - hold_0      friction = T R / (K_t a)

    (eq. 12 to 14, solved for V). The inertia in yaw may differ by another factor; the heading controller corrects this.

    The C files of the effects add to these quantities; see `bp_undoable`.

    Args:
        model: the real robot, a coupled diff_drive.
        believes: the robot that the firmware believes in; its effects are ignored.
    """
    robot, believed = model.nominal, believes.nominal
    of_effects, battery = plant.undoable(model), robot["battery_voltage"]
    sides = [_side(robot, of_effects, believed, side) for side in (LEFT, RIGHT)]
    reserve = max(_reserve(side, of_effects.lost_voltage, battery) for side in sides)
    turning = any(side["emf_mv_q15"] or side["friction_mv"] for side in sides)
    radius = robot["wheel_radius"] / believed["wheel_radius"]
    return {
        **{f"{side}_{name}": value for side, own in zip(SIDES, sides, strict=True) for name, value in own.items()},
        "deadband_mv": of_effects.lost_voltage,
        "reserve_mv": max(reserve, 0.0),
        "half_track_m_q14": robot["half_track"] if turning else 0.0,
        "battery_sags": float(of_effects.supply_resistance > 0),
        "gyro_bias_mrad_s": of_effects.gyro_offset,
        "gyro_scale_q15": 1 / of_effects.gyro_gain - 1,
        "travel_scale_q15": radius / of_effects.travel_gain - 1,
        "count_mismatch_q15": (of_effects.rim[LEFT] - of_effects.rim[RIGHT]) / 2,
    }


@cache
def undone(effect: str) -> tuple[str, ...]:
    """Returns the parameters of an effect that `si_values` undoes: those on which the effect's `Undoable` depends."""
    infos = catalogue.effect(effect).parameters
    presets = {info.name: info.preset for info in infos}

    def undoable(table: Values) -> Undoable:
        return plant.undoable(Model(effect, "diff_drive", "coupled", {}, {effect: table}))

    elsewhere = {info.name: info.minimum if info.preset != info.minimum else info.maximum for info in infos}
    at_presets = undoable(presets)
    return tuple(name for name, value in elsewhere.items() if undoable({**presets, name: value}) != at_presets)


def never_undone(model: Model) -> tuple[str, ...]:
    """Returns the effects of `model`, and the parameters of effects, that `si_values` does not undo."""
    left_out = []
    for name, values in model.effects.items():
        used = undone(name)
        others = [f"{name}.{parameter}" for parameter, value in values.items() if parameter not in used and value]
        left_out += others if used else [name]
    return tuple(left_out)


LEAST_DAMPING = 0.46
"""Least damping ratio of the heading control: below it, turns overshoot and the mission misses waypoints. Measured on
the packaged robot with 6 seeds per value: at 0.49 (3 times its yaw inertia) it reaches all 8 waypoints, at 0.455 (3.5
times its yaw inertia) only 7."""

HIGHEST_BATTERY, HIGHEST_OWN = 20.0, 32.0
"""V: the highest battery voltage that packaged images can measure, and the highest that any mixer allows
(VOLTAGE_MAX_MV)."""


def _heading_damping(robot: Values, believed: Values, controller: Values) -> float:
    """Returns the damping ratio of the heading controller on a robot whose straight drive is compensated.

    This robot reacts to a voltage difference as if its motors had the believed robot's push and hold (`si_values`), and
    each side had the mass M' = M_0 J_yaw / J (J_yaw: `difference_inertia`). With PD control, the loop is second-order.

    Args:
        robot, believed: nominal parameters.
        controller: the constants of the firmware's controllers, SI.
    """
    held = holding_voltage(believed)
    inertia = straight_inertia(believed) * difference_inertia(robot) / mean_inertia(robot)
    time_constant, arm = inertia / (push(believed) * held), held * robot["half_track"]
    return (1 + controller["heading_kd"] / arm) / (2 * math.sqrt(time_constant * controller["heading_kp"] / arm))


def limits_of_loads(of_effects: Undoable) -> list[str]:
    """Returns a line for each side whose constant load is larger than its dry friction."""
    return [
        f"{side}_offset_mv: a load of {abs(load):.3g} N m exceeds the dry friction of {friction:.3g} N m, so the robot "
        "moves at rest, while the firmware learns the gyro's bias"
        for side, load, friction in zip(SIDES, of_effects.load, of_effects.dry_torque, strict=True)
        if abs(load) > friction
    ]


def limits_of_robot(robot: Values, believed: Values, controller: Values | None = None) -> Iterator[str]:
    """Yields a line for each nominal value that is beyond the limits of the controllers and that no setting undoes."""
    known = controller or plain(ROBOT["controller"]["coupled"])
    damping = _heading_damping(robot, believed, known)
    if damping < LEAST_DAMPING:
        own = _heading_damping(believed, believed, known)
        yield (
            f"yaw_inertia: {robot['yaw_inertia']:.3g} kg m^2 at a half-track of {robot['half_track']:.3g} m give turns "
            f"a damping ratio of {damping:.2f} (the believed robot: {own:.2f}); below {LEAST_DAMPING:g} they overshoot"
        )
    battery, floor = robot["battery_voltage"], known["battery_floor"]
    highest = HIGHEST_BATTERY if controller is None else HIGHEST_OWN
    if not floor <= battery <= highest:
        outside = f"is outside the {floor:g} to {highest:g} V that the firmware reckons with"
        yield f"battery_voltage: {battery:.3g} V {outside}"
