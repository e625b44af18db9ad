"""The parts that an explanation is made of: effects of the library, and values that differ from run to run.

Composed terms are parts, too: see `compose`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.dataset import Nominal
from brickpilot.discover import numbers
from brickpilot.fit.parameters import DECADE, Free, Plan
from brickpilot.fit.residual import MOTOR_STEP_S
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, State
from brickpilot.vehicle.replay import RUN_KINDS

_COMMAND = "voltage"  # the only limited signal that is a command; other limited signals are readings
_UNSCALED = frozenset({"order", "phase", "phase_difference", "frequency", "wavelength"})  # have no usual size
_ODDS = {"common": numbers.COMMON, "usual": numbers.USUAL, "rare": numbers.RARE}


@dataclass(frozen=True)
class Part:
    """An effect with some of its parameters free. The other parameters stay at `fixed`."""

    effect: str
    free: tuple[str, ...]
    fixed: Mapping[str, float] = field(hash=False)

    @property
    def name(self) -> str:
        """The name, unique among parts."""
        return self.effect

    @property
    def is_periodic(self) -> bool:
        """Whether the effect repeats with the angle of a wheel, at an order that is fitted."""
        return "order" in self.free

    @property
    def infos(self) -> dict[str, ParameterInfo]:
        """Parameter -> its row of the effect table, for all parameters of the effect."""
        return {row.name: row for row in catalogue.effect(self.effect).parameters}

    def range_of(self, name: str) -> tuple[float, float]:
        """Returns the least and the largest value that a parameter may have."""
        return self.infos[name].minimum, self.infos[name].maximum

    @property
    def log_odds(self) -> float:
        """The log of the prior odds that a machine has this effect and its simulator lacks the effect."""
        return math.log(_ODDS[catalogue.effect(self.effect).prior])

    @property
    def mechanism(self) -> str:
        return catalogue.effect(self.effect).mechanism

    @property
    def contains(self) -> tuple[str, ...]:
        """The names of the parts whose laws this part's law contains."""
        return catalogue.effect(self.effect).contains

    @property
    def made_of(self) -> tuple[str, ...]:
        """The names of the parts whose sum is this law, if only the law's first parameter is free."""
        info = catalogue.effect(self.effect)
        return info.made_of if self.free == (info.parameters[0].name,) else ()

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        """Returns `base` with this part at `values`. The part's free parameters come last."""
        table = {name: values.get(name, self.fixed.get(name, row.preset)) for name, row in self.infos.items()}
        model = dataclasses.replace(base.model, effects={**base.model.effects, self.effect: table})
        added = tuple(
            Free(f"{self.effect}.{name}", row, None, natural=_natural_size(row, base.model))
            for name, row in self.infos.items()
            if name in self.free
        )
        return base.joined(model, added)

    def removed_from(self, model: Model) -> Model:
        """Returns `model` without this part."""
        effects = {name: table for name, table in model.effects.items() if name != self.effect}
        return dataclasses.replace(model, effects=effects)

    def owns(self, free: Free) -> bool:
        """Returns whether a free parameter belongs to this part."""
        return free.effect is not None and free.effect[0] == self.effect

    def values_in(self, model: Model) -> Mapping[str, float]:
        """Returns the part's values in `model`, for `starting`."""
        return model.effects[self.effect]


