"""Replays measured runs: what a model gives from each run's own inputs alone, beside what was measured.

Nothing measured is fed back. A run starts from what its first sample measured, or from what the file states; what was
not measured starts at rest. Age, charge and heat carry over from run to run in the file's order, `gap_s` apart.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Container, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.errors import InputError
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, output_names
from brickpilot.vehicle.plant import OpenLoopRun, State

Array = NDArray[np.float64]
Outputs = Mapping[str, Array]

# What grows by summation, measured from an arbitrary origin: judged relative to its first sample.
SUMMED = frozenset(
    {"angle", "position", "yaw_angle"} | {f"wheel_{k}_{s}" for k in ("angle", "travel") for s in ("left", "right")}
)
RATE_OF = {"position": "velocity", "angle": "speed"}

# A run whose first samples all move one way starts in motion.
_START_SAMPLES = 9

_LARGEST = 1e30  # SI: far above anything measured, far below where squares overflow
_FINEST = 20  # interpolated samples per measured one, where the measured crowd
_SECANT_STEPS = 4


class Replay:
    """A data set made ready to be simulated as often as wanted.

    Args:
        dataset: as `dataset.read` gives it.
        motor_step, body_step: upper limits of the plant's steps, s; 0: the plant's own. Models with an effect that is
            over sooner get a shorter motor step.
        inputs: run -> (n, 1) or (n, 2) V, where they are not those of the runs' rows.
    """

    def __init__(
        self,
        dataset: Dataset,
        *,
        motor_step: float = 0.0,
        body_step: float = 0.0,
        inputs: Mapping[str, Array] | None = None,
    ) -> None:
        self.dataset = dataset
        self.inputs = dict(inputs) if inputs else {run.name: motor_inputs(run, dataset) for run in dataset.runs}
        self._steps = (motor_step, body_step)

    def simulate(
        self,
        models: Sequence[Model],
        *,
        only: Collection[str] | None = None,
        threads: int = 2,
        signals: Collection[str] | None = None,
    ) -> list[dict[str, Outputs]]:
        """Each model's outputs by run name.

        Args:
            only: the runs that are wanted; None: all. Those that a model's effects remember are simulated too.
            signals: the outputs to keep; None: all that the vehicle has.
        """
        results: list[dict[str, Outputs]] = [{} for _ in models]
        remembering = [any(one.carries_over for one in catalogue.effects_of(model.effects)) for model in models]
        runs = self._aged(only)
        batches = [(remembering, [one]) for one in runs]
        forgetful = [not one for one in remembering]
        batches.append((forgetful, [one for one in runs if only is None or one[0].name in only]))
        carried = [State()] * len(models)
        for takes_part, batch in batches:
            chosen = [index for index, takes in enumerate(takes_part) if takes]
            if not chosen:
                continue
            pairs = [(run, age, index) for run, age in batch for index in chosen]
            measured = initial_states([(run, models[index]) for run, _, index in pairs])
            jobs = []
            for (run, age, index), state in zip(pairs, measured, strict=True):
                left = carried[index]
                start = dataclasses.replace(state, age=age, charge=left.charge, heat=left.heat, rest=run.gap_s)
                jobs.append((models[index], self._open_loop(run, slice(None), start, models[index])))
            for (run, _, index), one in zip(pairs, plant.simulate(jobs, threads, signals=signals), strict=True):
                results[index][run.name] = one.outputs
                carried[index] = one.final
        return results

    def _aged(self, only: Collection[str] | None) -> list[tuple[Run, float]]:
        """The runs up to the last of `only`, each with s from power-on to its start."""
        runs = self.dataset.runs
        ages = np.cumsum([run.gap_s + before for run, before in zip(runs, [0.0, *map(_duration, runs)], strict=False)])
        wanted = [index for index, run in enumerate(runs) if only is None or run.name in only]
        return [(runs[index], float(ages[index])) for index in range(max(wanted) + 1)]

    def nudged(self, signal: str, by: float) -> Replay:
        """The same data with `by` added to what each run's first sample measured of `signal`."""
        runs = []
        for run in self.dataset.runs:
            values = np.array(run.outputs.get(signal, [0.0]))
            values[0] += by
            runs.append(
                dataclasses.replace(run, outputs={**run.outputs, signal: values}) if signal in run.outputs else run
            )
        return Replay(
            dataclasses.replace(self.dataset, runs=tuple(runs)),
            motor_step=self._steps[0],
            body_step=self._steps[1],
            inputs=self.inputs,
        )

    def windows(self, model: Model, window_s: float, *, threads: int = 2) -> dict[str, list[Window]]:
        """Open-loop stretches of `window_s` s by run name, each from the measured state; a rest at the end is left out.

        For a motor. Its velocity is the zero-phase derivative of the position where it was not measured; a window
        that would start at a blank is left out. Age is the time since the first run began; charge and heat are zero.
        """
        given = output_names(model)
        stretches: list[tuple[str, slice]] = []
        batch: list[tuple[Model, OpenLoopRun]] = []
        age = 0.0
        for run in self.dataset.runs:
            age += run.gap_s
            rates = {name: values for name, values in measured_rates(run).items() if name in given}
            for stretch in _stretches(run.time, window_s):
                here = {name: float(values[stretch.start]) for name, values in run.outputs.items()}
                here |= {name: float(values[stretch.start]) for name, values in rates.items()}
                if not all(np.isfinite(here[name]) for name in rates):
                    continue
                start = _states([_reading(here, model, age=age + float(run.time[stretch.start] - run.time[0]))])[0]
                stretches.append((run.name, stretch))
                batch.append((model, self._open_loop(run, stretch, start, model)))
            age += float(run.time[-1] - run.time[0])
        found: dict[str, list[Window]] = {run.name: [] for run in self.dataset.runs}
        for (name, stretch), one in zip(
            stretches, plant.simulate(batch, threads=threads) if batch else [], strict=True
        ):
            found[name].append(Window(stretch, one.outputs))
        return found

    def _open_loop(self, run: Run, stretch: slice, start: State, model: Model) -> OpenLoopRun:
        motor_step, body_step = self._steps
        needed = [one.motor_step for one in catalogue.effects_of(model.effects) if one.motor_step > 0]
        motor_step = min([motor_step, *needed])
        return OpenLoopRun(
            time=run.time[stretch],
            inputs=self.inputs[run.name][stretch],
            initial=start,
            motor_step=motor_step,
            body_step=body_step,
        )


