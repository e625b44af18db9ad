"""The RCX's program flies whole missions on the simulator of its processor: the golden motor streams, bit for bit."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import make_golden
import numpy as np
import pytest
import step_study
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError
from brickpilot.hil import ends
from brickpilot.hil.ends import check_sensors
from brickpilot.vehicle import flight, flight_figures, scenario
from command import brickpilot
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Flown:
    """A golden flight: its plan, the host's motor commands for it, and the command that flies it on the H8."""

    plan: flight.Plan
    host: NDArray[np.int16]
    done: Future[subprocess.CompletedProcess[str]]


def fly_golden(profile: str, sensors: str, folder: Path, seconds: float) -> subprocess.CompletedProcess[str]:
    text = scenario.packaged()["mission"].read_text(encoding="utf-8")
    mission = folder.with_suffix(".toml")
    mission.write_text(text.replace("duration_s = 60", f"duration_s = {seconds:.3f}"), encoding="utf-8")
    options = ("--profile", profile, "--sensors", sensors, "--telemetry-every", "100", "--out", str(folder), "--json")
    return brickpilot("hil", str(mission), "--target", "h8sim", *options, cwd=make_golden.GOLDEN.parent)


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Mapping[tuple[str, str], Flown]:
    """Starts all flights, as many at a time as there are processors; each takes half a minute.

    That of the paper goes on to the 60 s of the mission: the robot stands. The others end 2 s after the mission's end.
    """
    folder = tmp_path_factory.mktemp("h8sim")
    pool = ThreadPoolExecutor(os.cpu_count())
    started = {}
    for profile, sensors in make_golden.FLIGHTS:
        plan = make_golden.planned(profile, sensors)
        host = flight.fly(plan)
        if profile != "paper":
            plan = make_golden.cut(plan, host)
        place = folder / f"{profile}-{sensors}"
        done = pool.submit(fly_golden, profile, sensors, place, plan.steps * STEP_S)
        started[profile, sensors] = Flown(plan, host.motors, done)
    return started


@pytest.mark.parametrize(("profile", "sensors"), make_golden.FLIGHTS)
def test_a_whole_mission_on_the_h8_gives_the_motor_stream_of_the_host(
    profile: str, sensors: str, flights: Mapping[tuple[str, str], Flown]
) -> None:
    flown = flights[profile, sensors]
    assert make_golden.digest(flown.host) == make_golden.golden()[f"{profile}/{sensors}"]
    done = flown.done.result()
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads(done.stdout)
    assert (figures["lost_frames"], figures["broke_off"]) == (0, None)
    assert figures["waypoints_reached"] == figures["waypoints_total"] == 8
    assert figures["steps"] == flown.plan.steps
    assert figures["steps"] == 20_000 or profile == "coupled"
    assert figures["motor_stream_sha256"] == make_golden.digest(flown.host[: flown.plan.steps])


@pytest.mark.parametrize(("built_for", "sensors"), [("imu", "imu"), ("rotation", "imu+encoders")])
def test_the_mission_at_the_step_of_the_rcx_equals_that_of_the_host(
    built_for: str, sensors: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    plan = make_golden.planned("coupled", sensors)
    expected = step_study.fly_by(step_study.build(built_for, tmp_path), plan)
    assert expected.broke_off is None
    figures = flight_figures.summary(expected.flight)
    assert (figures["waypoints_reached"], figures["final_mode"]) == (8, "arrived")
    assert figures["cross_track_rms_m"] < 0.04  # 0.026 with a step of 3 ms
    commands = expected.flight.motors
    assert not np.any(commands[1::3] != commands[::3][: len(commands[1::3])])  # the commands change only every 9 ms

    plan = make_golden.cut(plan, expected.flight)
    with ends.both_ends(f"h8sim:{built_for}") as both:
        flown = step_study.at_the_link(both, plan)
    assert flown.broke_off is None
    np.testing.assert_array_equal(flown.flight.motors, commands[: plan.steps])


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
