"""The state that a simulation starts from, so that the model's sensors read what was measured at that sample.

A sensor effect of the model, such as a scale or a bias, lies between state and reading. The state is therefore solved
for: the one at which the model's sensors give the measured values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Run
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

Array = NDArray[np.float64]

# A run whose first samples all move in one direction starts in motion.
_START_SAMPLES = 9
_SECANT_STEPS = 4

# Measured signals that make up a state and that a sensor effect may change.
_SENSOR_SIGNALS = SUMMED | {"yaw_rate", *RATE_OF.values()}

_GEOMETRY = ("wheel_radius", "half_track", "force_per_volt")
"""The nominal parameters that a state made of measured values depends on: see `_state_of`."""


@dataclass(frozen=True)
class Reading:
    """What is known at one sample, from which a state is made.

    Attributes:
        known: signal -> value, SI.
        read: the signals in `known` that are sensor readings, which a sensor effect of the model may change; empty:
            the model has no such effect, and `known` is the state itself.
        age: s since power-on.
    """

    known: Mapping[str, float]
    read: tuple[str, ...]
    model: Model
    age: float

    def state(self, values: Array) -> State:
        """Returns the state in which the signals `read` have these true values."""
        truth = dict(self.known) | dict(zip(self.read, values.tolist(), strict=True))
        return _state_of(truth, self.model, self.age)


def initial_states(starts: Sequence[tuple[Run, Model]]) -> list[State]:
    """Returns the state at the first sample of each run under each model.

    A value is what the file states, else what the first sample measured, else 0. Models that give one state share it.
    """
    measured = {id(run): _first_sample(run) for run in {id(run): run for run, _ in starts}.values()}
    shared: dict[tuple[object, ...], State] = {}
    states, unsolved = [State()] * len(starts), []
    for k, (run, model) in enumerate(starts):
        if _has_sensor_effect(model):
            unsolved.append(k)
            continue
        key = (id(run), model.vehicle, *(model.parameters.get(name) for name in _GEOMETRY))
        if key not in shared:
            shared[key] = reading(measured[id(run)], model, stated=run.initial or {}).state(np.empty(0))
        states[k] = shared[key]
    readings = [reading(measured[id(starts[k][0])], starts[k][1], stated=starts[k][0].initial or {}) for k in unsolved]
    for k, state in zip(unsolved, solve(readings), strict=True):
        states[k] = state
    return states


def _first_sample(run: Run) -> dict[str, float]:
    """Returns what was measured at a run's first sample, and the rates of signals that sum up."""
    measured = {name: float(values[0]) for name, values in run.outputs.items()}
    for summed, rate in RATE_OF.items():
        if summed in run.outputs and rate not in run.outputs:
            measured[rate] = _starting_rate(run.time, run.outputs[summed])
    return measured


def _has_sensor_effect(model: Model) -> bool:
    return any(_changes_readings(name, model.vehicle) for name in model.effects)


def reading(
    measured: Mapping[str, float],
    model: Model,
    *,
    stated: Mapping[str, float] = MappingProxyType({}),
    age: float = 0.0,
) -> Reading:
    """Returns what is known at a sample. `measured` are readings, NaN where blank; `stated` are true values."""
    known = {name: value for name, value in measured.items() if np.isfinite(value)} | dict(stated)
    read = tuple(name for name in known if name in _SENSOR_SIGNALS and name not in stated)
    return Reading(known, read if _has_sensor_effect(model) else (), model, age)


def restarts(readings: Sequence[Reading]) -> list[State]:
    """Returns the states of `solve` for `plant.OpenLoopRun.restarts`: what was not measured is NaN, and so stays."""
    return [_restart(one, state) for one, state in zip(readings, solve(readings), strict=True)]


def _restart(one: Reading, state: State) -> State:
    nan, known = float("nan"), one.known
    if one.model.vehicle == "motor":
        speed, angle, current = (
            any(name in known for name in names)
            for names in (("speed", "velocity"), ("angle", "position"), ("current",))
        )
    else:
        speed, angle, current = (
            all(any(f"{name}_{side}" in known for name in names) for side in ("left", "right"))
            for names in (("wheel_speed", "wheel_velocity"), ("wheel_angle", "wheel_travel"), ("current",))
        )
    return State(
        x=nan,
        y=nan,
        heading=state.heading if "yaw_angle" in known else nan,
        surge=state.surge if speed or "surge" in known else nan,
        sway=state.sway if "sway" in known else nan,
        yaw_rate=state.yaw_rate if speed or "yaw_rate" in known else nan,
        current=state.current if current else (nan, nan),
        wheel_speed=state.wheel_speed if speed else (nan, nan),
        wheel_angle=state.wheel_angle if angle else (nan, nan),
        age=nan,
        charge=nan,
        heat=(nan, nan),
        rest=nan,
    )