def is_judged(signal: str, outputs: Container[str], model: Model) -> bool:
    """Whether the model says something of a measured signal. The battery is what drives, unless an effect loads it."""
    if signal != "battery_voltage":
        return signal in outputs
    return any(effect.acts_on == "supply" for effect in catalogue.effects_of(model.effects))


def judged(dataset: Dataset, model: Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the measured signals that the model says something of, and a note on those it does not.

    Raises:
        InputError: there is none, or all its samples are blank, or one is too large to be a measurement.
    """
    given = output_names(model)
    measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    names = tuple(name for name in measured if is_judged(name, given, model))
    largest = -1.0
    for run in dataset.runs:
        for name in names:
            known = np.abs(run.outputs[name][np.isfinite(run.outputs[name])])
            largest = max(largest, float(known.max(initial=-1.0)))
            if largest > _LARGEST:
                raise InputError(f"{largest:g} is no measurement", file=run.file, field=name)
    silent = [name for name in measured if name not in given]
    if largest < 0:
        beside = f"; {', '.join(silent)}: not given for this vehicle" if silent else ""
        raise InputError(
            f"nothing measured to judge: no signal that the model gives has a value{beside}",
            file=dataset.path,
            field="signals",
        )
    notes = (f"Not judged, as the model of this vehicle does not give it: {', '.join(silent)}.",) if silent else ()
    return names, notes


@dataclass(frozen=True)
class Window:
    """One open-loop stretch of a run: its samples, and what the model gave for them."""

    samples: slice
    outputs: Outputs


def initial_states(asked: Sequence[tuple[Run, Model]]) -> list[State]:
    """The state that each run starts from under each model: what the file states, else what its first sample measured,
    else rest."""
    readings = []
    for run, model in asked:
        measured = {name: float(values[0]) for name, values in run.outputs.items()}
        for summed, rate, per in _START_RATES:
            if summed in run.outputs and rate not in run.outputs:
                measured[rate] = _starting_rate(run.time, run.outputs[summed]) * per
        readings.append(_reading(measured, model, stated=run.initial or {}))
    return _states(readings)


_START_RATES = [
    (f"wheel_{summed}_{side}", f"wheel_{rate}_{side}", 1.0)
    for summed, rate in (("angle", "speed"), ("travel", "velocity"))
    for side in ("left", "right")
] + [("position", "velocity", 1.0), ("angle", "speed", 1.0)]


# Measured signals that a state is made of and that a sensor effect may have changed.
_READ_INTO_STATE = SUMMED | {"yaw_rate", *RATE_OF.values(), *(rate for _, rate, _ in _START_RATES)}


def _duration(run: Run) -> float:
    return float(run.time[-1] - run.time[0])


def _starting_rate(time: Array, values: Array) -> float:
    first = values[:_START_SAMPLES]
    change = np.diff(first)
    if len(first) < _START_SAMPLES or not (np.all(change > 0) or np.all(change < 0)):
        return 0.0
    return float(np.polyfit(time[:_START_SAMPLES] - time[0], first, 1)[0])


@dataclass(frozen=True)
class _Reading:
    """What is known of a state, and which of it, by name, sensors read and may have misread."""

    known: Mapping[str, float]
    read: tuple[str, ...]
    model: Model
    age: float

    def state(self, values: Array) -> State:
        """Were `values` the truth of what was read."""
        truth = dict(self.known) | dict(zip(self.read, values.tolist(), strict=True))
        return _state_of(truth, self.model.vehicle, self.model, self.age)


def _reading(
    measured: Mapping[str, float],
    model: Model,
    *,
    stated: Mapping[str, float] = MappingProxyType({}),
    age: float = 0.0,
) -> _Reading:
    """`stated` is true already, whatever the sensors say."""
    known = {name: value for name, value in measured.items() if np.isfinite(value)} | dict(stated)
    read = tuple(name for name in known if name in _READ_INTO_STATE and name not in stated)
    misread = any(_misreads(name, model.vehicle) for name in model.effects)
    return _Reading(known, read if misread else (), model, age)


@cache
def _misreads(effect: str, vehicle: str) -> bool:
    """Whether an effect, at its preset, changes what sensors say of the state at the very first sample."""
    rest = np.zeros((1, 1 if vehicle == "motor" else 2))
    moving = State(surge=0.2, yaw_rate=1.0, wheel_speed=(7.0, 3.0), wheel_angle=(2.0, 1.0), heading=0.5, age=1.0)
    base = Model("moving", vehicle, "coupled", catalogue.presets(vehicle))
    run = OpenLoopRun(time=np.zeros(1), inputs=rest, initial=moving)
    plain, changed = (
        one.outputs for one in plant.simulate([(base, run), (dataclasses.replace(base, effects={effect: {}}), run)])
    )
    return any(plain[name][0] != changed[name][0] for name in plain.keys() & _READ_INTO_STATE)


def _states(readings: Sequence[_Reading]) -> list[State]:
    """The states of which the models' sensors say what was read.

    Secant steps, each signal for itself: exact after three where a sensor adds or scales. One that is not heeded, such
    as a yaw rate beside two wheel speeds, or that is clipped, stays off.
    """
    wanted = [np.array([one.known[name] for name in one.read]) for one in readings]
    values, slopes = list(wanted), [np.ones_like(one) for one in wanted]
    states = [one.state(at) for one, at in zip(readings, values, strict=True)]
    off = [k for k, one in enumerate(readings) if one.read]
    said = dict(zip(off, _said(readings, states, off), strict=True))
    for _ in range(_SECANT_STEPS):
        off = [k for k in off if np.any(np.abs(wanted[k] - said[k]) > 1e-12)]
        moved = {k: (wanted[k] - said[k]) / slopes[k] for k in off}
        for k in off:
            values[k] = values[k] + moved[k]
            states[k] = readings[k].state(values[k])
        answers = dict(zip(off, _said(readings, states, off), strict=True))
        answered = {k: answers[k] - said[k] for k in off}
        said |= answers
        for k in off:
            heeded = (np.abs(moved[k]) > 1e-9) & (np.abs(answered[k]) > 0.1 * np.abs(moved[k]))
            slopes[k] = np.where(heeded, answered[k] / np.where(heeded, moved[k], 1.0), slopes[k])
        off = [k for k in off if answered[k].any()]
    return states


def _said(readings: Sequence[_Reading], states: Sequence[State], which: Sequence[int]) -> list[Array]:
    """What the sensors say, at rest commands, of some of the states: of each what was read."""
    jobs = []
    for k in which:
        rest = np.zeros((1, 1 if readings[k].model.vehicle == "motor" else 2))
        jobs.append((readings[k].model, OpenLoopRun(time=np.zeros(1), inputs=rest, initial=states[k])))
    outputs = [one.outputs for one in plant.simulate(jobs)]
    return [
        np.array([one[name][0] if name in one else readings[k].known[name] for name in readings[k].read])
        for k, one in zip(which, outputs, strict=True)
    ]


def _state_of(known: Mapping[str, float], vehicle: str, model: Model, age: float) -> State:
    def first(*names_and_scales: tuple[str, float]) -> float | None:
        return next((known[name] * scale for name, scale in names_and_scales if name in known), None)

    if vehicle == "motor":
        if model.parameters.get("force_per_volt", 0.0) > 0:  # the plant's speed and angle are in m/s and m
            speed, angle = known.get("velocity", 0.0), known.get("position", 0.0)
        else:
            per = 1 / (model.parameters.get("wheel_radius") or np.inf)
            speed = first(("speed", 1.0), ("velocity", per)) or 0.0
            angle = first(("angle", 1.0), ("position", per)) or 0.0
        return State(
            wheel_speed=(speed, 0.0), wheel_angle=(angle, 0.0), current=(known.get("current", 0.0), 0.0), age=age
        )
    radius, half_track = model.parameters["wheel_radius"], model.parameters["half_track"]
    sides = ("left", "right")
    wheels = [first((f"wheel_speed_{side}", 1.0), (f"wheel_velocity_{side}", 1 / radius)) for side in sides]
    angles = [first((f"wheel_angle_{side}", 1.0), (f"wheel_travel_{side}", 1 / radius)) or 0.0 for side in sides]
    left, right = wheels
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


def measured_rates(run: Run) -> dict[str, Array]:
    """Velocity or speed of a motor's run: as measured, else the zero-phase derivative of what was measured."""
    rates = {
        rate: zero_phase_rate(run.time, run.outputs[summed])
        for summed, rate in RATE_OF.items()
        if summed in run.outputs
    }
    return rates | {rate: run.outputs[rate] for rate in RATE_OF.values() if rate in run.outputs}


def zero_phase_rate(time: Array, values: Array) -> Array:
    """The derivative of `values` without delay: Savitzky & Golay 1964, cubic over 21 samples of the median step.

    Irregular samples are first put on that step by linear interpolation. Same length as `values`; NaN where those are.
    The step is never below a twentieth of the mean one, however the samples crowd.
    """
    from scipy.signal import savgol_filter

    known = np.isfinite(values)
    if known.sum() < 4:
        return np.full_like(values, np.nan)
    step = max(float(np.median(np.diff(time))), float(time[-1] - time[0]) / (_FINEST * len(time)))
    even = np.arange(time[0], time[-1] + step / 2, step)
    window = min(21, (len(even) - 1) // 2 * 2 + 1)
    if window < 4:
        return np.full_like(values, np.nan)
    rate = savgol_filter(np.interp(even, time[known], values[known]), window, 3, deriv=1, delta=step)
    return np.where(known, np.interp(time, even, rate), np.nan)


def _stretches(time: Array, window_s: float) -> list[slice]:
    """Windows of `window_s` s that share their end samples, so that each interval of time is in one of them."""
    number = np.floor((time - time[0]) / window_s + 1e-9)
    edges = [0, *(np.flatnonzero(np.diff(number)) + 1)]
    return [slice(int(a), int(b) + 1) for a, b in pairwise(edges)]
