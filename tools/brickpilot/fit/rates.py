"""The rate of a motor's motion: as measured, or the derivative of the position without delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Run
from brickpilot.data.signals import RATE_OF

Array = NDArray[np.float64]

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
