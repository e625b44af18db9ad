"""Statistics of a residual: the pseudo-Huber loss, a size without outliers, correlation in time, and a noise model.

Source of the noise model: Ljung (1999), System Identification, 2nd ed., ch. 13.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, dia_array

Array = NDArray[np.float64]

HUBER_THRESHOLD = 2.0
"""Residual, in units of its scale, beyond which the loss grows linearly instead of quadratically."""

_SIZE_THRESHOLD = 2.5  # threshold of Huber's proposal 2, in units of the size
_SIZE_EFFICIENCY = 0.9775  # mean square of a standard normal residual that is clipped at this threshold


@dataclass(frozen=True)
class RobustResidual:
    """The residual phi, (n,), and its slope d phi / d e, (n,). The pseudo-Huber loss is phi^2 / 2."""

    value: Array
    slope: Array


def pseudo_huber(scaled: Array) -> RobustResidual:
    """Returns phi and its slope for residuals e, (n,), in units of their scale (Charbonnier 1997).

    phi^2 / 2 = h^2 (sqrt(1 + (e / h)^2) - 1), with the Huber threshold h.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # if the plant diverges, the cost is infinite
        root = np.sqrt(1 + (scaled / HUBER_THRESHOLD) ** 2)
        shrink = np.sqrt(2 / (1 + root))
        return RobustResidual(scaled * shrink, 1 / (root * shrink))


def pseudo_huber_loss(scaled: Array) -> Array:
    """Returns (n,): the loss phi^2 / 2 of residuals in units of their scale; see `pseudo_huber`."""
    return np.asarray(HUBER_THRESHOLD**2 * (np.sqrt(1 + (scaled / HUBER_THRESHOLD) ** 2) - 1))


def robust_size(error: Array) -> float:
    """Returns the rms of `error` without its outliers (Huber's proposal 2)."""
    size = 1.4826 * float(np.median(np.abs(error)))
    if size == 0:
        return float(np.sqrt(np.mean(error**2)))
    for _ in range(30):
        limited = np.minimum(error**2, (_SIZE_THRESHOLD * size) ** 2)
        size = float(np.sqrt(np.mean(limited) / _SIZE_EFFICIENCY))
    return size


def correlation_time(parts: Sequence[Array], *, about_mean: bool = True) -> float:
    """Returns 1 + 2 times the sum of the autocorrelation up to its first zero, in samples (Geyer 1992, simplified).

    Each of `parts` is one run; different runs count as independent.

    Args:
        about_mean: whether the mean of each run is removed first. False: a constant error counts as correlated.
    """
    longest = max(len(part) for part in parts)
    total = np.zeros(longest)
    for part in parts:
        spectrum = np.fft.rfft(part - part.mean() if about_mean else part, 2 * longest)
        total += np.fft.irfft(np.abs(spectrum) ** 2)[:longest]
    if total[0] <= 0:
        return 1.0
    rho = total / total[0]
    below = np.flatnonzero(rho <= 0)
    return float(max(1.0, 1 + 2 * np.sum(rho[1 : below[0] if len(below) else longest])))


def noise_model(residuals: Sequence[Array], highest_order: int) -> Array:
    """Returns (p,): c of r[t] = c[0] r[t-1] + ... + c[p-1] r[t-p] + innovation; BIC chooses p, 0..`highest_order`.

    In a feedback loop the input depends on past noise, but a fit by output error assumes that it does not.
    With the right noise model, the innovation (the one-step prediction error) is independent of the input in any loop.
    So the innovations are fitted (the direct method, Ljung 1999, sec. 13.4). Burg's recursion (1975), with sums over
    all runs, gives a stable model even from short runs.

    Args:
        residuals: the residual of one signal in each run, (n,), evenly sampled, without NaN. Run means are removed.
    """
    forward = [part - part.mean() for part in residuals if len(part) > highest_order]
    backward, samples = list(forward), sum(len(part) for part in forward)
    power = sum(float(part @ part) for part in forward) / max(samples, 1)
    found = np.empty(0)
    best, score = found, math.log(power) if power > 0.0 else -math.inf
    for order in range(1, highest_order + 1):
        ahead, behind = [part[1:] for part in forward], [part[:-1] for part in backward]
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
    """Returns a matrix (n, n), lower banded, that turns a residual (n,) into innovations of equal variance.

    Lower orders of the model (Levinson's recursion backwards) predict the first p samples. Their innovations are scaled
    to the variance of the later innovations, which is exact for a stationary residual. So no row is left zero.

    Args:
        coefficients: (p,), from `noise_model`; every reflection coefficient lies between -1 and 1.
        length: n, samples of the run.
    """
    order = len(coefficients)
    bands = np.empty((order + 1, length))  # (lags, columns)
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
