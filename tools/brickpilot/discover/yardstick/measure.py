"""Holds a model to the yardstick: fit in percent before, after and attainable, and what of the error is predictable."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from brickpilot.data.agreement import Agreement
from brickpilot.data.signals import SUMMED
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.yardstick import black_box
from brickpilot.discover.yardstick.black_box import Error, Problem, Summed
from brickpilot.discover.yardstick.features import features
from brickpilot.discover.yardstick.record import Fit, Numbers, Predictable, SignalFit, Source, Yardstick, percent, share
from brickpilot.discover.yardstick.repeatability import half_difference, repeats
from brickpilot.discover.yardstick.rows import Rows, rows
from brickpilot.fit.headline import Headline, headline_of
from brickpilot.fit.horizons import Course, Track, deviation, simulate, track
from brickpilot.fit.replay import Outputs
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOVES_NOISE_SD = 3.0  # a signal whose rms is smaller, in sd of its noise, hardly moves: its fit says nothing
_BLOCKS = 8  # of time, where there is one fit run alone
_DRAWN_S, _DRAWS = 1.0, 200  # stretches of a bootstrap (Efron & Tibshirani 1993, ch. 8)
_LEAST_SHARE = 0.02  # of the error: less that is predictable counts as nothing
_LEAST_SOURCE = 0.05  # of the predictable error: a group that accounts for less is not listed


@dataclass(frozen=True)
class Left:
    """What the nominal model leaves of one signal at one horizon. All but `repeatability` are (rows,).

    Attributes:
        count: compared samples.
        before: sum of squared errors of the nominal model.
        unseen: the same with the error added that the black box predicts without having seen the run.
        shuffled: group -> `unseen` with the group shuffled.
        spread: role -> sum of squares of the measured signal about its mean; absent where the signal hardly moves.
        size: role -> the same about zero, of all signals.
    """

    count: Array
    before: Array
    unseen: Array
    shuffled: Mapping[str, Array]
    spread: Mapping[str, float]
    size: Mapping[str, float]
    repeatability: float | None


@dataclass(frozen=True)
class Reference:
    """The nominal model on the yardstick, with what a black box makes of its error: all that needs no other model.

    Attributes:
        left: horizon -> signal -> what the nominal model leaves.
        is_fit: (rows,) whether the row is fitted; the others are held out.
        plain: the runs that the headline numbers are of; `track` unless runs got values of their own.
        headline: of the nominal model.
    """

    prepared: Prepared
    track: Track
    plain: Track
    headline: Headline
    rows: Rows
    is_fit: Mask
    left: Mapping[str, Mapping[str, Left]]
    notes: tuple[str, ...]


def reference(prepared: Prepared, nominal: Model) -> Reference:
    """Returns how well the calibrated nominal model fits, and how much better a black box does on unseen runs."""
    compared, plain = track(prepared.measured, prepared.dataset, nominal), prepared.plain
    same = plain.measured is prepared.measured and plain.started is prepared.dataset
    other = compared if same else track(plain.measured, plain.started, nominal)
    thinned = rows(compared)
    is_fit = _is_fit(prepared, compared, thinned)
    simulated = {name: one[0] for name, one in simulate(compared, [nominal], jobs=prepared.jobs).items()}
    folds, note = _folds(thinned, is_fit)

    def left_of(course: Course) -> dict[str, Left]:
        told = features(compared, course, thinned, simulated["free_run"], simulated[course.horizon])
        problem = Problem(told.columns, told.groups, folds, prepared.seed)
        with threadpool_limits(1):  # trees of this size are slower on several threads
            return _left(prepared, compared, thinned, course, simulated[course.horizon], problem, is_fit)

    courses = [course for course in compared.courses if course.horizon in simulated]
    black_box.load()  # limits of threads hold for libraries that are loaded
    with ThreadPoolExecutor(prepared.jobs) as pool:
        left = dict(zip([course.horizon for course in courses], pool.map(left_of, courses), strict=True))
    numbers = _headline(prepared, compared, other, nominal, simulated)
    return Reference(prepared, compared, other, numbers, thinned, is_fit, left, (*compared.notes, *note))


def _headline(
    prepared: Prepared, compared: Track, plain: Track, model: Model, simulated: Mapping[str, Mapping[str, Outputs]]
) -> Headline:
    """Returns the headline numbers of a model. `simulated`: what it gives on `compared`."""
    if plain is not compared:
        simulated = {name: one[0] for name, one in simulate(plain, [model], jobs=prepared.jobs).items()}
    return headline_of(plain, simulated, prepared.roles)


def measure(before: Reference, augmented: Model) -> Yardstick:
    """Returns the record of `augmented`, which should be the model as read back from its file."""
    compared = before.track
    simulated = {name: one[0] for name, one in simulate(compared, [augmented], jobs=before.prepared.jobs).items()}
    numbers = _headline(before.prepared, compared, before.plain, augmented, simulated)
    signals: dict[str, dict[str, SignalFit]] = {}
    predictable = {}
    for course in compared.courses:
        if course.horizon not in simulated or course.horizon not in before.left:
            continue
        after = {
            signal: before.rows.total(_errors(compared, course, signal, simulated[course.horizon])[0] ** 2)
            for signal in compared.signals
        }
        for signal, left in before.left[course.horizon].items():
            scores = {
                role: [one.of(signal, role, course.horizon) for one in (before.headline, numbers)]
                for role, _ in _roles(before)
            }
            fits = [_fit(left, role, here, *scores[role]) for role, here in _roles(before)]
            signals.setdefault(signal, {})[course.horizon] = SignalFit(fits[0], fits[1], left.repeatability)
        predictable[course.horizon] = _predictable(before, before.left[course.horizon], after)
    return Yardstick(signals, predictable, before.notes)


def _is_fit(prepared: Prepared, compared: Track, thinned: Rows) -> Mask:
    """Returns (rows,) whether the row is fitted: its run is, and it lies in no stretch that is held out of it."""
    found = np.empty(len(thinned.run), dtype=np.bool_)
    for index, run in enumerate(compared.dataset.runs):
        here = thinned.run == index
        first, last = prepared.roles.stretches.get(run.name, (np.inf, -np.inf))
        time = run.time[0] + thinned.time[here]
        found[here] = (prepared.roles.by_run[run.name] == "fit") & ((time < first) | (time > last))
    return found


def _roles(before: Reference) -> tuple[tuple[str, Mask], tuple[str, Mask]]:
    return ("fit", before.is_fit), ("held_out", ~before.is_fit)


def _folds(thinned: Rows, is_fit: Mask) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Returns the folds of the rows, and a note where they are blocks of time of one run."""
    runs = np.unique(thinned.run[is_fit])
    if len(runs) > 1:
        return black_box.folds(thinned.run, is_fit), ()
    time = thinned.time[is_fit]
    length = max(float(time.max(initial=0.0)) / _BLOCKS, 1e-9)
    blocks = np.minimum((thinned.time / length).astype(np.int64), _BLOCKS - 1)
    note = "There is one fit run alone, so what is attainable on it was predicted from other stretches of the same run."
    return black_box.folds(blocks, is_fit), (note,)


