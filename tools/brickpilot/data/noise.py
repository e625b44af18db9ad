"""The noise of a measured signal: its size, its colour, and the sd of a mean over several samples.

Third differences of samples, computed at several distances between the samples, distinguish noise from motion. A smooth
motion contributes a variance that grows with the sixth power of the distance. White noise contributes the same variance
at every distance. At the shortest distance, differentiated noise contributes more than at longer distances, and
filtered noise contributes less. The colour also determines the noise of a mean over n samples: filtered noise falls
more slowly with n than white noise, and differentiated noise falls faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import nnls

from brickpilot.data.signals import Array

Colour = Literal["white", "differentiated", "filtered", "quantised"]

_DISTANCES = np.array([1, 2, 3, 4, 6])  # samples
_LEAST_SAMPLES = 40  # least number of samples that show a colour; in shorter runs noise counts as white
_THIRD = np.array([20.0, -30.0, 12.0, -2.0])  # weights of autocorrelations 0 to 3 in the variance of a third difference
_FILTERS = np.array([0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])  # lag-one autocorrelations that are tried
_MOST = 0.85  # a larger autocorrelation is not accepted: such smooth noise looks like motion
_CLEARLY = 0.5  # a colour is accepted if its misfit is below this share of white noise's misfit
_MULTIPLE = 0.05  # share of a step: a distance this close to a whole number of steps counts as this number
_DISTANCES_TRIED = 300  # number of the smallest distances between values from which the step is computed
_SKIPPED = 60  # largest number of steps in the smallest distance between values, because a fast counter skips values
_TEXT = 30.0  # limit on the noise's sd, in steps: if it is larger, the step is only that of the log's decimal digits
_ALL = 0.98  # a step is accepted if a larger share of the distances are whole numbers of this step
_LEAST_PIECE = 8  # least number of samples in a piece; a dropout of as many samples ends a piece
_COARSE = 0.5  # limit on the share of repeated samples: above it, the error comes from the steps and not from noise
_LAGS = 400
_SAME, _SELDOM = 1e-6, 0.05  # coarse signal: `_SELDOM` of third differences or more are within `_SAME` of their median


@dataclass(frozen=True)
class Noise:
    """The noise of one signal.

    Attributes:
        sd: sd of the noise in one sample, SI.
        colour: "differentiated": noise of a rate computed from counts or positions; "filtered": white noise after a
            first-order low-pass; "quantised": only the steps of the converter.
        correlation: lag-one autocorrelation of filtered noise; for "quantised", `exp(-1 / n)` with the mean number n
            of samples on one step.
    """

    sd: float
    colour: Colour = "white"
    correlation: float = 0.0

    def mean_sd(self, count: float) -> float:
        """Returns the noise sd of the mean of `count` consecutive samples; `count` is rounded, to at least 1."""
        whole = max(1, round(count))
        if self.colour == "differentiated":
            return self.sd / whole
        lags = np.arange(1, min(whole, _LAGS))
        correlated = 2 * float(np.sum((1 - lags / whole) * self.correlation**lags))
        return float(self.sd * np.sqrt((1 + correlated) / whole))


def noise_of(parts: Sequence[Array], step: float = 0.0) -> Noise:
    """Estimates the noise of a signal from the runs that measured it.

    Args:
        parts: the samples of each run, SI, evenly sampled with at most small jitter; NaN is a dropout.
        step: the converter's step, SI; 0: the step is not known and is estimated.
    """
    known = [piece for part in parts for piece in _without_long_holes(part) if len(piece) >= _LEAST_PIECE]
    if not known:
        return Noise(0.0)
    quantum = step or step_of(known)
    moving = [part for part in known if np.ptp(part) > 0] or known
    repeats = float(np.median([np.mean(np.diff(part) == 0) for part in moving]))
    if quantum > 0 and repeats > _COARSE:
        samples_a_step = 1 / max(1 - repeats, 1e-3)
        return Noise(quantum / 12**0.5, "quantised", float(np.exp(-1 / samples_a_step)))
    long = [part for part in moving if len(part) >= _LEAST_SAMPLES]
    white = float(np.median([_third_difference(part, 1) for part in moving])) / 20**0.5
    noise = _coloured(long, white) if long else Noise(white)
    return Noise(max(noise.sd, quantum / 12**0.5), noise.colour, noise.correlation)


def _without_long_holes(part: Array) -> list[Array]:
    """Returns the known samples, cut into pieces at long dropouts: across a dropout, motion would count as noise."""
    known = np.flatnonzero(np.isfinite(part))
    return [np.asarray(part[piece]) for piece in np.split(known, np.flatnonzero(np.diff(known) > _LEAST_PIECE) + 1)]


def step_of(parts: Sequence[Array]) -> float:
    """Returns the step of a converter or a counter, SI; 0: no step is visible.

    Nearly all differences of values are multiples of the step. A counter of a fast wheel skips most of its values, so
    the step may be a fraction of the smallest distance. If few values repeat, a step far below the noise comes from the
    number of digits in the log, and 0 is returned.

    Args:
        parts: the known samples of each run; the values of a run may have any origin.
    """
    different = [np.unique(part) for part in parts]
    apart = np.sort(np.concatenate([np.diff(values) for values in different]))
    apart = apart[apart > 1e-9 * max((float(np.abs(values).max()) for values in different if len(values)), default=0.0)]
    if len(apart) < 3:
        return float(apart[0]) if len(apart) else 0.0
    step = _common_divisor(apart[:_DISTANCES_TRIED])
    seldom = len(np.unique(np.concatenate(different))) > 0.5 * sum(len(part) for part in parts)
    noise = float(np.median([_third_difference(part, 1) for part in parts])) / 20**0.5
    return 0.0 if seldom and noise > _TEXT * step else step


def _common_divisor(apart: Array) -> float:
    """Returns the largest number that divides nearly all distances in the sorted `apart`; 0: no number does."""
    for divisor in range(1, _SKIPPED + 1):
        step = float(apart[0]) / divisor
        reach = 2.0 * divisor
        while True:  # refines the step: larger distances determine it more precisely
            multiples = np.maximum(np.round(apart / step), 1.0)
            near = multiples <= reach
            step = float(multiples[near] @ apart[near] / (multiples[near] @ multiples[near]))
            if near.all():
                break
            reach *= 2
        if np.mean(np.abs(apart / step - np.round(apart / step)) < _MULTIPLE) > _ALL:
            return step
    return 0.0


def _coloured(parts: Sequence[Array], white: float) -> Noise:
    """Returns the noise with the best fit to the third differences, or white noise if no colour is clearly better."""
    variance = np.array([np.median([_third_difference(part, k) ** 2 for part in parts]) for k in _DISTANCES])
    if variance[0] <= 0:
        return Noise(white)
    fits: dict[Noise, float] = {}
    for colour, correlation, shape in _shapes():
        columns = np.column_stack([shape, _DISTANCES.astype(float) ** 6]) / variance[:, np.newaxis]
        (size, _), misfit = nnls(columns, np.ones(len(variance)))
        fits[Noise(float(np.sqrt(size)), colour, correlation)] = float(misfit)
    plain = next(noise for noise in fits if noise.colour == "white")
    best = min(fits, key=lambda noise: fits[noise])
    clear = best.sd > 0 and fits[best] < _CLEARLY * fits[plain] and best.correlation < _MOST
    return best if clear else Noise(white)


def _shapes() -> list[tuple[Colour, float, Array]]:
    """Returns each colour with the variance of its third differences at `_DISTANCES`, for noise of unit variance."""
    shapes: list[tuple[Colour, float, Array]] = [("white", 0.0, np.full(len(_DISTANCES), _THIRD[0]))]
    correlation = np.array([1.0, -0.5])  # autocorrelation of a difference of white noise
    differences = [
        sum(weight * (correlation[k * distance] if k * distance < 2 else 0.0) for k, weight in enumerate(_THIRD))
        for distance in _DISTANCES.tolist()
    ]
    shapes.append(("differentiated", 0.0, np.array(differences)))
    for rho in _FILTERS.tolist():
        powers = rho ** (_DISTANCES[:, np.newaxis] * np.arange(4))
        shapes.append(("filtered", rho, np.asarray(powers @ _THIRD)))
    return shapes


def _third_difference(values: Array, distance: int) -> float:
    """Returns a robust sd of the third differences of samples `distance` apart."""
    end = len(values) - 3 * distance
    if end < 1:
        return 0.0
    a, b, c, d = (values[k * distance : k * distance + end] for k in range(4))
    size = np.abs(d - 3 * c + 3 * b - a)
    middle = float(np.median(size))
    if middle > 0 and np.mean(np.abs(size - middle) < _SAME * middle) < _SELDOM:
        return 1.4826 * middle
    limit = 3 * float(np.sqrt(np.mean(size**2)))  # not the median: a coarse signal's median is a whole number of steps
    return float(np.sqrt(np.mean(np.minimum(size, limit) ** 2)))
