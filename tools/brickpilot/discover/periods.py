"""Where data are periodic: the wheels' speeds as measured, and a residual along time, a wheel's angle and the position.

An order is a number of periods per turn.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle
from scipy.stats import f as fisher

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.motion import HOLE_S, wheel_angles
from brickpilot.discover import numbers

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]
Settings = tuple[tuple[str, float], ...]

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
    plain, by_current = dict[str, Spectrum](), dict[str, Spectrum]()
    for whole in dataset.runs:
        run, rows = _measured(whole)
        driven = np.nan_to_num(motor_inputs(whole, dataset))[rows]
        if len(driven) < _LEAST_ROWS:
            continue
        for wheel, (name, angle) in enumerate((wheel_angles(run) or {}).items()):
            speed = np.gradient(angle, run.time)
            jerked = np.gradient(speed, run.time) * np.gradient(run.time)
            jerked -= jerked.mean()
            volts = driven[:, min(wheel, driven.shape[1] - 1)]
            current = volts - speed * float(volts @ speed) / max(float(speed @ speed), 1e-300)
            sums = _sums(angle, jerked)
            alone += np.abs(sums) ** 2
            plain[name] = plain.get(name, 0.0) + sums
            by_current[name] = by_current.get(name, 0.0) + _sums(angle, jerked * current)
    found: list[float] = []
    coherent = [
        sum((np.abs(one) ** 2 for one in wheels.values()), np.zeros_like(alone)) for wheels in (plain, by_current)
    ]
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
    """Returns the orders at which `power` (orders,) stands out of its neighbourhood, the strongest first."""
    order = np.asarray(np.arange(len(power)) * _RESOLUTION, dtype=np.float64)

    def stands_out(index: int) -> bool:
        away = np.abs(order - order[index])
        return bool(power[index] > _PROMINENCE * np.median(power[(away < _NEIGHBOURHOOD) & (away > 0.25)]))

    inside = np.flatnonzero((order > _LOWEST) & (order < _HIGHEST) & (power > 0.0))
    strongest = inside[np.argsort(-power[inside])][: 50 * _PEAKS]
    return _separate(order, strongest, _NEIGHBOURHOOD, stands_out)


def _separate(
    places: Array, indices: NDArray[np.intp], apart: float, counts: Callable[[int], bool] = lambda _: True
) -> list[float]:
    """Returns the first few of `places` at `indices` that count and lie `apart` from those before them."""
    found: list[float] = []
    for index in indices.tolist():
        if all(abs(places[index] - other) >= apart for other in found) and counts(index):
            found.append(float(places[index]))
        if len(found) == _PEAKS:
            break
    return found


def _sums(angle: Array, values: Array) -> Spectrum:
    """Returns (orders,): the Fourier sum over the angle of `values` (n,) at `angle` (n,)."""
    length = _LONGEST * _PADDING
    bins = np.round(angle / _STEP).astype(np.intp) % length
    return np.asarray(np.fft.rfft(np.bincount(bins, values, length)))


_NEIGHBOURS = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # times the resolution of a spectrum
_LEAST_STEPS = 20  # of a spectrum, that a coordinate has to move by

# What a period along it is called -> names of the coordinate, its step in a spectrum, rad or m, and what is one turn.
_COORDINATES = {
    "order": (("wheel_angle_left", "wheel_angle_right", "angle"), 2 * math.pi / 100, 2 * math.pi),
    "wavelength": (("x", "position"), 0.005, 1.0),
}


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


@dataclass(frozen=True, eq=False)
class Axis:
    """A coordinate along which a residual may repeat: time, a wheel's angle or the position.

    Attributes:
        setting: what holds a period along it: a frequency in Hz, an order, or a wavelength in m.
        clock: of time: ("clock", 0) where it counts from the start of each run, ("clock", 1) from power-on.
        tracks: the segments with their coordinate (n,), once for each name that it has.
        step: of the spectrum, in the coordinate's unit.
        turn: what one period is counted for, in the coordinate's unit.
        extent: the longest way along it that has one phase.
    """

    setting: str
    clock: Settings
    tracks: Sequence[Sequence[tuple[Segment, Array]]]
    step: float
    turn: float
    extent: float

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the settings that a period along it has."""
        return (self.setting, *(name for name, _ in self.clock))

    @property
    def resolution(self) -> float:
        """The difference of periods per turn, m or s that the runs resolve."""
        return self.turn / self.extent

    @property
    def least(self) -> float:
        """The least frequency: what repeats less than once in all time is a drift."""
        return self.resolution if self.clock else 0.0

    def peaks(self, residual: Array) -> list[float]:
        """Returns the periods per turn, m or s at which `residual` (N,) is strongest along it."""
        found: set[float] = set()
        for track in self.tracks:
            places, power = _spectrum(track, residual, self.step, coherent=bool(self.clock))
            longest = max(float(np.ptp(coordinate)) for _, coordinate in track)
            inner = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (places[1:-1] >= 1.5 / longest)
            indices = np.flatnonzero(inner) + 1
            strongest = indices[np.argsort(-power[indices], kind="stable")]
            found |= {one * self.turn for one in _separate(places, strongest, 0.5 / longest)}
        return sorted(found)

    def at(self, count: float) -> Settings:
        """Returns the settings of so many periods per turn, m or s."""
        return ((self.setting, 1 / count if self.setting == "wavelength" else count), *self.clock)

    def beside(self, settings: Settings) -> list[Settings]:
        """Returns settings with a slightly longer or shorter period: a fit finds the best phase, not the next one."""
        count = dict(settings)[self.setting]
        count = 1 / count if self.setting == "wavelength" else count
        near = [count + k * self.resolution for k in _NEIGHBOURS]
        return [self.at(one) for one in near if one > 0 and one >= self.least]


