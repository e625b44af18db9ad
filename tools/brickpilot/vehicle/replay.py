"""Replays measured runs: simulates a model from the inputs of each run alone.

These are free runs: no measured output is fed back. A run starts from the state of its first sample (`start_state`).
Age, charge and heat carry over from run to run in the file's order, with the stated pauses between the runs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.input_timing import held_back, later, means_over_grids, scaled
from brickpilot.data.motion import run_of
from brickpilot.vehicle import plant, start_state
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from brickpilot.vehicle.start_state import GEOMETRY

Array = NDArray[np.float64]
Outputs = Mapping[str, Array]
_Own = tuple[tuple[str, float], ...]  # the values that a model has for one run alone: (name in `RUN_KINDS`, value) each

_MOST_BEGUN = 64  # largest number of `_Begun` objects that are kept
_SLIDING_S = 0.003  # s: the longest motor step that is short enough when a skid steer's contacts begin to slide


@dataclass(frozen=True)
class Mark:
    """A sample at which a simulated run continues from `measured`: signal -> measured value, SI."""

    sample: int
    measured: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Begun:
    """Runs, each with its start state under one model.

    Attributes:
        requests: (runs,) the runs as the compiled plant reads them.
        runs: holds the arrays that `requests` points to.
    """

    requests: NDArray[np.void]
    runs: tuple[OpenLoopRun, ...]


@dataclass(eq=False)
class Replay:
    """A data set whose runs can be simulated under any model.

    Attributes:
        dataset: the data set as `reading.read` returns it.
        motor_step, body_step: upper limits of the plant's steps, s; 0: the plant's limits. Models with a fast effect
            get a shorter motor step.
        inputs: run -> (n, 1) or (n, 2) V; empty: the inputs of the data set.
        whole: window -> time and inputs of the whole run from which the window was cut; a model's values for single
            runs change these inputs. Empty: the time and inputs of each run in `dataset`.
    """

    dataset: Dataset
    motor_step: float = 0.0
    body_step: float = 0.0
    inputs: Mapping[str, Array] = field(default_factory=dict)
    whole: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.inputs = self.inputs or {run.name: motor_inputs(run, self.dataset) for run in self.dataset.runs}
        self.whole = self.whole or {run.name: (run.time, self.inputs[run.name]) for run in self.dataset.runs}
        self._begun: dict[tuple[object, ...], _Begun] = {}
        self._acting: dict[tuple[_Own, tuple[str, ...]], list[OpenLoopRun]] = {}  # runs with their changed inputs

    def simulate(
        self,
        models: Sequence[Model],
        *,
        only: Collection[str] | None = None,
        threads: int = 2,
        signals: Collection[str] | None = None,
        marks: Mapping[str, Sequence[Mark]] | None = None,
    ) -> list[dict[str, Outputs]]:
        """Simulates the runs under each model, and returns, for each model, run name -> outputs.

        Args:
            only: the runs that are wanted; None: all. If charge or heat carries over, earlier runs are simulated too.
            signals: the outputs to keep; None: all that the vehicle has.
            marks: run name -> the samples at which the simulation starts anew from measured values. None: at no sample.
                Unmeasured values stay as simulated, and so do delayed commands, heat and charge.
        """
        names = plant.wanted_names(signals)
        rows, (places, _) = self.stacked(models, only, signals, threads, marks), self._places(names)
        wanted = [run for run in self.dataset.runs if only is None or run.name in only]

        def outputs(row: Array, run: Run) -> Outputs:
            own = row[places[run.name] : places[run.name] + len(names) * len(run.time)]
            return plant.by_signal(names, own.reshape(len(names), -1))

        return [{run.name: outputs(row, run) for run in wanted} for row in rows]

    def layout(self, signals: Collection[str]) -> tuple[dict[tuple[str, str], int], int]:
        """Returns (run, signal) -> index of the signal's first sample in a row of `stacked`; and the length of a row.

        A row has room for all runs; the values of runs that are not simulated are undefined.
        """
        names = plant.wanted_names(signals)
        places, length = self._places(names)
        runs = self.dataset.runs
        return {(r.name, name): places[r.name] + k * len(r.time) for r in runs for k, name in enumerate(names)}, length

    def _places(self, names: Sequence[str]) -> tuple[dict[str, int], int]:
        """Returns run -> index of the run's first output in a row of the outputs `names`; and the length of a row."""
        ends = np.cumsum([0, *(len(names) * len(run.time) for run in self.dataset.runs)]).tolist()
        return {run.name: end for run, end in zip(self.dataset.runs, ends, strict=False)}, ends[-1]

    def stacked(
        self,
        models: Sequence[Model],
        only: Collection[str] | None,
        signals: Collection[str] | None,
        threads: int,
        marks: Mapping[str, Sequence[Mark]] | None = None,
    ) -> Array:
        """Simulates as `simulate` does, and returns the outputs, (models, length), in the order of `layout`.

        If charge or heat carries over, a model's runs are simulated one after the other, else all at once.
        """
        models, names = [_with_sums(model, self.dataset.runs) for model in models], plant.wanted_names(signals)
        places, length = self._places(names)
        rows = np.empty((len(models), length))
        restarts_of = self._restarts(models, marks or {})
        carrying = [index for index, model in enumerate(models) if _needs(tuple(model.effects), model.vehicle)[0]]
        others = [index for index in range(len(models)) if index not in carrying]
        wanted = [(run, age) for run, age in self.aged if only is None or run.name in only]
        until = self.aged.index(wanted[-1]) + 1 if wanted else 0
        carried = np.zeros(len(carrying), dtype=plant.layout("bp_state"))
        for chosen, batch in [*((carrying, [aged]) for aged in self.aged[:until]), (others, wanted)]:
            if not chosen or not batch:
                continue
            own = [models[index] for index in chosen]
            requests, begun = self._starting(batch, own)
            if chosen is carrying:
                for name in ("charge", "heat"):
                    requests["initial"][name] = carried[name]
            runs = [run.name for run, _ in batch]
            for (index, run), restarts in restarts_of.items():
                if index in chosen and run in runs:
                    at = runs.index(run), chosen.index(index)
                    requests["restart"][at] = restarts.ctypes.data
                    requests["restart_count"][at] = len(restarts)
            starts = np.add.outer([places[run] for run in runs], np.array(chosen) * length)
            last = plant.simulate_into(rows.reshape(-1), starts, own, requests, names, threads)
            del begun  # until here, the requests needed the arrays that `begun` keeps
            if chosen is carrying:
                carried = last[0]
        return rows

    def _restarts(
        self, models: Sequence[Model], marks: Mapping[str, Sequence[Mark]]
    ) -> dict[tuple[int, str], NDArray[np.void]]:
        """Returns (index of the model, run) -> (marks,) `bp_restart`: samples and states where the run continues."""
        restarts = {}
        for run, age in self.aged:
            if not (of_run := marks.get(run.name)):
                continue
            samples = np.array([mark.sample for mark in of_run])
            known = _columns([mark.measured for mark in of_run])
            ages = age + run.time[samples] - run.time[0]
            for index, own in enumerate(start_state.states(models, known, {}, ages, restart=True)):
                rows = restarts[index, run.name] = np.zeros(len(own), dtype=plant.layout("bp_restart"))
                rows["sample"], rows["state"] = samples, own
        return restarts

    @cached_property
    def aged(self) -> list[tuple[Run, float]]:
        """The runs, each with its age: the time from power-on to the start of the run, s."""
        runs = self.dataset.runs
        lasted = [0.0, *(float(run.time[-1] - run.time[0]) for run in runs)]
        ages = np.cumsum([run.gap_s + before for run, before in zip(runs, lasted, strict=False)])
        return list(zip(runs, ages.tolist(), strict=True))

    @cached_property
    def _first_samples(self) -> dict[str, dict[str, float]]:
        """Run -> signal -> its measured value at the first sample."""
        return {run.name: start_state.first_sample(run) for run in self.dataset.runs}

    @cached_property
    def _plain(self) -> dict[str, OpenLoopRun]:
        """Run -> the run with its inputs as in the data, without a model's values for single runs."""
        return {run.name: OpenLoopRun(run.time, self.inputs[run.name]) for run in self.dataset.runs}

    def nudged(self, signal: str, by: float) -> Replay:
        """Returns the same data with `by` added to `signal` in the first sample of each run."""
        runs = []
        for run in self.dataset.runs:
            if signal in run.outputs:
                values = np.array(run.outputs[signal])
                values[0] += by
                run = dataclasses.replace(run, outputs={**run.outputs, signal: values})
            runs.append(run)
        return dataclasses.replace(self, dataset=dataclasses.replace(self.dataset, runs=tuple(runs)))

    def _starting(
        self, batch: Sequence[tuple[Run, float]], models: Sequence[Model]
    ) -> tuple[NDArray[np.void], list[_Begun]]:
        """Returns (runs, models): a request for each run under each model. `batch`: the runs with their ages.

        Each run starts from its first sample. The method also returns the `_Begun` objects that hold the arrays of
        these requests. Models with the same start states share a `_Begun`.
        """
        if len(self._begun) > _MOST_BEGUN:
            self._begun, self._acting = {}, {}  # new dictionaries, as another thread may still read the old ones
        names, begun = tuple(run.name for run, _ in batch), self._begun
        keys: list[tuple[object, ...]] = [
            (names, _start_key(model), tuple(_own_values(run, model) for run, _ in batch) if model.by_run else ())
            for model in models
        ]
        new = {key: model for key, model in zip(keys, models, strict=True) if key not in begun}
        made = dict(zip(new, self._begin(batch, [*new.values()]), strict=True)) if new else {}
        begun |= made
        chosen = [begun[key] for key in keys]
        requests = np.empty((len(batch), len(models)), dtype=plant.layout("bp_run"))
        for column, under_model in enumerate(chosen):
            requests[:, column] = under_model.requests
        return requests, chosen

    def _begin(self, batch: Sequence[tuple[Run, float]], models: Sequence[Model]) -> Iterator[_Begun]:
        """Yields, for each model, the runs with their states at the start."""
        known = _columns([self._first_samples[run.name] for run, _ in batch])
        stated = _columns([run.initial or {} for run, _ in batch])
        ages = np.array([age for _, age in batch])
        for model, own in zip(models, start_state.states(models, known, stated, ages), strict=True):
            runs = [self._plain[run.name] for run, _ in batch] if not model.by_run else self._driven(batch, model)
            columns = 1 if model.vehicle == "motor" else 2
            requests = np.frombuffer(bytearray().join(run.as_c(columns) for run in runs), plant.layout("bp_run"))
            requests["initial"] = own
            requests["initial"]["age"], requests["initial"]["rest"] = ages, [run.gap_s for run, _ in batch]
            requests["motor_step"] = min([self.motor_step, *_needs(tuple(model.effects), model.vehicle)[1]])
            requests["body_step"] = self.body_step
            yield _Begun(requests, tuple(runs))

    def _driven(self, batch: Sequence[tuple[Run, float]], model: Model) -> list[OpenLoopRun]:
        """Returns the runs with the inputs that result from the model's values for these runs."""
        together: dict[tuple[str, _Own], list[Run]] = {}  # windows cut from one run share that run's values
        for run, _ in batch:
            if own := _own_values(run, model):
                together.setdefault((run_of(run.name), own), []).append(run)
        driven_runs, acting = dict(self._plain), self._acting
        for (_, own), runs in together.items():
            key = own, tuple(run.name for run in runs)
            if key not in acting:  # models that differ in no value of a run have equal inputs
                time, driven = self.whole[runs[0].name]
                for kind, value in own:
                    driven = RUN_KINDS[kind].change(time, driven, value)
                made = means_over_grids(time, driven, [run.time for run in runs])
                acting[key] = [OpenLoopRun(run.time, inputs) for run, inputs in zip(runs, made, strict=True)]
            driven_runs |= dict(zip(key[1], acting[key], strict=True))
        return [driven_runs[run.name] for run, _ in batch]


