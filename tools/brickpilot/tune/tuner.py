"""Tunes the gains of one robot: its problem, the search, the final comparison (the judge), and the kept gains.

Workers load only the module `task`, so a worker needs none of the libraries that links need.

The search is CMA-ES (Hansen, 2016, arXiv 1604.00772) by pycma, on flights of drawn robots; the workers of a campaign
fly them. All gain sets of a generation are flown by the same robots with the same noise (common random numbers), so
that chance does not affect the ranks of the sets; CMA-ES uses only these ranks. The next generation uses other robots,
so that no set is overfitted to a few robots. The answer is the centre of the last distribution, because scores are
noisy: the gain set with the best score may be best by chance.

The judge flies the old and the new gains with the same new robots and the same noise.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest, bootstrap

from brickpilot.campaign import robots
from brickpilot.campaign.run_parts import Part, Results, Workers
from brickpilot.errors import InputError
from brickpilot.firmware import boards, robot, simulate
from brickpilot.tune.task import Batch, Outcome, Problem, Raw, Scale, Space, around, fly_batch, scale, score
from brickpilot.vehicle import compensation, flight, scenario
from brickpilot.vehicle import model as models
from brickpilot.vehicle.settings import constants, default, defaults, settings

PACKAGED = "packaged"
"""The value of `board` for the project's own firmware, with the compensation of the model."""

SEARCH, SCALE, JUDGE, BOOTSTRAP = range(4)
"""The streams of random numbers: robots for the search, the score's scale and the judge, and the bootstrap's resamples.
Each robot also has a place in its stream, so it shares no random numbers with another robot or the bootstrap."""

SCALE_ROBOTS = 64

STEP = 0.3
"""First step size of the search: the sd of a gain's logarithm. Gains change by about a third, up or down."""

FLIGHTS = 8
"""Number of flights in a part. With more flights, workers wait at a generation's end; with fewer, overhead grows."""

LEVEL = 0.95
RESAMPLES = 4000
SIGNIFICANT = 1 - LEVEL


def problem(
    path: Path, board: str, sensors: str, mission: str | None, shares: Mapping[str, float], seed: int
) -> Problem:
    """Returns the problem of a model file: its present firmware, its mission, and the robots that the data allow.

    Args:
        path: path of model.toml; files of `calibrate` or `discover` in the same folder say which robots the data allow.
        board: a key of `boards.BOARDS`, or `PACKAGED`.
        sensors: the sensors of the robot.
        mission: file or name of a scenario; None: the packaged mission, scaled to the robot.
        shares: see `robots.Allowed`.
        seed: seed of the drawn robots.

    Raises:
        InputError: a file is bad, a value does not fit into a format, or the folder is not in a checkout.
    """
    if board == PACKAGED:
        return _packaged(path, sensors, mission, shares, seed)
    own = robot.load(path)
    plan = simulate.plan(own, simulate.mission(own, mission), sensors, seed)
    loop = boards.closed_loop(own, boards.BOARDS[board], sensors)
    loop.library()  # compiled before the workers start, so that a compiler error is reported once
    allowed = dataclasses.replace(robots.read(own.model, path, shares), devices=plan.devices)
    values = constants(own.vehicle, "coupled")
    firmware = {name: default(setting, values, "coupled") for name, setting in settings().items()}
    return Problem(plan, loop, allowed, firmware, seed)


def _packaged(path: Path, sensors: str, mission: str | None, shares: Mapping[str, float], seed: int) -> Problem:
    model = models.load(path)
    route = scenario.load(scenario.find(mission or "mission"))
    if route.kind != "mission":
        raise InputError("is a manoeuvre, which has no controller to tune", file=mission, field="kind")
    plan = flight.plan(route, model, profile="coupled", sensors=sensors, compensation=compensation.from_model(model))
    firmware = {**defaults("coupled"), "cruise": settings()["cruise"].raw(plan.cruise)}
    return Problem(plan, None, robots.read(model, path, shares), firmware, seed)


