"""Decimation: merges rows that follow each other faster than the plant's motor step.

A simulation holds an input for at least a motor step, so such rows only cost time and memory.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import MOTOR_STEP_S

if TYPE_CHECKING:
    from brickpilot.data.dataset import Run

Vector = NDArray[np.float64]


def decimated(run: Run) -> Run:
    """Returns the run with several rows merged into one; the run itself unless two rows fit into a motor step.

    An input becomes the mean of its rows, and floats if it floats in one of them. An output stays a reading of one
    instant: the first that is there, so a channel that is logged less often loses none.
    """
    step = float(np.median(np.diff(run.time)))
    together = int(MOTOR_STEP_S / step * (1 + 1e-6))
    if together < 2:
        return run
    group = np.floor((run.time - run.time[0]) / (together * step) + 1e-6).astype(np.int64)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    rows = np.diff(np.append(first, run.time.size))
    if first.size < 2:
        return run

    def mean(values: Vector) -> Vector:
        return _fixed(np.add.reduceat(values, first) / rows)

    def reading(values: Vector) -> Vector:
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            return _fixed(values[first])
        found = known[np.minimum(np.searchsorted(known, first), known.size - 1)]
        return _fixed(np.where(group[found] == group[first], values[found], np.nan))

    return dataclasses.replace(
        run,
        time=_fixed(run.time[first]),
        inputs={name: mean(values) for name, values in run.inputs.items()},
        outputs={name: reading(values) for name, values in run.outputs.items()},
        raw_outputs={name: reading(values) for name, values in run.raw_outputs.items()},
    )


def decimation_note(rows: int, kept: int) -> str:
    """Returns the sentence that tells the user; `rows`: of all runs, as logged; `kept`: those that are left."""
    return (
        f"{rows:,} rows become {kept:,}: the plant moves its motors in steps of {1e3 * MOTOR_STEP_S:g} ms, and faster "
        "rows tell it nothing; inputs are averaged"
    )


def _fixed(values: Vector) -> Vector:
    values.setflags(write=False)
    return values
