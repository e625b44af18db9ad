"""How long a discovery takes, before it starts and while it runs."""

from __future__ import annotations

import time
from collections.abc import Callable

from brickpilot.discover.candidates import candidates
from brickpilot.discover.prepare import Prepared
from brickpilot.fit.descent import Progress

_COARSE, _FINE = 90, 300
"""Simulations of all fit runs that a discovery takes as long as: on the coarse grid, for each candidate, with the fits
around them; and at the measured samples. Median of six data sets that end with one effect or none, which need 25 to 300
for each candidate; where something remains that no effect explains it is more."""


def estimate(prepared: Prepared) -> float:
    """Returns how many seconds a discovery that finds one effect takes, from simulations that are timed here."""
    models = [prepared.plan.at(prepared.plan.start())] * 4

    def timed(predict: Callable[..., object]) -> float:
        """Returns the s of one model. The first call fills caches."""
        predict(models)
        began = time.perf_counter()
        predict(models)
        return (time.perf_counter() - began) / len(models)

    count = len(candidates(models[0], prepared.coarse.signals))
    return _COARSE * count * timed(prepared.coarse.predict) + _FINE * timed(prepared.fine.predict)


_BEGINS = {
    "calibrating the nominal model": 0.03,
    "searching for effect 1": 0.08,
    "searching for effect 2": 0.55,
    "searching for effect 3": 0.7,
    "removing needless effects": 0.8,
    "fitting at the measured samples": 0.82,
    "composing a term for the rest": 0.85,
    "computing intervals and the next experiment": 0.9,
    "measuring what is attainable": 0.92,
}
"""Share of the time after which a stage begins, where one effect is found: median of the same sets."""


class Stages:
    """Reports the start of each stage to `progress`, with the share of the time that has passed, in percent."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._share = progress, 0.0

    def __call__(self, text: str) -> None:
        self._share = max(self._share, _BEGINS.get(text, 0.0))
        if self._progress is not None:
            self._progress(round(100 * self._share), 100, text)

    def announce(self, text: str) -> None:
        """Reports a line that is no stage: 0 of 0."""
        if self._progress is not None:
            self._progress(0, 0, text)
