"""Where a residual is periodic: spectra over time, wheel angle and position; and strips of the floor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PEAKS = 3  # peaks of a spectrum that are tried
_PADDING = 4  # points of a spectrum per resolution
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
    return _peaks(*found, least=1.5 / longest, apart=0.5 / longest)


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
        found += [f * turn for f in _peaks(*spectrum, least=1.5 / longest, apart=0.5 / longest)]
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


def _peaks(places: Array, power: Array, *, least: float, apart: float) -> list[float]:
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
