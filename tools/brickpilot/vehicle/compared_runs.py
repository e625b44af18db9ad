"""The data that are compared with a model. Every comparison uses the same runs, roles and start states."""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data import holdout
from brickpilot.data.audit import against_model
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.data.motion import with_averaged_starts, with_rates
from brickpilot.errors import InputError, SimulationError
from brickpilot.vehicle.model import Model, of_dataset, output_names
from brickpilot.vehicle.replay import Replay

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparable:
    """Measured runs that are ready to be compared with a model.

    Attributes:
        measured: the data set as read, without channels that contradict the stated values.
        started: the data set to simulate: as `measured`, but each run's first sample is estimated from several
            samples, and a motor has a velocity beside its position.
        roles: the roles of the runs, and of stretches of runs.
    """

    measured: Dataset
    started: Dataset
    roles: holdout.Roles

    def part(self, role: str) -> Dataset:
        """Returns `measured`. If stretches are held out, the samples that do not have the role `role` are blank."""
        if not self.roles.stretches:
            return self.measured
        runs = tuple(self.roles.samples(run, role) for run in self.measured.runs)
        return dataclasses.replace(self.measured, runs=runs)


def comparable(dataset: Dataset) -> Comparable:
    """Returns a data set in the form in which `compare`, `calibrate` and `discover` compare it with a model."""
    try:
        wrong = contradictions(dataset)
    except SimulationError:  # no simulation, so no channel can contradict it
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
    measured = {name for run in dataset.runs for name in run.outputs}
    simulated = Replay(dataset).simulate([of_dataset(dataset)], signals=measured)[0]
    return against_model.contradictions(dataset, simulated)


_LARGEST = 1e30  # largest size of a sample, SI: far above any measurement; its square does not overflow


@dataclass(frozen=True)
class ComparedSignals:
    """The measured signals that the model gives, and notes on the other signals."""

    names: tuple[str, ...]
    notes: tuple[str, ...]


def is_compared(signal: str, outputs: Container[str], model: Model) -> bool:
    """Whether a measured signal is compared with the model. `outputs`: the signals that the model gives.

    The battery's voltage is an input of the model. It is compared only if an effect of the model acts on the supply.
    """
    if signal != "battery_voltage":
        return signal in outputs
    return any(effect.acts_on == "supply" for effect in catalogue.effects_of(model.effects))


def compared_signals(dataset: Dataset, model: Model) -> ComparedSignals:
    """Finds the measured signals that the model gives.

    Raises:
        InputError: no signal that the model gives has a value, or a sample is too large to be a measurement.
    """
    given = output_names(model)
    measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    names = tuple(name for name in measured if is_compared(name, given, model))
    has_value = False
    for run in dataset.runs:
        for name in (name for name in names if name in run.outputs):
            sizes = np.abs(run.outputs[name])
            largest = float(sizes[np.isfinite(sizes)].max(initial=-1.0))
            if largest > _LARGEST:
                raise InputError(f"{largest:g} is too large to be a measurement", file=run.file, field=name)
            has_value |= largest >= 0
    others = ", ".join(name for name in measured if name not in given)
    if not has_value:
        reason = f"; the model of this vehicle does not give {others}" if others else ""
        message = f"nothing to compare: no signal that the model gives has a value{reason}"
        raise InputError(message, file=dataset.path, field="signals")
    note = f"Not compared, because the model of this vehicle does not give it: {others}."
    return ComparedSignals(names, (note,) if others else ())