@dataclass(frozen=True)
class Rate:
    """The number of robots that succeeded, with Wilson's 95 % interval of the share."""

    successes: int
    robots: int
    low: float
    high: float

    @property
    def share(self) -> float:
        return self.successes / self.robots


@dataclass(frozen=True)
class Change:
    """A figure's means over the same robots with old and new gains, and the 95 % interval of the mean difference.

    Attributes:
        robots: number of robots in the means: all robots, or those that succeeded with both gain sets.
        low, high: ends of the interval of `after` - `before`, by bootstrap over robots.
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
    """The result of the judge.

    Attributes:
        before, after: outcomes of the same robots with the old and the new gains.
        gained, lost: number of robots that succeeded only with the new gains, and only with the old gains.
        p: the p-value of McNemar's exact test on `gained` and `lost`.
        changes: the changes of the figures; the first figure is the score.
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
        """Whether success is significantly higher, or the score is better and success is not significantly lower."""
        if self.is_worse_in_success:
            return False
        return (self.gained > self.lost and self.p < SIGNIFICANT) or self.changes[0].high < 0


def rate(outcomes: Sequence[Outcome]) -> Rate:
    """Returns the share of successes with its interval."""
    successes = sum(outcome.success for outcome in outcomes)
    interval = binomtest(successes, len(outcomes)).proportion_ci(LEVEL, method="wilson")
    return Rate(successes, len(outcomes), float(interval.low), float(interval.high))


def judge(before: Sequence[Outcome], after: Sequence[Outcome], by: Scale, seed: int) -> Judged:
    """Compares each robot's flights with old and new gains; `before` and `after` have the robots in the same order.

    Args:
        by: the units of the score.
        seed: seed of the bootstrap.
    """
    every = list(zip(before, after, strict=True))
    both = [(old, new) for old, new in every if old.success and new.success]
    gained = sum(new.success and not old.success for old, new in every)
    lost = sum(old.success and not new.success for old, new in every)
    p = float(binomtest(gained, gained + lost).pvalue) if gained + lost else 1.0
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(BOOTSTRAP,)))
    changes = [_compared("score", "", [(score(old, by), score(new, by)) for old, new in every], random)]
    for name, unit in (("cross_track", "m"), ("time", "s"), ("wear", "full duties")):
        pairs = [(getattr(old, name), getattr(new, name)) for old, new in both]
        changes.append(_compared(name.replace("_", "-"), unit, pairs, random))
    return Judged(tuple(before), tuple(after), rate(before), rate(after), gained, lost, p, tuple(changes))


def _compared(name: str, unit: str, pairs: Sequence[tuple[float, float]], random: np.random.Generator) -> Change:
    if not pairs:
        return Change(name, unit, 0, math.nan, math.nan, math.nan, math.nan)
    old, new = np.array(pairs).T
    difference = new - old
    low = high = float(difference.mean())
    if np.ptp(difference) > 0:
        resampled = bootstrap(
            (difference,), np.mean, confidence_level=LEVEL, n_resamples=RESAMPLES, method="percentile", rng=random
        )
        low, high = (float(end) for end in resampled.confidence_interval)
    return Change(name, unit, len(pairs), float(old.mean()), float(new.mean()), low, high)


Show = Callable[[str, int], None]
"""Called with the name of the present stage, and the number of flights so far."""


@dataclass(frozen=True)
class Tuned:
    """The result of `tune`.

    Attributes:
        gains: the gains to use: `found` if these gains are better, else the gains at the start.
        found: the gains at the end of the search.
        flights: the total number of flights.
    """

    problem: Problem
    space: Space
    gains: Raw
    found: Raw
    searched: Searched
    by: Scale
    judged: Judged
    robots: int
    budget: Budget
    flights: int

    @property
    def kept_start(self) -> bool:
        return dict(self.gains) == dict(self.problem.start)


