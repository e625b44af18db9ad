"""The RCX's program flies whole missions on the simulator of its processor: the golden motor streams, bit for bit."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import make_golden
import numpy as np
import pytest
import step_study
from brickpilot.errors import InputError
from brickpilot.hil import ends
from brickpilot.hil.ends import check_sensors
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from command import brickpilot

ROOT = Path(__file__).parents[2]


def fly_golden(profile: str, sensors: str, folder: Path) -> subprocess.CompletedProcess[str]:
    options = ("--profile", profile, "--sensors", sensors, "--telemetry-every", "100", "--out", str(folder), "--json")
    return brickpilot("hil", "mission", "--target", "h8sim", *options, cwd=make_golden.GOLDEN.parent)


@pytest.fixture(scope="module")
def flights(
    tmp_path_factory: pytest.TempPathFactory,
) -> Mapping[tuple[str, str], Future[subprocess.CompletedProcess[str]]]:
    """Starts all flights, as many at a time as there are processors; each takes half a minute."""
    folder = tmp_path_factory.mktemp("h8sim")
    pool = ThreadPoolExecutor(os.cpu_count())
    return {
        (profile, sensors): pool.submit(fly_golden, profile, sensors, folder / f"{profile}-{sensors}")
        for profile, sensors in make_golden.FLIGHTS
    }


@pytest.mark.parametrize(("profile", "sensors"), make_golden.FLIGHTS)
def test_a_whole_mission_on_the_h8_gives_the_motor_stream_of_the_host(
    profile: str, sensors: str, flights: Mapping[tuple[str, str], Future[subprocess.CompletedProcess[str]]]
) -> None:
    done = flights[profile, sensors].result()
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert (figures["lost_frames"], figures["broke_off"]) == (0, None)
    assert figures["waypoints_reached"] == figures["waypoints_total"] == 8
    assert figures["steps"] == 20_000
    assert figures["motor_stream_sha256"] == make_golden.golden()[f"{profile}/{sensors}"]


@pytest.mark.parametrize(("built_for", "sensors"), [("imu", "imu"), ("rotation", "imu+encoders")])
def test_the_mission_at_the_step_of_the_rcx_equals_that_of_the_host(
    built_for: str, sensors: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    plan = flight.plan(scenario.load(scenario.packaged()["mission"]), rcx(), profile="coupled", sensors=sensors, seed=0)
    expected = step_study.fly_by(step_study.build(built_for, tmp_path), plan)
    assert expected.broke_off is None
    figures = flight_figures.summary(expected.flight)
    assert (figures["waypoints_reached"], figures["final_mode"]) == (8, "arrived")
    assert figures["cross_track_rms_m"] < 0.04  # 0.026 with a step of 3 ms
    commands = expected.flight.motors
    assert not np.any(commands[1::3] != commands[::3][: len(commands[1::3])])  # the commands change only every 9 ms

    with ends.both_ends(f"h8sim:{built_for}") as both:
        flown = step_study.at_the_link(both, plan)
    assert flown.broke_off is None
    np.testing.assert_array_equal(flown.flight.motors, commands)


def test_ideal_sensors_are_refused_for_a_brick_that_lacks_them() -> None:
    with pytest.raises(InputError, match=r"--sensors ideal: a brick has no ideal sensors; h8sim:imu flies with imu or"):
        check_sensors("h8sim:imu", "ideal")


def test_the_page_says_how_to_fly_once_more(tmp_path):
    scenario = 'name = "short"\nkind = "mission"\nduration_s = 0.3\nwaypoints_m = [[0.3, 0]]\n'
    (tmp_path / "short.toml").write_text(scenario, encoding="utf-8")
    folder = str(tmp_path / "run")
    flown = brickpilot(
        "hil", str(tmp_path / "short.toml"), "--target", "h8sim", "--out", folder, cwd=make_golden.GOLDEN.parent
    )
    assert flown.returncode == 1  # the mission takes longer than this flight
    assert "short.toml --target h8sim" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
