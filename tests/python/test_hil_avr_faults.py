"""After each fault in the AVR and at its pins, the motors are safe.

Each test says what safe means: the bridges coast (every pin is an input), they short the motors (duty 0), or the robot
goes on as it should. Each flight drives straight ahead when the fault begins.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickpilot.hil import avr_flight
from brickpilot.hil import fly as over_a_link
from brickpilot.hil.avr_flight import AvrRobot, avr_image
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.hil.linked_flight import board_figures
from brickpilot.link.messages import book
from brickpilot.link.session import Session
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.scenario import Fault
from brickpilot.vehicle.settings import settings
from command import brickpilot

ROOT = Path(__file__).parents[2]
BEGIN_S = 1.5
COMMANDED, LATE_TICK = 4, 7  # numbers of faults in the log

STRAIGHT = """\
name = "straight"
title = "Straight ahead, with a fault"
kind = "mission"
duration_s = 2.0
start_at_s = 0.3
start = { x_m = 0, y_m = 0, heading_deg = 0 }
waypoints_m = [[2, 0]]
sensors = "imu"
"""


@dataclasses.dataclass(frozen=True)
class Faulty:
    """A flight with a fault; its duties (steps, 2) and count of resets (steps,) at the start of each step."""

    flown: over_a_link.HilFlight
    duty: Any
    resets: Any

    def after(self, seconds: float) -> Any:
        """Returns the duties from `seconds` after the beginning of the fault on."""
        return self.duty[round((BEGIN_S + seconds) / 0.003) :]

    def last(self, column: str) -> float:
        return float(self.flown.flight.log[column][-1])


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def fly(
    *faults: Fault,
    target: str = "avr:328p-imu",
    seconds: float = 2.0,
    each_step: Callable[[AvrRobot, int], None] = lambda _robot, _step: None,
) -> Faulty:
    straight = dataclasses.replace(
        scenario.load(scenario.packaged()["mission"]), waypoints=((2.0, 0.0),), start_at=0.3, faults=faults
    )
    plan = flight.plan(straight, rcx(), profile="coupled", sensors=AVR_TARGETS[target].sensors[0])
    plan = dataclasses.replace(plan, steps=round(seconds / 0.003))
    duty, resets = [], []

    def look(robot: AvrRobot, step: int) -> None:
        told = robot.tell()
        duty.append(tuple(told.duty))
        resets.append(told.resets)
        each_step(robot, step)

    flown = avr_flight.fly(
        plan, target, avr_image(target), telemetry_every=10, progress=lambda *_: None, each_step=look
    )
    faulty = Faulty(flown, np.array(duty), np.array(resets))
    assert np.all(faulty.duty[round(BEGIN_S / 0.003) - 1] > 0.2), "it does not drive before the fault"
    return faulty


def assert_never_drives_again(faulty: Faulty, within_s: float) -> None:
    """Asserts that no motor is driven from `within_s` after the beginning of the fault until the end of the flight.

    An image may start its mission by itself 2 s after power-on, so the flight goes on for more than 2.4 s.
    """
    after = faulty.after(within_s)
    assert not np.nan_to_num(after).any(), "a motor has been driven again"
    assert len(after) > 2.4 / 0.003
    assert faulty.flown.broke_off is not None
    assert "the brick was reset" in faulty.flown.broke_off


def test_a_held_main_program_is_reset_by_the_watchdog_and_does_not_drive_off_again() -> None:
    """Safe: from 36 ms after the main program stops no motor is driven, and the robot waits for a host.

    A reset makes all pins inputs, so that the motors coast; the image that starts anew shorts them within a
    millisecond. The watchdog's time is 30 ms, in simavr 32 ms. The image starts its mission 2 s after
    power-on, but not after a reset by the watchdog.
    """
    faulty = fly(Fault("main_held", BEGIN_S, BEGIN_S + 0.034), seconds=BEGIN_S + 3)
    assert faulty.resets[-1] == 1
    assert board_figures(faulty.flown.board)["started_by"] == "the watchdog"
    assert_never_drives_again(faulty, 0.036)


def test_a_brown_out_lets_the_motors_coast_at_once() -> None:
    """Safe: no motor is driven from one control step after the supply falls below 4.3 V, nor after it is back."""
    faulty = fly(Fault("brown_out", BEGIN_S, BEGIN_S + 0.1), seconds=BEGIN_S + 3)
    assert faulty.resets[-1] == 1
    assert np.isnan(faulty.after(0.003)[:30]).all(), "the bridges do not coast"
    assert_never_drives_again(faulty, 0.003)


def test_a_stuck_interrupt_is_reset_by_the_watchdog() -> None:
    """Safe: as with a held main program, while the interrupt repeats and afterwards, but up to a control step later.

    Between two interrupts the main program does one instruction, so it may still restart the watchdog once.
    """
    faulty = fly(Fault("interrupt_stuck", BEGIN_S, BEGIN_S + 0.3))
    assert faulty.resets[-1] > 1
    assert not np.nan_to_num(faulty.after(0.039)).any()


def test_a_stuck_converter_ends_the_run_with_motors_off() -> None:
    """Safe: without gyro the run ends after `blind_ms` and `lost_ms`, 0.25 s together, and both motors are shorted."""
    faulty = fly(Fault("converter_stuck", BEGIN_S, BEGIN_S + 0.1))
    assert (faulty.after(0.26) == 0).all()
    assert faulty.last("fault") != 0
    assert faulty.resets[-1] == 0


def test_bytes_that_the_receiver_loses_change_nothing_and_the_host_can_still_stop_the_robot() -> None:
    """Safe: no damaged request is obeyed, the robot drives on, and the command to stop comes through afterwards."""
    cruise, request = settings()["cruise"], book().by_name["PARAMETER_REQUEST"]
    slower = cruise.raw(0.3)
    overruns = []

    def speak(robot: AvrRobot, step: int) -> None:
        at = step * 0.003
        if BEGIN_S <= at < BEGIN_S + 0.5 and step % 5 == 0:
            robot.send([(request.id, request.seal(step & 255, cruise.number, 1, slower))])
        elif at >= BEGIN_S + 0.5 and step % 5 == 0:
            robot.send([Session(robot, "avr").command_message("abort")])
        overruns.append(robot.tell().overruns)

    faulty = fly(Fault("overrun", BEGIN_S, BEGIN_S + 0.5, 0.1), seconds=2.2, each_step=speak)
    assert overruns[-1] > 20
    during = faulty.flown.flight.log["demand_speed_m_s"][round(BEGIN_S / 0.003) : round((BEGIN_S + 0.5) / 0.003)]
    known = {round(value, 3) for value in during}
    assert known <= {0.5, 0.3}
    assert 0.3 in known  # some requests came through
    assert (faulty.after(0.55) == 0).all()
    assert faulty.last("fault") == COMMANDED
    assert faulty.resets[-1] == 0


def test_pulses_on_a_rotation_sensor_do_not_move_the_robot_off() -> None:
    """Safe: a false pulse counts forward and back again; 1000 a second shift the estimate by under 30 mm in 0.5 s."""
    faulty = fly(Fault("encoder_noise", BEGIN_S, 2.0, 0.05), target="avr:328p-rotation")
    log = faulty.flown.flight.log
    assert abs(log["estimate_x_m"][-1] - log["true_x_m"][-1]) < 0.03
    assert (faulty.last("fault"), faulty.resets[-1]) == (0, 0)
    assert faulty.duty[-1].min() > 0.2


def test_in_a_storm_on_the_rotation_sensors_the_host_can_still_stop_the_robot() -> None:
    """Safe: in 100,000 false pulses a second the brick hears the host. 0.1 s after its command no motor is driven.

    A tick that is 20 ms late also stops the motors, and so does the watchdog. The robot's estimate of its travel is
    wrong by then.
    """

    def storm(robot: AvrRobot, step: int) -> None:
        if step == round(BEGIN_S / 0.003):
            robot.fault("ENCODER_NOISE", 100_000.0)
        if step * 0.003 >= BEGIN_S + 0.2 and step % 5 == 0:
            robot.send([Session(robot, "avr").command_message("abort")])

    faulty = fly(target="avr:328p-rotation", each_step=storm)
    assert not np.nan_to_num(faulty.after(0.3)).any()
    assert faulty.last("fault") in (COMMANDED, LATE_TICK) or faulty.resets[-1] > 0


def test_a_fault_of_the_brick_stands_in_the_scenario_and_fails_the_flight(tmp_path: Path) -> None:
    file = tmp_path / "held.toml"
    file.write_text(f'{STRAIGHT}\n[[faults]]\nkind = "main_held"\nfrom_s = 1.5\n')
    done = brickpilot("hil", str(file), "--target", "avr:328p-imu", "--out", str(tmp_path / "run"), "--json", cwd=ROOT)
    assert done.returncode == 1
    assert "the brick was reset by its watchdog or its brown-out detector, 1.53" in done.stderr
    assert "the motors were stopped" in done.stderr
    figures = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (figures["waypoints_reached"], figures["safe_stops"]) == (0, 1)
    other = brickpilot("hil", str(file), "--link", "tcp", cwd=ROOT)
    assert (other.returncode, "main_held: needs --target avr" in other.stderr) == (2, True)
