"""Hardware in the loop: the same motor stream over every link, what a brick refuses, and a lost brick."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import make_golden
import numpy as np
import pandas as pd
import pytest
from brickpilot.cli import main
from brickpilot.errors import InputError
from brickpilot.hil import ends, fly
from brickpilot.link.brick import open_link
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP, REALTIME, Session
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.compensation import FORMATS, Compensation
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.settings import settings as known_settings
from command import brickpilot

HEARTBEAT_STEPS = 100  # from one HEARTBEAT to the next, as in firmware/app/loop.c
LATE = 7  # fault number, in firmware/autopilot/mode.h, of a run that the watchdog ended
PATIENT_S = 5.0  # longest wait for a reply: a busy machine may not schedule the brick for a second
STARTED_HERE = ["serial:pty", "tcp", "can:slcan", "can:virtual"]


def plan(sensors: str = "ideal", profile: str = "coupled", **changes: object) -> flight.Plan:
    mission = scenario.load(scenario.packaged()["mission"])
    mission = dataclasses.replace(mission, **changes)  # type: ignore[arg-type]
    return flight.plan(mission, rcx(), profile=profile, sensors=sensors, seed=0)


def over(spec: str, wanted: flight.Plan, pace: str = LOCKSTEP, every: int = 10) -> fly.HilFlight:
    with ends.both_ends(spec) as both:
        patient = dataclasses.replace(both, reply_s=PATIENT_S)
        return fly.fly(patient, spec, wanted, pace=pace, telemetry_every=every, progress=lambda *_: None)


def undisturbed(flight_in_real_time: Callable[[], fly.HilFlight]) -> fly.HilFlight:
    """Flies up to six times, until no watchdog ends the flight: the machine itself can stall for 20 ms."""
    for _ in range(6):
        flown = flight_in_real_time()
        if flown.flight.log["fault"][-1] != LATE:
            break
    return flown


@pytest.fixture
def session() -> Iterator[Session]:
    with ends.both_ends("serial:pty") as both:
        made = Session(both.link, "serial:pty")
        made.open("coupled", LOCKSTEP)
        yield made


@pytest.mark.realtime  # a reply that is late counts as a lost frame
@pytest.mark.parametrize(
    ("spec", "sensors"), [("serial:pty", "ideal"), *((spec, "imu+encoders") for spec in STARTED_HERE)]
)
def test_the_mission_over_every_link_is_bit_for_bit_the_golden_one(spec: str, sensors: str) -> None:
    """Flights end 2 s after the mission, when the robot stands; the test of the paper's profile goes on to 60 s.

    The sensors change the readings in the messages and not how a link carries them.
    """
    host = flight.fly(plan(sensors))
    assert make_golden.digest(host.motors) == make_golden.golden()[f"coupled/{sensors}"]
    wanted = make_golden.cut(plan(sensors), host)
    flown = over(spec, wanted)
    np.testing.assert_array_equal(flown.flight.motors, host.motors[: wanted.steps])
    assert (flown.lost_frames, flown.late_ticks, flown.safe_stops, flown.broke_off) == (0, 0, 0, None)


def test_udp_multicast_carries_the_same_stream() -> None:
    wanted = plan(duration=3.0)
    try:
        flown = over("can:udp_multicast", wanted)
    except InputError as error:
        pytest.skip(f"this machine has no multicast: {error}")
    assert np.array_equal(flown.flight.motors, flight.fly(wanted).motors)


def test_the_paper_profile_over_a_pty_is_the_golden_one_too() -> None:
    figures = flight_figures.summary(over("serial:pty", plan(profile="paper")).flight)
    assert figures["motor_stream_sha256"] == make_golden.golden()["paper/ideal"]


def test_with_telemetry_every_step_the_log_equals_that_of_run() -> None:
    wanted = plan("imu+encoders", duration=20.0)
    alone, linked = flight.fly(wanted), over("serial:pty", wanted, every=1).flight
    assert list(linked.log) == list(alone.log)
    for column in alone.log:
        if "_cause" not in column:
            np.testing.assert_allclose(linked.log[column], alone.log[column], rtol=1e-12, atol=0, err_msg=column)


def test_each_finding_of_the_monitor_comes_within_three_heartbeats() -> None:
    wanted = plan("imu+encoders", duration=20.0)
    alone, linked = flight.fly(wanted), over("serial:pty", wanted, every=1).flight
    columns = [column for column in alone.log if "_cause" in column]
    assert len(columns) == 9
    for column in columns:
        ours, theirs = alone.log[column], linked.log[column]
        known = np.zeros(len(ours), dtype=bool)
        for late in range(3 * HEARTBEAT_STEPS + 2):
            known[late:] |= np.abs(theirs[late:] - ours[: len(ours) - late]) < 1e-9
        assert known[3 * HEARTBEAT_STEPS :].all(), column


def test_cruise_and_compensation_reach_the_brick() -> None:
    names = {"left_friction_mv": 120, "right_friction_mv": 110, "travel_scale_q15": 500, "battery_sags": 1}
    compensation = Compensation("m", dict.fromkeys(FORMATS, 0) | names)
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=9.0, cruise={"coupled": 0.31})
    wanted = flight.plan(mission, rcx(), sensors="imu+encoders", seed=3, compensation=compensation)
    plain = dataclasses.replace(wanted, compensation=None)
    assert np.array_equal(over("serial:pty", wanted).flight.motors, flight.fly(wanted).motors)
    assert not np.array_equal(flight.fly(plain).motors, flight.fly(wanted).motors)


@pytest.mark.realtime
def test_real_time_reaches_the_waypoint_and_counts_late_ticks() -> None:
    flown = undisturbed(lambda: over("serial:pty", plan(duration=3.0, waypoints=((0.3, 0.0),)), REALTIME))
    figures = flight_figures.summary(flown.flight)
    assert figures["waypoints_reached"] == 1
    assert 0.9 < figures["times_real_time"] < 1.1
    assert (flown.safe_stops, flown.broke_off) == (0, None)
    assert flown.late_ticks < 0.5 * figures["steps"]


def test_hil_writes_the_folder_and_the_keys_of_run(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 3\nwaypoints_m = [[0.3, 0]]\n', encoding="utf-8"
    )
    alone = brickpilot("run", "s.toml", "--json", cwd=tmp_path)
    done = brickpilot("hil", "s.toml", "--link", "serial:pty", "--json", "--out", "out", cwd=tmp_path, fresh=True)
    assert (done.returncode, done.stderr) == (0, "")
    figures, wanted = json.loads(done.stdout), json.loads(alone.stdout)
    assert figures.keys() >= wanted.keys() | {"link", "late_ticks", "lost_frames", "safe_stops"}
    assert figures["motor_stream_sha256"] == wanted["motor_stream_sha256"]
    assert figures["link"] == "serial:pty"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "log.csv", "report.html", "summary.json", "ticks.csv"
    ]  # fmt: skip
    logs = [pd.read_csv(tmp_path / folder / "log.csv", dtype=str) for folder in ("out", "runs/s-coupled-ideal")]
    telemetry = [log.loc[:, [column for column in log if "_cause" not in column]] for log in logs]
    assert telemetry[0].equals(telemetry[1])


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("serial:/nowhere/tty9", "No such file"),
        ("serial:/dev/null", "cannot be opened"),
        ("serial:/dev/null@fast", "no baud rate"),
        ("tcp:127.0.0.1:1", "no connection"),
        ("tcp:nowhere", "HOST:PORT"),
        ("tcp:127.0.0.1:99999", "HOST:PORT"),
        ("can:slcan:/nowhere/tty9", "cannot be opened"),
        ("can:socketcan:can9", "cannot be opened"),
        ("can:nothing:1", "no link"),
        ("carrier-pigeon", "no link"),
        ("", "no link"),
    ],
)
def test_a_bad_link_is_refused_in_one_line(
    spec: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main.main(["hil", "--link", spec, "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    assert (ended.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert said.err.startswith(f"brickpilot: --link {spec}")
    assert says in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("field", "says"), [("protocol", "speaks protocol 1"), ("crc", "another brickpilot.dbc")])
def test_a_brick_of_another_version_is_refused_in_one_line(
    field: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(book(), field, getattr(book(), field) ^ 2)
    with pytest.raises(SystemExit) as ended:
        main.main(["hil", "--link", "serial:pty", "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    assert (ended.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert says in said.err


def test_a_line_without_a_brick_is_reported_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    server = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=server.accept, daemon=True).start()
    with pytest.raises(SystemExit) as ended:
        main.main(["hil", "--link", f"tcp:127.0.0.1:{server.getsockname()[1]}", "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    server.close()
    assert ended.value.code in (1, 2)  # the server may close the connection first
    assert said.err.count("\n") == 1


def test_a_manoeuvre_is_refused_as_it_needs_no_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main.main(["hil", "fig4", "--link", "serial:pty", "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "manoeuvre" in capsys.readouterr().err


@pytest.mark.parametrize("spec", ["serial:pty", "tcp", "can:slcan"])
def test_a_brick_that_dies_leaves_the_robot_with_its_motors_off(spec: str, tmp_path: Path) -> None:
    wanted = plan(duration=12.0)
    process, address = ends.start_brick(ends.STARTED[spec])
    link = open_link(address)

    def kill(done: int, _steps: int, _text: str) -> None:
        if done == 1000:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()

    flown = fly.fly(ends.Ends(link, None), spec, wanted, pace=LOCKSTEP, telemetry_every=10, progress=kill)
    link.close()
    ends.end_brick(process)
    assert flown.broke_off is not None
    assert flown.safe_stops == 1
    last = int(np.flatnonzero(flown.flight.motors.any(axis=1))[-1])
    assert 990 <= last <= 1000
    assert len(flown.flight.motors) == last + 1 + fly.GIVE_UP_STEPS
    assert flown.flight.log["true_speed_m_s"][900] > 0.1
    assert abs(flown.flight.log["true_speed_m_s"][-1]) < 0.01


def test_a_lost_link_gives_status_1_and_keeps_the_flight_until_then(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 6\nwaypoints_m = [[0.3, 0.1]]\n'
        '[[faults]]\nkind = "plant_restart"\nfrom_s = 0.3\n',
        encoding="utf-8",
    )
    done = brickpilot("hil", "s.toml", "--link", "serial:pty", "--json", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    # On a busy machine the brick may stop reading for a second before a reply is missed.
    lost = r"(no reply|the other end does not read), 0\.300 s into the flight; the motors were stopped"
    assert re.search(lost, done.stderr)
    figures = json.loads(done.stdout)
    assert figures["steps"] == 100 + fly.GIVE_UP_STEPS
    assert figures["safe_stops"] >= 1
    assert "The link was lost" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("pace", [LOCKSTEP, pytest.param(REALTIME, marks=pytest.mark.realtime)])
def test_a_brick_without_messages_stops_and_needs_a_reset(pace: str) -> None:
    """After a silence longer than its watchdog allows, the brick keeps its motors off: only a reset ends the fault."""
    silent_s = 1.3 if pace == LOCKSTEP else 0.3
    wanted = plan(duration=9.0 if pace == LOCKSTEP else 3.0)

    def once() -> fly.HilFlight:
        paused: list[int] = []

        def pause(done: int, _steps: int, _text: str) -> None:
            if done == 400 and not paused:
                paused.append(done)
                threading.Event().wait(silent_s)

        with ends.both_ends("serial:pty") as both:
            return fly.fly(both, "serial:pty", wanted, pace=pace, telemetry_every=1, progress=pause)

    flown = undisturbed(once)
    log = flown.flight.log
    assert flown.flight.motors[390:400].any()
    assert not flown.flight.motors[560:].any()
    assert log["mode"][-1] == 3
    assert log["fault"][-1] == 6
    assert flown.safe_stops >= 1


def test_settings_are_written_read_back_and_range_checked(session: Session) -> None:
    assert session.read("speed_kp") == 1280
    session.write("speed_kp", 2000)
    assert session.read("speed_kp") == 2000
    with pytest.raises(InputError, match=r"speed_kp: 32768 is out of range"):
        session.write("speed_kp", 32768)
    with pytest.raises(InputError, match="out of range"):
        session.write("speed_kp", 2**40)
    assert session.read("speed_kp") == 2000
    for name in known_settings():
        session.write(name, session.read(name))


def test_settings_are_listed_and_written_by_the_command(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 0.6\nwaypoints_m = [[0.5, 0.0]]\n', encoding="utf-8"
    )
    listed = brickpilot("hil", "--link", "tcp", "--settings", "--json", cwd=tmp_path)
    assert json.loads(listed.stdout)["speed_kp"] == 1280
    fast, slow = (
        brickpilot("hil", "s.toml", "--link", "tcp", "--json", "--out", "out", *options, cwd=tmp_path)
        for options in ((), ("--set", "speed_kp=100", "--set", "cruise=800"))
    )
    assert "waypoint 1 was missed" in slow.stderr  # 0.6 s are too short to reach it
    logs = [json.loads(done.stdout)["motor_stream_sha256"] for done in (fast, slow)]
    assert logs[0] != logs[1]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "--set speed_kp=100 --set cruise=800" in page
    assert "Flown over tcp in lockstep: 0 late ticks, 0 lost frames, 0 safe stops" in page
    for pair, says in (("speed_kp=x", "whole number"), ("sped=1", "is no setting"), ("speed_kp=-1", "out of range")):
        done = brickpilot("hil", "s.toml", "--link", "tcp", "--set", pair, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert says in done.stderr


def test_creep_is_not_set_above_cruise(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nkind = "mission"\nduration_s = 0.6\nwaypoints_m = [[0.1, 0.0]]\n', encoding="utf-8"
    )

    def fly(*settings: str) -> tuple[int, str]:
        options = [word for pair in settings for word in ("--set", pair)]
        done = brickpilot("hil", "s.toml", "--link", "tcp", *options, cwd=tmp_path)
        return done.returncode, done.stderr

    refused = "creep: {} is above cruise, which is {}: it takes 0..cruise (1/16 mm/s)\n"
    assert fly("creep=6401") == (2, "brickpilot: " + refused.format(6401, 6400))  # compared with the brick's own cruise
    assert fly("creep=1300", "cruise=1299") == (2, "brickpilot: " + refused.format(1300, 1299))
    assert fly("align=1000", "pivot=999")[0] == 2
    for settings in (("creep=6400",), ("creep=8000", "cruise=8000"), ("cruise=1200",)):
        assert fly(*settings)[1].count("above cruise") == 0


def test_a_route_is_written_read_back_and_refused_as_a_whole(session: Session) -> None:
    route = [(1000, -2000), (-30000, 30000), (0, 0)]
    session.upload(route)
    assert session.route() == route
    for bad, says in (
        ([(1, 1), (30001, 0)], "waypoint 1: .* out of range"),
        ([(5, 5), (5, 5)], "repeated"),
        ([(0, k) for k in range(33)], "waypoint 32: is unknown to the brick"),
        ([], "empty"),
        ([(99999, 0)], "out of range"),
    ):
        with pytest.raises(InputError, match=says):
            session.upload(bad)
        assert session.route() == route


def test_a_command_without_meaning_in_its_mode_is_refused(session: Session) -> None:
    with pytest.raises(InputError, match="abort: has no meaning in mode idle"):
        session.command("abort")
    session.command("start")


def test_two_flights_can_use_the_same_brick_in_turn() -> None:
    process, address = ends.start_brick("--pty")
    wanted = plan(duration=3.0)
    streams = [over(address, wanted).flight.motors for _ in range(2)]
    ends.end_brick(process)
    assert np.array_equal(*streams)
    assert np.array_equal(streams[0], flight.fly(wanted).motors)


def test_claim_priority_returns_whether_the_system_grants_it() -> None:
    """The call runs in another process, so that the process of the tests keeps its priority."""
    code = (
        "import os; from brickpilot.hil.ends import claim_priority as c; print(c() is (os.sched_getscheduler(0) == 1))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "True\n"


def test_without_real_time_priority_the_flight_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert not ends.claim_priority()
