"""Calls the host plant through its C interface `brickpilot_sim.h`. The model itself is in C only."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brickpilot import catalogue
from brickpilot.compiled import interface
from brickpilot.errors import InputError, SimulationError

if TYPE_CHECKING:
    from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

MOST_LANES = 8
"""The largest number of runs that the compiled plant simulates side by side."""

TROUBLE = {  # status of the C interface -> its meaning
    -2: "an initial value or a step is not finite, or the motor has neither inertia nor mass",
    -3: "out of memory",
    -4: "the time of the samples does not increase",
    -5: "the state diverged",
}


@dataclass(frozen=True)
class State:
    """State of a vehicle in SI and in the paper's frame. Pairs are left and right; a motor uses only the first.

    In a coupled vehicle the wheel speeds set surge and yaw_rate, unless both wheel speeds are 0.

    Attributes:
        age: time since power-on, s.
        charge: charge drawn from the battery since power-on, C.
        heat: temperature of the windings above their surroundings, K.
        rest: time at rest before the run, s, in which the windings cool.
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
        initial: state at time[0]; a mapping gives some fields of `State`; the others are 0.
        motor_step, body_step: upper limits of the simulation steps, s; 0: `constants.MOTOR_STEP_S` and
            `constants.STEP_S`.
    """

    time: Array
    inputs: Array
    initial: State | Mapping[str, Any] = field(default_factory=State)
    motor_step: float = 0.0
    body_step: float = 0.0

    def as_c(self, columns: int) -> bytes:
        """Returns the run as C reads it, without model and outputs. The bytes hold addresses of arrays of `self`.

        Raises:
            ValueError: the shapes do not fit a vehicle with `columns` inputs.
        """
        time, inputs, row = self._as_c
        if inputs.shape != (len(time), columns):
            raise ValueError(f"time {time.shape} and inputs {inputs.shape} are not (n,) and (n, {columns})")
        return row

    def __getstate__(self) -> dict[str, Any]:
        """Returns the fields for a copy or a pickle, without the addresses of this object's arrays."""
        return {name: value for name, value in vars(self).items() if name != "_as_c"}

    @cached_property
    def _as_c(self) -> tuple[Array, Array, bytes]:
        """Time and inputs as C reads them, and the row of `bp_run` that points to them."""
        time = np.ascontiguousarray(self.time, dtype=np.float64)
        inputs = np.ascontiguousarray(self.inputs, dtype=np.float64)
        if time.ndim != 1:
            raise ValueError(f"time {time.shape} is not (n,)")
        row = np.array(
            (0, len(time), _address(time), _address(inputs), _initial(self.initial), self.motor_step, self.body_step,
             0, 0, 0, _NOTHING, 0, 0, 0),
            dtype=layout("bp_run"),
        )  # fmt: skip
        return time, inputs, row.tobytes()


@dataclass(frozen=True)
class Simulated:
    """The result of a simulation.

    Attributes:
        names: the wanted signals, in the order of the plant's table (`wanted_names`).
        columns: (names, n), the signals, SI, without noise; NaN for a signal that this vehicle does not have.
        last: the last state, as the compiled plant holds it.
    """

    names: tuple[str, ...]
    columns: Array
    last: np.void

    @cached_property
    def outputs(self) -> dict[str, Array]:
        """Signal -> (n,), for the signals that this vehicle has."""
        return by_signal(self.names, self.columns)

    @cached_property
    def final(self) -> State:
        """State at the last sample."""
        fields: Any = self.last.item()
        values: list[Any] = [field if isinstance(field, float) else tuple(field.tolist()) for field in fields]
        return State(*values)


def by_signal(names: Sequence[str], columns: Array) -> dict[str, Array]:
    """Returns signal -> (n,) from (names, n), for the signals that the vehicle has."""
    return {name: column for name, column in zip(names, columns, strict=True) if column[0] == column[0]}


