"""The rows of the peer's regression: residuals and library columns of runs, processed in the same way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from brickpilot.benchmark.sindy_library import Column, library
from brickpilot.benchmark.sindy_motion import Modes, Motion, carried, modes
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Outputs

Array = NDArray[np.float64]

_IMU = ("accel_surge", "accel_sway", "yaw_rate")
_STATE_WINDOW_S = 0.5  # smooths the speeds that terms are made of: with a short one their noise is on both sides
_ROWS_PER_WINDOW = 3
_ORDER = 3  # of the Savitzky-Golay filter


@dataclass(frozen=True)
class Regression:
    """Whitened rows of one data set.

    Attributes:
        target: (n,) the acceleration that is lacking, and residuals of sensors.
        columns: (n, k) of the effects `names` (k,).
        own: (n, m) columns of the nominal model itself.
        count: how many rows they were before they were condensed.
        size: (k,) what the columns were divided by.
    """

    target: Array
    columns: Array
    own: Array
    names: tuple[str, ...]
    count: int
    size: Array

    def only(self, kept: NDArray[np.bool_]) -> Regression:
        """Returns the regression with the columns `kept` (k,) alone."""
        names = tuple(name for name, one in zip(self.names, kept, strict=True) if one)
        return replace(self, columns=self.columns[:, kept], names=names, size=self.size[kept])


def rows_of(
    dataset: Dataset,
    model: Model,
    simulated: Mapping[str, Outputs],
    chosen: Sequence[str],
    noise_sd: Mapping[str, float],
    window_s: float,
) -> Regression:
    """Returns target and columns of all `chosen` runs, stacked."""
    of = modes(model)
    age, charge, heat = 0.0, 0.0, (0.0, 0.0)
    blocks: list[tuple[Array, Array]] = []
    own = 0
    names: tuple[str, ...] = ()
    for run in dataset.runs:
        motion, residuals = _motion(run, dataset, simulated[run.name], of, (age, charge, heat))
        age += float(run.time[-1] - run.time[0])
        charge, heat = carried(of, motion)
        if run.name not in chosen:
            continue
        terms = library(of, motion)
        own, names = len(terms[""]), tuple(name for name, columns in terms.items() if name for _ in columns)
        view = _View(of, motion, window_s, tuple(residuals))
        weight = {name: 1 / sd for name, sd in view.noise(noise_sd).items()}
        target = view.rows({name: values[:, np.newaxis] for name, values in residuals.items()})
        table = view.columns([column for columns in terms.values() for column in columns])
        blocks.append((view.stacked(target, weight), view.stacked(table, weight)))
    targets, tables = (np.vstack(parts) for parts in zip(*blocks, strict=True))
    return Regression(
        targets[:, 0], tables[:, own:], tables[:, :own], names, len(targets), np.ones(tables.shape[1] - own)
    )


def _motion(
    run: Run, dataset: Dataset, simulated: Outputs, of: Modes, past: tuple[float, float, tuple[float, float]]
) -> tuple[Motion, dict[str, Array]]:
    """Returns the run on an even grid, and its residual: signal -> (n,), the wheels as "mean" and "difference"."""
    step = float(np.median(np.diff(run.time)))
    grid = np.arange(run.time[0], run.time[-1] + step / 2, step)
    inputs = np.nan_to_num(motor_inputs(run, dataset))

    def even(values: Array) -> Array:
        known = np.isfinite(values)
        return np.interp(grid, run.time[known], values[known]) if known.any() else np.zeros_like(grid)

    measured = {name: even(values) for name, values in run.outputs.items()}
    given = {name: even(values) for name, values in simulated.items()}
    residuals = {name: measured[name] - given[name] for name in _IMU if name in measured}
    wheels = {side: given[f"wheel_speed_{side}"] for side in ("left", "right")}
    if all(f"wheel_speed_{side}" in measured for side in wheels):
        off = {side: measured[f"wheel_speed_{side}"] - wheels[side] for side in wheels}
        residuals["mean"] = 0.5 * (off["left"] + off["right"])
        residuals["difference"] = 0.5 * (off["left"] - off["right"])
        wheels = {side: wheels[side] + _smooth(off[side], _samples(_STATE_WINDOW_S, step)) for side in wheels}
    rates = {side: np.gradient(given[f"wheel_speed_{side}"], step) for side in wheels}
    age, charge, heat = past
    motion = Motion(
        step=step,
        left=wheels["left"],
        right=wheels["right"],
        volts_left=even(inputs[:, 0]),
        volts_right=even(inputs[:, 1]),
        left_rate=rates["left"],
        right_rate=rates["right"],
        surge_accel=given["accel_surge"],
        sway_accel=given["accel_sway"],
        yaw_accel=of.radius / of.half_track * 0.5 * (rates["left"] - rates["right"]),
        age=age,
        charge=charge,
        heat=heat,
    )
    return motion, residuals


def _samples(window_s: float, step: float) -> int:
    """Returns the samples of a Savitzky-Golay window: odd, and more than its order."""
    return max(_ORDER + 2, 2 * round(0.5 * window_s / step) + 1)


def _smooth(values: Array, count: int) -> Array:
    return np.asarray(savgol_filter(values, min(count, (len(values) - 1) // 2 * 2 + 1), _ORDER, axis=0))


class _View:
    """Turns residuals and library columns of one run into rows of the regression.

    With wheel speeds, rows are the accelerations that the two modes lack, and the residuals of gyro and accelerometers
    that the wheels do not explain. With an IMU alone, rows are the yaw acceleration that is lacking and the residuals
    of the three signals. There is no measured speed then, so a column passes through the nominal modes first.
    """

    def __init__(self, of: Modes, motion: Motion, window_s: float, signals: tuple[str, ...]) -> None:
        from pysindy import SmoothedFiniteDifference

        self.of, self.motion, self.signals = of, motion, signals
        self.wheels = "mean" in signals
        self.per = of.radius / of.half_track
        self.surge = (of.radius * 0.5 * (motion.left + motion.right))[:, np.newaxis]
        self.turn = (self.per * 0.5 * (motion.left - motion.right))[:, np.newaxis]
        self.samples = _samples(window_s, motion.step)
        self.every = max(1, self.samples // _ROWS_PER_WINDOW)
        self.time = np.arange(len(motion.left)) * motion.step
        self.derivative = SmoothedFiniteDifference(
            smoother_kws={"window_length": self.samples, "polyorder": _ORDER, "axis": 0}
        )

    def rows(self, residuals: Mapping[str, Array]) -> dict[str, Array]:
        """Returns the rows from the residuals of each signal, (n, k): name -> (n, k)."""
        smooth = {name: _smooth(values, self.samples) for name, values in residuals.items()}
        mean_decay, turn_decay = self.of.decay
        if not self.wheels:
            if "yaw_rate" not in residuals:
                return smooth
            turning = self._rate(residuals["yaw_rate"]) + turn_decay * smooth["yaw_rate"]
            return {**smooth, "difference": turning / self.per}
        mean, difference = smooth["mean"], smooth["difference"]
        mean_rate = self._rate(residuals["mean"])
        beside = {
            "accel_surge": self.of.radius * mean_rate,
            "accel_sway": self.surge * self.per * difference + self.turn * self.of.radius * mean,
            "yaw_rate": self.per * difference,
        }
        return {
            "mean": mean_rate + mean_decay * mean,
            "difference": self._rate(residuals["difference"]) + turn_decay * difference,
            **{name: smooth[name] - beside[name] for name in beside if name in smooth},
        }

    def columns(self, library_columns: Sequence[Column]) -> dict[str, Array]:
        """Returns the rows of library columns: each as if one effect of size 1 were all that is missing."""
        nothing = np.zeros(len(self.time))
        mean = np.column_stack([one.mean for one in library_columns])
        difference = np.column_stack([one.difference for one in library_columns])
        errors = {
            name: np.column_stack([one.sensors.get(name, nothing) for one in library_columns]) for name in self.signals
        }
        if self.wheels:
            rows = self.rows(errors)
            rows["mean"] = rows["mean"] + _smooth(mean, self.samples)
            rows["difference"] = rows["difference"] + _smooth(difference, self.samples)
            return rows
        mean_decay, turn_decay = self.of.decay
        fast, turned = _driven(mean, mean_decay, self.motion.step), _driven(difference, turn_decay, self.motion.step)
        signals = {
            "accel_surge": self.of.radius * (mean - mean_decay * fast),
            "accel_sway": self.surge * self.per * turned + self.turn * self.of.radius * fast,
            "yaw_rate": self.per * turned,
        }
        return self.rows({name: signals[name] + values for name, values in errors.items()})

    def noise(self, noise_sd: Mapping[str, float]) -> dict[str, float]:
        """Returns row -> its sd for white noise of the sensors."""
        random = np.random.default_rng(0)
        sds = {name: noise_sd.get(name, 0.0) for name in self.signals}
        if self.wheels:
            sds["mean"] = sds["difference"] = noise_sd["wheel_speed_left"] / np.sqrt(2)
        drawn = {name: random.normal(0.0, sds[name], (len(self.time), 1)) for name in self.signals}
        return {name: max(float(values.std()), 1e-12) for name, values in self.rows(drawn).items()}

    def stacked(self, rows: Mapping[str, Array], weight: Mapping[str, float]) -> Array:
        return np.vstack([weight[name] * rows[name][:: self.every] for name in weight])

    def _rate(self, values: Array) -> Array:
        return np.asarray(self.derivative(values, self.time))


def _driven(values: Array, decay: float, step: float) -> Array:
    """Returns the solution of y' = values - decay y from rest."""
    kept = np.exp(-decay * step)
    return np.asarray(lfilter([0.0, (1 - kept) / decay], [1, -kept], values, axis=0))
