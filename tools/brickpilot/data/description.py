"""A data set: a folder with `dataset.toml` and a table of columns for each run.

    name    = "bench-7"
    vehicle = "diff_drive"       # or "motor": a motor and its load; or "skid_steer": two wheels or a track on each side
    frame   = "FLU"              # y left, yaw counter-clockwise positive; or "FRD", the default
    csv     = { delimiter = ",", header = true }  # or semicolon, tab, blank, bar; header = false: columns are 0, 1, ...
    gap_s   = 0                  # pause between runs in s: charge and heat carry over to the next run
    input_timing = "held"        # what an input does between two rows: "held" (the default), "linear" or "unknown"
    as_wired = false             # true: channels that look swapped, reversed or wrongly scaled are not mended
    guessed = []                 # numbers that an importer had to guess, in words

    [signals]                    # column and unit; optional, in this unit: scale, offset, noise_sd, resolution, range
    time          = { column = "t_s", unit = "s" }                       # value = scale * cell + offset
    voltage_left  = { column = "v_left", unit = "V" }
    voltage_right = { column = "v_right", unit = "V" }
    yaw_rate      = { column = "yaw_rate", unit = "deg/s", noise_sd = 0.8, range = [-300, 300] }

    [nominal]                    # known parameters in SI: a value, or { value, sd }; absent parameters are fitted
    mass = 0.6
    wheel_radius = { value = 0.028, sd = 0.0003 }

    [nominal.effects]            # effects that the model already contains, in the same form

    [[runs]]
    name = "straight_half"
    file = "straight_half.csv"   # name and file are needed; the other keys are optional:
    role = "fit"                 # or "held_out"; if absent, the program chooses the role, and says so
    gap_s = 2.5                  # pause before this run, s
    initial = { surge = 0.2 }    # replicate_of = "name" says that this run repeats another run

- Units are written as usual: `mm`, `ft`, `deg/s`, `rpm`, `mV`, `ms`, `rotation`, and `g0` for gravity. Inside the
  program all values are in SI and FRD.
- A blank voltage means that the motor floats; 0 V means that the motor is shorted. A blank output is a missing sample.
  Sampling may be irregular.
- Duty is a share of the battery voltage, -1 to 1. The program uses the measured battery voltage, or else
  `battery_voltage` of `[nominal]`, or else 9 V, with a note. `duty_mean` is `(left + right) / 2`, and `duty_diff` is
  `left - right`.
- `sampling = "instant"` or `"mean"` under `accel_surge` and `accel_sway` says what a sample of an accelerometer is: the
  acceleration at its time, or the mean since the sample before it. The default is the mean, and `discover` notes which
  of the two the data show. The wrong choice changes the fitted inductance and resistance.
- `unsigned = true` under a rotation sensor's channel says that the sensor counts up in both directions. All rotation
  sensors of the simulated machine then do the same.
- Rows closer than the plant's motor step of 0.3 ms are merged, with a note: an input becomes its mean, an output its
  first reading. A channel that is logged faster than it is sampled repeats each sample in several rows; only the first
  of these rows is used. Inputs keep their repeated rows, and files are never changed.
- If a controller follows set points, and neither voltage nor duty is logged, the inputs are a pair, either
  `reference_wheel_speed_left` and `_right`, or `reference_velocity` and `reference_yaw_rate` (a `cmd_vel`); a motor has
  `reference_speed`. Then the model contains a speed controller. State known gains under `[nominal.effects]`; otherwise
  the gains `feedforward` and `integral` are fitted. The value of `emf_constant` then sets the scale of all voltages,
  and a higher proportional gain acts like a lower resistance.
- A motor whose drive controls the current needs `force_per_volt` or `torque_per_volt` under `[nominal]`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from brickpilot import catalogue
from brickpilot.catalogue import EffectInfo
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.input_timing import INPUT_TIMINGS, UNKNOWN_TIMING, InputTiming, Sampling
from brickpilot.data.nominal import Nominal, read_nominal, read_nominal_effects
from brickpilot.data.rows import DELIMITERS, CsvFormat
from brickpilot.data.signals import (
    INITIAL_UNITS,
    INPUT_SETS,
    RATE_OF,
    SIGNALS,
    TURNS_WITH_FRAME,
    VEHICLES,
    Frame,
    Vehicle,
    to_frd,
)
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.data.units import si_factor

Role = Literal["fit", "held_out"]

_TOP = {"name", "vehicle", "frame", "csv", "signals", "nominal", "gap_s", "input_timing", "guessed", "as_wired", "runs"}
_SIGNAL = {"column", "unit", "scale", "offset", "noise_sd", "resolution", "range"}
_TIME = {"column", "unit", "scale", "offset"}
_SAMPLED = ("instant", "mean")  # the two meanings of an accelerometer's sample
_RUN = {"name", "file", "role", "gap_s", "replicate_of", "initial"}

_SET_POINTS = "reference"  # the names of a controller's set points begin with this word
_NO_VOLTAGE = (
    "the inputs are set points, and no voltage is logged: all voltages are scaled to a back EMF constant of {:g} "
    "V s/rad, and a change of the controller's proportional gain looks like a change of the motor's resistance"
)

_LONGEST_GAP_S = 1e8
_SMALLEST_SIZE = 1e-12  # SI: least accepted noise_sd or resolution, far below the last digit of any log


@dataclass(frozen=True)
class Signal:
    """One measured column.

    A value in SI is ``to_si * (scale * raw + offset)``; in FLU its sign may be reversed (`signals.to_frd`). The file
    states ``noise_sd``, ``resolution`` and ``range`` in ``unit``, after scale and offset. In this object these three
    are in SI and the paper's frame, like the signal's values; None: not stated.
    """

    name: str
    column: str | int
    unit: str
    scale: float
    offset: float
    noise_sd: float | None
    resolution: float | None
    range: tuple[float, float] | None
    sampling: Sampling | None = None  # for an accelerometer: whether a sample is instant or a mean
    stated: tuple[str, ...] = ()  # of a rotation sensor: keys, such as `unsigned`, that state an effect and are true

    @property
    def to_si(self) -> float:
        """The number of SI units in one ``unit``."""
        return si_factor(self.unit, SIGNALS[self.name].unit)


@dataclass(frozen=True)
class Description:
    """A checked dataset.toml: the data set, whose runs have no samples yet, and the layout of the run files."""

    dataset: Dataset
    layout: CsvFormat
    as_wired: bool


def describe(toml: TomlFile) -> Description:
    """Checks the tables of a dataset.toml.

    Raises:
        InputError: the message names file, line and key.
    """
    data = toml.data
    toml.known_keys((), data, _TOP, ("name", "vehicle", "signals", "runs"))
    vehicle = cast(Vehicle, toml.choice(("vehicle",), data["vehicle"], VEHICLES))
    frame = cast(Frame, toml.choice(("frame",), data.get("frame", "FRD"), ("FLU", "FRD")))
    signals = _signals(toml, vehicle, frame)
    layout = _layout(toml)
    _check_columns(toml, signals, layout)
    nominal_table = toml.table(("nominal",), data.get("nominal", {}))
    nominal = read_nominal(toml, nominal_table, vehicle)
    effects_table = toml.table(("nominal", "effects"), nominal_table.get("effects", {}))
    effects = _of_channels(signals) | read_nominal_effects(toml, effects_table, frame)
    notes = _notes(data, signals)
    if any(name.startswith(_SET_POINTS) for name in signals):
        effects |= _controllers(effects)
        nominal["emf_constant"] = _scale_of_volts(toml, nominal, signals)
        notes.append(_NO_VOLTAGE.format(nominal["emf_constant"].value))
    gap_s = toml.number(("gap_s",), data.get("gap_s", 0.0), 0.0, _LONGEST_GAP_S)
    timing = toml.choice(("input_timing",), data.get("input_timing", "held"), INPUT_TIMINGS)
    runs = _runs(toml, vehicle, frame, gap_s)
    dataset = Dataset(
        name=toml.file_name(("name",), data["name"]),
        path=toml.path,
        vehicle=vehicle,
        frame=frame,
        signals=signals,
        nominal=nominal,
        nominal_effects=effects,
        runs=runs,
        gap_s=gap_s,
        faults=(),
        notes=tuple(notes),
        input_timing=cast(InputTiming, timing),
        guessed=_guessed(toml, data.get("guessed", [])),
    )
    return Description(dataset, layout, toml.switch(("as_wired",), data.get("as_wired", False)))


def _controllers(stated: Mapping[str, Mapping[str, Nominal]]) -> dict[str, dict[str, Nominal]]:
    """Returns the effects of a controller whose inputs are set points. A parameter with preset 0 is 0 unless stated."""
    return {
        effect.name: {row.name: Nominal(0.0) for row in effect.parameters if row.preset == 0}
        | dict(stated.get(effect.name, {}))
        for effect in catalogue.effects()
        if effect.stated_by == _SET_POINTS
    }


def _scale_of_volts(toml: TomlFile, nominal: Mapping[str, Nominal], signals: Collection[str]) -> Nominal:
    """Returns the back EMF constant without an sd: it is not fitted, because it only scales the unknown voltages.

    Raises:
        InputError: `reference_velocity` needs a length that is not stated; or the motor's drive controls the current.
    """
    for name in ("wheel_radius", "half_track"):
        if "reference_velocity" in signals and name not in nominal:
            message = f"{name} is missing: state the one with which the controller converts reference_velocity"
            toml.refuse(("nominal",), message)
    for name in ("force_per_volt", "torque_per_volt"):
        if name in nominal:
            toml.refuse(("nominal", name), "belongs to a motor whose input is a voltage, not a set point")
    known = nominal.get("emf_constant")
    return Nominal(catalogue.parameter("emf_constant").preset if known is None else known.value)


def _guessed(toml: TomlFile, given: object) -> tuple[str, ...]:
    """Returns an importer's guesses of unstated numbers, such as "960 counts a turn"."""
    if not isinstance(given, list) or not all(isinstance(guess, str) for guess in given):
        toml.refuse(("guessed",), "is not a list of texts")
    return tuple(given)