def solve(readings: Sequence[Reading]) -> list[State]:
    """Returns the states in which the models' sensors give the readings.

    Each signal is solved by secant steps of its own, which is exact after three where a sensor adds or scales. A signal
    that does not follow the state keeps its error: one that is clipped, or a yaw rate beside two wheel speeds.
    """
    wanted = [np.array([one.known[name] for name in one.read]) for one in readings]
    values, slopes = list(wanted), [np.ones_like(one) for one in wanted]
    states = [one.state(at) for one, at in zip(readings, values, strict=True)]
    unsolved = [k for k, one in enumerate(readings) if one.read]
    given = dict(zip(unsolved, _sensor_outputs(readings, states, unsolved), strict=True))
    for _ in range(_SECANT_STEPS):
        unsolved = [k for k in unsolved if np.any(np.abs(wanted[k] - given[k]) > 1e-12)]
        moved = {k: (wanted[k] - given[k]) / slopes[k] for k in unsolved}
        for k in unsolved:
            values[k] = values[k] + moved[k]
            states[k] = readings[k].state(values[k])
        outputs = dict(zip(unsolved, _sensor_outputs(readings, states, unsolved), strict=True))
        changes = {k: outputs[k] - given[k] for k in unsolved}
        given |= outputs
        for k in unsolved:
            follows = (np.abs(moved[k]) > 1e-9) & (np.abs(changes[k]) > 0.1 * np.abs(moved[k]))
            slopes[k] = np.where(follows, changes[k] / np.where(follows, moved[k], 1.0), slopes[k])
        unsolved = [k for k in unsolved if changes[k].any()]
    return states


def _sensor_outputs(readings: Sequence[Reading], states: Sequence[State], which: Sequence[int]) -> list[Array]:
    """Returns, for the readings numbered `which`, what the model's sensors give in these states, at zero input."""
    jobs = []
    for k in which:
        rest = np.zeros((1, 1 if readings[k].model.vehicle == "motor" else 2))
        jobs.append((readings[k].model, OpenLoopRun(time=np.zeros(1), inputs=rest, initial=states[k])))
    outputs = [one.outputs for one in plant.simulate(jobs)]
    return [
        np.array([one[name][0] if name in one else readings[k].known[name] for name in readings[k].read])
        for k, one in zip(which, outputs, strict=True)
    ]


@cache
def _changes_readings(effect: str, vehicle: str) -> bool:
    """Whether an effect, at its preset, changes what sensors give of the state at the very first sample."""
    rest = np.zeros((1, 1 if vehicle == "motor" else 2))
    moving = State(surge=0.2, yaw_rate=1.0, wheel_speed=(7.0, 3.0), wheel_angle=(2.0, 1.0), heading=0.5, age=1.0)
    base = Model("moving", vehicle, "coupled", catalogue.presets(vehicle))
    run = OpenLoopRun(time=np.zeros(1), inputs=rest, initial=moving)
    plain, changed = (
        one.outputs for one in plant.simulate([(base, run), (dataclasses.replace(base, effects={effect: {}}), run)])
    )
    return any(plain[name][0] != changed[name][0] for name in plain.keys() & _SENSOR_SIGNALS)


def _starting_rate(time: Array, values: Array) -> float:
    """Returns the slope of the first samples where they all move in one direction, else 0."""
    first = values[:_START_SAMPLES]
    change = np.diff(first)
    if len(first) < _START_SAMPLES or not (np.all(change > 0) or np.all(change < 0)):
        return 0.0
    return float(np.polyfit(time[:_START_SAMPLES] - time[0], first, 1)[0])


def _state_of(known: Mapping[str, float], model: Model, age: float) -> State:
    return _motor_state(known, model, age) if model.vehicle == "motor" else _vehicle_state(known, model, age)


def _motor_state(known: Mapping[str, float], model: Model, age: float) -> State:
    if model.parameters.get("force_per_volt", 0.0) > 0:  # the plant's speed and angle are in m/s and m
        speed, angle = known.get("velocity", 0.0), known.get("position", 0.0)
    else:
        per = 1 / (model.parameters.get("wheel_radius") or np.inf)
        speed = _first(known, ("speed", 1.0), ("velocity", per)) or 0.0
        angle = _first(known, ("angle", 1.0), ("position", per)) or 0.0
    current = known.get("current", 0.0)
    return State(wheel_speed=(speed, 0.0), wheel_angle=(angle, 0.0), current=(current, 0.0), age=age)


def _vehicle_state(known: Mapping[str, float], model: Model, age: float) -> State:
    radius, half_track = model.parameters["wheel_radius"], model.parameters["half_track"]
    left, right = (
        _first(known, (f"wheel_speed_{side}", 1.0), (f"wheel_velocity_{side}", 1 / radius))
        for side in ("left", "right")
    )
    angles = [
        _first(known, (f"wheel_angle_{side}", 1.0), (f"wheel_travel_{side}", 1 / radius)) or 0.0
        for side in ("left", "right")
    ]
    if left is None or right is None:
        surge, yaw_rate = known.get("surge", 0.0), known.get("yaw_rate", 0.0)
        left, right = (surge + half_track * yaw_rate) / radius, (surge - half_track * yaw_rate) / radius
    return State(
        heading=known.get("yaw_angle", 0.0),
        surge=known.get("surge", radius * (left + right) / 2),
        sway=known.get("sway", 0.0),
        yaw_rate=known.get("yaw_rate", radius * (left - right) / (2 * half_track)),
        wheel_speed=(left, right),
        wheel_angle=(angles[0], angles[1]),
        current=(known.get("current_left", 0.0), known.get("current_right", 0.0)),
        age=age,
    )


def _first(known: Mapping[str, float], *names_and_scales: tuple[str, float]) -> float | None:
    """Returns the first of these signals that is known, times its scale; None where none is."""
    return next((known[name] * scale for name, scale in names_and_scales if name in known), None)
