"""The host plant, called through its C interface `brickpilot_sim.h`; no second implementation of the model is here."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn, get_args

import numpy as np
from cffi import FFI
from numpy.typing import NDArray

from brickpilot.errors import InputError, SimulationError

if TYPE_CHECKING:
    from brickpilot.model import Model

Array = NDArray[np.float64]

VEHICLE_CODES = {"diff_drive": 0, "motor": 1}
PROFILE_CODES = {"coupled": 0, "paper": 1}

_TROUBLE = {
    -2: "an initial value or a step is not finite, or the motor has neither inertia nor mass",
    -3: "out of memory",
    -4: "the time of the samples does not increase",
    -5: "the state grew beyond all bounds",
}


Role = Literal["size", "shape", "place", "switch", "limit", "fixed"]


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of the nominal model or of an effect, SI: a row of the C table, whose header explains every field.

    Attributes:
        linear_unit: the unit where the input of a motor commands a force.
        odd: its sign turns over when left and right are swapped.
        scan: sizes that a search tries one by one; empty: none.
        limits, arm_of, only_with: a signal, and two parameters of the same effect; empty: none.
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
    in_volts: bool
    zero_if_unstated: bool


@dataclass(frozen=True)
class EffectInfo:
    """One effect of the library: a row of the C table, whose header explains every field.

    Attributes:
        acts_on: supply, drive, motor, gear, wheel, body, sensor or timing.
        words: a noun phrase, as in "The simulator lacks ...".
        summary: one sentence for a reader who does not know the name.
        mechanism: supply, drive, timing, motor, gear, bearing, tyre, body, floor or sensor.
        motor_step: s, the longest motor step that still resolves it; 0: as long as without it.
        carries_over: charge or heat that one run leaves changes the next.
        composed: a sum of terms that discovery composes, never a candidate of its own.
    """

    name: str
    acts_on: str
    equation: str
    source: str
    parameters: tuple[ParameterInfo, ...]
    words: str
    summary: str
    mechanism: str
    motor_step: float
    carries_over: bool
    composed: bool


@dataclass(frozen=True)
class State:
    """State of a vehicle in SI, frame of the paper; pairs are left and right, a motor uses the first alone.

    A coupled vehicle with both wheel speeds 0 gets them from surge and yaw_rate; otherwise the wheel speeds decide.
    ``age``: s since power-on; ``charge``: C drawn from the battery since then; ``heat``: K of the windings above their
    surroundings; ``rest``: s at rest before the run, in which they cool.
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    surge: float = 0.0
    sway: float = 0.0
    yaw_rate: float = 0.0
    current: tuple[float, float] = (0.0, 0.0)
    wheel_speed: tuple[float, float] = (0.0, 0.0)
    wheel_angle: tuple[float, float] = (0.0, 0.0)
    age: float = 0.0
    charge: float = 0.0
    heat: tuple[float, float] = (0.0, 0.0)
    rest: float = 0.0


@dataclass(frozen=True)
class OpenLoopRun:
    """Inputs of a run; input k acts from time[k] to time[k + 1].

    Attributes:
        time: (n,) s, strictly increasing.
        inputs: (n, 2) V left and right, or (n, 1) V of a motor; NaN: the motor floats.
        initial: state at time[0]; a mapping names some fields of `State`.
        motor_step, body_step: upper limits, s; 0: 0.0003 and 0.003.
    """

    time: Array
    inputs: Array
    initial: State | Mapping[str, Any] = field(default_factory=State)
    motor_step: float = 0.0
    body_step: float = 0.0


@dataclass(frozen=True)
class Simulated:
    """``outputs``: signal -> (n,), SI, noise-free, those that this vehicle has. ``final``: state at the last sample."""

    outputs: dict[str, Array]
    final: State


@cache
def interface() -> tuple[FFI, Any]:
    """cffi's `ffi` and the loaded library, for what this module does not wrap."""
    folder = Path(__file__).parent
    header = (folder / "brickpilot_sim.h").read_text(encoding="utf-8")
    ffi = FFI()
    ffi.cdef("\n".join(line for line in header.splitlines() if not line.startswith("#")))
    return ffi, ffi.dlopen(str(folder / "libbrickpilot_sim.so"))


