"""Where a residual repeats or stands out: its spectra against time, wheel angle and position, and strips of the way."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.segment import Segment

Array = NDArray[np.float64]

_PEAKS = 3  # of a spectrum that are tried
_PADDING = 4  # a spectrum's points are so many times as dense as its resolution
_ANGLE_STEP, _POSITION_STEP = 2 * math.pi / 100, 0.005  # rad, m: of the spectra
_CELLS, _STRIPS = 24, 2  # of the way, looked at for a strip that differs; strips that are tried

_ANGLES = ("wheel_angle_left", "wheel_angle_right", "angle")
_POSITIONS = ("x", "position")


def angle_orders(segments: Sequence[Segment], left: Array) -> list[float]:
    """Periods per turn of a wheel at which `left` (N,) is strongest; none where no angle is known."""
    return _peaks_over(segments, left, _ANGLES, _ANGLE_STEP, 2 * math.pi)


def wavelengths(segments: Sequence[Segment], left: Array) -> list[float]:
    """m of x at which `left` (N,) repeats most strongly."""
    return [1 / f for f in _peaks_over(segments, left, _POSITIONS, _POSITION_STEP, 1.0)]


def angle_resolution(segments: Sequence[Segment]) -> float:
    """Periods per turn that the longest run tells apart."""
    return 2 * math.pi / _extent(segments, _ANGLES)


def position_resolution(segments: Sequence[Segment]) -> float:
    """1/m that the longest run tells apart."""
    return 1 / _extent(segments, _POSITIONS)


def time_resolution(segments: Sequence[Segment], clock: float) -> float:
    """Hz that the longest run tells apart or, where `clock` is 1, all runs together."""
    return 1 / max(float(one.time[-1]) + clock * one.age for one in segments)


def _extent(segments: Sequence[Segment], names: Sequence[str]) -> float:
    """How far the longest way of a run goes."""
    return max(float(np.ptp(one.at[name])) for one in segments for name in names if name in one.at)


def frequencies(segments: Sequence[Segment], left: Array, clock: float) -> list[float]:
    """Hz at which `left` (N,) is strongest, time counted from each run's start (clock 0) or from power-on (1)."""
    step = min(float(np.median(np.diff(one.time))) for one in segments if len(one.time) > 1)
    longest = max(float(one.time[-1]) for one in segments)
    found = _spectrum([(one, one.time + clock * one.age) for one in segments], left, step, coherent=True)
    return _peaks(*found, least=1.5 / longest, apart=0.5 / longest)


def _peaks_over(
    segments: Sequence[Segment], left: Array, names: Sequence[str], step: float, turn: float
) -> list[float]:
    """Peaks in periods per `turn` of the coordinates `names`."""
    found: list[float] = []
    for name in names:
        known = [one for one in segments if name in one.at and np.ptp(one.at[name]) > 20 * step]
        if not known:
            continue
        longest = _extent(known, [name])
        spectrum = _spectrum([(one, one.at[name]) for one in known], left, step, coherent=False)
        found += [f * turn for f in _peaks(*spectrum, least=1.5 / longest, apart=0.5 / longest)]
    return sorted(set(found))


def _spectrum(
    ways: Sequence[tuple[Segment, Array]], left: Array, step: float, *, coherent: bool
) -> tuple[Array, Array]:
    """Frequencies and power against each segment's coordinate, runs added with their phases (coherent) or without."""
    low = min(float(np.min(way)) for _, way in ways)
    high = max(float(np.max(way)) for _, way in ways)
    length = 2 ** math.ceil(math.log2(max(_PADDING * (high - low) / step, 8)))
    power = np.zeros(length // 2 + 1)
    sums: dict[str, NDArray[np.complex128]] = {}
    for one, way in ways:
        values = left[one.place]
        bins = ((way - low) / step).astype(np.intp)
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
    """Middle and half width, m, of strips that share the way between them; none where the vehicle hardly moves."""
    ways = [one.at[name] for one in segments for name in _POSITIONS if name in one.at]
    if not ways:
        return []
    low, high = min(float(np.min(way)) for way in ways), max(float(np.max(way)) for way in ways)
    width = (high - low) / _CELLS
    if width <= 4e-3:
        return []
    middles = low + width * (np.arange(_CELLS) + 0.5)
    return [(float(middle), width / 2) for middle in middles]


def best_windows(slopes: Array, left: Array) -> list[tuple[int, int]]:
    """First and last cell of the rows of cells that take most away together, none overlapping a better one.

    Args:
        slopes: (N, cells): what each cell does to the residual `left` (N,).
    """
    gains = {}
    for first in range(slopes.shape[1]):
        column = np.zeros_like(left)
        for last in range(first, slopes.shape[1]):
            column = column + slopes[:, last]
            strength = float(column @ column)
            gains[first, last] = float(column @ left) ** 2 / strength if strength > 0 else 0.0
    found: list[tuple[int, int]] = []
    for window in sorted(gains, key=lambda one: -gains[one]):
        if gains[window] > 0 and all(window[1] < other[0] or window[0] > other[1] for other in found):
            found.append(window)
        if len(found) == _STRIPS:
            break
    return found
