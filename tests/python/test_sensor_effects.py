"""Sensor effects: stated in a data set, fitted, removed from a run's start state, and seen by the firmware."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.fit.calibration import calibrate
from brickpilot.vehicle import flight, plant, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.plant import State
from brickpilot.vehicle.replay import Mark, Replay
from synthetic import robot, write

STATED = """
rolling_friction = 0.015
half_track = 0.07
wheel_radius = 0.0408
wheel_inertia = 1e-4
resistance = 22.0
torque_constant = 0.195
emf_constant = 0.245
viscous_friction = 1.8e-5
mass = 0.9
yaw_inertia = { value = 0.006, sd = 0.0006 }
"""
EXAMPLE = """
[nominal.effects]
gyro_bias = { bias = { value = 0.0, sd = 0.02 } }
imu_lever_arm = { x = 0.02, y = 0.0 }
"""
SIDEWAYS = """
[nominal.effects]
gyro_bias = { bias = { value = 0.1, sd = 0.02 } }
imu_lever_arm = { x = 0.02, y = 0.03 }
accel_bias = { surge = 0.1, sway = 0.2 }
gyro_scale = { error = 0.05 }
floor_slope = { slope_y = 0.02 }
com_lateral_offset = { right = 0.01 }
motor_asymmetry = { difference = 0.02 }
"""
WHEEL_SPEEDS = ["wheel_speed_left", "wheel_speed_right"]
IMU = {"accel_surge": 0.025, "accel_sway": 0.025, "yaw_rate": 0.014}


def with_effects(**effects):
    return dataclasses.replace(robot(), effects=effects)


@pytest.mark.parametrize("frame", ["FRD", "FLU"])
def test_effects_the_data_set_states_are_simulated_and_refitted_within_their_sd(tmp_path, frame):
    truth = with_effects(gyro_bias={"bias": 0.03}, imu_lever_arm={"x": 0.02, "y": 0.0})
    found = calibrate(reading.read(write(tmp_path / "set", truth, IMU, STATED + EXAMPLE, frame=frame)))
    bias = found.parameters["gyro_bias.bias"]
    assert set(found.parameters) == {"yaw_inertia", "gyro_bias.bias"}
    assert bias.value == pytest.approx(0.03, abs=0.002)
    assert bias.ci95[0] < 0.03 < bias.ci95[1]
    assert found.model.effects["imu_lever_arm"] == {"x": 0.02, "y": 0.0}
    after = {(gap.run, gap.signal): gap.after for gap in found.gaps}
    assert after["spin", "accel_surge"] < 0.05


def test_a_bias_far_from_what_was_stated_is_a_finding(tmp_path):
    truth = with_effects(gyro_bias={"bias": 0.2}, imu_lever_arm={"x": 0.02, "y": 0.0})
    found = calibrate(reading.read(write(tmp_path / "set", truth, IMU, STATED + EXAMPLE)))
    assert any(note.startswith("gyro_bias.bias is ") and "sd away from its prior" in note for note in found.notes)


def test_sideways_values_of_effects_turn_with_the_frame_of_the_file(tmp_path):
    right, left = (
        reading.read(write(tmp_path / frame, robot(), IMU, STATED + SIDEWAYS, frame=frame)).nominal_effects
        for frame in ("FRD", "FLU")
    )
    for effect, parameter, sign in [
        ("gyro_bias", "bias", -1),
        ("imu_lever_arm", "x", 1),
        ("imu_lever_arm", "y", -1),
        ("accel_bias", "surge", 1),
        ("accel_bias", "sway", -1),
        ("gyro_scale", "error", 1),
        ("floor_slope", "slope_y", -1),
        ("com_lateral_offset", "right", 1),
        ("motor_asymmetry", "difference", 1),
    ]:
        assert left[effect][parameter].value == sign * right[effect][parameter].value
    assert left["gyro_bias"]["bias"].sd == 0.02


@pytest.mark.parametrize(
    ("effects", "signals"),
    [
        ({"gyro_bias": {"bias": 0.3}}, ["yaw_rate", "accel_surge"]),
        ({"gyro_scale": {"error": -0.3}, "gyro_bias": {"bias": 0.3}}, ["yaw_rate"]),
        ({"gyro_bias": {"bias": 0.3}, "encoder_scale": {"error": 0.2}}, [*WHEEL_SPEEDS, "yaw_rate"]),
        ({"encoder_scale": {"error": 0.4}}, ["wheel_velocity_left", "wheel_velocity_right", "yaw_rate"]),
    ],
)  # fmt: skip
def test_a_run_starts_from_what_the_sensors_meant(tmp_path, effects, signals):
    """A replay of the true model from the first readings gives these data again: a bias is not taken for motion."""
    truth = with_effects(**effects)
    start = State(yaw_rate=1.0, surge=0.2 if len(signals) == 3 else 0.0)
    folder = write(tmp_path / "set", truth, dict.fromkeys(signals, 0.0), STATED, start=start)
    measured = reading.read(folder)
    simulated = Replay(measured).simulate([truth])[0]
    for run in measured.runs:
        for signal, values in run.raw_outputs.items():
            np.testing.assert_allclose(simulated[run.name][signal], values, atol=1e-6, err_msg=f"{run.name} {signal}")


def test_a_late_run_starts_from_what_a_drifting_gyro_meant(tmp_path):
    """After 100 s the gyro reads 1 rad/s too much, and the start state does not take this error for motion."""
    truth = with_effects(gyro_drift={"rate": 0.01})
    start = State(yaw_rate=0.5, age=100.0)
    folder = write(tmp_path / "set", truth, {"yaw_rate": 0.0}, STATED, start=start, manoeuvres={"spin": (4.5, -4.5)})
    measured = reading.read(folder)
    (run,) = measured.runs
    assert run.raw_outputs["yaw_rate"][0] == pytest.approx(1.5)
    late = dataclasses.replace(measured, runs=(dataclasses.replace(run, gap_s=100.0),))
    (simulated,) = Replay(late).simulate([truth])
    np.testing.assert_allclose(simulated["spin"]["yaw_rate"], run.raw_outputs["yaw_rate"], atol=1e-6)


def test_a_stated_start_is_true_whatever_the_sensors_say(tmp_path):
    truth = with_effects(gyro_bias={"bias": 0.3})
    measured = reading.read(write(tmp_path / "set", truth, {"yaw_rate": 0.0}, STATED, initial="yaw_rate = 0.0"))
    simulated = Replay(measured).simulate([truth])[0]
    assert simulated["straight"]["yaw_rate"][0] == 0.3


def test_a_motors_window_starts_from_what_its_encoder_meant(tmp_path):
    starts = (50, 100, 150)  # 1 us lies between each of these samples and the next
    times = [(k - 1) / 100 + 1e-6 if k - 1 in starts else k / 100 for k in range(200)]
    (tmp_path / "r.csv").write_text("t,v,w\n" + "".join(f"{t:.9f},3,6\n" for t in times), encoding="utf-8")
    (tmp_path / "dataset.toml").write_text(
        'name = "m"\nvehicle = "motor"\n[signals]\ntime = { column = "t", unit = "s" }\n'
        'voltage = { column = "v", unit = "V" }\nspeed = { column = "w", unit = "rad/s" }\n'
        '[[runs]]\nname = "r"\nfile = "r.csv"\n',
        encoding="utf-8",
    )
    model = dataclasses.replace(
        rcx(), vehicle="motor", parameters=catalogue.presets("motor"), effects={"encoder_scale": {"error": 0.2}}
    )
    marks = {"r": [Mark(k, {"speed": 6.0}) for k in starts]}
    (simulated,) = Replay(reading.read(tmp_path)).simulate([model], marks=marks)
    for k in starts:
        assert simulated["r"]["speed"][k] != pytest.approx(6.0, rel=1e-2)
        assert simulated["r"]["speed"][k + 1] == pytest.approx(6.0, rel=1e-3)


def test_imu_effects_leave_a_motor_alone_and_encoder_and_delay_do_not():
    base = dataclasses.replace(rcx(), vehicle="motor", parameters=catalogue.presets("motor"), effects={})
    time = np.arange(0.0, 0.5, 0.003)
    run = plant.OpenLoopRun(time=time, inputs=np.full((len(time), 1), 5.0))
    acting = set()
    for effect in catalogue.effects():
        if effect.acts_on != "sensor":
            continue
        model = dataclasses.replace(base, effects={effect.name: {}})
        plain, changed = (one.outputs for one in plant.simulate([(base, run), (model, run)]))
        if any(not np.array_equal(plain[name], changed[name]) for name in plain):
            acting.add(effect.name)
    assert acting == {"encoder_scale", "sensor_delay", "speed_delay", "speed_lag"}


def fly(**effects):
    mission = scenario.load(scenario.packaged()["mission"])
    model = dataclasses.replace(rcx(), effects=effects)
    return flight.fly(flight.plan(mission, model, profile="coupled", sensors="imu+encoders", seed=1))


def test_the_firmware_reads_its_gyro_through_the_effects():
    plain, biased = fly(), fly(gyro_bias={"bias": 0.1})
    rates = [one.log["measured_yaw_rate_rad_s"] - one.log["true_yaw_rate_rad_s"] for one in (plain, biased)]
    assert np.mean(rates[1]) - np.mean(rates[0]) == pytest.approx(0.1, abs=0.002)
    assert plain.motors.tobytes() != biased.motors.tobytes()


def test_the_firmware_counts_its_wheels_through_the_effects():
    flown = fly(encoder_scale={"error": 0.1})
    turned = np.cumsum(flown.log["left_wheel_rad_s"]) * 0.003
    counted = np.unwrap(flown.log["measured_left_counts"], period=65536) * 2 * np.pi / 48
    assert turned.max() > 50
    assert counted.max() / turned.max() == pytest.approx(1.1, rel=0.01)
