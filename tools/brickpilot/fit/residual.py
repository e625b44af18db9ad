"""The residual of all fit runs, measured minus simulated, with its weights. Simulations use the inputs alone.

The residual of signal s at sample k is e = (measured - simulated) / scale_s. Least squares use phi(e) / sqrt(tau_s):

- phi^2 / 2 is the pseudo-Huber loss (`robust`), so the influence of a collision or a dropout is at most the Huber
  threshold.
- scale_s is the unit of the error. For samples, it is the size of the residual, at least the noise. For bins, it is the
  noise of a bin's mean plus the least error of any simulator, a share of the signal's rms.
- tau_s is the correlation time of the residual, in samples: n samples with a slow error count as n / tau_s samples.

Runs are compared in two ways: at the measured samples, and by means over bins of time. No model here has fast dynamics,
such as tyres, compliance and vibration. Error from such dynamics would dominate a test over all frequencies, so bins
keep only frequencies below about 15 Hz. A `Residual` never changes: a change of weights makes a new `Residual`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from brickpilot.data.dataset import Dataset
from brickpilot.data.motion import MOTOR_RATE_OF, run_of
from brickpilot.data.noise import Noise, noise_of
from brickpilot.data.signals import SUMMED
from brickpilot.errors import SimulationError
from brickpilot.fit import robust
from brickpilot.fit.blocks import SAMPLES, Bins, Block, blocks, on_coarse_grid, stack
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay, by_recording

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MODEL_ERROR_SHARE = 0.004
"""Least error of any simulator of a real machine, as a share of a signal's rms: it is part of the scale of bins."""

MOTOR_STEP_S = 0.003
"""Longest motor step, s, of a simulation that is compared with bins."""

LEAST_NOISE_SHARE = 1e-3
"""Least noise sd of a sample, as a share of the signal's rms: a signal that looks smoother was filtered."""

_LEAST_KEPT, _KEPT_VALUES = 32, 2_000_000  # least number of kept simulations, and largest number of values in them
_CHUNK = 24  # largest number of models that are simulated at once, as their outputs take memory
_FIRST_SCALE = 0.2  # scale of samples before any residual is known, as a share of the signal's rms
_LEAST_RMS = 1e-30  # least rms, SI: a signal with a smaller rms counts as zero


@dataclass(frozen=True)
class Scale:
    """How one signal is weighed.

    Attributes:
        size: scale of the signal's residual, SI.
        tau: correlation time of the signal's residual, in samples or bins.
        noise: sd, SI, of the noise of a compared value (a sample, a mean or a change of means): the least `size`.
        sample_noise: sd of the noise of a single sample, SI.
    """

    size: float
    tau: float
    noise: float
    sample_noise: float