def _notes(data: Mapping[str, Any], signals: Collection[str]) -> list[str]:
    notes = []
    if "frame" not in data and TURNS_WITH_FRAME & set(signals):
        notes.append("no frame is stated: FRD is assumed, as in the paper: yaw is positive clockwise")
    if data.get("input_timing") == "unknown":
        notes.append(UNKNOWN_TIMING)
    return notes


def _layout(toml: TomlFile) -> CsvFormat:
    table = toml.table(("csv",), toml.data.get("csv", {}))
    toml.known_keys(("csv",), table, {"delimiter", "header"})
    delimiter, header = table.get("delimiter", ","), table.get("header", True)
    if delimiter not in DELIMITERS:
        toml.refuse(("csv", "delimiter"), f"{delimiter!r} is not one of comma, semicolon, tab, blank and bar")
    return CsvFormat(delimiter, toml.switch(("csv", "header"), header))


def _signals(toml: TomlFile, vehicle: Vehicle, frame: Frame) -> dict[str, Signal]:
    table = toml.table(("signals",), toml.data["signals"])
    for name in table:
        if name not in SIGNALS:
            toml.refuse(("signals", name), "unknown signal")
        if vehicle not in SIGNALS[name].vehicles:
            toml.refuse(("signals", name), f"is not a signal of vehicle {vehicle}")
    if "time" not in table:
        toml.refuse(("signals",), "time is missing")
    _check_inputs(toml, table, vehicle)
    if not any(SIGNALS[name].kind == "output" for name in table):
        toml.refuse(("signals",), "no output is measured")
    return {name: _signal(toml, name, entry, frame) for name, entry in table.items()}


