"""After a reset at any tick of a mission an AVR is off within a period, has forgotten all, and obeys a new session."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from brickpilot.hil.avr_flight import avr_image, open_robot
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.link.messages import book
from brickpilot.link.session import REALTIME
from brickpilot.vehicle import flight
from loader_resets import STEP_S, SUPPLY_V, Flight, InSteps, in_child, planned

ROUTE_MM = [(600, 600), (600, -200)]
SLOWER = 4000
"""A value of the setting cruise, 1/16 mm/s, below the image's own."""

HELD_STEPS, WATCHED_S = 3, 0.1
DRIVES_S = 3.0
"""s after the start within which a robot drives: it first rolls out and learns the gyro's bias at rest."""

DRIVEN_AGAIN = 4
"""One in this many resets is followed by a new mission, as that takes long and does not depend on the tick."""


def after_a_reset(flown: Flight, drives_again: bool) -> dict[str, Any]:
    """Cuts the supply for some steps, and returns what the robot then does and says."""
    before = flown.robot.tell().resets
    flown.robot.fault("BATTERY", SUPPLY_V)
    driven = [flown.drives() for _ in range(HELD_STEPS)]
    flown.robot.fault("BATTERY", 0.0)
    driven += flown.for_s(WATCHED_S)
    line = InSteps(flown)
    session = line.session()
    line.send([session.command_message("start")])
    refused = session.wait(book().by_name["MODE_REPLY"].id, lambda _: True, 0.03) is None
    driven += flown.for_s(WATCHED_S)
    session.open("coupled", REALTIME)
    found = {"route": session.route(), "cruise": session.read("cruise"), "refused": refused}
    session.upload(ROUTE_MM)
    session.command("start")
    obeys = not drives_again or any(flown.drives() for _ in range(round(DRIVES_S / STEP_S)))
    return found | {"driven": sum(driven), "obeys": obeys, "resets": flown.robot.tell().resets - before}


def resets(target: str, every: int, last_s: float) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """Yields a tick, the image's own cruise, and what a reset at that tick of a host's mission led to."""
    plan = planned(target, last_s)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors = np.zeros((plan.steps, 2), dtype=np.int16)
    with open_robot(plan, avr_image(target), AVR_TARGETS[target].chip, log, motors) as robot:
        flown = Flight(robot)
        session = InSteps(flown).session()
        session.open("coupled", REALTIME)
        cruise = session.read("cruise")
        session.upload(ROUTE_MM)
        session.write("cruise", SLOWER)
        session.command("start")
        for tick in range(round(last_s / STEP_S)):
            flown.drives()
            robot.receive(0.0)
            if tick % every == 0:
                drives_again = tick % (DRIVEN_AGAIN * every) == 0
                yield tick, cruise, in_child(lambda again=drives_again: after_a_reset(flown, again))


@pytest.mark.parametrize("target", ["avr:328p-imu", "avr:2560"])
def test_motors_are_off_in_a_period_all_is_forgotten_and_a_new_session_drives(target: str, full: bool) -> None:
    """Tries every tenth tick of 6 s, or each with --full: these include rest, drive, brake and turn."""
    tried = 0
    for tick, cruise, found in resets(target, 1 if full else 10, 6.0):
        tried += 1
        assert found["resets"] == 1, tick
        assert found["driven"] == 0, tick
        assert found["refused"], tick
        assert (found["route"], found["cruise"]) == ([], cruise), tick
        assert found["obeys"], tick
        assert cruise != SLOWER
    assert tried == (2000 if full else 200)