def _errors(compared: Track, course: Course, signal: str, simulated: Mapping[str, Outputs]) -> tuple[Array, Array]:
    """Returns (all samples,) measured less simulated, and the measured signal; NaN where a run lacks it."""
    errors, values = [], []
    for one in course.stretches:
        if signal in compared.measured[one.run.name]:
            error, value = deviation(compared, one, signal, simulated[one.run.name][signal])
        else:
            error = value = np.full(len(one.run.time), np.nan)
        errors.append(error)
        values.append(value)
    return np.concatenate(errors), np.concatenate(values)


def _left(
    prepared: Prepared,
    compared: Track,
    thinned: Rows,
    course: Course,
    simulated: Mapping[str, Outputs],
    problem: Problem,
    is_fit: Mask,
) -> dict[str, Left]:
    """Returns signal -> what the nominal model leaves of it at one horizon."""
    measured = {signal: _errors(compared, course, signal, simulated) for signal in compared.signals}
    errors = {signal: thinned.mean(errors) for signal, (errors, _) in measured.items()}
    learned = [
        Error(error, _summed(thinned, course, error) if signal in SUMMED else None) for signal, error in errors.items()
    ]
    left = {}
    for signal, found in zip(errors, black_box.predict(problem, learned), strict=True):
        error, (samples, values) = errors[signal], measured[signal]
        count, before = thinned.total(np.isfinite(samples).astype(np.float64)), thinned.total(samples**2)

        def unseen(predicted: Array, before: Array = before, count: Array = count, error: Array = error) -> Array:
            """Returns (rows,) the squared error less what a prediction of each row's mean takes away."""
            return np.asarray(before + count * np.nan_to_num(predicted**2 - 2 * predicted * error))

        shuffled = {group: unseen(one) for group, one in found.shuffled.items()}
        sd = prepared.fine.sample_noise.get(signal, 0.0)
        spread = {
            role: size
            for role, here in (("fit", is_fit), ("held_out", ~is_fit))
            if (size := _spread(thinned, values, here, sd)) > 0
        }
        squares = thinned.total(values**2)
        whole = {role: float(squares[here].sum()) for role, here in (("fit", is_fit), ("held_out", ~is_fit))}
        repeated = _repeatability(compared, course, samples, values)
        left[signal] = Left(count, before, unseen(found.value), shuffled, spread, whole, repeated)
    return left