def tune(problem: Problem, workers: Workers, *, robots: int, judges: int, budget: Budget, show: Show) -> Tuned:
    """Tunes gains for the robots that the data allow, and judges the gains on robots that the search did not fly.

    With a budget in gain sets, the result depends only on the problem and the arguments, not on the workers.

    Args:
        robots: number of robots that fly each gain set of the search.
        judges: number of robots that fly the old and the new gains.

    Raises:
        InputError: no drawn robot is within the physical ranges, or a library is missing.
        SimulationError: a flight cannot begin.
    """
    space = around(problem.start, problem.firmware)
    stage = ["scale"]
    with flyer(problem, workers, lambda count: show(stage[0], count)) as fly:
        by = scale(fly.fly([problem.start], SCALE, range(SCALE_ROBOTS))[0], problem)
        stage[0] = "search"
        searched = search(fly, space, problem.start, by, robots, budget)
        stage[0] = "judge"
        before, after = fly.fly([problem.start, searched.gains], JUDGE, range(judges))
        judged = judge(before, after, by, problem.seed)
        flights = fly.count
    gains = searched.gains if judged.better else dict(problem.start)
    return Tuned(problem, space, gains, searched.gains, searched, by, judged, robots, budget, flights)


def to_json(tuned: Tuned) -> dict[str, Any]:
    """Returns the object of summary.json."""
    judged, problem = tuned.judged, tuned.problem
    return {
        "robot": problem.plan.model.name,
        "kept_start": tuned.kept_start,
        "sensors": problem.plan.sensors,
        "mission": problem.plan.scenario.title,
        "uncertainty": problem.allowed.source,
        "explanations": [explanation.name for explanation in problem.allowed.explanations],
        "success": {"before": _rate(judged.rate_before), "after": _rate(judged.rate_after)},
        "gained": judged.gained,
        "lost": judged.lost,
        "p": judged.p,
        "changes": {change.name: _change(change) for change in judged.changes},
        "failures": {"before": _causes(judged.before), "after": _causes(judged.after)},
        "gains": {
            name: {
                "unit": settings()[name].format.unit,
                "before": settings()[name].value(problem.start[name]),
                "after": settings()[name].value(tuned.found[name]),
                "raw_before": problem.start[name],
                "raw_after": tuned.found[name],
                "raw_range": [int(low), int(high)],
            }
            for name, low, high in zip(tuned.space.names, tuned.space.low, tuned.space.high, strict=True)
        },
        "search": [dataclasses.asdict(generation) for generation in tuned.searched.generations],
        "robots": tuned.robots,
        "budget": tuned.budget.text,
        "flights": tuned.flights,
        "seed": problem.seed,
    }


def _rate(rate: Rate) -> dict[str, Any]:
    return {"successes": rate.successes, "robots": rate.robots, "share": rate.share, "ci95": [rate.low, rate.high]}


def _change(change: Change) -> dict[str, Any]:
    known = change.robots > 0
    values = {"before": change.before, "after": change.after, "difference": change.after - change.before}
    shown = {name: value if known else None for name, value in values.items()}
    return {"unit": change.unit, "robots": change.robots, **shown, "ci95": [change.low, change.high] if known else None}


def _causes(outcomes: Sequence[Outcome]) -> dict[str, int]:
    counts = Counter(outcome.cause for outcome in outcomes if outcome.cause)
    return dict(sorted(counts.items(), key=lambda row: (-row[1], row[0])))


@dataclass(frozen=True)
class Budget:
    """The search ends after the generation in which it reaches `sets` gain sets or `seconds`."""

    sets: int | None
    seconds: float | None

    @property
    def text(self) -> str:
        return f"{self.sets} gain sets" if self.sets is not None else f"{self.seconds:g} s"

    def is_spent(self, sets: int, elapsed: float) -> bool:
        """Whether the budget is spent after `sets` gain sets and `elapsed` s; a search has at least one generation."""
        if self.sets is not None:
            return sets >= self.sets
        return self.seconds is not None and elapsed >= self.seconds and sets > 0


