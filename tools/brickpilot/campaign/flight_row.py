"""One flight of a campaign as one flat row of figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brickpilot.errors import SimulationError
from brickpilot.vehicle import flight, flight_figures, plant

if TYPE_CHECKING:
    from brickpilot.hil.fly import HilFlight

DIVERGED = "the simulation diverged"
_E_DIVERGED = -5  # BP_E_DIVERGED of the C interface

Row = dict[str, float | int | bool | str]

_LOGGED = (
    "time_s", "true_x_m", "true_y_m", "true_heading_rad", "charge_c", "estimate_x_m", "estimate_y_m", "bias_unknown",
    "gyro_full_steps", "mode", "fault", "phase", "waypoint", "overshoots", "demand_heading_rad", "surge_saturated",
    "yaw_saturated",
)  # fmt: skip
"""The columns of the log that the figures need."""

_CAUSES = {
    "arrived": "took a missed waypoint for reached",
    "run": "time ran out",
    "idle": "was not started",
    "fault": "stopped",
}
"""The controller's last mode -> why a waypoint was missed, if no fault explains it."""

UNITS = {
    "success": "", "cause": "", "reached_all": "", "waypoints_reached": "", "waypoints_total": "", "time_s": "s",
    "cross_track_rms_m": "m", "cross_track_max_m": "m", "heading_rms_rad": "rad", "closest_approach_max_m": "m",
    "position_estimate_error_m": "m", "overshoots": "", "saturated_surge_steps": "", "saturated_yaw_steps": "",
    "charge_c": "C", "duty_travel": "", "ended_at_s": "s", "final_mode": "", "fault": "", "seed": "",
    "motor_stream_sha256": "",
}  # fmt: skip
"""The figures of a row -> unit, in the order of a row."""

WORDS = ("cause", "final_mode", "fault", "motor_stream_sha256")
"""The figures that are texts."""

TRUTHS = ("success", "reached_all")
COUNTS = (
    "waypoints_reached", "waypoints_total", "overshoots", "saturated_surge_steps", "saturated_yaw_steps", "seed",
)  # fmt: skip


def row(plan: flight.Plan) -> Row:
    """Flies one mission and returns its figures: see `rows`."""
    [found] = rows([plan])
    return found


def rows(plans: Sequence[flight.Plan]) -> list[Row]:
    """Flies missions and returns the figures of each. If a scenario has faults, a link is between plant and brick.

    Missions without faults fly side by side, with one firmware: this takes less time and changes no byte.

    Keys are those of `UNITS`. `success` is: every waypoint reached, and no fault; `cause` says in words why a mission
    failed, and is empty otherwise. `time_s` is when the last waypoint was reached, `closest_approach_max_m` the largest
    of the waypoints' closest approaches, `charge_c` what the battery gave. A number that a flight does not have is NaN.
    A flight whose simulation diverges has this as its cause, and no further figures.

    Raises:
        InputError: the plant refuses the model.
        SimulationError: a flight cannot begin, as where the firmware refuses its route.
    """
    found: dict[int, Row] = {}
    alone = [index for index, plan in enumerate(plans) if not plan.scenario.faults]
    for first in range(0, len(alone), plant.MOST_LANES):
        group = alone[first : first + plant.MOST_LANES]
        flown = flight.fly_many([plans[index] for index in group], _LOGGED)
        found |= {index: _row(plans[index], one) for index, one in zip(group, flown, strict=True)}
    return [found[index] if index in found else _linked_row(plan) for index, plan in enumerate(plans)]


def _row(plan: flight.Plan, flown: flight.Flight | SimulationError) -> Row:
    if isinstance(flown, flight.Flight):
        return figures(flown)
    if flown.status != _E_DIVERGED:
        raise flown
    return diverged(plan)


def _linked_row(plan: flight.Plan) -> Row:
    from brickpilot.hil import fly

    try:
        return over_a_link(fly.fly_alone(plan))
    except SimulationError as error:
        return _row(plan, error)


def figures(flown: flight.Flight) -> Row:
    """Returns the row of a flight whose log has at least the columns that the figures need."""
    route, end = flight_figures.route_figures(flown), flight_figures.final_figures(flown)
    reached_all = route["waypoints_reached"] == route["waypoints_total"]
    cause = _cause(reached_all, end)
    return {
        "success": not cause,
        "cause": cause,
        "reached_all": reached_all,
        "waypoints_reached": route["waypoints_reached"],
        "waypoints_total": route["waypoints_total"],
        "time_s": _number(route["reached_at_s"][-1]),
        "cross_track_rms_m": _number(route["cross_track_rms_m"]),
        "cross_track_max_m": _number(route["cross_track_max_m"]),
        "heading_rms_rad": _number(route["heading_rms_rad"]),
        "closest_approach_max_m": max(route["closest_approach_m"]),
        "position_estimate_error_m": _number(route["position_estimate_error_m"]),
        "overshoots": end["overshoots"],
        "saturated_surge_steps": end["saturated_steps"]["surge"],
        "saturated_yaw_steps": end["saturated_steps"]["yaw"],
        "charge_c": float(flown.log["charge_c"][-1]),
        "duty_travel": float(np.abs(np.diff(flown.motors.astype(np.int32), axis=0)).sum() / 32767),
        "ended_at_s": _number(end["ended_at_s"]),
        "final_mode": end["final_mode"],
        "fault": end["fault"],
        "seed": flown.plan.seed,
        "motor_stream_sha256": flight_figures.motor_hash(flown),
    }


def over_a_link(flown: HilFlight) -> Row:
    """Returns the row of a flight over a link, which also fails if the link ends it."""
    row = figures(flown.flight)
    if flown.broke_off is None:
        return row
    return row | {"success": False, "cause": flown.broke_off.split(":")[0].split(",")[0]}


def diverged(plan: flight.Plan) -> Row:
    """Returns the row of a flight whose simulation diverged."""
    unknown: Row = {name: math.nan for name in UNITS}
    return unknown | {
        "success": False,
        "cause": DIVERGED,
        "reached_all": False,
        "waypoints_reached": 0,
        "waypoints_total": len(plan.scenario.waypoints),
        "overshoots": 0,
        "saturated_surge_steps": 0,
        "saturated_yaw_steps": 0,
        "final_mode": "",
        "fault": "",
        "seed": plan.seed,
        "motor_stream_sha256": "",
    }


def _cause(reached_all: bool, end: Mapping[str, Any]) -> str:
    """Returns why the mission failed: the same words for all flights of one kind, so that they can be counted."""
    if end["fault"] != "none":
        return f"fault: {end['fault']}"
    return "" if reached_all else _CAUSES[end["final_mode"]]


def _number(value: float | None) -> float:
    return math.nan if value is None else value
