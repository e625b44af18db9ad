"""An AVR may be reset at any tick of a mission.

Then its motors are off within a period, its route and settings are lost, and it obeys a new session.
"""

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

HELD_STEPS, BOOTS_S, REFUSED_S = 3, 0.03, 0.03
RESTS_S = 0.7
"""Time for which a robot that must not start is watched, s: a robot that starts drives after 0.5 s."""
DRIVES_S = 3.0
"""Time from the start within which a robot drives, s: it first rolls out and learns the gyro's bias at rest."""

LONG = 20
"""Only one of this many resets is watched for RESTS_S and followed by a drive, because both take long. After each other
reset, too, route and settings are checked to be those of a new robot, and a start is accepted."""


def after_a_reset(flown: Flight, long: bool) -> dict[str, Any]:
    """Cuts the supply for some steps. Returns what the robot then does and replies, before and after a new start."""
    before = flown.robot.tell().resets
    flown.robot.fault("BATTERY", SUPPLY_V)
    driven = [flown.drives() for _ in range(HELD_STEPS)]
    flown.robot.fault("BATTERY", 0.0)
    driven += flown.for_s(BOOTS_S)
    line = InSteps(flown)
    session = line.session()
    line.send([session.command_message("start")])
    refused = session.wait(book().by_name["MODE_REPLY"].id, lambda _: True, REFUSED_S) is None
    driven += flown.for_s(RESTS_S if long else 0.0)
    session.open("coupled", REALTIME)
    found = {"route": session.route(), "cruise": session.read("cruise"), "refused": refused}
    session.upload(ROUTE_MM)
    found["driven"] = sum(driven) + line.driven
    session.command("start")
    obeys = not long or any(flown.drives() for _ in range(round(DRIVES_S / STEP_S)))
    return found | {"obeys": obeys, "resets": flown.robot.tell().resets - before}


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
                long = tick % (LONG * every) == 0
                yield tick, cruise, in_child(lambda long=long: after_a_reset(flown, long))


@pytest.mark.parametrize("target", ["avr:328p-imu", "avr:2560"])
def test_motors_are_off_in_a_period_all_is_forgotten_and_a_new_session_drives(target: str, full: bool) -> None:
    """Tries every tenth tick of 6 s, with --full every tick: the robot rests, drives, brakes and turns in this time."""
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
