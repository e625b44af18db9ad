"""The runs of a campaign: the plan of each run, its flight, and its row of figures."""

from __future__ import annotations

import dataclasses
import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from brickpilot.campaign import designs, inputs, robots
from brickpilot.campaign.file import Box, Campaign
from brickpilot.campaign.inputs import ON, Drawn
from brickpilot.campaign.robots import Robot
from brickpilot.campaign.run_parts import Part
from brickpilot.errors import SimulationError
from brickpilot.vehicle import flight, flight_figures, plant
from brickpilot.vehicle.scenario import Scenario

if TYPE_CHECKING:
    from brickpilot.hil.fly import HilFlight

Array = NDArray[np.float64]

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
"""The controller's last mode -> why the flight missed a waypoint, if the flight has no fault."""

UNITS = {
    "success": "", "cause": "", "reached_all": "", "waypoints_reached": "", "waypoints_total": "", "time_s": "s",
    "cross_track_rms_m": "m", "cross_track_max_m": "m", "heading_rms_rad": "rad", "closest_approach_max_m": "m",
    "position_estimate_error_m": "m", "overshoots": "", "saturated_surge_steps": "", "saturated_yaw_steps": "",
    "charge_c": "C", "duty_travel": "", "ended_at_s": "s", "final_mode": "", "fault": "", "seed": "",
    "motor_stream_sha256": "",
}  # fmt: skip
"""Figure -> unit, in the order of a row."""

WORDS = ("cause", "final_mode", "fault", "motor_stream_sha256")
"""The figures that are texts."""

_COUNTS = ("waypoints_reached", "waypoints_total", "overshoots", "saturated_surge_steps", "saturated_yaw_steps", "seed")
_TYPES: Mapping[str, type] = {
    **dict.fromkeys(WORDS, str),
    **dict.fromkeys(("success", "reached_all"), bool),
    **dict.fromkeys(_COUNTS, int),
}
"""Figure -> type, for the figures whose type is not float."""


def row(plan: flight.Plan) -> Row:
    """Flies one mission and returns its figures: see `rows`."""
    [figures_of_run] = rows([plan])
    return figures_of_run


def rows(plans: Sequence[flight.Plan]) -> list[Row]:
    """Flies missions and returns each mission's figures. If a scenario has faults, a link is between plant and brick.

    Missions without faults fly side by side in the plant's lanes. This takes less time and gives the same figures.

    The keys are those of `UNITS`. `success`: every waypoint was reached without a fault. `cause`: why a mission failed;
    empty: it did not fail. `time_s`: the time of the last waypoint. `closest_approach_max_m`: the largest of the
    waypoints' closest approaches. `charge_c`: the charge from the battery. A number that a flight lacks is NaN. If the
    simulation diverges, `cause` says so, and there are no further figures.

    Raises:
        InputError: the plant refuses the model.
        SimulationError: a flight cannot begin, for example because the firmware refuses its route.
    """
    unlinked: dict[int, Row] = {}
    alone = [index for index, plan in enumerate(plans) if not plan.scenario.faults]
    for first in range(0, len(alone), plant.MOST_LANES):
        group = alone[first : first + plant.MOST_LANES]
        flown = flight.fly_many([plans[index] for index in group], _LOGGED)
        unlinked |= {index: _row(plans[index], result) for index, result in zip(group, flown, strict=True)}
    return [unlinked[index] if index in unlinked else _linked_row(plan) for index, plan in enumerate(plans)]


def _row(plan: flight.Plan, flown: flight.Flight | SimulationError) -> Row:
    if isinstance(flown, flight.Flight):
        return figures(flown)
    if flown.status != _E_DIVERGED:
        raise flown
    return _diverged(plan)


def _linked_row(plan: flight.Plan) -> Row:
    from brickpilot.hil import fly  # needs more libraries than a flight without a link

    try:
        return over_a_link(fly.fly_alone(plan))
    except SimulationError as error:
        return _row(plan, error)


def figures(flown: flight.Flight) -> Row:
    """Returns the row of a flight whose log has at least the columns that the figures need."""
    route, end = flight_figures.route_figures(flown), flight_figures.final_figures(flown)
    reached_all = route["waypoints_reached"] == route["waypoints_total"]
    cause = _cause(reached_all, end)
    row = {
        **route,
        **end,
        "success": not cause,
        "cause": cause,
        "reached_all": reached_all,
        "time_s": route["reached_at_s"][-1],
        "closest_approach_max_m": max(route["closest_approach_m"]),
        "saturated_surge_steps": end["saturated_steps"]["surge"],
        "saturated_yaw_steps": end["saturated_steps"]["yaw"],
        "charge_c": float(flown.log["charge_c"][-1]),
        "duty_travel": float(np.abs(np.diff(flown.motors.astype(np.int32), axis=0)).sum() / 32767),
        "seed": flown.plan.seed,
        "motor_stream_sha256": flight_figures.motor_hash(flown),
    }
    return {name: math.nan if row[name] is None else row[name] for name in UNITS}