@dataclass(frozen=True)
class RunPart(Part):
    """Values of one kind, such as delays: a value for each fit run. `effect` is the kind; `free` lists the runs."""

    @property
    def infos(self) -> dict[str, ParameterInfo]:
        kind = RUN_KINDS[self.effect]
        row = ParameterInfo(
            self.effect, kind.unit, kind.words, kind.low, kind.high, 0.0, False, "size", kind.unit, False, 0.0, (),
            "", "", "", "", False, "", "", "",
        )  # fmt: skip
        return dict.fromkeys(self.free, row)

    @property
    def log_odds(self) -> float:
        """The log of the prior odds: `numbers.RARE` for each run's value."""
        return math.log(numbers.RARE) * len(self.free)

    @property
    def mechanism(self) -> str:
        return RUN_KINDS[self.effect].mechanism

    @property
    def contains(self) -> tuple[str, ...]:
        return ()

    @property
    def made_of(self) -> tuple[str, ...]:
        return ()

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        kind = RUN_KINDS[self.effect]
        table = {run: values.get(run, 0.0) for run in self.free}
        model = dataclasses.replace(base.model, by_run={**base.model.by_run, self.effect: table})
        known, infos = Nominal(0.0, kind.sd), self.infos
        free = tuple(
            Free(f"{self.effect}@{run}", info, known, unit=kind.sd, centred=kind.low < 0) for run, info in infos.items()
        )
        return base.joined(model, free)

    def removed_from(self, model: Model) -> Model:
        by_run = {kind: table for kind, table in model.by_run.items() if kind != self.effect}
        return dataclasses.replace(model, by_run=by_run)

    def values_in(self, model: Model) -> Mapping[str, float]:
        return model.by_run[self.effect]


def library_parts(base: Model, measured: Collection[str] | None = None) -> list[Part]:
    """Returns, for each effect that `base` lacks, a part for each set of its parameters that are fitted together.

    Args:
        measured: the compared signals. A sensor effect that changes none of these signals is left out. Of effects that
            change these signals in the same way, the effect that changes the largest number stays. None: all stay.
    """
    found, read = [], set[frozenset[tuple[str, bytes]]]()
    has_current_loop = any(base.parameters.get(name, 0.0) != 0.0 for name in ("force_per_volt", "torque_per_volt"))
    sensors = {one.name: readings_of(one.name, base.vehicle) for one in catalogue.effects() if one.acts_on == "sensor"}
    for info in sorted(catalogue.effects(), key=lambda one: -len(sensors.get(one.name, ()))):
        if info.name in sensors and info.is_searched and measured is not None:
            readings = frozenset(one for one in sensors[info.name].items() if one[0] in measured)
            if not readings or readings in read:
                continue
            read.add(readings)
        if info.name in base.effects or not info.is_searched or (info.acts_on == "supply" and has_current_loop):
            continue  # a current loop compensates the supply
        usable = [one for one in info.parameters if _adds_something(one, base)]
        for free in _sets_of_parameters(usable):
            off = {one.name: one.preset if one.role == "shape" else 0.0 for one in usable if one.name not in free}
            found.append(Part(info.name, free, off))
    return found


def run_parts(runs: Sequence[str]) -> list[RunPart]:
    """Returns a part for each kind of value that may differ from run to run; none for fewer than three fit runs."""
    return [RunPart(kind, tuple(runs), {}) for kind in RUN_KINDS] if len(runs) > 2 else []


def _adds_something(row: ParameterInfo, base: Model) -> bool:
    """Returns whether `base` has the two sides that a parameter may need, but no parameter that acts like it."""
    sided = base.vehicle != "motor" or not row.odd
    return sided and not (row.same_as and base.parameters.get(row.same_as, 0.0) != 0)


@cache
def readings_of(effect: str, vehicle: str) -> Mapping[str, bytes]:
    """Returns signal -> its samples in a simulated run with fast motion, for each signal that `effect` changes."""
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
    return {name: changed[name].tobytes() for name in plain if np.any(plain[name] != changed.get(name, plain[name]))}


def _sets_of_parameters(usable: list[ParameterInfo]) -> list[tuple[str, ...]]:
    """Returns the sets of an effect's parameters that are freed together.

    An optional parameter is freed together with the main parameters, and also alone if it acts without them. If an
    effect holds three laws, each law is freed alone.
    """
    main = tuple(one.name for one in usable if not one.optional and one.role != "switch")
    optional = [one.name for one in usable if one.optional]
    signed = all(is_signed(one) for one in usable)
    sets = [main, *((name,) for name in optional if signed)]
    if not signed or len(usable) == 2:
        sets += [(*main, name) for name in optional]
    return list(dict.fromkeys(one for one in sets if one))


