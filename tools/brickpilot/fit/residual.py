"""The residual: measured less simulated from the inputs alone, over all fit runs together, with its weights.

The residual of signal s at sample k is e = (measured - simulated) / scale_s. Least squares see phi(e) / sqrt(tau_s):

- phi is the pseudo-Huber loss (`robust`), so that a collision or a dropout pulls no harder than a residual at the Huber
  threshold.
- scale_s is what one unit of error is: at samples the size of the residual itself, never below the noise; of bins the
  noise of a mean together with a share of the signal, as no simulator matches a real machine better.
- tau_s is the correlation time of the residual in samples: n samples of a slow model error count as n / tau_s.

There are two views of the same runs: samples as they were measured, and means over bins of time. No model here has fast
dynamics such as tyres, compliance and vibration. They would dominate a test over the full band; bins keep what lies
below about 15 Hz. A residual never changes: each stage that weighs it anew gets another one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from brickpilot.data.dataset import Dataset
from brickpilot.data.noise import Noise, noise_of
from brickpilot.data.signals import SUMMED
from brickpilot.errors import SimulationError
from brickpilot.fit.comparable import Bins, Block, blocks, on_coarse_grid, stack
from brickpilot.fit.parameters import Plan
from brickpilot.fit.replay import Replay
from brickpilot.fit.robust import (
    HUBER_THRESHOLD,
    correlation_time,
    noise_sd,
    pseudo_huber,
    pseudo_huber_loss,
    robust_size,
)
from brickpilot.fit.start_state import MOTOR_RATE_OF, run_of
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MODEL_ERROR_SHARE = 0.004
"""Share of a signal's rms that belongs to the scale of its bins: no simulator matches a real machine better."""

LEAST_NOISE_SHARE = 1e-3
"""The least noise of a sample, as a share of the signal's rms: a smoother signal was filtered, its noise with it."""

_MOTOR_STEP_S = 0.003  # the longest motor step of bins at the measured samples
_CHUNK = 24  # models that are simulated at once: their outputs take memory
_EFFECT_STEP, _NOMINAL_STEP = 1e-2, 1e-4  # of finite differences, in coordinates
_ANCHOR_SD = 30.0  # in coordinates: a prior so weak that it holds only what the data leave open
_COMMON_SD = 0.01  # in coordinates: what values of runs may have in common
_FIRST_SCALE = 0.2  # of the signal's rms: the scale of samples before any residual is known
_LEAST_RMS = 1e-30  # SI: a signal with a smaller rms counts as zero


@dataclass(frozen=True)
class Scale:
    """How one signal is weighed.

    Attributes:
        size: scale of its residual, SI.
        tau: correlation time of its residual, in samples or bins.
        noise: sd of the noise of a compared value, SI: the least that `size` can be.
        sample_noise: sd of the noise of a single sample, SI.
    """

    size: float
    tau: float
    noise: float
    sample_noise: float


