"""In MuJoCo, the exported robot drives as in the plant, by given voltages and under the firmware."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import mujoco_robot
import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.export import machine, mjcf
from brickpilot.hil import ends, fly
from brickpilot.vehicle import flight_figures, plant
from brickpilot.vehicle import model as models
from brickpilot.vehicle.model import Model
from command import brickpilot
from numpy.typing import NDArray
from test_flight import fly as fly_in_process

Array = NDArray[np.float64]

STEP_S = 0.003


def robot(name: str, parameters: dict[str, float], **effects: dict[str, float]) -> Model:
    return Model(name, "diff_drive", "coupled", {**models.rcx().parameters, **parameters}, effects)


def small(**effects: dict[str, float]) -> Model:
    values = {
        "mass": 0.3, "yaw_inertia": 6e-4, "half_track": 0.05, "wheel_radius": 0.021, "wheel_inertia": 3e-5,
        "resistance": 6.0, "inductance": 2e-3, "emf_constant": 0.2, "torque_constant": 0.19, "viscous_friction": 2e-4,
    }  # fmt: skip
    return robot("small", values, **effects)


def large(**effects: dict[str, float]) -> Model:
    values = {
        "mass": 8.0, "yaw_inertia": 0.2, "half_track": 0.16, "wheel_radius": 0.055, "wheel_inertia": 4e-3,
        "resistance": 1.2, "inductance": 0.0, "emf_constant": 0.7, "torque_constant": 0.8, "drag_area": 0.05,
    }  # fmt: skip
    return robot("large", values, **effects)


def commands(seed: int, battery: float = 9.0) -> Array:
    """Returns (20000, 2) voltages for a minute: two random voltages for each second, of either sign, and two rests."""
    rng = np.random.default_rng(seed)
    levels = np.repeat(rng.uniform(-0.9, 0.9, (60, 2)) * battery, 334, axis=0)[:20000]
    levels[::5] *= 0.98  # a ripple, so that the motors are never steady
    levels[3000:3600] = levels[9000:9300] = 0
    return levels


def driven(model: Model, volts: Array) -> Mapping[str, Array]:
    return mujoco_robot.drive(mjcf.write(model).text, volts)


def apart(model: Model, volts: Array, made: Mapping[str, Array] | None = None) -> tuple[float, float, float]:
    """Returns the largest distance between MuJoCo's robot and the plant's, mm, the path, m, and the yaw error, rad.

    Args:
        volts: (n, 2) voltages of the motors.
        made: the result of `driven` if it is known; None: MuJoCo simulates.
    """
    made = driven(model, volts) if made is None else made
    run = plant.OpenLoopRun(np.arange(len(volts)) * STEP_S, volts)
    (ours,) = plant.simulate([(model, run)])
    x, y = ours.outputs["x"], ours.outputs["y"]
    distance = np.hypot(made["x"] - x, made["y"] - y).max() * 1e3
    path = np.hypot(np.diff(x), np.diff(y)).sum()
    return distance, path, float(np.abs(made["yaw_angle"] - ours.outputs["yaw_angle"]).max())


SAID = {
    "coulomb_friction": {"torque": 0.006},
    "viscous_loss": {"drag": 4e-4},
    "yaw_scrub": {"moment": 0.01},
    "viscous_scrub": {"drag": 0.002},
    "surge_drag": {"drag": 0.5},
    "quadratic_drag": {"drag": 0.8},
    "constant_offset": {"torque": 0.002, "difference": 0.001},
    "motor_asymmetry": {"difference": 0.06},
    "torque_constant_asymmetry": {"difference": -0.05},
    "wheel_radius_mismatch": {"mismatch": 0.02},
    "com_forward_offset": {"forward": 0.02},
    "com_lateral_offset": {"right": 0.01},
    "payload_mass": {"mass": 0.2, "forward": -0.02, "right": 0.02},
    "floor_slope": {"slope_x": 0.02, "slope_y": -0.01},
    "input_delay": {"delay": 0.06},
    "actuator_lag": {"time_constant": 0.05},
    "supply_saturation": {"voltage": 6.0},
}


@pytest.mark.parametrize("make", [models.rcx, small, large])
def test_the_nominal_robot_stays_within_a_seventh_of_a_millimetre_a_metre(make: Any) -> None:
    distance, path, turned = apart(make(), commands(1))
    assert path > 10.0
    assert distance / path < 0.15
    assert turned < 4e-3


def test_the_voltages_of_a_mission_lead_along_its_track() -> None:
    log = fly_in_process("coupled", "ideal").log
    distance, path, turned = apart(models.rcx(), np.column_stack([log["left_voltage_v"], log["right_voltage_v"]]))
    assert path > 11.0
    assert distance < 0.3
    assert turned < 3e-3


@pytest.fixture(scope="module")
def without() -> Mapping[str, Array]:
    """Returns the motion of MuJoCo's robot without an effect, as `driven` does."""
    return driven(models.rcx(), commands(2)[:3500])


@pytest.mark.parametrize("effect", SAID)
def test_an_effect_that_is_said_acts_as_in_the_plant(effect: str, without: Mapping[str, Array]) -> None:
    volts = commands(2)[:3500]
    model = robot("changed", {}, **{effect: SAID[effect]})
    made = driven(model, volts)
    distance, path, turned = apart(model, volts, made)
    acts = np.hypot(made["x"] - without["x"], made["y"] - without["y"]).max() * 1e3
    assert distance / path < 0.6
    assert turned < 5e-3
    assert acts > 8 * distance