def _spread(thinned: Rows, values: Array, here: Mask, noise_sd: float) -> float:
    """Returns the sum of squares of a signal about its mean, in some rows; 0 where it hardly moves."""
    chosen = values[np.repeat(here, thinned.count)]
    chosen = chosen[np.isfinite(chosen)]
    if len(chosen) < 2 or float(np.std(chosen)) <= _MOVES_NOISE_SD * noise_sd:
        return 0.0
    return float(np.sum((chosen - chosen.mean()) ** 2))


def _summed(thinned: Rows, course: Course, error: Array) -> Summed:
    """Returns how the error of a signal that sums up is learned by its rate: it starts at 0 in each window."""
    since = thinned.mean(np.concatenate([one.since_start for one in course.stretches]))
    step = np.diff(since, prepend=0.0)
    first = np.concatenate([[True], (np.diff(thinned.run) != 0) | (step[1:] <= 0)])
    step = np.where(first, np.maximum(since, 1e-9), step)
    known = np.where(first, 0.0, np.concatenate([[0.0], error[:-1]]))
    numbers = np.cumsum(first) - 1

    def total(rate: Array) -> Array:
        grown = np.cumsum(rate * step)
        at_first = (grown - rate * step)[first]
        return np.asarray(grown - at_first[numbers])

    return Summed((error - known) / step, total)


def _repeatability(compared: Track, course: Course, errors: Array, values: Array) -> float | None:
    """Returns the fit in percent of a perfect model, as far as repeats tell; None where nothing was repeated."""
    by_run, base = {}, 0
    for one in course.stretches:
        by_run[one.run.name] = errors[base : base + len(one.run.time)]
        base += len(one.run.time)
    found = [half_difference(one, compared.dataset, by_run) for one in repeats(compared.dataset)]
    samples, known = sum(count for _, count in found), values[np.isfinite(values)]
    size = float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
    if samples == 0 or size == 0:
        return None
    return percent(100 * (1 - float(np.sqrt(sum(squares for squares, _ in found) / samples)) / size))


def _fit(left: Left, role: str, here: Mask, nominal: Agreement, augmented: Agreement) -> Fit:
    """Returns the headline numbers of one signal, with what a black box reaches on the rows `here`."""
    before, after = nominal.fit_percent, augmented.fit_percent
    size = left.size[role]
    reached = nominal.percent_of(nominal.signal * max(float(left.unseen[here].sum()), 0.0) / size) if size > 0 else None
    known = [one for one in (before, after, reached) if one is not None]
    if before is None and after is None:
        return Fit(None, None, None)
    return Fit(before, after, max(known), Numbers.of(nominal), Numbers.of(augmented))


