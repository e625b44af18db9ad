"""`ask` flies the missions that separate the rivals, within the robot's fence, until one explanation is left.

The guide "my_robot" calls `ask` for a whole robot; `test_guides` checks the effects that this call finds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import brickpilot as bp
import numpy as np
import pytest
from brickpilot.ask import courses as offered
from brickpilot.ask import question
from brickpilot.ask.courses import Limits
from brickpilot.ask.question import Driven
from brickpilot.cli.main import cli
from brickpilot.discover.finding import Share
from brickpilot.hil import ends, fly
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle import flight
from brickpilot.vehicle.scenario import Fault, Scenario
from click.testing import CliRunner

LIMITS = Limits(space_m=1.2, speed_m_s=0.5)
SENSORS = "imu+encoders"


def robot(folder: Path, **effects: dict[str, float]) -> Path:
    file = folder / "robot.toml"
    bp.save_model(dataclasses.replace(bp.rcx(), effects=effects), file)
    return file


def hidden(**effects: dict[str, float]) -> bp.Model:
    return dataclasses.replace(bp.rcx(), effects=effects)


@pytest.mark.parametrize("faults", [(), (Fault("drop", 1.0, 60.0, 0.03),)], ids=["clear", "messages lost"])
def test_the_motors_stop_at_the_fence(faults: tuple[Fault, ...]) -> None:
    mission = Scenario("far", "far", "mission", 30.0, waypoints=((3.0, 0.0),), cruise={"coupled": 0.5}, faults=faults)
    plan = flight.plan(mission, sensors=SENSORS, seed=1)
    free, fenced = fly.Fence(10.0), fly.Fence(0.6)
    gone = {}
    for fence in (free, fenced):
        with ends.memory_ends() as both:
            flown = fly.fly(both, "here", plan, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None, watch=fence)
        gone[fence] = flown.flight.log
    assert not free.crossed
    assert fenced.crossed
    assert gone[free]["true_x_m"].max() > 2.5
    log = gone[fenced]
    crossed = int(np.argmax(log["estimate_x_m"] > 0.6))
    assert len(log["time_s"]) - crossed == pytest.approx(fly.REST_STEPS, abs=5)  # a second to roll out, then the end
    late = crossed + (5 if not faults else 25)
    assert np.all(flown.flight.motors[late:] == 0)
    assert log["true_x_m"].max() < 0.6 + offered.ROLL_OUT_S * 0.5


def test_every_course_stays_within_the_limits_with_every_rival() -> None:
    chosen = offered.courses(LIMITS)
    assert len({one.name for one in chosen}) == len(chosen) == 10
    assert max(one.cruise["coupled"] for one in chosen) == 0.5
    turned = hidden(gyro_scale={"error": -0.4})  # its gyro shows too small a turn, so it drives elsewhere
    for course, flown in zip(chosen, offered.safe(chosen, [bp.rcx(), turned], SENSORS, LIMITS), strict=True):
        for one in flown:
            assert np.hypot(one.log["true_x_m"], one.log["true_y_m"]).max() < LIMITS.reach_m, course.name
    flown = offered.safe(chosen, [bp.rcx()], SENSORS, LIMITS)
    assert all(flown)
    assert not all(offered.safe(chosen, [bp.rcx(), turned], SENSORS, LIMITS))


def test_the_course_that_separates_the_rivals_is_chosen() -> None:
    """A caster's scrub acts only in turns, so a course with turns is chosen and not a straight leg."""
    noise = {"yaw_rate": 0.01, "wheel_angle_left": 0.04, "wheel_angle_right": 0.04}
    straight, *turning = [one for one in offered.courses(LIMITS) if "out_and_back" in one.name or "square" in one.name]
    rivals = [hidden(yaw_scrub={"moment": 0.012}), bp.rcx()]
    one_leg = dataclasses.replace(straight, waypoints=straight.waypoints[:1])
    decided = offered.deciding(rivals, noise, [one_leg, turning[0]], SENSORS, LIMITS)
    assert decided is not None
    assert decided[0] is turning[0]
    assert decided[1] > 1.0
    assert offered.deciding([bp.rcx(), bp.rcx()], noise, [one_leg, *turning], SENSORS, LIMITS) is None


def finding(verdict: str, *names: str, rivals: Sequence[str] = ()) -> Any:
    """Returns a stand-in for a `Finding`, with only the attributes that a question reads."""
    effects = [SimpleNamespace(name=name, claimed=True, equivalents=()) for name in names]
    shares = (Share(names, 0.6, ()), *(Share((rival,), 0.35 / len(rivals), ()) for rival in rivals))
    return SimpleNamespace(verdict=verdict, effects=effects, explanations=shares, augmented=bp.rcx(), noise_sd={})


FRICTION, PLAY = finding("named", "coulomb_friction"), finding("named", "gear_backlash")
EITHER = finding("ambiguous", "coulomb_friction", rivals=("gear_backlash",))


@pytest.mark.parametrize(
    ("says", "drives", "stopped", "missions"),
    [
        ([FRICTION, FRICTION], {}, "decided", 2),
        ([finding("none"), finding("none")], {}, "decided", 2),
        ([FRICTION, EITHER, PLAY, PLAY], {}, "decided", 4),  # later courses refute the answer from the first
        ([EITHER, EITHER, EITHER], {}, "budget", 3),
        ([FRICTION], {"ended": "fence"}, "fence", 1),
        ([EITHER], {"ended": "link"}, "link", 1),
        ([EITHER], {"battery_v": 6.9}, "budget", 1),
    ],
)
def test_the_questions_end_for_a_reason(says: list[Any], drives: dict[str, Any], stopped: str, missions: int) -> None:
    limits = dataclasses.replace(LIMITS, most=9 if drives or stopped != "budget" else missions, battery_v=7.0)
    told = iter(says)
    asked = question.ask(
        bp.rcx(), SENSORS, limits, lambda _course: Driven(**{"seconds": 9.0, "battery_v": 8.0, "ended": None} | drives),
        lambda: next(told), lambda _found, offers, driven: (offers[len(driven)], "next"),
    )  # fmt: skip
    assert asked.stopped == stopped
    assert len(asked.manoeuvres) == missions
    assert asked.finding is says[missions - 1]
    assert asked.sentence


def test_what_no_course_separates_is_said() -> None:
    asked = question.ask(
        bp.rcx(), SENSORS, LIMITS, lambda _course: Driven(9.0, 8.0, None), lambda: EITHER, lambda *_: None
    )
    assert asked.stopped == "undecidable"
    assert asked.manoeuvres[0].weights == {"coulomb_friction": 0.6, "gear_backlash": 0.35}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--space", "0.3"], "space: needs "),
        (["--speed", "3"], "speed: needs 0.05 to 1.6 m/s, not 3"),
        (["--link", "tube:1"], "--link tube:1: is no link"),
        (["--target", "h8sim"], "--target h8sim: has its own link"),
    ],
)
def test_a_wrong_limit_or_link_is_one_line(words: list[str], says: str, tmp_path: Path) -> None:
    file = robot(tmp_path)
    link = [] if words[0] == "--link" else ["--link", "can:virtual"]
    done = CliRunner().invoke(cli, ["ask", str(file), *link, *words, "--out", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert says in str(done.exception)
    assert not (tmp_path / "out").exists()
