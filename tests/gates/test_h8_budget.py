"""Instructions, states and stack of a control step on the RCX's processor: no more than they were."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from brickpilot.h8 import states
from command import brickpilot

ROOT = Path(__file__).resolve().parents[2]

# Most of any step in 8 s of the mission: a start, two turns and a leg. The goal is 24,000 states, half of 3 ms. When a
# figure falls, its limit falls with it. (target, profile, sensors) -> limits.
LIMITS = {
    ("h8", "coupled", "imu+encoders"): {"instructions": 8550, "states_external": 85000, "states_on_chip": 32800},
    ("h8", "paper", "imu+encoders"): {"instructions": 11200, "states_external": 109600, "states_on_chip": 42300},
    ("h8:imu", "coupled", "imu"): {"instructions": 7930, "states_external": 79700, "states_on_chip": 30800},
    ("h8:rotation", "coupled", "imu+encoders"): {
        "instructions": 8000,
        "states_external": 80700,
        "states_on_chip": 31200,
    },
}
STACK = 240

# The same by stage, states in external RAM, of the last of these.
STAGES = {
    "model": 17450,
    "heading": 6650,
    "speed": 8370,
    "pose": 3980,
    "guidance": 24400,
    "control": 10300,
    "mixer": 8100,
    "telemetry": 3250,
    "rest": 7450,
}


def bench(target: str, profile: str, sensors: str) -> dict[str, Any]:
    options = ("--target", target, "--profile", profile, "--sensors", sensors, "--seconds", "8", "--json")
    found: dict[str, Any] = json.loads(brickpilot("bench", *options, cwd=ROOT).stdout)
    return found


def step_ms(sensors: str) -> int:
    flags = (ROOT / "hal/rcx/flags").read_text()
    named = re.search(rf"^{sensors}\).*-DSTEP_MS=(\d+)", flags, re.MULTILINE)
    assert named is not None
    return int(named[1])


@pytest.mark.parametrize(("target", "profile", "sensors"), LIMITS)
def test_a_step_takes_no_longer_on_the_rcx_than_it_did(target: str, profile: str, sensors: str) -> None:
    found = bench(target, profile, sensors)
    most = {name: counts["most"] for name, counts in found["stages"]["step"].items()}
    for name, limit in LIMITS[target, profile, sensors].items():
        assert 0.95 * limit < most[name] <= limit, f"{name}: {most[name]}, limit {limit}"
    assert found["stack_bytes"] <= STACK
    if target == "h8:rotation":
        for name, limit in STAGES.items():
            stage = found["stages"][name]["states_external"]["most"]
            assert 0.95 * limit < stage <= limit, f"{name}: {stage}, limit {limit}"
    _, _, built_for = target.partition(":")
    if built_for:  # a third of its time is the drivers', the interrupts' and the kernel's
        assert most["states_external"] <= 2 / 3 * step_ms(built_for) * 1e-3 * states.CLOCK_HZ
