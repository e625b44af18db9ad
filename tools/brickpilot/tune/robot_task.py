"""Makes the tuning problem of one robot: its present firmware, its mission, and the robots that the data allow.

It is separate from `task`, which workers load, because workers need no library of a link.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from brickpilot.campaign import robots
from brickpilot.errors import InputError
from brickpilot.firmware import boards, robot, simulate
from brickpilot.firmware.robot import Robot
from brickpilot.tune.task import TUNED, Problem, Raw
from brickpilot.vehicle import compensation, flight, scenario
from brickpilot.vehicle import model as models
from brickpilot.vehicle.settings import constants, default, defaults, settings

PACKAGED = "packaged"
"""The value of `board` for the project's own firmware, with the compensation of the model."""


@dataclasses.dataclass(frozen=True)
class Ready:
    """A problem, and the raw integers of all settings of its firmware."""

    problem: Problem
    firmware: Raw


def problem(path: Path, board: str, sensors: str, mission: str | None, shares: Mapping[str, float], seed: int) -> Ready:
    """Returns the problem of a model file.

    Args:
        path: path of model.toml; the files of `calibrate` or `discover` beside it say which robots the data allow.
        board: a key of `boards.BOARDS`, or `PACKAGED`.
        sensors: the sensors of the robot.
        mission: file or name of a scenario; None: the packaged mission, scaled to the robot.
        shares: see `robots.Allowed`.
        seed: seed of the drawn robots.

    Raises:
        InputError: a file is bad, a value does not fit into a format, or no checkout is here.
    """
    if board == PACKAGED:
        return _packaged(path, sensors, mission, shares, seed)
    own = robot.load(path)
    route = simulate.mission(own, mission)
    plan = simulate.plan(own, route, sensors, seed)
    loop = boards.closed_loop(own, boards.BOARDS[board], sensors)
    loop.library()  # compiled here first, so that a compiler error is reported once
    allowed = dataclasses.replace(robots.read(own.model, path, shares), devices=plan.devices)
    firmware = _settings(own)
    return Ready(Problem(plan, loop, allowed, {name: firmware[name] for name in TUNED}, seed), firmware)


def _settings(own: Robot) -> dict[str, int]:
    """Returns the raw integers of all settings with which the robot's own firmware starts."""
    values = constants(own.vehicle, "coupled")
    return {name: default(setting, values, "coupled") for name, setting in settings().items()}


def _packaged(path: Path, sensors: str, mission: str | None, shares: Mapping[str, float], seed: int) -> Ready:
    model = models.load(path)
    route = scenario.load(scenario.find(mission or "mission"))
    if route.kind != "mission":
        raise InputError("is a manoeuvre, which has no controller to tune", file=mission, field="kind")
    plan = flight.plan(route, model, profile="coupled", sensors=sensors, compensation=compensation.from_model(model))
    firmware = dict(defaults("coupled")) | {"cruise": settings()["cruise"].raw(plan.cruise)}
    start = {name: firmware[name] for name in TUNED}
    return Ready(Problem(plan, None, robots.read(model, path, shares), start, seed), firmware)
