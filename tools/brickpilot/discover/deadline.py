"""The time of a discovery: the limit, the work left out to keep the limit, and an estimate beforehand."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from brickpilot.discover.parts import library_parts
from brickpilot.fit.descent import Progress

if TYPE_CHECKING:
    from brickpilot.discover.explanation import Explanation
    from brickpilot.discover.prepare import Prepared

SEARCHED, COMPOSED = 0.7, 0.9
"""Shares of the budget at which the search and the composed term must be finished. The rest of the budget is for work
that cannot be left out: the proof of the written model, intervals and the report."""


@dataclass(frozen=True)
class Deadline:
    """The time limit of a discovery. A stage asks `allows` before work that can be left out.

    Attributes:
        budget_s: the time limit, s; None: no limit.
        share: the share of the budget at which the stage must be finished.
        began: the start of the discovery on the clock of `time.perf_counter`, s.
        left_out: the work for which there was no time, in order; all stages share this record.
    """

    budget_s: float | None = None
    share: float = 1.0
    began: float = field(default_factory=time.perf_counter)
    left_out: dict[str, None] = field(default_factory=dict)

    def until(self, share: float) -> Deadline:
        """Returns the deadline of a stage that must be finished at this share of the budget."""
        return dataclasses.replace(self, share=share)

    @property
    def passed(self) -> bool:
        return self.budget_s is not None and time.perf_counter() - self.began >= self.share * self.budget_s

    def allows(self, work: str) -> bool:
        """Returns whether there is time for `work`; if not, records `work` as left out."""
        if self.passed:
            self.left_out[work] = None
        return not self.passed


NO_LIMIT = Deadline()

_COARSE, _FINE = 90, 300
"""A unit of work is so many simulations of all fit runs: `_COARSE` in bins per candidate, `_FINE` at the samples."""

_UNITS = ((1.3, 0.2, 0.5), (4.0, 0.4, 1.5), (math.inf, 1.5, 8.0))
"""Rows (ratio, least, most): up to this ratio of the nominal model's cost to the cost of noise, a discovery takes about
`least` to `most` units of work. If noise explains the residual, the search ends; otherwise it starts again in windows
and with terms. The rows were set on fifteen data sets, seven of them measured; one data set took 16 units."""

_YARDSTICK_S = (3.0, 12.0)
"""Usual range of the processor time, s, of the black box that measures the attainable fit; one data set took 22 s."""

_MOST_PASSED = 0.95  # largest share of the time that a progress report shows before the end


@dataclass(frozen=True)
class Span:
    """A range of time, s."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        return math.sqrt(self.low * self.high)

    def __str__(self) -> str:
        return f"{max(self.low, 1):.0f} to {max(self.high, 2):.0f} s"


def estimate(prepared: Prepared, nominal: Explanation, *, times: float = 1.0) -> Span:
    """Returns the expected time of a discovery, from simulations timed here and from the nominal model's error.

    Args:
        nominal: the calibrated nominal model.
        times: ratio of the discovery's number of samples to the number prepared here.
    """
    models = [nominal.model] * 4

    def timed(predict: Callable[..., object]) -> float:
        """Returns the time to simulate one model, s. The first call fills caches and is not timed."""
        predict(models)
        began = time.perf_counter()
        predict(models)
        return (time.perf_counter() - began) / len(models)

    count = len(library_parts(models[0], prepared.coarse.signals))
    unit = times * (_COARSE * count * timed(prepared.coarse.predict) + _FINE * timed(prepared.fine.predict))
    above_noise = nominal.cost / max(prepared.coarse.noise_cost(), 1e-12)
    _, low, high = next(row for row in _UNITS if above_noise <= row[0])
    return Span(low * unit + _YARDSTICK_S[0] / prepared.jobs, high * unit + _YARDSTICK_S[1] / prepared.jobs)


class Stages:
    """Reports the start of each stage to `progress`, with the passed share of the expected time, in percent."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._began, self._expected_s = progress, time.perf_counter(), math.inf

    def __call__(self, text: str) -> None:
        share = min((time.perf_counter() - self._began) / self._expected_s, _MOST_PASSED)
        if self._progress is not None:
            self._progress(round(100 * share), 100, text)

    def expect(self, estimated: Span) -> None:
        """Reports the estimated time as step 0 of 0, because the estimate is not a stage."""
        self._expected_s = time.perf_counter() - self._began + estimated.middle
        if self._progress is not None:
            self._progress(0, 0, f"estimate: {estimated}")