@dataclass(frozen=True, eq=False)
class Residual:
    """Measured runs beside a simulator, and how each compared value is weighed. See the module's page.

    Attributes:
        replay: the runs, as they are simulated.
        runs: the names of those that are compared.
        blocks: one signal of one run each, in the order of the stacked values.
        measured: (values,) what is compared, SI.
        picked: (values, simulated samples) the matrix that takes a row of `Replay.stacked` to the compared values.
        scales: signal -> weights.
        rms: signal -> rms of its compared values, 1 for a signal that is zero.
        notes: a sentence for each signal that was left out.
        matched: no value of a fit is trusted more than to this share of it, however little noise there is; 0: no limit.
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
        return {name: one.sample_noise for name, one in self.scales.items()}

    def on_threads(self, threads: int) -> Residual:
        """Returns the same residual, simulated on so many threads."""
        return dataclasses.replace(self, threads=threads)

    def predict(self, models: Sequence[Model]) -> Array:
        """Returns (models, values): the simulated values, SI; NaN where a model diverges."""
        return np.vstack([self._predict(models[k : k + _CHUNK]) for k in range(0, len(models), _CHUNK)])

    def _predict(self, models: Sequence[Model]) -> Array:
        try:
            rows = self.replay.stacked(models, only=self.runs, threads=self.threads, signals=self.signals)
        except SimulationError:
            if len(models) > 1:
                return np.vstack([self._predict([model]) for model in models])
            return np.full((1, len(self.measured)), np.nan)
        return np.array([self.picked @ row for row in rows])

    def scaled(self, model: Model) -> Array:
        """Returns (values,): the residual of `model`, in scales."""
        return next(self.scaled_by([model]))

    def scaled_by(self, models: Sequence[Model]) -> Iterator[Array]:
        """Yields (values,): the residual of each model, in scales. Simulates as it goes on."""
        for first in range(0, len(models), _CHUNK):
            yield from self.whiten(self.predict(models[first : first + _CHUNK]))

    def whiten(self, simulated: Array) -> Array:
        """Returns (..., values): measured less `simulated` (..., values), in scales."""
        return (self.measured - simulated) * self.weight()

    def losses(self, model: Model) -> Array:
        """Returns (values,): what each value adds to the cost, without priors."""
        return pseudo_huber_loss(self.scaled(model))

    def weight(self) -> Array:
        """Returns (values,): 1 / scale."""
        return 1 / self.by_signal({signal: one.size for signal, one in self.scales.items()})

    def taus(self) -> Array:
        """Returns (values,): the correlation time of the value's signal."""
        return self.by_signal({signal: one.tau for signal, one in self.scales.items()})

    def signal_size(self) -> Array:
        """Returns (values,): the rms of the signal that the value belongs to."""
        return self.by_signal(self.rms)

    def by_signal(self, values: Mapping[str, float]) -> Array:
        """Returns (values,) from a number for each signal."""
        result = np.empty(len(self.measured))
        for block in self.blocks:
            result[block.place] = values[block.signal]
        return result

    def parts(self, values: Array, signal: str) -> list[Array]:
        """Returns the values of a signal, run by run, from (values,)."""
        return [values[block.place] for block in self.blocks if block.signal == signal]

    def noise_cost(self) -> float:
        """Returns the cost that white noise of the size of the noise floors would leave."""
        return sum(
            len(block.measured) * (self.scales[block.signal].noise / self.scales[block.signal].size) ** 2 / 2
            for block in self.blocks
        )

    def rescaled(self, model: Model) -> Residual:
        """Returns the residual weighed by its own size and correlation time under `model`, never below the noise."""
        error = self.measured - self.predict([model])[0]
        scales = {}
        for signal, one in self.scales.items():
            parts = self.parts(error, signal)
            size = max(robust_size(np.concatenate(parts)), one.noise)
            tau = correlation_time([pseudo_huber(part / size).value for part in parts])
            scales[signal] = dataclasses.replace(one, size=size, tau=tau)
        return dataclasses.replace(self, scales=scales)

    def weighed_by_size(self, model: Model) -> Residual:
        """Returns bins weighed by the robust size of each signal's residual under `model`: none swamps another."""
        error = self.measured - self.predict([model])[0]
        scales = {
            signal: dataclasses.replace(
                one,
                size=max(
                    robust_size(np.concatenate(self.parts(error, signal))),
                    float(np.hypot(one.noise, MODEL_ERROR_SHARE * self.rms[signal])),
                ),
            )
            for signal, one in self.scales.items()
        }
        return dataclasses.replace(self, scales=scales)

    def with_raised_floors(self, model: Model) -> Residual:
        """Returns bins that take what changes from bin to bin under `model` for noise: no effect is a vibration."""
        error, scales = self.measured - self.predict([model])[0], dict(self.scales)
        for signal, one in self.scales.items():
            changes = [np.diff(part, 2) for part in self.parts(error, signal) if len(part) > 3]
            if changes:
                sd = 1.4826 * float(np.median(np.abs(np.concatenate(changes)))) / 6**0.5
                noise = max(one.noise, sd)
                size = float(np.hypot(noise, MODEL_ERROR_SHARE * self.rms[signal]))
                scales[signal] = dataclasses.replace(one, noise=noise, size=size)
        return dataclasses.replace(self, scales=scales)

    def weighed_like(self, other: Residual) -> Residual:
        """Returns the residual with the weights of `other` for the signals that both compare."""
        scales = {name: other.scales.get(name, one) for name, one in self.scales.items()}
        return dataclasses.replace(self, scales=scales)

    def coloured(self, filters: Mapping[tuple[str, str], csr_array]) -> Residual:
        """Returns the innovations: each block behind a filter of its own, (run, signal) -> (values, values).

        Measured and simulated values pass the same filter, so all that works on a residual works on innovations. Noise
        of a signal that was white passes it too, and its sd grows by the norm of the filter.
        """
        whole = csr_array(block_diag([filters[block.run, block.signal] for block in self.blocks], format="csr"))
        measured, scales, rms = np.asarray(whole @ self.measured), {}, {}
        gain = np.sqrt(np.asarray(whole.multiply(whole).sum(axis=1)).ravel())
        for signal, one in self.scales.items():
            noise = one.noise * float(np.median(np.concatenate(self.parts(gain, signal))))
            rms[signal] = float(np.sqrt(np.mean(np.concatenate(self.parts(measured, signal)) ** 2))) or 1.0
            size = float(np.hypot(noise, MODEL_ERROR_SHARE * rms[signal]))
            scales[signal] = dataclasses.replace(one, noise=noise, size=size)
        return dataclasses.replace(
            self, measured=measured, picked=csr_array(whole @ self.picked), scales=scales, rms=rms
        )

    def with_inputs(self, replay: Replay) -> Residual:
        """Returns the same measured values and weights, simulated from the inputs of `replay`, on the same samples."""
        return dataclasses.replace(self, replay=replay)

    def influence(self, model: Model) -> tuple[Array, Array]:
        """Returns the pull psi(e) / (scale tau) and the stiffness psi'(e) / (scale^2 tau) at `model`, (values,) each.

        psi is the derivative of the loss. Pull times sensitivity is a value's score; stiffness weighs its information.
        A signal's residual counts as large as its scale at least: the part of a scale that is model error goes into the
        parameters and leaves no trace in the residual.
        """
        size, tau = 1 / self.weight(), self.taus()
        scaled = (self.measured - self.predict([model])[0]) / size
        root = np.sqrt(1 + (scaled / HUBER_THRESHOLD) ** 2)
        rms = {name: float(np.sqrt(np.mean(np.concatenate(self.parts(scaled, name)) ** 2))) for name in self.signals}
        raised = self.by_signal({signal: 1 / min(max(one, 1e-9), 1.0) for signal, one in rms.items()})
        return raised * scaled / root / (size * tau), root**-3 / (size**2 * tau)

    def stretches(self, length_s: float, least: int = 1) -> tuple[Indices, int]:
        """Cuts the runs into stretches of time of `length_s` s, or into `least` of them where that gives more.

        Windows of one run share its clock. Returns (values,) the number of each value's stretch, the same for all
        signals, and how many there are.
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
            cut = np.floor((block.middle - starts[name]) / length).astype(np.int64)
            numbers[block.place] = [first.setdefault((name, one), len(first)) for one in cut.tolist()]
        return numbers, len(first)

    def start_errors(self, model: Model) -> Array:
        """Returns (signals, values): the change of the simulation when a run's first sample is off by one noise sd."""
        base = self.predict([model])[0]
        moved = []
        for signal, one in self.scales.items():
            nudged = dataclasses.replace(self, replay=self.replay.nudged(signal, one.noise))
            moved.append(nudged.predict([model])[0] - base)
        return np.array(moved)

    def rows_of(self, run: str) -> NDArray[np.bool_]:
        """Returns (values,) whether a value is of a run, or of a window of it."""
        rows = np.zeros(len(self.measured), dtype=np.bool_)
        for block in self.blocks:
            if run_of(block.run) == run:
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
    """Returns the residual at the measured samples, each signal first weighed by a fifth of its rms.

    Args:
        runs: names of the runs that are compared.
        measured: the measured data, where `replay` runs on other samples than were measured.

    Raises:
        InputError: the runs hold nothing that the model gives.
    """
    found, notes = blocks(measured or replay.dataset, model, set(runs))
    rms = _rms_of(found)
    scales = {signal: _first_scale(replay.dataset, found, signal, one) for signal, one in rms.items()}
    return _made(replay, runs, found, scales, rms, notes, 0.0, threads)


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
    """Returns the residual of means over bins of `width_s` s, weighed by the noise of a mean and by the model's error.

    Args:
        coarse: simulates on a grid of a third of a bin, with the mean of the inputs over each step. That is exact
            enough for a search; what is reported is fitted at the measured samples.
        samples: the data set with only the samples that are compared; None: all of `dataset` are.
        as_measured: signals that sum up are compared as such, and not by their change from bin to bin.

    Raises:
        InputError: the runs hold nothing that the model gives.
    """
    changes = frozenset[str]() if as_measured else _compared_by_change(dataset)
    if coarse:
        replay, bins = on_coarse_grid(dataset, width_s)
    else:
        replay, bins = Replay(dataset, motor_step=_MOTOR_STEP_S), Bins(width_s)
    bins = dataclasses.replace(bins, changes=changes, as_measured=as_measured)
    found, notes = blocks(samples or dataset, model, set(runs), bins)
    rms = _rms_of(found)
    scales = {signal: _bin_scale(dataset, found, signal, one, changes) for signal, one in rms.items()}
    return _made(replay, runs, found, scales, rms, notes, MODEL_ERROR_SHARE, threads)