def over_a_link(flown: HilFlight) -> Row:
    """Returns the row of a flight over a link. A flight that ended early, as with a lost link, counts as failed."""
    row = figures(flown.flight)
    if flown.broke_off is None:
        return row
    return row | {"success": False, "cause": flown.broke_off.split(":")[0].split(",")[0]}


def _diverged(plan: flight.Plan) -> Row:
    """Returns the row of a flight whose simulation diverged."""
    unknown: Row = {name: _TYPES[name]() if name in _TYPES else math.nan for name in UNITS}
    known: Row = {"cause": DIVERGED, "waypoints_total": len(plan.scenario.waypoints), "seed": plan.seed}
    return unknown | known


def _cause(reached_all: bool, end: Mapping[str, Any]) -> str:
    """Returns why the mission failed; the words are the same for the same cause, so that causes can be counted."""
    if end["fault"] != "none":
        return f"fault: {end['fault']}"
    return "" if reached_all else _CAUSES[end["final_mode"]]


PART_RUNS = 100
LINK_PART_RUNS = 10
"""Largest number of runs in a part, without and with a link. A flight over a link takes about fifty times as long."""

_LEAST_PARTS = 20
"""The least number of parts of a campaign, so that all workers get parts."""

_TRIES = 1000

INDEX = "run"
_ROUTE_LENGTH = "route.length_m"
_ROUTE = "route.waypoints_m"
_ROBOT = "robot."
_EXPLANATION = "robot.explanation"
_STREAM = zlib.crc32(b"robots")  # larger than any run's number, so that no other draw has this key


@dataclass(frozen=True)
class RunsOfPart:
    """Successive runs of a campaign, from run `start` on: the argument of a part.

    Attributes:
        shares: (runs, inputs drawn): see `designs.drawn_shares`.
    """

    campaign: Campaign
    start: int
    shares: Array


@dataclass(frozen=True)
class Run:
    """One run: its number, its inputs, its flight's plan, and its drawn robot, or None if the model itself flies."""

    index: int
    drawn: Drawn
    plan: flight.Plan
    robot: Robot | None = None


