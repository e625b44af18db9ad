"""How much of each measured signal a model explains: over whole runs and 1 s ahead, in fit runs and in held-out runs.

`compare`, `calibrate` and `discover` get their numbers here, so these commands give equal numbers for the same model
and runs. `data.agreement` defines the number fit %, and `Comparable` the start states of runs. At a short horizon, a
run is divided into windows: each window starts from measured values, and is simulated from the inputs alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import SIDES
from brickpilot.data.agreement import Agreement, agreement, mean_fit, together
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.holdout import Roles, repeats
from brickpilot.data.motion import zero_phase_rate
from brickpilot.data.noise import noise_of
from brickpilot.data.signals import RATE_OF, SIGNALS, SUMMED
from brickpilot.errors import SimulationError
from brickpilot.vehicle.compared_runs import Comparable, is_compared
from brickpilot.vehicle.model import Model, output_names
from brickpilot.vehicle.replay import Mark, Outputs, Replay

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ROLES = ("held_out", "fit")
FREE_RUN = "free_run"
"""The horizon from the first to the last sample of a run."""

AHEAD: Mapping[str, float] = {"1_s": 1.0}
"""The horizons of every headline number besides the free run: name -> s."""

_LEAST_SAMPLES = 4  # least number of samples in a window; with fewer samples, the horizon is left out
_SMOOTHED_S = 0.04  # time around a window's start, s, whose samples give the rate at the start


@dataclass(frozen=True)
class Stretch:
    """One run, divided into the windows of one horizon.

    Attributes:
        start: (n,) for each sample, the index at which its window starts; a sample at the edge of two windows belongs
            to the earlier window.
        within: (n,) whether each sample lies within the horizon, counted from the start of its window.
    """

    run: Run
    start: Indices
    within: NDArray[np.bool_]


@dataclass(frozen=True)
class Course:
    """All runs, divided into the windows of one horizon.

    Attributes:
        marks: run -> the samples at which a window starts from measured values.
    """

    horizon: str
    stretches: tuple[Stretch, ...]
    marks: Mapping[str, Sequence[Mark]]


@dataclass(frozen=True)
class Track:
    """The measured values of a data set, and the horizons at which a model can be compared with them.

    Attributes:
        dataset: the data set as it is simulated, with averaged start states.
        measured: run -> signal -> (n,) the measured values that are compared.
        notes: sentences on horizons that are absent or start from only a part of the state.
    """

    dataset: Dataset
    roles: Roles
    signals: tuple[str, ...]
    measured: Mapping[str, Mapping[str, Array]]
    courses: tuple[Course, ...]
    notes: tuple[str, ...]


def track(ready: Comparable, model: Model, horizons: Mapping[str, float] = AHEAD) -> Track:
    """Returns the measured signals that `model` gives, with the windows of each horizon.

    Args:
        horizons: name -> how far a prediction reaches, s; the free run is always added.
    """
    given, dataset = output_names(model), ready.started
    as_read = {run.name: run for run in ready.measured.runs}
    measured: dict[str, dict[str, Array]] = {}
    for run in dataset.runs:
        both = {**run.outputs, **as_read[run.name].outputs}
        measured[run.name] = {
            name: values
            for name, values in both.items()  # beside a velocity, a motor's position has one sample: left out
            if is_compared(name, given, model) and np.count_nonzero(np.isfinite(values)) > 1
        }
    signals = tuple(dict.fromkeys(name for run in dataset.runs for name in measured[run.name]))
    starts = {run.name: _starts(run.time, measured[run.name]) for run in dataset.runs}
    known, notes = _known_at_starts(dataset, starts)
    courses = [Course(FREE_RUN, tuple(_stretch(run, (), np.inf) for run in dataset.runs), {})]
    for name, length in horizons.items() if known else ():
        if max(float(np.median(np.diff(run.time))) for run in dataset.runs) * _LEAST_SAMPLES > length:
            notes.append(f"There is no horizon of {length:g} s: the samples are too far apart for it.")
            continue
        courses.append(_windowed(name, length, dataset, starts))
    return Track(dataset, ready.roles, signals, measured, tuple(courses), tuple(notes))


def deviation(track: Track, stretch: Stretch, signal: str, simulated: Array) -> tuple[Array, Array]:
    """Returns (n,) measured minus simulated and (n,) the measured signal; NaN: there is nothing to compare.

    Signals that sum up motion, such as an angle, are compared by their change since the start of the window.
    """
    values = track.measured[stretch.run.name][signal]
    if signal not in SUMMED:
        error, reference = values - simulated, np.array(values)
    else:
        known = np.flatnonzero(np.isfinite(values))
        at_start = np.where(stretch.start > 0, values[stretch.start], values[known[0]])
        # A window starts from a measured value, but a run starts from a simulated value.
        simulated_start = np.where(stretch.start > 0, values[stretch.start], simulated[known[0]])
        reference = values - at_start
        error = reference - (simulated - simulated_start)
    outside = ~stretch.within | ~np.isfinite(error)
    error[outside], reference[outside] = np.nan, np.nan
    return error, reference


def _starts(time: Array, measured: Mapping[str, Array]) -> dict[str, Array]:
    """Returns signal -> (n,): the measured state. Rates are smoothed, or derived from angles or travel."""
    states = {n: values if n in SUMMED else _smoothed(time, values) for n, values in measured.items() if n in _STATES}
    for summed, rate in {**RATE_OF, "yaw_angle": "yaw_rate"}.items():
        if summed in measured and rate not in states:
            states[rate] = zero_phase_rate(time, measured[summed])
    return states


_STATES = (
    SUMMED | frozenset(RATE_OF.values()) | {"yaw_rate", "surge", "sway", "current", "current_left", "current_right"}
)


def _smoothed(time: Array, values: Array) -> Array:
    """Returns `values` with little noise and no delay: a parabola is fitted around each sample."""
    from scipy.signal import savgol_filter

    known = np.isfinite(values)
    count = 2 * int(_SMOOTHED_S / 2 / max(float(np.median(np.diff(time))), 1e-9)) + 1
    count = min(max(count, 5), (len(values) - 1) // 2 * 2 + 1)
    if count < 5 or known.sum() < count:
        return values
    filled = np.interp(time, time[known], values[known])
    return np.where(known, savgol_filter(filled, count, 2), np.nan)


def _known_at_starts(dataset: Dataset, starts: Mapping[str, Mapping[str, Array]]) -> tuple[bool, list[str]]:
    """Returns whether windows can start from measured values, and a note if some or all of these values are missing."""
    names = set.intersection(*(set(starts[run.name]) for run in dataset.runs))
    if dataset.vehicle == "motor":
        if names & {"speed", "velocity"}:
            return True, []
    elif all(names & {f"wheel_speed_{side}", f"wheel_velocity_{side}"} for side in SIDES):
        return True, []
    elif "yaw_rate" in names:
        return True, [
            "No wheel was measured: short windows start from the measured yaw rate and from the simulated speed."
        ]
    return False, ["There is no short horizon: no speed was measured from which a window could start."]


def _windowed(name: str, length: float, dataset: Dataset, starts: Mapping[str, Mapping[str, Array]]) -> Course:
    stretches, marks = [], {}
    for run in dataset.runs:
        known = starts[run.name]
        whole = np.all([np.isfinite(values) for values in known.values()], axis=0)
        number = np.floor((run.time - run.time[0]) / length + 1e-9)
        edges = [int(k) + 1 for k in np.flatnonzero(np.diff(number)) if whole[k + 1] and k + 2 < len(number)]
        marks[run.name] = [Mark(k, {signal: float(values[k]) for signal, values in known.items()}) for k in edges]
        stretches.append(_stretch(run, edges, length))
    return Course(name, tuple(stretches), marks)


def _stretch(run: Run, edges: Sequence[int], length: float) -> Stretch:
    """Returns a run in windows that start at `edges`; a sample at an edge is the last sample of the earlier window."""
    starts = np.array([0, *edges], dtype=np.int64)
    start = starts[np.maximum(np.searchsorted(starts, np.arange(len(run.time)), side="left") - 1, 0)]
    within = run.time - run.time[start] <= length * (1 + 1e-6) + float(np.median(np.diff(run.time))) / 2
    return Stretch(run, start, within)


@dataclass(frozen=True)
class Headline:
    """How well one model agrees with one data set: its headline numbers.

    Attributes:
        parts: (run, horizon, signal, role) -> agreement. A run has two roles if only a stretch of it is held out.
    """

    parts: Mapping[tuple[str, str, str, str], Agreement]

    @property
    def horizons(self) -> list[str]:
        return list(dict.fromkeys(horizon for _, horizon, _, _ in self.parts))

    @property
    def signals(self) -> list[str]:
        return list(dict.fromkeys(signal for _, _, signal, _ in self.parts))

    @property
    def role(self) -> str:
        """The role of the runs by which a model is judged: "held_out", or "fit" if nothing is held out."""
        return next((role for role in ROLES if self.mean(role) is not None), "fit")

    def of(self, signal: str, role: str, horizon: str = FREE_RUN) -> Agreement:
        """Returns the agreement of a signal over all runs and stretches of runs that have this role."""
        wanted = horizon, signal, role
        return together(part for (_, *key), part in self.parts.items() if tuple(key) == wanted)

    def of_run(self, run: str, signal: str, horizon: str = FREE_RUN) -> Agreement:
        """Returns the agreement of a signal over a whole run."""
        wanted = run, horizon, signal
        return together(part for (*key, _), part in self.parts.items() if tuple(key) == wanted)

    def mean(self, role: str, horizon: str = FREE_RUN) -> float | None:
        """Returns the mean fit in percent over the signals; None: no run has this role or horizon."""
        return mean_fit({signal: self.of(signal, role, horizon).fit_percent for signal in self.signals})

    def to_json(self) -> dict[str, Any]:
        """Returns role -> horizon -> the mean fit in percent, and the numbers of each signal."""
        return {
            role: {
                horizon: {
                    "fit_percent": self.mean(role, horizon),
                    "signals": {
                        signal: {**agreed.to_json(), "unit": SIGNALS[signal].unit}
                        for signal in self.signals
                        if (agreed := self.of(signal, role, horizon)).samples
                    },
                }
                for horizon in self.horizons
            }
            for role in ROLES
        }


def headline(ready: Comparable, model: Model, *, threads: int = 2) -> Headline:
    """Returns how well a model explains each signal over whole runs and 1 s ahead.

    Raises:
        SimulationError: the plant diverges with this model.
    """
    compared = track(ready, model)
    return headline_of(compared, simulated_at(compared, [model], threads=threads)[0])


def simulated_at(
    compared: Track, models: Sequence[Model], *, threads: int = 2, may_diverge: bool = False
) -> list[dict[str, Mapping[str, Outputs]]]:
    """Returns, for each model, horizon -> run -> the simulated outputs of the measured signals.

    If a model diverges at a short horizon, all results lack this horizon; with `may_diverge`, also the free run.

    Raises:
        SimulationError: a model diverges in a free run, and `may_diverge` is false.
    """
    replay, simulated = Replay(compared.dataset), [dict[str, Mapping[str, Outputs]]() for _ in models]
    names = {*compared.signals, *(name for run in compared.dataset.runs for name in run.outputs)}
    for course in compared.courses:
        try:
            outputs = replay.simulate(models, threads=threads, signals=names, marks=course.marks)
        except SimulationError:
            if course.horizon == FREE_RUN and not may_diverge:
                raise
            continue
        for by_horizon, runs in zip(simulated, outputs, strict=True):
            by_horizon[course.horizon] = runs
    return simulated


def headline_of(compared: Track, simulated: Mapping[str, Mapping[str, Outputs]]) -> Headline:
    """Returns the headline numbers of simulated outputs. `simulated`: horizon -> run -> outputs."""
    noise = {
        signal: noise_sd(compared.dataset, signal, [run[signal] for run in compared.measured.values() if signal in run])
        for signal in compared.signals
    }
    parts = {}
    for course in compared.courses:
        for stretch in course.stretches:
            run, outputs = stretch.run, simulated.get(course.horizon, {}).get(stretch.run.name, {})
            held_out = _held_out(run, compared.roles)
            for signal in compared.measured[run.name] if outputs else ():
                error, value = deviation(compared, stretch, signal, outputs[signal])
                for role, here in (("held_out", held_out), ("fit", ~held_out)):
                    if here.any():
                        key = run.name, course.horizon, signal, role
                        parts[key] = agreement(error[here], value[here], noise_sd=noise[signal])
    return Headline(parts)


def noise_sd(dataset: Dataset, signal: str, parts: Sequence[Array]) -> float:
    """Returns a signal's noise sd, SI: the larger of its stated and estimated sd. `parts`: the signal in each run."""
    described = dataset.signals.get(signal)
    stated = (described.noise_sd if described is not None else None) or 0.0
    step = (described.resolution if described is not None else None) or 0.0
    return max(float(np.hypot(stated, step / 12**0.5)), noise_of(parts, step).sd)


