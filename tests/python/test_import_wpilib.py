"""Logs of WPILib's SysId, old and new, become data sets."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickpilot.data.dataset import motor_inputs
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from importing import import_wpilib
from other_logs import TURN, new_log, old_log, write_json
from test_dataset import measured


def test_an_old_wpilib_log_gives_signed_voltages_metres_and_the_battery(tmp_path: Path) -> None:
    imported = import_wpilib([write_json(tmp_path / "log.json", old_log())], tmp_path / "set")
    dataset = read(imported.folder)
    straight, spot = dataset.runs
    assert [run.name for run in dataset.runs] == ["slow-forward", "track-width"]
    np.testing.assert_allclose(motor_inputs(straight, dataset), np.full((20, 2), 6.0))
    np.testing.assert_allclose(motor_inputs(spot, dataset), np.tile([-3.0, 3.0], (20, 1)))
    np.testing.assert_allclose(straight.outputs["wheel_travel_left"], TURN * (0.01 * np.arange(20) + 1))
    np.testing.assert_allclose(spot.raw_outputs["wheel_velocity_left"], -TURN)
    np.testing.assert_array_equal(spot.outputs["battery_voltage"], 12.0)
    assert sum("voltage_left is reversed" in note for note in imported.notes) == 1


def test_tests_of_one_wpilib_log_follow_the_robots_clock(tmp_path: Path) -> None:
    log = dict(reversed(old_log().items()))
    dataset = read(import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set").folder)
    assert [run.name for run in dataset.runs] == ["slow-forward", "track-width"]
    assert [run.gap_s for run in dataset.runs] == pytest.approx([0.0, 20.0 - 10.095])


@pytest.mark.parametrize(("sense", "frame"), [(1.0, "FLU"), (-1.0, "FRD")])
def test_the_gyros_sense_is_found_from_the_wheels(tmp_path: Path, sense: float, frame: str) -> None:
    log = old_log()
    for row in log["track-width"]:
        row[9] *= sense
    imported = import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set")
    dataset = read(imported.folder)
    assert dataset.frame == frame
    assert any("gyro counts" in note for note in imported.notes)
    assert dataset.runs[1].outputs["yaw_angle"][-1] == pytest.approx(
        -0.38
    )  # to the left: negative in the paper's frame


def test_a_gyro_that_does_not_follow_the_wheels_is_said(tmp_path: Path) -> None:
    log = old_log()
    for k, row in enumerate(log["track-width"]):
        row[9] = math.sin(2.5 * k)
    imported = import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set")
    assert any("do not agree" in note for note in imported.notes)


def test_a_sysid_drivetrain_keeps_its_signs_and_feet_become_metres(tmp_path: Path) -> None:
    dataset = read(import_wpilib([write_json(tmp_path / "log.json", new_log())], tmp_path / "set").folder)
    run = dataset.runs[0]
    assert dataset.frame == "FLU"
    np.testing.assert_array_equal(motor_inputs(run, dataset), np.tile([-3.0, 3.0], (10, 1)))
    np.testing.assert_allclose(run.outputs["wheel_velocity_right"], 5.0 * TURN * 0.3048)
    np.testing.assert_array_equal(run.outputs["yaw_rate"], -15.0)
    assert "battery_voltage" not in run.outputs


def test_a_converted_sysid_log_gets_its_signs_back_and_loses_its_dead_gyro(tmp_path: Path) -> None:
    rows = [[k * 0.02, 3.0, 3.0, -0.1 * k, -0.1 * k, -5.0, -5.0, 0.0, 0.0] for k in range(10)]
    log = {**new_log(test="Drivetrain"), "fast-forward": [], "fast-backward": rows}
    imported = import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set")
    dataset = read(imported.folder)
    assert [run.name for run in dataset.runs] == ["fast-backward"]
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset), -3.0)
    assert "yaw_angle" not in dataset.signals
    assert any("no gyro" in note for note in imported.notes)


def test_wheels_logged_in_angles_become_wheel_angles(tmp_path: Path) -> None:
    log = new_log(units="Degrees", unitsPerRotation=360.0)
    run = read(import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set").folder).runs[0]
    np.testing.assert_allclose(run.outputs["wheel_speed_right"], 5.0 * 2 * math.pi)
    np.testing.assert_allclose(run.outputs["wheel_angle_left"][-1], -0.9 * 2 * math.pi)


@pytest.mark.parametrize(
    ("units", "signal", "factor"), [("Inches", "position", 0.0254), ("Rotations", "angle", 2 * math.pi)]
)
def test_a_sysid_mechanism_becomes_a_motor(tmp_path: Path, units: str, signal: str, factor: float) -> None:
    rows = [[k * 0.02, 2.0, 0.1 * k, 5.0] for k in range(10)]
    log = {"sysid": True, "test": "Elevator", "units": units, "unitsPerRotation": 2.0, "slow-forward": rows}
    dataset = read(
        import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set", nominal={"resistance": 2.0}).folder
    )
    assert dataset.vehicle == "motor"
    assert dataset.nominal["resistance"].value == 2.0
    np.testing.assert_allclose(dataset.runs[0].outputs[signal], 0.1 * np.arange(10) * 2.0 * factor)
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset), 2.0)


def test_several_logs_make_one_data_set(tmp_path: Path) -> None:
    files = [write_json(tmp_path / f"{name}.json", old_log()) for name in ("a", "b")]
    dataset = read(import_wpilib(files, tmp_path / "deep" / "er" / "set", name="both").folder)
    assert dataset.name == "both"
    assert [run.name for run in dataset.runs] == ["a_slow-forward", "a_track-width", "b_slow-forward", "b_track-width"]


def test_rows_whose_time_stands_still_are_left_out_and_said(tmp_path: Path) -> None:
    log = old_log()
    log["slow-forward"][5][0] = log["slow-forward"][4][0]
    imported = import_wpilib([write_json(tmp_path / "log.json", log)], tmp_path / "set")
    assert read(imported.folder).runs[0].time.size == 19
    assert any("slow-forward: 1 rows" in note for note in imported.notes)


def test_the_measured_frc_logs_are_consistent_after_import(tmp_path: Path) -> None:
    folder = measured("frc_drivetrain")
    imported = import_wpilib([folder / "linear-data.json", folder / "angular-data.json"], tmp_path / "set")
    dataset = read(imported.folder)
    assert dataset.frame == "FLU"
    assert [run.time.size for run in dataset.runs] == [2252, 3812, 936, 836, 3632, 3332, 3116, 416, 532, 2352]
    for run in dataset.runs:
        volts = motor_inputs(run, dataset)
        for side, column in (("left", 0), ("right", 1)):
            speed = run.outputs[f"wheel_velocity_{side}"]
            moving = np.abs(speed) > 0.1
            assert (np.sign(volts[moving, column]) == np.sign(speed[moving])).mean() > 0.95, (run.name, side)
        lead = run.outputs["wheel_travel_left"] - run.outputs["wheel_travel_right"]
        assert np.corrcoef(lead, run.outputs["yaw_angle"])[0, 1] > 0.99, run.name
        assert 9.5 < run.outputs["battery_voltage"].min() < run.outputs["battery_voltage"].max() < 12.3


def rows_with(change: Callable[[list[Any]], Any]) -> dict[str, Any]:
    log = old_log()
    log["slow-forward"][3] = change(log["slow-forward"][3])
    return log


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "log.json:1: is not JSON"),
        ("{\n1}", "log.json:2: is not JSON"),
        ("[" * 100_000, "log.json: is not JSON"),
        ("[]", "one JSON object"),
        ("{}", "log.json: test: is missing"),
        (old_log(units="Furlongs"), "log.json: units:"),
        (old_log(unitsPerRotation=0), "log.json: unitsPerRotation:"),
        (old_log(unitsPerRotation="1"), "log.json: unitsPerRotation:"),
        ({**old_log(), "slow-forward": [], "track-width": []}, "holds no test"),
        ({**old_log(), "../evil": old_log()["slow-forward"]}, "is not a valid name of a test"),
        (rows_with(lambda row: row[:9]), "log.json: slow-forward[3]: is not a row of 10 or 9 numbers"),
        (rows_with(lambda row: [*row[:9], "x"]), "log.json: slow-forward[3]: holds something that is not a number"),
        (rows_with(lambda row: [*row[:9], math.nan]), "log.json: slow-forward[3]: holds a value that is not finite"),
        (rows_with(lambda row: [*row[:9], 10**400]), "log.json: slow-forward: holds a number that is too large"),
        (rows_with(lambda _: 7), "log.json: slow-forward[3]: is not a row"),
        (old_log(test="Elevator", **{"slow-forward": new_log()["fast-forward"]}), "is not a row of 10 or 4"),
    ],
)
def test_a_bad_wpilib_log_is_named_and_leaves_nothing(tmp_path: Path, content: object, says: str) -> None:
    file = tmp_path / "log.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        import_wpilib([file], tmp_path / "set")
    assert says in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.json"]


def test_logs_of_different_mechanisms_are_not_mixed(tmp_path: Path) -> None:
    files = [write_json(tmp_path / "a.json", old_log()), write_json(tmp_path / "b.json", old_log(test="Elevator"))]
    with pytest.raises(InputError, match=r"b\.json: is of another mechanism"):
        import_wpilib(files, tmp_path / "set")
