"""Instructions, states and stack of a control step on the RCX's processor: no more than they were."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from brickpilot.benchmark import h8_states
from command import brickpilot

ROOT = Path(__file__).resolve().parents[2]

# Most of any step in 8 s of the mission: a start, two turns and a leg. The goal is 24,000 states, half of 3 ms. When a
# figure falls, its limit falls with it. (target, profile, sensors) -> limits.
LIMITS = {
    ("h8", "coupled", "imu+encoders"): {"instructions": 7490, "states_external": 75200, "states_on_chip": 29400},
    ("h8", "paper", "imu+encoders"): {"instructions": 10070, "states_external": 99600, "states_on_chip": 38800},
    ("h8:imu", "coupled", "imu"): {"instructions": 6890, "states_external": 68500, "states_on_chip": 26900},
    ("h8:rotation", "coupled", "imu+encoders"): {
        "instructions": 6960,
        "states_external": 69500,
        "states_on_chip": 27300,
    },
}
STACK = 240

# The same by stage, states in external RAM, of the last of these.
STAGES = {
    "model": 17400,
    "heading": 6320,
    "speed": 8360,
    "pose": 3970,
    "guidance": 17500,
    "control": 7830,
    "mixer": 5770,
    "telemetry": 3240,
    "rest": 4360,
}


def bench(target: str, profile: str, sensors: str) -> dict[str, Any]:
    options = ("--target", target, "--profile", profile, "--sensors", sensors, "--seconds", "8", "--json")
    found: dict[str, Any] = json.loads(brickpilot("bench", *options, cwd=ROOT, fresh=True).stdout)
    return found


def step_ms(sensors: str) -> int:
    flags = (ROOT / "firmware/targets/rcx/flags").read_text()
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
        assert most["states_external"] <= 2 / 3 * step_ms(built_for) * 1e-3 * h8_states.CLOCK_HZ
