"""The motion that a log shows without a model: rates, wheel angles, starts of runs, and windows of runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.signals import RATE_OF, SUMMED, Array
from brickpilot.errors import InputError

_REST_S = 0.5  # s: longest rest at the start of a run over which samples are averaged
MOVING_SAMPLES = 12
"""Number of samples to which a line is fitted if a run starts in motion."""
_LEAST_KNOWN = 4  # least number of known samples for the fit of a line
_LEAST_BENT = 6  # least number of known samples to test whether a motion is curved
_HELD_S = 0.1  # s: a slowly sampled channel has its first sample within this time from a run's start
_TREND_SD = 3.0  # limit on a polynomial's leading coefficient, in sds: a larger coefficient is motion and not noise
_OF_MOTION = (1, 2, 3)  # degrees of the polynomials tested for a trend; not only 1, because a swing may have no slope
_SPIKE = 3.0  # limit, in spans of the middle 90 % of samples: a sample farther from the median is damaged


def with_rates(dataset: Dataset) -> Dataset:
    """Returns a motor's data set with velocities added; only the first sample of a position is kept.

    Errors of the velocity add up in the position during a run. So the velocity is compared, and the position only gives
    the start of the run.
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
    """Returns the data set with each run's first sample replaced by an estimate from its first samples.

    A simulated run starts from the state in the first sample. The noise of this one sample would cause a false motion.
    So the samples before the first command are averaged. If the run starts in motion, a line is fitted to the first few
    samples. If the signal is curved even in these few samples, the measured sample is kept.

    Args:
        inputs: run -> (n, 1) or (n, 2) V.
    """
    runs = []
    for run in dataset.runs:
        outputs = dict(run.outputs)
        rest = _samples_at_rest(run, inputs[run.name])
        for name, values in outputs.items():
            moving = MOVING_SAMPLES
            if not np.isfinite(values[0]):  # a slowly sampled channel: its first sample may be some rows later
                moving = max(moving, int(np.searchsorted(run.time, run.time[0] + _HELD_S)))
            if name in SUMMED or name.startswith("accel") or not np.isfinite(values[:moving]).any():
                continue
            first = np.array(values)
            first[0] = _first_value(run.time, values, rest, moving)
            outputs[name] = first
        runs.append(dataclasses.replace(run, outputs=outputs))
    return dataclasses.replace(dataset, runs=tuple(runs))


def _samples_at_rest(run: Run, driven: Array) -> int:
    """Returns the number of samples before the first change of a command, at most those within `_REST_S`."""
    same = np.all((driven == driven[0]) | (np.isnan(driven) & np.isnan(driven[0])), axis=1)
    count = len(same) if same.all() else int(np.argmin(same))
    return min(count, int(np.searchsorted(run.time, run.time[0] + _REST_S)))


