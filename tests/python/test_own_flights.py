"""`why` explains flights of `run`, in which the firmware steers by its gyro, so the motors follow the gyro's noise."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import brickpilot as bp
import numpy as np
import pytest
from brickpilot.cli.main import cli
from brickpilot.data import reading
from brickpilot.errors import InputError
from click.testing import CliRunner, Result
from importing import import_flight

TURN = 2 * np.pi / 48  # rad of one count
ROUTE = """name = "short"
kind = "mission"
duration_s = 40
waypoints_m = [[0.8, 0], [0.8, 0.8], [0, 0.6]]
cruise_m_s = { paper = 1.0, coupled = 0.4 }
"""
"""Takes 10 s to fly, with turns of 90 degrees and more."""
CORNER = ROUTE.replace("[[0.8, 0], [0.8, 0.8], [0, 0.6]]", "[[0.4, 0], [0.4, 0.4]]")
"""Takes 4 s to fly: two legs, and a turn of 90 degrees between them."""
WEAK = {"motor_asymmetry": {"difference": 0.1}}
DRY = {"coulomb_friction": {"torque": 0.005}}


def brickpilot(*words: object) -> Result:
    return CliRunner().invoke(cli, [str(one) for one in words])


def flown(
    folder: Path,
    name: str,
    hidden: dict[str, dict[str, float]],
    sensors: str = "imu+encoders",
    seed: int = 1,
    course: str = ROUTE,
) -> Path:
    """Flies a short mission with effects that the firmware does not know, and returns the run folder."""
    robot, route = folder / f"{name}.toml", folder / "short.toml"
    bp.save_model(dataclasses.replace(bp.rcx(), effects=hidden), robot)
    route.write_text(course, encoding="utf-8")
    done = brickpilot("run", route, "--sensors", sensors, "--seed", seed, "--model", robot, "--out", folder / name)
    assert done.exit_code == 0, done.output
    return folder / name


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of a flight without a hidden effect."""
    return flown(tmp_path_factory.mktemp("plain"), "flight", {})


@pytest.mark.parametrize("hidden", [{}, WEAK, DRY], ids=["none", "motor_asymmetry", "coulomb_friction"])
def test_a_flight_shows_what_the_firmware_does_not_know(hidden: dict[str, dict[str, float]], tmp_path: Path) -> None:
    """`why` names the biases of the packaged IMU, which the nominal model lacks, and a weak motor or dry friction.

    Friction removes a hundred times the error that the gyro's bias leaves.

    A noise model that is fitted to the nominal residual would hide both. A disturbance of 112 Hz with 0.003 % of the
    residual's power is in the data, and is too small to be a reason for such a noise model.
    """
    answer = bp.why(flown(tmp_path, "flight", hidden, seed=2))
    assert answer.answer.ending == "cause"  # a mission turns at its waypoints: it is no straight run
    found = answer.finding
    assert found.closed_loop is not None
    assert found.closed_loop.gain > (0.15 if hidden is DRY else 0.2)  # friction weakens the loop
    assert found.verdict == "named"
    assert {one.name for one in found.effects} == {"accel_bias", "gyro_bias", *hidden}
    sizes = {one.name: next(iter(one.parameters.values())) for one in found.effects}
    assert sizes["accel_bias"].value == pytest.approx(0.03, abs=0.004)
    for name, values in hidden.items():
        (truth,) = values.values()
        assert sizes[name].value == pytest.approx(truth, rel=0.04)
        assert sizes[name].ci95[0] < truth < sizes[name].ci95[1]


def test_what_changed_between_two_flights_is_told_through_the_loop(tmp_path: Path) -> None:
    """The residual of the changed flight is correlated in time, like noise in a loop; that of the other flight is not.

    A gyro that reads 10 % too much also looks like a robot with less half track and less yaw inertia: two constants.
    """
    flights = [("first", {}), ("again", {}), ("turned", {"gyro_scale": {"error": 0.1}})]
    logs = [
        flown(tmp_path, name, hidden, seed=seed, course=CORNER) for seed, (name, hidden) in enumerate(flights, start=1)
    ]
    before, *later = (import_flight([log], tmp_path / f"{log.name}_data").folder for log in logs)
    found = bp.changed(before, *later)
    assert [*found.verdicts.values()] == ["nothing", "changed"]
    (one,) = found.changes
    assert one.what == "gyro_scale"
    assert one.since is None  # a flight begins at rest, where no change shows
    assert one.change.ci95[0] < 0.102
    assert one.change.ci95[1] > 0.098
    assert one.change.ci95[1] - one.change.ci95[0] < 0.02


def test_the_data_set_of_a_flight_holds_what_its_host_sees(plain: Path, tmp_path: Path) -> None:
    data = reading.read(import_flight([plain], tmp_path / "data", nominal={"mass": 0.8}).folder)
    (run,) = data.runs
    assert run.name == "flight"
    assert {*run.outputs} >= {"accel_surge", "accel_sway", "yaw_rate", "wheel_angle_left", "wheel_angle_right"}
    ended = json.loads((plain / "summary.json").read_text())["ended_at_s"]
    assert run.time[-1] == pytest.approx(ended + 1.0, abs=0.004)
    assert data.nominal["mass"].value == 0.8
    assert data.nominal["resistance"].value == bp.rcx().parameters["resistance"]
    angle = run.outputs["wheel_angle_left"]
    assert angle[-1] > 2 * np.pi  # it drove, and the counter is unwrapped
    assert np.abs(np.diff(angle)).max() < 10 * TURN


def test_flights_that_tell_nothing_are_refused(plain: Path, tmp_path: Path) -> None:
    ideal = flown(tmp_path, "ideal", {}, sensors="ideal")
    imu = flown(tmp_path, "imu", {}, sensors="imu")
    brickpilot("run", "forward_1m", "--sensors", "imu", "--out", tmp_path / "manoeuvre")
    other = shutil.copytree(plain, tmp_path / "other")
    (other / "summary.json").write_text((other / "summary.json").read_text().replace("{", '{"image": "own.elf",', 1))
    for folders, why in (
        ([other], "other: was flown by own.elf, whose counts per turn and nominal values are another robot's"),
        ([ideal], "ideal: was flown with ideal sensors, which no robot has"),
        ([imu, plain], r"flight: was flown with imu\+encoders, and .*imu with imu"),
        ([tmp_path / "manoeuvre"], "drives no motor by its duty: it is no flight of a mission"),
        ([tmp_path], "summary.json: is not the summary of a flight"),
    ):
        with pytest.raises(InputError, match=why):
            import_flight(folders, tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_flights_with_the_same_sensors_make_one_data_set(tmp_path: Path) -> None:
    folders = [flown(tmp_path, name, {}, sensors="imu") for name in ("first", "second")]
    made = brickpilot("import", *folders, "--out", tmp_path / "data")
    assert made.exit_code == 0, made.output
    assert [run.name for run in reading.read(tmp_path / "data").runs] == ["first", "second"]
