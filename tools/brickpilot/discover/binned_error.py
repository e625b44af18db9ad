"""The residual that discovery compares: means over bins of time, weighted by noise and by the model-error floor.

No model here has fast dynamics such as tyres, compliance and vibration. They would dominate a test over the full
band. Means over `BIN_S` keep what lies below about 15 Hz. The scale of a signal is its noise in a bin and, added to it
in squares, a share of the signal itself. No simulator matches a real machine better than that, so a smaller residual
names nothing, however low the noise.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset
from brickpilot.data.noise import Noise, noise_of
from brickpilot.data.signals import SUMMED
from brickpilot.discover.coarse_grid import on_coarse_grid
from brickpilot.discover.gates import BIN_S, CORRELATED_S, LEAST_NOISE_SHARE, MODEL_ERROR_SHARE
from brickpilot.discover.segment import Segment
from brickpilot.fit.blocks import Bins
from brickpilot.fit.output_error import OutputError, Scale
from brickpilot.fit.parameters import Plan
from brickpilot.fit.rates import MOTOR_RATE_OF
from brickpilot.fit.replay import Replay
from brickpilot.fit.robust import pseudo_huber_loss, robust_size
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_MOTOR_STEP_S = 0.003  # at the measured samples
_CHUNK = 24  # models that are simulated at once: their outputs take memory
_EFFECT_STEP, _NOMINAL_STEP = 1e-2, 1e-4  # steps of finite differences, in coordinates


class BinnedOutputError(OutputError):
    """Output error over bins, with fixed scales, in the coordinates of `plan.free`.

    Args:
        plan: its first parameters are the nominal ones. Their sensitivities cost most of a descent and change little
            from one candidate to the next, so they can be kept: see `keep_sensitivities`.
        coarse: simulates on a grid of a third of a bin, with the mean of the inputs over each step. That is exact
            enough for a search; what is reported is fitted at the measured samples.
        samples: the data set with only the samples that are compared; None: all of `dataset` are.
        as_measured: signals that sum up are compared as such, and not by their change.
    """

    def __init__(
        self,
        dataset: Dataset,
        plan: Plan,
        runs: Sequence[str],
        *,
        threads: int = 2,
        coarse: bool = False,
        samples: Dataset | None = None,
        as_measured: bool = False,
    ) -> None:
        self.changes = frozenset[str]() if as_measured else _compared_by_change(dataset)
        grid = on_coarse_grid(dataset) if coarse else (Replay(dataset, motor_step=_MOTOR_STEP_S), Bins(BIN_S))
        replay, bins = grid[0], dataclasses.replace(grid[1], changes=self.changes, as_measured=as_measured)
        super().__init__(replay, plan, runs, threads=threads, bins=bins, measured=samples or dataset)
        self._dataset, self._coarse, self.matched = dataset, coarse, MODEL_ERROR_SHARE
        self._noise = {signal: self._estimated_noise(signal) for signal in self.signals}
        self.sample_noise = {signal: self._sample_noise(signal) for signal in self.signals}
        self.noise_floors = {signal: self._noise_floor(signal) for signal in self.signals}
        self.scales = {signal: self._scale(signal) for signal in self.signals}
        self._kept: Array | None = None

    def with_plan(self, plan: Plan, *, threads: int | None = None) -> BinnedOutputError:
        """Returns the same data for another model, with the kept sensitivities."""
        other = copy.copy(self)
        other.plan, other._cache = plan, None
        if threads is not None:
            other._threads = threads
        return other

    def with_inputs(self, dataset: Dataset) -> BinnedOutputError:
        """Returns the same measured values, with the weights of now, simulated from the inputs of `dataset`."""
        other = copy.copy(self)
        other._replay = on_coarse_grid(dataset)[0] if self._coarse else Replay(dataset, motor_step=_MOTOR_STEP_S)
        other.scales, other.noise_floors = dict(self.scales), dict(self.noise_floors)
        other._cache = other._kept = None
        return other

    def keep_sensitivities(self, point: Array, count: int) -> None:
        """Keeps the sensitivities of the first `count` coordinates as they are at `point`; 0 drops them."""
        self._kept = self._columns(point, range(count)) if count else None

    def sensitivity(self, point: Array) -> Array:
        kept = self._kept
        if kept is None:
            return self._columns(point, range(len(point)))
        return np.hstack([kept, self._columns(point, range(kept.shape[1], len(point)))])

    def weight(self) -> Array:
        """Returns (samples,): 1 / scale."""
        return 1 / self._sizes()

    def whiten(self, simulated: Array) -> Array:
        """Returns (..., samples): measured less `simulated` (..., samples), in scales."""
        return (self.measured - simulated) * self.weight()

    def residual_of(self, model: Model) -> Array:
        """Returns (samples,): the residual of `model`, in scales."""
        return next(self.residuals_of([model]))

    def residuals_of(self, models: Sequence[Model]) -> Iterator[Array]:
        """Yields (samples,): the residual of each model, in scales; NaN where it diverges. Simulates as it goes on."""
        for first in range(0, len(models), _CHUNK):
            yield from self.whiten(self.predict(models[first : first + _CHUNK]))

    def losses(self, model: Model) -> Array:
        """Returns (samples,): what each sample adds to the cost, without priors."""
        return pseudo_huber_loss(self.residual_of(model))

    def prior_rows(self, point: Array) -> tuple[Array, Array]:
        """Returns the residual of the priors at `point`, and its (parameters, parameters) slopes."""
        return self._prior(point), self._prior_slopes(point)

    def raise_noise_floors(self, point: Array) -> None:
        """Takes what changes from bin to bin in the residual at `point` for noise: no effect here is a vibration."""
        error = self.measured - self._simulated(point)
        for signal in self.signals:
            parts = [np.diff(error[b.place], 2) for b in self.blocks if b.signal == signal and len(b.measured) > 3]
            if parts:
                sd = 1.4826 * float(np.median(np.abs(np.concatenate(parts)))) / 6**0.5
                self.noise_floors[signal] = max(self.noise_floors[signal], sd)
                self.scales[signal] = self._scale(signal)

    def weigh_by_residual(self, point: Array) -> None:
        """Takes the robust size of each signal's residual at `point` for its scale: no signal swamps another."""
        error = self.measured - self._simulated(point)
        for signal, scale in self.scales.items():
            size = robust_size(np.concatenate([error[b.place] for b in self.blocks if b.signal == signal]))
            self.scales[signal] = dataclasses.replace(scale, size=max(size, self._scale(signal).size))

    def adopt_scales(self, other: BinnedOutputError) -> None:
        """Weights each signal as `other` does."""
        self.noise_floors = {name: other.noise_floors.get(name, floor) for name, floor in self.noise_floors.items()}
        self.scales = {name: other.scales.get(name, scale) for name, scale in self.scales.items()}

    def noise_cost(self) -> float:
        """Returns the cost that white noise of the size of the noise floors would leave."""
        return (
            sum(len(b.measured) * (self.noise_floors[b.signal] / self.scales[b.signal].size) ** 2 for b in self.blocks)
            / 2
        )

    def floor_cost(self) -> float:
        """Returns the cost of a residual of one scale throughout: the model-error floor."""
        return len(self.measured) / 2

    def segments(self, model: Model, names: Sequence[str]) -> list[Segment]:
        """Returns the blocks of the residual with the outputs `names` of `model` at the middle of each bin."""
        outputs = self._replay.simulate([model], threads=self._threads)[0]
        grids = {run.name: run.time for run in self._replay.dataset.runs}
        ages = self._ages()
        return [
            Segment(
                block.run,
                block.signal,
                block.place,
                block.middle - grids[block.run][0],
                ages[block.run],
                {
                    name: np.interp(block.middle, grids[block.run], outputs[block.run][name])
                    for name in names
                    if name in outputs[block.run]
                },
            )
            for block in self.blocks
        ]

    def _ages(self) -> dict[str, float]:
        """Returns run -> s from power-on to its start."""
        ages: dict[str, float] = {}
        age = 0.0
        for run in self._dataset.runs:
            age += run.gap_s
            ages[run.name] = age
            age += float(run.time[-1] - run.time[0])
        return ages

    def stretches(self, least: int) -> tuple[NDArray[np.int64], int]:
        """Cuts the runs into stretches for a bootstrap; see `OutputError.stretches`.

        The residual of bins is correlated for about as long as a part of a manoeuvre lasts.
        """
        fitted = {block.run for block in self.blocks}
        whole = sum(float(run.time[-1] - run.time[0]) for run in self._dataset.runs if run.name in fitted)
        return self.stretches_of(min(CORRELATED_S, whole / least))

    def stretches_of(self, length_s: float) -> tuple[NDArray[np.int64], int]:
        """Returns (samples,) the number of each sample's stretch of time, the same for all signals, and their count."""
        starts = {run.name: float(run.time[0]) for run in self._dataset.runs}
        numbers = np.empty(len(self.measured), dtype=np.int64)
        first: dict[tuple[str, int], int] = {}
        for block in self.blocks:
            for place, middle in zip(range(block.place.start, block.place.stop), block.middle, strict=True):
                key = (block.run, int((middle - starts[block.run]) / length_s))
                numbers[place] = first.setdefault(key, len(first))
        return numbers, len(first)

    def _columns(self, point: Array, which: Sequence[int] | range) -> Array:
        """Returns (samples, which): finite differences of the simulated signals along some coordinates."""
        if not len(which):
            return np.empty((len(self.measured), 0))
        ends = [self._difference_ends(point, index) for index in which]
        two_sided = [low for low, _ in ends if low is not None]
        moved = self.predict([self.plan.at(end) for end in (*(high for _, high in ends), *two_sided)])
        below = iter(moved[len(ends) :])
        base = self._simulated(point)
        slopes = np.array(
            [
                (above - (base if low is None else next(below))) / (high - (point if low is None else low))[index]
                for (low, high), above, index in zip(ends, moved, which, strict=False)
            ]
        ).T
        return np.where(np.isfinite(slopes), slopes, 0.0)

    def _difference_ends(self, point: Array, index: int) -> tuple[Array | None, Array]:
        """Returns the points between which one coordinate's difference is taken; low None is `point` itself.

        The difference of an effect reaches far, because the moment a wheel crosses its backlash is only known to a
        step. It reaches to both sides, because a slope that is slightly wrong does not lead down a narrow valley.
        """
        free = self.plan.free[index]
        length = _EFFECT_STEP * free.reach if free.effect is not None else _NOMINAL_STEP
        step = np.zeros(len(point))
        step[index] = length
        low, high = free.bounds()
        if point[index] + length > high:
            return None, point - step
        if free.effect is None or point[index] - length < low:
            return None, point + step
        return point - step, point + step

    def _scale(self, signal: str) -> Scale:
        size = float(np.hypot(self.noise_floors[signal], MODEL_ERROR_SHARE * self._rms(signal)))
        return Scale(size, 1.0, self.noise_floors[signal])

    def _sample_noise(self, signal: str) -> float:
        """Returns the noise sd of a sample: as stated or as estimated, the larger one, converter's step included."""
        described = self._dataset.signals.get(signal)
        stated = described.noise_sd if described is not None and described.noise_sd else 0.0
        step = described.resolution / 12**0.5 if described is not None and described.resolution else 0.0
        return max(float(np.hypot(stated, step)), self._noise[signal].sd, LEAST_NOISE_SHARE * self._rms(signal))

    def _estimated_noise(self, signal: str) -> Noise:
        described = self._dataset.signals.get(signal)
        fitted = {block.run for block in self.blocks if block.signal == signal}
        parts = [run.outputs[signal] for run in self._dataset.runs if run.name in fitted and signal in run.outputs]
        return noise_of(parts, (described.resolution or 0.0) if described is not None else 0.0)

    def _noise_floor(self, signal: str) -> float:
        """Returns the sd of a bin's value for noise of the signal's colour."""
        per_bin = float(np.median([block.count for block in self.blocks if block.signal == signal]))
        noise = self._noise[signal]
        share = noise.mean_sd(per_bin) / noise.sd if noise.sd > 0 else per_bin**-0.5
        least = LEAST_NOISE_SHARE * self._rms(signal) * per_bin**-0.5
        changed = 2**0.5 if signal in self.changes else 1.0
        return float(max(self.sample_noise[signal] * share, least) * changed)


def _compared_by_change(dataset: Dataset) -> frozenset[str]:
    """Returns the signals that are compared by their change from bin to bin.

    These are the signals that sum up, and velocities derived from a position. A wrong force on a heavy load moves its
    velocity for seconds, and each bin would count the same error again. The change shows the force that is missing.
    """
    derived = {name for run in dataset.runs for name in run.outputs if name not in dataset.signals}
    return SUMMED | (derived & set(MOTOR_RATE_OF.values()))
