"""The judge: the same fresh robots, with the same noise, fly with the gains before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, bootstrap

from brickpilot.tune.task import Outcome, Scale, score

Array = NDArray[np.float64]

JUDGE = 2
"""The stream of the judge's robots: no search has seen them."""

BOOTSTRAP = 3
"""The stream of the resamples. The others are of robots: SEARCH 0, SCALE 1 and JUDGE, each with a place beside it."""

LEVEL = 0.95
RESAMPLES = 4000
SIGNIFICANT = 1 - LEVEL


@dataclass(frozen=True)
class Rate:
    """How many robots flew their mission, with Wilson's 95 % interval of the share."""

    successes: int
    robots: int
    low: float
    high: float

    @property
    def share(self) -> float:
        return self.successes / self.robots


@dataclass(frozen=True)
class Change:
    """A figure before and after, as means over the same robots, and the 95 % interval of the mean difference.

    Attributes:
        robots: of which it is: those that flew the mission both times, or all.
        low, high: of `after` - `before`, by bootstrap over robots.
    """

    name: str
    unit: str
    robots: int
    before: float
    after: float
    low: float
    high: float


@dataclass(frozen=True)
class Judged:
    """What the judge found.

    Attributes:
        before, after: outcomes of the same robots.
        gained, lost: robots that flew the mission with the new gains alone, and with the old ones alone.
        p: that they would differ by so much or more if the gains were equally good (McNemar's exact test).
        changes: the score first.
    """

    before: tuple[Outcome, ...]
    after: tuple[Outcome, ...]
    rate_before: Rate
    rate_after: Rate
    gained: int
    lost: int
    p: float
    changes: tuple[Change, ...]

    @property
    def is_worse_in_success(self) -> bool:
        return self.lost > self.gained and self.p < SIGNIFICANT

    @property
    def better(self) -> bool:
        """Whether the new gains are better: success first, then the score, each beyond chance."""
        if self.is_worse_in_success:
            return False
        return (self.gained > self.lost and self.p < SIGNIFICANT) or self.changes[0].high < 0


def rate(outcomes: Sequence[Outcome]) -> Rate:
    """Returns the share of successes with its interval."""
    successes = sum(one.success for one in outcomes)
    interval = binomtest(successes, len(outcomes)).proportion_ci(LEVEL, method="wilson")
    return Rate(successes, len(outcomes), float(interval.low), float(interval.high))


def judge(before: Sequence[Outcome], after: Sequence[Outcome], by: Scale, seed: int) -> Judged:
    """Returns what two flights of each robot say, in the same order.

    Args:
        by: what the score is measured in.
        seed: of the bootstrap.
    """
    gained = sum(new.success and not old.success for old, new in zip(before, after, strict=True))
    lost = sum(old.success and not new.success for old, new in zip(before, after, strict=True))
    differing = gained + lost
    p = float(binomtest(gained, differing).pvalue) if differing else 1.0
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(BOOTSTRAP,)))
    both = [(old, new) for old, new in zip(before, after, strict=True) if old.success and new.success]
    every = list(zip(before, after, strict=True))
    changes = [_change("score", "", [(score(old, by), score(new, by)) for old, new in every], random)]
    for field, unit in (("cross_track", "m"), ("time", "s"), ("wear", "full duties")):
        pairs = [(getattr(old, field), getattr(new, field)) for old, new in both]
        changes.append(_change(field.replace("_", "-"), unit, pairs, random))
    return Judged(tuple(before), tuple(after), rate(before), rate(after), gained, lost, p, tuple(changes))


def _change(name: str, unit: str, pairs: Sequence[tuple[float, float]], random: np.random.Generator) -> Change:
    if not pairs:
        return Change(name, unit, 0, math.nan, math.nan, math.nan, math.nan)
    old, new = np.array(pairs).T
    difference = new - old
    low = high = float(difference.mean())
    if np.ptp(difference) > 0:
        found = bootstrap(
            (difference,), np.mean, confidence_level=LEVEL, n_resamples=RESAMPLES, method="percentile", rng=random
        ).confidence_interval
        low, high = float(found.low), float(found.high)
    return Change(name, unit, len(pairs), float(old.mean()), float(new.mean()), low, high)
