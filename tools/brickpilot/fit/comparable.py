"""A data set as every comparison takes it: the same samples, the same roles, and the same start of each run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data import holdout
from brickpilot.data.audit import against_model
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.errors import SimulationError
from brickpilot.fit import parameters
from brickpilot.fit.replay import Replay
from brickpilot.fit.start_state import with_averaged_starts, with_rates

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
