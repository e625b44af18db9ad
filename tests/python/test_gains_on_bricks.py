"""Images of both bricks hold a gain set: its raw integers control flights on simulated processors of RCX and AVR."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h8_flight
import numpy as np
import pytest
from brickpilot.firmware import boards, robot, simulate
from brickpilot.firmware.robot import Robot
from brickpilot.hil import avr_flight
from brickpilot.hil.avr_flight import open_robot
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle import flight
from brickpilot.vehicle.flight import Flight, Plan
from test_firmware import OWN, ROOT, write
from test_gains import TUNED

TARGET = "avr:328p-rotation"


def planned(folder: Path, board: str, sensors: str, steps: int) -> tuple[Robot, Plan]:
    """Writes headers with the gains into `folder`. Returns the robot `middle` and the plan of its flight."""
    own = robot.load(write(folder, "middle", OWN["middle"]))
    mission, flags = simulate.mission(own, None), boards.flags_of(boards.BOARDS[board], sensors, ROOT)
    tuned = robot.with_gains(own, TUNED)
    boards.write_headers(tuned, mission, boards.BOARDS[board], boards.step_of(flags), folder / "own", ROOT)
    return own, dataclasses.replace(simulate.plan(own, mission, sensors, 0), steps=steps)


def in_process(own: Robot, plan: Plan, board: str, monkeypatch: pytest.MonkeyPatch) -> Flight:
    """Returns the flight of a firmware that is compiled without these gains and gets them as settings."""
    monkeypatch.chdir(ROOT)
    library = boards.closed_loop(own, boards.BOARDS[board], plan.sensors).library()
    return flight.fly(dataclasses.replace(plan, firmware=library, gains=TUNED))


def test_the_rcx_processor_flies_with_them_bit_for_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own, plan = planned(tmp_path, "rcx", "imu", 1000)
    flags = boards.flags_of(boards.RCX, "imu", ROOT)
    there = h8_flight.motors(tmp_path / "own", flags, plan, tmp_path)
    here = in_process(own, plan, "rcx", monkeypatch).motors
    np.testing.assert_array_equal(there, here)
    assert np.abs(here).max() > 10_000


def test_the_avr_image_holds_them_and_drives_on_simavr_as_the_simulation_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, plan = planned(tmp_path, "avr", "imu+encoders", round(1.8 / 0.003))
    plan = dataclasses.replace(plan, start_step=100)  # the robot still waits until it knows the gyro's bias
    (tmp_path / "image").mkdir()
    boards.build(boards.BOARDS["avr"], "imu+encoders", tmp_path / "own", tmp_path / "image", ROOT)
    image = tmp_path / "image/brickpilot.elf"
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors = np.zeros((plan.steps, 2), dtype=np.int16)
    with open_robot(plan, image, AVR_TARGETS[TARGET].chip, log, motors, None) as brick:
        session = Session(brick, TARGET, lambda *_: None, avr_flight.REPLY_S)
        session.open("coupled", REALTIME)
        assert {name: session.read(name) for name in TUNED.raw} == TUNED.raw
    flown = avr_flight.fly(plan, TARGET, image, telemetry_every=10, progress=lambda *_: None).flight
    simulated = in_process(own, plan, "avr", monkeypatch)
    apart = np.hypot(*(flown.log[name] - simulated.log[name] for name in ("true_x_m", "true_y_m")))
    assert np.hypot(simulated.log["true_x_m"][-1], simulated.log["true_y_m"][-1]) > 0.05
    assert apart.max() < 0.005
