"""The state that a run starts from, or a window that is cut out of it.

It is measured: several samples are read instead of one. A sensor effect of the model, such as a scale or a bias, lies
between state and reading. The state is therefore solved for: the one at which the model's sensors give what was
measured.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

Array = NDArray[np.float64]

_REST_S = 0.5  # at the start of a run at rest: the longest time that is averaged
MOVING_SAMPLES = 12
"""So many samples are fitted by a line where a run starts in motion."""
_LEAST_KNOWN = 4  # of these, for a line
_HELD_S = 0.1  # within which the first sample of a held channel is looked for
_TREND_SD = 3.0  # a slope beyond so many of its sd is motion
_SPIKE = 3.0  # times what 90 % of the run's samples span: a sample this far off the others is damaged


def with_rates(dataset: Dataset) -> Dataset:
    """Returns a motor's data set with velocities beside positions; positions only keep their first sample.

    A position sums every error up while the run lasts. So the velocity is compared, and the position says where the
    run starts.
    """
    runs = []
    for run in dataset.runs:
        outputs = dict(run.outputs)
        for summed, rate in MOTOR_RATE_OF.items():
            if summed in outputs and rate not in outputs:
                outputs[rate] = measured_rates(run)[rate]
            if summed in outputs:
                start = np.full_like(outputs[summed], np.nan)
                start[0] = outputs[summed][0]
                outputs[summed] = start
        runs.append(dataclasses.replace(run, outputs=outputs))
    return dataclasses.replace(dataset, runs=tuple(runs))


def with_averaged_starts(dataset: Dataset, inputs: Mapping[str, Array]) -> Dataset:
    """Returns the data set with each run's first sample replaced by an estimate from its first samples together.

    A run starts from the state that its first sample measured. The noise of one sample would go on as a motion that
    never was. Before the first command the samples are averaged; in motion a line is fitted to a few.

    Args:
        inputs: run -> (n, 1) or (n, 2) V.
    """
    runs = []
    for run in dataset.runs:
        outputs = dict(run.outputs)
        rest = _samples_at_rest(run, inputs[run.name])
        for name, values in outputs.items():
            moving = MOVING_SAMPLES
            if not np.isfinite(values[0]):  # a held channel: its next sample is a few rows away
                moving = max(moving, int(np.searchsorted(run.time, run.time[0] + _HELD_S)))
            if name in SUMMED or name.startswith("accel") or not np.isfinite(values[:moving]).any():
                continue
            first = np.array(values)
            first[0] = _first_value(run.time, values, rest, moving)
            first.flags.writeable = False
            outputs[name] = first
        runs.append(dataclasses.replace(run, outputs=outputs))
    return dataclasses.replace(dataset, runs=tuple(runs))


def _samples_at_rest(run: Run, driven: Array) -> int:
    """Returns how many samples lie before the first change of command, within `_REST_S`."""
    same = np.all((driven == driven[0]) | (np.isnan(driven) & np.isnan(driven[0])), axis=1)
    count = len(same) if same.all() else int(np.argmin(same))
    return min(count, int(np.searchsorted(run.time, run.time[0] + _REST_S)))


def _first_value(time: Array, values: Array, rest: int, moving: int) -> float:
    """Returns an estimate of the first of `values` (n,) from its known ones among the first `rest`, else `moving`."""
    known = _without_spikes(values, np.flatnonzero(np.isfinite(values[: max(rest, moving)])))
    for count in (rest, moving):
        chosen = known[known < count]
        if len(chosen) < _LEAST_KNOWN:
            continue
        clock = time[chosen] - time[0]
        slope, at_start = np.polyfit(clock, values[chosen], 1)
        residual = values[chosen] - at_start - slope * clock
        sd = float(np.std(residual, ddof=2)) / max(float(np.sqrt(np.sum((clock - clock.mean()) ** 2))), 1e-300)
        if count == rest and abs(slope) < _TREND_SD * sd + 1e-300:
            return float(np.mean(values[chosen]))
        if count == moving:
            return float(at_start)
    return float(values[known[0]])


def _without_spikes(values: Array, known: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns those of the first samples that lie no impossible way off the others."""
    low, high = np.nanpercentile(values, [5, 95])
    if len(known) < _LEAST_KNOWN or high <= low:
        return known
    usual = np.abs(values[known] - np.median(values[known])) <= _SPIKE * (high - low)
    return np.asarray(known[usual])


MOTOR_RATE_OF = {summed: RATE_OF[summed] for summed in ("position", "angle")}
"""Position or angle of a motor -> its rate."""

