"""Replays measured runs: simulates a model from each run's own inputs alone.

These are free runs: no measured output is fed back. A run starts from the state of its first sample (`start_state`).
Age, charge and heat carry over from run to run in the file's order, with the stated pauses between them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.fit import start_state
from brickpilot.fit.start_state import run_of
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, Simulated, State

Array = NDArray[np.float64]
Outputs = Mapping[str, Array]
Restarts = Mapping[str, Sequence[tuple[int, State]]]


@dataclass(frozen=True)
class Mark:
    """A sample at which a simulated run goes on from what was measured: signal -> value, SI."""

    sample: int
    measured: Mapping[str, float]


class Replay:
    """A data set whose runs can be simulated under any model.

    Args:
        dataset: as `dataset.read` gives it.
        motor_step, body_step: upper limits of the plant's steps, s; 0: the plant's own. Models with a fast effect get a
            shorter motor step.
        inputs: run -> (n, 1) or (n, 2) V; None: the inputs of the data set.
        whole: run -> time and inputs of the whole run that it was cut from, for values of runs; None: its own.
    """

    def __init__(
        self,
        dataset: Dataset,
        *,
        motor_step: float = 0.0,
        body_step: float = 0.0,
        inputs: Mapping[str, Array] | None = None,
        whole: Mapping[str, tuple[Array, Array]] | None = None,
    ) -> None:
        self.dataset = dataset
        self.inputs = dict(inputs) if inputs else {run.name: motor_inputs(run, dataset) for run in dataset.runs}
        self.whole = whole or {run.name: (run.time, self.inputs[run.name]) for run in dataset.runs}
        self._steps = (motor_step, body_step)

    def simulate(
        self,
        models: Sequence[Model],
        *,
        only: Collection[str] | None = None,
        threads: int = 2,
        signals: Collection[str] | None = None,
        marks: Mapping[str, Sequence[Mark]] | None = None,
    ) -> list[dict[str, Outputs]]:
        """Simulates the runs under each model, and returns for each model run name -> outputs.

        Args:
            only: the runs that are wanted; None: all. Where charge or heat carries over, the runs before are simulated
                too.
            signals: the outputs to keep; None: all that the vehicle has.
            marks: run name -> the samples at which the run goes on from what was measured: it is then a row of
                open-loop windows. What was not measured stays as simulated, and so do commands on their way, heat and
                charge.
        """
        simulated = self._simulate(models, only, threads, signals, self._restarts(models, marks or {}))
        return [{name: run.outputs for name, run in runs.items()} for runs in simulated]

    def stacked(
        self,
        models: Sequence[Model],
        *,
        only: Collection[str],
        threads: int = 2,
        signals: Collection[str] | None = None,
    ) -> list[Array]:
        """Simulates as `simulate` does, and returns for each model its outputs in one row: see `layout`."""
        runs = [run.name for run in self.dataset.runs if run.name in only]
        simulated = self._simulate(models, only, threads, signals)
        return [np.concatenate([one[name].columns.ravel() for name in runs]) for one in simulated]

    def layout(self, only: Collection[str], signals: Collection[str]) -> tuple[dict[tuple[str, str], int], int]:
        """Returns (run, signal) -> the place of its first sample in a row of `stacked`; and the length of a row."""
        places, place = {}, 0
        for run in self.dataset.runs:
            for signal in plant.wanted_names(frozenset(signals)) if run.name in only else ():
                places[run.name, signal] = place
                place += len(run.time)
        return places, place

    def _simulate(
        self,
        models: Sequence[Model],
        only: Collection[str] | None,
        threads: int,
        signals: Collection[str] | None,
        restarts: Sequence[Restarts] | None = None,
    ) -> list[dict[str, Simulated]]:
        """Returns for each model run name -> what was simulated.

        Models whose charge or heat carries over need one run after the other; the others all runs at once.
        """
        results: list[dict[str, Simulated]] = [{} for _ in models]
        runs = self._aged(only)
        carry_over = [
            index
            for index, model in enumerate(models)
            if any(effect.carries_over for effect in catalogue.effects_of(model.effects))
        ]
        others = [index for index in range(len(models)) if index not in carry_over]
        batches = [(carry_over, [one]) for one in runs]
        batches.append((others, [one for one in runs if only is None or one[0].name in only]))
        steps = [self._motor_step(model) for model in models]
        carried = [State()] * len(models)
        for chosen, batch in batches:
            if not chosen:
                continue
            pairs = [(run, age, index) for run, age in batch for index in chosen]
            measured = start_state.initial_states([(run, models[index]) for run, _, index in pairs])
            jobs, ready = [], dict[tuple[int, int], State]()
            for (run, age, index), state in zip(pairs, measured, strict=True):
                left = carried[index]
                start = ready.get((id(state), id(left)))
                if start is None:
                    start = dataclasses.replace(state, age=age, charge=left.charge, heat=left.heat, rest=run.gap_s)
                    ready[id(state), id(left)] = start
                one_run = self._open_loop(run, start, steps[index], models[index])
                if restarts is not None and run.name in restarts[index]:
                    one_run = dataclasses.replace(one_run, restarts=restarts[index][run.name])
                jobs.append((models[index], one_run))
            for (run, _, index), one in zip(pairs, plant.simulate(jobs, threads, signals=signals), strict=True):
                results[index][run.name] = one
                if chosen is carry_over:
                    carried[index] = one.final
        return results

    def _restarts(self, models: Sequence[Model], marks: Mapping[str, Sequence[Mark]]) -> Sequence[Restarts] | None:
        """Returns for each model run name -> (sample, state to go on from); None without marks."""
        if not marks:
            return None
        ages = {run.name: age for run, age in self._aged(None)}
        places, readings = [], []
        for run in self.dataset.runs:
            for mark in marks.get(run.name, ()):
                age = ages[run.name] + float(run.time[mark.sample] - run.time[0])
                for index, model in enumerate(models):
                    places.append((index, run.name, mark.sample))
                    readings.append(start_state.reading(mark.measured, model, age=age))
        found: list[dict[str, list[tuple[int, State]]]] = [{} for _ in models]
        for (index, name, sample), state in zip(places, start_state.restarts(readings), strict=True):
            found[index].setdefault(name, []).append((sample, state))
        return found

    def _aged(self, only: Collection[str] | None) -> list[tuple[Run, float]]:
        """Returns the runs up to the last of `only`, each with the s from power-on to its start."""
        runs = self.dataset.runs
        ages = np.cumsum([run.gap_s + before for run, before in zip(runs, [0.0, *map(_duration, runs)], strict=False)])
        wanted = [index for index, run in enumerate(runs) if only is None or run.name in only]
        return [(runs[index], float(ages[index])) for index in range(max(wanted) + 1)]

    def with_whole(self, whole: Mapping[str, tuple[Array, Array]]) -> Replay:
        """Returns the same windows, which know time and inputs of the whole runs that they were cut from."""
        motor_step, body_step = self._steps
        return Replay(self.dataset, motor_step=motor_step, body_step=body_step, inputs=self.inputs, whole=whole)

    def nudged(self, signal: str, by: float) -> Replay:
        """Returns the same data with `by` added to `signal` in the first sample of each run."""
        runs = []
        for run in self.dataset.runs:
            values = np.array(run.outputs.get(signal, [0.0]))
            values[0] += by
            runs.append(
                dataclasses.replace(run, outputs={**run.outputs, signal: values}) if signal in run.outputs else run
            )
        return Replay(
            dataclasses.replace(self.dataset, runs=tuple(runs)),
            motor_step=self._steps[0],
            body_step=self._steps[1],
            inputs=self.inputs,
            whole=self.whole,
        )

    def _motor_step(self, model: Model) -> float:
        """Returns the upper limit of the motor step, s: that of the replay, or of an effect that is faster."""
        needed = [one.motor_step for one in catalogue.effects_of(model.effects) if one.motor_step > 0]
        return min([self._steps[0], *needed])

    def _open_loop(self, run: Run, start: State, motor_step: float, model: Model) -> OpenLoopRun:
        inputs = self.inputs[run.name]
        own = {kind: one[run_of(run.name)] for kind, one in model.by_run.items() if one.get(run_of(run.name))}
        if own:
            time, driven = self.whole[run.name]
            for kind, value in own.items():
                driven = RUN_KINDS[kind].change(time, driven, value)
            inputs = mean_over_steps(time, driven, run.time)
        return OpenLoopRun(
            time=run.time,
            inputs=inputs,
            initial=start,
            motor_step=motor_step,
            body_step=self._steps[1],
        )


def _duration(run: Run) -> float:
    return float(run.time[-1] - run.time[0])


def mean_over_steps(time: Array, driven: Array, grid: Array) -> Array:
    """Returns (grid, columns): the mean of each input over each step of the grid. Inputs hold from sample to sample.

    Args:
        time: (n,) s, when each row of `driven` begins to act; what acts before it is 0.
        driven: (n, columns) V; NaN: the motor floats.
        grid: (m,) s. Its last row is the last input.
    """
    held = np.where(np.isnan(driven), 0.0, driven)
    summed = np.vstack([np.zeros(driven.shape[1]), np.cumsum(held[:-1] * np.diff(time)[:, np.newaxis], axis=0)])
    at_grid = np.column_stack([np.interp(grid, time, column) for column in summed.T])
    means = np.vstack([np.diff(at_grid, axis=0) / np.diff(grid)[:, np.newaxis], held[-1]])
    floats = np.isnan(driven[np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)])
    means[floats] = np.nan
    return means


def later(time: Array, driven: Array, delay_s: float) -> Array:
    """Returns (n, columns): inputs that act `delay_s` s later, or earlier below 0, at the same samples.

    Before the first input arrives, 0 V act; the last one holds.
    """
    beyond = max(float(time[-1]), float(time[-1]) + delay_s) + 1.0
    arrives = np.append(time + delay_s, beyond)
    held = np.vstack([driven, driven[-1]])
    return mean_over_steps(arrives, held, np.append(time, beyond))[:-1]


def held_back(time: Array, driven: Array, held_s: float) -> Array:
    """Returns (n, columns): inputs that are 0 V in the first `held_s` s of the run; later ones act in time."""
    steps = np.diff(time, append=2 * time[-1] - time[-2])
    missing = np.clip((held_s - (time - time[0])) / steps, 0.0, 1.0)[:, np.newaxis]
    return np.where(missing >= 1, 0.0, (1 - missing) * driven)


@dataclass(frozen=True)
class RunKind:
    """One kind of value that a run may have of its own: what of its inputs reaches the motors, and when.

    Attributes:
        words: what differs, as the subject of a sentence.
        unit: SI; 1 is a share.
        mechanism: as of an effect.
        change: (time (n,), inputs (n, columns), value) -> inputs.
        sd: how much runs of one machine usually differ: the prior of a value. A held-out run has 0.
        low, high: the range of values.
        tried: values from which a fit may start, as nothing depends on a small one.
    """

    words: str
    unit: str
    mechanism: str
    change: Callable[[Array, Array, float], Array]
    sd: float
    low: float
    high: float
    tried: tuple[float, ...] = ()


RUN_KINDS: Mapping[str, RunKind] = {
    "supply_gain": RunKind(
        "The voltage that reaches the motors",
        "1",
        "supply",
        lambda _, driven, value: driven * (1 + value),
        0.1,
        -0.5,
        0.5,
    ),
    "delay": RunKind(
        "The time from a command to its effect",
        "s",
        "timing",
        later,
        0.1,
        -0.5,
        0.5,
        tuple(0.05 * k for k in range(-2, 7) if k),
    ),
    "start": RunKind(
        "The time from the start of a recording to the first input that acts",
        "s",
        "timing",
        held_back,
        0.1,
        0.0,
        0.5,
        tuple(0.05 * k for k in range(1, 8)),
    ),
}
"""A battery's charge changes the gain of a run, a link its delay; a log may start before its command does."""
