"""For a log with set points and no voltage, the model has the controller, and discovery finds a missing effect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import brickpilot as bp
import numpy as np
import other_logs
import pandas as pd
import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.data.dataset import Dataset
from brickpilot.discover.parts import library_parts
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model, rcx
from set_point_robot import EMF, HALF_TRACK, NOMINAL, RADIUS, ROW_S, Controller, logs

CONTROLLER = next(one for one in catalogue.effects() if one.stated_by == "reference")
SOFT = Controller()
HARD_AND_LATE = Controller(feedforward=0.0, proportional=2.0, integral=10.0, delay_s=0.06)


def dataset(runs: dict[str, pd.DataFrame], **nominal: Any) -> Dataset:
    return Dataset.from_frames(runs, vehicle="diff_drive", frame="FLU", nominal={**NOMINAL, **nominal})


@pytest.fixture(scope="module")
def soft() -> dict[str, pd.DataFrame]:
    return logs(SOFT)


@pytest.fixture(scope="module")
def rubbing() -> dict[str, pd.DataFrame]:
    return logs(SOFT, dry_friction=0.03)


@pytest.fixture(scope="module")
def plain(soft: dict[str, pd.DataFrame]) -> bp.Finding:
    return bp.discover(dataset(soft))


def test_set_points_of_the_body_are_those_of_its_wheels(soft: dict[str, pd.DataFrame]) -> None:
    body = dataset(soft)
    wheels = {
        name: pd.DataFrame(
            {
                "time": log.time,
                "reference_wheel_speed_left": (log.reference_velocity - HALF_TRACK * log.reference_yaw_rate) / RADIUS,
                "reference_wheel_speed_right": (log.reference_velocity + HALF_TRACK * log.reference_yaw_rate) / RADIUS,
                "yaw_rate": log.yaw_rate,
            }
        )
        for name, log in soft.items()
    }
    for one, other in zip(body.runs, dataset(wheels).runs, strict=True):
        np.testing.assert_allclose(body.motor_inputs(one), dataset(wheels).motor_inputs(other), atol=1e-12)
    spin = next(run for run in body.runs if run.name == "spin")
    volts = body.motor_inputs(spin)[len(spin.time) // 2]
    assert volts == pytest.approx([-2.5 * HALF_TRACK / RADIUS * EMF, 2.5 * HALF_TRACK / RADIUS * EMF])


def test_the_controller_and_the_scale_of_volts_are_part_of_the_model(soft: dict[str, pd.DataFrame]) -> None:
    known = dataset(soft)
    assert {name: {key: one.value for key, one in table.items()} for name, table in known.nominal_effects.items()} == {
        CONTROLLER.name: {"proportional": 0.0}
    }
    assert known.nominal["emf_constant"].sd is None
    assert any("no voltage is logged" in note and "0.31 V s/rad" in note for note in known.notes)
    loose = dataset(soft, emf_constant={"value": 0.31, "sd": 0.1})
    assert loose.nominal["emf_constant"].sd is None, "nothing tells what a volt is"


def test_a_log_of_set_points_is_calibrated_and_lacks_nothing(plain: bp.Finding) -> None:
    assert plain.verdict == "none"
    fits = [one.held_out.before for horizons in plain.yardstick.signals.values() for one in horizons.values()]
    assert min(one for one in fits if one is not None) > 98.0
    gains = plain.augmented.effects[CONTROLLER.name]
    assert gains["integral"] > 1.0


@pytest.mark.parametrize(("times", "verdict"), [(0.6, "none"), (1.5, "named")])
def test_none_says_how_much_dry_friction_would_have_shown(plain: bp.Finding, times: float, verdict: str) -> None:
    """In a closed loop the model-error floor, not the noise, hides a small dry friction."""
    size = plain.power["coulomb_friction"].size
    assert bp.discover(dataset(logs(SOFT, dry_friction=times * size))).verdict == verdict


def test_dry_friction_is_found_behind_a_controller(rubbing: dict[str, pd.DataFrame]) -> None:
    found = bp.discover(dataset(rubbing))
    assert found.verdict in ("named", "ambiguous")
    assert found.mechanism == "bearing"
    assert "coulomb_friction" in {name for one in found.explanations for name in one.effects}


def test_dry_friction_is_found_in_one_long_recording(rubbing: dict[str, pd.DataFrame]) -> None:
    """Under integral control, friction exceeds the model-error floor only for some tenths of a second at each start."""
    lasts = ROW_S * len(rubbing["ahead"])
    table = pd.concat([log.assign(time=log.time + k * lasts) for k, log in enumerate(rubbing.values())])
    nominal = {"wheel_radius": RADIUS, "half_track": HALF_TRACK}
    found = bp.discover(Dataset.from_frames({"all": table}, vehicle="diff_drive", frame="FLU", nominal=nominal))
    assert found.verdict in ("named", "ambiguous")
    assert ("coulomb_friction",) in {one.effects for one in found.explanations}


def test_a_late_controller_without_feedforward_is_found_late() -> None:
    found = bp.discover(dataset(logs(HARD_AND_LATE)))
    late = [table["delay"] for name, table in found.augmented.effects.items() if "delay" in table]
    assert late
    assert late[0] == pytest.approx(HARD_AND_LATE.delay_s, abs=0.01)


def test_stated_gains_are_kept(soft: dict[str, pd.DataFrame]) -> None:
    gains = {"feedforward": 1.0, "proportional": 0.5, "integral": 6.0}
    losses = {"wheel_inertia": 4e-4, "viscous_friction": 8e-4, "rolling_friction": 0.0}
    known = dataset(soft, effects={CONTROLLER.name: gains}, **losses)
    found = bp.calibrate(known)
    assert found.model.effects[CONTROLLER.name] == gains
    # The true controller acts every 10 ms, the model's at once; motor and load have a time constant of 27 ms.
    later = 0.2
    assert found.model.parameters["resistance"] == pytest.approx(2.2, rel=later)


def test_discovery_does_not_look_for_a_controller_where_volts_are_logged() -> None:
    assert not CONTROLLER.is_searched
    plain: Model = rcx()
    assert CONTROLLER.name not in {part.effect for part in library_parts(plain)}


@pytest.mark.parametrize("missing", ["wheel_radius", "half_track"])
def test_a_demand_to_a_body_needs_the_geometry_of_its_controller(soft: dict[str, pd.DataFrame], missing: str) -> None:
    stated = {name: value for name, value in NOMINAL.items() if name != missing}
    with pytest.raises(
        InputError, match=f"{missing} is missing: state the one with which the controller converts reference_velocity"
    ):
        Dataset.from_frames(soft, vehicle="diff_drive", frame="FLU", nominal=stated)


def test_a_set_point_and_a_commanded_torque_contradict_each_other() -> None:
    log = pd.DataFrame({"time": [0.0, 0.1, 0.2], "reference_speed": [0.0, 9.0, 9.0], "speed": [0.0, 2.0, 5.0]})
    with pytest.raises(InputError, match="a motor whose input is a voltage, not a set point"):
        Dataset.from_frames({"step": log}, vehicle="motor", nominal={"torque_per_volt": 0.1})


def test_one_motor_with_a_set_point_is_calibrated() -> None:
    time = np.arange(0.0, 4.0, 0.01)
    runs = {}
    for name, wanted in (("up", 30.0), ("down", -20.0), ("slow", 8.0)):
        asked = wanted * ((time > 0.5) & (time < 3.0))
        speed, summed, measured = 0.0, 0.0, []
        for value in asked:
            measured.append(speed)
            for _ in range(10):  # V = 0.05 (wanted + integral), on 0.05 V s/rad, 2 ohm and 1e-4 kg m^2
                summed += 9.0 * (value - speed) * 0.001
                speed += 0.001 * 0.05 * (0.05 * (value + summed) - 0.05 * speed) / 2.0 / 1e-4
        noisy = np.array(measured) + np.random.default_rng(len(name)).normal(0.0, 0.05, len(time))
        runs[name] = pd.DataFrame({"time": time, "reference_speed": asked, "speed": noisy})
    nominal = {"emf_constant": 0.05, "torque_constant": 0.05, "wheel_inertia": 1e-4, "viscous_friction": 0.0}
    found = bp.calibrate(Dataset.from_frames(runs, vehicle="motor", nominal=nominal))
    assert found.model.effects[CONTROLLER.name]["integral"] == pytest.approx(9.0, rel=0.05)
    assert found.model.effects[CONTROLLER.name]["feedforward"] == pytest.approx(1.0, rel=0.05)
    assert found.model.parameters["resistance"] == pytest.approx(2.0, rel=0.05)


def test_a_bag_with_demands_and_joint_states_is_imported(tmp_path: Path, rubbing: dict[str, pd.DataFrame]) -> None:
    messages = []
    for k, row in enumerate(rubbing["bend"].itertuples()):
        stamp = 1_700_000_000_000_000_000 + k * round(ROW_S * 1e9)
        turned = {"left": row.wheel_speed_left, "right": row.wheel_speed_right}
        twist = other_logs.twist(row.reference_velocity, row.reference_yaw_rate)
        messages += [
            (stamp, "/cmd_vel", "geometry_msgs/msg/Twist", twist),
            (stamp, "/joint_states", "sensor_msgs/msg/JointState", other_logs.joints(stamp, turned, turned)),
        ]
    other_logs.write_mcap(tmp_path / "drive.mcap", messages)
    mapping = [
        "reference_velocity=/cmd_vel.linear.x", "reference_yaw_rate=/cmd_vel.angular.z",
        "wheel_speed_left=/joint_states.velocity[left]", "wheel_speed_right=/joint_states.velocity[right]",
    ]  # fmt: skip
    geometry = {"wheel_radius": RADIUS, "half_track": HALF_TRACK}
    found = bp.import_log(
        tmp_path / "drive.mcap", tmp_path / "out", vehicle="diff_drive", frame="FLU", mapping=mapping, nominal=geometry
    )
    assert len(found.runs) == 1
    (run,) = reading.read(tmp_path / "out").runs
    assert run.inputs["reference_velocity"].max() == pytest.approx(rubbing["bend"].reference_velocity.max())
    assert run.inputs["reference_yaw_rate"].min() == pytest.approx(-1.2)


@pytest.mark.parametrize(("sign", "frame"), [(1.0, "FLU"), (-1.0, "FRD")])
def test_the_frame_of_a_table_is_the_one_in_which_nothing_is_swapped(
    tmp_path: Path, soft: dict[str, pd.DataFrame], sign: float, frame: str
) -> None:
    names = {
        "time": "time [s]", "reference_velocity": "/cmd_vel/linear/x", "reference_yaw_rate": "/cmd_vel/angular/z",
        "wheel_speed_left": "left_speed [rad/s]", "wheel_speed_right": "right_speed [rad/s]", "yaw_rate": "gz [rad/s]",
    }  # fmt: skip
    turns = soft["bend"].assign(reference_yaw_rate=lambda log: sign * log.reference_yaw_rate)
    turns.assign(yaw_rate=sign * turns.yaw_rate).rename(columns=names).to_csv(tmp_path / "log.csv", index=False)
    geometry = {"wheel_radius": RADIUS, "half_track": HALF_TRACK}
    made = bp.import_log(tmp_path / "log.csv", tmp_path / "out", guessed=True, nominal=geometry)
    assert made.wiring == ()
    assert reading.read(tmp_path / "out").frame == frame
