"""Writes golden/motor_streams.txt: the SHA-256 of the motor commands with seed 0. A commit explains each change."""

from __future__ import annotations

import hashlib
from pathlib import Path

from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx

GOLDEN = Path(__file__).with_name("golden") / "motor_streams.txt"
FLIGHTS = (("coupled", "ideal"), ("coupled", "imu+encoders"), ("coupled", "imu"), ("paper", "ideal"))


def streams() -> dict[str, str]:
    """Returns "profile/sensors" -> hex digest of the little-endian pairs of every control step."""
    mission = scenario.load(scenario.packaged()["mission"])
    found = {}
    for profile, sensors in FLIGHTS:
        flown = flight.fly(flight.plan(mission, rcx(), profile=profile, sensors=sensors, seed=0))
        found[f"{profile}/{sensors}"] = hashlib.sha256(flown.motors.astype("<i2").tobytes()).hexdigest()
    return found


def golden() -> dict[str, str]:
    """Returns the digests of the file."""
    lines = GOLDEN.read_text(encoding="utf-8").splitlines()
    return dict(line.split() for line in lines if not line.startswith("#"))


if __name__ == "__main__":
    text = "# Motor commands of the mission, seed 0, SHA-256: tests/loop/make_golden.py\n"
    GOLDEN.parent.mkdir(exist_ok=True)
    GOLDEN.write_text(text + "".join(f"{name} {digest}\n" for name, digest in streams().items()), encoding="utf-8")