def _refuse(model: Model, name: str, value: float, status: int) -> NoReturn:
    reasons = {-1: "unknown", -2: f"{value} is outside the physical range", -3: "too many effects"}
    raise InputError(reasons[status], file=model.name, field=name)


def build(model: Model) -> Any:
    """Returns the C model. Its memory is freed together with the returned object. Absent parameters keep their presets.

    Raises:
        InputError: a parameter or effect the plant does not know, or a value outside its range.
    """
    ffi, library = interface()
    built = library.bp_model_new(catalogue.VEHICLE_CODES[model.vehicle], catalogue.PROFILE_CODES[model.profile])
    if not built:
        raise MemoryError
    built = ffi.gc(built, library.bp_model_free)
    for name, value in model.parameters.items():
        if status := library.bp_model_set(built, name.encode(), value):
            _refuse(model, name, value, status)
    for name, table in model.effects.items():
        known = _effect_presets().get(name)
        if known is None:
            raise InputError("unknown effect", file=model.name, field=f"effects.{name}")
        for parameter in table:
            if parameter not in known:
                raise InputError("unknown parameter", file=model.name, field=f"effects.{name}.{parameter}")
        values = [*{**known, **table}.values()]
        if status := library.bp_model_add_effect(built, name.encode(), ffi.new("double[]", values or [0.0])):
            _refuse(model, f"effects.{name}", values[0] if values else 0.0, status)
    return built


def build_all(models: Iterable[Model]) -> dict[int, Any]:
    """Returns id(model) -> the C model that `build` returns."""
    return {key: build(model) for key, model in {id(model): model for model in models}.items()}


@dataclass(frozen=True)
class Undoable:
    """The part of a model's effects that the firmware can undo. `bp_undoable` in the C interface explains the fields.

    Pairs are left and right.
    """

    flux: tuple[float, float]
    rim: tuple[float, float]
    drive_gain: tuple[float, float]
    dry_torque: tuple[float, float]
    root_torque: tuple[float, float]
    load: tuple[float, float]
    lost_voltage: float
    supply_resistance: float
    gyro_offset: float
    gyro_gain: float
    travel_gain: float


def undoable(model: Model) -> Undoable:
    """Returns the part of the model's effects that the firmware can undo, summed over the effects.

    Raises:
        InputError: as `build`.
    """
    ffi, library = interface()
    sums = ffi.new("bp_undoable *")
    library.bp_model_undoable(build(model), sums)
    fields = ((name, getattr(sums, name)) for name in Undoable.__dataclass_fields__)
    values: dict[str, Any] = {name: own if isinstance(own, float) else (own[0], own[1]) for name, own in fields}
    return Undoable(**values)


@cache
def _effect_presets() -> dict[str, dict[str, float]]:
    """Returns effect -> parameter -> preset, in the table's order."""
    return {effect.name: {info.name: info.preset for info in effect.parameters} for effect in catalogue.effects()}


def wanted_names(signals: Collection[str] | None) -> tuple[str, ...]:
    """Returns the outputs of the table that are in `signals`, in the table's order; None: all."""
    return tuple(name for name in catalogue.outputs() if signals is None or name in signals)


@cache
def _columns_of(names: tuple[str, ...]) -> NDArray[np.int32]:
    """Returns the positions of the outputs `names` in the table."""
    table = wanted_names(None)
    return np.array([table.index(name) for name in names], dtype=np.int32)


@cache
def layout(name: str) -> np.dtype[np.void]:
    """Returns the layout of a structure of the C interface."""
    fields: np.dtype[np.void] = np.dtype(_layout_of(interface()[0].typeof(name)))
    return fields


def _layout_of(kind: Any) -> Any:
    if kind.kind == "struct":
        names, fields = zip(*kind.fields, strict=True)
        formats, offsets = [_layout_of(field.type) for field in fields], [field.offset for field in fields]
        size = interface()[0].sizeof(kind)
        return {"names": names, "formats": formats, "offsets": offsets, "itemsize": size}
    if kind.kind == "array":
        return (_layout_of(kind.item), (kind.length,))
    return np.uintp if kind.kind == "pointer" else {"double": np.float64, "int": np.intc}[kind.cname]


