"""Finds periods in the measured wheel motion (along the angle) and in a model's residual (along time).

An order is a number of periods per turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.motion import HOLE_S, wheel_angles
from brickpilot.data.signals import Array

Spectrum = NDArray[np.complex128]

_STEP = 2 * math.pi / 256  # rad
_LOWEST, _HIGHEST = 0.9, 115.0  # range of the orders that are searched; `_STEP` resolves 128
_SLOW = 0.1  # quantile of the turn per sample that gives the highest order: slow parts of runs resolve more orders
_TURNS = 1e-3  # rad per sample: a wheel that turns less counts as at rest
PADDING = 4
"""The number of points of a spectrum within one resolution (1 / span of the data)."""

_NEIGHBOURHOOD = 2.0  # orders: a peak is compared with the spectrum up to this distance
_PROMINENCE = 6.0  # least ratio of a peak's power to the median power in its neighbourhood
_PEAKS = 3  # largest number of peaks of a spectrum that are tried
_LEAST_ROWS = 3  # least number of rows from which accelerations can be computed
_SAME = 0.003  # orders that differ by less count as one order
_LONGEST = 2**15  # range of the angle, in `_STEP`: 800 rad; larger angles wrap around
_RESOLUTION = 2 * math.pi / (_STEP * _LONGEST * PADDING)


def orders(dataset: Dataset) -> tuple[float, ...]:
    """Returns the orders at which the wheels' acceleration is periodic in their angle, the strongest first.

    Three spectra are used. The first assumes one phase for all runs of a wheel. The second is like the first, but for
    effects proportional to the current, such as a motor's ripple. The third allows a different phase in each run. The
    current is estimated as the part of the voltage that the speed does not explain. No model is needed, because the
    effects have more periods per turn than the commands.
    """
    alone = np.zeros(_LONGEST * PADDING // 2 + 1)
    plain, by_current = dict[str, Spectrum](), dict[str, Spectrum]()
    for whole in dataset.runs:
        run, rows = _measured(whole)
        driven = np.nan_to_num(motor_inputs(whole, dataset))[rows]
        if len(driven) < _LEAST_ROWS:
            continue
        for wheel, (name, angle) in enumerate((wheel_angles(run) or {}).items()):
            speed = np.gradient(angle, run.time)
            gained = np.gradient(speed, run.time) * np.gradient(run.time)
            gained -= gained.mean()
            volts = driven[:, min(wheel, driven.shape[1] - 1)]
            current = volts - speed * float(volts @ speed) / max(float(speed @ speed), 1e-300)
            sums = _sums(angle, gained)
            alone += np.abs(sums) ** 2
            plain[name] = plain.get(name, 0.0) + sums
            by_current[name] = by_current.get(name, 0.0) + _sums(angle, gained * current)
    distinct: list[float] = []
    none = np.zeros_like(alone)
    coherent = [sum((np.abs(sums) ** 2 for sums in wheels.values()), none) for wheels in (plain, by_current)]
    for power in (*coherent, alone):
        distinct += [order for order in _peaks(power) if all(abs(order - other) > _SAME for other in distinct)]
    return tuple(distinct)


def _measured(run: Run) -> tuple[Run, slice]:
    """Returns the longest part of a run between long holes (such as held-out stretches), and the rows of this part.

    After a long hole the wheel's angle is no longer known.
    """
    known = np.flatnonzero(np.any([np.isfinite(values) for values in run.outputs.values()], axis=0))
    is_hole = (np.diff(run.time[known]) > HOLE_S) & (np.diff(known) > 1)
    parts = np.split(known, np.flatnonzero(is_hole) + 1)
    longest = max(parts, key=len)
    rows = slice(int(longest[0]), int(longest[-1]) + 1) if len(longest) else slice(0, 0)
    return run.rows(rows), rows


def resolved_order(dataset: Dataset) -> float | None:
    """Returns the highest order that the samples resolve; None if no wheel was measured.

    At least two samples in each period are needed. A ripple of a higher order appears at a wrong order or not at all,
    and its mean effect may look like friction or dead time.
    """
    steps = [np.abs(np.diff(angle)) for run in dataset.runs for angle in (wheel_angles(run) or {}).values()]
    turning = np.concatenate([step[step > _TURNS] for step in steps]) if steps else np.empty(0)
    return math.pi / float(np.quantile(turning, _SLOW)) if len(turning) else None


def _peaks(power: Array) -> list[float]:
    """Returns the orders at which `power` (orders,) is clearly above its neighbourhood, the strongest first."""
    order = np.asarray(np.arange(len(power)) * _RESOLUTION, dtype=np.float64)

    def stands_out(index: int) -> bool:
        away = np.abs(order - order[index])
        return bool(power[index] > _PROMINENCE * np.median(power[(away < _NEIGHBOURHOOD) & (away > 0.25)]))

    inside = np.flatnonzero((order > _LOWEST) & (order < _HIGHEST) & (power > 0.0))
    strongest = inside[np.argsort(-power[inside])][: 50 * _PEAKS]
    return separate(order, strongest, _NEIGHBOURHOOD, stands_out)


def separate(
    places: Array, indices: NDArray[np.intp], apart: float, counts: Callable[[int], bool] = lambda _: True
) -> list[float]:
    """Returns up to `_PEAKS` of `places[indices]` that `counts` accepts, each at least `apart` from the others."""
    chosen: list[float] = []
    for index in indices.tolist():
        if all(abs(places[index] - other) >= apart for other in chosen) and counts(index):
            chosen.append(float(places[index]))
        if len(chosen) == _PEAKS:
            break
    return chosen


def _sums(angle: Array, values: Array) -> Spectrum:
    """Returns (orders,): the Fourier sums over the angle of `values` (n,), which were measured at `angle` (n,), rad."""
    length = _LONGEST * PADDING
    bins = np.round(angle / _STEP).astype(np.intp) % length
    return np.asarray(np.fft.rfft(np.bincount(bins, values, length)))


_AROUND = 8  # number of background frequencies on each side of a peak; a piece's background is known to 25 %
_GRID = 32  # number of grid times in the shortest period: a sample is moved by at most 1/64 period
_FINER = 20  # number of frequencies between two multiples of 1 / duration at which a peak is evaluated


@dataclass(frozen=True)
class Period:
    """A periodic disturbance that no command causes.

    Attributes:
        frequency: Hz.
        amplitude: amplitude of the sine, in the residual's unit, rms over the pieces.
        share: the disturbance's share of the residual's power, 0..1.
        chance: p-value of a peak of at least this height at any of the tested frequencies.
    """

    frequency: float
    amplitude: float
    share: float
    chance: float

    @property
    def sentence(self) -> str:
        """Returns a sentence for the user."""
        return (
            f"a disturbance of {self.frequency:.3g} Hz that no command causes has {100 * self.share:.2g} % of the "
            f"residual's power, with an amplitude of {self.amplitude:.3g}"
        )


def own_period(residuals: Sequence[tuple[Array, Array]], level: float) -> Period | None:
    """Returns the clearest periodic disturbance, whose phase may differ between runs; None: no period is significant.

    Runs are cut into pieces as long as the median run. The Lomb-Scargle power of each piece (Scargle 1982, Astrophys.
    J. 263) is divided by the variance of the piece. The power is summed over the pieces at multiples of 1 / duration.
    The sum is compared with the mean of the sums at eight frequencies on each side. The nearest frequency on each side
    is left out, because a peak between two frequencies appears at both frequencies. On a smooth background the ratio is
    Fisher's F, with two degrees of freedom for each piece and frequency. Nine lower frequencies are needed, so a piece
    must hold at least ten periods. A lightly damped resonance gives such a peak, too, and looks like a disturbance.

    Args:
        residuals: for each run: time (n,) in s, possibly uneven, and residual (n,), NaN where unknown.
        level: significance level: a period is returned only if its `chance` is smaller.
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
    power = np.sum([_power_at_multiples(*piece, duration, len(multiples)) for piece in pieces], axis=0)
    around = [offset for offset in range(-_AROUND - 1, _AROUND + 2) if abs(offset) > 1]
    background = np.mean([power[tested - 1 + offset] for offset in around], axis=0)
    ratio = power[tested - 1] / background
    from scipy.signal import lombscargle  # slow to load, and seldom needed
    from scipy.stats import f as fisher

    chances = fisher.sf(ratio, 2 * len(pieces), 2 * len(pieces) * len(around)) * len(tested)
    best = int(np.argmin(chances))
    if not chances[best] < level:
        return None
    near = (tested[best] + np.linspace(-1.0, 1.0, 2 * _FINER + 1)) / duration
    angular = 2.0 * math.pi * near
    # (pieces, frequencies): the Lomb-Scargle power of each piece divided by the piece's variance
    shares = np.array([np.asarray(lombscargle(time, left, angular)) / np.mean(left**2) for time, left in pieces])
    peak = int(np.argmax(shares.sum(axis=0)))
    sizes = np.array([np.mean(left**2) for _, left in pieces])
    sines = 2.0 * shares[:, peak] / [len(left) for _, left in pieces] * sizes
    amplitude, share = math.sqrt(2.0 * sines.mean()), float(sines.sum() / sizes.sum())
    return Period(float(near[peak]), amplitude, share, float(chances[best]))


