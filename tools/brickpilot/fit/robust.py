"""Robust statistics of a residual: the pseudo-Huber loss, a size without outliers, noise, and correlation in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HUBER_THRESHOLD = 2.0
"""In units of the residual's scale: beyond it residuals count linearly, not as squares."""

_SIZE_THRESHOLD = 2.5  # of Huber's proposal 2, in units of the size
_SIZE_EFFICIENCY = 0.9775  # mean square of a normal residual limited to that threshold


@dataclass(frozen=True)
class RobustResidual:
    """The residual phi of which least squares make the pseudo-Huber loss, and d phi / d e. Both (n,)."""

    value: Array
    slope: Array


def pseudo_huber(scaled: Array) -> RobustResidual:
    """Returns phi of the residual e over its scale (Charbonnier 1997).

    phi^2 / 2 = h^2 (sqrt(1 + (e / h)^2) - 1), with the Huber threshold h.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # where the plant runs away the cost is infinite
        root = np.sqrt(1 + (scaled / HUBER_THRESHOLD) ** 2)
        shrink = np.sqrt(2 / (1 + root))
        return RobustResidual(scaled * shrink, 1 / (root * shrink))


def pseudo_huber_loss(scaled: Array) -> Array:
    """Returns the loss phi^2 / 2 of each residual over its scale; see `pseudo_huber`."""
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


def noise_sd(values: Array) -> float:
    """Returns the sd of white noise on a smooth signal (n,), from its third differences: robust sd over sqrt(20)."""
    if len(values) < 8:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / 20**0.5)


def correlation_time(parts: Sequence[Array], *, about_mean: bool = True) -> float:
    """Returns 1 + 2 times the sum of the autocorrelation up to its first zero, in samples (Geyer 1992, simplified).

    Each part is one run; parts are not correlated with each other.

    Args:
        about_mean: each part is taken about its own mean; else about zero, so that a constant counts as correlated.
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