def _made(
    replay: Replay,
    runs: Sequence[str],
    found: Sequence[Block],
    scales: Mapping[str, Scale],
    rms: Mapping[str, float],
    notes: Sequence[str],
    matched: float,
    threads: int,
) -> Residual:
    picked = stack(found, *replay.layout(frozenset(runs), list(scales)))
    measured = np.concatenate([block.measured for block in found])
    return Residual(
        replay, frozenset(runs), tuple(found), measured, picked, scales, rms, tuple(notes), matched, threads
    )


def _rms_of(found: Sequence[Block]) -> dict[str, float]:
    rms = {}
    for signal in dict.fromkeys(block.signal for block in found):
        parts = [block.measured for block in found if block.signal == signal]
        moved = [part - part[0] if signal in SUMMED else part for part in parts]
        size = float(np.sqrt(np.mean(np.concatenate(moved) ** 2)))
        rms[signal] = size if size > _LEAST_RMS else 1.0
    return rms


def _first_scale(dataset: Dataset, found: Sequence[Block], signal: str, rms: float) -> Scale:
    described = dataset.signals.get(signal)
    stated = described.noise_sd if described is not None else None
    parts = [block.measured for block in found if block.signal == signal]
    noise = max(stated or max(noise_sd(part) for part in parts), 1e-6 * rms)
    if described is not None and described.resolution:
        noise = max(noise, described.resolution / 12**0.5)
    return Scale(max(noise, _FIRST_SCALE * rms), 1.0, noise, noise)


