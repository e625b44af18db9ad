"""A small tuning in this process: the packaged firmware with poor gains, on a short mission."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from brickpilot.campaign.run_parts import Function, Results
from brickpilot.discover.prepare import SD_SHARE
from brickpilot.tune.task import Problem
from brickpilot.tune.tuner import PACKAGED, Budget, Tuned, problem, tune
from brickpilot.vehicle import model
from brickpilot.vehicle.model import rcx
from pages import HOSTILE

SHORT = """name = "short"
title = "there and aside"
kind = "mission"
duration_s = 10
waypoints_m = [[0.7, 0], [0.7, 0.6]]
"""
ROBOTS, JUDGES, BUDGET = 6, 60, Budget(44, None)


class Here:
    """Runs all parts in this process, the last part first."""

    @contextmanager
    def started(self, function: Function) -> Iterator[Results]:
        yield lambda parts: ((part, function(part.argument)) for part in reversed(list(parts)))


def ready(folder: Path, name: str = "bench", seed: int = 0) -> Problem:
    """Returns the tuning problem of the packaged robot on a short mission, with the usual sd of each kind of value."""
    (folder / "short.toml").write_text(SHORT)
    model.save(dataclasses.replace(rcx(), name=name), folder / "model.toml")
    route = str(folder / "short.toml")
    return problem(folder / "model.toml", PACKAGED, "imu+encoders", route, SD_SHARE, seed)


@cache
def poor(folder: Path) -> Tuned:
    """Returns the tuning of start gains with which many robots turn too late to reach the second waypoint."""
    given = ready(folder, HOSTILE)
    firmware = {**given.firmware, "heading_kp": 90, "heading_ki": 0, "pivot": 15000}
    return tune(
        dataclasses.replace(given, firmware=firmware),
        Here(),
        robots=ROBOTS,
        judges=JUDGES,
        budget=BUDGET,
        show=lambda *_: None,
    )
