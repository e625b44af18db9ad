"""The firmware's monitor names causes that set in during a flight, says nothing without a cause, and hosts show it."""

from __future__ import annotations

import dataclasses
import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from brickpilot.cli.monitor import monitor
from brickpilot.errors import InputError
from brickpilot.hil import avr_flight
from brickpilot.link.messages import book
from brickpilot.report.flight_text import monitor_line
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.flight_figures import monitor_figures
from click.testing import CliRunner
from command import brickpilot

MISSION = scenario.load(scenario.packaged()["mission"])
ONSET = 14.0


def said(effects: Mapping[str, Mapping[str, float]], sensors: str, at: float = ONSET) -> list[dict[str, Any]]:
    """Returns what the monitor says after a mission in which these effects set in at `at` s."""
    mission = dataclasses.replace(MISSION, effects=effects, sets_in_at=at, duration=40.0)
    return monitor_figures(flight.fly(flight.plan(mission, profile="coupled", sensors=sensors)).log)


@pytest.mark.parametrize("sensors", scenario.SENSORS)
@pytest.mark.parametrize(
    ("cause", "effects", "size"),
    [
        ("friction", {"coulomb_friction": {"torque": 0.005}}, 0.564),
        ("braking", {"viscous_loss": {"drag": 4e-4}}, 0.168),
        ("slip", {"wheel_slip": {"creep": 0.2, "friction": 0.8}}, 0.25),
    ],
)
def test_a_cause_of_both_wheels_is_named_with_its_size_and_onset(
    cause: str, effects: dict[str, dict[str, float]], size: float, sensors: str
) -> None:
    told = said(effects, sensors)
    assert {one["channel"] for one in told} == {"left", "right"}
    assert {one["cause"] for one in told} <= {cause, "undecided"}
    named = [one for one in told if one["cause"] == cause]
    assert named
    for one in named:
        assert one["size"] == pytest.approx(size, rel=0.2)
        assert one["since_s"] == pytest.approx(ONSET, abs=4.0)
        assert one["until_s"] is None


@pytest.mark.parametrize("sensors", scenario.SENSORS)
def test_a_battery_that_sags_is_named_beside_sound_wheels(sensors: str) -> None:
    [battery] = said({"battery_sag": {"resistance": 4.0}}, sensors)
    assert (battery["channel"], battery["cause"]) == ("battery", "supply")
    assert battery["size"] == pytest.approx(4.0 / 22.0, rel=0.35)


@pytest.mark.parametrize("sensors", scenario.SENSORS)
def test_nothing_is_said_of_a_robot_like_the_model(sensors: str) -> None:
    assert said({}, sensors, at=0.0) == []


def test_a_line_gives_place_cause_size_and_time() -> None:
    left = {"channel": "left", "cause": "friction", "size": 0.56, "since_s": 14.21, "until_s": None}
    assert monitor_line(left) == "left wheel: dry friction +0.56 V since 14.2 s"
    battery = {"channel": "battery", "cause": "supply", "size": 0.182, "since_s": 3.0, "until_s": 20.0}
    assert monitor_line(battery) == "battery: resistance +18.2 % of a motor's since 3.0 s until 20.0 s"
    right = {"channel": "right", "cause": "undecided", "size": 0.0, "since_s": 3.0, "until_s": None}
    assert monitor_line(right) == "right wheel: not decided yet since 3.0 s"


TEXT = f"""
name = "rubs"
kind = "mission"
duration_s = 40
sensors = "imu"
waypoints_m = [[1.0, 0], [1.0, 1.0], [0, 1.0], [0, 0], [1, 0.5], [1.5, 1.5]]
sets_in_at_s = {ONSET}
[effects.coulomb_friction]
torque = 0.005
"""


def test_run_and_hil_show_what_the_monitor_says(tmp_path: Path) -> None:
    file = tmp_path / "rubs.toml"
    file.write_text(TEXT, encoding="utf-8")
    told = {}
    for command in (["run"], ["hil", "--link", "serial:pty"]):
        out = tmp_path / command[0]
        done = brickpilot(*command, str(file), "--out", str(out), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "monitor             left wheel: dry friction +0.5" in done.stdout
        page = (out / "report.html").read_text(encoding="utf-8")
        assert "The monitor: left wheel: dry friction" in page
        assert "coulomb_friction (torque 0.005), from 14 s on." in page
        told[command[0]] = json.loads((out / "summary.json").read_text(encoding="utf-8"))["monitor"]
    assert [one["cause"] for one in told["run"]] == [one["cause"] for one in told["hil"]]
    for ours, theirs in zip(told["run"], told["hil"], strict=True):
        assert ours["size"] == pytest.approx(theirs["size"], abs=0.02)
        assert ours["since_s"] == pytest.approx(theirs["since_s"], abs=0.01)


def test_a_mission_file_keeps_its_onset(tmp_path: Path) -> None:
    file = tmp_path / "rubs.toml"
    file.write_text(TEXT, encoding="utf-8")
    mission = scenario.load(file)
    file.write_text(scenario.render_mission(mission), encoding="utf-8")
    assert scenario.load(file) == mission
    file.write_text(TEXT.replace(f"= {ONSET}", "= 41"), encoding="utf-8")
    with pytest.raises(InputError, match="sets_in_at_s"):
        scenario.load(file)


def test_monitor_shows_each_change_that_a_brick_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    left, battery = (book().by_name[f"MONITOR_{name}"].id for name in ("LEFT", "BATTERY"))
    reports = [
        [(left, struct.pack("<hIBB", 0, 0, 1, 0)), (left, b"short"), (0x180, bytes(8))],
        [(left, struct.pack("<hIBB", 560, 14200, 2, 2))],
        [(left, struct.pack("<hIBB", 560, 14200, 3, 2))],  # no change but the time
        [(battery, struct.pack("<hIBB", 182, 20000, 4, 4)), (battery, struct.pack("<hIBB", 182, 20000, 5, 9))],
        [(left, struct.pack("<hIBB", 0, 30000, 6, 0))],
    ]

    class Brick:
        """A link over which a brick sends its reports, and is then gone."""

        def receive(self, timeout: float) -> list[tuple[int, bytes]]:
            if not reports:
                raise KeyboardInterrupt
            return reports.pop(0)

        def close(self) -> None:
            pass

    monkeypatch.setattr("brickpilot.link.brick.open_link", lambda spec: Brick())
    done = CliRunner().invoke(monitor, ["--link", "serial:x"])
    assert done.exit_code == 0, done.output
    assert done.output.splitlines() == [
        "left wheel: dry friction +0.56 V since 14.2 s",
        "battery: resistance +18.2 % of a motor's since 20.0 s",
        "left: as the model again",
    ]


def test_a_simulated_avr_refuses_a_plant_that_changes() -> None:
    mission = dataclasses.replace(MISSION, effects={"coulomb_friction": {"torque": 0.005}}, sets_in_at=ONSET)
    with pytest.raises(InputError, match="sets_in_at_s: sets in during the flight"):
        avr_flight._check_plan(flight.plan(mission, profile="coupled", sensors="imu"), "avr:328p-imu")
