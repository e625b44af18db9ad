"""The state at the start of a run, or at the start of a window that is cut out of a run.

The measured values may come from several samples (`first_sample`). A sensor effect of the model, such as a scale or a
bias, changes what the sensors read. So the result is the state in which the model's sensors give the measured values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.constants import SIDES
from brickpilot.data.dataset import Run
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

Array = NDArray[np.float64]

# number of first samples: if they all increase or all decrease, the run starts in motion
_START_SAMPLES = 9
_SECANT_STEPS = 4

# Measured signals that make up a state and that a sensor effect may change.
_SENSOR_SIGNALS = SUMMED | {"yaw_rate", *RATE_OF.values()}

GEOMETRY = ("wheel_radius", "half_track", "force_per_volt")
"""The nominal parameters on which the result of `states` depends. The result also depends on `sensor_effects`, and on
the age if a sensor effect depends on the age."""

_Value = Array | float  # (samples,) or (models, samples), or one value for all
_Fields = Mapping[str, _Value | tuple[_Value, ...]]  # field of `plant.State` -> values


def first_sample(run: Run) -> dict[str, float]:
    """Returns signal -> value at a run's first sample. Unmeasured rates are derived from angles or travel."""
    measured = {name: float(values[0]) for name, values in run.outputs.items()}
    for summed, rate in RATE_OF.items():
        if summed in run.outputs and rate not in run.outputs:
            measured[rate] = _starting_rate(run.time, run.outputs[summed])
    return measured


def sensor_effects(model: Model) -> tuple[str, ...]:
    """Returns the effects of the model that change the sensors' readings of the state."""
    return tuple(name for name in model.effects if _changes_readings(name, model.vehicle))


