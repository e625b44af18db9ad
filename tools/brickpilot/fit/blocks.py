"""The compared values of a data set: a block is one signal of one run, sample by sample or as means over bins."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.input_timing import mean_over_steps
from brickpilot.data.motion import MOTOR_RATE_OF, measured_rates
from brickpilot.data.signals import SUMMED
from brickpilot.errors import InputError
from brickpilot.vehicle.compared_runs import compared_signals
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay

Array = NDArray[np.float64]

_JUMP = 0.05  # limit, as a share of the largest command: a smaller change between two samples is a ramp, not a jump
_LONGEST_HOLE = 3.0  # limit, in median distances of bins: no change spans a longer hole, such as a held-out stretch


@dataclass(frozen=True)
class Block:
    """One signal of one fit run.

    Attributes:
        place: where this block's values stand in the stacked residual.
        measured: the compared values, SI.
        middle: (values,) the time of each value, s on the run's clock.
        picked: (values, simulated samples): the matrix that turns the simulated signal into the compared values.
        count: the average number of samples in a compared value.
    """

    run: str
    signal: str
    place: slice
    measured: Array
    middle: Array
    picked: csr_array
    count: float = 1.0


def stack(blocks: Sequence[Block], starts: Mapping[tuple[str, str], int], length: int) -> csr_array:
    """Returns the matrix that turns one row of `Replay.stacked` into the values of all blocks.

    Args:
        starts, length: as `Replay.layout` gives them.
    """
    data, columns, ends = [], [], [np.zeros(1, dtype=np.int64)]
    for block in blocks:
        data.append(block.picked.data)
        columns.append(block.picked.indices + starts[block.run, block.signal])
        ends.append(block.picked.indptr[1:] + ends[-1][-1])
    pointers = np.concatenate(ends)
    return csr_array((np.concatenate(data), np.concatenate(columns), pointers), shape=(len(pointers) - 1, length))


@dataclass(frozen=True)
class Bins:
    """How the values of blocks are averaged: over bins of `width` s from each run's start.

    Attributes:
        width: the width of a bin, s; 0: samples are compared as they are.
        grids: run -> times of the simulated samples, s. A run that is not listed is simulated at its measured samples.
        changes: signals that are compared by their change from bin to bin.
        as_measured: whether a motor's position or angle is compared, and not its derivative.
    """

    width: float
    grids: Mapping[str, Array] = field(default_factory=dict)
    changes: frozenset[str] = SUMMED
    as_measured: bool = False


SAMPLES = Bins(0.0, changes=frozenset())


def blocks(dataset: Dataset, model: Model, fitted: set[str], bins: Bins = SAMPLES) -> tuple[list[Block], list[str]]:
    """Returns the blocks of the fit runs, and a note on each signal that is left out.

    Args:
        fitted: names of the fit runs.

    Raises:
        InputError: the fit runs hold no signal that the model gives.
    """
    names = compared_signals(dataset, model).names
    found: list[Block] = []
    notes, start = [], 0
    for run in (one for one in dataset.runs if one.name in fitted):
        rates = measured_rates(run)
        for signal, measured in _fitted_signals(run, names, rates, bins).items():
            rows = np.flatnonzero(np.isfinite(measured))
            if len(rows) < 2:
                continue
            rate = rates.get(MOTOR_RATE_OF.get(signal, ""), np.empty(0))
            if np.ptp(measured[rows]) == 0 and np.any(np.abs(rate[np.isfinite(rate)]) > 0):
                notes.append(f"Run {run.name}: {signal} is frozen while its rate is not; left out of the fit.")
                continue
            described = dataset.signals.get(signal)
            instant = described is not None and described.sampling == "instant"
            covers = float(np.median(np.diff(run.time))) if signal.startswith("accel") and not instant else 0.0
            reach = _reach(run, rows, bins, covers=covers, instant=instant)
            mean, middle, count = _means(run, rows, bins, covers=covers, change=signal in bins.changes)
            values = np.asarray(mean @ measured[rows])
            if len(values) < 2:
                continue
            place = slice(start, start := start + len(values))
            found.append(Block(run.name, signal, place, values, middle, csr_array(mean @ reach), count))
    if not found:
        raise InputError("nothing to compare in the fit runs", file=dataset.path, field="signals")
    return found, notes


def _reach(run: Run, rows: NDArray[np.intp], bins: Bins, *, covers: float, instant: bool) -> csr_array:
    """Returns (rows, simulated samples): the matrix that gives a simulated signal at the measured samples `rows`."""
    time, grid = run.time[rows], bins.grids.get(run.name)
    if instant:
        return _instants(time, run.time, _jumps(run)) if grid is None else _instants(time, grid)
    if grid is None:
        return _selection(rows, len(run.time))
    return _overlap(time, covers, grid) if covers else _interpolation(time, grid)


def _means(
    run: Run, samples: NDArray[np.intp], bins: Bins, *, covers: float, change: bool
) -> tuple[csr_array, Array, float]:
    """Returns the matrix (values, samples) of means over bins, the time of each value, and the samples per value.

    Args:
        covers: a sample is a mean over this time, s, before it. The middle of this time decides the sample's bin.
        change: whether a value is the change from bin to bin.
    """
    time, rows = run.time[samples], np.arange(len(samples))
    if bins.width == 0:
        return _selection(rows, len(rows)), time, 1.0
    lies = np.maximum(time - run.time[0] - covers / 2, 0.0)
    number = np.floor(lies / bins.width + 1e-9).astype(np.intp)
    filled, place, counts = np.unique(number, return_inverse=True, return_counts=True)
    mean = csr_array((1 / counts[place], (place, rows)))
    middle = np.asarray(mean @ time)
    if change:
        apart = np.diff(filled)
        later = np.flatnonzero(apart <= _LONGEST_HOLE * np.median(apart)) if len(apart) else rows[:0]
        step = _selection(later + 1, len(filled)) - _selection(later, len(filled))
        mean, middle = csr_array(step @ mean), middle[later + 1]
    return mean, middle, float(counts.mean())


def _selection(rows: NDArray[np.intp], length: int) -> csr_array:
    """Returns (rows, length): the matrix that picks the samples `rows`."""
    return csr_array((np.ones(len(rows)), rows, np.arange(len(rows) + 1)), shape=(len(rows), length))


def _interpolation(time: Array, grid: Array) -> csr_array:
    """Returns (times, grid): linear interpolation between the grid's points, constant beyond them."""
    left = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, len(grid) - 2)
    share = np.clip((time - grid[left]) / (grid[left + 1] - grid[left]), 0.0, 1.0)
    rows, columns = np.tile(np.arange(len(time)), 2), np.concatenate([left, left + 1])
    return csr_array((np.concatenate([1 - share, share]), (rows, columns)), shape=(len(time), len(grid)))


