"""On the simulator of its processor, the RCX's program gives the golden motor streams of whole missions bit for bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import make_golden
import numpy as np
import pytest
import step_study
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError
from brickpilot.hil import ends, fly
from brickpilot.hil.ends import check_sensors
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight, flight_figures
from command import brickpilot

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def fly_on_the_h8(target: str, plan: flight.Plan) -> fly.HilFlight:
    """Flies `plan` on the H8 simulator. Telemetry is rare, because the simulated processor takes long to send it."""
    with ends.both_ends(target) as both:
        return fly.fly(both, target, plan, pace=LOCKSTEP, telemetry_every=255, progress=lambda *_: None)


@pytest.mark.parametrize(("profile", "sensors"), make_golden.FLIGHTS)
def test_a_whole_mission_on_the_h8_gives_the_motor_stream_of_the_host(profile: str, sensors: str) -> None:
    """The streams are compared until 2 s after the mission's end, because the robot then stands still."""
    plan = make_golden.planned(profile, sensors)
    host = flight.fly(plan)
    assert make_golden.digest(host.motors) == make_golden.golden()[f"{profile}/{sensors}"]
    plan = make_golden.cut(plan, host)
    flown = fly_on_the_h8("h8sim", plan)
    assert (flown.lost_frames, flown.broke_off) == (0, None)
    assert flight_figures.summary(flown.flight)["waypoints_reached"] == 8
    np.testing.assert_array_equal(flown.flight.motors, host.motors[: plan.steps])


@pytest.mark.parametrize(("built_for", "sensors"), [("imu", "imu"), ("rotation", "imu+encoders")])
def test_the_mission_at_the_step_of_the_rcx_equals_that_of_the_host(
    built_for: str, sensors: str, tmp_path: Path
) -> None:
    plan = dataclasses.replace(make_golden.planned("coupled", sensors), steps=round(45 / STEP_S))
    expected = step_study.fly_by(step_study.build(built_for, tmp_path), plan)
    assert expected.broke_off is None
    figures = flight_figures.summary(expected.flight)
    assert (figures["waypoints_reached"], figures["final_mode"]) == (8, "arrived")
    assert figures["cross_track_rms_m"] < 0.04  # 0.026 m with a step of 3 ms
    commands = expected.flight.motors
    assert not np.any(commands[1::3] != commands[::3][: len(commands[1::3])])  # the commands change only every 9 ms

    plan = make_golden.cut(plan, expected.flight)
    flown = fly_on_the_h8(f"h8sim:{built_for}", plan)
    assert flown.broke_off is None
    np.testing.assert_array_equal(flown.flight.motors, commands[: plan.steps])


def test_ideal_sensors_are_refused_for_a_brick_that_lacks_them() -> None:
    with pytest.raises(InputError, match=r"--sensors ideal: a brick has no ideal sensors; h8sim:imu flies with imu or"):
        check_sensors("h8sim:imu", "ideal")


def test_the_page_says_how_to_fly_once_more(tmp_path: Path) -> None:
    scenario = 'name = "short"\nkind = "mission"\nduration_s = 0.3\nwaypoints_m = [[0.3, 0]]\n'
    (tmp_path / "short.toml").write_text(scenario, encoding="utf-8")
    folder = str(tmp_path / "run")
    flown = brickpilot(
        "hil", str(tmp_path / "short.toml"), "--target", "h8sim", "--out", folder, cwd=make_golden.GOLDEN.parent
    )
    assert flown.returncode == 1  # the flight is too short for the mission
    assert "short.toml --target h8sim" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
