"""Closed loops: the promised results of the mission, determinism, and the accuracy with each set of sensors."""

from __future__ import annotations

import dataclasses

import make_golden
import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.errors import SimulationError
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx


def fly(profile: str, sensors: str, seed: int = 0, **changes: object) -> flight.Flight:
    mission = scenario.load(scenario.packaged()["mission"])
    mission = dataclasses.replace(mission, **changes)  # type: ignore[arg-type]
    return flight.fly(flight.plan(mission, rcx(), profile=profile, sensors=sensors, seed=seed))


@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_all_eight_waypoints_are_reached_in_order_with_ideal_sensors(profile: str) -> None:
    figures = flight_figures.summary(fly(profile, "ideal"))
    assert figures["waypoints_reached"] == figures["waypoints_total"] == 8
    assert figures["reached_at_s"] == sorted(figures["reached_at_s"])
    assert figures["final_mode"] == "arrived"
    assert max(figures["closest_approach_m"]) <= 0.11


@pytest.mark.parametrize("seed", range(5))
def test_all_eight_waypoints_are_reached_with_gyro_and_rotation_sensors(seed: int) -> None:
    figures = flight_figures.summary(fly("coupled", "imu+encoders", seed))
    assert figures["waypoints_reached"] == 8
    assert figures["cross_track_rms_m"] < 0.05


def test_the_robot_believes_worse_of_its_position_without_rotation_sensors() -> None:
    heavier = {"mass": 1.1, "torque_constant": 0.185}  # unknown to the controller's model
    errors = [
        np.median(
            [
                flight_figures.summary(fly("coupled", sensors, seed, parameters=heavier))["position_estimate_error_m"]
                for seed in range(5)
            ]
        )
        for sensors in ("ideal", "imu+encoders", "imu")
    ]
    assert errors[0] < 0.001 < errors[1] < errors[2]


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others() -> None:
    first, second, other = (fly("coupled", "imu+encoders", seed) for seed in (3, 3, 4))
    assert first.motors.tobytes() == second.motors.tobytes()
    assert all(np.array_equal(first.log[name], second.log[name]) for name in first.log)
    assert first.motors.tobytes() != other.motors.tobytes()


def test_motor_streams_are_those_of_the_golden_file() -> None:
    assert make_golden.streams() == make_golden.golden()


def plans_of_all_kinds() -> list[flight.Plan]:
    """Returns plans that can run side by side, plans of another duration, profile or tyre, and plans that fail."""
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=3.0, start_at=0.0)
    forward = dataclasses.replace(scenario.load(scenario.packaged()["forward_1m"]), duration=3.0)
    wild = [dataclasses.replace(part, left=1e300) for part in forward.segments]
    friction = {"coulomb_friction": {"torque": 0.004}}
    sensed = {"gyro_scale": {"scale": 1.1}, "encoder_scale": {"scale": 1.05}, "imu_lag": {"time": 0.01}}
    slip = {"side_slip": {}}
    choices: list[tuple[scenario.Scenario, dict[str, dict[str, float]], str, str]] = [
        (mission, {}, "coupled", "imu+encoders"),
        (mission, friction, "coupled", "imu"),
        (mission, sensed, "coupled", "imu+encoders"),
        (dataclasses.replace(mission, waypoints=((1e4, 0.0),)), {}, "coupled", "ideal"),
        (mission, slip, "coupled", "imu+encoders"),
        (dataclasses.replace(forward, segments=tuple(wild)), {}, "coupled", "ideal"),
        (forward, friction | sensed, "coupled", "imu"),
        (mission, {"input_delay": {}}, "coupled", "imu+encoders"),
        (mission, {}, "coupled", "ideal"),
        (mission, {}, "paper", "imu+encoders"),
        (mission, {}, "paper", "ideal"),
        (dataclasses.replace(mission, duration=1.5), {}, "coupled", "imu+encoders"),
        (mission, {"torque_ripple": {}}, "coupled", "imu+encoders"),
    ]
    effects = {info.name: info for info in catalogue.effects()}
    plans = []
    for seed, (flown, chosen, profile, sensors) in enumerate(choices):
        whole = {
            name: {one.name: values.get(one.name, one.preset) for one in effects[name].parameters}
            for name, values in chosen.items()
        }
        model = dataclasses.replace(rcx(), effects=whole)
        plans.append(flight.plan(flown, model, profile=profile, sensors=sensors, seed=seed))
    return plans


def bytes_of(flown: flight.Flight | SimulationError) -> object:
    if isinstance(flown, SimulationError):
        return flown.status
    return flown.motors.tobytes(), {name: values.tobytes() for name, values in flown.log.items()}


def test_flights_side_by_side_get_the_bytes_of_one_at_a_time() -> None:
    plans = plans_of_all_kinds()
    alone = [bytes_of(flight.fly_many([plan])[0]) for plan in plans]
    assert [status for status in alone if isinstance(status, int)] == [-2, -5]  # the bad route, and the divergence
    for order in (plans, plans[::-1]):
        together = [bytes_of(flown) for flown in flight.fly_many(order)]
        assert together == (alone if order is plans else alone[::-1])


def test_a_log_row_stands_for_every_step_and_time_counts_in_3_ms() -> None:
    flown = fly("coupled", "ideal", duration=6.0)
    assert flown.log["time_s"] == pytest.approx(np.arange(2000) * 0.003)


def test_waypoints_are_judged_by_the_true_track_and_in_order() -> None:
    time = np.arange(5.0)
    x, y = np.array([0.0, 1.0, 2.0, 3.0, 4.0]), np.zeros(5)
    near, far = (flight_figures.waypoints_reached(time, x, y, [(1.0, side)]).at for side in (0.199, 0.201))
    assert (near, far) == ([1.0], [None])  # twice the acceptance radius
    reached = flight_figures.waypoints_reached(time, x, y, [(1.0, 0.1), (3.0, 0.0), (2.0, 0.0), (4.0, 0.0)])
    assert reached.at == [1.0, 3.0, None, None]  # the third waypoint lies behind; after a miss, no waypoint counts
    assert reached.closest == pytest.approx([0.1, 0.0, 1.0, 0.0])


def test_cross_track_error_is_positive_to_the_right_of_the_leg() -> None:
    x, y = np.array([0.5, 1.1]), np.array([0.2, 0.5])
    error = flight_figures.cross_track(x, y, (0.0, 0.0), [(1.0, 0.0), (1.0, 1.0)], np.array([0.0, 1.0]))
    assert error == pytest.approx([0.2, -0.1])


def test_one_metre_forward_stops_after_one_metre() -> None:
    plan = flight.plan(scenario.load(scenario.packaged()["forward_1m"]), rcx(), profile="coupled")
    flown = flight.fly(plan)
    assert flown.log["true_x_m"][-1] == pytest.approx(1.0, abs=0.25)  # with shorted motors the robot rolls on
    assert abs(flown.log["true_speed_m_s"][-1]) < 1e-3
