"""What an input does between two rows of a log: it holds, or it goes in a straight line to the next row.

A simulation holds an input from row to row. So a straight line becomes rows of its own, short ones with the mean of
each; what is measured stays blank there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from brickpilot.data.dataset import Run

Vector = NDArray[np.float64]
InputTiming = Literal["held", "linear", "unknown"]

INPUT_TIMINGS: tuple[InputTiming, ...] = ("held", "linear", "unknown")

_STEP_S = 0.005  # a linear input is held for so long at most
_MOST_STEPS = 200  # between two rows


def with_linear_inputs(run: Run) -> Run:
    """Returns a run with rows of at most 5 ms wherever an input changes from one row to the next."""
    return with_rows(run, *ramps(run.time, run.inputs))


def ramps(time: Vector, inputs: Mapping[str, Vector], step_s: float = _STEP_S) -> tuple[Vector, dict[str, Vector]]:
    """Returns the times and inputs of rows that follow straight lines between those given, with the mean of each row.

    Args:
        time: (n,) s, strictly increasing; all of it is in the result.
        inputs: name -> (n,); NaN: the motor floats, until the next row.
        step_s: the longest row while an input changes.
    """
    span = np.diff(time)
    changes = np.any([np.diff(values) != 0.0 for values in inputs.values()], axis=0)
    steps = np.where(changes, np.ceil(span / step_s - 1e-9), 1.0)
    steps = np.clip(steps, 1, _MOST_STEPS).astype(np.int64)
    row = np.repeat(np.arange(span.size), steps)
    part = (np.arange(row.size) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[row]
    begins = np.append(time[row] + part * span[row], time[-1])
    found = {}
    for name, values in inputs.items():
        ramp = values[row] + (part + 0.5 / steps[row]) * np.diff(values)[row]
        found[name] = np.append(np.where(np.isnan(ramp), values[row], ramp), values[-1])
    return begins, found


def with_rows(run: Run, time: Vector, inputs: Mapping[str, Vector]) -> Run:
    """Returns a run with more rows and other inputs; outputs are blank in the rows that it did not have.

    Args:
        time: (m,) s; holds all of the run's times.
        inputs: name -> (m,).
    """
    measured = np.searchsorted(time, run.time)

    def spread(values: Vector) -> Vector:
        wider = np.full(time.size, np.nan)
        wider[measured] = values
        wider.setflags(write=False)
        return wider

    outputs = {name: spread(values) for name, values in run.outputs.items()}
    raw = {name: spread(values) for name, values in run.raw_outputs.items()}
    return dataclasses.replace(run, time=time, inputs=dict(inputs), outputs=outputs, raw_outputs=raw)
