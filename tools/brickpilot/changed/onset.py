"""The onset of a difference: the moment in a recording from which on it explains the measurements.

The sum of gains from a moment to the end is largest at the moment at which losses turn into gains (Page 1954,
Biometrika 41: the CUSUM of a change point). A first estimate takes the growth of the old model's error as the gain,
because this model is right before the moment. The final estimate takes the gain of the differences that explain the
data after the moment. Every model explains a machine at rest, so data at rest do not show when a difference began.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.motion import run_of
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Judge, scale_of_rest
from brickpilot.fit.residual import Residual
from brickpilot.fit.robust import correlation_time
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_STEP_S = 0.1  # resolution of a moment
_FAR = 5.0  # in scales: a larger error is clipped to this


@dataclass(frozen=True)
class Onset:
    """A moment in a recording.

    Attributes:
        run: the name of the run in the joint data set.
        at_s: the moment, on the clock of the run.
        ci95: the first and last moment of the same run that the data cannot tell from this one.
    """

    run: str
    at_s: float
    ci95: tuple[float, float]


def suspected(data: Residual, old: Model, recording: str) -> Onset | None:
    """Returns the moment from which on the old model leaves a larger error of a recording than usual; None: none.

    Args:
        data: its floors say how much error is usual.
    """
    error, gains = data.error(old), np.zeros(len(data.measured))
    for signal in data.signals:
        own, usual = data.rows_of(recording, signal), data.floor(signal)
        if own.any():
            large = scale_of_rest(error[own], usual)
            squares = np.clip(error[own] / usual, -_FAR * large / usual, _FAR * large / usual) ** 2
            gains[own] = (squares * (1 - (usual / large) ** 2)) / 2 - np.log(large / usual)
    return _onset(data, gains / _correlated(data, error, recording), recording)


def onset(data: Residual, old: Model, changed: Model, recording: str) -> Onset | None:
    """Returns the moment from which on `changed` explains a recording better than `old`; None: from its start.

    Args:
        data: its floors say how much error is usual.
        changed: the model of the data after the change.
    """
    error = data.error(old)
    by_value = Judge(data, np.arange(len(error)), len(error), 0.0)
    gains = by_value.rises(error, data.error(changed))
    return _onset(data, gains / _correlated(data, error, recording), recording)


def _correlated(data: Residual, error: Array, recording: str) -> float:
    """Returns the correlation time, in values, of the old model's error outside a recording: the longest of signals.

    Inside this recording, the change itself makes the error correlated.
    """
    there = ~data.rows_of(recording)
    found = 1.0
    for signal in data.signals:
        parts = [
            np.clip(one / data.floor(signal), -_FAR, _FAR) for one in data.parts(np.where(there, error, np.nan), signal)
        ]
        known = [one for one in parts if np.isfinite(one).all()]
        found = max(found, correlation_time(known, about_mean=False) if known else 1.0)
    return found


def _onset(data: Residual, gains: Array, recording: str) -> Onset | None:
    """Returns the moment from which on the sum of gains (values,) is largest, if this is surely not chance."""
    stretch, count = data.stretches(_STEP_S)
    here = data.rows_of(recording)
    total = np.bincount(stretch[here], gains[here], count)
    place: dict[int, tuple[str, float]] = {}
    for block in data.blocks:
        numbers_of = stretch[block.place]
        for number in np.unique(numbers_of[here[block.place]]).tolist():
            first = float(block.middle[numbers_of == number].min())
            place[number] = (run_of(block.run), min(first, place.get(number, ("", np.inf))[1]))
    order = _order(data)
    moments = sorted(place, key=lambda number: (order[place[number][0]], place[number][1]))
    if len(moments) < 2:
        return None
    rest = np.cumsum(total[moments][::-1])[::-1]  # from each moment to the end
    best = int(np.argmax(rest))
    if rest[best] - rest[0] < numbers.CHANCE_NATS + np.log(len(moments)):  # any of the moments may win by chance
        return None
    run, at_s = place[moments[best]]
    near = [
        place[one][1]
        for one, sum_ in zip(moments, rest.tolist(), strict=True)
        if sum_ > rest[best] - numbers.CHANCE_NATS and place[one][0] == run
    ]
    return Onset(run, at_s, (min(near), max(near)))


def _order(data: Residual) -> Mapping[str, int]:
    """Returns run -> its number in the data set."""
    found: dict[str, int] = {}
    for run in data.replay.dataset.runs:
        found.setdefault(run_of(run.name), len(found))
    return found