def _of_sensors() -> list[EffectInfo]:
    """Returns the effects that a rotation sensor's channel may state."""
    return [effect for effect in catalogue.effects() if effect.stated_by and effect.acts_on == "sensor"]


def _of_channels(signals: Mapping[str, Signal]) -> dict[str, dict[str, Nominal]]:
    """Returns the effects that channels state, such as `unsigned`, with their preset parameters."""
    stated = {key for signal in signals.values() for key in signal.stated}
    return {
        effect.name: {row.name: Nominal(row.preset) for row in effect.parameters}
        for effect in _of_sensors()
        if effect.stated_by in stated
    }


def _check_inputs(toml: TomlFile, table: Mapping[str, Any], vehicle: Vehicle) -> None:
    sets = INPUT_SETS[vehicle]
    present = [name for name in table if SIGNALS[name].kind == "input"]
    wanted = " or ".join(" + ".join(names) for names in sets)
    if not present:
        toml.refuse(("signals",), f"no input; one of {wanted} is needed")
    first = next(names for names in sets if present[0] in names)
    for name in present:
        if name not in first:
            toml.refuse(("signals", name), f"conflicts with {present[0]}; the inputs are {wanted}")
    for name in first:
        if name not in present:
            toml.refuse(("signals", present[0]), f"needs {name} beside it")


def _signal(toml: TomlFile, name: str, value: object, frame: Frame) -> Signal:
    key = ("signals", name)
    entry = toml.table(key, value)
    switches = [effect.stated_by for effect in _of_sensors()] if name in RATE_OF or name in RATE_OF.values() else []
    known = (
        _TIME if name == "time" else _SIGNAL | {"sampling"} if name.startswith("accel_") else _SIGNAL.union(switches)
    )
    toml.known_keys(key, entry, known, ("column", "unit"))
    unit = toml.text((*key, "unit"), entry["unit"])
    try:
        factor = si_factor(unit, SIGNALS[name].unit)
    except ValueError as error:
        toml.refuse((*key, "unit"), str(error))
    scale = toml.number((*key, "scale"), entry.get("scale", 1.0))
    if scale == 0.0 or (name == "time" and scale < 0.0):
        toml.refuse((*key, "scale"), f"{scale:g} cannot scale a column")
    sizes = {size: _size(toml, name, size, entry[size], factor) for size in ("noise_sd", "resolution") if size in entry}
    sampling = toml.choice((*key, "sampling"), entry["sampling"], _SAMPLED) if "sampling" in entry else None
    return Signal(
        name=name,
        column=entry["column"],
        unit=unit,
        scale=scale,
        offset=toml.number((*key, "offset"), entry.get("offset", 0.0)),
        noise_sd=sizes.get("noise_sd"),
        resolution=sizes.get("resolution"),
        range=_range(toml, name, entry["range"], factor, frame) if "range" in entry else None,
        sampling=cast(Sampling | None, sampling),
        stated=tuple(switch for switch in switches if toml.switch((*key, switch), entry.get(switch, False))),
    )


