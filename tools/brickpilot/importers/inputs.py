"""Joins a log with the inputs that act between its rows.

A simulation holds an input from row to row. So a row is added where the input changes between two rows of a log; what
is measured stays blank there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import SIGNALS

Vector = NDArray[np.float64]

_LINEAR_STEP_S = 0.005  # a linear input is held for so long at most
_MOST_STEPS = 200  # between two rows


def with_events(columns: Mapping[str, Vector], events: Mapping[str, Vector]) -> dict[str, Vector]:
    """Returns a log whose inputs come from a table of events; it has a row at each event within the log.

    Args:
        columns: of the log: time, outputs, and inputs, which are left out.
        events: time and inputs; an input holds from its event to the next. Before the first event it is 0.
    """
    time, at = columns["time"], events["time"]
    within = at[(at > time[0]) & (at <= time[-1])]
    union = np.union1d(time, within)
    place = np.searchsorted(at, union, side="right") - 1
    joined = {"time": union}
    for name, values in events.items():
        if name != "time":
            joined[name] = np.where(place < 0, 0.0, values[np.maximum(place, 0)])
    measured = np.searchsorted(union, time)
    for name, values in columns.items():
        if SIGNALS[name].kind == "output":
            joined[name] = np.full(union.size, np.nan)
            joined[name][measured] = values
    return joined


def with_linear_inputs(columns: Mapping[str, Vector], second: float) -> dict[str, Vector]:
    """Returns a log whose inputs change linearly from row to row, as steps of 5 ms with the mean of each.

    Args:
        columns: of the log.
        second: 1 s in the unit of the time.
    """
    time = columns["time"]
    inputs = {name: values for name, values in columns.items() if SIGNALS[name].kind == "input"}
    span = np.diff(time)
    changes = np.any([np.diff(values) != 0.0 for values in inputs.values()], axis=0)
    steps = np.where(changes, np.ceil(span / (_LINEAR_STEP_S * second) - 1e-9), 1.0)
    steps = np.clip(steps, 1, _MOST_STEPS).astype(np.int64)
    row = np.repeat(np.arange(span.size), steps)
    part = (np.arange(row.size) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[row]
    begins = np.append(time[row] + part * span[row], time[-1])
    measured = np.append(part == 0.0, True)
    result = {"time": begins}
    for name, values in inputs.items():
        middle = part + 0.5 / steps[row]
        ramp = values[row] + middle * np.diff(values)[row]
        result[name] = np.append(np.where(np.isnan(ramp), values[row], ramp), values[-1])
    for name, values in columns.items():
        if SIGNALS[name].kind == "output":
            result[name] = np.full(begins.size, np.nan)
            result[name][measured] = values
    return {name: result[name] for name in columns}
