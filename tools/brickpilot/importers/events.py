"""Joins a log with the events at which its inputs change between its rows.

A simulation holds an input from row to row. So a row is added if the input changes between two rows of a log; measured
signals stay blank there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import SIGNALS

Vector = NDArray[np.float64]


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
