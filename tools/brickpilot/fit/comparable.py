"""A data set as every comparison takes it: the same samples, the same roles, and the same start of each run."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data import holdout
from brickpilot.data.audit import against_model
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit import parameters
from brickpilot.fit.replay import Replay
from brickpilot.fit.start_state import with_averaged_starts, with_rates
from brickpilot.vehicle.model import Model, output_names

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparable:
    """Measured runs that are ready to be compared with a model.

    Attributes:
        measured: the data set as read, without channels that contradict what it states.
        started: the same with the state of each run's start estimated from several samples, and with the velocity of a
            motor beside its position. It is what is simulated.
        roles: of the runs, and of stretches of them.
    """

    measured: Dataset
    started: Dataset
    roles: holdout.Roles

    def part(self, role: str) -> Dataset:
        """Returns `measured` without the samples of stretches that have another role."""
        if not self.roles.stretches:
            return self.measured
        runs = tuple(self.roles.samples(run, role) for run in self.measured.runs)
        return dataclasses.replace(self.measured, runs=runs)


def comparable(dataset: Dataset) -> Comparable:
    """Returns a data set as `compare`, `calibrate` and `discover` compare it with a model."""
    try:
        wrong = contradictions(dataset)
    except SimulationError:  # nothing contradicts values with which nothing can be simulated
        wrong = ()
    measured = against_model.leave_out(dataset, wrong)
    inputs = {run.name: motor_inputs(run, measured) for run in measured.runs}
    return Comparable(measured, started(measured, inputs), holdout.assign(measured, inputs, stretches=True))


def started(measured: Dataset, inputs: Mapping[str, Array]) -> Dataset:
    """Returns the data set to simulate. `inputs`: run -> (n, 1) or (n, 2) V. See `Comparable`."""
    return with_averaged_starts(with_rates(measured) if measured.vehicle == "motor" else measured, inputs)


def contradictions(dataset: Dataset) -> tuple[Fault, ...]:
    """Returns channels that no machine with the stated values can have measured: data faults, not effects.

    Raises:
        SimulationError: the plant diverges with the stated values.
    """
    stated = parameters.plan(dataset)
    measured = {name for run in dataset.runs for name in run.outputs}
    simulated = Replay(dataset).simulate([stated.at(stated.start())], signals=measured)[0]
    return against_model.contradictions(dataset, simulated)


_LARGEST = 1e30  # SI: far above anything measured, far below where squares overflow


@dataclass(frozen=True)
class ComparedSignals:
    """The measured signals that the model gives, and a note on those it does not give."""

    names: tuple[str, ...]
    notes: tuple[str, ...]


def is_compared(signal: str, outputs: Container[str], model: Model) -> bool:
    """Whether a measured signal is compared with the model, which gives `outputs`.

    The battery's voltage is an input of the model, unless an effect of the model loads the battery.
    """
    if signal != "battery_voltage":
        return signal in outputs
    return any(effect.acts_on == "supply" for effect in catalogue.effects_of(model.effects))


def compared_signals(dataset: Dataset, model: Model) -> ComparedSignals:
    """Finds the measured signals that the model gives.

    Raises:
        InputError: there is none, or all its samples are blank, or one is too large to be a measurement.
    """
    given = output_names(model)
    measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    names = tuple(name for name in measured if is_compared(name, given, model))
    largest = -1.0
    for run in dataset.runs:
        for name in (one for one in names if one in run.outputs):
            known = np.abs(run.outputs[name][np.isfinite(run.outputs[name])])
            largest = max(largest, float(known.max(initial=-1.0)))
            if largest > _LARGEST:
                raise InputError(f"{largest:g} is too large to be a measurement", file=run.file, field=name)
    others = [name for name in measured if name not in given]
    if largest < 0:
        reason = f"; the model of this vehicle does not give {', '.join(others)}" if others else ""
        message = f"nothing to compare: no signal that the model gives has a value{reason}"
        raise InputError(message, file=dataset.path, field="signals")
    note = f"Not compared, because the model of this vehicle does not give it: {', '.join(others)}."
    return ComparedSignals(names, (note,) if others else ())


MANY, ENOUGH = 100_000, 30_000
"""Samples of fit runs above which some are chosen, and how many. The model's own error, and not the number of samples,
then limits how well a value is known. A dozen runs of 10 s at 500 Hz have 60,000, and all of them are fitted."""


def enough_to_fit(dataset: Dataset) -> tuple[Dataset, str | None]:
    """Returns a data set of some fit runs and a note; all of it and None where these have no more than `MANY` samples.

    Runs are taken in turn from each manoeuvre and direction, that of the largest input first, the others evenly over
    the file's order. Pauses grow by what is left out, so that a run is as old as before.
    """
    inputs = {run.name: motor_inputs(run, dataset) for run in dataset.runs}
    fitted = set(holdout.assign(dataset, inputs, stretches=True).fit())
    runs = [run for run in dataset.runs if run.name in fitted]
    if sum(len(run.time) for run in runs) <= MANY:
        return dataset, None
    groups: dict[str, list[tuple[float, Run]]] = defaultdict(list)
    for run in runs:
        driven = np.nan_to_num(inputs[run.name])
        groups[holdout.manoeuvre(driven)].append((float(np.sqrt(np.mean(driven**2))), run))
    chosen, samples = set[str](), 0
    queues = [_in_turn(group) for group in groups.values()]
    while samples < ENOUGH:
        for queue in queues:
            if queue:
                run = queue.pop(0)
                chosen.add(run.name)
                samples += len(run.time)
    note = (
        f"The nominal values are fitted to {len(chosen)} of {len(runs)} fit runs, {samples} samples: more tell no more."
    )
    return dataclasses.replace(dataset, runs=_kept(dataset, chosen)), note


def _in_turn(group: list[tuple[float, Run]]) -> list[Run]:
    """Returns the runs of one manoeuvre: that of the largest input, then halves, quarters and so on of the others."""
    largest = max(range(len(group)), key=lambda index: group[index][0])
    others = [run for index, (_, run) in enumerate(group) if index != largest]
    bits = max(len(others) - 1, 1).bit_length()
    order = sorted(range(len(others)), key=lambda index: int(f"{index:0{bits}b}"[::-1], 2))
    return [group[largest][1], *(others[index] for index in order)]


def _kept(dataset: Dataset, chosen: set[str]) -> tuple[Run, ...]:
    """Returns the chosen runs, stated as fit runs, each as old as before."""
    kept, left_out = [], 0.0
    for run in dataset.runs:
        if run.name in chosen:
            kept.append(dataclasses.replace(run, role="fit", gap_s=run.gap_s + left_out, replicate_of=None))
            left_out = 0.0
        else:
            left_out += run.gap_s + float(run.time[-1] - run.time[0])
    return tuple(kept)
