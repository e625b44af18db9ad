"""Values of the runs of a data set: what of a run's inputs reaches the motors, and when.

The plant stays as it is. A run's own value changes its inputs before they are simulated.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run
from brickpilot.fit.held_inputs import held_back, later

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """One kind of value that a run may have of its own.

    Attributes:
        name: its key in verdict.json.
        words: what differs, as the subject of a sentence.
        unit: SI; 1 is a share.
        change: (time (n,), inputs (n, columns), value) -> inputs.
        tried: values from which a fit may start.
        low, high: the range of values.
        counts_from: the mean of the fit runs, or their least value: that part belongs to the model. Or nothing: values
            are whole, and take the place of an effect.
        all_through: it acts all through the run; else only at its start.
    """

    name: str
    words: str
    unit: str
    change: Callable[[Array, Array, float], Array]
    tried: tuple[float, ...]
    low: float
    high: float
    counts_from: Literal["mean", "least", "nothing"]
    all_through: bool

    @property
    def is_whole(self) -> bool:
        """Whether values count from nothing, so that the model may not hold a part of them."""
        return self.counts_from == "nothing"


GAIN = Kind(
    "supply_gain",
    "The voltage that reaches the motors",
    "1",
    lambda _, driven, value: driven * (1 + value),
    (),
    -0.5,
    0.5,
    "mean",
    True,
)
"""The supply's voltage, as a battery, its charge and the windings' temperature change it."""

DELAY = Kind(
    "delay",
    "The time from a command to its effect",
    "s",
    later,
    tuple(0.025 * k for k in range(-4, 13)),
    -0.5,
    0.5,
    "least",
    True,
)
"""A link's delay: every input of the run acts later."""

START = Kind(
    "start",
    "The time from the start of a recording to the first input that acts",
    "s",
    held_back,
    tuple(0.025 * k for k in range(21)),
    0.0,
    0.5,
    "nothing",
    False,
)
"""A log that starts before its command does: later inputs act in time."""

KINDS = (GAIN, DELAY, START)


@dataclass(frozen=True)
class RunValue:
    """The value of one run, with its 95 % interval."""

    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class RunValues:
    """Values of one kind, for the fit runs of a data set.

    Attributes:
        mean: over the runs; a held-out run has it.
        sd: between runs.
        removed: the share of the cost that they take away, 0..1.
        applied: the fit runs were simulated with them; else they are only reported.
    """

    kind: Kind
    mean: float
    sd: float
    runs: Mapping[str, RunValue]
    removed: float
    applied: bool

    def to_json(self) -> dict[str, Any]:
        """Returns the entry of verdict.json."""
        return {
            "kind": self.kind.name,
            "unit": self.kind.unit,
            "mean": self.mean,
            "sd": self.sd,
            "runs": {name: {"value": one.value, "ci95": list(one.ci95)} for name, one in self.runs.items()},
            "removed": self.removed,
            "applied": self.applied,
            "sentence": self.sentence(),
        }

    def sentence(self) -> str:
        """Returns what this means, for a reader."""
        size, suffix = (100.0, " %") if self.kind.unit == "1" else (1.0, f" {self.kind.unit}")
        least = min(self.runs, key=lambda name: self.runs[name].value)
        most = max(self.runs, key=lambda name: self.runs[name].value)
        low, high = (size * self.runs[name].value for name in (least, most))
        sign = "+" if self.kind.counts_from == "mean" else ""
        about = {"mean": " about its mean", "least": ", counted from the run in which it is least", "nothing": ""}[
            self.kind.counts_from
        ]
        end = (
            "Each fit run was simulated with its own value, and held-out runs with the mean: theirs is not known."
            if self.applied
            else "All runs were simulated with one value."
        )
        return (
            f"{self.kind.words} differs from run to run, with an sd of {size * self.sd:.2g}{suffix}{about}: from "
            f"{low:{sign}.2g}{suffix} ({least}) to {high:{sign}.2g}{suffix} ({most}). {end}"
        )


def with_values(dataset: Dataset, kind: Kind, values: Mapping[str, float]) -> Dataset:
    """Returns the data set with the inputs of these whole runs as they reach the motors; the others stay."""
    runs = tuple(_changed(run, kind, values[run.name]) if values.get(run.name) else run for run in dataset.runs)
    return dataclasses.replace(dataset, runs=runs)


def _changed(run: Run, kind: Kind, value: float) -> Run:
    names = list(run.inputs)
    changed = kind.change(run.time, np.column_stack([run.inputs[name] for name in names]), value)
    return dataclasses.replace(run, inputs=dict(zip(names, changed.T, strict=True)))


def inputs_of(whole: Dataset, compared: Dataset, run_of: Callable[[str], str]) -> Dataset:
    """Returns `compared`, runs or windows of runs of `whole`, with the inputs of the whole runs at its samples."""
    by_name = {run.name: run for run in whole.runs}
    runs = []
    for run in compared.runs:
        parent = by_name[run_of(run.name)]
        rows = np.searchsorted(parent.time, run.time)
        runs.append(dataclasses.replace(run, inputs={name: one[rows] for name, one in parent.inputs.items()}))
    return dataclasses.replace(compared, runs=tuple(runs))
