"""The tuning problem: one robot's controller, tested in flights of one mission by robots that the data allow.

The search has one coordinate for each tuned gain. A coordinate is `log(raw + offset)`, because ratios of gains matter.
The offset gives a gain of 0 a finite coordinate, from which the gain can grow. The search keeps each gain within a
factor of its value at the start and within the range of its format. It scores gains that are rounded to integers.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign import robots, runs
from brickpilot.campaign.robots import Allowed
from brickpilot.firmware.boards import ClosedLoop
from brickpilot.vehicle import flight
from brickpilot.vehicle.gains import AT_MOST, Gains
from brickpilot.vehicle.settings import defaults, settings

Array = NDArray[np.float64]

PIDS = ("speed_kp", "speed_ki", "heading_kp", "heading_ki", "heading_kd", "feedforward")
GUIDANCE = ("cruise", "decel", "bearing_hold", "pivot", "align")
TUNED = PIDS + GUIDANCE
"""The gains that are tuned: those of both PIDs, and those of the line-of-sight guidance."""

FACTOR_PID, FACTOR_GUIDANCE = 10.0, 3.0
"""Largest factors by which the search changes a PID's and a guidance gain; beyond, the kind of control would change."""

OFFSET = 0.02
"""Offset as a share of the packaged robot's raw value; a gain well below the offset has nearly the coordinate of 0."""


@dataclass(frozen=True)
class Space:
    """Ranges of the search, in raw integers; arrays are (gains,), in the order of `names`."""

    names: tuple[str, ...]
    offset: Array
    low: Array
    high: Array

    def coordinates(self, raw: Mapping[str, int]) -> Array:
        """Returns the coordinates of a gain set, (gains,)."""
        return np.asarray(np.log(np.array([float(raw[name]) for name in self.names]) + self.offset))

    def raw(self, coordinates: Array) -> dict[str, int]:
        """Returns the raw integers at these coordinates: rounded, within the ranges and in agreement with `AT_MOST`."""
        values = np.clip(np.exp(coordinates) - self.offset, self.low, self.high)
        raw = {name: int(value) for name, value in zip(self.names, np.rint(values), strict=True)}
        for less, more in AT_MOST:
            if less in raw and more in raw:
                most = settings()[less].raw(settings()[more].value(raw[more]))
                raw[less] = min(raw[less], most)
        return raw

    def bounds(self) -> tuple[Array, Array]:
        """Returns the least and the largest coordinate of each gain."""
        return np.log(self.low + self.offset), np.log(self.high + self.offset)


def around(start: Mapping[str, int], firmware: Mapping[str, int]) -> Space:
    """Returns the search space about the gains at the start.

    Args:
        start: raw integers of `TUNED`.
        firmware: raw integers of all settings; the tuned settings have to agree with the other settings.
    """
    names = tuple(name for name in TUNED if name in start)
    packaged = defaults("coupled")
    offset = np.array([max(OFFSET * packaged[name], 1.0) for name in names])
    rows = [_range(name, start, firmware, float(more)) for name, more in zip(names, offset, strict=True)]
    low, high = np.array(rows, dtype=float).T
    return Space(names, offset, low, high)


def _range(name: str, start: Mapping[str, int], firmware: Mapping[str, int], offset: float) -> tuple[int, int]:
    factor, row = (FACTOR_PID if name in PIDS else FACTOR_GUIDANCE), settings()[name]
    low = max(row.low, round((start[name] + offset) / factor - offset))
    high = min(row.high, round((start[name] + offset) * factor - offset))
    for less, more in AT_MOST:  # a `less` that is not tuned limits `more`
        if name == more and less not in start:
            low = max(low, row.raw(settings()[less].value(firmware[less])))
    return min(low, start[name]), max(high, start[name])


Raw = Mapping[str, int]
"""Setting -> its raw integer in a flight."""


