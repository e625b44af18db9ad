"""How many times a turn something repeats: read off the measured wheel speeds, before anything is simulated."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.discover.windows import wheel_angles

Array = NDArray[np.float64]

_STEP = 2 * math.pi / 256  # rad
_LOWEST, _HIGHEST = 0.9, 64.0  # a turn
_PADDING = 4
_BESIDE = 2.0  # orders either side that a peak is measured against
_STANDS_OUT = 6.0  # times the median of what is beside it
_PEAKS = 3
_SAME = 0.003  # orders that are one: nearer than a search finds the way between
_LONGEST = 2**15  # steps of angle: 800 rad either way, beyond which angles wrap
_RESOLUTION = 2 * math.pi / (_STEP * _LONGEST * _PADDING)


def orders(dataset: Dataset) -> tuple[float, ...]:
    """Orders at which the wheels' acceleration repeats with their angle, the strongest of each way to look first.

    Three ways, as no model is needed to see what repeats more often a turn than the drive does: with one phase for all
    runs of a wheel; with that in proportion to the current, as a motor's ripple is; and with the phases of each run for
    themselves. What stands for the current is the voltage that the speed does not account for.
    """
    alone = np.zeros(_LONGEST * _PADDING // 2 + 1)
    together: dict[tuple[str, bool], NDArray[np.complex128]] = {}
    for run in dataset.runs:
        driven = np.nan_to_num(motor_inputs(run, dataset))
        for wheel, (name, angle) in enumerate((wheel_angles(run) or {}).items()):
            speed = np.gradient(angle, run.time)
            jerked = np.gradient(speed, run.time) * np.gradient(run.time)
            volts = driven[:, min(wheel, driven.shape[1] - 1)]
            current = volts - speed * float(volts @ speed) / max(float(speed @ speed), 1e-300)
            sums = _sums(angle, jerked - jerked.mean())
            alone += np.abs(sums) ** 2
            for key, one in (((name, False), sums), ((name, True), _sums(angle, (jerked - jerked.mean()) * current))):
                together[key] = together.get(key, 0.0) + one
    coherent = [
        sum((np.abs(one) ** 2 for key, one in together.items() if key[1] is by_current), np.zeros_like(alone))
        for by_current in (False, True)
    ]
    found: list[float] = []
    for power in (*coherent, alone):
        found += [one for one in _peaks(power) if all(abs(one - other) > _SAME for other in found)]
    return tuple(found)


def _peaks(power: Array) -> list[float]:
    """Orders at which `power` (orders,) stands out, the strongest first."""
    if not power.any():
        return []
    order = np.arange(len(power)) * _RESOLUTION
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
    return found


def _sums(angle: Array, values: Array) -> NDArray[np.complex128]:
    """(orders,): Fourier sum over angle of `values` (n,) at `angle` (n,)."""
    bins = np.zeros(_LONGEST * _PADDING)
    np.add.at(bins, np.round(angle / _STEP).astype(np.int64) % len(bins), values)
    return np.asarray(np.fft.rfft(bins))
