"""Cuts a run into windows, and gives the motion in each window as each channel measures it.

A rate is integrated, and an angle is differenced over the window. Then both have the same unit and can be compared,
even if their noise, filters and sampling differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import RATE_OF, SUMMED

Vector = NDArray[np.float64]

LEAST_SAMPLES = 20
"""A run with fewer samples is not compared."""

_LEAST_WINDOWS, _MOST_WINDOWS = 8, 32
_WINDOW_S = 0.25  # longer than delays and lags of sensors, shorter than a manoeuvre
_KNOWN = 0.7  # share of known samples, for a window to count
_EDGE = 0.15  # of a window: span on each side of an edge over which the velocity there is averaged


@dataclass(frozen=True, eq=False)
class Windows:
    """The motion of one run.

    Attributes:
        interval: s between samples, the median.
        seconds: (w,), the length of each window.
        moved: channel -> (w,), the integral of a rate or the growth of a sum, SI; NaN where too little is known.
        changed: channel of a wheel or motor -> (w,), the change of its rate from a window's start to its end.
    """

    interval: float
    seconds: Vector
    moved: Mapping[str, Vector]
    changed: Mapping[str, Vector]

    def divided(self, factors: Mapping[str, float]) -> Windows:
        """Returns the windows with channels divided by their factors; "time" divides the clock."""
        clock = factors.get("time", 1.0)

        def by(name: str, power: int) -> float:
            return 1.0 / (factors.get(name, 1.0) * clock**power)

        moved = {name: values * by(name, 0 if name in SUMMED else 1) for name, values in self.moved.items()}
        changed = {name: values * by(name, -1 if name in SUMMED else 0) for name, values in self.changed.items()}
        return replace(self, interval=self.interval / clock, seconds=self.seconds / clock, moved=moved, changed=changed)


def cut(time: Vector, channels: Mapping[str, Vector], count: int = 0) -> Windows:
    """Cuts one run into `count` windows; 0: into 8 to 32 of about 0.25 s. `channels`: (n,) each, NaN where unknown."""
    count = count or int(np.clip((time[-1] - time[0]) / _WINDOW_S, _LEAST_WINDOWS, _MOST_WINDOWS))
    edges = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], count + 1)))
    moved: dict[str, Vector] = {}
    changed: dict[str, Vector] = {}
    for name, values in channels.items():
        known = np.isfinite(values)
        if np.count_nonzero(known) < 2:
            continue
        whole = values if known.all() else np.interp(time, time[known], values[known])
        sums = whole if name in SUMMED else integral(time, whole)
        thin = np.diff(np.concatenate([[0], np.cumsum(known)])[edges]) < _KNOWN * np.diff(edges)
        moved[name] = np.where(thin, np.nan, np.diff(sums[edges]))
        if name in RATE_OF or name in RATE_OF.values():
            changed[name] = np.where(thin, np.nan, np.diff(_rate_at(time, sums, edges)))
    return Windows(float(np.median(np.diff(time))), np.diff(time[edges]), moved, changed)


def integral(time: Vector, rate: Vector) -> Vector:
    """Returns the integral of a rate from the first sample on, by the trapezoidal rule."""
    steps = (rate[1:] + rate[:-1]) / 2 * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _rate_at(time: Vector, sums: Vector, edges: NDArray[np.intp]) -> Vector:
    half = max(1, round(_EDGE * float(np.median(np.diff(edges)))))
    before, after = np.maximum(edges - half, 0), np.minimum(edges + half, len(time) - 1)
    return (sums[after] - sums[before]) / (time[after] - time[before])
