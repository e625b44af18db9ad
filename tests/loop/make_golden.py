"""Writes golden/motor_streams.txt: the SHA-256 of the motor commands with seed 0. Its commit explains each change."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import numpy as np
from brickpilot.constants import STEP_S
from brickpilot.vehicle import flight, flight_figures, scenario
from brickpilot.vehicle.model import rcx
from numpy.typing import NDArray

GOLDEN = Path(__file__).with_name("golden") / "motor_streams.txt"
FLIGHTS = (("coupled", "ideal"), ("coupled", "imu+encoders"), ("coupled", "imu"), ("paper", "ideal"))
STANDS_S = 2.0
"""Time, s, for which a cut flight goes on after the robot has ended its mission."""


def digest(motors: NDArray[np.int16]) -> str:
    """Returns the hex digest of the motor commands: one pair of little-endian numbers for each control step."""
    return hashlib.sha256(motors.astype("<i2").tobytes()).hexdigest()


def planned(profile: str, sensors: str) -> flight.Plan:
    mission = scenario.load(scenario.packaged()["mission"])
    return flight.plan(mission, rcx(), profile=profile, sensors=sensors, seed=0)


def cut(plan: flight.Plan, flown: flight.Flight) -> flight.Plan:
    """Returns the plan of `flown`, cut at `STANDS_S` after the mission's end, because the robot then only stands.

    Raises:
        ValueError: the robot moves after the mission's end, or does not end its mission.
    """
    ended = flight_figures.summary(flown)["ended_at_s"]
    if ended is None or flown.motors[round(ended / STEP_S) + 1 :].any():
        raise ValueError("the golden flight does not stand at its end")
    return dataclasses.replace(plan, steps=min(plan.steps, round((ended + STANDS_S) / STEP_S)))


def streams() -> dict[str, str]:
    """Returns "profile/sensors" -> digest of the whole flight."""
    return {
        f"{profile}/{sensors}": digest(flight.fly(planned(profile, sensors)).motors) for profile, sensors in FLIGHTS
    }


def golden() -> dict[str, str]:
    """Returns the digests of the file."""
    lines = GOLDEN.read_text(encoding="utf-8").splitlines()
    return dict(line.split() for line in lines if not line.startswith("#"))


if __name__ == "__main__":
    text = "# Motor commands of the mission, seed 0, SHA-256: tests/loop/make_golden.py\n"
    GOLDEN.parent.mkdir(exist_ok=True)
    GOLDEN.write_text(text + "".join(f"{name} {digest}\n" for name, digest in streams().items()), encoding="utf-8")
