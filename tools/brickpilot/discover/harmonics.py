"""The orders (periods per turn) of periodic effects, read off the measured wheel speeds before any simulation."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.fit.windows import HOLE_S, wheel_angles

Array = NDArray[np.float64]

_STEP = 2 * math.pi / 256  # rad
_LOWEST, _HIGHEST = 0.9, 115.0  # orders; `_STEP` resolves 128
_SLOW = 0.1  # quantile of the turn from sample to sample: the slow parts of the runs show the highest orders
_TURNS = 1e-3  # rad between samples: a wheel that turns less stands
_PADDING = 4
_NEIGHBOURHOOD = 2.0  # orders on either side that a peak is compared with
_PROMINENCE = 6.0  # times the median of its neighbourhood
_PEAKS = 3
_SAME = 0.003  # orders nearer than this are one: a search finds the way between them
_LONGEST = 2**15  # steps of angle: 800 rad, beyond which angles wrap
_RESOLUTION = 2 * math.pi / (_STEP * _LONGEST * _PADDING)


def orders(dataset: Dataset) -> tuple[float, ...]:
    """Returns the orders at which the wheels' acceleration repeats with their angle, the strongest first.

    There are three spectra: one phase for all runs of a wheel; the same in proportion to the current, as a motor's
    ripple is; and a phase for each run. The current is taken as the voltage that the speed does not explain. No model
    is needed, because an effect repeats more often per turn than the drive does.
    """
    alone = np.zeros(_LONGEST * _PADDING // 2 + 1)
    together: dict[tuple[str, bool], NDArray[np.complex128]] = {}
    for whole in dataset.runs:
        run, rows = _measured(whole)
        driven = np.nan_to_num(motor_inputs(whole, dataset))[rows]
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


def _measured(run: Run) -> tuple[Run, slice]:
    """Returns the longest part of a run that was measured without a long hole, and its rows: some may be held out.

    Behind a hole nobody knows the wheel's angle any more.
    """
    known = np.flatnonzero(np.any([np.isfinite(one) for one in run.outputs.values()], axis=0))
    parts = np.split(known, np.flatnonzero(np.diff(run.time[known]) > HOLE_S) + 1)
    longest = max(parts, key=len)
    rows = slice(int(longest[0]), int(longest[-1]) + 1) if len(longest) else slice(0, 0)
    outputs = {name: one[rows] for name, one in run.outputs.items()}
    return dataclasses.replace(run, time=run.time[rows], outputs=outputs), rows


def resolved_order(dataset: Dataset) -> float | None:
    """Returns the highest order that the samples can show; None if no wheel was measured.

    Two samples a period are needed. A ripple of a higher order than this is seen at a wrong one or not at all, and what
    it does on average may pose as friction or as dead time.
    """
    steps = [np.abs(np.diff(angle)) for run in dataset.runs for angle in (wheel_angles(run) or {}).values()]
    turning = np.concatenate([step[step > _TURNS] for step in steps]) if steps else np.empty(0)
    return math.pi / float(np.quantile(turning, _SLOW)) if len(turning) else None


def _peaks(power: Array) -> list[float]:
    """Returns the orders at which `power` (orders,) has a peak, the strongest first."""
    if not power.any():
        return []
    order = np.arange(len(power)) * _RESOLUTION
    found: list[float] = []
    inside = (order > _LOWEST) & (order < _HIGHEST)
    for index in np.argsort(np.where(inside, -power, 0.0))[: 50 * _PEAKS].tolist():
        if not inside[index] or any(abs(order[index] - one) < _NEIGHBOURHOOD for one in found):
            continue
        neighbours = (np.abs(order - order[index]) < _NEIGHBOURHOOD) & (np.abs(order - order[index]) > 0.25)
        if power[index] > _PROMINENCE * float(np.median(power[neighbours])):
            found.append(float(order[index]))
        if len(found) == _PEAKS:
            break
    return found


def _sums(angle: Array, values: Array) -> NDArray[np.complex128]:
    """Returns (orders,): the Fourier sum over the angle of `values` (n,) at `angle` (n,)."""
    bins = np.zeros(_LONGEST * _PADDING)
    np.add.at(bins, np.round(angle / _STEP).astype(np.int64) % len(bins), values)
    return np.asarray(np.fft.rfft(bins))