@dataclass(frozen=True)
class Generation:
    """One generation of the search.

    Attributes:
        sets: number of gain sets flown until the generation's end.
        best, middle: the least and the median of the gain sets' mean scores over robots.
        success: share of successful flights, among the flights of all sets.
        step: the step size of the search: an sd of the logarithm of the gains.
    """

    sets: int
    best: float
    middle: float
    success: float
    step: float


@dataclass(frozen=True)
class Searched:
    """The gains at the end of the search, and its generations."""

    gains: Raw
    generations: tuple[Generation, ...]


def search(flyer: Flyer, space: Space, start: Raw, by: Scale, robots: int, budget: Budget) -> Searched:
    """Returns the gains at the end of the search.

    Args:
        by: the units of the score.
        robots: how many robots fly each gain set.

    Raises:
        InputError: pycma is not installed.
    """
    try:
        import cma
    except ImportError:
        raise InputError("needs the library cma: pip install 'brickpilot[tune]'", field="tune") from None
    began, sets = time.monotonic(), 0
    options = {
        "bounds": [list(bound) for bound in space.bounds()],
        "seed": flyer.problem.seed % (2**31 - 1) + 1,  # pycma's seeds end at 2^31 - 1; for 0 it takes the clock
        "verbose": -9,
    }
    strategy = cma.CMAEvolutionStrategy(space.coordinates(start), STEP, options)
    generations: list[Generation] = []
    while not strategy.stop() and not budget.is_spent(sets, time.monotonic() - began):
        places = range(robots * len(generations), robots * (len(generations) + 1))
        asked = strategy.ask()
        flown = flyer.fly([space.raw(np.asarray(coordinates)) for coordinates in asked], SEARCH, places)
        means = [float(np.mean([score(outcome, by) for outcome in outcomes])) for outcomes in flown]
        strategy.tell(asked, means)
        sets += len(flown)
        success = float(np.mean([outcome.success for outcomes in flown for outcome in outcomes]))
        middle = float(np.median(means))
        generations.append(Generation(sets, min(means), middle, success, float(strategy.sigma)))
    return Searched(space.raw(np.asarray(strategy.result.xfavorite)), tuple(generations))


@dataclass
class Flyer:
    """Flies on workers that stay alive between calls, because a worker takes a second to start.

    Attributes:
        flown: function that is called after each part, with the number of flights so far.
        count: number of flights so far.
    """

    problem: Problem
    results: Results
    flown: Callable[[int], None]
    count: int = 0

    def fly(self, sets: Sequence[Raw], stream: int, places: Sequence[int]) -> list[list[Outcome]]:
        """Returns the outcomes of each gain set; all sets are flown by the same robots, with the same noise."""
        groups = [tuple(places[begin : begin + FLIGHTS]) for begin in range(0, len(places), FLIGHTS)]
        keys = [[f"{stream}-{places[0]}-{number}-{group[0]}" for group in groups] for number in range(len(sets))]
        parts = [
            Part(key, Batch(self.problem, gains, stream, group))
            for gains, row in zip(sets, keys, strict=True)
            for key, group in zip(row, groups, strict=True)
        ]
        flown: dict[str, list[Outcome]] = {}
        for part, outcomes in self.results(parts):
            flown[part.key] = outcomes
            self.count += len(outcomes)
            self.flown(self.count)
        return [[outcome for key in row for outcome in flown[key]] for row in keys]


@contextmanager
def flyer(problem: Problem, workers: Workers, flown: Callable[[int], None]) -> Iterator[Flyer]:
    """Yields the `Flyer` of the problem; its workers stop at the end."""
    with workers.started(fly_batch) as results:
        yield Flyer(problem, results, flown)