def _text(value: Any) -> str:
    if not value:
        return ""
    raw = interface()[0].string(value)
    return raw.decode() if isinstance(raw, bytes) else str(raw)


@cache
def _roles() -> dict[int, Role]:
    """The names of BP_ROLE_SIZE and its like, by their numbers in C."""
    library = interface()[1]
    return {getattr(library, f"BP_ROLE_{role.upper()}"): role for role in get_args(Role)}


def _parameter(info: Any) -> ParameterInfo:
    return ParameterInfo(
        name=_text(info.name),
        unit=_text(info.unit),
        meaning=_text(info.meaning),
        minimum=info.minimum,
        maximum=info.maximum,
        preset=info.preset,
        odd=bool(info.odd),
        role=_roles()[info.role],
        linear_unit=_text(info.linear_unit) or _text(info.unit),
        optional=bool(info.optional),
        trial=info.trial,
        scan=tuple(np.geomspace(info.scan_from, info.scan_to, info.scan_count).tolist()) if info.scan_count else (),
        limits=_text(info.limits),
        arm_of=_text(info.arm_of),
        only_with=_text(info.only_with),
        in_volts=bool(info.in_volts),
        zero_if_unstated=bool(info.zero_if_unstated),
    )


@cache
def parameters() -> tuple[ParameterInfo, ...]:
    """The nominal parameters; the presets are the packaged robot's."""
    library = interface()[1]
    found: list[ParameterInfo] = []
    while info := library.bp_parameter(len(found)):
        found.append(_parameter(info))
    return tuple(found)


@cache
def effects() -> tuple[EffectInfo, ...]:
    """The effect library; the presets are clearly visible sizes."""
    library = interface()[1]
    found: list[EffectInfo] = []
    while info := library.bp_effect(len(found)):
        found.append(
            EffectInfo(
                name=_text(info.name),
                acts_on=_text(info.acts_on),
                equation=_text(info.equation),
                source=_text(info.source),
                parameters=tuple(_parameter(info.parameters[k]) for k in range(info.parameter_count)),
                words=_text(info.words),
                summary=_text(info.summary),
                mechanism=_text(info.mechanism),
                motor_step=info.motor_step,
                carries_over=bool(info.carries_over),
                composed=bool(info.composed),
            )
        )
    return tuple(found)


@cache
def _output_table() -> tuple[tuple[str, str], ...]:
    library = interface()[1]
    found: list[tuple[str, str]] = []
    while name := library.bp_output_name(len(found)):
        found.append((_text(name), _text(library.bp_output_unit(len(found)))))
    return tuple(found)


def outputs() -> dict[str, str]:
    """Name -> unit of every output signal of either vehicle."""
    return dict(_output_table())


def presets(vehicle: str) -> dict[str, float]:
    """Every nominal parameter of a vehicle nobody said anything about; a bare motor has no mass and no wheel: 0."""
    ffi, library = interface()
    built = ffi.gc(library.bp_model_new(VEHICLE_CODES[vehicle], 0), library.bp_model_free)
    value = ffi.new("double *")
    found = {}
    for info in parameters():
        library.bp_model_get(built, info.name.encode(), value)
        found[info.name] = value[0]
    return found


def _refuse(model: Model, name: str, value: float, status: int) -> NoReturn:
    reasons = {-1: "unknown", -2: f"{value} is outside what is physical", -3: "too many effects"}
    raise InputError(reasons[status], file=model.name, field=name)


def build(model: Model) -> Any:
    """The C model, freed with the returned object. Parameters that `model` leaves out keep their presets.

    Raises:
        InputError: a parameter or effect the plant does not know, or a value outside its range.
    """
    ffi, library = interface()
    built = library.bp_model_new(VEHICLE_CODES[model.vehicle], PROFILE_CODES[model.profile])
    if not built:
        raise MemoryError
    built = ffi.gc(built, library.bp_model_free)
    for name, value in model.parameters.items():
        status = library.bp_model_set(built, name.encode(), value)
        if status:
            _refuse(model, name, value, status)
    presets_of = _effect_presets()
    for name, table in model.effects.items():
        known = presets_of.get(name)
        if known is None:
            raise InputError("unknown effect", file=model.name, field=f"effects.{name}")
        for parameter in table:
            if parameter not in known:
                raise InputError("unknown parameter", file=model.name, field=f"effects.{name}.{parameter}")
        values = [*{**known, **table}.values()]
        status = library.bp_model_add_effect(built, name.encode(), ffi.new("double[]", values or [0.0]))
        if status:
            _refuse(model, f"effects.{name}", values[0] if values else 0.0, status)
    return built


