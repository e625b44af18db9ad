"""The residual that discovery judges by: averaged over bins of time, weighed by noise and by what no model matches.

Fast dynamics that no model here has (tyres, compliance, vibration) would rule a full-band test; averages over
`BIN_S` keep what lies below some 15 Hz. A signal's scale is its noise in a bin, and beside it a share of the signal
itself: no simulator matches a real machine better, so that what is smaller names nothing, however low the noise.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from brickpilot.data.dataset import Dataset, Nominal, Run, motor_inputs
from brickpilot.fit.blocks import Bins
from brickpilot.fit.output_error import BEND, OutputError, Scale, noise_sd
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.replay import RATE_OF, SUMMED, Replay, measured_rates
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

BIN_S = 0.03
_PER_BIN = 3  # steps of the coarse grid
_MOTOR_STEP = 0.003  # s, at the measured samples
_BODY_STEP = 0.003  # s, the plant's longest
_EFFECT_STEP, _NOMINAL_STEP = 1e-2, 1e-4  # coordinates, of finite differences
_TOGETHER_S = 1.0  # s, for which residuals are taken to hang together
_MATCHED = 0.004  # of a signal's rms: the best that a model is trusted to match
_LEAST = 1e-3  # of a signal's rms: what is smooth was filtered, and its noise with it

# What a person knows of a value given without an sd, as a share of it: by ruler and scales, by a data sheet or a bench
# test, by an estimate. Three times as much is nothing out of the ordinary.
_RULER, _BENCH, _ESTIMATE, _GUESS = 0.03, 0.05, 0.1, 0.3
_KNOWN_TO = {
    "mass": _RULER,
    "half_track": _RULER,
    "wheel_radius": _RULER,
    "resistance": _BENCH,
    "torque_constant": _BENCH,
    "emf_constant": _BENCH,
    "battery_voltage": _RULER,
    "yaw_inertia": _ESTIMATE,
    "wheel_inertia": _ESTIMATE,
    "inductance": _ESTIMATE,
    "viscous_friction": _GUESS,
    "rolling_friction": _GUESS,
    "drag_area": _GUESS,
}

_STRETCH = ", stretch "
_TURNING = (
    ("wheel_angle_left", "wheel_speed_left"),
    ("wheel_angle_right", "wheel_speed_right"),
    ("angle", "speed"),
    ("position", "velocity"),
)

_REST_S = 0.5  # at the start of a run, at most, that its first state is averaged over
_MOVING_SAMPLES = 12  # that it is extrapolated from where the run starts in motion
_TREND_SD = 3.0


def loosened(dataset: Dataset) -> Dataset:
    """The data set with an sd on every nominal value that was given without: nobody knows a value exactly.

    A wrong nominal value is not an effect: all of them are fitted, each within what is usual for its kind.
    """
    nominal = {
        name: Nominal(known.value, abs(known.value) * _KNOWN_TO[name])
        if known.sd is None and known.value != 0 and name in _KNOWN_TO
        else known
        for name, known in dataset.nominal.items()
    }
    return dataclasses.replace(dataset, nominal=nominal)


def with_rates(dataset: Dataset) -> Dataset:
    """A motor's data set with the velocity of each run beside its position, which only says where the run starts.

    A position sums every error up while the run lasts; what is judged, drawn and told is the velocity.
    """
    runs = []
    for run in dataset.runs:
        outputs = dict(run.outputs)
        for summed, rate in RATE_OF.items():
            if summed in outputs and rate not in outputs:
                outputs[rate] = measured_rates(run)[rate]
            if summed in outputs:
                start = np.full_like(outputs[summed], np.nan)
                start[0] = outputs[summed][0]
                outputs[summed] = start
        runs.append(dataclasses.replace(run, outputs=outputs))
    return dataclasses.replace(dataset, runs=tuple(runs))


def settled(dataset: Dataset, inputs: Mapping[str, Array]) -> Dataset:
    """The data set with each run's first sample replaced by what its first samples say together.

    A run starts from the state that its first sample measured; the noise of one sample would be driven along as a
    motion that was not. Before the first command they are averaged; in motion a line is laid through a few.
    """
    runs = []
    for run in dataset.runs:
        outputs = dict(run.outputs)
        still = _rest_samples(run, inputs[run.name])
        for name, values in outputs.items():
            if name in SUMMED or name.startswith("accel") or not np.isfinite(values[0]):
                continue
            first = np.array(values)
            first[0] = _first(run.time, values, still)
            first.flags.writeable = False
            outputs[name] = first
        runs.append(dataclasses.replace(run, outputs=outputs))
    return dataclasses.replace(dataset, runs=tuple(runs))


def run_of(name: str) -> str:
    """The run that a stretch was cut from; a run's own name otherwise."""
    return name.rsplit(_STRETCH, 1)[0]


