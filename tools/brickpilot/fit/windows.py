"""Cuts runs into windows that each start from the measured state."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.fit.start_state import MOVING_SAMPLES, with_averaged_starts

Array = NDArray[np.float64]

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
    still = _STILL * length_s * max((_mean_rate(run, turned[run.name] or {}) for run in dataset.runs), default=0.0)
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


def _mean_rate(run: Run, angles: Mapping[str, Array]) -> float:
    return max((float(np.ptp(values)) for values in angles.values()), default=0.0) / float(run.time[-1] - run.time[0])


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
