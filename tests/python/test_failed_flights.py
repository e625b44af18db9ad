"""A failed flight ends with exit status 1 and a line with the cause. JSON, page and JUnit file also give the cause."""

from __future__ import annotations

import json
import os
import signal
import threading
from pathlib import Path

import junitparser
import pytest
from brickpilot.hil import ends, fly
from brickpilot.link.brick import open_link
from brickpilot.link.session import REALTIME
from brickpilot.report import flight_text
from brickpilot.vehicle import flight_figures
from command import brickpilot
from test_hil import LATE, over, plan

TOO_SHORT = 'name = "s"\nkind = "mission"\nduration_s = 3\nwaypoints_m = [[0.3, 0], [2, 2]]\n'
FLOWN = 'name = "s"\nkind = "mission"\nduration_s = 3\nwaypoints_m = [[0.3, 0]]\n'
LOST = TOO_SHORT + '[[faults]]\nkind = "missing_sensor"\nsensor = "reference"\nfrom_s = 0.6\n'
CUT = TOO_SHORT + '[[faults]]\nkind = "plant_restart"\nfrom_s = 0.3\n'


@pytest.mark.parametrize("command", [("run",), ("hil", "--link", "tcp")])
def test_a_mission_that_was_not_flown_gives_status_1_and_its_cause(command: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(TOO_SHORT)
    done = brickpilot(*command, "s.toml", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert (
        "1 of 2 waypoints reached: waypoint 2 was missed by 2.397 m, and the flight was over after 3 s" in done.stderr
    )
    assert "waypoint 2: not reached" in done.stdout
    assert "cross-track error" in done.stdout
    figures = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert figures["failure"] in done.stderr
    assert figures["failure"] in (tmp_path / "out" / "report.html").read_text()
    again = brickpilot(*command, "s.toml", "--out", "out", "--json", cwd=tmp_path)
    assert (again.returncode, json.loads(again.stdout)["failure"]) == (1, figures["failure"])


@pytest.mark.parametrize("name", ["fig4", "fig5", "forward_1m"])
def test_a_manoeuvre_is_no_mission_and_cannot_fail_as_one(name: str, tmp_path: Path) -> None:
    done = brickpilot("run", name, "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr, json.loads(done.stdout)["failure"]) == (0, "", None)


def failing(file: Path) -> dict[str, str]:
    """Returns failed test case of a JUnit file -> message, as the library junitparser reads the file."""
    found = {}
    (suite,) = junitparser.JUnitXml.fromfile(str(file))
    assert suite.tests == len(list(suite))
    for case in suite:
        for result in case.result:
            found[case.name] = result.message
    assert suite.failures + suite.errors == len(found)
    return found


@pytest.mark.parametrize(
    ("scenario", "wrong"),
    [
        (FLOWN, {}),
        (TOO_SHORT, {"waypoint 2": "was missed by"}),
        (LOST, {"controller": 'fault "state lost" at 0.8', "waypoint 2": "was missed by"}),
        (
            CUT,
            {"link": "the link was lost", "safe stops": "were stopped", "waypoint 2": "missed"},
        ),
    ],
    ids=["flown", "too short", "state lost", "link lost"],
)
def test_junit_holds_what_the_exit_status_says(scenario: str, wrong: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(scenario)
    done = brickpilot("hil", "s.toml", "--link", "tcp", "--junit", "ci/flight.xml", cwd=tmp_path)
    found = failing(tmp_path / "ci" / "flight.xml")
    assert done.returncode == bool(wrong), done.stderr
    assert found.keys() - {"controller"} == wrong.keys() - {"controller"}, found
    assert all(says in found[name] for name, says in wrong.items()), found
    first = next(iter(wrong), None)
    assert first is None or found[first] in done.stderr


def test_junit_tells_of_a_flight_that_did_not_begin(tmp_path: Path) -> None:
    done = brickpilot("hil", "--link", "tcp:127.0.0.1:1", "--junit", "flight.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert "no connection" in failing(tmp_path / "flight.xml")["link"]


def test_a_name_with_signs_of_xml_is_text() -> None:
    text = flight_text.junit_text('<script>&"', [flight_figures.Check("link", "a < b & c")], "brickpilot 'x'")
    (suite,) = junitparser.JUnitXml.fromstring(text.partition("\n")[2])
    (case,) = suite
    assert (suite.name, case.result[0].message) == ('<script>&"', "a < b & c")


@pytest.mark.realtime
def test_a_late_tick_has_a_fault_of_its_own() -> None:
    """The brick stops for 40 ms: longer than its watchdog allows, but too short for the host to lose the link."""
    process, address = ends.start_brick("--pty")

    def stall(done: int, _steps: int, _text: str) -> None:
        if done == 300:
            os.kill(process.pid, signal.SIGSTOP)
            threading.Event().wait(0.04)
            os.kill(process.pid, signal.SIGCONT)

    link = open_link(address)
    wanted = plan(duration=6.0)
    flown = fly.fly(ends.Ends(link, None), "x", wanted, pace=REALTIME, telemetry_every=5, progress=stall)
    link.close()
    ends.end_brick(process)
    assert flown.flight.log["fault"][-1] == LATE
    figures = flight_figures.summary(flown.flight)
    assert figures["fault"] == flight_figures.LATE
    linked = {"link": "x", "broke_off": None, "late_ticks": 3, "lost_frames": 0, "safe_stops": flown.safe_stops}
    assert 'the fault "late tick" at ' in str(flight_figures.failure(figures | linked))
    assert flown.flight.plan.steps < 1000, "the flight ends a second after the fault, not with the scenario"


@pytest.mark.realtime
def test_in_real_time_the_flight_ends_a_second_after_its_mission() -> None:
    for _ in range(30):  # a busy machine often stalls for 20 ms, which is a late tick
        flown = over("serial:pty", plan(duration=30.0, waypoints=((0.3, 0.0),)), REALTIME)
        if flown.flight.log["fault"][-1] != LATE:
            break
    figures = flight_figures.summary(flown.flight)
    assert (figures["waypoints_reached"], figures["final_mode"]) == (1, "arrived")
    assert 0.9 < figures["simulated_s"] - figures["ended_at_s"] < 1.3
    assert flown.flight.log["true_speed_m_s"][-1] == pytest.approx(0, abs=1e-3)