def windowed(dataset: Dataset, inputs: Mapping[str, Array], length_s: float) -> Dataset | None:
    """The data set cut into stretches, each a run from the measured state, wheel angles included.

    What repeats with the wheels' angle is out of step with a simulation that has come a turn off on the way; over a
    stretch it is in step. None where neither angles nor speeds of the wheels were measured.
    """
    runs = []
    for run in dataset.runs:
        angles = angles_of(run)
        if angles is None:
            return None
        count = max(1, round(float(run.time[-1] - run.time[0]) / length_s))
        edges = np.searchsorted(run.time, np.linspace(run.time[0], run.time[-1], count + 1))
        for number, (first, last) in enumerate(pairwise(edges)):
            stretch = slice(int(first), int(last) + 1)
            length = len(run.time[stretch])
            if length < 2 * _MOVING_SAMPLES:
                continue
            outputs = {name: values[stretch] for name, values in run.outputs.items() if name not in angles}
            for name, values in angles.items():
                outputs[name] = np.full(length, np.nan)
                outputs[name][0] = values[first]
            runs.append(
                dataclasses.replace(
                    run,
                    name=f"{run.name}{_STRETCH}{number + 1}",
                    time=run.time[stretch],
                    inputs={name: values[stretch] for name, values in run.inputs.items()},
                    outputs=outputs,
                    gap_s=run.gap_s if number == 0 else 0.0,
                    replicate_of=None,
                    initial={} if number else run.initial,
                )
            )
    whole = dataclasses.replace(dataset, runs=tuple(runs))
    return settled(whole, {run.name: motor_inputs(run, whole) for run in runs})


def angles_of(run: Run) -> dict[str, Array] | None:
    """Wheel angles by name, as measured or summed up from the measured speeds."""
    found = {}
    for angle, speed in _TURNING:
        if angle in run.outputs and np.isfinite(run.outputs[angle]).all():
            found[angle] = run.outputs[angle]
        elif speed in run.outputs and np.isfinite(run.outputs[speed]).all():
            found[angle] = cumulative_trapezoid(run.outputs[speed], run.time, initial=0)
    return None if len(found) == 1 and found.keys() & {"wheel_angle_left", "wheel_angle_right"} else found or None


def _rest_samples(run: Run, driven: Array) -> int:
    same = np.all((driven == driven[0]) | (np.isnan(driven) & np.isnan(driven[0])), axis=1)
    count = len(same) if same.all() else int(np.argmin(same))
    return min(count, int(np.searchsorted(run.time, run.time[0] + _REST_S)))


def _first(time: Array, values: Array, still: int) -> float:
    """The value at the first sample, from those beside it."""
    known = np.flatnonzero(np.isfinite(values[: max(still, _MOVING_SAMPLES)]))
    for count in (still, _MOVING_SAMPLES):
        chosen = known[known < count]
        if len(chosen) < 4:
            continue
        clock = time[chosen] - time[0]
        slope, at_start = np.polyfit(clock, values[chosen], 1)
        left = values[chosen] - at_start - slope * clock
        sd = float(np.std(left, ddof=2)) / max(float(np.sqrt(np.sum((clock - clock.mean()) ** 2))), 1e-300)
        if count == still and abs(slope) < _TREND_SD * sd + 1e-300:
            return float(np.mean(values[chosen]))
        if count == _MOVING_SAMPLES:
            return float(at_start)
    return float(values[0])


