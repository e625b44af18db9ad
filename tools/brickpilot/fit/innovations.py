"""Innovations: measured less predicted from all that was measured before, over several runs together.

The plant predicts from sample to sample in a Kalman filter (`vehicle.predictor`). Its equations get unknown loads and
its sensors unknown drifts, so the prediction keeps track where a free run drifts away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.signals import RATE_OF, SUMMED
from brickpilot.errors import InputError
from brickpilot.fit.compared import compared_signals
from brickpilot.fit.initial_state import initial_states
from brickpilot.fit.robust import noise_sd
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from brickpilot.vehicle.predictor import Predicted, ProcessNoise, Readings, predict

Array = NDArray[np.float64]

MOTOR_STEP_S = 0.003
"""Longest motor step of a prediction: it starts again at each sample, so that it needs no shorter one."""

_LEAST_NOISE = 1e-4  # of a signal's rms: no reading is trusted more
_START_SHARE = 0.02  # of the largest speed: sd of a speed at the start of a run that no sensor tells


@dataclass(frozen=True)
class _Log:
    """One run, ready for a filter: its samples, inputs, age at the start, and what was measured."""

    run: Run
    time: Array
    inputs: Array
    age: float
    measured: Mapping[str, Array]


class Innovations:
    """Runs of a data set that can be filtered under any model.

    Args:
        runs: the names of the runs.
        step_s: samples are thinned to steps of about so many s; 0: every sample. Accelerations are averaged.

    Attributes:
        signals: the measured signals that are predicted.
        noise: signal -> sd of its readings, as stated or as estimated.
        rms: signal -> rms; of a signal that sums up motion, of its change since the run's start.

    Raises:
        InputError: the runs hold nothing that the model gives.
    """

    def __init__(
        self, dataset: Dataset, model: Model, runs: Sequence[str], *, step_s: float = 0.0, threads: int = 1
    ) -> None:
        names = [name for name in compared_signals(dataset, model).names if name != "battery_voltage"]
        self._threads, self._dataset, self._body_step = threads, dataset, step_s
        logs = [_log(run, dataset, age, names, step_s) for run, age in _aged(dataset) if run.name in set(runs)]
        self._logs = [log for log in logs if log.measured]
        if not self._logs:
            raise InputError("nothing to predict in these runs", file=dataset.path, field="signals")
        self.signals = tuple(name for name in names if any(name in log.measured for log in self._logs))
        self.rms = {name: self._rms(name) for name in self.signals}
        self.noise = {name: self._noise(name) for name in self.signals}
        self.step_s = float(np.median(np.concatenate([np.diff(log.time) for log in self._logs])))

    @property
    def runs(self) -> tuple[str, ...]:
        return tuple(log.run.name for log in self._logs)

    @property
    def times(self) -> tuple[Array, ...]:
        """(n,) s of each run's samples."""
        return tuple(log.time for log in self._logs)

    @property
    def ages(self) -> tuple[float, ...]:
        """s from power-on to the start of each run."""
        return tuple(log.age for log in self._logs)

    def inputs(self) -> tuple[Array, ...]:
        """Returns the inputs of each run, (n, 1) or (n, 2) V."""
        return tuple(log.inputs for log in self._logs)

    def measured(self) -> tuple[Mapping[str, Array], ...]:
        """Returns signal -> (n,) readings of each run."""
        return tuple(log.measured for log in self._logs)

    def predict(
        self, model: Model, noise: ProcessNoise, *, horizon_s: float | None = None, smooth: bool = False
    ) -> list[Predicted]:
        """Filters each run; see `vehicle.predictor.predict`. A run starts from the state of its first sample."""
        states = initial_states([(log.run, model) for log in self._logs])
        needed = [one.motor_step for one in catalogue.effects_of(model.effects) if one.motor_step > 0]
        readings = []
        for log, state in zip(self._logs, states, strict=True):
            start = {**{name: getattr(state, name) for name in state.__dataclass_fields__}, "age": log.age}
            run = OpenLoopRun(log.time, log.inputs, start, min([MOTOR_STEP_S, *needed]), self._body_step)
            readings.append(Readings(run, log.measured, self._start_sd(log.measured, model)))
        return predict(model, readings, noise, horizon_s=horizon_s, smooth=smooth, threads=self._threads)

    def _start_sd(self, measured: Mapping[str, Array], model: Model) -> dict[str, float]:
        """Returns how well the first sample tells the state, by the names of estimates."""
        radius = model.parameters.get("wheel_radius", 0.0) or 1.0
        lever = 1.0 if model.parameters.get("force_per_volt", 0.0) > 0 else radius
        scale = {"velocity": lever, "position": lever, "wheel_velocity": radius, "wheel_travel": radius}
        sds: dict[str, float] = {}
        for name in measured:
            kind, _, side = name.rpartition("_")
            kind, side = (kind, side) if side in ("left", "right") else (name, "left")
            sd = self.noise[name] / scale.get(kind, 1.0)
            if kind in ("speed", "velocity", "wheel_speed", "wheel_velocity"):
                sds[f"wheel_speed_{side}"] = sd
            elif name in RATE_OF:
                sds[f"wheel_angle_{side}"] = sd
                fastest = self.rms[name] / max(float(np.ptp(self._logs[0].time)), 1.0) / scale.get(kind, 1.0)
                sds.setdefault(f"wheel_speed_{side}", _START_SHARE * fastest)
            elif name in ("yaw_rate", "surge", "sway", "current_left", "current_right", "current"):
                sds["current_left" if name == "current" else name] = sd
            elif name == "yaw_angle":
                sds["heading"] = sd
        return sds

    def _rms(self, name: str) -> float:
        parts = [log.measured[name] for log in self._logs if name in log.measured]
        moved = [part - part[np.argmax(np.isfinite(part))] if name in SUMMED else part for part in parts]
        rms = float(np.sqrt(np.nanmean(np.concatenate(moved) ** 2)))
        return rms if rms > 0 else 1.0

    def _noise(self, name: str) -> float:
        described = self._dataset.signals.get(name)
        stated = described.noise_sd if described is not None and described.noise_sd else 0.0
        step = described.resolution / 12**0.5 if described is not None and described.resolution else 0.0
        parts = [log.run.outputs[name] for log in self._logs if name in log.run.outputs]
        estimated = float(np.median([noise_sd(part[np.isfinite(part)]) for part in parts]))
        return max(float(np.hypot(stated, step)) or estimated, _LEAST_NOISE * self.rms[name])


