"""The known faults of the paper's model: how the profiles `paper` and `coupled` behave at each fault."""

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, Simulated, State, simulate
from scipy.integrate import solve_ivp

SCENARIOS = Path(__file__).parents[2] / "sim_host" / "run" / "scenarios"
MODEL = Path(__file__).parents[2] / "sim_host" / "models" / "rcx.toml"
RPM = 2 * math.pi / 60


def robot(profile: str, effects: Mapping[str, Mapping[str, float]] | None = None) -> Model:
    return dataclasses.replace(rcx(), profile=profile, effects=effects or {})


def drive(model: Model, left: float, right: float, seconds: float, start: State | None = None) -> Simulated:
    time = np.arange(round(seconds / 0.003) + 1) * 0.003
    inputs = np.tile([left, right], (len(time), 1)).astype(float)
    return simulate([(model, OpenLoopRun(time, inputs, initial=start or State()))])[0]


def test_fault_1_body_outruns_its_wheels() -> None:
    paper = drive(robot("paper"), 4.5, 4.5, 7.0)
    assert paper.final.surge == pytest.approx(1.54, abs=0.05)
    assert paper.outputs["wheel_velocity_left"][-1] == pytest.approx(0.67, abs=0.01)
    coupled = drive(robot("coupled"), 4.5, 4.5, 7.0).outputs
    np.testing.assert_allclose(coupled["surge"], coupled["wheel_velocity_left"], atol=1e-12)
    assert coupled["surge"][-1] == pytest.approx(0.67, abs=0.01)


def literal_wheel_speed(volts: float) -> float:
    """Returns the wheel speed w, rad/s, after 3 s at `volts`, if eq. 13 has the sign of w and eq. 14 has it again."""
    p = rcx().parameters

    def slope(_: float, s: np.ndarray) -> list[float]:
        current, speed = s
        friction = p["mass"] * p["gravity"] * p["rolling_friction"] * p["wheel_radius"] * speed
        torque = (
            p["torque_constant"] * current
            - p["viscous_friction"] * speed
            - np.sign(speed) * friction * p["wheel_radius"]
        )
        return [
            (volts - p["resistance"] * current - p["emf_constant"] * speed) / p["inductance"],
            torque / p["wheel_inertia"],
        ]

    return float(solve_ivp(slope, (0, 3), [0.0, 0.0], "LSODA", rtol=1e-8).y[1, -1])


def test_fault_2_friction_with_its_sign_twice_spins_unevenly() -> None:
    forward, backward = literal_wheel_speed(4.5), literal_wheel_speed(-4.5)
    assert forward == pytest.approx(16.5, abs=0.5)
    assert backward < -1.2 * forward
    p = rcx().parameters
    thrust = [p["stall_torque"] * (v / 9 - w / p["no_load_speed"]) for v, w in ((4.5, forward), (-4.5, backward))]
    fair = p["stall_torque"] * (4.5 / 9 - forward / p["no_load_speed"])
    assert abs(thrust[0] - thrust[1]) < 0.15 * 2 * fair  # almost no yaw
    for profile in ("paper", "coupled"):  # eq. 13 read with abs(w)
        spin = drive(robot(profile), 4.5, -4.5, 3.0)
        assert spin.final.wheel_speed[0] == -spin.final.wheel_speed[1]
        assert spin.final.yaw_rate > 5


def test_fault_3_thrust_follows_the_velocity_not_the_heading() -> None:
    start = State(sway=0.001)
    paper = drive(robot("paper"), 9.0, 9.0, 2.0, start).final
    assert abs(paper.y) > 10 * abs(paper.x)
    assert paper.sway > 0.5
    coupled = drive(robot("coupled"), 9.0, 9.0, 2.0, start).final
    assert coupled.y == 0
    assert coupled.x > 1


def test_fault_4_nothing_damps_the_yaw() -> None:
    def rates(profile: str) -> np.ndarray:
        return drive(robot(profile), 4.5, 0.0, 30.0).outputs["yaw_rate"][[3333, 6667, 10000]]

    first, second, third = rates("paper")
    assert second - first == pytest.approx(third - second, rel=1e-3)
    assert third - second > 10
    first, second, third = rates("coupled")
    assert third == pytest.approx(first, rel=1e-6)
    spinning = State(yaw_rate=5.0)
    assert drive(robot("paper"), math.nan, math.nan, 5.0, spinning).final.yaw_rate == 5.0
    assert drive(robot("coupled"), math.nan, math.nan, 5.0, spinning).final.yaw_rate < 2.0


