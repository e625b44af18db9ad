"""How many times a turn something repeats: read off the measured wheel speeds, before anything is simulated."""

from __future__ import annotations

import math
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from brickpilot.dataset import Dataset
from brickpilot.discover.band import angles_of

Array = NDArray[np.float64]

_STEP = 2 * math.pi / 256  # rad
_LOWEST, _HIGHEST = 0.9, 64.0  # a turn
_PADDING = 4
_BESIDE = 2.0  # orders either side that a peak is measured against
_STANDS_OUT = 6.0  # times the median of what is beside it
_PEAKS = 3


def orders(dataset: Dataset) -> tuple[float, ...]:
    """Orders at which the wheels' acceleration repeats with their angle, the strongest first; none is common.

    The spectrum of acceleration over angle, all wheels and runs together: the Fourier sum of samples sorted into steps
    of angle. No model is needed, as what repeats so often a turn is not the drive.
    """
    power: Array | None = None
    for run in dataset.runs:
        for angle in chain((angles_of(run) or {}).values()):
            spectrum = _spectrum(run.time, angle)
            power = spectrum if power is None else power + spectrum
    if power is None:
        return ()
    order = np.arange(len(power)) * _resolution()
    found: list[float] = []
    inside = (order > _LOWEST) & (order < _HIGHEST)
    for index in np.argsort(np.where(inside, -power, 0.0))[: 50 * _PEAKS].tolist():
        if not inside[index] or any(abs(order[index] - one) < _BESIDE for one in found):
            continue
        beside = (np.abs(order - order[index]) < _BESIDE) & (np.abs(order - order[index]) > 0.25)
        if power[index] > _STANDS_OUT * float(np.median(power[beside])):
            found.append(float(order[index]))
        if len(found) == _PEAKS:
            break
    return tuple(found)


_LONGEST = 2**15  # steps of angle: 800 rad either way, beyond which angles wrap


def _resolution() -> float:
    return 2 * math.pi / (_STEP * _LONGEST * _PADDING)


def _spectrum(time: Array, angle: Array) -> Array:
    """Squared Fourier sum over angle of the second difference of `angle` in time, (orders,)."""
    speed = np.gradient(angle, time)
    accel = np.gradient(speed, time) * np.gradient(time)
    bins = np.zeros(_LONGEST * _PADDING)
    np.add.at(bins, np.round(angle / _STEP).astype(np.int64) % len(bins), accel - accel.mean())
    return np.abs(np.fft.rfft(bins)) ** 2