class _Memory:
    """The simulated values of the latest models. A fit often returns to a point that another stage has simulated."""

    def __init__(self) -> None:
        self._kept: dict[object, Array] = {}
        self._lock = Lock()

    def recall(self, keys: Sequence[object]) -> dict[object, Array]:
        """Returns key -> (values,), for those of `keys` whose values are still kept."""
        with self._lock:
            found = {key: self._kept.pop(key) for key in dict.fromkeys(keys) if key in self._kept}
            self._kept |= found  # moves the latest request to the end
            return found

    def keep(self, made: Mapping[object, Array]) -> None:
        """Keeps key -> (values,), and drops the least recently used values."""
        with self._lock:
            self._kept |= made
            most = max(_LEAST_KEPT, _KEPT_VALUES // max(len(next(iter(self._kept.values()))), 1))
            for key in list(self._kept)[: max(len(self._kept) - most, 0)]:
                del self._kept[key]


def _key(model: Model) -> object:
    """Returns everything that a simulation depends on."""
    tables = (model.effects, model.by_run)
    rest = tuple((name, tuple(values.items())) for table in tables for name, values in table.items())
    return model.vehicle, model.profile, tuple(model.parameters.items()), rest


@dataclass(frozen=True, eq=False)
class Residual:
    """Measured runs with a simulator, and the weight of each compared value. See the module's docstring.

    Attributes:
        replay: the simulator of the runs.
        runs: the names of the compared runs.
        blocks: the places of the compared values: a block is one signal of one run.
        measured: (values,) the compared values, SI.
        picked: (values, simulated samples) the matrix that turns a row of `Replay.stacked` into the compared values.
        scales: signal -> how it is weighed.
        rms: signal -> rms of its compared values, 1 for a signal that is zero.
        notes: a sentence for each signal that was left out.
        matched: least relative error of any simulator: a lower limit of scales and of a fitted value's sd; 0: no limit.
    """

    replay: Replay
    runs: frozenset[str]
    blocks: tuple[Block, ...]
    measured: Array
    picked: csr_array
    scales: Mapping[str, Scale]
    rms: Mapping[str, float]
    notes: tuple[str, ...]
    matched: float
    threads: int = 2
    _memory: _Memory = field(default_factory=_Memory, repr=False)

    def __post_init__(self) -> None:
        for name in ("scales", "rms"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        self.measured.flags.writeable = False

    @property
    def signals(self) -> list[str]:
        return list(self.scales)

    @property
    def sample_noise(self) -> dict[str, float]:
        """Signal -> sd of the noise of a sample, SI."""
        return {name: scale.sample_noise for name, scale in self.scales.items()}

    def on_threads(self, threads: int) -> Residual:
        """Returns the same residual, simulated on `threads` threads."""
        return dataclasses.replace(self, threads=threads)

    def predict(self, models: Sequence[Model]) -> Array:
        """Returns (models, values): the simulated values, SI; NaN where a model diverges."""
        keys = [_key(model) for model in models]
        known = self._memory.recall(keys)
        new = list({key: model for key, model in zip(keys, models, strict=True) if key not in known}.items())
        for first in range(0, len(new), _CHUNK):
            chunk = dict(new[first : first + _CHUNK])
            made = dict(zip(chunk, self._predict(list(chunk.values())), strict=True))
            self._memory.keep(made)
            known |= made
        return np.array([known[key] for key in keys])

    def _predict(self, models: Sequence[Model]) -> list[Array]:
        values = np.empty((len(models), len(self.measured)))
        try:
            for own, runs in by_recording(models, self.replay.dataset, self.runs):
                rows = self.replay.stacked(own, runs, self.signals, self.threads)
                made = np.array([self.picked @ row for row in rows])
                for block in self.blocks:
                    if block.run in runs:
                        values[:, block.place] = made[:, block.place]
        except SimulationError:
            if len(models) > 1:
                return [one for model in models for one in self._predict([model])]
            return [np.full(len(self.measured), np.nan)]
        return list(values)

    def error(self, model: Model) -> Array:
        """Returns (values,): measured less simulated, SI."""
        return np.asarray(self.measured - self.predict([model])[0])

    def scaled(self, model: Model) -> Array:
        """Returns (values,): the residual of `model`, in units of each signal's scale."""
        return self.error(model) * self.weight()

    def scaled_by(self, models: Sequence[Model]) -> Iterator[Array]:
        """Yields each model's residual, (values,), in units of each signal's scale; simulates while it is iterated."""
        for first in range(0, len(models), _CHUNK):
            yield from (self.measured - self.predict(models[first : first + _CHUNK])) * self.weight()

    def losses(self, model: Model) -> Array:
        """Returns (values,): the contribution of each value to the cost, without priors."""
        return robust.pseudo_huber_loss(self.scaled(model))

    def weight(self) -> Array:
        """Returns (values,): 1 divided by the scale of the value's signal."""
        return 1 / self.by_signal({signal: scale.size for signal, scale in self.scales.items()})

    def taus(self) -> Array:
        """Returns (values,): the correlation time of the value's signal."""
        return self.by_signal({signal: scale.tau for signal, scale in self.scales.items()})

    def by_signal(self, values: Mapping[str, float]) -> Array:
        """Returns (values,): for each compared value, the entry of its signal in `values`."""
        result = np.empty(len(self.measured))
        for block in self.blocks:
            result[block.place] = values[block.signal]
        return result

    def parts(self, values: Array, signal: str) -> list[Array]:
        """Returns the entries of `values`, (values,), that belong to a signal: one array for each run."""
        return [values[block.place] for block in self.blocks if block.signal == signal]

    def noise_cost(self) -> float:
        """Returns the cost of a residual that is white noise with the sd `Scale.noise` in each signal."""
        return sum(
            len(block.measured) * (self.scales[block.signal].noise / self.scales[block.signal].size) ** 2 / 2
            for block in self.blocks
        )

    def floor(self, signal: str) -> float:
        """Returns the least scale of a signal's residual, SI, from the noise and the least error of any simulator."""
        return float(np.hypot(self.scales[signal].noise, self.matched * self.rms[signal]))

    def weighed_by_size(self, model: Model, *, correlated: bool = False) -> Residual:
        """Returns the residual with a new scale for each signal: the robust size of its error under `model`.

        So no signal dominates. `correlated`: whether each signal's correlation time is also computed from this error.
        """
        error, scales = self.error(model), {}
        for signal, scale in self.scales.items():
            parts = self.parts(error, signal)
            size = max(robust.robust_size(np.concatenate(parts)), self.floor(signal))
            tau = (
                robust.correlation_time([robust.pseudo_huber(part / size).value for part in parts])
                if correlated
                else scale.tau
            )
            scales[signal] = dataclasses.replace(scale, size=size, tau=tau)
        return dataclasses.replace(self, scales=scales)

    def with_floors(self, noise: Mapping[str, float]) -> Residual:
        """Returns the residual with each signal's floor as its scale; `noise`: signal -> sd of a value's noise, SI."""
        noisy = {signal: dataclasses.replace(scale, noise=noise[signal]) for signal, scale in self.scales.items()}
        found = dataclasses.replace(self, scales=noisy)
        sizes = {signal: dataclasses.replace(scale, size=found.floor(signal)) for signal, scale in noisy.items()}
        return dataclasses.replace(found, scales=sizes)

    def with_raised_floors(self, model: Model) -> Residual:
        """Returns the residual. Its noise is at least `model`'s error from bin to bin: no effect models vibration."""
        error, noise = self.error(model), {signal: scale.noise for signal, scale in self.scales.items()}
        for signal in self.signals:
            changes = [np.diff(part, 2) for part in self.parts(error, signal) if len(part) > 3]
            if changes:
                sd = 1.4826 * float(np.median(np.abs(np.concatenate(changes)))) / 6**0.5
                noise[signal] = max(noise[signal], sd)
        return self.with_floors(noise)

    def weighed_like(self, other: Residual) -> Residual:
        """Returns the residual with the weights of `other` for the signals that both residuals compare."""
        scales = {name: other.scales.get(name, scale) for name, scale in self.scales.items()}
        return dataclasses.replace(self, scales=scales)

    def coloured(self, filters: Mapping[tuple[str, str], csr_array]) -> Residual:
        """Returns the innovations: each block's values after its filter. `filters`: (run, signal) -> (values, values).

        Measured and simulated values pass the same filter, so every method of `Residual` also works on innovations.
        The filter multiplies the sd of white noise by the filter's norm.
        """
        whole = csr_array(block_diag([filters[block.run, block.signal] for block in self.blocks], format="csr"))
        measured, picked = np.asarray(whole @ self.measured), csr_array(whole @ self.picked)
        gain = np.sqrt(np.asarray(whole.multiply(whole).sum(axis=1)).ravel())
        noise = {
            signal: scale.noise * float(np.median(np.concatenate(self.parts(gain, signal))))
            for signal, scale in self.scales.items()
        }
        rms = {signal: rms_of(self.parts(measured, signal)) or 1.0 for signal in self.signals}
        found = dataclasses.replace(self, measured=measured, picked=picked, rms=rms, _memory=_Memory())
        return found.with_floors(noise)

    def with_inputs(self, replay: Replay) -> Residual:
        """Returns the residual with another `replay` (other inputs, same samples); measured values and weights stay."""
        return dataclasses.replace(self, replay=replay, _memory=_Memory())

    def influence(self, model: Model) -> tuple[Array, Array]:
        """Returns the pull psi(e) / (scale tau) and the stiffness psi'(e) / (scale^2 tau) at `model`, (values,) each.

        psi is the derivative of the loss. A value's score is its pull times its sensitivity; its information is weighed
        by the stiffness. If the rms of a signal's residual is below the scale, the pull is multiplied by scale / rms:
        the scale includes a model error that the residual does not show, because the fit moved it into the parameters.
        """
        size, tau = 1 / self.weight(), self.taus()
        scaled = self.error(model) / size
        root = np.sqrt(1 + (scaled / robust.HUBER_THRESHOLD) ** 2)
        raised = self.by_signal(
            {name: 1 / min(max(rms_of(self.parts(scaled, name)), 1e-9), 1.0) for name in self.signals}
        )
        return raised * scaled / root / (size * tau), root**-3 / (size**2 * tau)

    def stretches(self, length_s: float, least: int = 1) -> tuple[Indices, int]:
        """Returns (values,) the number of the stretch of time that holds each value, and the count of stretches.

        A stretch is `length_s` s of all signals; it is shorter if the runs would give fewer than `least` stretches.
        Windows of one run are cut by the clock of this run.
        """
        starts: dict[str, float] = {}
        whole = 0.0
        for run in self.replay.dataset.runs:
            if run.name in self.runs:
                name = run_of(run.name)
                starts[name] = min(starts.get(name, np.inf), float(run.time[0]))
                whole += float(run.time[-1] - run.time[0])
        length = min(length_s, whole / least)
        numbers = np.empty(len(self.measured), dtype=np.int64)
        first: dict[tuple[str, int], int] = {}
        for block in self.blocks:
            name = run_of(block.run)
            cut, place = np.unique(
                np.floor((block.middle - starts[name]) / length).astype(np.int64), return_inverse=True
            )
            numbers[block.place] = np.array([first.setdefault((name, one), len(first)) for one in cut.tolist()])[place]
        return numbers, len(first)

    def start_errors(self, model: Model) -> Array:
        """Returns (signals, values): the change of simulated values if a run's first sample is wrong by a noise sd."""
        base = self.predict([model])[0]
        moved = []
        for signal, scale in self.scales.items():
            nudged = self.with_inputs(self.replay.nudged(signal, scale.noise))
            moved.append(nudged.predict([model])[0] - base)
        return np.array(moved)

    def rows_of(self, run: str, signal: str = "") -> NDArray[np.bool_]:
        """Returns (values,): whether a value is of `run` (a run, window or recording) and of `signal` ("": of any)."""
        rows = np.zeros(len(self.measured), dtype=np.bool_)
        recordings = {one.name: one.recording for one in self.replay.dataset.runs}
        for block in self.blocks:
            if run in (run_of(block.run), recordings[block.run]) and signal in ("", block.signal):
                rows[block.place] = True
        return rows

    def by_run(self, values: Array) -> Array:
        """Returns (runs, columns): the sums of (values, columns) over each compared run."""
        runs = list(dict.fromkeys(block.run for block in self.blocks))
        sums = np.zeros((len(runs), values.shape[1]))
        for block in self.blocks:
            sums[runs.index(block.run)] += values[block.place].sum(axis=0)
        return sums


def of_samples(
    replay: Replay, model: Model, runs: Sequence[str], *, measured: Dataset | None = None, threads: int = 2
) -> Residual:
    """Returns the residual at the measured samples. Its first scales are a fifth of each signal's rms.

    Args:
        runs: names of the runs that are compared.
        measured: the measured data; None: the data set of `replay`.

    Raises:
        InputError: the runs have no signal that the model gives.
    """
    found, notes = blocks(measured or replay.dataset, model, set(runs))
    made = _weighed(replay, SAMPLES, runs, found, notes, threads)
    scales = {
        signal: dataclasses.replace(scale, size=max(scale.noise, _FIRST_SCALE * made.rms[signal]))
        for signal, scale in made.scales.items()
    }
    return dataclasses.replace(made, scales=scales)


def of_bins(
    dataset: Dataset,
    model: Model,
    runs: Sequence[str],
    *,
    width_s: float,
    coarse: bool = False,
    samples: Dataset | None = None,
    as_measured: bool = False,
    threads: int = 2,
) -> Residual:
    """Returns the residual of means over bins of `width_s` s, each signal weighed by its floor (`Residual.floor`).

    Args:
        coarse: whether to simulate on a grid with three steps per bin, with the mean of the inputs over each step. This
            grid is exact enough for a search; reported values are fitted at the measured samples.
        samples: the data set with only the samples that are compared; None: all of `dataset`.
        as_measured: whether angles and travels are compared by value, not by their change from bin to bin.

    Raises:
        InputError: the runs have no signal that the model gives.
    """
    replay, bins = on_coarse_grid(dataset, width_s) if coarse else (Replay(dataset, MOTOR_STEP_S), Bins(width_s))
    changes = frozenset[str]() if as_measured else _compared_by_change(dataset)
    bins = dataclasses.replace(bins, changes=changes, as_measured=as_measured)
    found, notes = blocks(samples or dataset, model, set(runs), bins)
    made = _weighed(replay, bins, runs, found, notes, threads)
    return made.with_floors({signal: scale.noise for signal, scale in made.scales.items()})


def _weighed(
    replay: Replay, bins: Bins, runs: Sequence[str], found: Sequence[Block], notes: Sequence[str], threads: int
) -> Residual:
    """Returns the residual of the blocks `found`; the scale of a signal is the noise sd of its compared values."""
    scales, rms, dataset = {}, {}, replay.dataset
    for signal in dict.fromkeys(block.signal for block in found):
        own = [block for block in found if block.signal == signal]
        size = rms_of([one.measured - one.measured[0] if signal in SUMMED else one.measured for one in own])
        rms[signal] = size if size > _LEAST_RMS else 1.0
        sample, noise = _noise(dataset, own, rms[signal])
        noise *= 2**0.5 if signal in bins.changes else 1.0
        scales[signal] = Scale(noise, 1.0, noise, sample)
    picked = stack(found, *replay.layout(list(scales)))
    measured = np.concatenate([block.measured for block in found])
    matched = 0.0 if bins is SAMPLES else MODEL_ERROR_SHARE
    return Residual(
        replay, frozenset(runs), tuple(found), measured, picked, scales, rms, tuple(notes), matched, threads
    )


def _noise(dataset: Dataset, own: Sequence[Block], rms: float) -> tuple[float, float]:
    """Returns the noise sd, SI, of a sample and of a bin's mean. The mean's sd depends on the noise's correlation."""
    fitted, signal = {block.run for block in own}, own[0].signal
    described = dataset.signals.get(signal)
    stated = (described.noise_sd if described is not None else None) or 0.0
    resolution = (described.resolution if described is not None else None) or 0.0
    parts = [run.outputs[signal] for run in dataset.runs if run.name in fitted and signal in run.outputs]
    noise: Noise = noise_of(parts or [block.measured for block in own], resolution)
    sample = max(float(np.hypot(stated, resolution / 12**0.5)), noise.sd, LEAST_NOISE_SHARE * rms)
    per_bin = float(np.median([block.count for block in own]))
    share = noise.mean_sd(per_bin) / noise.sd if noise.sd > 0 else per_bin**-0.5
    return sample, max(sample * share, LEAST_NOISE_SHARE * rms * per_bin**-0.5)


def rms_of(parts: Sequence[Array]) -> float:
    """Returns the rms of all values in `parts`."""
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _compared_by_change(dataset: Dataset) -> frozenset[str]:
    """Returns the signals that are compared by their change from bin to bin.

    These are the signals that integrate a rate, and velocities derived from a position. A wrong force on a heavy load
    shifts the velocity for seconds, and each bin would count this error again. The change counts this error once.
    """
    derived = {name for run in dataset.runs for name in run.outputs if name not in dataset.signals}
    return SUMMED | (derived & set(MOTOR_RATE_OF.values()))