def test_fault_4_takes_the_spin_of_fig_5_out_of_the_gyros_range_and_coupled_stays_within() -> None:
    """The paper explains half power: "The rotational velocity at full power is out with the range of the sensor"."""
    gyro = tomllib.loads(MODEL.read_text(encoding="utf-8"))["sensors"]["imu"]["gyro_range"]["value"]
    half, full = (abs(drive(robot("coupled"), v, -v, 7.0).final.yaw_rate) for v in (4.5, 9.0))
    assert math.degrees(half) == pytest.approx(553, abs=1)
    assert half < gyro < full
    paper = np.abs(drive(robot("paper"), 4.5, -4.5, 7.0).outputs["yaw_rate"])
    assert 0.003 * np.argmax(paper > gyro) == pytest.approx(4.3, abs=0.05)
    assert math.degrees(paper[-1]) == pytest.approx(949, abs=1)


def test_fault_5_the_smallest_voltage_turns_the_wheels() -> None:
    assert drive(robot("paper"), 0.02, 0.02, 3.0).final.wheel_speed[0] > 0.05
    sticking = robot("coupled", {"coulomb_friction": {"torque": 0.005}})
    assert not np.any(drive(sticking, 0.02, 0.02, 3.0).outputs["wheel_angle_left"])
    assert drive(sticking, 1.0, 1.0, 3.0).final.surge > 0.02


def test_fault_5_each_wheel_carries_the_full_weight_in_both_profiles() -> None:
    p = rcx().parameters
    loss = p["viscous_friction"] + p["mass"] * p["gravity"] * p["rolling_friction"] * p["wheel_radius"] ** 2
    expected = 4.5 / (p["emf_constant"] + loss * p["resistance"] / p["torque_constant"])
    for profile in ("paper", "coupled"):
        without_air = dataclasses.replace(robot(profile), parameters={**p, "drag_area": 0.0})
        assert drive(without_air, 4.5, 4.5, 10.0).final.wheel_speed[0] == pytest.approx(expected, rel=1e-6)


def test_fault_6_one_metre_per_second_is_at_the_motors_limit() -> None:
    p = rcx().parameters
    free_rim = 9.0 / p["emf_constant"] * p["wheel_radius"]
    assert drive(robot("paper"), 9.0, 9.0, 20.0).final.surge > free_rim
    assert drive(robot("coupled"), 9.0, 9.0, 20.0).final.surge < free_rim
    loaded = drive(robot("coupled", {"coulomb_friction": {"torque": 0.0225}}), 9.0, 9.0, 20.0).final
    assert loaded.wheel_speed[0] < 250 * RPM * 1.01
    assert loaded.surge == pytest.approx(1.0, abs=0.08)
    cruise = tomllib.loads((SCENARIOS / "mission.toml").read_text())["cruise_m_s"]
    assert (cruise["coupled"] if isinstance(cruise, dict) else cruise) < loaded.surge


def test_fault_7_an_imu_cannot_tell_a_steady_speed() -> None:
    def steady(volts: float) -> dict[str, float]:
        outputs = drive(robot("coupled"), volts, volts, 20.0).outputs
        return {name: values[-1] for name, values in outputs.items()}

    slow, fast = steady(2.0), steady(4.0)
    assert fast["surge"] > 1.9 * slow["surge"]  # the true state, which the paper fed to its controllers
    for signal in ("accel_surge", "accel_sway", "yaw_rate"):
        assert fast[signal] == pytest.approx(slow[signal], abs=1e-6)
    assert fast["wheel_speed_left"] > 1.9 * slow["wheel_speed_left"]  # rotation sensors would show the speed


def pulsed(model: Model, between: float, seconds: float = 5.0) -> Simulated:
    """Simulates 9 V on every other tick of 1 ms, and `between` V on the other ticks."""
    time = np.arange(round(seconds * 1000) + 1) * 0.001
    inputs = np.where((np.arange(len(time)) % 2 == 0)[:, None], 9.0, between) * np.ones((1, 2))
    return simulate([(model, OpenLoopRun(time, inputs))])[0]


def test_fault_8_half_power_is_not_half_voltage_when_the_motor_floats_between_pulses() -> None:
    half = drive(robot("coupled"), 4.5, 4.5, 5.0).final.surge
    assert pulsed(robot("coupled"), 0.0).final.surge == pytest.approx(half, rel=0.01)
    assert pulsed(robot("coupled"), math.nan).final.surge > 1.2 * half
    # The paper's thrust depends on the voltage alone: half the time gives half the thrust, also if the motor floats.
    paper = robot("paper")
    stalled = dataclasses.replace(paper, parameters={**paper.parameters, "wheel_inertia": 1e4})
    braked, floating = (pulsed(stalled, between, 0.5).final.surge for between in (0.0, math.nan))
    assert floating == pytest.approx(braked, rel=1e-3)
