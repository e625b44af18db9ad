"""Output error: measured minus simulated from the inputs alone, over all fitted runs together, whitened and robust.

The residual of signal s in sample k is e = (measured - simulated) / scale_s, of which least squares sees
phi(e) / sqrt(tau_s). phi is the pseudo-Huber loss (Charbonnier 1997), so that a collision or a dropout pulls no
harder than `BEND` scales' worth. tau_s is the residual's correlation time in samples, so that n samples of a slow
model error count as the n / tau_s they are worth. scale_s is the residual's own size, never below the signal's noise:
on measured data it is the model's error, not the noise, that says how well a signal can be matched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset
from brickpilot.errors import SimulationError
from brickpilot.fit.blocks import Bins, blocks
from brickpilot.fit.parameters import Plan
from brickpilot.fit.replay import SUMMED, Outputs, Replay
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

BEND = 2.0
"""Scales: where the loss turns from squared to linear."""

_STEP = 1e-4
_ANCHOR_SD = 30.0  # in coordinates: keeps what the data leave open from wandering, and outweighs nothing they say
_FIRST_SCALE = 0.2  # of the signal's rms: before any residual is known
_NOTHING = 1e-30  # SI: a signal whose rms is less is taken for zero


@dataclass(frozen=True)
class Scale:
    """How one signal is weighed: `size` in its SI unit, `tau` in samples, `noise` the floor of `size`."""

    size: float
    tau: float
    noise: float


class OutputError:
    """The fit's residual and Jacobian in the coordinates of `plan.free`.

    Args:
        runs: names of the runs that are fitted.
        bins: averages are compared; None: samples.
        measured: what is compared with, where `replay` runs on other samples than were measured.

    Where the plant diverges the residual is NaN, and its derivative 0 where only the neighbouring value does.

    Raises:
        InputError: the fitted runs hold nothing that the model gives.

    `matched`: share of a value below which a model is not trusted to be right, however little noise there is.

    `holds_priors`: False while the size of the residual is not known. A prior would else be kept by taking the gap it
    leaves for the model's error.
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
        self.scales = {signal: self._first_scale(signal) for signal in self.signals}
        self.holds_priors, self.matched = True, 0.0
        self._cache: tuple[bytes, Array] | None = None

    def predict(self, models: Sequence[Model]) -> Array:
        """(models, samples): what each model gives where something was measured; NaN where it diverges in any run."""
        try:
            outputs = self._simulate(self._replay, models)
        except SimulationError:
            if len(models) > 1:
                return np.vstack([self.predict([model]) for model in models])
            return np.full((1, len(self.measured)), np.nan)
        return np.array([np.concatenate([b.pick(one[b.run][b.signal]) for b in self.blocks]) for one in outputs])

    def residual(self, point: Array) -> Array:
        bent, _ = _bend(self._whitened(point))
        return np.concatenate([bent / self._per_sample("tau") ** 0.5, self._prior(point)])

    def jacobian(self, point: Array) -> Array:
        """Of `residual`: one batch of forward differences."""
        _, slope = _bend(self._whitened(point))
        weight = -slope / (self._per_sample("size") * self._per_sample("tau") ** 0.5)
        steps = np.eye(len(point)) * _STEP
        prior = np.array([(self._prior(point + step) - self._prior(point)) / _STEP for step in steps])
        return np.vstack([self.sensitivity(point) * weight[:, np.newaxis], prior.T.reshape(-1, len(point))])

    def sensitivity(self, point: Array) -> Array:
        """(samples, parameters): change of the simulated signals per coordinate, in their SI units."""
        steps = [self._inward(point, index) for index in range(len(point))]
        moved = self.predict([self.plan.at(point + step) for step in steps])
        sizes = np.array([step.sum() for step in steps])
        return finite(((moved - self._simulated(point)) / sizes[:, np.newaxis]).T)

    def rescale(self, point: Array) -> None:
        """Weighs each signal by what is left of it at `point`."""
        error = self.measured - self._simulated(point)
        for signal in self.signals:
            noise = self.scales[signal].noise
            parts = [error[block.place] for block in self.blocks if block.signal == signal]
            size = max(_robust_size(np.concatenate(parts)), noise)
            bent = [_bend(part / size)[0] for part in parts]
            self.scales[signal] = Scale(size, correlation_time(bent), noise)

    def influence(self, model: Model) -> tuple[Array, Array]:
        """(samples,) each, at `model`: pull, psi(e) / (scale tau), and stiffness, psi'(e) / (scale^2 tau).

        psi is the loss's derivative. Pull times sensitivity is a sample's score; stiffness weighs its information.
        """
        size, tau = self._per_sample("size"), self._per_sample("tau")
        whitened = (self.measured - self.predict([model])[0]) / size
        root = np.sqrt(1 + (whitened / BEND) ** 2)
        return whitened / root / (size * tau), root**-3 / (size**2 * tau)

    def stretches(self, least: int) -> tuple[NDArray[np.int64], int]:
        """Cuts the runs into stretches of time longer than the residual remembers, but at least `least` of them.

        Returns (samples,) the number of the stretch of each sample, the same for all signals, and how many there are.
        """
        rows = {block.run: len(block.known) for block in self.blocks}
        remembered = 2 * max(scale.tau for scale in self.scales.values())
        length = int(max(1, min(remembered, sum(rows.values()) / least)))
        first, numbers = {}, np.empty(len(self.measured), dtype=np.int64)
        count = 0
        for run, samples in rows.items():
            first[run], count = count, count + -(-samples // length)
        for block in self.blocks:
            numbers[block.place] = first[block.run] + np.flatnonzero(block.known) // length
        return numbers, count

    def start_errors(self, model: Model) -> Array:
        """(signals, samples): what one noise sd in the sample a run starts from does to what is simulated."""
        base = self.predict([model])[0]
        moved = []
        for signal in self.signals:
            replay = self._replay.nudged(signal, self.scales[signal].noise)
            outputs = self._simulate(replay, [model])[0]
            moved.append(np.concatenate([b.pick(outputs[b.run][b.signal]) for b in self.blocks]) - base)
        return np.array(moved)

    def by_run(self, values: Array) -> Array:
        """(runs, columns): sums of (samples, columns) over each fitted run."""
        runs = list(dict.fromkeys(block.run for block in self.blocks))
        sums = np.zeros((len(runs), values.shape[1]))
        for block in self.blocks:
            sums[runs.index(block.run)] += values[block.place].sum(axis=0)
        return sums

    def signal_size(self) -> Array:
        """(samples,): rms of the signal that the sample belongs to."""
        return self._by_signal({signal: self._rms(signal) for signal in self.signals})

    def _simulate(self, replay: Replay, models: Sequence[Model]) -> list[dict[str, Outputs]]:
        return replay.simulate(models, only=self._runs, threads=self._threads, signals=self.signals)

    def _simulated(self, point: Array) -> Array:
        key = point.tobytes()
        if self._cache is None or self._cache[0] != key:
            self._cache = (key, self.predict([self.plan.at(point)])[0])
        return self._cache[1]

    def _whitened(self, point: Array) -> Array:
        return (self.measured - self._simulated(point)) / self._per_sample("size")

    def _prior(self, point: Array) -> Array:
        centre = self.plan.start()
        terms = []
        for free, x, x0 in zip(self.plan.free, point, centre, strict=True):
            if self.holds_priors and free.known is not None and free.known.sd is not None:
                terms.append((free.to_value(float(x)) - free.known.value) / free.known.sd)
            else:
                terms.append((float(x) - float(x0)) / _ANCHOR_SD)
        return np.array(terms)

    def _inward(self, point: Array, index: int) -> Array:
        """A step of one coordinate, towards the inside of its bounds."""
        high = self.plan.free[index].bounds()[1]
        step = np.zeros(len(point))
        step[index] = _STEP if point[index] + _STEP <= high else -_STEP
        return step

    def _per_sample(self, what: str) -> Array:
        return self._by_signal({signal: getattr(scale, what) for signal, scale in self.scales.items()})

    def _by_signal(self, values: dict[str, float]) -> Array:
        result = np.empty(len(self.measured))
        for block in self.blocks:
            result[block.place] = values[block.signal]
        return result

    def _rms(self, signal: str) -> float:
        parts = [self.measured[block.place] for block in self.blocks if block.signal == signal]
        moved = [part - part[0] if signal in SUMMED else part for part in parts]
        rms = float(np.sqrt(np.mean(np.concatenate(moved) ** 2)))
        return rms if rms > _NOTHING else 1.0

    def _first_scale(self, signal: str) -> Scale:
        description = self._replay.dataset.signals.get(signal)
        stated = description.noise_sd if description is not None else None
        parts = [self.measured[block.place] for block in self.blocks if block.signal == signal]
        noise = max(stated or max(noise_sd(part) for part in parts), 1e-6 * self._rms(signal))
        if description is not None and description.resolution:
            noise = max(noise, description.resolution / 12**0.5)
        return Scale(max(noise, _FIRST_SCALE * self._rms(signal)), 1.0, noise)


def finite(slopes: Array) -> Array:
    """`slopes` with 0 where the plant diverged."""
    return np.where(np.isfinite(slopes), slopes, 0.0)


def noise_sd(values: Array) -> float:
    """White noise on a smooth signal, from its third differences: robust sd over sqrt(20). `values` (n,), any unit."""
    if len(values) < 8:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / 20**0.5)


