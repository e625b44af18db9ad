"""With the IMU alone, the robot learns a dry friction that is not stated. Learning does no harm without friction."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import Model, rcx
from compensation_study import ANOTHER, PRESETS, robot

MISSION = scenario.load(scenario.packaged()["mission"])


def figures(model: Model, seeds: int, *, sensors: str = "imu", rest: float = 1.0) -> list[dict[str, Any]]:
    """Returns `flight_figures.summary` of the packaged mission for each seed, after a rest."""
    mission = dataclasses.replace(MISSION, start_at=rest)
    plans = (flight.plan(mission, model, profile="coupled", sensors=sensors, seed=seed) for seed in range(seeds))
    return [flight_figures.summary(flight.fly(plan)) for plan in plans]


def arrived(flown: list[dict[str, Any]]) -> int:
    """Returns the number of flights with all 8 waypoints."""
    return sum(one["waypoints_reached"] == 8 for one in flown)


def error_mm(flown: list[dict[str, Any]]) -> float:
    """Returns the mean error of the position estimate, mm."""
    return float(1e3 * np.mean([one["position_estimate_error_m"] for one in flown]))


def friction(torque: float) -> Model:
    return robot({"coulomb_friction": {"torque": torque}})


def test_the_imu_alone_flies_with_a_friction_that_nobody_stated() -> None:
    """Without learning this friction, 0 of 50 flights arrive, and the position is wrong by 215 mm."""
    flown = figures(friction(0.005), 50)
    assert arrived(flown) >= 45
    assert error_mm(flown) < 60


@pytest.mark.parametrize("torque", [0.002, 0.008, 0.012, 0.02, 0.026])
def test_more_or_less_friction(torque: float) -> None:
    flown = figures(friction(torque), 20)
    assert arrived(flown) >= 18
    assert error_mm(flown) < 80


@pytest.mark.parametrize(
    "model",
    [
        robot({"stiction_stribeck": PRESETS["stiction_stribeck"]}),
        robot({"rolling_sqrt": {"torque": 0.002}}),
        robot({"actuator_deadband": {"voltage": 0.5}}),
        robot({"viscous_loss": PRESETS["viscous_loss"]}),
        robot({"coulomb_friction": {"torque": 0.005}, "imu_lever_arm": PRESETS["imu_lever_arm"]}),
        robot({"coulomb_friction": {"torque": 0.005}, "accel_bias": {"surge": 0.03}}),
        ANOTHER,
    ],
    ids=["stribeck", "rolling", "deadband", "viscous", "lever arm", "twice the bias", "another robot"],
)
def test_other_losses_and_robots(model: Model) -> None:
    """Without learning, each model fails all these missions. A loss by another law is learnt as dry friction."""
    assert arrived(figures(model, 20)) >= 18


@pytest.mark.parametrize(
    ("model", "before_mm"),
    [
        (rcx(), 28.1),
        (robot({}, mass=0.99, torque_constant=0.18525), 41.4),
        (robot({}, wheel_radius=0.041616), 37.4),
        (robot({"accel_bias": {"surge": -0.06}}), 27.8),
        (robot({"motor_asymmetry": {"difference": 0.2}}), 36.6),
        (robot({"battery_sag": {"resistance": 16.0}}), 36.2),
    ],
    ids=["as believed", "heavier", "wheels", "bias", "motors", "battery"],
)
def test_a_robot_that_flew_without_learning_flies_as_well(model: Model, before_mm: float) -> None:
    flown = figures(model, 12)
    assert arrived(flown) == 12
    assert error_mm(flown) < before_mm + 3  # the mean of 12 seeds scatters by 5 mm


def test_without_a_rest_nothing_is_learnt() -> None:
    """Without a rest the accelerometer's bias is unknown: the robot stops short, as it does without learning."""
    flown = figures(friction(0.005), 4, rest=0.0)
    assert arrived(flown) == 0
    assert error_mm(flown) == pytest.approx(225.9, abs=25)


def test_rotation_sensors_leave_nothing_to_learn() -> None:
    flown = figures(friction(0.005), 4, sensors="imu+encoders")
    assert arrived(flown) == 4
