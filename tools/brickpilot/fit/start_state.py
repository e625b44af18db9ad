"""The state that a run starts from, read off several samples instead of one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.signals import RATE_OF, SUMMED

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
