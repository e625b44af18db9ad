"""The main result, fit %: the share of a measured signal that a model explains. Only this file defines fit %.

    fit % = 100 (1 - norm of the error / norm of the signal)

The error of a sample is the measured value minus the simulated value. Every sample has the same weight. No mean is
removed from the signal, so a model whose output is always 0 has 0 %. R2 compares the model with the signal's mean. The
rms of the error has the signal's unit u. The integral of the squared error (eq. 20 of the paper) has the unit u^2 s.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from brickpilot.data.signals import Array

_OVER_NOISE = 3.0  # limit on a signal's rms, in sds of its noise: a weaker signal counts as noise alone


@dataclass(frozen=True)
class Agreement:
    """How well one signal is simulated.

    Attributes:
        samples: number of compared samples.
        error: sum of (measured - simulated)^2 over the samples, in the squared SI unit of the signal.
        signal: sum of squares of the measured signal, in the unit of `error`.
        mean: mean of the measured signal, SI.
        spread: sum of (measured - `mean`)^2 over the samples, in the unit of `error`.
        noise_sd: sd of the measured signal's noise, SI.
    """

    samples: int
    error: float
    signal: float
    mean: float
    spread: float
    noise_sd: float = 0.0

    @property
    def fit_percent(self) -> float | None:
        """The explained share of the signal, in percent: at most 100 (perfect), without a lower limit.

        None: the signal is zero, its rms is at most 3 sd of its noise, or the error is not finite.
        """
        return self.percent_of(self.error)

    @property
    def share(self) -> float | None:
        """The norm of the error divided by that of the signal: `1 - fit_percent / 100`. None: `fit_percent` is None."""
        return None if self.fit_percent is None else round(1 - self.fit_percent / 100, 8)

    def percent_of(self, error: float) -> float | None:
        """Returns the `fit_percent` of a model whose sum of squared errors is `error`."""
        if not self._exceeds_noise(self.signal) or not math.isfinite(error / self.signal):
            return None
        return round(100 * (1 - math.sqrt(max(error / self.signal, 0.0))), 3)

    @property
    def r2(self) -> float | None:
        """R2: 1 is perfect; 0 is as good as the signal's mean. None: the signal's sd is at most 3 noise sds."""
        if not self._exceeds_noise(self.spread):
            return None
        r2 = 1 - self.error / self.spread
        return round(r2, 5) if math.isfinite(r2) else None

    @property
    def rms_error(self) -> float | None:
        """rms of the measured minus the simulated values, in the signal's SI unit; None: no sample is compared."""
        return _rms(self.error, self.samples)

    @property
    def rms_signal(self) -> float | None:
        """rms of the measured signal, in the signal's SI unit; None: no sample is compared."""
        return _rms(self.signal, self.samples)

    def to_json(self) -> dict[str, float | None]:
        return {name: getattr(self, name) for name in ("fit_percent", "r2", "rms_error", "rms_signal")}

    def _exceeds_noise(self, squares: float) -> bool:
        return squares > 0 and squares > self.samples * (_OVER_NOISE * self.noise_sd) ** 2


def agreement(error: Array, signal: Array, *, noise_sd: float = 0.0) -> Agreement:
    """Returns how well a signal is simulated.

    Args:
        error: (n,) measured minus simulated values, SI. A sample that is NaN here or in `signal` is left out.
        signal: (n,) measured values, SI; values with an arbitrary origin, such as an angle, are relative to the first
            sample of the run or window.
        noise_sd: sd of the signal's noise, SI.
    """
    known = np.isfinite(error) & np.isfinite(signal)
    values = signal[known]
    if not len(values):
        return Agreement(0, 0.0, 0.0, 0.0, 0.0, noise_sd)
    mean = float(np.mean(values))
    with np.errstate(over="ignore"):
        sums = [float(np.sum(one**2)) for one in (error[known], values, values - mean)]
    return Agreement(len(values), sums[0], sums[1], mean, sums[2], noise_sd)


def together(parts: Iterable[Agreement]) -> Agreement:
    """Returns one agreement over all samples of several runs, or of several parts of runs."""
    measured = [part for part in parts if part.samples]
    count = sum(part.samples for part in measured)
    if not count:
        return Agreement(0, 0.0, 0.0, 0.0, 0.0)
    mean = sum(part.samples * part.mean for part in measured) / count
    spread = sum(part.spread + part.samples * (part.mean - mean) ** 2 for part in measured)
    noise = max(part.noise_sd for part in measured)
    return Agreement(
        count, sum(part.error for part in measured), sum(part.signal for part in measured), mean, spread, noise
    )


def mean_fit(by_signal: Mapping[str, float | None]) -> float | None:
    """Returns the mean of the fits that are known, in percent; None: no fit is known.

    Args:
        by_signal: signal -> fit in percent. The battery's voltage does not count: it is an input of most models.
    """
    known = [fit for name, fit in by_signal.items() if fit is not None and name != "battery_voltage"]
    return round(sum(known) / len(known), 3) if known else None


def _rms(squares: float, samples: int) -> float | None:
    if not samples or not math.isfinite(squares):
        return None
    return float(f"{math.sqrt(squares / samples):.6g}")


@dataclass(frozen=True)
class SignalError:
    """The error of one signal in one run; `u` is the SI unit of the signal.

    Attributes:
        energy: integral of signal^2 dt, u^2 s. The signal's mean is not removed; see `relative` of `signal_error`.
        ils: integral of error^2 dt, u^2 s (integral least squares, eq. 20 of the paper).
        seconds: the time in s over which `ils` and `energy` are integrated.
    """

    ils: float
    energy: float
    seconds: float

    @property
    def ils_normalised(self) -> float | None:
        """The ratio of `ils` to the signal's energy; None if the energy is 0."""
        return self.ils / self.energy if self.energy > 0 else None

    @property
    def rms_error(self) -> float | None:
        return float(np.sqrt(self.ils / self.seconds)) if self.seconds > 0 else None

    @property
    def rms_signal(self) -> float | None:
        return float(np.sqrt(self.energy / self.seconds)) if self.seconds > 0 else None

    @property
    def share(self) -> float | None:
        """The ratio of rms error to rms signal; None if the energy is 0."""
        return None if self.ils_normalised is None else float(np.sqrt(self.ils_normalised))

    def to_json(self) -> dict[str, float | None]:
        return {name: getattr(self, name) for name in ("ils", "ils_normalised", "rms_error", "rms_signal")}


def signal_error(time: Array, simulated: Array, measured: Array, *, relative: bool = False) -> SignalError:
    """Integrates the error by the trapezoidal rule on the samples' own times, which may be irregular.

    Args:
        time, simulated, measured: (n,); the intervals before and after a NaN are left out.
        relative: whether `energy` is computed from the signal's change since its first known sample, for a signal of
            arbitrary origin.
    """
    known = np.isfinite(measured) & np.isfinite(simulated)
    error = np.where(known, simulated - measured, 0.0)
    origin = measured[known][0] if relative and known.any() else 0.0
    signal = np.where(known, measured - origin, 0.0)
    step = np.diff(time) * (known[1:] & known[:-1])
    return SignalError(_integral(step, error**2), _integral(step, signal**2), float(step.sum()))


def _integral(step: Array, values: Array) -> float:
    return float(np.sum(step * (values[1:] + values[:-1])) / 2)