def _pieces(time: Array, left: Array, duration: float) -> Iterator[tuple[Array, Array]]:
    """Yields the pieces of a run with a length of `duration` s, each without its mean and slope."""
    for start in np.arange(time[0], time[-1] - duration * (1.0 - 1e-9), duration):
        inside = (time >= start) & (time <= start + duration)
        if np.count_nonzero(inside) > 2 * _AROUND and np.ptp(left[inside]) > 0.0:
            line = np.polyval(np.polyfit(time[inside] - start, left[inside], 1), time[inside] - start)
            yield time[inside] - start, left[inside] - line


def _power_at_multiples(time: Array, left: Array, duration: float, count: int) -> Array:
    """Returns (count,): Lomb-Scargle power divided by variance, at 1..`count` periods in `duration`, by two FFTs.

    Samples are moved to the nearest of evenly spaced times. Then two Fourier sums replace the sums of sines and cosines
    (Press & Rybicki 1989, Astrophys. J. 338): that of the residual, and that of the number of samples at each time. The
    second is taken at twice the frequency.
    """
    length = next_fast_len(_GRID * count, real=True)
    bins = np.round(time / duration * length).astype(np.intp) % length
    sums = np.fft.rfft(np.bincount(bins, left, length))[1 : count + 1]
    doubled = np.fft.rfft(np.bincount(bins, minlength=length))[2 : 2 * count + 1 : 2]
    samples = len(time)
    own = np.maximum(samples**2 - np.abs(doubled) ** 2, samples**2 * np.finfo(np.float64).eps)
    power = (samples * np.abs(sums) ** 2 - (sums**2 * doubled.conj()).real) / own
    return np.asarray(power / np.mean(left**2))