def is_signed(row: ParameterInfo) -> bool:
    """Returns whether a parameter is a size that may be negative."""
    return row.minimum < 0 and row.role != "shape"


def least_of(info: ParameterInfo) -> float:
    """Returns the least size, SI, of a named effect: one simulation step for a delay or a lag, 0 for all other sizes.

    The models lack fast dynamics such as a tyre's compliance: a very short delay would stand in for these dynamics.
    """
    return MOTOR_STEP_S if info.unit == "s" and info.role == "size" and info.minimum == 0 else 0.0


def read_limits(part: Part) -> list[tuple[str, str]]:
    """Returns the parameters of a part that limit a sensor's reading, each with the sensor's signal."""
    return [(name, row.limits) for name, row in part.infos.items() if row.limits not in ("", _COMMAND)]


def limit_of(part: Part) -> ParameterInfo | None:
    """Returns the parameter that is a limit; None if the effect has none."""
    return next((row for row in part.infos.values() if row.role == "limit"), None)


def scanned_parameter(part: Part) -> ParameterInfo | None:
    """Returns the parameter whose sizes are tried one by one because only some sizes show the effect; or None."""
    return next((row for row in part.infos.values() if row.scan), None)


def switch_settings(part: Part) -> list[dict[str, float]]:
    """Returns the settings of a part's switches that are tried: all off, and each switch alone on."""
    return [{}, *({name: row.maximum} for name, row in part.infos.items() if row.role == "switch")]


def _natural_size(info: ParameterInfo, model: Model) -> float:
    """Returns a usual size of an effect's parameter on this vehicle, SI; 0 if no size is usual."""
    if info.role == "place" and info.unit == "m" and not info.arm_of:
        return 2 * _sizes(model)["m"] / DECADE  # the prior's sd, `DECADE` times this size, is then a track width
    if info.name in _UNSCALED or info.role in ("place", "limit", "switch") or info.arm_of:
        return 0.0
    return (info.preset or info.trial) * scale_of(info.unit, model)


def scale_of(unit: str, model: Model) -> float:
    """Returns the ratio of a usual quantity in `unit` on this vehicle to the same quantity on the packaged robot.

    The presets of the catalogue are sizes for the packaged robot.
    """
    own, packaged = _sizes(model), _sizes(rcx())
    return own[unit] / packaged[unit] if unit in own else 1.0


def _sizes(model: Model) -> dict[str, float]:
    """Returns unit -> a large value in this unit for a vehicle: the value at stall or at no-load speed."""
    known, robot = model.nominal, rcx().parameters
    volts = known["battery_voltage"] or robot["battery_voltage"]
    direct = known["force_per_volt"] or known["torque_per_volt"]
    torque = direct * volts if direct else known["torque_constant"] * volts / known["resistance"]
    radius = 1.0 if known["force_per_volt"] else known["wheel_radius"] or 0.04
    if direct:
        speed = torque / known["viscous_friction"] if known["viscous_friction"] else 1.0
    else:
        speed = volts / known["emf_constant"]
    return {
        "V": volts,
        "N m": torque,
        "N": torque / radius,
        "N m s/rad": torque / speed,
        "N s^2/m^2": torque / radius / (speed * radius) ** 2,
        "rad/s": speed,
        "kg": known["mass"] or 1.0,
        "m": known["half_track"] or robot["half_track"],
        "ohm": known["resistance"] or 1.0,
        "m/(N s)": speed * radius**2 / torque,
    }


@dataclass(frozen=True)
class Excitation:
    """The largest commands and readings of the runs, and the periodic motion of the wheels.

    Attributes:
        largest: signal -> its largest reading, SI; and "voltage" -> the largest command, V.
        orders: orders (periods per turn) at which the wheels' acceleration repeats.
        least_order: the lowest order of a periodic effect; at a lower order the runs show less than about one period.
        windowed: whether short windows are simulated, each from its measured state, so that wheels keep their phase.
    """

    largest: Mapping[str, float]
    orders: tuple[float, ...] = ()
    least_order: float = 0.9
    windowed: bool = False