def _first_value(time: Array, values: Array, rest: int, moving: int) -> float:
    """Estimates the first of `values` (n,) from the first `rest` samples, or else from the first `moving` samples."""
    known = _without_spikes(values, np.flatnonzero(np.isfinite(values[: max(rest, moving)])))
    chosen = known[known < rest]
    if len(chosen) >= _LEAST_KNOWN and not any(_trends(time[chosen], values[chosen], degree) for degree in _OF_MOTION):
        return float(np.mean(values[chosen]))
    chosen = known[known < moving]
    while len(chosen) >= _LEAST_BENT and _trends(time[chosen], values[chosen], 2):
        chosen = chosen[: len(chosen) // 2]
    if len(chosen) < _LEAST_KNOWN:
        return float(values[known[0]])
    return float(np.polyfit(time[chosen] - time[0], values[chosen], 1)[1])


def _trends(time: Array, values: Array, degree: int) -> bool:
    """Returns whether the leading coefficient of a fitted polynomial is significant."""
    clock = (time - time.mean()) / max(float(np.ptp(time)), 1e-300)
    terms = np.vander(clock, degree + 1)
    fitted = np.linalg.lstsq(terms, values, rcond=None)[0]
    noise = np.sum((values - terms @ fitted) ** 2) / max(len(values) - degree - 1, 1)
    sd = float(np.sqrt(noise * np.linalg.pinv(terms.T @ terms)[0, 0]))
    return bool(abs(fitted[0]) >= _TREND_SD * sd + 1e-300)


def _without_spikes(values: Array, known: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the indices in `known` whose values are no outliers."""
    low, high = np.nanpercentile(values, [5, 95])
    if len(known) < _LEAST_KNOWN or high <= low:
        return known
    usual = np.abs(values[known] - np.median(values[known])) <= _SPIKE * (high - low)
    return np.asarray(known[usual])


MOTOR_RATE_OF = {summed: RATE_OF[summed] for summed in ("position", "angle")}
"""Position or angle of a motor -> its rate."""

_SAMPLES = 21  # number of samples in the filter's window
_FINEST = 20  # largest ratio of interpolated to measured samples, in case the times are very uneven


def measured_rates(run: Run) -> dict[str, Array]:
    """Returns the velocity or speed in a motor's run: as measured, or else the derivative of position or angle."""
    rates = {
        rate: zero_phase_rate(run.time, run.outputs[summed])
        for summed, rate in MOTOR_RATE_OF.items()
        if summed in run.outputs
    }
    return rates | {rate: run.outputs[rate] for rate in MOTOR_RATE_OF.values() if rate in run.outputs}


def zero_phase_rate(time: Array, values: Array) -> Array:
    """Returns the derivative of `values` without delay, (n,); NaN where `values` are.

    The filter is cubic over 21 samples (Savitzky & Golay 1964). It needs even steps, so irregular samples are first
    interpolated to the median step, or to a twentieth of the mean step if that is larger.
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


_STILL = 0.01  # share of the largest mean rate of any run: a slower wheel without drive counts as at rest
HOLE_S = 0.12  # s: a longer hole in measured angles or speeds is not filled
_WINDOW = ", window "  # text between the run's name and the window's number


def run_of(name: str) -> str:
    """Returns the name of the run from which a window was cut; for a whole run, its own name."""
    return name.rsplit(_WINDOW, 1)[0]


def cut_into_windows(dataset: Dataset, inputs: Mapping[str, Array], length_s: float) -> Dataset | None:
    """Returns the data set cut into windows: runs that start from the measured state, wheel angles included.

    An effect that is periodic in a wheel's angle gets out of phase if the simulated angle drifts. In a short window the
    effect stays in phase.

    Returns None if neither angles nor speeds of the wheels were measured.
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
        if not run.outputs:  # a run without outputs is not compared, but its heat and charge carry over
            windows.append(run)
            continue
        if angles is None:
            return None
        windows += _windows(run, angles, length_s, still)
    cut = dataclasses.replace(dataset, runs=tuple(windows))
    return with_averaged_starts(cut, {run.name: motor_inputs(run, cut) for run in windows})


def _windows(run: Run, angles: Mapping[str, Array], length_s: float, still: float) -> Iterator[Run]:
    """Yields the windows of a run. Only the first sample of an angle is kept, as the window's initial state.

    A window without a measurement, or with a vehicle at rest, is left out.
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
        yield run.rows(
            rows,
            name=f"{run.name}{_WINDOW}{number + 1}",
            outputs=outputs,
            raw_outputs={},
            gap_s=run.gap_s if number == 0 else 0.0,
            initial={} if number else run.initial,
        )


def _shows_nothing(run: Run, angles: Mapping[str, Array], rows: slice, still: float) -> bool:
    """Returns whether a window has no measurement, or no motor is driven and all wheels move by less than `still`."""
    if not any(np.isfinite(values[rows]).any() for values in run.outputs.values()):
        return True
    driven = any(np.nan_to_num(values[rows]).any() for values in run.inputs.values())
    return not driven and all(np.ptp(values[rows]) < still for values in angles.values())


def _without_holes(time: Array, values: Array | None) -> Array | None:
    """Returns the values with short holes interpolated, as a slowly sampled channel has; None: a hole is too long."""
    known = np.flatnonzero(np.isfinite(values)) if values is not None else np.empty(0, dtype=np.intp)
    if values is None or len(known) < 2 or len(known) == len(values):
        return values if len(known) else None
    holes = np.diff(time[np.concatenate([[0], known])])  # a hole after the last sample does not count
    return np.asarray(np.interp(time, time[known], values[known])) if holes.max() <= HOLE_S else None


def wheel_angles(run: Run) -> dict[str, Array] | None:
    """Returns wheel angles by name, measured or integrated from speeds; None if the angle of a wheel is not known.

    If only the first sample of an angle is known, the integral of the speed begins at this sample's value.
    """
    angle_of = {}
    for angle, rate in RATE_OF.items():
        if "travel" in angle:
            continue
        angles, rates = (_without_holes(run.time, run.outputs.get(name)) for name in (angle, rate))
        if angles is not None and (rates is None or np.isfinite(angles).all()):
            angle_of[angle] = angles
        elif rates is not None:
            begun = 0.0 if angles is None else float(np.nan_to_num(angles[0]))
            angle_of[angle] = begun + cumulative_trapezoid(rates, run.time, initial=0)
    one_of_two = len(angle_of) == 1 and angle_of.keys() & {"wheel_angle_left", "wheel_angle_right"}
    return None if one_of_two else angle_of or None


WINDOW_S = 1.0
"""The default length in s of the open-loop windows in which a motor's velocity is compared."""

LEAST_WINDOW_S, LEAST_WINDOW_SAMPLES = 1e-3, 10
"""Least length of a window, in s and in samples. The length of a sample is the largest median step of all runs."""


def _least_window_s(dataset: Dataset) -> float:
    coarsest = max(float(np.median(np.diff(run.time))) for run in dataset.runs)
    return max(LEAST_WINDOW_S, LEAST_WINDOW_SAMPLES * coarsest)


def check_window(dataset: Dataset, asked: float) -> None:
    """Raises InputError if a data set cannot be cut into windows of `asked` s."""
    if dataset.vehicle != "motor":
        raise InputError("windows need a data set of a motor", field="--window")
    least = _least_window_s(dataset)
    longest = max(float(run.time[-1] - run.time[0]) for run in dataset.runs)
    if not (1 - 1e-6) * least <= asked <= longest:
        raise InputError(
            f"{asked:g} s is not within {least:g} s, the least of {LEAST_WINDOW_SAMPLES} samples and 1 ms, "
            f"and {longest:g} s, the longest run; 0: no windows",
            field="--window",
        )


def window_length(dataset: Dataset, names: Sequence[str], asked: float | None) -> float:
    """Returns the length in s of the windows in which a motor's signals are compared; 0: whole runs are compared.

    Raises:
        InputError: a length is given, but neither a velocity nor a position is measured.
    """
    moves = any(name in names for pair in MOTOR_RATE_OF.items() for name in pair)
    if asked and not moves:
        raise InputError("windows need a velocity or a position that the model gives", field="--window")
    if asked is not None:
        return asked
    shortest = min(float(run.time[-1] - run.time[0]) for run in dataset.runs)
    return WINDOW_S if moves and shortest >= 3 * WINDOW_S >= 3 * _least_window_s(dataset) else 0.0
