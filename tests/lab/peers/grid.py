"""Runs on even time steps, which peers need, and the choice of a peer's settings by its free runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.holdout import Roles
from brickpilot.data.motion import zero_phase_rate
from brickpilot.data.signals import SUMMED
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from lab.real_score import Predictions, fits

Array = NDArray[np.float64]

_FEWEST = 50  # least number of samples of the shortest run on a grid
_MOST_ROWS = 15_000  # largest number of samples of all runs on a grid
_STEPS_S = (0.005, 0.01, 0.02, 0.05)


@dataclass(frozen=True)
class Stretch:
    """One run on even steps.

    Attributes:
        time: (n,) s, on the run's own clock.
        inputs: (n, m) mean motor voltages over the next step, V; a floating motor counts as 0 V.
        outputs: (n, k) channels: each is a signal, or the signal's rate if the signal sums up motion.
    """

    time: Array
    inputs: Array
    outputs: Array


@dataclass(frozen=True)
class Grid:
    """All runs of a data set on even steps of `step` s. `signals` (k,): the signal of each channel."""

    dataset: Dataset
    step: float
    signals: tuple[str, ...]
    stretches: Mapping[str, Stretch]

    def back(self, simulated: Mapping[str, Array]) -> Predictions:
        """Returns the signals at the measured samples from simulated channels on the grid: run -> (n, k)."""
        with np.errstate(over="ignore", invalid="ignore"):  # a model may diverge
            return {
                run.name: self._signals(run, simulated[run.name]) for run in self.dataset.runs if run.name in simulated
            }

    def _signals(self, run: Run, channels: Array) -> dict[str, Array]:
        grid = self.stretches[run.name].time
        found = {}
        for number, name in enumerate(self.signals):
            values = channels[:, number]
            if name in SUMMED:
                start = run.outputs[name][np.isfinite(run.outputs[name])][:1].sum()
                values = start + cumulative_trapezoid(values, dx=self.step, initial=0)
            found[name] = np.interp(run.time, grid, values)
        return found


def signals_of(dataset: Dataset) -> tuple[str, ...]:
    """Returns the measured signals that a peer has to predict: all outputs except the battery voltage."""
    return tuple(dict.fromkeys(name for run in dataset.runs for name in run.outputs if name != "battery_voltage"))


def steps_for(dataset: Dataset) -> list[float]:
    """Returns the steps, s, from which a peer may choose. None is finer than the log or too coarse for short runs."""
    own = float(np.median([np.median(np.diff(run.time)) for run in dataset.runs]))
    spans = [float(run.time[-1] - run.time[0]) for run in dataset.runs]
    coarsest = max(own, min(spans) / _FEWEST)
    finest = max(own, sum(spans) / _MOST_ROWS)
    steps = {round(min(max(step, finest), coarsest), 6) for step in _STEPS_S}
    return sorted(steps) if finest <= coarsest else [finest]


def on_grid(dataset: Dataset, step: float) -> Grid:
    """Returns the runs on even steps. Blank and damaged samples are filled by straight lines."""
    signals = signals_of(dataset)
    return Grid(dataset, step, signals, {run.name: _stretch(run, dataset, step, signals) for run in dataset.runs})


def spread(values: Array) -> Array:
    """Returns the standard deviation of each column (k,); 1 for a column that never changes."""
    sizes = values.std(axis=0)
    return np.where(sizes > 0, sizes, 1.0)


def _stretch(run: Run, dataset: Dataset, step: float, signals: Sequence[str]) -> Stretch:
    count = max(int((run.time[-1] - run.time[0]) / step + 1e-6) + 1, 4)
    time = run.time[0] + step * np.arange(count)
    volts = np.nan_to_num(motor_inputs(run, dataset))
    inputs = np.column_stack([_held_means(run.time, column, time, step) for column in volts.T])
    outputs = np.column_stack([_channel(run, name, time) for name in signals])
    return Stretch(time, inputs, outputs)


def _channel(run: Run, name: str, time: Array) -> Array:
    values = run.outputs.get(name)
    if values is None or np.isfinite(values).sum() < 2:
        return np.zeros_like(time)
    if name in SUMMED:
        values = zero_phase_rate(run.time, values)
    known = np.isfinite(values)
    return np.interp(time, run.time[known], values[known]) if known.any() else np.zeros_like(time)


def _held_means(time: Array, values: Array, grid: Array, step: float) -> Array:
    """Returns the mean of a held input over the step that follows each point of the grid."""
    area = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])

    def until(at: Array) -> Array:
        inside = np.interp(at, time, area)
        return np.asarray(inside + values[-1] * np.maximum(at - time[-1], 0.0))

    return np.asarray((until(grid + step) - until(grid)) / step)


Setting = TypeVar("Setting")

Simulated = Callable[[Grid, Sequence[str], Sequence[str], Setting], Mapping[str, Array]]
"""A function that fits to the runs of the first list and returns the channels (n, k) of the second list's runs."""


def choose(
    grids: Iterable[Grid], settings: Sequence[Setting], simulated: Simulated[Setting], roles: Roles
) -> Predictions:
    """Returns the free runs of the best setting on the best grid.

    With three fit runs or more, every third run is used to choose the setting, and the other runs to fit. With fewer
    runs, all runs are used for both purposes. Held-out runs are never used.
    """
    fitted = roles.fit()
    watched = fitted[1::3] if len(fitted) > 2 else fitted
    used = [name for name in fitted if name not in watched] or fitted
    best: tuple[float, Grid, Setting] | None = None
    for grid in grids:
        for setting in settings:
            score = _score(grid, _safely(simulated, grid, used, watched, setting), watched)
            if best is None or score > best[0]:
                best = (score, grid, setting)
    if best is None:
        return {}
    _, grid, setting = best
    every = [run.name for run in grid.dataset.runs]
    return grid.back(_safely(simulated, grid, fitted, every, setting))


def _score(grid: Grid, simulated: Mapping[str, Array], names: Sequence[str]) -> float:
    if not simulated:
        return -np.inf
    found = fits(grid.dataset, Roles(dict.fromkeys(names, "fit"), ""), grid.back(simulated), grid.signals)["fit"]
    return -np.inf if found.pooled is None else found.pooled


def _safely(
    simulated: Simulated[Setting], grid: Grid, used: Sequence[str], wanted: Sequence[str], setting: Setting
) -> Mapping[str, Array]:
    """Returns `simulated` of a setting; {} if the library fails because of a singular matrix or a diverging model."""
    try:
        with np.errstate(all="ignore"):
            return simulated(grid, used, wanted, setting)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, IndexError):
        return {}