def _jumps(run: Run) -> NDArray[np.bool_]:
    """Returns (n,): whether a command, and so the acceleration, jumps at each sample."""
    found = np.zeros(len(run.time), dtype=np.bool_)
    for values in run.inputs.values():
        driven = np.nan_to_num(values)
        found[1:] |= np.abs(np.diff(driven)) > _JUMP * np.max(np.abs(driven), initial=0.0)
    return found


def _instants(time: Array, simulated: Array, jumps: NDArray[np.bool_] | None = None) -> csr_array:
    """Returns (times, simulated): the matrix that interpolates the plant's accelerations (means over steps) at `time`.

    A mean holds at the middle of its step. Between two middles, the acceleration is taken as linear: this is exact to
    second order. `jumps`: (simulated,) whether a command jumps at a sample; it then gets the mean of the step before.
    """
    middles = simulated - np.append(0.0, np.diff(simulated)) / 2
    if jumps is None:
        return _interpolation(time, middles)
    before = np.flatnonzero(jumps[np.searchsorted(simulated, time)])
    at = np.array(time)
    at[before] = middles[np.searchsorted(simulated, time[before])]
    return _interpolation(at, middles)


def _overlap(time: Array, span: float, grid: Array) -> csr_array:
    """Returns (times, grid): the matrix that turns means over steps into means over the `span` s before each time.

    The value of the first point also holds before this point.
    """
    begins, ends = np.append(-np.inf, grid[:-1]), np.append(grid[:-1], np.inf)
    first = np.minimum(np.searchsorted(grid, time - span, side="right"), len(grid) - 1)
    last = np.clip(np.searchsorted(grid, time - 1e-9), first, len(grid) - 1)
    counts = last - first + 1
    rows = np.repeat(np.arange(len(time)), counts)
    steps = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - last - 1, counts)
    shared = np.minimum(ends[steps], time[rows]) - np.maximum(begins[steps], time[rows] - span)
    return csr_array((shared / span, (rows, steps)), shape=(len(time), len(grid)))