def _held_out(run: Run, roles: Roles) -> NDArray[np.bool_]:
    """Returns (n,): whether each sample of a run is held out."""
    stretch = roles.stretches.get(run.name)
    if stretch is None:
        return np.full(len(run.time), roles.by_run[run.name] == "held_out")
    return np.asarray((run.time >= stretch[0]) & (run.time <= stretch[1]))


def repeatability(compared: Track, simulated: Mapping[str, Mapping[str, Array]]) -> dict[str, float]:
    """Returns signal -> the fit in percent that a perfect model would reach, estimated from repeats of the same inputs.

    The difference of two repeats has twice the noise variance of one repeat. The nominal model's errors are compared
    instead of the signals, so that small differences between the repeats' inputs and start states cancel.
    """
    pairs = repeats(compared.dataset)
    clocks = {run.name: run.time - run.time[0] for run in compared.dataset.runs}
    best = {}
    for signal in compared.signals if pairs else ():
        differences, sizes = [np.empty(0)], [np.empty(0)]
        for first, second, seconds in pairs:
            measured, repeated = (compared.measured[name].get(signal) for name in (first, second))
            if measured is None or repeated is None:
                continue
            error, other_error = measured - simulated[first][signal], repeated - simulated[second][signal]
            known = np.isfinite(other_error)
            at_same_time = np.interp(clocks[first], clocks[second][known], other_error[known])
            differences.append((error - at_same_time)[clocks[first] <= seconds])
            sizes.append(measured)
        difference, size = (np.concatenate(parts) for parts in (differences, sizes))
        difference, size = difference[np.isfinite(difference)], size[np.isfinite(size)]
        rms = float(np.sqrt(np.mean(size**2))) if len(size) else 0.0
        if len(difference) and rms > 0:
            best[signal] = round(100 * (1 - float(np.sqrt(np.mean(difference**2) / 2)) / rms), 3)
    return best