class Band(OutputError):  # noqa: N818  not an exception: what measured and simulated differ by
    """Output error over bins, with fixed scales, in the coordinates of `plan.free`.

    Args:
        plan: its first parameters are the nominal ones; their sensitivities may be kept (`keep`), as they change little
            from one candidate to the next and cost most of a descent.
        coarse: simulates on a grid of a third of a bin, with the mean of the inputs over each of its steps: three times
            as fast and as near as a search needs. What is reported is fitted at the measured samples.
    """

    def __init__(
        self, dataset: Dataset, plan: Plan, runs: Sequence[str], *, threads: int = 2, coarse: bool = False
    ) -> None:
        self.changes = _changes(dataset)
        replay, bins = _thinned(dataset) if coarse else (Replay(dataset, motor_step=_MOTOR_STEP), Bins(BIN_S))
        bins = dataclasses.replace(bins, changes=self.changes)
        super().__init__(replay, plan, runs, threads=threads, bins=bins, measured=dataset)
        self._dataset, self.matched = dataset, _MATCHED
        self.sample_noise = {signal: self._sample_noise(signal) for signal in self.signals}
        self.floors = {signal: self._floor(signal) for signal in self.signals}
        self.scales = {signal: self._scale(signal) for signal in self.signals}
        self._kept: Array | None = None

    def with_plan(self, plan: Plan, *, threads: int | None = None) -> Band:
        """The same data for another model; kept sensitivities go along."""
        other = copy.copy(self)
        other.plan, other._cache = plan, None
        if threads is not None:
            other._threads = threads
        return other

    def keep(self, point: Array, count: int) -> None:
        """Keeps the sensitivities of the first `count` coordinates as they are at `point`; 0: forgets them."""
        self._kept = self._columns(point, range(count)) if count else None

    def sensitivity(self, point: Array) -> Array:
        kept = self._kept
        if kept is None:
            return self._columns(point, range(len(point)))
        return np.hstack([kept, self._columns(point, range(kept.shape[1], len(point)))])

    def weight(self) -> Array:
        """(samples,): 1 / scale."""
        return 1 / self._per_sample("size")

    def whitened(self, model_values: Array) -> Array:
        """(..., samples): what is left of the measured values beside (..., samples) simulated, in scales."""
        return (self.measured - model_values) * self.weight()

    def prior_rows(self, point: Array) -> tuple[Array, Array]:
        """The priors' residual at `point`, and its (parameters, parameters) slopes."""
        steps = np.eye(len(point)) * 1e-4
        base = self._prior(point)
        return base, np.array([(self._prior(point + step) - base) / 1e-4 for step in steps]).T

    def raise_floors(self, point: Array) -> None:
        """Takes what changes from bin to bin in the residual at `point` for noise: vibration has no name here."""
        error = self.measured - self._simulated(point)
        for signal in self.signals:
            parts = [np.diff(error[b.place], 2) for b in self.blocks if b.signal == signal and len(b.measured) > 3]
            if parts:
                seen = 1.4826 * float(np.median(np.abs(np.concatenate(parts)))) / 6**0.5
                self.floors[signal] = max(self.floors[signal], seen)
                self.scales[signal] = self._scale(signal)

    def noise_cost(self) -> float:
        """Half the squares that white noise of the floors' size would leave."""
        return sum(len(b.measured) * (self.floors[b.signal] / self.scales[b.signal].size) ** 2 for b in self.blocks) / 2

    def trusted(self) -> float:
        """The cost of a residual of one scale throughout: no model is trusted to leave less."""
        return len(self.measured) / 2

    def adopt_floors(self, other: Band) -> None:
        """Weighs each signal as `other` does."""
        self.floors = {name: other.floors.get(name, floor) for name, floor in self.floors.items()}
        self.scales = {name: other.scales.get(name, scale) for name, scale in self.scales.items()}

    def left(self, model: Model) -> Array:
        """(samples,): what `model` leaves, in scales."""
        return self.whitened(self.predict([model])[0])

    def losses(self, model: Model) -> Array:
        """(samples,): what each adds to the cost, priors apart."""
        return BEND**2 * (np.sqrt(1 + (self.left(model) / BEND) ** 2) - 1)

    def courses(
        self, model: Model, names: Sequence[str]
    ) -> list[tuple[str, str, slice, Array, float, dict[str, Array]]]:
        """Of each block: run, signal, place, s since the run's start, s from power-on to it, outputs at its middles."""
        outputs = self._replay.simulate([model], threads=self._threads)[0]
        grids = {run.name: run.time for run in self._replay.dataset.runs}
        ages: dict[str, float] = {}
        age = 0.0
        for run in self._dataset.runs:
            age += run.gap_s
            ages[run.name] = age
            age += float(run.time[-1] - run.time[0])
        return [
            (
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

    def stretches(self, least: int) -> tuple[NDArray[np.int64], int]:
        """As of `OutputError`; what is left of bins may hang together for as long as a manoeuvre's parts last."""
        fitted = {block.run for block in self.blocks}
        whole = sum(float(run.time[-1] - run.time[0]) for run in self._dataset.runs if run.name in fitted)
        return self.stretches_of(min(_TOGETHER_S, whole / least))

    def stretches_of(self, length_s: float) -> tuple[NDArray[np.int64], int]:
        """(samples,) the number of the stretch of time that each belongs to, all signals alike, and how many."""
        starts = {run.name: float(run.time[0]) for run in self._dataset.runs}
        numbers = np.empty(len(self.measured), dtype=np.int64)
        first: dict[tuple[str, int], int] = {}
        for block in self.blocks:
            for place, middle in zip(range(block.place.start, block.place.stop), block.middle, strict=True):
                key = (block.run, int((middle - starts[block.run]) / length_s))
                numbers[place] = first.setdefault(key, len(first))
        return numbers, len(first)

    def _columns(self, point: Array, which: Sequence[int] | range) -> Array:
        if not len(which):
            return np.empty((len(self.measured), 0))
        ends = [self._around(point, index) for index in which]
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

    def _around(self, point: Array, index: int) -> tuple[Array | None, Array]:
        """Where one coordinate's difference is taken: (low, high), low None for `point` itself.

        An effect's reaches far, as where a wheel meets its backlash is only known to a step, and to both sides, as a
        slope that is a little off leads nowhere in a valley that hundreds of other scales wall in.
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
        size = float(np.hypot(self.floors[signal], _MATCHED * self._rms(signal)))
        return Scale(size, 1.0, self.floors[signal])

    def _sample_noise(self, signal: str) -> float:
        """sd of a sample: as stated, or seen, whichever is more; the converter's step included."""
        described = self._dataset.signals.get(signal)
        stated = described.noise_sd if described is not None and described.noise_sd else 0.0
        step = described.resolution / 12**0.5 if described is not None and described.resolution else 0.0
        fitted = {block.run for block in self.blocks if block.signal == signal}
        seen = [
            noise_sd(run.outputs[signal][np.isfinite(run.outputs[signal])])
            for run in self._dataset.runs
            if run.name in fitted and signal in run.outputs
        ]
        return max(float(np.hypot(stated, step)), float(np.median(seen)) if seen else 0.0, _LEAST * self._rms(signal))

    def _floor(self, signal: str) -> float:
        """sd of a bin's value, were the noise white."""
        per_bin = float(np.median([block.count for block in self.blocks if block.signal == signal]))
        return float(self.sample_noise[signal] / np.sqrt(per_bin) * (np.sqrt(2) if signal in self.changes else 1.0))


def _changes(dataset: Dataset) -> frozenset[str]:
    """What is judged by its change from bin to bin.

    Beside what sums up, the velocity that was derived from a position: what moves a heavy load wrongly moves its
    velocity for seconds, and each bin would say the same again. Its change shows the force that is missing.
    """
    derived = {name for run in dataset.runs for name in run.outputs if name not in dataset.signals}
    return SUMMED | (derived & set(RATE_OF.values()))


def _thinned(dataset: Dataset) -> tuple[Replay, Bins]:
    """The data set's runs on a coarse grid, and the bins that take what is simulated there to the measured averages."""
    full = Replay(dataset)
    step = BIN_S / _PER_BIN
    runs, grids, means, inputs = [], {}, {}, {}
    for run in dataset.runs:
        own = float(np.median(np.diff(run.time)))
        if own > step / 1.5:
            runs.append(run)
            inputs[run.name] = full.inputs[run.name]
            continue
        grid = np.append(np.arange(run.time[0], run.time[-1] - step / 2, step), run.time[-1])
        grids[run.name], means[run.name] = grid, min(own, _BODY_STEP)
        inputs[run.name] = _mean_inputs(run.time, full.inputs[run.name], grid)
        runs.append(dataclasses.replace(run, time=grid))
    thin = Replay(dataclasses.replace(dataset, runs=tuple(runs)), inputs=inputs, motor_step=step, body_step=step)
    return thin, Bins(BIN_S, grids, means)


def _mean_inputs(time: Array, driven: Array, grid: Array) -> Array:
    """(grid, columns): the mean of each input, which holds from sample to sample, over each step of the grid."""
    held = np.where(np.isnan(driven), 0.0, driven)
    summed = np.vstack([np.zeros(driven.shape[1]), np.cumsum(held[:-1] * np.diff(time)[:, np.newaxis], axis=0)])
    at = np.column_stack([np.interp(grid, time, column) for column in summed.T])
    means = np.vstack([np.diff(at, axis=0) / np.diff(grid)[:, np.newaxis], held[-1]])
    floats = np.isnan(driven[np.searchsorted(time, grid, side="right") - 1])
    means[floats] = np.nan
    return means


def nominal_count(free: Sequence[Free]) -> int:
    """How many of `free`, which begin with them, are nominal parameters."""
    return sum(one.effect is None for one in free)