def part_size(campaign: Campaign) -> int:
    """Returns the number of runs in a part. This number depends only on the campaign, and so do the table's bytes."""
    most = LINK_PART_RUNS if campaign.over_a_link else PART_RUNS
    return min(most, -(-campaign.runs // _LEAST_PARTS))


def parts(campaign: Campaign) -> Iterator[Part]:
    """Yields the parts of a campaign in order; their keys sort in the same order."""
    shares = designs.drawn_shares(campaign)
    for start in range(0, campaign.runs, part_size(campaign)):
        yield Part(f"{start:07}", _runs_of_part(campaign, start, shares))


def _runs_of_part(campaign: Campaign, start: int, shares: Callable[[int, int], Array]) -> RunsOfPart:
    """Returns the part that begins with run `start`; `shares`: see `designs.drawn_shares`."""
    stop = min(start + part_size(campaign), campaign.runs)
    return RunsOfPart(campaign, start, shares(start, stop))


def fly(part: RunsOfPart) -> pa.Table:
    """Flies the runs of a part and returns a row for each: number, inputs, figures; a missing number is null."""
    flown = list(planned(part))
    figures = rows([run.plan for run in flown])
    whole = [{INDEX: run.index} | _inputs(part.campaign, run) | row for run, row in zip(flown, figures, strict=True)]
    columns = schema(part.campaign)
    arrays = [pa.array([row[field.name] for row in whole], field.type, from_pandas=True) for field in columns]
    return pa.Table.from_arrays(arrays, schema=columns)


def single_run(campaign: Campaign, index: int) -> Run:
    """Returns the run of this number. All runs of its part are drawn, so it equals the campaign's run bit for bit."""
    place = index % part_size(campaign)
    part = _runs_of_part(campaign, index - place, designs.drawn_shares(campaign))
    return list(planned(part))[place]


def planned(part: RunsOfPart) -> Iterator[Run]:
    """Yields the runs of a part."""
    campaign = part.campaign
    for index, given in enumerate(drawn(campaign, part.shares), part.start):
        robot = None
        if campaign.robots is not None:  # the runs of a block share one robot
            [robot] = robots.draw(campaign.robots, campaign.seed, _STREAM, [designs.block(campaign, index)])
        yield Run(index, given, _plan(campaign, index, given, robot), robot)


def drawn(campaign: Campaign, shares: Array) -> list[dict[str, inputs.Value]]:
    """Returns the inputs of runs, including fixed inputs; `shares`: (runs, inputs drawn), each 0..1."""
    varying, fixed = iter(shares.T), np.zeros(len(shares))
    columns = {}
    for input_ in campaign.inputs:
        columns[input_.name] = input_.values(next(varying) if input_.distribution.varies else fixed)
    return [{name: column[row] for name, column in columns.items()} for row in range(len(shares))]


def _plan(campaign: Campaign, index: int, given: Drawn, robot: Robot | None) -> flight.Plan:
    name = given.get("scenario", campaign.scenarios[0].name)
    scenario = next(scenario for scenario in campaign.scenarios if scenario.name == name)
    if campaign.box is not None:
        scenario = _routed(campaign, campaign.box, index, scenario, given)
    plan = flight.plan(
        scenario,
        campaign.model if robot is None else robot.model,
        profile=campaign.profile,
        sensors=str(given.get("sensors", campaign.sensors[0])),
        seed=designs.noise_seed(campaign, index),
        compensation=campaign.compensation,
        gains=inputs.tuned(campaign.gains, given),
    )
    if robot is not None and plan.sensors != "ideal":
        plan = dataclasses.replace(plan, devices=robot.devices)
    return inputs.applied(plan, given, campaign.faults)


def _routed(campaign: Campaign, box: Box, index: int, scenario: Scenario, given: Drawn) -> Scenario:
    """Returns the scenario with a route that is drawn for this run."""
    start = (float(given.get("start.x_m", scenario.start[0])), float(given.get("start.y_m", scenario.start[1])))
    dice = designs.stream(campaign, designs.block(campaign, index), "route")
    points = [start]
    while len(points) <= box.waypoints:
        for _ in range(_TRIES):
            x, y = (round(float(dice.uniform(*ends)), 3) for ends in (box.x, box.y))
            if np.hypot(x - points[-1][0], y - points[-1][1]) >= box.least_leg:
                break
        points.append((x, y))
    return dataclasses.replace(scenario, waypoints=tuple(points[1:]), duration=box.duration or scenario.duration)


def _inputs(campaign: Campaign, run: Run) -> dict[str, Any]:
    """Returns the inputs of a run as columns; inputs of an effect or a fault that the run lacks are blank."""
    columns: dict[str, Any] = dict(run.drawn) | of_robot(campaign, run)
    for name, value in run.drawn.items():
        if name.endswith(f".{ON}") and value is False:
            base = name.removesuffix(ON)
            columns |= {other: None for other in columns if other.startswith(base) and other != name}
    if campaign.box is not None:
        scenario = run.plan.scenario
        corners = np.array([scenario.start[:2], *scenario.waypoints])
        columns[_ROUTE_LENGTH] = float(np.hypot(*np.diff(corners, axis=0).T).sum())
        columns[_ROUTE] = "; ".join(f"{x:g} {y:g}" for x, y in scenario.waypoints)
    return columns


def of_robot(campaign: Campaign, run: Run) -> dict[str, Any]:
    """Returns the values of the run's robot that differ between drawn robots and that `[vary]` does not state."""
    if run.robot is None:
        return {}
    own = robots.values(run.plan.model)
    columns: dict[str, Any] = {f"{_ROBOT}{name}": own.get(name) for name in _left_open(campaign)}
    return columns | {_EXPLANATION: run.robot.explanation}


def _left_open(campaign: Campaign) -> list[str]:
    if campaign.robots is None:
        return []
    stated = {input_.name for input_ in campaign.inputs}
    return [name for name in campaign.robots.open if not {f"parameter.{name}", f"effect.{name}"} & stated]


def schema(campaign: Campaign) -> pa.Schema:
    """Returns the columns of the table, each with its unit."""
    columns = [(INDEX, pa.int64(), "")]
    for input_ in campaign.inputs:
        kind = pa.string() if input_.labels else pa.bool_() if input_.chance is not None else pa.float64()
        columns.append((input_.name, kind, input_.unit))
    if campaign.box is not None:
        columns += [(_ROUTE_LENGTH, pa.float64(), "m"), (_ROUTE, pa.string(), "")]
    if campaign.robots is not None:
        columns += [(f"{_ROBOT}{name}", pa.float64(), robots.infos()[name].unit) for name in _left_open(campaign)]
        columns.append((_EXPLANATION, pa.string(), ""))
    kinds = {str: pa.string(), bool: pa.bool_(), int: pa.int64(), float: pa.float64()}
    columns += [(name, kinds[_TYPES.get(name, float)], unit) for name, unit in UNITS.items()]
    return pa.schema([pa.field(name, kind, metadata={"unit": unit}) for name, kind, unit in columns])
