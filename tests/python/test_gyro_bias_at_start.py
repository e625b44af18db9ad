"""A mission begins with a learnt gyro bias, or reports that it has none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from brickpilot.vehicle import flight_figures
from brickpilot.vehicle.scenario import Fault
from command import brickpilot
from test_hil import over, plan

START_S = 1.0
BLOCK_STEPS = 64
MOST_STEPS = 255
WAITING, RUN = 0, 1


def missing(from_s: float, to_s: float) -> Fault:
    return Fault("missing_sensor", from_s, to_s, 1.0, "both", "imu")


def steps_of_rest(log: dict[str, np.ndarray]) -> int:
    return int(np.count_nonzero((log["mode"] == RUN) & (log["phase"] == WAITING)))


def test_the_mission_waits_for_the_bias_where_readings_were_missing() -> None:
    wanted = plan("imu+encoders", duration=4.0, waypoints=((0.3, 0.1),), faults=(missing(0.0, START_S),))
    flown = over("can:virtual", wanted, every=1).flight
    assert 0 <= steps_of_rest(flown.log) - (BLOCK_STEPS - 1) <= 2
    figures = flight_figures.summary(flown)
    assert figures["started_without_gyro_bias"] is False
    assert figures["waypoints_reached"] == 1
    assert flown.log["bias_unknown"][-1] == 0


def test_one_missing_reading_does_not_empty_the_block() -> None:
    gaps = tuple(missing(0.05 * k, 0.05 * k + 0.006) for k in range(20))
    wanted = plan("imu+encoders", duration=1.3, waypoints=((0.3, 0.1),), faults=gaps)
    log = over("can:virtual", wanted, every=1).flight.log
    assert steps_of_rest(log) == 0
    learnt = int(np.argmin(log["bias_unknown"]))
    assert BLOCK_STEPS < learnt < 1.3 * BLOCK_STEPS


SCARCE = "".join(
    f'[[faults]]\nkind = "missing_sensor"\nsensor = "imu"\nfrom_s = {0.099 * k:.3f}\nto_s = {0.099 * k + 0.093:.3f}\n'
    for k in range(18)
)
"""Faults: until 1.8 s, 2 of each 33 readings arrive. They are too few for a block, but less than 0.1 s apart."""


def test_a_start_without_a_bias_is_flagged_in_figures_text_and_page(tmp_path: Path) -> None:
    mission = 'name = "s"\nkind = "mission"\nduration_s = 4\nwaypoints_m = [[0.3, 0.1]]\n'
    (tmp_path / "s.toml").write_text(mission + SCARCE, encoding="utf-8")
    done = brickpilot("hil", "s.toml", "--sensors", "imu+encoders", "--link", "tcp", "--out", "out", cwd=tmp_path)
    assert done.stdout.count("gyro bias           not learnt before the start") == 1, done.stderr
    figures = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert figures["started_without_gyro_bias"] is True
    log = np.genfromtxt(tmp_path / "out" / "log.csv", delimiter=",", names=True)
    assert steps_of_rest({name: log[name] for name in ("mode", "phase")}) in (MOST_STEPS, MOST_STEPS + 1)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "not learnt before the start" in page
    (tmp_path / "s.toml").write_text(mission)
    well = brickpilot("hil", "s.toml", "--sensors", "imu+encoders", "--link", "tcp", "--out", "well", cwd=tmp_path)
    assert "gyro bias" not in well.stdout
    assert "not learnt before the start" not in (tmp_path / "well" / "report.html").read_text(encoding="utf-8")


def test_a_missed_waypoint_names_the_bias_that_was_not_learnt() -> None:
    wanted = plan("imu+encoders", duration=1.3, waypoints=((2.0, 0.1),))
    figures = flight_figures.summary(over("can:virtual", wanted).flight)
    assert "bias" not in str(flight_figures.failure(figures))
    figures["started_without_gyro_bias"] = True
    assert str(flight_figures.failure(figures)).endswith("; it started before the gyro's bias was learnt")
