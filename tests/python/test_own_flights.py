"""What is asked of logs of flights: the firmware steers by its gyro, so its motors follow the gyro's noise."""

from __future__ import annotations

import dataclasses

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.vehicle import flight
from brickpilot.vehicle.scenario import Scenario

TURN_COUNTS = 48
ROUTES = {
    "there_and_back": (0.2, ((2.0, 0.0), (0.0, 0.0))),
    "square": (0.4, ((1.2, 0.0), (1.2, 0.5), (0.0, 0.5), (0.0, 0.0))),
    "slalom": (0.6, ((0.6, 0.5), (1.2, -0.5), (1.8, 0.5), (1.8, -0.5), (0.0, 0.0))),
}


def logged(name: str, robot: bp.Model, seed: int) -> pd.DataFrame:
    """Flies a route, and returns what a host logs of it: duty, battery and the sensors' readings, every 3 ms."""
    cruise, waypoints = ROUTES[name]
    scenario = Scenario(name, name, "mission", 40.0, waypoints=waypoints, cruise={"coupled": cruise})
    log = flight.fly(flight.plan(scenario, robot, sensors="imu+encoders", seed=seed)).log
    arrived = int(np.argmax(log["mode"] == 2))
    assert arrived
    turn = 2 * np.pi / TURN_COUNTS
    columns = {
        "time": log["time_s"],
        "duty_left": log["left_duty"],
        "duty_right": log["right_duty"],
        "accel_surge": log["measured_accel_surge_m_s2"],
        "accel_sway": log["measured_accel_sway_m_s2"],
        "yaw_rate": log["measured_yaw_rate_rad_s"],
        "battery_voltage": log["battery_v"],
        "wheel_angle_left": turn * np.unwrap(log["measured_left_counts"], period=65536),
        "wheel_angle_right": turn * np.unwrap(log["measured_right_counts"], period=65536),
    }
    return pd.DataFrame(columns)[: arrived + 300]


@pytest.mark.parametrize("hidden", [{}, {"motor_asymmetry": {"difference": 0.1}}], ids=["none", "motor_asymmetry"])
def test_flights_of_the_firmware_show_what_the_simulator_lacks(hidden: dict[str, dict[str, float]]) -> None:
    """The IMU of the packaged robot has a bias, so that is always there. Behind a model of the noise nothing shows."""
    robot = dataclasses.replace(bp.rcx(), effects=hidden)
    runs = {name: logged(name, robot, seed) for seed, name in enumerate(ROUTES)}
    resolved = {
        name: {"column": name, "resolution": 2 * np.pi / TURN_COUNTS} for name in runs["square"] if "angle" in name
    }
    known = {"force_per_volt", "torque_per_volt", "stall_torque", "no_load_speed"}
    data = bp.Dataset.from_frames(
        runs,
        vehicle="diff_drive",
        frame="FRD",
        signals={name: name for name in runs["square"] if name != "time"} | resolved,
        nominal={name: value for name, value in robot.parameters.items() if name not in known},
    )
    found = bp.discover(data)
    assert found.closed_loop is not None
    assert found.closed_loop.gain > 0.2
    assert found.verdict == "named"
    assert {one.name for one in found.effects} - {"gyro_bias"} == {"accel_bias", *hidden}
    for one in found.effects:
        for name, true in hidden.get(one.name, {}).items():
            low, high = one.parameters[name].ci95
            assert low < true < high