def _bin_scale(dataset: Dataset, found: Sequence[Block], signal: str, rms: float, changes: frozenset[str]) -> Scale:
    """Returns the scale of a bin's value: noise of the signal's colour, and the model-error share."""
    described = dataset.signals.get(signal)
    stated = described.noise_sd if described is not None and described.noise_sd else 0.0
    resolution = (described.resolution if described is not None else None) or 0.0
    fitted = {block.run for block in found if block.signal == signal}
    parts = [run.outputs[signal] for run in dataset.runs if run.name in fitted and signal in run.outputs]
    noise: Noise = noise_of(parts, resolution)
    sample = max(float(np.hypot(stated, resolution / 12**0.5)), noise.sd, LEAST_NOISE_SHARE * rms)
    per_bin = float(np.median([block.count for block in found if block.signal == signal]))
    share = noise.mean_sd(per_bin) / noise.sd if noise.sd > 0 else per_bin**-0.5
    changed = 2**0.5 if signal in changes else 1.0
    floor = max(sample * share, LEAST_NOISE_SHARE * rms * per_bin**-0.5) * changed
    return Scale(float(np.hypot(floor, MODEL_ERROR_SHARE * rms)), 1.0, floor, sample)


def _compared_by_change(dataset: Dataset) -> frozenset[str]:
    """Returns the signals that are compared by their change from bin to bin.

    These are the signals that sum up, and velocities derived from a position. A wrong force on a heavy load moves its
    velocity for seconds, and each bin would count the same error again. The change shows the force that is missing.
    """
    derived = {name for run in dataset.runs for name in run.outputs if name not in dataset.signals}
    return SUMMED | (derived & set(MOTOR_RATE_OF.values()))


