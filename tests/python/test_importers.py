"""Logs of other tools become data sets that read back as what was logged; bad logs leave nothing behind."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from brickpilot.data.dataset import motor_inputs, read
from brickpilot.errors import InputError
from brickpilot.importers import mat_file, matlab
from brickpilot.importers.mapping import parse_mapping, parse_nominal
from brickpilot.importers.matlab import import_matlab
from brickpilot.importers.table import import_table
from brickpilot.importers.wpilib import import_wpilib
from scipy.io import savemat
from test_dataset import measured

TURN = 0.5  # unitsPerRotation of the logs below


def old_row(time: float, autospeed: float, left: float, right: float, gyro: float) -> list[float]:
    """A row of frc-characterization: the battery at 12 V, voltages without sign, `left` and `right` in rotations."""
    volts = abs(12.0 * autospeed)
    return [time, 12.0, autospeed, volts, volts, left, right, math.copysign(1.0, left), math.copysign(1.0, right), gyro]


def old_log(**changes: Any) -> dict[str, Any]:
    """Straight on, then on the spot to the left: left wheel backward, right wheel forward, the gyro counting up."""
    straight = [old_row(10 + 0.005 * k, 0.5, 0.01 * k + 1, 0.01 * k + 1, 0.0) for k in range(20)]
    spot = [old_row(20 + 0.005 * k, 0.25, -0.01 * k - 1, 0.01 * k + 1, 0.02 * k) for k in range(20)]
    log = {
        "slow-forward": straight,
        "track-width": spot,
        "test": "Drivetrain",
        "units": "Meters",
        "unitsPerRotation": TURN,
    }
    return {**log, **changes}


def new_log(**changes: Any) -> dict[str, Any]:
    """A SysId drivetrain, turning left: rows of time, V left, right, position, velocity, angle, rate."""
    rows = [[k * 0.02, -3.0, 3.0, -0.1 * k, 0.1 * k, -5.0, 5.0, 0.3 * k, 15.0] for k in range(10)]
    log = {
        "sysid": True,
        "test": "Drivetrain (Angular)",
        "units": "Feet",
        "unitsPerRotation": TURN,
        "fast-forward": rows,
    }
    return {**log, **changes}


def write_json(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


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


SAMPLES = np.arange(50) * 0.01
MAPPING = ["time=t", "voltage=u:V", "position=log.q[1]:mm"]


def mat_content() -> dict[str, Any]:
    return {"t": SAMPLES, "u": np.cos(SAMPLES), "log": {"q": np.column_stack([SAMPLES, 1000 * SAMPLES**2])}}


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = SAMPLES[np.newaxis, :]
        file["u"] = np.cos(SAMPLES)[:, np.newaxis]
        file["log/q"] = np.column_stack([SAMPLES, 1000 * SAMPLES**2]).T
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


MAT_WRITERS: dict[str, Callable[[Path], None]] = {
    "v5": lambda path: savemat(path, mat_content(), do_compression=False),
    "v7": lambda path: savemat(path, mat_content(), do_compression=True, oned_as="column"),
    "v7.3": write_hdf5,
}


@pytest.mark.parametrize("version", MAT_WRITERS)
def test_a_mat_file_becomes_a_data_set(tmp_path: Path, version: str) -> None:
    MAT_WRITERS[version](tmp_path / "run1.mat")
    imported = import_matlab(
        [tmp_path / "run1.mat"], tmp_path / "set", MAPPING, vehicle="motor", nominal={"force_per_volt": 35.15}
    )
    dataset = read(imported.folder)
    assert (dataset.name, imported.runs) == ("set", ("run1",))
    np.testing.assert_array_equal(dataset.runs[0].time, SAMPLES)
    np.testing.assert_allclose(dataset.runs[0].outputs["position"], SAMPLES**2)
    np.testing.assert_array_equal(motor_inputs(dataset.runs[0], dataset)[:, 0], np.cos(SAMPLES))


def test_nan_in_a_mat_file_becomes_a_blank(tmp_path: Path) -> None:
    content = mat_content()
    content["u"][3] = np.nan
    savemat(tmp_path / "a.mat", content)
    run = read(import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor").folder).runs[0]
    assert np.flatnonzero(np.isnan(run.inputs["voltage"])).tolist() == [3]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("position=x", "a.mat: position: no variable 'x' among"),
        ("position=log.z", "a.mat: position: no variable 'log.z'"),
        ("position=log.q", "is a matrix; name a column"),
        ("position=log.q[2]", "has no column 2"),
        ("position=log", "not a vector or matrix of real"),
        ("position=word", "not a vector or matrix of real"),
        ("position=short", "has 3 values where time has 50"),
        ("position=far", "infinite"),
    ],
)
def test_a_mat_variable_that_cannot_be_a_signal_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: str, says: str
) -> None:
    monkeypatch.setattr(matlab, "load", mat_file.parse)  # spares a process a case
    more = {"word": "abc", "short": np.ones(3), "far": np.where(SAMPLES > 0.2, np.inf, 0.0)}
    savemat(tmp_path / "a.mat", {**mat_content(), **more})
    with pytest.raises(InputError) as caught:
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", [*MAPPING[:2], entry], vehicle="motor")
    assert says in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mat"]


def test_tables_become_runs_of_a_data_set(tmp_path: Path) -> None:
    for name, sign in (("go", 1), ("back", -1)):
        (tmp_path / f"{name}.txt").write_text("".join(f"  {k}   {sign * 3}\t{sign * k * 90}\n" for k in range(5)))
    mapping = ["time=0:ms", "voltage=1", "angle=2:deg"]
    imported = import_table(
        [tmp_path / "go.txt", tmp_path / "back.txt"],
        tmp_path / "set",
        mapping,
        vehicle="motor",
        delimiter=" ",
        name="n",
    )
    dataset = read(imported.folder)
    assert [run.name for run in dataset.runs] == ["go", "back"]
    np.testing.assert_allclose(dataset.runs[1].outputs["angle"], -np.arange(5) * math.pi / 2)
    np.testing.assert_allclose(dataset.runs[1].time, np.arange(5) * 1e-3)


def test_a_table_with_a_header_is_mapped_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t;v left;v right;r\n0;1;2;90\n1;;2;90\n")
    mapping = ["time=t", "voltage_left=v left", "voltage_right=v right", "yaw_rate=r:deg/s"]
    out = tmp_path / "set"
    import_table([tmp_path / "a.csv"], out, mapping, vehicle="diff_drive", frame="FLU", delimiter=";", header=True)
    run = read(out).runs[0]
    np.testing.assert_array_equal(run.inputs["voltage_left"], [1.0, math.nan])
    np.testing.assert_allclose(run.outputs["yaw_rate"], -math.pi / 2)


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        (["time"], "--map time: is not SIGNAL"),
        (["time=0", "speed=1:furlong"], "--map speed=1:furlong: unknown unit"),
        (["time=0", "spin=1"], "--map spin=1: unknown signal"),
        (["time=0", "time=1"], "--map time=1: time is mapped already"),
        (["voltage=0"], "--map: time is not mapped"),
        (["time=0", "voltage=v"], "--map voltage: v is not a column number"),
        (["time=0", "voltage=9"], "a.csv:1: voltage: no column 9"),
        (["time=0", "voltage=1"], "a.csv: makes no valid data set: dataset.toml:6: signals: no output"),
        (["time=1", "voltage=0", "speed=2"], "a.csv: makes no valid data set: a.csv:3: time: does not increase"),
    ],
)
def test_a_mapping_that_makes_no_data_set_is_named_and_leaves_nothing(
    tmp_path: Path, mapping: list[str], says: str
) -> None:
    (tmp_path / "a.csv").write_text("0,1,2\n1,1,2\n")
    with pytest.raises(InputError) as caught:
        import_table([tmp_path / "a.csv"], tmp_path / "set", mapping, vehicle="motor")
    assert says in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv"]


def test_nominal_options_are_numbers() -> None:
    assert parse_nominal(["mass=0.6", "resistance=22"]) == {"mass": 0.6, "resistance": 22.0}
    for entry in ("mass", "mass=heavy", "=1", "mass=inf"):
        with pytest.raises(InputError, match="NAME=NUMBER"):
            parse_nominal([entry])


def test_a_unit_left_out_is_the_si_unit() -> None:
    assert parse_mapping(["time=t", "speed=w"])["speed"].unit == "rad/s"


def test_an_unknown_nominal_parameter_is_named(tmp_path: Path) -> None:
    file = write_json(tmp_path / "log.json", old_log())
    with pytest.raises(InputError, match=r"nominal\.weight: unknown nominal parameter"):
        import_wpilib([file], tmp_path / "set", nominal={"weight": 1.0})
    assert not (tmp_path / "set").exists()


def test_what_is_there_already_is_not_overwritten(tmp_path: Path) -> None:
    file = write_json(tmp_path / "log.json", old_log())
    (tmp_path / "set").mkdir()
    import_wpilib([file], tmp_path / "set")  # an empty folder may be filled
    before = (tmp_path / "set" / "dataset.toml").read_bytes()
    for out in (tmp_path / "set", file):
        with pytest.raises(InputError, match="exists already"):
            import_wpilib([file], out)
    assert (tmp_path / "set" / "dataset.toml").read_bytes() == before


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


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0 MAT-file", b"\x00" * 600, b"junk" * 300])
def test_a_file_that_is_no_mat_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mat: (is not a readable \.mat file|time: no variable)"):
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor")


@pytest.mark.parametrize(("version", "at"), [("v5", 128), ("v5", 145), ("v7", 150), ("v7.3", 520)])
def test_a_damaged_mat_file_is_refused_even_where_it_crashes_the_reader(tmp_path: Path, version: str, at: int) -> None:
    MAT_WRITERS[version](tmp_path / "a.mat")
    content = bytearray((tmp_path / "a.mat").read_bytes())
    content[at] ^= 0xFF  # byte 145 of v5 makes scipy 1.17 crash
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mat: is not a readable \.mat file"):
        import_matlab([tmp_path / "a.mat"], tmp_path / "set", MAPPING, vehicle="motor")
    assert not (tmp_path / "set").exists()


def test_missing_files_and_doubled_names_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nil\.json: no such file"):
        import_wpilib([tmp_path / "nil.json"], tmp_path / "set")
    with pytest.raises(InputError, match=r"nil\.mat: no such file"):
        import_matlab([tmp_path / "nil.mat"], tmp_path / "set", MAPPING, vehicle="motor")
    with pytest.raises(InputError, match="two files would both make run 'a'"):
        import_table([tmp_path / "a.csv", tmp_path / "b" / "a.csv"], tmp_path / "set", ["time=0"], vehicle="motor")
    with pytest.raises(InputError, match="no file to import"):
        import_table([], tmp_path / "set", ["time=0"], vehicle="motor")


@pytest.mark.parametrize("delimiter", ["tab", r"\t", "\t"])
def test_a_tab_may_be_spelt_out(delimiter: str, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0\t1\t2\n1\t1\t3\n", encoding="utf-8")
    mapping = ["time=0", "voltage=1", "speed=2"]
    imported = import_table([tmp_path / "a.txt"], tmp_path / "set", mapping, vehicle="motor", delimiter=delimiter)
    np.testing.assert_array_equal(read(imported.folder).runs[0].outputs["speed"], [2.0, 3.0])


def test_a_delimiter_that_is_none_is_refused_with_the_spellings_of_a_tab(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--delimiter: 'tabs' is not one of .*tab or \\t"):
        import_table([], tmp_path / "set", ["time=0"], vehicle="motor", delimiter="tabs")
