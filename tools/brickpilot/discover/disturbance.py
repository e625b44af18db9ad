"""Models what disturbs the outputs of a machine, from what a model leaves of them.

There are two: noise of a smooth spectrum, with which a fit is right in a feedback loop, too (`closed_loop`), and a
disturbance with a period of its own in time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle
from scipy.sparse import csr_array, dia_array
from scipy.stats import f as fisher

from brickpilot.discover import numbers

Array = NDArray[np.float64]

_NEIGHBOURS = 8  # frequencies on either side: 32 degrees of freedom a piece know the background to a fourth
_FINER = 20  # frequencies between two multiples, where a peak is read off


def noise_model(residuals: Sequence[Array], highest_order: int) -> Array:
    """Returns (p,): c with r[t] = c[0] r[t-1] + ... + c[p-1] r[t-p] + innovation; p = 0..`highest_order` by BIC.

    In a loop the input contains the noise of the past. Output error takes the noise of one sample for independent of
    the input, which it is not; the error of a prediction one sample ahead is, whatever the loop does, if the noise has
    the right model: fit the innovations (the direct method, Ljung 1999, sec. 13.4). Burg's
    recursion (1975), its sums taken over all runs, gives a stable model however short they are.

    Args:
        residuals: one signal's, a run each: (n,), even in time, without NaN. Their means are removed.
    """
    forward = [one - one.mean() for one in residuals if len(one) > highest_order]
    backward, samples = list(forward), sum(len(one) for one in forward)
    power = sum(float(one @ one) for one in forward) / max(samples, 1)
    found = np.empty(0)
    best, score = found, math.log(power) if power > 0.0 else -math.inf
    for order in range(1, highest_order + 1):
        ahead, behind = [one[1:] for one in forward], [one[:-1] for one in backward]
        size = sum(float(a @ a + b @ b) for a, b in zip(ahead, behind, strict=True))
        if not size > 0.0:
            break
        turned = 2.0 * sum(float(a @ b) for a, b in zip(ahead, behind, strict=True)) / size
        found = np.append(found - turned * found[::-1], turned)
        forward = [a - turned * b for a, b in zip(ahead, behind, strict=True)]
        backward = [b - turned * a for a, b in zip(ahead, behind, strict=True)]
        power *= 1.0 - turned**2
        if not power > 0.0:
            break
        if (own := math.log(power) + order * math.log(samples) / samples) < score:
            best, score = found, own
    return best


def whitening(coefficients: Array, length: int) -> csr_array:
    """Returns (n, n), lower banded: times a residual (n,) it gives innovations, all of the same variance.

    The first p samples are predicted by the lower orders of the same model (Levinson's recursion backwards), scaled to
    the variance of the later ones: exact for a stationary residual, and no row is zero.

    Args:
        coefficients: (p,), of `noise_model`; |reflection| < 1.
        length: n, samples of the run.
    """
    order = len(coefficients)
    bands = np.empty((order + 1, length))  # by lag and column
    bands[0], bands[1:] = 1.0, -np.asarray(coefficients)[:, np.newaxis]
    lower, scale = np.asarray(coefficients, dtype=np.float64), 1.0
    for row in range(order - 1, -1, -1):
        turned = lower[-1]
        lower = (lower[:-1] + turned * lower[-2::-1] if row else lower[:0]) / (1.0 - turned**2)
        scale *= math.sqrt(1.0 - turned**2)
        if row < length:
            bands[0, row] = scale
            for lag in range(1, order + 1):
                if row >= lag:
                    bands[lag, row - lag] = -scale * lower[lag - 1]
    return csr_array(dia_array((bands, -np.arange(order + 1)), shape=(length, length)))


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
    tested = multiples[_NEIGHBOURS + 1 : len(multiples) - _NEIGHBOURS - 1]
    if not len(tested):
        return None
    power = _power(pieces, multiples / duration)
    around = [one for one in range(-_NEIGHBOURS - 1, _NEIGHBOURS + 2) if abs(one) > 1]
    background = np.mean([power[tested - 1 + one] for one in around], axis=0)
    ratio = power[tested - 1] / background
    chances = fisher.sf(ratio, 2 * len(pieces), 2 * len(pieces) * len(around)) * len(tested)
    best = int(np.argmin(chances))
    if not chances[best] < numbers.STRICT:
        return None
    near = (tested[best] + np.linspace(-1.0, 1.0, 2 * _FINER + 1)) / duration
    frequency = float(near[int(np.argmax(_power(pieces, near)))])
    squares = [(2.0 * float(_power([one], np.array([frequency]))[0]), float(np.mean(one[1] ** 2))) for one in pieces]
    sine = sum(share / len(left) * size for (share, size), (_, left) in zip(squares, pieces, strict=True))
    total = sum(size for _, size in squares)
    return Period(frequency, math.sqrt(2.0 * sine / len(pieces)), sine / total, float(chances[best]))


def _pieces(time: Array, left: Array, duration: float) -> Iterator[tuple[Array, Array]]:
    """Yields the pieces of a run of that `duration` in s, each without its mean and slope."""
    for start in np.arange(time[0], time[-1] - duration * (1.0 - 1e-9), duration):
        inside = (time >= start) & (time <= start + duration)
        if np.count_nonzero(inside) > 2 * _NEIGHBOURS and np.ptp(left[inside]) > 0.0:
            line = np.polyval(np.polyfit(time[inside] - start, left[inside], 1), time[inside] - start)
            yield time[inside] - start, left[inside] - line


def _power(pieces: Sequence[tuple[Array, Array]], frequencies: Array) -> Array:
    """Returns the sum of the pieces' Lomb-Scargle power over their variance at `frequencies` in Hz."""
    power = np.zeros(len(frequencies))
    for time, left in pieces:
        power += np.asarray(lombscargle(time, left, 2.0 * math.pi * frequencies)) / np.mean(left**2)
    return power
