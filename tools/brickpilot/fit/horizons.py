"""Simulates the runs at several horizons: whole, and in short open-loop windows that start from what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.errors import SimulationError
from brickpilot.fit.comparable import is_compared
from brickpilot.fit.replay import Mark, Outputs, Replay
from brickpilot.fit.start_state import zero_phase_rate
from brickpilot.vehicle.model import Model, output_names

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

HORIZONS: Mapping[str, float] = {"free_run": np.inf, "1_s": 1.0, "0.2_s": 0.2}
"""Name -> s, how far a prediction reaches; a free run reaches from the first sample of a run to its last."""

_LEAST_SAMPLES = 4  # in a window: below, a horizon says nothing
_SMOOTHED_S = 0.04  # a rate at the start of a window is read off so many seconds of samples around it
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Stretch:
    """One run at one horizon.

    Attributes:
        start: (n,) the sample at which the window of each sample starts; of the mark between two windows, the earlier.
        within: (n,) whether the sample lies within the horizon of its start.
    """

    run: Run
    start: Indices
    within: NDArray[np.bool_]

    @property
    def since_start(self) -> Array:
        """Returns (n,) s since the start of each sample's window."""
        return np.asarray(self.run.time - self.run.time[self.start])


@dataclass(frozen=True)
class Course:
    """All runs at one horizon.

    Attributes:
        marks: run -> where a window starts from what was measured.
    """

    horizon: str
    stretches: tuple[Stretch, ...]
    marks: Mapping[str, Sequence[Mark]]


@dataclass(frozen=True)
class Track:
    """What is compared: the measured values of a data set, and the horizons at which a model can be held to them.

    Attributes:
        dataset: as it is simulated, with averaged starts.
        measured: run -> signal -> (n,) the compared values.
        starts: run -> signal -> (n,) what a window takes over where it starts.
        notes: sentences on horizons that are absent or start from a part of the state alone.
    """

    dataset: Dataset
    signals: tuple[str, ...]
    measured: Mapping[str, Mapping[str, Array]]
    starts: Mapping[str, Mapping[str, Array]]
    courses: tuple[Course, ...]
    notes: tuple[str, ...]


def track(measured_runs: Dataset, dataset: Dataset, model: Model, horizons: Mapping[str, float] = HORIZONS) -> Track:
    """Returns the measured signals that `model` gives, with the windows of each horizon.

    Args:
        measured_runs, dataset: as measured, and as simulated; see `Comparable`.
        horizons: name -> s, how far a prediction reaches.
    """
    given = output_names(model)
    as_read = {run.name: run for run in measured_runs.runs}
    measured: dict[str, dict[str, Array]] = {}
    for run in dataset.runs:
        both = {**run.outputs, **as_read[run.name].outputs}
        measured[run.name] = {
            name: values for name, values in both.items() if is_compared(name, given, model) and _has_values(values)
        }
    signals = tuple(dict.fromkeys(name for run in dataset.runs for name in measured[run.name]))
    starts = {run.name: _starts(run.time, measured[run.name]) for run in dataset.runs}
    known, notes = _known_at_starts(dataset, starts)
    courses = [Course("free_run", tuple(_stretch(run, (), np.inf) for run in dataset.runs), {})]
    for name, length in horizons.items() if known else ():
        if not np.isfinite(length):
            continue
        if max(float(np.median(np.diff(run.time))) for run in dataset.runs) * _LEAST_SAMPLES > length:
            notes.append(f"There is no horizon of {length:g} s: the samples are too far apart for it.")
            continue
        courses.append(_windowed(name, length, dataset, starts))
    return Track(dataset, signals, measured, starts, tuple(courses), tuple(notes))


def simulate(track: Track, models: Sequence[Model], *, jobs: int) -> dict[str, list[dict[str, Outputs]]]:
    """Returns horizon -> for each model run -> outputs, of all that the vehicle has.

    A horizon at which a model diverges is absent.
    """
    found = {}
    replay = Replay(track.dataset)
    for course in track.courses:
        try:
            found[course.horizon] = replay.simulate(models, threads=jobs, marks=course.marks)
        except SimulationError:
            continue
    return found


def deviation(track: Track, stretch: Stretch, signal: str, simulated: Array) -> tuple[Array, Array]:
    """Returns (n,) measured less simulated and (n,) the measured signal; NaN where there is nothing to compare.

    A signal that sums up counts from the start of its window: only its change has a meaning.
    """
    values = track.measured[stretch.run.name][signal]
    if signal not in SUMMED:
        error, reference = values - simulated, np.array(values)
    else:
        known = np.flatnonzero(np.isfinite(values))
        at_start = np.where(stretch.start > 0, values[stretch.start], values[known[0]])
        # A window starts from the measured value, a run from a simulated one.
        simulated_start = np.where(stretch.start > 0, values[stretch.start], simulated[known[0]])
        reference = values - at_start
        error = reference - (simulated - simulated_start)
    outside = ~stretch.within | ~np.isfinite(error)
    error[outside], reference[outside] = np.nan, np.nan
    return error, reference


def _has_values(values: Array) -> bool:
    return int(np.isfinite(values).sum()) > 1  # a motor's position beside its velocity keeps only the first sample


def _starts(time: Array, measured: Mapping[str, Array]) -> dict[str, Array]:
    """Returns what is known of the state at each sample. Rates are smoothed, or derived from what sums them up."""
    found: dict[str, Array] = {}
    for name, values in measured.items():
        if name in SUMMED:
            found[name] = values
        elif name in _STATES:
            found[name] = _smoothed(time, values)
    for summed, rate in RATE_OF.items():
        if summed in measured and rate not in found:
            found[rate] = zero_phase_rate(time, measured[summed])
    if "yaw_angle" in measured and "yaw_rate" not in found:
        found["yaw_rate"] = zero_phase_rate(time, measured["yaw_angle"])
    return found


_STATES = frozenset(RATE_OF.values()) | {"yaw_rate", "surge", "sway", "current", "current_left", "current_right"}


def _smoothed(time: Array, values: Array) -> Array:
    """Returns `values` without most of their noise and without delay: a parabola through the samples around each."""
    known = np.isfinite(values)
    count = 2 * int(_SMOOTHED_S / 2 / max(float(np.median(np.diff(time))), 1e-9)) + 1
    count = min(max(count, 5), (len(values) - 1) // 2 * 2 + 1)
    if count < 5 or known.sum() < count:
        return values
    filled = np.interp(time, time[known], values[known])
    return np.where(known, savgol_filter(filled, count, 2), np.nan)


def _known_at_starts(dataset: Dataset, starts: Mapping[str, Mapping[str, Array]]) -> tuple[bool, list[str]]:
    """Returns whether windows can start from what was measured, and a note if they cannot, or not wholly."""
    names = set.intersection(*(set(starts[run.name]) for run in dataset.runs))
    if dataset.vehicle == "motor":
        if names & {"speed", "velocity"}:
            return True, []
    elif all(names & {f"wheel_speed_{side}", f"wheel_velocity_{side}"} for side in _SIDES):
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
    """Returns a run in windows that start at `edges`; a sample at an edge is the last one of the window before."""
    starts = np.array([0, *edges], dtype=np.int64)
    start = starts[np.maximum(np.searchsorted(starts, np.arange(len(run.time)), side="left") - 1, 0)]
    within = run.time - run.time[start] <= length * (1 + 1e-6) + float(np.median(np.diff(run.time))) / 2
    return Stretch(run, start, within)