def _size(toml: TomlFile, name: str, size: str, value: object, factor: float) -> float:
    """Returns a noise_sd or a resolution in SI."""
    key = ("signals", name, size)
    number = toml.positive(key, value) * factor
    if not _SMALLEST_SIZE <= number <= SIGNALS[name].largest:
        limits = f"{_SMALLEST_SIZE:g}..{SIGNALS[name].largest:g} {SIGNALS[name].unit}"
        toml.refuse(key, f"{number:g} is outside what is physical, {limits}")
    return number


def _range(toml: TomlFile, name: str, value: object, factor: float, frame: Frame) -> tuple[float, float]:
    key = ("signals", name, "range")
    if not isinstance(value, list) or len(value) != 2:
        toml.refuse(key, "needs [lowest, highest]")
    low, high = (toml.number(key, end) * factor for end in value)
    if not low < high:
        toml.refuse(key, "the lowest is not below the highest")
    return (low, high) if to_frd(name, 1.0, frame) > 0 else (-high, -low)


def _check_columns(toml: TomlFile, signals: Mapping[str, Signal], layout: CsvFormat) -> None:
    taken: dict[str | int, str] = {}
    for name, signal in signals.items():
        key, column = ("signals", name, "column"), signal.column
        if layout.header and not (isinstance(column, str) and column):
            toml.refuse(key, f"{column!r} is not the name of a column")
        if not layout.header and (isinstance(column, bool) or not isinstance(column, int) or not 0 <= column < 10_000):
            toml.refuse(key, f"{column!r} is not a column number from 0, as files without a header need")
        if column in taken:
            toml.refuse(key, f"{column!r} is the column of {taken[column]} already")
        taken[column] = name


def _runs(toml: TomlFile, vehicle: Vehicle, frame: Frame, gap_s: float) -> tuple[Run, ...]:
    entries = toml.data["runs"]
    if not isinstance(entries, list) or not entries:
        toml.refuse(("runs",), "needs at least one [[runs]] table")
    runs: list[Run] = []
    for index, entry in enumerate(entries):
        run = _run(toml, ("runs", index), toml.table(("runs", index), entry), vehicle, frame, gap_s)
        if run.name in {other.name for other in runs}:
            toml.refuse(("runs", index, "name"), f"{run.name!r} is the name of two runs")
        runs.append(run)
    names = {run.name for run in runs}
    for index, run in enumerate(runs):
        if run.replicate_of is not None and run.replicate_of not in names - {run.name}:
            toml.refuse(("runs", index, "replicate_of"), f"{run.replicate_of!r} is not another run")
    return tuple(runs)


def _run(toml: TomlFile, key: Key, entry: dict[str, Any], vehicle: Vehicle, frame: Frame, gap_s: float) -> Run:
    toml.known_keys(key, entry, _RUN, ("name", "file"))
    name = toml.file_name((*key, "name"), entry["name"])
    role = toml.choice((*key, "role"), entry["role"], ("fit", "held_out")) if "role" in entry else None
    replicate_of = toml.text((*key, "replicate_of"), entry["replicate_of"]) if "replicate_of" in entry else None
    return Run(
        name=name,
        file=toml.file_beside((*key, "file"), entry["file"]),
        role=cast(Role | None, role),
        time=np.empty(0),
        inputs={},
        outputs={},
        raw_outputs={},
        gap_s=toml.number((*key, "gap_s"), entry.get("gap_s", gap_s), 0.0, _LONGEST_GAP_S),
        replicate_of=replicate_of,
        initial=_initial(toml, (*key, "initial"), entry.get("initial", {}), vehicle, frame),
    )


def _initial(toml: TomlFile, key: Key, value: object, vehicle: Vehicle, frame: Frame) -> dict[str, float]:
    table = toml.table(key, value)
    toml.known_keys(key, table, INITIAL_UNITS[vehicle])
    return {name: to_frd(name, toml.number((*key, name), number), frame) for name, number in table.items()}