@cache
def _effect_presets() -> dict[str, dict[str, float]]:
    """effect -> parameter -> preset, in the table's order."""
    return {effect.name: {info.name: info.preset for info in effect.parameters} for effect in effects()}


def _fill_state(target: Any, state: State | Mapping[str, Any]) -> None:
    chosen = state if isinstance(state, State) else State(**state)
    for name in State.__dataclass_fields__:
        value = getattr(chosen, name)
        if isinstance(value, tuple):
            getattr(target, name)[0], getattr(target, name)[1] = value
        else:
            setattr(target, name, value)


def _read_state(source: Any) -> State:
    values: dict[str, Any] = {name: getattr(source, name) for name in State.__dataclass_fields__}
    for pair in ("current", "wheel_speed", "wheel_angle", "heat"):
        values[pair] = (values[pair][0], values[pair][1])
    return State(**values)


def _fill_run(request: Any, built: Any, model: Model, run: OpenLoopRun, output: Array) -> list[Any]:
    """Fills the C request and returns what must stay alive while it is used."""
    ffi = interface()[0]
    columns = 1 if model.vehicle == "motor" else 2
    time = np.ascontiguousarray(run.time, dtype=np.float64)
    inputs = np.ascontiguousarray(run.inputs, dtype=np.float64)
    if time.ndim != 1 or inputs.shape != (len(time), columns):
        raise ValueError(f"time {time.shape} and inputs {inputs.shape} are not (n,) and (n, {columns})")
    request.model = built
    request.samples = len(time)
    request.motor_step = run.motor_step
    request.body_step = run.body_step
    buffers = [ffi.from_buffer("double[]", array.data) for array in (time, inputs, output)]
    request.time, request.input, request.output = buffers
    _fill_state(request.initial, run.initial)
    return buffers


def simulate(
    jobs: Sequence[tuple[Model, OpenLoopRun]], threads: int = 1, *, signals: Collection[str] | None = None
) -> list[Simulated]:
    """Simulates each run under its model, on up to `threads` threads; the results do not depend on how many.

    Args:
        signals: the outputs to keep, of those that the vehicle has; None: all. Copying the rest out costs more time
            than simulating it.

    Raises:
        SimulationError: of the first run that failed, e.g. because its state diverged.
        InputError: a model the plant refuses.
        ValueError: arrays whose shapes do not fit.
    """
    if not jobs:
        return []
    ffi, library = interface()
    names = [name for name, _ in _output_table()]
    requests = ffi.new("bp_run[]", len(jobs))
    built: dict[int, Any] = {}
    rows = [np.empty((len(run.time), len(names))) for _, run in jobs]
    alive: list[Any] = []
    for index, (model, run) in enumerate(jobs):
        if id(model) not in built:
            built[id(model)] = build(model)
        alive.append(_fill_run(requests[index], built[id(model)], model, run, rows[index]))
    library.bp_simulate(requests, len(jobs), threads)
    results: list[Simulated] = []
    for index, (model, _) in enumerate(jobs):
        status = requests[index].status
        if status:
            raise SimulationError(f"{model.name}, run {index}: {_TROUBLE.get(status, status)}", index, status)
        present = ~np.isnan(rows[index][0])  # the plant gives NaN for what the other kind of vehicle has
        wanted = [k for k, name in enumerate(names) if present[k] and (signals is None or name in signals)]
        columns = rows[index].T[wanted]
        kept = {names[k]: column for k, column in zip(wanted, columns, strict=True)}
        results.append(Simulated(kept, _read_state(requests[index].final)))
    return results