def states(
    models: Sequence[Model],
    measured: Mapping[str, Array],
    stated: Mapping[str, Array],
    age: Array,
    *,
    restart: bool = False,
) -> NDArray[np.void]:
    """Returns (models, samples) the states in which each model's sensors give the measured values, as C holds them.

    The secant method finds the true value of each signal separately. It is exact after three steps if a sensor only
    adds or scales. A signal that does not follow the state, such as a clipped signal or a yaw rate beside two wheel
    speeds, keeps its error.

    Args:
        models: models of one kind of vehicle.
        measured: signal -> (samples,) reading, SI; NaN where blank.
        stated: signal -> (samples,) true value; NaN where no value is stated.
        age: (samples,) time since power-on, s.
        restart: True: unknown values are NaN, so that they stay as simulated. False: unknown values are 0.
    """
    known = {name: np.where(np.isfinite(values), values, np.nan) for name, values in measured.items()}
    known |= {name: _first_known(values, known.get(name, np.nan)) for name, values in stated.items()}
    changed = np.array([[bool(sensor_effects(model))] for model in models])
    read = {  # signal -> (models, samples): whether a sensor effect may have changed the known value
        name: here
        for name in sorted(known.keys() & _SENSOR_SIGNALS)
        if (here := changed & ~np.isnan(known[name]) & np.isnan(stated.get(name, np.nan))).any()
    }
    if not read:
        return _states_of(models, known, age, restart)
    needed = np.stack([*read.values()], axis=-1).reshape(-1, len(read))
    readings = np.tile(np.column_stack([known[name] for name in read]), (len(models), 1))
    wanted = np.where(needed, readings, 0.0)
    values, slopes, given = wanted.copy(), np.ones_like(wanted), wanted.copy()
    built = plant.build_all(models)

    def solved(restart: bool) -> NDArray[np.void]:
        by_signal = zip(read.items(), values.T.reshape(len(read), len(models), -1), strict=True)
        truth = known | {name: np.where(here, own, known[name]) for (name, here), own in by_signal}
        return _states_of(models, truth, age, restart)

    def outputs(rows: NDArray[np.intp]) -> Array:
        """Returns (rows, read): the sensors' readings at `values`, with zero input; 0 where no reading is needed."""
        own = [models[k] for k in (rows // len(age)).tolist()]
        made = _sensor_outputs(own, solved(False).reshape(-1)[rows], tuple(read), built)
        return np.where(needed[rows] & ~np.isnan(made), made, wanted[rows])

    unsolved = np.flatnonzero(needed.any(axis=1))
    given[unsolved] = outputs(unsolved)
    for _ in range(_SECANT_STEPS):
        unsolved = unsolved[np.any(np.abs(wanted[unsolved] - given[unsolved]) > 1e-12, axis=1)]
        if not unsolved.size:
            break
        moved = (wanted[unsolved] - given[unsolved]) / slopes[unsolved]
        values[unsolved] += moved
        now = outputs(unsolved)
        changes = now - given[unsolved]
        given[unsolved] = now
        follows = (np.abs(moved) > 1e-9) & (np.abs(changes) > 0.1 * np.abs(moved))
        slopes[unsolved] = np.where(follows, changes / np.where(follows, moved, 1.0), slopes[unsolved])
        unsolved = unsolved[np.any(changes != 0.0, axis=1)]
    return solved(restart)


def _sensor_outputs(
    models: Sequence[Model], start: NDArray[np.void], names: Sequence[str], built: Mapping[int, Any]
) -> Array:
    """Returns (models, names): what the sensors read in the states `start`, (models,), at zero input."""
    columns = 1 if models[0].vehicle == "motor" else 2
    standing, ordered = OpenLoopRun(np.zeros(1), np.zeros((1, columns))), plant.wanted_names(names)
    requests = np.frombuffer(bytearray(standing.as_c(columns) * len(models)), dtype=plant.layout("bp_run"))
    requests["initial"] = start
    values = np.empty((len(models), len(ordered)))
    starts = np.arange(len(models)) * len(ordered)
    plant.simulate_into(values.reshape(-1), starts, models, requests, ordered, built=built)
    return values[:, [ordered.index(name) for name in names]]


@cache
def _changes_readings(effect: str, vehicle: str) -> bool:
    """Whether an effect, at its preset, changes the sensors' readings of the state at the first sample."""
    rest = np.zeros((1, 1 if vehicle == "motor" else 2))
    moving = State(surge=0.2, yaw_rate=1.0, wheel_speed=(7.0, 3.0), wheel_angle=(2.0, 1.0), heading=0.5, age=1.0)
    base = Model("moving", vehicle, "coupled", catalogue.presets(vehicle))
    run = OpenLoopRun(time=np.zeros(1), inputs=rest, initial=moving)
    plain, changed = (
        simulated.outputs
        for simulated in plant.simulate([(base, run), (dataclasses.replace(base, effects={effect: {}}), run)])
    )
    return any(plain[name][0] != changed[name][0] for name in plain.keys() & _SENSOR_SIGNALS)


def _starting_rate(time: Array, values: Array) -> float:
    """Returns the slope of the first samples if they all increase or all decrease, else 0."""
    first = values[:_START_SAMPLES]
    change = np.diff(first)
    if len(first) < _START_SAMPLES or not (np.all(change > 0) or np.all(change < 0)):
        return 0.0
    return float(np.polyfit(time[:_START_SAMPLES] - time[0], first, 1)[0])


def _first_known(value: _Value, *others: _Value) -> Array:
    """Returns `value`; each NaN is replaced by the value of the first of `others` that is not NaN there."""
    for other in others:
        value = np.where(np.isnan(value), other, value)
    return np.asarray(value)


def _states_of(models: Sequence[Model], truth: Mapping[str, Array], age: Array, restart: bool) -> NDArray[np.void]:
    """Returns (models, samples) states. `truth`: signal -> (samples,) or (models, samples), NaN where unknown."""
    unknown, layout = np.nan if restart else 0.0, plant.layout("bp_state")
    made = np.full((len(models), len(age), layout.itemsize // 8), unknown).view(layout)[..., 0]
    geometry = {name: np.array([[model.parameters.get(name, np.nan)] for model in models]) for name in GEOMETRY}
    fields = _motor_state if models[0].vehicle == "motor" else _vehicle_state
    for name, own in fields(lambda signal: truth.get(signal, np.nan), geometry, unknown).items():
        if isinstance(own, tuple):
            made[name][..., 0], made[name][..., 1] = own
        else:
            made[name] = own
    if not restart:
        made["age"] = age
    return made


def _motor_state(get: Callable[[str], _Value], geometry: Mapping[str, Array], unknown: float) -> _Fields:
    radius, direct = geometry["wheel_radius"], geometry["force_per_volt"] > 0
    per = 1 / np.where(np.isnan(radius) | (radius == 0), np.inf, radius)
    speed, angle = (
        # The plant gives the speed and angle of a linear motor in m/s and m.
        _first_known(np.where(direct, get(linear), _first_known(get(turning), get(linear) * per)), unknown)
        for turning, linear in (("speed", "velocity"), ("angle", "position"))
    )
    return {
        "wheel_speed": (speed, 0.0),
        "wheel_angle": (angle, 0.0),
        "current": (_first_known(get("current"), unknown), 0.0),
    }


def _vehicle_state(get: Callable[[str], _Value], geometry: Mapping[str, Array], unknown: float) -> _Fields:
    radius, half_track = geometry["wheel_radius"], geometry["half_track"]
    left, right = (
        _first_known(get(f"wheel_speed_{side}"), get(f"wheel_velocity_{side}") * (1 / radius)) for side in SIDES
    )
    surge = _first_known(get("surge"), radius * (left + right) / 2, unknown)
    yaw_rate = _first_known(get("yaw_rate"), radius * (left - right) / (2 * half_track), unknown)
    # At a start, unmeasured wheels roll as the vehicle moves. At a restart they stay as simulated: `unknown` is NaN.
    measured = ~np.isnan(left + right)
    rolling = [(surge + sign * half_track * yaw_rate) / radius + unknown for sign in (1, -1)]
    return {
        "heading": _first_known(get("yaw_angle"), unknown),
        "surge": surge,
        "sway": _first_known(get("sway"), unknown),
        "yaw_rate": yaw_rate,
        "wheel_speed": (np.where(measured, left, rolling[0]), np.where(measured, right, rolling[1])),
        "wheel_angle": tuple(
            _first_known(get(f"wheel_angle_{side}"), get(f"wheel_travel_{side}") * (1 / radius), unknown)
            for side in SIDES
        ),
        "current": tuple(_first_known(get(f"current_{side}"), unknown) for side in SIDES),
    }
