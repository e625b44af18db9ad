"""The error of a simulated signal: integral least squares (eq. 20) and the measures derived from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SignalError:
    """The error of one signal of one run, in the signal's SI unit `u`.

    Attributes:
        energy: integral of signal^2 dt, u^2 s. The mean is not removed; see `signal_error` for `relative`.
        ils: integral of error^2 dt, u^2 s (eq. 20).
        seconds: the time both integrals cover.
    """

    ils: float
    energy: float
    seconds: float

    @property
    def ils_normalised(self) -> float | None:
        """ILS over the signal's energy; None where the signal has none."""
        return self.ils / self.energy if self.energy > 0 else None

    @property
    def rms_error(self) -> float | None:
        return float(np.sqrt(self.ils / self.seconds)) if self.seconds > 0 else None

    @property
    def rms_signal(self) -> float | None:
        return float(np.sqrt(self.energy / self.seconds)) if self.seconds > 0 else None

    @property
    def share(self) -> float | None:
        """rms error over rms signal; None where the signal has no energy."""
        return None if self.ils_normalised is None else float(np.sqrt(self.ils_normalised))

    def to_json(self) -> dict[str, float | None]:
        return {
            "ils": self.ils,
            "ils_normalised": self.ils_normalised,
            "rms_error": self.rms_error,
            "rms_signal": self.rms_signal,
        }


def signal_error(time: Array, simulated: Array, measured: Array, *, relative: bool = False) -> SignalError:
    """Integrates the error by the trapezoidal rule on the samples' own times, which may be irregular.

    Args:
        time, simulated, measured: (n,); a NaN leaves out the two intervals beside it.
        relative: the signal's energy counts from its first known sample, for signals of arbitrary origin.
    """
    known = np.isfinite(measured) & np.isfinite(simulated)
    error = np.where(known, simulated - measured, 0.0)
    origin = measured[known][0] if relative and known.any() else 0.0
    signal = np.where(known, measured - origin, 0.0)
    step = np.diff(time) * (known[1:] & known[:-1])
    return SignalError(_integral(step, error**2), _integral(step, signal**2), float(step.sum()))


def pooled(errors: Iterable[SignalError]) -> SignalError:
    """Returns the error of several runs, or windows, taken as one."""
    listed = list(errors)
    return SignalError(sum(e.ils for e in listed), sum(e.energy for e in listed), sum(e.seconds for e in listed))


def _integral(step: Array, values: Array) -> float:
    return float(np.sum(step * (values[1:] + values[:-1])) / 2)