def _predictable(before: Reference, left: Mapping[str, Left], after: Mapping[str, Array]) -> Predictable:
    by_role = {}
    for role, here in _roles(before):
        chosen = {signal: one for signal, one in left.items() if role in one.spread}
        by_role[role] = _Shares(before, {s: (one, after[s]) for s, one in chosen.items()}, role, here)
    fit, held_out = by_role["fit"], by_role["held_out"]
    return Predictable(
        share=fit.predictable,
        interval=fit.interval(),
        held_out=held_out.predictable,
        held_out_interval=held_out.interval(),
        removed=fit.removed,
        removed_held_out=held_out.removed,
        by_run=_by_run(before, [fit, held_out]),
        sources=fit.sources(),
    )


class _Shares:
    """Squared errors of the runs of one role, summed over signals in units of each signal's own variance.

    Attributes:
        before, unseen: (rows,) of the nominal model, and with what the black box adds.
    """

    def __init__(self, reference: Reference, chosen: Mapping[str, tuple[Left, Array]], role: str, here: Mask) -> None:
        self._here, self._rows = here, reference.rows
        self._scaled = [(one, after, 1 / one.spread[role]) for one, after in chosen.values()]
        zero = np.zeros(len(here))
        self.before = sum((one.before * scale for one, _, scale in self._scaled), zero) * here
        self.unseen = sum((one.unseen * scale for one, _, scale in self._scaled), zero) * here
        whole = float(self.before.sum())
        self._whole = whole if np.isfinite(whole) else 0.0

    @property
    def predictable(self) -> float | None:
        return share(max(0.0, 1 - float(self.unseen.sum()) / self._whole)) if self._whole > 0 else None

    @property
    def removed(self) -> float | None:
        """Returns the share of what could be taken away that the augmented model takes away."""
        could = does = 0.0
        for one, after, scale in self._scaled:
            size = [float(part[self._here].sum()) * scale for part in (one.before, after, one.unseen)]
            could, does = could + size[0] - min(size), does + size[0] - size[1]
        return share(does / could) if could > _LEAST_SHARE * self._whole > 0 else None

    def interval(self) -> tuple[float, float] | None:
        """Returns the 95 % interval of the predictable share, by a bootstrap over stretches of time."""
        if self._whole <= 0:
            return None
        _, stretch = np.unique(
            self._rows.run[self._here] * 1e6 + np.floor(self._rows.time[self._here] / _DRAWN_S), return_inverse=True
        )
        sums = [np.bincount(stretch, part[self._here]) for part in (self.before, self.unseen)]
        count = len(sums[0])
        draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=_DRAWS)
        whole, rest = (draws @ one for one in sums)
        low, high = np.quantile(1 - rest[whole > 0] / whole[whole > 0], [0.025, 0.975])
        return round(float(low), 4), round(float(high), 4)

    def sources(self) -> tuple[Source, ...]:
        """Returns what the error is predicted from: what is lost with each group, over what is predictable."""
        gained = self._whole - float(self.unseen.sum())
        if gained <= _LEAST_SHARE * self._whole:
            return ()
        lost: dict[str, float] = {}
        for one, _, scale in self._scaled:
            for group, shuffled in one.shuffled.items():
                lost[group] = lost.get(group, 0.0) + float((shuffled - one.unseen)[self._here].sum()) * scale
        listed = {group: size / gained for group, size in lost.items() if size >= _LEAST_SOURCE * gained}
        return tuple(
            Source(group, round(min(listed[group], 1.0), 4)) for group in sorted(listed, key=lambda g: -listed[g])
        )


def _by_run(before: Reference, roles: list[_Shares]) -> dict[str, float]:
    """Returns run -> its share of all that is predictable. Fit runs and held-out runs add up to 1 together."""
    gained = sum(one.before - one.unseen for one in roles)
    names = [run.name for run in before.track.dataset.runs]
    sums = np.maximum(np.bincount(before.rows.run, gained, len(names)), 0.0)
    whole = float(sums.sum())
    return {name: round(float(size) / whole, 4) for name, size in zip(names, sums, strict=True)} if whole > 0 else {}
