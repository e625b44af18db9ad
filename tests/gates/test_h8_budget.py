"""Instructions, states and stack of a control step on the RCX's processor: no more than they were."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import brickpilot

ROOT = Path(__file__).resolve().parents[2]

# Most of any step in 8 s of the mission, `imu+encoders`: a start, two turns and a leg. The goal is 24,000 states, half
# of 3 ms. When a figure falls, its limit falls with it.
LIMITS = {
    "coupled": {"instructions": 9900, "states_external": 100000, "states_on_chip": 37800},
    "paper": {"instructions": 12600, "states_external": 124500, "states_on_chip": 47300},
}
STACK = 360


@pytest.mark.parametrize("profile", LIMITS)
def test_a_step_takes_no_longer_on_the_rcx_than_it_did(profile: str) -> None:
    done = brickpilot("bench", "--target", "h8", "--profile", profile, "--seconds", "8", "--json", cwd=ROOT)
    found = json.loads(done.stdout)
    most = {name: counts["most"] for name, counts in found["stages"]["step"].items()}
    for name, limit in LIMITS[profile].items():
        assert 0.95 * limit < most[name] <= limit, f"{name}: {most[name]}, limit {limit}"
    assert found["stack_bytes"] <= STACK
