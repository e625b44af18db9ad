"""Output error: measured less simulated from the inputs alone, over all fit runs together, scaled and robust.

The residual of signal s at sample k is e = (measured - simulated) / scale_s. Least squares see phi(e) / sqrt(tau_s):

- phi is the pseudo-Huber loss (`robust`), so that a collision or a dropout pulls no harder than a residual at the Huber
  threshold.
- tau_s is the correlation time of the residual in samples: n samples of a slow model error count as n / tau_s.
- scale_s is the size of the residual itself, never below the signal's noise. On measured data the model's error, not
  the noise, limits how well a signal can be matched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset
from brickpilot.data.signals import SUMMED
from brickpilot.errors import SimulationError
from brickpilot.fit.blocks import Bins, blocks, stack
from brickpilot.fit.parameters import Plan
from brickpilot.fit.replay import Replay
from brickpilot.fit.robust import HUBER_THRESHOLD, correlation_time, noise_sd, pseudo_huber, robust_size
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_STEP = 1e-4
_ANCHOR_SD = 30.0  # in coordinates: a prior so weak that it holds only what the data leave open
_FIRST_SCALE = 0.2  # of the signal's rms: the scale before any residual is known
_LEAST_RMS = 1e-30  # SI: a signal with a smaller rms counts as zero


@dataclass(frozen=True)
class Scale:
    """How one signal is weighed.

    Attributes:
        size: scale of its residual, SI.
        tau: correlation time of its residual, in samples.
        noise: sd of its noise, SI: the least that `size` can be.
    """

    size: float
    tau: float
    noise: float


class OutputError:
    """The fit's residual and Jacobian in the coordinates of `plan.free`.

    Where the plant diverges the residual is NaN. Its derivative is 0 where only the neighbouring value diverges.

    Args:
        runs: names of the fit runs.
        bins: averages over bins are compared; None: samples.
        measured: the measured data, where `replay` runs on other samples than were measured.

    Attributes:
        matched: no value is trusted more than to this share of it, however little noise there is; 0: no limit.
        holds_priors: False while the scale of the residual is not known. A prior would otherwise be held against the
            data: the gap that it leaves would count as the model's error.

    Raises:
        InputError: the fit runs hold nothing that the model gives.
    """

    def __init__(
        self,
        replay: Replay,
        plan: Plan,
        runs: Sequence[str],
        *,
        threads: int = 2,
        bins: Bins | None = None,
        measured: Dataset | None = None,
    ) -> None:
        self.plan = plan
        self._replay, self._threads = replay, threads
        self._runs = frozenset(runs)
        self.blocks, self.notes = blocks(measured or replay.dataset, plan.model, set(runs), bins)
        self.measured = np.concatenate([block.measured for block in self.blocks])
        self.signals = list(dict.fromkeys(block.signal for block in self.blocks))
        self._values = stack(self.blocks, *replay.layout(self._runs, self.signals))
        self.scales = {signal: self._first_scale(signal) for signal in self.signals}
        self.holds_priors, self.matched = True, 0.0
        self._cache: tuple[bytes, Array] | None = None

    def predict(self, models: Sequence[Model]) -> Array:
        """Returns (models, samples): the simulated values of all compared samples; NaN where a model diverges."""
        try:
            rows = self._simulate(self._replay, models)
        except SimulationError:
            if len(models) > 1:
                return np.vstack([self.predict([model]) for model in models])
            return np.full((1, len(self.measured)), np.nan)
        return np.array([self._values @ row for row in rows])

    def residual(self, point: Array) -> Array:
        """Returns (samples + parameters,): the robust residual and the prior's."""
        robust = pseudo_huber(self._scaled(point))
        return np.concatenate([robust.value / self._taus() ** 0.5, self._prior(point)])

    def jacobian(self, point: Array) -> Array:
        """Returns the derivative of `residual`, by one batch of forward differences."""
        robust = pseudo_huber(self._scaled(point))
        weight = -robust.slope / (self._sizes() * self._taus() ** 0.5)
        return np.vstack([self.sensitivity(point) * weight[:, np.newaxis], self._prior_slopes(point)])

    def sensitivity(self, point: Array) -> Array:
        """Returns (samples, parameters): the change of the simulated signals per coordinate, in their SI units."""
        steps = [self._inward(point, index) for index in range(len(point))]
        moved = self.predict([self.plan.at(point + step) for step in steps])
        sizes = np.array([step.sum() for step in steps])
        return finite(((moved - self._simulated(point)) / sizes[:, np.newaxis]).T)

    def rescale(self, point: Array) -> None:
        """Weighs each signal by the size of its residual at `point`."""
        error = self.measured - self._simulated(point)
        for signal in self.signals:
            noise = self.scales[signal].noise
            parts = [error[block.place] for block in self.blocks if block.signal == signal]
            size = max(robust_size(np.concatenate(parts)), noise)
            robust = [pseudo_huber(part / size).value for part in parts]
            self.scales[signal] = Scale(size, correlation_time(robust), noise)

    def influence(self, model: Model) -> tuple[Array, Array]:
        """Returns the pull psi(e) / (scale tau) and the stiffness psi'(e) / (scale^2 tau) at `model`, (samples,) each.

        psi is the derivative of the loss. Pull times sensitivity is a sample's score; stiffness weighs its information.
        A signal's residual counts as large as its scale at least: the part of a scale that is model error goes into the
        parameters and leaves no trace in the residual.
        """
        size, tau = self._sizes(), self._taus()
        scaled = (self.measured - self.predict([model])[0]) / size
        root = np.sqrt(1 + (scaled / HUBER_THRESHOLD) ** 2)
        rms = {
            signal: float(
                np.sqrt(np.mean(np.concatenate([scaled[b.place] for b in self.blocks if b.signal == signal]) ** 2))
            )
            for signal in self.signals
        }
        raised = self._by_signal({signal: 1 / min(max(one, 1e-9), 1.0) for signal, one in rms.items()})
        return raised * scaled / root / (size * tau), root**-3 / (size**2 * tau)

    def stretches(self, least: int) -> tuple[NDArray[np.int64], int]:
        """Cuts the runs into stretches of time, each longer than the residual's correlation time, at least `least`.

        Returns (samples,) the number of the stretch of each sample, the same for all signals, and how many there are.
        """
        rows = {block.run: len(block.known) for block in self.blocks}
        correlated = 2 * max(scale.tau for scale in self.scales.values())
        length = int(max(1, min(correlated, sum(rows.values()) / least)))
        first, numbers = {}, np.empty(len(self.measured), dtype=np.int64)
        count = 0
        for run, samples in rows.items():
            first[run], count = count, count + -(-samples // length)
        for block in self.blocks:
            numbers[block.place] = first[block.run] + np.flatnonzero(block.known) // length
        return numbers, count

    def start_errors(self, model: Model) -> Array:
        """Returns (signals, samples): the change of the simulation when a run's first sample is off by one noise sd."""
        base = self.predict([model])[0]
        moved = []
        for signal in self.signals:
            replay = self._replay.nudged(signal, self.scales[signal].noise)
            moved.append(self._values @ self._simulate(replay, [model])[0] - base)
        return np.array(moved)

    def by_run(self, values: Array) -> Array:
        """Returns (runs, columns): the sums of (samples, columns) over each fit run."""
        runs = list(dict.fromkeys(block.run for block in self.blocks))
        sums = np.zeros((len(runs), values.shape[1]))
        for block in self.blocks:
            sums[runs.index(block.run)] += values[block.place].sum(axis=0)
        return sums

    def signal_size(self) -> Array:
        """Returns (samples,): the rms of the signal that the sample belongs to."""
        return self._by_signal({signal: self._rms(signal) for signal in self.signals})

    def _simulate(self, replay: Replay, models: Sequence[Model]) -> list[Array]:
        return replay.stacked(models, only=self._runs, threads=self._threads, signals=self.signals)

    def _simulated(self, point: Array) -> Array:
        key = point.tobytes()
        if self._cache is None or self._cache[0] != key:
            self._cache = (key, self.predict([self.plan.at(point)])[0])
        return self._cache[1]

    def _scaled(self, point: Array) -> Array:
        return (self.measured - self._simulated(point)) / self._sizes()

    def _prior(self, point: Array) -> Array:
        centre = self.plan.start()
        terms = []
        for free, x, x0 in zip(self.plan.free, point, centre, strict=True):
            if self.holds_priors and free.known is not None and free.known.sd is not None:
                terms.append((free.to_value(float(x)) - free.known.value) / free.known.sd)
            else:
                terms.append((float(x) - float(x0)) / _ANCHOR_SD)
        return np.array(terms)

    def _prior_slopes(self, point: Array) -> Array:
        """Returns (parameters, parameters), column by column as the sensitivities are stored.

        Each prior depends on its own coordinate alone.
        """
        return np.diag((self._prior(point + _STEP) - self._prior(point)) / _STEP).T

    def _inward(self, point: Array, index: int) -> Array:
        """Returns a step of one coordinate that stays within its bounds."""
        high = self.plan.free[index].bounds()[1]
        step = np.zeros(len(point))
        step[index] = _STEP if point[index] + _STEP <= high else -_STEP
        return step

    def _sizes(self) -> Array:
        return self._by_signal({signal: scale.size for signal, scale in self.scales.items()})

    def _taus(self) -> Array:
        return self._by_signal({signal: scale.tau for signal, scale in self.scales.items()})

    def _by_signal(self, values: dict[str, float]) -> Array:
        result = np.empty(len(self.measured))
        for block in self.blocks:
            result[block.place] = values[block.signal]
        return result

    def _rms(self, signal: str) -> float:
        parts = [self.measured[block.place] for block in self.blocks if block.signal == signal]
        moved = [part - part[0] if signal in SUMMED else part for part in parts]
        rms = float(np.sqrt(np.mean(np.concatenate(moved) ** 2)))
        return rms if rms > _LEAST_RMS else 1.0

    def _first_scale(self, signal: str) -> Scale:
        description = self._replay.dataset.signals.get(signal)
        stated = description.noise_sd if description is not None else None
        parts = [self.measured[block.place] for block in self.blocks if block.signal == signal]
        noise = max(stated or max(noise_sd(part) for part in parts), 1e-6 * self._rms(signal))
        if description is not None and description.resolution:
            noise = max(noise, description.resolution / 12**0.5)
        return Scale(max(noise, _FIRST_SCALE * self._rms(signal)), 1.0, noise)


def finite(slopes: Array) -> Array:
    """Returns `slopes` with 0 where the plant diverged."""
    return np.where(np.isfinite(slopes), slopes, 0.0)