def axes(segments: Sequence[Segment]) -> list[Axis]:
    """Returns the coordinates that are known: time first, from power-on too if the runs differ in age."""
    step = min(float(np.median(np.diff(one.time))) for one in segments if len(one.time) > 1)
    found = []
    for clock in (0.0, 1.0) if len({one.age for one in segments}) > 1 else (0.0,):
        track = [(one, one.time + clock * one.age) for one in segments]
        extent = max(float(time[-1]) for _, time in track)
        found.append(Axis("frequency", (("clock", clock),), [track], step, 1.0, extent))
    for setting, (names, step, turn) in _COORDINATES.items():
        known = [[(one, one.at[name]) for one in segments if name in one.at] for name in names]
        ways = [float(np.ptp(coordinate)) for track in known for _, coordinate in track]
        moved = [[pair for pair in track if np.ptp(pair[1]) > _LEAST_STEPS * step] for track in known]
        if ways:
            found.append(Axis(setting, (), [track for track in moved if track], step, turn, max(ways)))
    return found


def _spectrum(
    track: Sequence[tuple[Segment, Array]], residual: Array, step: float, *, coherent: bool
) -> tuple[Array, Array]:
    """Returns frequencies and power over each segment's coordinate. Coherent: runs are added with their phases."""
    low = min(float(np.min(coordinate)) for _, coordinate in track)
    high = max(float(np.max(coordinate)) for _, coordinate in track)
    length = 2 ** math.ceil(math.log2(max(_PADDING * (high - low) / step, 8)))
    sums: dict[tuple[str, ...], Spectrum] = {}
    for one, coordinate in track:
        values = residual[one.place]
        bins = ((coordinate - low) / step).astype(np.intp)
        key = (one.signal,) if coherent else (one.signal, one.run)
        sums[key] = sums.get(key, 0.0) + np.fft.rfft(np.bincount(bins, values - values.mean(), length)[:length])
    power = sum((np.abs(one) ** 2 for one in sums.values()), np.zeros(length // 2 + 1))
    return np.arange(length // 2 + 1) / (length * step), power


_AROUND = 8  # frequencies on either side: 32 degrees of freedom a piece know the background to a fourth
_FINER = 20  # frequencies between two multiples, where a peak is read off


@dataclass(frozen=True)
class Period:
    """A disturbance with a period of its own in time.

    Attributes:
        frequency: Hz.
        amplitude: of the sine, in the residual's unit, rms over the pieces.
        share: 0..1, of the residual's power.
        chance: probability of so high a peak at any frequency without a period.
    """

    frequency: float
    amplitude: float
    share: float
    chance: float

    @property
    def sentence(self) -> str:
        """Returns the sentence for the user."""
        return (
            f"a disturbance of {self.frequency:.3g} Hz that no command makes holds {100 * self.share:.2g} % of what is "
            f"left, with an amplitude of {self.amplitude:.3g}"
        )


def own_period(residuals: Sequence[tuple[Array, Array]]) -> Period | None:
    """Returns the clearest disturbance with a period in time, of any phase in each run; None: there is none.

    Runs are cut into pieces as long as the median run. The Lomb-Scargle power of each (Scargle 1982, Astrophys. J.
    263), over its piece's variance, is added up at the multiples of one over a piece's duration, and compared with the
    mean of eight frequencies on either side, without the nearest, which a peak between two fills too: where the
    background is smooth their ratio is Fisher's F, with two degrees of freedom a piece and frequency. So a period must
    repeat ten times in a piece. A lightly damped resonance looks the same.

    Args:
        residuals: a run each: time (n,) in s, which may be uneven, and residual (n,), NaN where it is not known.
    """
    known = [(time[good], left[good]) for time, left in residuals if (good := np.isfinite(left)).any()]
    if not known:
        return None
    duration = float(np.median([time[-1] - time[0] for time, _ in known]))
    pieces = [piece for time, left in known for piece in _pieces(time, left, duration)]
    if not pieces:
        return None
    row_s = float(np.median(np.concatenate([np.diff(time) for time, _ in pieces])))
    multiples = np.arange(1, int(0.5 * duration / row_s))
    tested = multiples[_AROUND + 1 : len(multiples) - _AROUND - 1]
    if not len(tested):
        return None
    power = _power(pieces, multiples / duration).sum(axis=0)
    around = [one for one in range(-_AROUND - 1, _AROUND + 2) if abs(one) > 1]
    background = np.mean([power[tested - 1 + one] for one in around], axis=0)
    ratio = power[tested - 1] / background
    chances = fisher.sf(ratio, 2 * len(pieces), 2 * len(pieces) * len(around)) * len(tested)
    best = int(np.argmin(chances))
    if not chances[best] < numbers.STRICT:
        return None
    near = (tested[best] + np.linspace(-1.0, 1.0, 2 * _FINER + 1)) / duration
    shares = _power(pieces, near)
    peak = int(np.argmax(shares.sum(axis=0)))
    sizes = np.array([np.mean(left**2) for _, left in pieces])
    sines = 2.0 * shares[:, peak] / [len(left) for _, left in pieces] * sizes
    amplitude, share = math.sqrt(2.0 * sines.mean()), float(sines.sum() / sizes.sum())
    return Period(float(near[peak]), amplitude, share, float(chances[best]))


def _pieces(time: Array, left: Array, duration: float) -> Iterator[tuple[Array, Array]]:
    """Yields the pieces of a run of that `duration` in s, each without its mean and slope."""
    for start in np.arange(time[0], time[-1] - duration * (1.0 - 1e-9), duration):
        inside = (time >= start) & (time <= start + duration)
        if np.count_nonzero(inside) > 2 * _AROUND and np.ptp(left[inside]) > 0.0:
            line = np.polyval(np.polyfit(time[inside] - start, left[inside], 1), time[inside] - start)
            yield time[inside] - start, left[inside] - line


def _power(pieces: Sequence[tuple[Array, Array]], frequencies: Array) -> Array:
    """Returns (pieces, frequencies): the Lomb-Scargle power of each piece over its variance, at `frequencies` in Hz."""
    angular = 2.0 * math.pi * frequencies
    return np.array([np.asarray(lombscargle(time, left, angular)) / np.mean(left**2) for time, left in pieces])