def test_several_effects_act_together() -> None:
    names = ("coulomb_friction", "yaw_scrub", "motor_asymmetry", "payload_mass", "input_delay", "supply_saturation")
    distance, path, _ = apart(small(**{name: SAID[name] for name in names}), commands(3)[:7000])
    assert distance / path < 0.6


@pytest.mark.parametrize("name", [effect.name for effect in catalogue.effects()])
def test_every_effect_is_said_or_listed(name: str) -> None:
    made = mjcf.write(robot("one", {}, **{name: {}}))
    assert (name in made.left_out) == (name not in machine._LAWS)
    for line in made.left_out:
        assert line in made.text
    mujoco_robot.load(made.text)


def test_what_cannot_be_said_beside_something_else_is_listed() -> None:
    made = mjcf.write(robot("lag", {}, actuator_lag={}, supply_saturation={}))
    assert [line.partition(" ")[0].rstrip(",") for line in made.left_out] == ["inductance", "the", "a"]


def test_the_sensors_read_what_those_of_the_plant_read() -> None:
    model = robot("late", {}, imu_lever_arm={"x": 0.05, "y": 0.02}, sensor_delay={"delay": 0.03})
    time = np.arange(1200) * STEP_S
    volts = np.column_stack([4 + 3 * np.sin(2 * time), 4 + 3 * np.cos(3 * time)])
    (ours,) = plant.simulate([(model, plant.OpenLoopRun(time, volts))])
    engine, data = mujoco_robot.load(mjcf.write(model).text)
    names = [engine.sensor(k).name for k in range(engine.nsensor)]
    assert names == ["gyro", "accelerometer", *(f"wheel_{what}_{side}" for side in ("left", "right")
                                                 for what in ("angle", "speed"))]  # fmt: skip
    rows = np.empty((len(time), 5))
    for k, now in enumerate(volts):
        yaw, accel = data.sensor("gyro").data, data.sensor("accelerometer").data
        rows[k] = (
            -yaw[2],
            accel[0],
            -accel[1],
            data.sensor("wheel_angle_left").data[0],
            data.sensor("wheel_speed_right").data[0],
        )
        data.ctrl[:2] = now
        mujoco.mj_step(engine, data, 10)
    signals = ("yaw_rate", "accel_surge", "accel_sway", "wheel_angle_left", "wheel_speed_right")
    for found, name in zip(rows.T, signals, strict=True):
        truth = ours.outputs[name]
        assert np.abs(found - truth)[60:].max() < 0.005 * np.ptp(truth), name


@pytest.mark.parametrize("values", [
    {"wheel_inertia": 1e-3}, {"wheel_inertia": 1e-3, "inductance": 0.0}, {"mass": 1.0, "wheel_radius": 0.02},
    {"mass": 90.0, "force_per_volt": 35.0, "viscous_friction": 200.0},
])  # fmt: skip
def test_a_motor_turns_its_load_as_in_the_plant(values: dict[str, float]) -> None:
    effects = {"coulomb_friction": {"torque": 0.01}, "constant_offset": {"torque": -0.004}}
    model = Model("bench", "motor", "coupled", values, effects)
    volts = commands(4)[:5000, :1]
    made = mujoco_robot.drive(mjcf.write(model).text, volts)["angle"]
    (ours,) = plant.simulate([(model, plant.OpenLoopRun(np.arange(5000) * STEP_S, volts))])
    truth = ours.outputs["position" if "force_per_volt" in values else "angle"]
    assert np.abs(made - truth).max() < 1e-4 * np.ptp(truth)


def test_the_firmware_flies_the_robot_in_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over a CAN bus, in lockstep, the firmware flies MuJoCo's robot: its track is within 5 mm of the plant's track."""
    flown = fly_in_process("coupled", "ideal", duration=36.0)
    end = mujoco_robot.MujocoEnd(mjcf.write(models.rcx()).text, flown.plan)
    monkeypatch.setattr(fly, "open_plant", lambda *_: mujoco_robot.opened(end))
    with ends.both_ends("can:virtual") as both:
        done = fly.fly(both, "can:virtual", flown.plan, pace="lockstep", telemetry_every=10, progress=lambda *_: None)
    track = np.array(end.track)
    reached = flight_figures.waypoints_reached(flown.log["time_s"], *track.T, flown.plan.scenario.waypoints)
    assert done.broke_off is None
    assert None not in reached.at
    assert np.hypot(track[:, 0] - flown.log["true_x_m"], track[:, 1] - flown.log["true_y_m"]).max() < 5e-3


def test_the_command_prints_what_is_left_out(tmp_path: Path) -> None:
    models.save(small(battery_sag={}, coulomb_friction={}), tmp_path / "small.toml")
    done = brickpilot("export", "mjcf", "--model", "small.toml", "--out", "there/small.xml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"not in the file: (.*)", done.stdout)[0] == "battery_sag"
    mujoco.MjModel.from_xml_path(str(tmp_path / "there/small.xml"))
    paper = models.rcx()
    models.save(Model("paper", "diff_drive", "paper", paper.parameters), tmp_path / "paper.toml")
    done = brickpilot("export", "mjcf", "--model", "paper.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "profile: has wheels that do not carry the body" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["paper.toml", "small.toml", "there"]
