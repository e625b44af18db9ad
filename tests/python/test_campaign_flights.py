"""A flight of a campaign becomes one row of figures."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from brickpilot.campaign import runs
from brickpilot.errors import SimulationError
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle.gains import Gains


@pytest.fixture(scope="module")
def plan():
    return flight.plan("mission", sensors="imu+encoders", seed=3)


@pytest.fixture(scope="module")
def flown(plan):
    return flight.fly(plan)


def short(plan: flight.Plan, seconds: float) -> flight.Plan:
    return dataclasses.replace(plan, steps=round(seconds / 0.003))


def test_a_row_has_the_figures_of_run(plan, flown):
    row, figures = runs.row(plan), flight_figures.summary(flown)
    assert list(row) == list(runs.UNITS)
    assert (row["success"], row["cause"], row["reached_all"]) == (True, "", True)
    for name in row.keys() & figures.keys():
        assert row[name] == figures[name], name
    assert len(row.keys() & figures.keys()) == 12
    assert row["time_s"] == figures["reached_at_s"][-1]
    assert row["closest_approach_max_m"] == max(figures["closest_approach_m"])
    assert row["saturated_surge_steps"] == figures["saturated_steps"]["surge"] > 0


def test_the_charge_is_that_of_the_motors_currents(flown):
    log = flown.log
    power = sum(log[f"{side}_voltage_v"] * log[f"{side}_current_a"] for side in ("left", "right"))
    assert log["charge_c"][0] == 0
    assert runs.figures(flown)["charge_c"] == pytest.approx(np.sum(power) * 0.003 / 9.0, rel=0.01)


def test_chosen_columns_are_those_of_the_whole_log(plan, flown):
    few = flight.fly(plan, ("mode", "true_x_m", "time_s"))
    assert list(few.log) == ["mode", "true_x_m", "time_s"]
    for name, column in few.log.items():
        assert np.array_equal(column, flown.log[name])
    assert np.array_equal(few.motors, flown.motors)


def test_each_way_to_fail_has_its_cause(plan):
    rows = {
        "time ran out": short(plan, 20.0),
        "was not started": dataclasses.replace(short(plan, 3.0), start_step=5000),
        "took a missed waypoint for reached": dataclasses.replace(plan, acceptance=0.005),
        "fault: leg timed out": dataclasses.replace(short(plan, 8.0), gains=Gains("hasty", {"leg_timeout": 500})),
    }
    for cause, one in rows.items():
        row = runs.row(one)
        assert (row["success"], row["cause"], row["reached_all"]) == (False, cause, False)
        assert row["waypoints_reached"] < row["waypoints_total"] == 8
        assert math.isnan(row["time_s"])


def test_a_flight_that_diverges_fails_and_one_that_cannot_begin_is_an_error(plan, monkeypatch):
    beside = dataclasses.replace(plan.scenario, waypoints=((1.0, 0.0), (1.0, 0.0)))
    with pytest.raises(SimulationError):
        runs.row(dataclasses.replace(plan, scenario=beside))
    whole = runs.row(short(plan, 1.0))

    monkeypatch.setattr(flight, "fly_many", lambda plans, _: [SimulationError("", status=-5) for _ in plans])
    row = runs.row(plan)
    assert (row["success"], row["cause"], row["seed"]) == (False, "the simulation diverged", 3)
    assert list(row) == list(whole)
