"""The record of each tick of a flight over a link: its times on this machine's clock, and its faults."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import STEP_S

Array = NDArray[np.float64]

TROUBLES = ("late_ticks", "lost_frames", "refused_frames", "safe_stops")
"""The faults that both ends count: late ticks, frames that were missing, damaged or old, and safe stops."""


@dataclass(frozen=True)
class Ticks:
    """The ticks of a flight; each array has the shape (steps,).

    Attributes:
        time_s: of the flight.
        begun_s: when the tick began, s of the clock after the first.
        round_trip_ms: from sending the sensors' set to its motor command; NaN: none came.
        troubles: by name, how many were counted in the tick. The brick reports its own with a delay.
    """

    time_s: Array
    begun_s: Array
    round_trip_ms: Array
    troubles: dict[str, Array]

    def columns(self) -> dict[str, Array]:
        """Returns the columns of ticks.csv."""
        return {"time_s": self.time_s, "begun_s": self.begun_s, "round_trip_ms": self.round_trip_ms, **self.troubles}


class TickRecorder:
    """Records the ticks of a flight of at most `steps` steps."""

    def __init__(self, steps: int) -> None:
        self._begun: Array = np.full(steps, np.nan)
        self._round_trip: Array = np.full(steps, np.nan)
        self._counted: Array = np.full((steps, len(TROUBLES)), np.nan)
        self._sent: dict[int, tuple[int, float]] = {}  # sequence number -> step and time

    def begin(self, step: int) -> None:
        """Notes that a tick begins."""
        self._begun[step] = time.perf_counter()

    def sent(self, step: int, sequence: int) -> None:
        """Notes that the set of a step is sent; a set that is sent again counts from there."""
        self._sent[sequence] = step, time.perf_counter()

    def replied(self, sequence: int) -> None:
        """Notes the motor command that answers the set of this sequence number."""
        step, sent = self._sent.pop(sequence, (-1, 0.0))
        if step >= 0:
            self._round_trip[step] = 1e3 * (time.perf_counter() - sent)

    def count(self, step: int, *totals: int) -> None:
        """Notes how many of each of TROUBLES were counted since the flight began."""
        self._counted[step] = totals

    def ticks(self, steps: int) -> Ticks:
        """Returns the first `steps` ticks. Ticks without counts, as after a lost link, repeat the last counts."""
        counted = np.vstack([np.zeros(len(TROUBLES)), self._counted[:steps]])
        last = np.maximum.accumulate(np.where(np.isnan(counted[:, 0]), 0, np.arange(len(counted))))
        more = np.diff(counted[last], axis=0)
        first = self._begun[0] if steps else 0.0
        return Ticks(
            STEP_S * np.arange(steps, dtype=np.float64),
            self._begun[:steps] - first,
            self._round_trip[:steps],
            {name: np.maximum(more[:, k], 0.0) for k, name in enumerate(TROUBLES)},
        )
