"""The RCX's program on the simulator of its processor: the motor commands of `brickpilot run`, bit for bit."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from brickpilot import flight, scenario
from brickpilot.hil import ends, fly
from brickpilot.hil.session import LOCKSTEP
from brickpilot.model import rcx

SECONDS = 0.24  # of the mission; the simulator takes a minute for one


@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_h8_gives_the_motor_stream_of_the_host(profile: str) -> None:
    assert shutil.which("h8300-hms-gcc"), "no h8300-hms-gcc: tests/run installs it"
    mission = scenario.load(scenario.packaged()["mission"])
    wanted = flight.plan(
        dataclasses.replace(mission, duration=SECONDS), rcx(), profile=profile, sensors="ideal", seed=0
    )
    with ends.both_ends(ends.H8SIM) as both:
        flown = fly.fly(both, ends.H8SIM, wanted, pace=LOCKSTEP, telemetry_every=50, progress=lambda *_: None)
    alone = flight.fly(wanted)
    assert (flown.broke_off, flown.lost_frames) == (None, 0)
    assert np.any(alone.motors != 0)
    assert np.array_equal(flown.flight.motors, alone.motors)