_state_values = attrgetter(*State.__dataclass_fields__)
"""Returns the fields of a `State` as a tuple, in the order of `bp_state` in C."""

_NOTHING = _state_values(State())


def _initial(state: State | Mapping[str, Any]) -> tuple[Any, ...]:
    values: tuple[Any, ...] = _state_values(state if isinstance(state, State) else State(**state))
    return values


def simulate(
    jobs: Sequence[tuple[Model, OpenLoopRun]],
    threads: int = 1,
    *,
    signals: Collection[str] | None = None,
    lanes: int = MOST_LANES,
) -> list[Simulated]:
    """Simulates each run under its model, on up to `threads` threads. Their number does not change the results.

    Neighbouring runs in `jobs` with the same sample times run side by side in vector registers.

    Args:
        signals: the outputs to keep; None: all outputs of the vehicle. Copying an output takes longer than simulating
            it.
        lanes: the largest number of runs side by side; the processor may allow fewer. The number does not change the
            results.

    Raises:
        SimulationError: a run failed, e.g. because its state diverged; the error is that of the first such run.
        InputError: a model the plant refuses.
        ValueError: arrays whose shapes do not fit.
    """
    if not jobs:
        return []
    names = wanted_names(signals)
    ends = np.cumsum([len(run.time) * len(names) for _, run in jobs]).tolist()
    values, models = np.empty(ends[-1]), [model for model, _ in jobs]
    rows = [run.as_c(1 if model.vehicle == "motor" else 2) for model, run in jobs]
    requests = np.frombuffer(bytearray().join(rows), dtype=layout("bp_run"))
    last = simulate_into(values, [0, *ends[:-1]], models, requests, names, threads, lanes)
    columns = (own.reshape(len(names), -1) for own in np.split(values, ends[:-1]))
    return [Simulated(names, own, end) for own, end in zip(columns, last, strict=True)]


def simulate_into(
    values: Array,
    starts: ArrayLike,
    models: Sequence[Model],
    requests: NDArray[np.void],
    names: tuple[str, ...],
    threads: int = 1,
    lanes: int = MOST_LANES,
    built: Mapping[int, Any] | None = None,
) -> NDArray[np.void]:
    """Simulates as `simulate` does, but writes into the caller's `values` (n,).

    Args:
        starts: (runs, models) index in `values` at which the outputs of each run begin: all samples of the first name,
            then all samples of the next name. The shape is (models,) if `requests` has the shape (models,).
        requests: the runs as `OpenLoopRun.as_c` gives them, (runs, models): each run under every model; or (models,):
            each run under its own model. The call writes to `requests`. The caller has to keep the arrays to which the
            requests point until the call returns.
        names: the outputs to keep, as `wanted_names` gives them.
        built: the result of `build_all` for the models; None: this function builds the models.

    Returns the last states, in the shape of `requests`, as the compiled plant holds them.
    """
    ffi, library = interface()
    if built is None:
        built = build_all(models)
    at = {key: int(ffi.cast("uintptr_t", model)) for key, model in built.items()}
    columns = _columns_of(names)
    requests["model"] = [at[id(model)] for model in models]
    requests["output"] = _address(values) + 8 * np.asarray(starts)
    requests["columns"], requests["column_count"] = _address(columns), len(names)
    library.bp_simulate_lanes(ffi.cast("bp_run *", requests.ctypes.data), requests.size, threads, lanes)
    failed = np.flatnonzero(requests["status"])
    if len(failed):
        index = int(failed[0])
        name, status = models[index % len(models)].name, int(requests["status"].flat[index])
        raise SimulationError(f"{name}, run {index}: {TROUBLE.get(status, status)}", index, status)
    return np.asarray(requests["final"])


def _address(array: NDArray[Any]) -> int:
    place: int = array.__array_interface__["data"][0]
    return place
