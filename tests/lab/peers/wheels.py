"""The common part of peers that model each side separately. The other channels follow from the sides' speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from brickpilot.data.signals import RATE_OF
from numpy.typing import NDArray

from lab.peers.grid import Grid
from lab.real_score import Predictions

Array = NDArray[np.float64]

_MOTOR = ("velocity", "speed", "position", "angle")
_WHEEL = ("wheel_velocity", "wheel_speed", "wheel_travel", "wheel_angle")


@dataclass(frozen=True)
class Drive:
    """One driven side of one run: volts (n,) and measured speed (n,), on even steps of `step` s."""

    step: float
    volts: Array
    speed: Array


FitSide = Callable[[Sequence[Drive]], Callable[[Drive], Array]]
"""A function that fits to drives and returns a simulator: drive -> speed (n,) from its volts and its first speed."""


def simulated_by_side(grid: Grid, fitted: Sequence[str], fit_side: FitSide) -> Predictions:
    """Returns the free runs of all signals: the speed of each side by `fit_side`, other signals from these speeds.

    Any other signal, such as a gyro's, is a linear combination of the sides' speeds and accelerations, fitted to the
    fit runs.
    """
    sides = _sides(grid)
    speeds: dict[str, list[Array]] = {name: [] for name in grid.stretches}
    for number, channel in enumerate(sides):
        drives = {
            name: Drive(grid.step, one.inputs[:, number], one.outputs[:, channel])
            for name, one in grid.stretches.items()
        }
        simulate = fit_side([drives[name] for name in fitted])
        for name, drive in drives.items():
            speeds[name].append(simulate(drive))
    moved = {name: np.column_stack(columns) for name, columns in speeds.items()}
    return grid.back(_spread_out(grid, fitted, sides, moved))


def _sides(grid: Grid) -> list[int]:
    """Returns the channel of each driven side's speed: a measured speed if possible, otherwise a derivative."""
    if grid.dataset.vehicle == "motor":
        return [next(grid.signals.index(name) for name in _MOTOR if name in grid.signals)]
    names = next(name for name in _WHEEL if f"{name}_left" in grid.signals)
    return [grid.signals.index(f"{names}_{side}") for side in ("left", "right")]


def _spread_out(
    grid: Grid, fitted: Sequence[str], sides: Sequence[int], moved: Mapping[str, Array]
) -> dict[str, Array]:
    features = {name: _features(speed, grid.step) for name, speed in moved.items()}
    used = np.vstack([features[name] for name in fitted])
    wanted = np.vstack([grid.stretches[name].outputs for name in fitted])
    weights = np.linalg.lstsq(used, wanted, rcond=1e-10)[0]
    for channel, side in _same_motion(grid, sides).items():
        weights[:, channel] = 0.0
        own, target = np.vstack([moved[name] for name in fitted])[:, side], wanted[:, channel]
        weights[side, channel] = _ratio(grid, channel, sides[side], own, target)
    return {name: columns @ weights for name, columns in features.items()}


def _features(speed: Array, step: float) -> Array:
    return np.column_stack([speed, np.gradient(speed, step, axis=0)])


def _same_motion(grid: Grid, sides: Sequence[int]) -> dict[int, int]:
    """Returns channel -> number of a side, for channels that are the speed or path of this side."""
    found = {}
    for number, channel in enumerate(sides):
        end = grid.signals[channel].rpartition("_")[2] if grid.dataset.vehicle == "diff_drive" else ""
        rates = {name for pair in RATE_OF.items() for name in pair}
        for other, name in enumerate(grid.signals):
            if name in rates and (not end or name.endswith(end)):
                found[other] = number
    return found


def _ratio(grid: Grid, channel: int, speed: int, simulated: Array, target: Array) -> float:
    """Returns 1 for the speed itself and its own path, otherwise the fitted ratio of length to angle."""
    same = {grid.signals[speed], *(summed for summed, rate in RATE_OF.items() if rate == grid.signals[speed])}
    if grid.signals[channel] in same or RATE_OF.get(grid.signals[speed]) == grid.signals[channel]:
        return 1.0
    size = float(simulated @ simulated)
    return float(simulated @ target) / size if size > 0 else 0.0