class Problem:
    """Least squares of a residual in the coordinates of `plan.free`, priors included.

    Where the plant diverges the residual is NaN. Its derivative is 0 where only the neighbouring value diverges.

    Args:
        holds_priors: False while the scale of the residual is not known. A prior would otherwise be held against the
            data: the gap that it leaves would count as the model's error.
        kept: (values, count) sensitivities of the first coordinates, those of the nominal parameters. They cost most of
            a descent and change little from one candidate to the next.
    """

    def __init__(self, residual: Residual, plan: Plan, *, holds_priors: bool = True, kept: Array | None = None) -> None:
        self.data, self.plan = residual, plan
        self._holds_priors, self._kept = holds_priors, kept
        self._last: tuple[bytes, Array] | None = None

    def keeping(self, point: Array, count: int) -> Problem:
        """Returns the problem with the sensitivities of the first `count` coordinates kept as they are at `point`."""
        kept = self.columns(point, range(count)) if count else None
        return Problem(self.data, self.plan, holds_priors=self._holds_priors, kept=kept)

    def of(self, plan: Plan) -> Problem:
        """Returns the problem of a longer plan on one thread, with the kept sensitivities."""
        return Problem(self.data.on_threads(1), plan, holds_priors=self._holds_priors, kept=self._kept)

    def residual(self, point: Array) -> Array:
        """Returns (values + parameters,): the robust residual and the prior's."""
        robust = pseudo_huber(self.data.whiten(self.simulated(point)))
        return np.concatenate([robust.value / self.data.taus() ** 0.5, self.prior(point)])

    def jacobian(self, point: Array) -> Array:
        """Returns (values + parameters, parameters): the derivative of `residual`."""
        robust = pseudo_huber(self.data.whiten(self.simulated(point)))
        weight = -robust.slope * self.data.weight() / self.data.taus() ** 0.5
        return np.vstack([self.sensitivity(point) * weight[:, np.newaxis], self.prior_slopes(point)])

    def cost(self, point: Array) -> float:
        """Returns half the sum of squares; infinite where the plant diverges."""
        cost = float(np.sum(self.residual(point) ** 2) / 2)
        return cost if np.isfinite(cost) else float("inf")

    def simulated(self, point: Array) -> Array:
        """Returns (values,) what the model at `point` gives; the last result is remembered."""
        key = point.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = (key, self.data.predict([self.plan.at(point)])[0])
        return self._last[1]

    def sensitivity(self, point: Array) -> Array:
        """Returns (values, parameters): the change of the simulated signals per coordinate, in their SI units."""
        if self._kept is None:
            return self.columns(point, range(len(point)))
        return np.hstack([self._kept, self.columns(point, range(self._kept.shape[1], len(point)))])

    def columns(self, point: Array, which: Sequence[int] | range) -> Array:
        """Returns (values, which): finite differences of the simulated signals along some coordinates."""
        own = {index: self.plan.free[index].run for index in which if self.plan.free[index].run}
        if own:
            alone = [index for index in which if index not in own]
            return self._joined(which, self.columns(point, alone), alone, point, own)
        if not len(which):
            return np.empty((len(self.data.measured), 0))
        ends = [self._difference_ends(point, index) for index in which]
        two_sided = [low for low, _ in ends if low is not None]
        moved = self.data.predict([self.plan.at(end) for end in (*(high for _, high in ends), *two_sided)])
        below = iter(moved[len(ends) :])
        base = self.simulated(point)
        slopes = np.array(
            [
                (above - (base if low is None else next(below))) / (high - (point if low is None else low))[index]
                for (low, high), above, index in zip(ends, moved, which, strict=False)
            ]
        ).T
        return np.where(np.isfinite(slopes), slopes, 0.0)

    def _joined(
        self, which: Sequence[int] | range, columns: Array, alone: Sequence[int], point: Array, own: Mapping[int, str]
    ) -> Array:
        """Returns (values, which): `columns` of the coordinates `alone`, and those of the values that runs have.

        The value of a run touches the samples of that run alone, so one simulation with the values of all runs changed
        gives the slopes along all of one kind.
        """
        made = dict(zip(alone, columns.T, strict=True))
        kinds = {self.plan.free[index].name.partition("@")[0] for index in own}
        for kind in sorted(kinds):
            moved = np.array(point)
            here = [index for index in own if self.plan.free[index].name.startswith(f"{kind}@")]
            for index in here:
                high = self.plan.free[index].bounds()[1]
                moved[index] += _EFFECT_STEP if point[index] + _EFFECT_STEP <= high else -_EFFECT_STEP
            change = self.data.predict([self.plan.at(moved)])[0] - self.simulated(point)
            for index in here:
                slope = np.where(self.data.rows_of(own[index]), change / (moved[index] - point[index]), 0.0)
                made[index] = np.where(np.isfinite(slope), slope, 0.0)
        return np.array([made[index] for index in which]).T

    def prior(self, point: Array) -> Array:
        """Returns (parameters + kinds,): how far each parameter is from what is known of it, in sd.

        Values of one kind that runs have of their own lie about 0: what they have in common belongs to the model, and a
        held-out run has that alone.
        """
        centre = self.plan.start()
        terms = []
        for free, x, x0 in zip(self.plan.free, point, centre, strict=True):
            away = free.away(float(x)) if self._holds_priors else None
            terms.append((float(x) - float(x0)) / _ANCHOR_SD if away is None else away)
        common = [float(np.mean(point[here])) / _COMMON_SD for here in self._centred()]
        return np.array([*terms, *common])

    def prior_slopes(self, point: Array) -> Array:
        """Returns (parameters + kinds, parameters), column by column as the sensitivities are stored."""
        count, centred = len(point), self._centred()
        own = np.diag(((self.prior(point + _NOMINAL_STEP) - self.prior(point)) / _NOMINAL_STEP)[:count])
        rows = np.zeros((len(centred), count))
        for row, here in zip(rows, centred, strict=True):
            row[here] = 1 / (len(here) * _COMMON_SD)
        return np.asfortranarray(np.vstack([own, rows]))

    def _centred(self) -> list[list[int]]:
        """Returns the coordinates of each kind of values of runs that lie about 0."""
        kinds: dict[str, list[int]] = {}
        for index, free in enumerate(self.plan.free):
            if free.run and free.signed:
                kinds.setdefault(free.name.partition("@")[0], []).append(index)
        return list(kinds.values())

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


class Projection:
    """Removes from a whitened residual what the parameters of a problem can take up, from `point`: linear, with priors.

    Source: score test, Rao 1948.
    """

    def __init__(self, problem: Problem, point: Array) -> None:
        whitened = problem.sensitivity(point) * problem.data.weight()[:, np.newaxis]
        self._prior = -problem.prior(point)
        self._basis, _ = np.linalg.qr(np.vstack([whitened, problem.prior_slopes(point)]))

    def remainder(self, residual: Array) -> Array:
        """Returns (values + parameters,) from (values,). The rows of the priors come last."""
        return self._project(np.concatenate([residual, self._prior]))

    def signatures(self, changes: Sequence[Array] | Array) -> Array:
        """Returns (values + parameters, changes) from changes of the simulated signals, (values,) each, in scales."""
        return np.array([self._project(np.append(one, np.zeros(len(self._prior)))) for one in changes]).T

    def _project(self, rows: Array) -> Array:
        rest: Array = rows - self._basis @ (self._basis.T @ rows)
        return rest