def _columns(rows: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Returns signal -> (rows,), NaN where a row does not have the signal."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows], dtype=np.float64) for name in names}


@cache
def _needs(effects: tuple[str, ...], vehicle: str) -> tuple[bool, tuple[float, ...]]:
    """Returns whether these effects carry charge or heat over from run to run, and limits of the motor step, s."""
    infos = catalogue.effects_of(effects)
    steps = tuple(effect.motor_step for effect in infos if effect.motor_step > 0)
    return any(effect.carries_over for effect in infos), (*steps, _SLIDING_S) if vehicle == "skid_steer" else steps


def _own_values(run: Run, model: Model) -> _Own:
    """Returns (name in `RUN_KINDS`, value) of each nonzero value that the model has for this run."""
    name = run_of(run.name)
    return tuple((kind, values[name]) for kind, values in model.by_run.items() if values.get(name))


def _with_sums(model: Model, runs: Sequence[Run]) -> Model:
    """Returns the model without effects whose size a run changes: the values of runs then hold the sums."""
    for effect, parameter, kind in _sums(tuple(model.effects)):
        if own := model.by_run.get(kind):
            common = model.effects[effect][parameter]
            whole = {name: max(common + own.get(name, 0.0), 0.0) for name in (run_of(run.name) for run in runs)}
            effects = {name: table for name, table in model.effects.items() if name != effect}
            model = dataclasses.replace(model, effects=effects, by_run={**model.by_run, kind: whole})
    return model


@cache
def _sums(effects: tuple[str, ...]) -> tuple[tuple[str, str, str], ...]:
    """Returns (effect, parameter, name in `RUN_KINDS`) for each parameter to which a value of each run is added."""
    return tuple(
        (effect.name, info.name, info.run_value)
        for effect in catalogue.effects_of(effects)
        for info in effect.parameters
        if info.run_value
    )


def _start_key(model: Model) -> tuple[object, ...]:
    """Returns the values of a model that determine the start state of runs, without its values for single runs."""
    sensors = tuple((name, *model.effects[name].items()) for name in start_state.sensor_effects(model))
    steps = _needs(tuple(model.effects), model.vehicle)[1]
    return model.vehicle, steps, sensors, *(model.parameters.get(name) for name in GEOMETRY)


@dataclass(frozen=True)
class RunKind:
    """One kind of value that may differ from run to run: the gain or the timing of the inputs at the motors.

    Attributes:
        words: the quantity that differs, as the subject of a sentence.
        unit: the SI unit of the value; "1": the value is a share.
        mechanism: the mechanism that causes the difference, as for an effect.
        change: function of time (n,), inputs (n, columns) and value that returns the changed inputs.
        sd: the prior sd of a value: how far the value of a run usually is from 0. A held-out run has the value 0.
        low, high: the range of values.
        tried: values from which fits start, because a value near 0 has no influence; empty: fits start from `sd`.
    """

    words: str
    unit: str
    mechanism: str
    change: Callable[[Array, Array, float], Array]
    sd: float
    low: float
    high: float
    tried: tuple[float, ...] = ()


_START = "The time from the start of a recording to the first input that acts"
_TRIED_DELAYS = tuple(0.05 * k for k in range(-2, 7) if k)
_TRIED_STARTS = tuple(0.05 * k for k in range(1, 8))

RUN_KINDS: Mapping[str, RunKind] = {
    "supply_gain": RunKind("The voltage that reaches the motors", "1", "supply", scaled, 0.1, -0.5, 0.5),
    "delay": RunKind("The time from a command to its effect", "s", "timing", later, 0.1, -0.5, 0.5, _TRIED_DELAYS),
    "start": RunKind(_START, "s", "timing", held_back, 0.1, -0.5, 0.5, _TRIED_STARTS),
}
"""Runs differ because the battery's charge and the link's delay change, or a log starts before its commands act.

A `start` value is added to the model's start delay; a negative sum counts as 0.
"""


ADDED = frozenset({"viscous_friction"})
"""Nominal parameters that may be 0. So a recording's difference is an amount that is added, not a relative change."""


def by_recording(
    models: Sequence[Model], dataset: Dataset, runs: Collection[str]
) -> Iterator[tuple[list[Model], frozenset[str]]]:
    """Yields, for each recording, the models with the recording's values, and those of `runs` that belong to it.

    Recordings without own values are yielded as one. A model's `by_run` holds, under a recording's name, how the
    recording differs from the model: for a name in `RUN_KINDS`, the value itself; for a nominal parameter, the relative
    change; for a parameter in `ADDED` or an "effect.parameter", the amount to add, SI.
    """
    differing = {name for model in models for table in model.by_run.values() for name in table}
    recording_of = {run.name: run.recording for run in dataset.runs if run.name in runs}
    recording_of = {run: name if name in differing else "" for run, name in recording_of.items()}
    for recording in dict.fromkeys(recording_of.values()):
        own = frozenset(run for run, name in recording_of.items() if name == recording)
        yield [in_recording(model, recording, own) for model in models] if differing else list(models), own


def in_recording(model: Model, recording: str, runs: Collection[str]) -> Model:
    """Returns the model with its values in `recording`, without effects of size 0. `runs`: the recording's runs."""
    own = {kind: table[recording] for kind, table in model.by_run.items() if recording in table}
    kept = {kind: table for kind, table in model.by_run.items() if kind in RUN_KINDS and recording not in table}
    parameters, effects = dict(model.parameters), {name: dict(table) for name, table in model.effects.items()}
    for kind, value in own.items():
        effect, _, name = kind.rpartition(".")
        if kind in RUN_KINDS:
            kept[kind] = dict.fromkeys(map(run_of, runs), value)
            continue
        rows = catalogue.effect(effect).parameters if effect else catalogue.parameters()
        info = next(info for info in rows if info.name == name)
        table = effects[effect] if effect else parameters
        added = value if effect or name in ADDED else value * table[name]
        table[name] = min(max(table[name] + added, info.minimum), info.maximum)
    for kind in model.by_run:
        effect = kind.partition(".")[0]
        if effect in effects and not any(
            effects[effect][info.name] for info in catalogue.effect(effect).parameters if info.role in ("size", "limit")
        ):
            del effects[effect]
    return dataclasses.replace(model, parameters=parameters, effects=effects, by_run=kept)
