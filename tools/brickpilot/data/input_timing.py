"""The inputs between two rows of a log (held, or linear up to the next row), and the delay of the inputs.

A simulation holds an input from row to row. So a linear change becomes several short rows, each with the input's mean
over this row; measured signals are blank in the added rows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from brickpilot.data.signals import Array

if TYPE_CHECKING:
    from brickpilot.data.dataset import Dataset, Run

Timing = Literal["held", "linear"]
InputTiming = Literal[Timing, "unknown"]
Sampling = Literal["instant", "mean"]
Kind = Literal["delay", "lag"]

INPUT_TIMINGS: tuple[InputTiming, ...] = ("held", "linear", "unknown")

UNKNOWN_TIMING = "how the inputs change between two rows is not known: they are taken as held"
"""The note of a data set whose `input_timing` is "unknown"."""

_STEP_S = 0.005  # s: longest duration of a row while an input changes linearly
_MOST_STEPS = 200  # largest number of steps between two rows
_PARTS = 8  # number of steps into which a row of a log is divided


def with_linear_inputs(run: Run) -> Run:
    """Returns a run with rows of at most 5 ms wherever an input changes from one row to the next."""
    return with_rows(run, *ramps(run.time, run.inputs))


def ramps(time: Array, inputs: Mapping[str, Array], step_s: float = _STEP_S) -> tuple[Array, dict[str, Array]]:
    """Returns times and inputs of finer rows: an input is linear between given rows, and averaged over finer rows.

    Args:
        time: (n,) s, strictly increasing; the result contains all these times.
        inputs: name -> (n,); NaN: the motor floats until the next row.
        step_s: the largest length of a row in s while an input changes.
    """
    span = np.diff(time)
    changes = np.any([np.diff(values) != 0.0 for values in inputs.values()], axis=0)
    steps = np.where(changes, np.ceil(span / step_s - 1e-9), 1.0)
    steps = np.clip(steps, 1, _MOST_STEPS).astype(np.int64)
    row = np.repeat(np.arange(span.size), steps)
    part = (np.arange(row.size) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[row]
    begins = np.append(time[row] + part * span[row], time[-1])
    means = {}
    for name, values in inputs.items():
        ramp = values[row] + (part + 0.5 / steps[row]) * np.diff(values)[row]
        means[name] = np.append(np.where(np.isnan(ramp), values[row], ramp), values[-1])
    return begins, means


def with_rows(run: Run, time: Array, inputs: Mapping[str, Array]) -> Run:
    """Returns a run with more rows and other inputs; outputs are blank in the new rows.

    Args:
        time: (m,) s; holds all of the run's times.
        inputs: name -> (m,).
    """
    measured = np.searchsorted(time, run.time)

    def spread(values: Array) -> Array:
        wider = np.full(time.size, np.nan)
        wider[measured] = values
        wider.setflags(write=False)
        return wider

    outputs = {name: spread(values) for name, values in run.outputs.items()}
    raw = {name: spread(values) for name, values in run.raw_outputs.items()}
    return dataclasses.replace(run, time=time, inputs=dict(inputs), outputs=outputs, raw_outputs=raw)


def mean_over_steps(time: Array, driven: Array, grid: Array) -> Array:
    """Returns (grid, columns): the mean of each input over each step of the grid. Inputs are held between samples.

    Args:
        time: (n,) s, the times at which the rows of `driven` begin to act; before the first row the input is 0.
        driven: (n, columns) V; NaN: the motor floats.
        grid: (m,) s. The last row of the result is the last row of `driven`.
    """
    return means_over_grids(time, driven, [grid])[0]


def means_over_grids(time: Array, driven: Array, grids: Sequence[Array]) -> list[Array]:
    """Returns the result of `mean_over_steps` for each grid, but sums the inputs only once."""
    grid, ends = np.concatenate(grids), np.cumsum([len(each) for each in grids])
    held = np.where(np.isnan(driven), 0.0, driven)
    summed = np.vstack([np.zeros(driven.shape[1]), np.cumsum(held[:-1] * np.diff(time)[:, np.newaxis], axis=0)])
    at_grid = np.column_stack([np.interp(grid, time, column) for column in summed.T])
    with np.errstate(divide="ignore", invalid="ignore"):  # the invalid step between two grids is replaced below
        means = np.vstack([np.diff(at_grid, axis=0) / np.diff(grid)[:, np.newaxis], held[-1]])
    means[ends - 1] = held[-1]
    floats = np.isnan(driven[np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)])
    means[floats] = np.nan
    return np.split(means, ends[:-1])


def later(time: Array, driven: Array, delay_s: float) -> Array:
    """Returns (n, columns): the inputs delayed by `delay_s` s (negative: they act earlier), at the same samples.

    Before the first input arrives, 0 V acts; the last input is held.
    """
    beyond = max(float(time[-1]), float(time[-1]) + delay_s) + 1.0
    arrives = np.append(time + delay_s, beyond)
    held = np.vstack([driven, driven[-1]])
    return mean_over_steps(arrives, held, np.append(time, beyond))[:-1]


def held_back(time: Array, driven: Array, held_s: float) -> Array:
    """Returns (n, columns): the inputs with 0 V in the first `held_s` s of the run."""
    steps = np.diff(time, append=2 * time[-1] - time[-2])
    missing = np.clip((held_s - (time - time[0])) / steps, 0.0, 1.0)[:, np.newaxis]
    return np.where(missing >= 1, 0.0, (1 - missing) * driven)


def scaled(_: Array, driven: Array, gain: float) -> Array:
    """Returns (n, columns): the inputs multiplied by 1 + `gain`."""
    return np.asarray(driven * (1 + gain))


@dataclass(frozen=True)
class Behind:
    """How late the inputs act: a dead time ("delay"), or a first-order lag with a time constant ("lag"), s; 0: none."""

    kind: Kind = "delay"
    seconds: float = 0.0

    def __str__(self) -> str:
        return f"a {self.kind} of {1e3 * self.seconds:.3g} ms"


def refined(dataset: Dataset) -> Dataset:
    """Returns the data set with each row divided into eight, so that delayed inputs can be represented."""
    runs = []
    for run in dataset.runs:
        rows = np.arange(len(run.time))
        time = np.interp(np.arange(_PARTS * rows[-1] + 1) / _PARTS, rows, run.time)
        runs.append(with_rows(run, time, inputs_acting(run, time, "held", Behind())))
    return dataclasses.replace(dataset, runs=tuple(runs), input_timing="held")


def inputs_acting(run: Run, time: Array, timing: Timing, behind: Behind) -> dict[str, Array]:
    """Returns a logged run's inputs as means over the rows at `time`, after `timing` and `behind` are applied."""
    at, inputs = run.time, run.inputs
    if timing == "linear":
        at, inputs = ramps(at, inputs, float(np.diff(time).min()))
    values = np.column_stack(list(inputs.values()))
    delay = behind.seconds if behind.kind == "delay" else 0.0
    before = at[0] - delay - 1.0  # the first input acts from this time on
    means = mean_over_steps(np.append(before, at + delay), np.vstack([values[:1], values]), time)
    if behind.kind == "lag":
        means = _lagged(time, means, behind.seconds)
    return dict(zip(inputs, means.T, strict=True))


def _lagged(time: Array, values: Array, lag: float) -> Array:
    """Returns (n, columns): row means of `values` after a first-order lag, settled at the start; NaN stays NaN."""
    steps = np.diff(time, append=2 * time[-1] - time[-2])
    kept = np.exp(-steps / lag)
    means = np.empty_like(values)
    state = np.nan_to_num(values[0])
    for row, held in enumerate(values):
        means[row] = held + (state - held) * (1 - kept[row]) * lag / steps[row]
        state = np.nan_to_num(held + (state - held) * kept[row])
    return means