_SAMPLES = 21  # in the filter's window
_FINEST = 20  # interpolated samples for each measured one, at most, where measured samples crowd


def measured_rates(run: Run) -> dict[str, Array]:
    """Returns velocity or speed of a motor's run: as measured, else the derivative of position or angle."""
    rates = {
        rate: zero_phase_rate(run.time, run.outputs[summed])
        for summed, rate in MOTOR_RATE_OF.items()
        if summed in run.outputs
    }
    return rates | {rate: run.outputs[rate] for rate in MOTOR_RATE_OF.values() if rate in run.outputs}


def zero_phase_rate(time: Array, values: Array) -> Array:
    """Returns the derivative of `values` without delay, (n,); NaN where `values` are.

    The filter is that of Savitzky & Golay 1964, cubic over 21 samples. It needs even steps, so irregular samples are
    first interpolated to the median step, or to a twentieth of the mean step where that is more.
    """
    from scipy.signal import savgol_filter

    known = np.isfinite(values)
    if known.sum() < 4:
        return np.full_like(values, np.nan)
    step = max(float(np.median(np.diff(time))), float(time[-1] - time[0]) / (_FINEST * len(time)))
    even = np.arange(time[0], time[-1] + step / 2, step)
    window = min(_SAMPLES, (len(even) - 1) // 2 * 2 + 1)
    if window < 4:
        return np.full_like(values, np.nan)
    rate = savgol_filter(np.interp(even, time[known], values[known]), window, 3, deriv=1, delta=step)
    return np.where(known, np.interp(time, even, rate), np.nan)


_STILL = 0.01  # of the mean rate in the fastest run: a wheel that turns less and is not driven rests
HOLE_S = 0.12  # a longer hole in measured angles or speeds is not filled
_WINDOW = ", window "  # between the run's name and the window's number
_ANGLE_AND_RATE = (
    ("wheel_angle_left", "wheel_speed_left"),
    ("wheel_angle_right", "wheel_speed_right"),
    ("angle", "speed"),
    ("position", "velocity"),
)


def run_of(name: str) -> str:
    """Returns the name of the run that a window was cut from; the name of a whole run stays."""
    return name.rsplit(_WINDOW, 1)[0]


def cut_into_windows(dataset: Dataset, inputs: Mapping[str, Array], length_s: float) -> Dataset | None:
    """Returns the data set cut into windows, each a run from the measured state, wheel angles included.

    An effect that repeats with the angle of a wheel gets out of phase with a simulation in which the wheel turned a
    little less. Over a short window it stays in phase.

    Returns None where neither angles nor speeds of the wheels were measured.
    """
    windows: list[Run] = []
    turned = {run.name: wheel_angles(run) for run in dataset.runs}
    rates = [
        float(np.ptp(values)) / float(run.time[-1] - run.time[0])
        for run in dataset.runs
        for values in (turned[run.name] or {}).values()
    ]
    still = _STILL * length_s * max(rates, default=0.0)
    for run in dataset.runs:
        angles = turned[run.name]
        if not run.outputs:  # nothing of it is compared; heat and charge carry over
            windows.append(run)
            continue
        if angles is None:
            return None
        windows += _windows(run, angles, length_s, still)
    cut = dataclasses.replace(dataset, runs=tuple(windows))
    return with_averaged_starts(cut, {run.name: motor_inputs(run, cut) for run in windows})


def _windows(run: Run, angles: Mapping[str, Array], length_s: float, still: float) -> Iterator[Run]:
    """Yields the windows of a run. Of an angle only the first sample stays: it says where the window starts.

    A window in which nothing was measured, or in which the vehicle rests, is left out.
    """
    count = max(1, round(float(run.time[-1] - run.time[0]) / length_s))
    edges = np.searchsorted(run.time, np.linspace(run.time[0], run.time[-1], count + 1))
    for number, (first, last) in enumerate(pairwise(edges)):
        rows = slice(int(first), int(last) + 1)
        length = len(run.time[rows])
        if length < 2 * MOVING_SAMPLES or _shows_nothing(run, angles, rows, still):
            continue
        outputs = {name: values[rows] for name, values in run.outputs.items() if name not in angles}
        for name, values in angles.items():
            outputs[name] = np.full(length, np.nan)
            outputs[name][0] = values[first]
        yield dataclasses.replace(
            run,
            name=f"{run.name}{_WINDOW}{number + 1}",
            time=run.time[rows],
            inputs={name: values[rows] for name, values in run.inputs.items()},
            outputs=outputs,
            raw_outputs={},
            gap_s=run.gap_s if number == 0 else 0.0,
            replicate_of=None,
            initial={} if number else run.initial,
        )


def _shows_nothing(run: Run, angles: Mapping[str, Array], rows: slice, still: float) -> bool:
    """Whether nothing was measured in a window, or nothing was driven in it and no wheel moved by more than `still`."""
    if not any(np.isfinite(values[rows]).any() for values in run.outputs.values()):
        return True
    driven = any(np.nan_to_num(values[rows]).any() for values in run.inputs.values())
    return not driven and all(np.ptp(values[rows]) < still for values in angles.values())


def _without_holes(time: Array, values: Array | None) -> Array | None:
    """Returns the values with short holes filled, as between held samples; None if a hole is long."""
    known = np.flatnonzero(np.isfinite(values)) if values is not None else np.empty(0, dtype=np.intp)
    if values is None or len(known) < 2 or len(known) == len(values):
        return values if len(known) else None
    holes = np.diff(time[np.concatenate([[0], known])])  # what follows the last sample stays as it was
    return np.asarray(np.interp(time, time[known], values[known])) if holes.max() <= HOLE_S else None


def wheel_angles(run: Run) -> dict[str, Array] | None:
    """Returns wheel angles by name, measured or integrated from measured speeds; None if not all wheels have one."""
    found = {}
    for angle, rate in _ANGLE_AND_RATE:
        angles, rates = (_without_holes(run.time, run.outputs.get(name)) for name in (angle, rate))
        if angles is not None:
            found[angle] = angles
        elif rates is not None:
            found[angle] = cumulative_trapezoid(rates, run.time, initial=0)
    one_of_two = len(found) == 1 and found.keys() & {"wheel_angle_left", "wheel_angle_right"}
    return None if one_of_two else found or None


# A run whose first samples all move in one direction starts in motion.
_START_SAMPLES = 9
_SECANT_STEPS = 4

# Measured signals that make up a state and that a sensor effect may change.
_SENSOR_SIGNALS = SUMMED | {"yaw_rate", *RATE_OF.values()}

GEOMETRY = ("wheel_radius", "half_track", "force_per_volt")
"""The nominal parameters that a state made of measured values depends on: see `Reading.state`."""


@dataclass(frozen=True)
class Reading:
    """What is known at one sample, from which a state is made.

    Attributes:
        measured: signal -> reading, SI; NaN where blank.
        stated: signal -> true value.
        age: s since power-on.
    """

    measured: Mapping[str, float]
    stated: Mapping[str, float]
    model: Model
    age: float = 0.0

    @cached_property
    def known(self) -> dict[str, float]:
        """Signal -> value, of all that is known."""
        return {name: value for name, value in self.measured.items() if math.isfinite(value)} | dict(self.stated)

    @cached_property
    def read(self) -> tuple[str, ...]:
        """The known signals that a sensor effect of the model may have changed; empty: it has no such effect."""
        if not has_sensor_effect(self.model):
            return ()
        return tuple(name for name in self.known if name in _SENSOR_SIGNALS and name not in self.stated)

    def state(self, values: Array, *, restart: bool = False) -> State:
        """Returns the state in which the signals `read` have these true values.

        `restart`: what was not measured is NaN, and so stays as it is simulated; else it is 0.
        """
        truth = self.known | dict(zip(self.read, values.tolist(), strict=True))
        unknown = float("nan") if restart else 0.0
        made = _motor_state if self.model.vehicle == "motor" else _vehicle_state
        return State(x=unknown, y=unknown, age=unknown if restart else self.age, charge=unknown,
            heat=(unknown, unknown), rest=unknown, **made(truth, self.model, unknown))  # fmt: skip


def first_sample(run: Run) -> dict[str, float]:
    """Returns what was measured at a run's first sample, and the rates of signals that sum up."""
    measured = {name: float(values[0]) for name, values in run.outputs.items()}
    for summed, rate in RATE_OF.items():
        if summed in run.outputs and rate not in run.outputs:
            measured[rate] = _starting_rate(run.time, run.outputs[summed])
    return measured


def has_sensor_effect(model: Model) -> bool:
    """Whether an effect of the model changes what sensors give of the state."""
    return any(_changes_readings(name, model.vehicle) for name in model.effects)


def states(readings: Sequence[Reading], *, restart: bool = False) -> list[State]:
    """Returns the states in which the models' sensors give the readings; see `Reading.state`.

    Each signal is solved by secant steps of its own, which is exact after three where a sensor adds or scales. A signal
    that does not follow the state keeps its error: one that is clipped, or a yaw rate beside two wheel speeds.
    """
    wanted = [np.array([one.known[name] for name in one.read]) for one in readings]
    values, slopes = list(wanted), [np.ones_like(one) for one in wanted]
    unsolved = [k for k, one in enumerate(readings) if one.read]
    given = _sensor_outputs(readings, values, unsolved)
    for _ in range(_SECANT_STEPS):
        unsolved = [k for k in unsolved if np.any(np.abs(wanted[k] - given[k]) > 1e-12)]
        moved = {k: (wanted[k] - given[k]) / slopes[k] for k in unsolved}
        for k in unsolved:
            values[k] = values[k] + moved[k]
        outputs = _sensor_outputs(readings, values, unsolved)
        changes = {k: outputs[k] - given[k] for k in unsolved}
        given |= outputs
        for k in unsolved:
            follows = (np.abs(moved[k]) > 1e-9) & (np.abs(changes[k]) > 0.1 * np.abs(moved[k]))
            slopes[k] = np.where(follows, changes[k] / np.where(follows, moved[k], 1.0), slopes[k])
        unsolved = [k for k in unsolved if changes[k].any()]
    return [one.state(at, restart=restart) for one, at in zip(readings, values, strict=True)]


def _sensor_outputs(readings: Sequence[Reading], values: Sequence[Array], which: Sequence[int]) -> dict[int, Array]:
    """Returns, for the readings numbered `which`, what the model's sensors give of these values, at zero input."""
    jobs = []
    for k in which:
        rest = np.zeros((1, 1 if readings[k].model.vehicle == "motor" else 2))
        jobs.append((readings[k].model, OpenLoopRun(np.zeros(1), rest, readings[k].state(values[k]))))
    outputs = zip(which, (one.outputs for one in plant.simulate(jobs)), strict=True)
    return {
        k: np.array([one[n][0] if n in one else readings[k].known[n] for n in readings[k].read]) for k, one in outputs
    }


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


def _motor_state(known: Mapping[str, float], model: Model, unknown: float) -> dict[str, Any]:
    if model.parameters.get("force_per_volt", 0.0) > 0:  # the plant's speed and angle are in m/s and m
        speed, angle = known.get("velocity", unknown), known.get("position", unknown)
    else:
        per = 1 / (model.parameters.get("wheel_radius") or np.inf)
        speed = _first(known, "speed", "velocity", per, unknown)
        angle = _first(known, "angle", "position", per, unknown)
    return {"wheel_speed": (speed, 0.0), "wheel_angle": (angle, 0.0), "current": (known.get("current", unknown), 0.0)}


def _vehicle_state(known: Mapping[str, float], model: Model, unknown: float) -> dict[str, Any]:
    radius, half_track = model.parameters["wheel_radius"], model.parameters["half_track"]
    left = _first(known, "wheel_speed_left", "wheel_velocity_left", 1 / radius, np.nan)
    right = _first(known, "wheel_speed_right", "wheel_velocity_right", 1 / radius, np.nan)
    left_angle = _first(known, "wheel_angle_left", "wheel_travel_left", 1 / radius, unknown)
    right_angle = _first(known, "wheel_angle_right", "wheel_travel_right", 1 / radius, unknown)
    surge, yaw_rate = known.get("surge", unknown), known.get("yaw_rate", unknown)
    if not math.isnan(left + right):
        surge = known.get("surge", radius * (left + right) / 2)
        yaw_rate = known.get("yaw_rate", radius * (left - right) / (2 * half_track))
    elif math.isnan(unknown):
        left = right = unknown
    else:
        left, right = (surge + half_track * yaw_rate) / radius, (surge - half_track * yaw_rate) / radius
    return {
        "heading": known.get("yaw_angle", unknown),
        "surge": surge,
        "sway": known.get("sway", unknown),
        "yaw_rate": yaw_rate,
        "wheel_speed": (left, right),
        "wheel_angle": (left_angle, right_angle),
        "current": (known.get("current_left", unknown), known.get("current_right", unknown)),
    }


def _first(known: Mapping[str, float], name: str, other: str, scale: float, unknown: float) -> float:
    """Returns the value of a signal where it is known, else `scale` times that of another one, else `unknown`."""
    value = known.get(name)
    if value is None:
        value = known[other] * scale if other in known else unknown
    return value
