"""Tunes the gains of one robot: the search, the judge, and what is kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from brickpilot.campaign.engine import Workers
from brickpilot.tune.cma import Budget, Searched, search
from brickpilot.tune.flying import Flyer, flyer
from brickpilot.tune.judge import JUDGE, Change, Judged, Rate, judge
from brickpilot.tune.space import Space, around
from brickpilot.tune.task import Problem, Raw, Scale, scale
from brickpilot.vehicle.settings import settings

SCALE = 1
"""The stream of the robots that the start flies for the scale of the score."""

SCALE_ROBOTS = 64

Show = Callable[[str, int], None]
"""Takes what is done now, and the flights so far."""


@dataclass(frozen=True)
class Tuned:
    """The result of `tune`.

    Attributes:
        gains: those to fly with: the found ones, or the start's where these are not better.
        found: the gains that the search ended with.
        flights: in all.
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


def tune(
    problem: Problem, firmware: Raw, workers: Workers, *, robots: int, judges: int, budget: Budget, show: Show
) -> Tuned:
    """Returns the gains for the robots that the data allow, judged on others of them.

    The same problem, numbers and budget in gain sets give the same result, whatever the workers.

    Args:
        firmware: raw integers of all settings of the firmware.
        robots: that fly each gain set of the search.
        judges: that fly before and after.

    Raises:
        InputError: the data allow no robot, or a library is missing.
        SimulationError: a flight cannot begin.
    """
    space = around(problem.start, firmware)
    stage = ["scale"]
    with flyer(problem, workers, lambda count: show(stage[0], count)) as fly:
        by = scale(fly.fly([problem.start], SCALE, range(SCALE_ROBOTS))[0], problem)
        stage[0] = "search"
        searched = search(fly, space, problem.start, by, robots, budget)
        stage[0] = "judge"
        judged = _judged(fly, searched.gains, by, judges)
        flights = fly.count
    gains = searched.gains if judged.better else dict(problem.start)
    return Tuned(problem, space, gains, searched.gains, searched, by, judged, robots, budget, flights)


def _judged(fly: Flyer, found: Raw, by: Scale, judges: int) -> Judged:
    before, after = fly.fly([fly.problem.start, found], JUDGE, range(judges))
    return judge(before, after, by, fly.problem.seed)


def to_json(tuned: Tuned) -> dict[str, Any]:
    """Returns the object of summary.json."""
    judged, problem = tuned.judged, tuned.problem
    return {
        "robot": problem.plan.model.name,
        "kept_start": tuned.kept_start,
        "sensors": problem.plan.sensors,
        "mission": problem.plan.scenario.title,
        "uncertainty": problem.allowed.source,
        "explanations": [one.name for one in problem.allowed.explanations],
        "success": {"before": _rate(judged.rate_before), "after": _rate(judged.rate_after)},
        "gained": judged.gained,
        "lost": judged.lost,
        "p": judged.p,
        "changes": {one.name: _change(one) for one in judged.changes},
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
        "search": [
            {"sets": one.sets, "best": one.best, "middle": one.middle, "success": one.success, "step": one.step}
            for one in tuned.searched.generations
        ],
        "robots": tuned.robots,
        "budget": tuned.budget.text,
        "flights": tuned.flights,
        "seed": problem.seed,
    }


def _rate(one: Rate) -> dict[str, Any]:
    return {"successes": one.successes, "robots": one.robots, "share": one.share, "ci95": [one.low, one.high]}


def _change(one: Change) -> dict[str, Any]:
    known = one.robots > 0
    values = {"before": one.before, "after": one.after, "difference": one.after - one.before}
    shown = {name: value if known else None for name, value in values.items()}
    return {"unit": one.unit, "robots": one.robots, **shown, "ci95": [one.low, one.high] if known else None}


def _causes(outcomes: tuple[Any, ...]) -> dict[str, int]:
    found: dict[str, int] = {}
    for one in outcomes:
        if one.cause:
            found[one.cause] = found.get(one.cause, 0) + 1
    return dict(sorted(found.items(), key=lambda row: (-row[1], row[0])))
