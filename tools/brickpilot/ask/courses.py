"""Missions that a robot may fly in a limited space, and the choice of the mission that separates rivals most.

A course is a mission: the brick's autopilot drives it, so any brick that flies missions can drive a course.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.constants import ACCEPTANCE_M
from brickpilot.discover.experiment import SEPARATES_NOISE_SD, rms_apart
from brickpilot.errors import InputError
from brickpilot.vehicle import flight, plant
from brickpilot.vehicle.flight import Flight
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.scenario import Scenario

ROLL_OUT_S = 0.4  # time constant, s, with which the robot slows down after its motors are off
_LEAST_SPACE_M = 4 * ACCEPTANCE_M  # in a smaller space, a waypoint counts as reached before a leg is driven
_SHARES = (1.0, 0.5)  # each course is offered at these shares of the user's speed
_COLUMNS = ("time_s", "true_x_m", "true_y_m", "left_duty", "right_duty", "battery_v")
_EVERY = 3  # steps of 3 ms from one sample of a simulated course to the next

_FORMS: Mapping[str, Sequence[tuple[float, float]]] = {
    "out and back": ((1.0, 0.0), (0.0, 0.0)),
    "a square to the right": ((0.7, 0.0), (0.7, 0.7), (0.0, 0.7), (0.0, 0.0)),
    "a square to the left": ((0.7, 0.0), (0.7, -0.7), (0.0, -0.7), (0.0, 0.0)),
    "short legs": ((0.4, 0.0), (0.0, 0.0), (0.4, 0.0), (0.0, 0.0), (0.4, 0.0), (0.0, 0.0)),
    "curves to both sides": ((0.4, 0.1), (0.8, -0.2), (0.4, -0.5), (0.0, -0.3)),
}
"""Name -> waypoints, as shares of the largest distance from the start."""


@dataclass(frozen=True)
class Limits:
    """The limits that the user sets.

    Attributes:
        space_m: largest distance from the start, m.
        speed_m_s: largest speed, m/s.
        battery_v: no course begins at a lower voltage of the battery, V; None: no such limit.
        most: the largest number of courses.
    """

    space_m: float = 1.5
    speed_m_s: float = 0.4
    battery_v: float | None = None
    most: int = 6

    def __post_init__(self) -> None:
        if not self.space_m >= _LEAST_SPACE_M:
            raise InputError(f"needs {_LEAST_SPACE_M:.2g} m or more, not {self.space_m:g}", field="space")
        if not 0.05 <= self.speed_m_s <= 1.6:
            raise InputError(f"needs 0.05 to 1.6 m/s, not {self.speed_m_s:g}", field="speed")
        if not self.reach_m > _LEAST_SPACE_M / 2:
            raise InputError(f"is too fast for {self.space_m:g} m: the robot rolls out", field="speed")

    @property
    def reach_m(self) -> float:
        """Distance from the start, m, at which the motors stop, so that the robot rolls out within `space_m`."""
        return self.space_m - ROLL_OUT_S * self.speed_m_s


def courses(limits: Limits) -> list[Scenario]:
    """Returns the missions that fit the limits; the robot passes each waypoint within its acceptance radius."""
    size = limits.reach_m - ACCEPTANCE_M
    made = []
    for share in _SHARES:
        speed = share * limits.speed_m_s
        for name, form in _FORMS.items():
            points = tuple((round(size * x, 3), round(size * y, 3)) for x, y in form)
            path = sum(map(math.dist, ((0.0, 0.0), *points[:-1]), points))
            title = f"{name} at {speed:.2g} m/s"
            file_name = f"{name.replace(' ', '_')}_{1000 * speed:.0f}_mm_s"
            seconds = math.ceil(2 * path / speed + 5 * len(points))
            made.append(Scenario(file_name, title, "mission", seconds, waypoints=points, cruise={"coupled": speed}))
    return made


def safe(chosen: Sequence[Scenario], models: Sequence[Model], sensors: str, limits: Limits) -> list[list[Flight]]:
    """Returns, for each course, a flight under each model; no flights if a flight leaves the space or diverges."""
    made = []
    for course in chosen:
        plans = [flight.plan(course, model, sensors=sensors, profile="coupled") for model in models]
        flights = [flown for flown in flight.fly_many(plans, _COLUMNS) if isinstance(flown, Flight)]
        within = [np.hypot(flown.log["true_x_m"], flown.log["true_y_m"]).max() < limits.reach_m for flown in flights]
        made.append(flights if len(flights) == len(models) and all(within) else [])
    return made


def deciding(
    rivals: Sequence[Model], noise_sd: Mapping[str, float], chosen: Sequence[Scenario], sensors: str, limits: Limits
) -> tuple[Scenario, float, str] | None:
    """Returns the course that separates the rivals most, the separation in noise sd, and the signal that shows it.

    Each rival flies each course in simulation. All rivals are then simulated with the commands of that flight, because
    `discover` simulates them with the measured commands. None: no course separates the rivals clearly.

    Args:
        rivals: two or more fitted models.
        noise_sd: measured signal -> noise sd of a sample, SI.
    """
    found: list[tuple[float, str, Scenario]] = []
    for course, flown in zip(chosen, safe(chosen, rivals, sensors, limits), strict=True):
        for one in flown:
            log = {name: values[::_EVERY] for name, values in one.log.items()}
            volts = np.column_stack([log[f"{side}_duty"] * log["battery_v"] for side in ("left", "right")])
            run = plant.OpenLoopRun(log["time_s"], volts)
            outputs = [each.outputs for each in plant.simulate([(model, run) for model in rivals], threads=2)]
            found.append((*rms_apart(outputs, noise_sd), course))
    if not found:
        return None
    apart, signal, course = max(found, key=lambda one: one[0])
    return (course, apart, signal) if apart >= SEPARATES_NOISE_SD else None