@dataclass(frozen=True)
class Problem:
    """The tuning problem of one robot; small, and picklable for workers.

    Attributes:
        plan: the plan of a flight by the robot of the best explanation, with the firmware's own gains; `planned` sets
            its `firmware` from `loop`.
        loop: the robot's own firmware; None: the packaged firmware.
        allowed: the robots whose values the data allow.
        firmware: the present values of all settings.
        seed: seed of the drawn robots.
    """

    plan: flight.Plan
    loop: ClosedLoop | None
    allowed: Allowed
    firmware: Raw
    seed: int

    @property
    def start(self) -> dict[str, int]:
        """The present values of the gains that are tuned."""
        return {name: self.firmware[name] for name in TUNED}

    def planned(self, robot: robots.Robot, gains: Raw) -> flight.Plan:
        """Returns the plan of a flight of the drawn `robot` with `gains`."""
        scenario = self.plan.scenario  # the scenario's values of the plant replace those of each robot
        model = dataclasses.replace(
            robot.model,
            parameters={**robot.model.parameters, **scenario.parameters},
            effects={**robot.model.effects, **scenario.effects},
        )
        return dataclasses.replace(
            self.plan,
            model=model,
            seed=robot.seed,
            devices=robot.devices,
            gains=Gains(self.plan.model.name, gains),
            firmware=None if self.loop is None else self.loop.library(),
        )


class Outcome(NamedTuple):
    """The figures of a flight that the score uses.

    Attributes:
        success: whether every waypoint was reached without a fault.
        missed: share of the waypoints that were not reached; 1 if the simulation diverged.
        cross_track: rms cross-track error while driving, m; NaN: the robot never drove.
        time: time of the last waypoint, s; NaN: this waypoint was not reached.
        wear: the sum of the absolute changes of both motors' duties, in full duties.
        cause: why the flight failed; empty: the flight succeeded.
    """

    success: bool
    missed: float
    cross_track: float
    time: float
    wear: float
    cause: str


class Batch(NamedTuple):
    """Some flights with one gain set, for a worker.

    Attributes:
        stream, places: the stream of drawn robots, and the robots' places in the stream.
    """

    problem: Problem
    gains: Raw
    stream: int
    places: tuple[int, ...]


def fly_batch(batch: Batch) -> list[Outcome]:
    """Returns the outcomes of the flights of a batch, in the order of its places."""
    drawn = robots.draw(batch.problem.allowed, batch.problem.seed, batch.stream, batch.places)
    return outcomes([batch.problem.planned(robot, batch.gains) for robot in drawn])


def outcomes(plans: Sequence[flight.Plan]) -> list[Outcome]:
    """Flies plans and returns their outcomes."""
    return [_outcome(row) for row in runs.rows(plans)]


def _outcome(row: runs.Row) -> Outcome:
    missed = 1.0 - float(row["waypoints_reached"]) / float(row["waypoints_total"])
    track, time, wear = (float(row[name]) for name in ("cross_track_rms_m", "time_s", "duty_travel"))
    return Outcome(bool(row["success"]), missed, track, time, wear, str(row["cause"]))


@dataclass(frozen=True)
class Scale:
    """The units of the terms of the score.

    Attributes:
        acceptance: m, the acceptance radius of the robot.
        time: s, the median time of the successful flights with the start's gains.
        wear: full duties, the median wear of the same flights.
        longest: s, the longest flight; a robot that does not arrive gets this time.
    """

    acceptance: float
    time: float
    wear: float
    longest: float


MISSED, TIME, WEAR = 100.0, 0.5, 0.1
"""Weights of the score. A waypoint missed by one robot of a hundred costs more than any observed change of the other
terms. A cross-track error of one acceptance radius costs as much as twice the start's time, or as ten times the start's
wear."""

_LEAST = 0.1  # a fault after the last waypoint costs as much as this share of missed waypoints

UNKNOWN_RADII = 5.0
"""Cross-track error of a robot that never drove, in acceptance radii."""


def scale(outcomes: Sequence[Outcome], problem: Problem) -> Scale:
    """Returns the units of the score, computed from the flights with the start's gains."""
    longest = problem.plan.scenario.duration
    known = [outcome for outcome in outcomes if outcome.success]
    time = float(np.median([outcome.time for outcome in known])) if known else longest
    wear = float(np.median([outcome.wear for outcome in known or outcomes]))
    return Scale(problem.plan.acceptance, time, max(wear, 1.0), longest)


def score(outcome: Outcome, by: Scale) -> float:
    """Returns the cost of a flight, to be averaged over robots; less is better.

    100 missed + cross-track rms / by.acceptance + time / (2 by.time) + wear / (10 by.wear); missed is the share of
    waypoints that were missed, at least 0.1 of a flight that failed.
    """
    track = UNKNOWN_RADII if math.isnan(outcome.cross_track) else outcome.cross_track / by.acceptance
    time = by.longest if math.isnan(outcome.time) else outcome.time
    wear = by.wear if math.isnan(outcome.wear) else outcome.wear
    return (
        MISSED * max(outcome.missed, _LEAST * (not outcome.success))
        + track
        + TIME * time / by.time
        + WEAR * wear / by.wear
    )
