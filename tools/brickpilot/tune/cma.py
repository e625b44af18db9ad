"""The search: CMA-ES (Hansen, 2016, arXiv 1604.00772) by pycma, on flights of drawn robots.

All gain sets of a generation are flown by the same robots with the same noise (common random numbers), so that their
ranks, all that the method uses, compare gains and not luck. The next generation gets other robots, so that no set is
fitted to a few. The answer is the centre of the last distribution: where scores are noisy, the best set seen was lucky.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from brickpilot.errors import InputError
from brickpilot.tune.flying import Flyer
from brickpilot.tune.space import Space
from brickpilot.tune.task import Outcome, Raw, Scale, score

SEARCH = 0
"""The stream of the robots that the search flies."""

STEP = 0.3
"""First step, of a logarithm: a third more or less."""

_SEEDS = 2**31 - 1  # of pycma, which takes 0 for the clock


@dataclass(frozen=True)
class Budget:
    """When the search ends: after so many gain sets, or after so many seconds; the generation is finished."""

    sets: int | None
    seconds: float | None

    @property
    def text(self) -> str:
        return f"{self.sets} gain sets" if self.sets is not None else f"{self.seconds:g} s"


@dataclass(frozen=True)
class Generation:
    """One generation of the search.

    Attributes:
        sets: gain sets flown until its end.
        best, middle: the least and the median mean score of its sets.
        success: share of the flights of all its sets that succeeded.
        step: of the search, in units of a logarithm.
    """

    sets: int
    best: float
    middle: float
    success: float
    step: float


@dataclass(frozen=True)
class Searched:
    """What the search found, and its generations."""

    gains: Raw
    generations: tuple[Generation, ...]


def search(flyer: Flyer, space: Space, start: Raw, by: Scale, robots: int, budget: Budget) -> Searched:
    """Returns the gains that the search ends with.

    Args:
        by: what the score is measured in.
        robots: that fly each gain set.

    Raises:
        InputError: pycma is not installed.
    """
    cma = _library()
    began = time.monotonic()
    options = {
        "bounds": [list(bound) for bound in space.bounds()],
        "seed": flyer.problem.seed % _SEEDS + 1,
        "verbose": -9,
    }
    strategy = cma.CMAEvolutionStrategy(space.coordinates(start), STEP, options)
    generations: list[Generation] = []
    while not strategy.stop() and not _is_spent(budget, generations, time.monotonic() - began):
        places = range(robots * len(generations), robots * (len(generations) + 1))
        asked = strategy.ask()
        flown = flyer.fly([space.raw(np.asarray(one)) for one in asked], SEARCH, places)
        means = [float(np.mean([score(one, by) for one in outcomes])) for outcomes in flown]
        strategy.tell(asked, means)
        generations.append(_generation(generations, flown, means, float(strategy.sigma)))
    return Searched(space.raw(np.asarray(strategy.result.xfavorite)), tuple(generations))


def _library() -> Any:
    """Returns pycma.

    Raises:
        InputError: it is not installed.
    """
    try:
        import cma
    except ImportError:
        raise InputError("needs the library cma: pip install 'brickpilot[tune]'", field="tune") from None
    return cma


def _is_spent(budget: Budget, generations: list[Generation], elapsed: float) -> bool:
    sets = generations[-1].sets if generations else 0
    if budget.sets is not None:
        return sets >= budget.sets
    return budget.seconds is not None and elapsed >= budget.seconds and bool(generations)


def _generation(before: list[Generation], flown: list[list[Outcome]], means: list[float], step: float) -> Generation:
    success = float(np.mean([one.success for outcomes in flown for one in outcomes]))
    sets = (before[-1].sets if before else 0) + len(flown)
    return Generation(sets, min(means), float(np.median(means)), success, step)