def correlation_time(parts: Sequence[Array]) -> float:
    """1 + 2 times the sum of the autocorrelation up to its first zero (Geyer 1992, simplified), in samples.

    Each part, a run, is taken about its own mean, and parts are uncorrelated with each other.
    """
    longest = max(len(part) for part in parts)
    total = np.zeros(longest)
    for part in parts:
        spectrum = np.fft.rfft(part - part.mean(), 2 * longest)
        total += np.fft.irfft(np.abs(spectrum) ** 2)[:longest]
    if total[0] <= 0:
        return 1.0
    rho = total / total[0]
    below = np.flatnonzero(rho <= 0)
    return float(max(1.0, 1 + 2 * np.sum(rho[1 : below[0] if len(below) else longest])))


def _bend(whitened: Array) -> tuple[Array, Array]:
    """Pseudo-Huber: (phi, d phi / d whitened), with phi^2 / 2 = bend^2 (sqrt(1 + (e / bend)^2) - 1)."""
    root = np.sqrt(1 + (whitened / BEND) ** 2)
    shrink = np.sqrt(2 / (1 + root))
    return whitened * shrink, 1 / (root * shrink)


def _robust_size(error: Array) -> float:
    """Huber's proposal 2 with a bend of 2.5: the rms of what is not an outlier."""
    size = 1.4826 * float(np.median(np.abs(error)))
    if size == 0:
        return float(np.sqrt(np.mean(error**2)))
    for _ in range(30):
        size = float(np.sqrt(np.mean(np.minimum(error**2, (2.5 * size) ** 2)) / 0.9775))
    return size
