"""Coordinates along which a residual may be periodic (time, a wheel's angle, the position), and their spectra."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.periods import PADDING, separate
from brickpilot.data.signals import Array

Spectrum = NDArray[np.complex128]
Settings = tuple[tuple[str, float], ...]
"""(name, value) of each setting that shapes a periodic term."""

_NEIGHBOURS = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # offsets of the candidates in `beside`, in resolutions
_LEAST_STEPS = 20  # in sampling steps: a run whose coordinate does not change by more is not used

# Setting that states a period -> names of its coordinate, sampling step, and length of one turn or 1 m (in rad or m).
_COORDINATES = {
    "order": (("wheel_angle_left", "wheel_angle_right", "angle"), 2 * math.pi / 100, 2 * math.pi),
    "wavelength": (("x", "position"), 0.005, 1.0),
}


@dataclass(frozen=True)
class Segment:
    """One signal of one run in the stacked residual (the residuals of all runs and signals in one array).

    Attributes:
        place: the segment's rows in the stacked residual.
        time: (n,) s since the run's first sample.
        age: s from power-on to the run's first sample.
        at: coordinate -> (n,) its values at `time`, which the model without the new term simulates. The coordinates
            are wheel angles, "x", or "angle" and "position" of a motor. If a coordinate is missing, no term that
            depends on it is tried.
    """

    run: str
    signal: str
    place: slice
    time: Array
    age: float
    at: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Axis:
    """A coordinate along which a residual may be periodic: time, a wheel's angle or the position.

    Attributes:
        setting: the setting that states a period: "frequency" in Hz, "order", or "wavelength" in m.
        clock: ("clock", 0): time counts from the start of each run; ("clock", 1): it counts from power-on;
            empty: the axis is not time.
        tracks: a list for each wheel's angle or other such coordinate. The list has pairs: a segment, and the
            coordinate's values (n,) in this segment.
        step: the sampling step for a spectrum, in the coordinate's unit.
        turn: the length over which periods are counted (1 s, one turn or 1 m), in the coordinate's unit.
        extent: the longest span of the coordinate over which a periodic term keeps its phase, in the coordinate's unit.
    """

    setting: str
    clock: Settings
    tracks: Sequence[Sequence[tuple[Segment, Array]]]
    step: float
    turn: float
    extent: float

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the settings that define a period along this axis."""
        return (self.setting, *(name for name, _ in self.clock))

    @property
    def resolution(self) -> float:
        """The smallest difference of two frequencies that the runs resolve, in periods per turn, per m or per s."""
        return self.turn / self.extent

    @property
    def least(self) -> float:
        """The least frequency in Hz: a slower change has less than one period in the data and counts as drift."""
        return self.resolution if self.clock else 0.0

    def peaks(self, residual: Array) -> list[float]:
        """Returns the highest peaks in the spectrum of `residual` (N,), in periods per turn, per m or per s."""
        peaks: set[float] = set()
        for track in self.tracks:
            places, power = _spectrum(track, residual, self.step, coherent=bool(self.clock))
            longest = max(float(np.ptp(coordinate)) for _, coordinate in track)
            inner = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (places[1:-1] >= 1.5 / longest)
            indices = np.flatnonzero(inner) + 1
            strongest = indices[np.argsort(-power[indices], kind="stable")]
            peaks |= {place * self.turn for place in separate(places, strongest, 0.5 / longest)}
        return sorted(peaks)

    def at(self, count: float) -> Settings:
        """Returns the settings of a term with `count` periods per turn, per m or per s."""
        return ((self.setting, 1 / count if self.setting == "wavelength" else count), *self.clock)

    def beside(self, settings: Settings) -> list[Settings]:
        """Returns settings with slightly longer and shorter periods than `settings`, as candidates for a fit."""
        count = dict(settings)[self.setting]
        count = 1 / count if self.setting == "wavelength" else count
        near = [count + k * self.resolution for k in _NEIGHBOURS]
        return [self.at(other) for other in near if other > 0 and other >= self.least]


def axes(segments: Sequence[Segment]) -> list[Axis]:
    """Returns the axes: time from each run's start, time from power-on if the runs' ages differ, angle and position."""
    step = min(float(np.median(np.diff(segment.time))) for segment in segments if len(segment.time) > 1)
    known_axes = []
    for clock in (0.0, 1.0) if len({segment.age for segment in segments}) > 1 else (0.0,):
        track = [(segment, segment.time + clock * segment.age) for segment in segments]
        extent = max(float(time[-1]) for _, time in track)
        known_axes.append(Axis("frequency", (("clock", clock),), [track], step, 1.0, extent))
    for setting, (names, step, turn) in _COORDINATES.items():
        known = [[(segment, segment.at[name]) for segment in segments if name in segment.at] for name in names]
        ways = [float(np.ptp(coordinate)) for track in known for _, coordinate in track]
        moved = [[pair for pair in track if np.ptp(pair[1]) > _LEAST_STEPS * step] for track in known]
        if ways:
            known_axes.append(Axis(setting, (), [track for track in moved if track], step, turn, max(ways)))
    return known_axes


def _spectrum(
    track: Sequence[tuple[Segment, Array]], residual: Array, step: float, *, coherent: bool
) -> tuple[Array, Array]:
    """Returns frequencies along the coordinate, and the power at each; `coherent`: all runs share one phase."""
    low = min(float(np.min(coordinate)) for _, coordinate in track)
    high = max(float(np.max(coordinate)) for _, coordinate in track)
    length = 2 ** math.ceil(math.log2(max(PADDING * (high - low) / step, 8)))
    sums: dict[tuple[str, ...], Spectrum] = {}
    for segment, coordinate in track:
        values = residual[segment.place]
        bins = ((coordinate - low) / step).astype(np.intp)
        key = (segment.signal,) if coherent else (segment.signal, segment.run)
        sums[key] = sums.get(key, 0.0) + np.fft.rfft(np.bincount(bins, values - values.mean(), length)[:length])
    power = sum((np.abs(spectrum) ** 2 for spectrum in sums.values()), np.zeros(length // 2 + 1))
    return np.arange(length // 2 + 1) / (length * step), power