def _fitted_signals(run: Run, names: Sequence[str], rates: Mapping[str, Array], bins: Bins) -> dict[str, Array]:
    """Returns the measured signals that are compared; a motor's velocity replaces its position, unless `as_measured`.

    A position holds the same information as the velocity, but it sums up the velocity's error over the run.
    """
    fitted = {name: run.outputs[name] for name in names if name in run.outputs}
    if bins.as_measured:
        return fitted
    for summed, rate in MOTOR_RATE_OF.items():
        if summed in fitted and rate not in fitted:
            del fitted[summed]
            fitted[rate] = rates[rate]
    return fitted


_STEPS_PER_BIN = 3
_LEAST_STEP = 0.05  # limit, in steps of the grid: a command's jump gets a row of its own only if no row is nearer


def on_coarse_grid(dataset: Dataset, width_s: float) -> tuple[Replay, Bins]:
    """Returns the runs on a grid with three steps per bin, and the bins in which simulation and samples are compared.

    A simulation on this grid is about three times as fast as at the measured samples, and exact enough for a search. In
    each step an input has its mean over the step. If a command jumps and then stays, the grid has a row there. The mean
    of both commands would act as a third command on a drive that has a dead band, or that coasts at zero.
    """
    step = width_s / _STEPS_PER_BIN
    runs, grids = [], {}
    for run in dataset.runs:
        if np.median(np.diff(run.time)) <= step / 1.5:
            grids[run.name] = _coarse_grid(run, step)
            run = dataclasses.replace(run, time=grids[run.name])
        runs.append(run)
    coarse = dataclasses.replace(dataset, runs=tuple(runs))
    inputs = _inputs_on(dataset, coarse)
    return Replay(coarse, inputs=inputs, motor_step=step, body_step=step), Bins(width_s, grids)


def _coarse_grid(run: Run, step: float) -> Array:
    """Returns the times of the rows: one every `step` s, one where a command jumps and then stays, and the last."""
    even = np.append(np.arange(run.time[0], run.time[-1] - step / 2, step), run.time[-1])
    jumps = run.time[_jumps(run)]
    apart = np.diff(jumps, prepend=-np.inf, append=np.inf) > step
    lone = jumps[apart[:-1] & apart[1:]]
    place = (lone - run.time[0]) / step
    return np.union1d(even, lone[np.abs(place - np.round(place)) > _LEAST_STEP])


def with_inputs_of(coarse: Replay, dataset: Dataset) -> Replay:
    """Returns the replay `coarse` with the inputs of `dataset`, which has the same runs; the grid stays."""
    return dataclasses.replace(coarse, inputs=_inputs_on(dataset, coarse.dataset))


def _inputs_on(dataset: Dataset, coarse: Dataset) -> dict[str, Array]:
    """Returns run -> (rows, columns): the means of the inputs of `dataset` over the steps of the runs of `coarse`."""
    driven = Replay(dataset).inputs
    return {
        run.name: driven[run.name] if run.time is own.time else mean_over_steps(own.time, driven[run.name], run.time)
        for own, run in zip(dataset.runs, coarse.runs, strict=True)
    }