def _aged(dataset: Dataset) -> list[tuple[Run, float]]:
    """Returns the runs, each with the s from power-on to its start."""
    found, age = [], 0.0
    for run in dataset.runs:
        age += run.gap_s
        found.append((run, age))
        age += float(run.time[-1] - run.time[0])
    return found


def _log(run: Run, dataset: Dataset, age: float, names: Sequence[str], step_s: float) -> _Log:
    inputs = motor_inputs(run, dataset)
    outputs = {name: run.outputs[name] for name in names if _moves(run.outputs.get(name))}
    each = round(step_s / float(np.median(np.diff(run.time)))) if step_s > 0 else 1
    if each < 2 or len(run.time) < 4 * each:
        return _Log(run, run.time, inputs, age, outputs)
    kept = np.arange(0, len(run.time), each)
    held = np.add.reduceat(inputs, kept, axis=0) / np.diff(np.append(kept, len(run.time)))[:, np.newaxis]
    thinned = {
        name: _mean_before(values, kept, each) if name.startswith("accel") else values[kept]
        for name, values in outputs.items()
    }
    return _Log(run, run.time[kept], held, age, thinned)


def _moves(values: Array | None) -> bool:
    """Whether a signal tells anything in a run: a column that never changes is blank, frozen, or at rest."""
    known = values[np.isfinite(values)] if values is not None else np.empty(0)
    return len(known) > 1 and bool(np.ptp(known) > 0)


def _mean_before(values: Array, kept: NDArray[np.intp], each: int) -> Array:
    """Returns the means of the `each` values up to each of `kept`."""
    summed = np.concatenate([[0.0], np.cumsum(values)])
    first = np.maximum(kept - each + 1, 0)
    return np.asarray((summed[kept + 1] - summed[first]) / (kept + 1 - first))
