"""Where data are periodic: the wheels' speeds as measured, and a residual over time, wheel angle and position.

An order is a number of periods per turn. Strips of the floor, which a vehicle crosses again and again, stand here too.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.fit.start_state import HOLE_S, wheel_angles

Array = NDArray[np.float64]

_STEP = 2 * math.pi / 256  # rad
_LOWEST, _HIGHEST = 0.9, 115.0  # orders; `_STEP` resolves 128
_SLOW = 0.1  # quantile of the turn from sample to sample: the slow parts of the runs show the highest orders
_TURNS = 1e-3  # rad between samples: a wheel that turns less stands
_PADDING = 4  # points of a spectrum per resolution
_NEIGHBOURHOOD = 2.0  # orders on either side that a peak is compared with
_PROMINENCE = 6.0  # times the median of its neighbourhood
_PEAKS = 3  # of a spectrum, that are tried
_LEAST_ROWS = 3  # a shorter part of a run has no acceleration
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
        if len(driven) < _LEAST_ROWS:
            continue
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
    is_hole = (np.diff(run.time[known]) > HOLE_S) & (np.diff(known) > 1)
    parts = np.split(known, np.flatnonzero(is_hole) + 1)
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


_ANGLE_STEP, _POSITION_STEP = 2 * math.pi / 100, 0.005  # rad, m: of the spectra
_CELLS, _STRIPS = 24, 2  # cells of the travel, to look for strips; strips that are tried

_ANGLES = ("wheel_angle_left", "wheel_angle_right", "angle")
_POSITIONS = ("x", "position")


@dataclass(frozen=True)
class Segment:
    """One signal of one run in the stacked residual.

    Attributes:
        place: its rows.
        time: (n,) s since the run's first sample.
        age: s from power-on to the run's first sample.
        at: what the base model gives at these rows, by name: wheel angles, "x", or "angle" and "position" of a motor.
            Terms that depend on a missing one are not screened.
    """

    run: str
    signal: str
    place: slice
    time: Array
    age: float
    at: Mapping[str, Array]


def angle_orders(segments: Sequence[Segment], residual: Array) -> list[float]:
    """Returns the periods per turn of a wheel at which `residual` (N,) is strongest; none if no angle is known."""
    return _peaks_over(segments, residual, _ANGLES, _ANGLE_STEP, 2 * math.pi)


def wavelengths(segments: Sequence[Segment], residual: Array) -> list[float]:
    """Returns the wavelengths in x, m, at which `residual` (N,) is strongest."""
    return [1 / f for f in _peaks_over(segments, residual, _POSITIONS, _POSITION_STEP, 1.0)]


def angle_resolution(segments: Sequence[Segment]) -> float:
    """Returns the difference of periods per turn that the longest run resolves."""
    return 2 * math.pi / _extent(segments, _ANGLES)


def position_resolution(segments: Sequence[Segment]) -> float:
    """Returns the difference of wave numbers, 1/m, that the longest run resolves."""
    return 1 / _extent(segments, _POSITIONS)


def time_resolution(segments: Sequence[Segment], clock: float) -> float:
    """Returns the difference of frequencies, Hz, that the longest run resolves, or for clock 1 all runs together."""
    return 1 / max(float(one.time[-1]) + clock * one.age for one in segments)


def _extent(segments: Sequence[Segment], names: Sequence[str]) -> float:
    """Returns the longest travel of a run."""
    return max(float(np.ptp(one.at[name])) for one in segments for name in names if name in one.at)


def frequencies(segments: Sequence[Segment], residual: Array, clock: float) -> list[float]:
    """Returns the frequencies, Hz, at which `residual` (N,) is strongest.

    Time counts from the start of each run for clock 0, from power-on for clock 1.
    """
    step = min(float(np.median(np.diff(one.time))) for one in segments if len(one.time) > 1)
    longest = max(float(one.time[-1]) for one in segments)
    found = _spectrum([(one, one.time + clock * one.age) for one in segments], residual, step, coherent=True)
    return _separate_peaks(*found, least=1.5 / longest, apart=0.5 / longest)


def _peaks_over(
    segments: Sequence[Segment], residual: Array, names: Sequence[str], step: float, turn: float
) -> list[float]:
    """Returns peaks in periods per `turn` of the coordinates `names`."""
    found: list[float] = []
    for name in names:
        known = [one for one in segments if name in one.at and np.ptp(one.at[name]) > 20 * step]
        if not known:
            continue
        longest = _extent(known, [name])
        spectrum = _spectrum([(one, one.at[name]) for one in known], residual, step, coherent=False)
        found += [f * turn for f in _separate_peaks(*spectrum, least=1.5 / longest, apart=0.5 / longest)]
    return sorted(set(found))


def _spectrum(
    coordinates: Sequence[tuple[Segment, Array]], residual: Array, step: float, *, coherent: bool
) -> tuple[Array, Array]:
    """Returns frequencies and power over each segment's coordinate. Coherent: runs are added with their phases."""
    low = min(float(np.min(coordinate)) for _, coordinate in coordinates)
    high = max(float(np.max(coordinate)) for _, coordinate in coordinates)
    length = 2 ** math.ceil(math.log2(max(_PADDING * (high - low) / step, 8)))
    power = np.zeros(length // 2 + 1)
    sums: dict[str, NDArray[np.complex128]] = {}
    for one, coordinate in coordinates:
        values = residual[one.place]
        bins = ((coordinate - low) / step).astype(np.intp)
        spectrum = np.fft.rfft(np.bincount(bins, values - values.mean(), length)[:length])
        if coherent:
            sums[one.signal] = sums.get(one.signal, 0.0) + spectrum
        else:
            power += np.abs(spectrum) ** 2
    for spectrum in sums.values():
        power += np.abs(spectrum) ** 2
    return np.arange(length // 2 + 1) / (length * step), power


def _separate_peaks(places: Array, power: Array, *, least: float, apart: float) -> list[float]:
    inner = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (places[1:-1] >= least)
    found: list[float] = []
    for index in sorted((np.flatnonzero(inner) + 1).tolist(), key=lambda k: -float(power[k])):
        if all(abs(places[index] - other) > apart for other in found):
            found.append(float(places[index]))
        if len(found) == _PEAKS:
            break
    return found


def cells(segments: Sequence[Segment]) -> list[tuple[float, float]]:
    """Returns middle and half width, m, of cells that divide the travel; none if the vehicle hardly moves."""
    travels = [one.at[name] for one in segments for name in _POSITIONS if name in one.at]
    if not travels:
        return []
    low, high = min(float(np.min(travel)) for travel in travels), max(float(np.max(travel)) for travel in travels)
    width = (high - low) / _CELLS
    if width <= 4e-3:
        return []
    middles = low + width * (np.arange(_CELLS) + 0.5)
    return [(float(middle), width / 2) for middle in middles]


def best_windows(slopes: Array, residual: Array) -> list[tuple[int, int]]:
    """Returns the first and last cell of the strips that explain most; none overlaps a better one.

    Args:
        slopes: (N, cells): what each cell does to `residual` (N,).
    """
    gains = {}
    for first in range(slopes.shape[1]):
        column = np.zeros_like(residual)
        for last in range(first, slopes.shape[1]):
            column = column + slopes[:, last]
            strength = float(column @ column)
            gains[first, last] = float(column @ residual) ** 2 / strength if strength > 0 else 0.0
    found: list[tuple[int, int]] = []
    for window in sorted(gains, key=lambda one: -gains[one]):
        if gains[window] > 0 and all(window[1] < other[0] or window[0] > other[1] for other in found):
            found.append(window)
        if len(found) == _STRIPS:
            break
    return found
