"""A control step takes the stated instructions, processor states and stack on the RCX's processor."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from brickpilot.hil.rcx_flight import CLOCK_HZ
from command import brickpilot

ROOT = Path(__file__).resolve().parents[2]

# Largest share of the control period for the worst step of a brick's program; the rest is for drivers, interrupts and
# kernel. The main task has a stack of 344 bytes; tests/rcx measured up to 130 bytes for interrupts.
SHARE = 0.6
STACK = 344 - 130

# (target, profile, sensors) -> figures of the worst step. The brick's programs, `h8:...`, fly the whole mission; `h8`
# flies its first 8 s. If a figure changes by more than TOLERANCE, correct it here and in firmware/README.md.
TOLERANCE = 0.02
MEASURED = {
    ("h8", "coupled", "imu+encoders"): {"instructions": 10849, "states_external": 110370, "states_on_chip": 42544},
    ("h8", "paper", "imu+encoders"): {"instructions": 12204, "states_external": 121190, "states_on_chip": 46814},
    ("h8:imu", "coupled", "imu"): {"instructions": 8237, "states_external": 84773, "states_on_chip": 33090},
    ("h8:rotation", "coupled", "imu+encoders"): {
        "instructions": 8310,
        "states_external": 85872,
        "states_on_chip": 33466,
    },
}

# Stage -> processor states with the program in external RAM, for the last row of MEASURED.
STAGES = {
    "model": 17232,
    "heading": 7861,
    "speed": 10534,
    "pose": 5620,
    "guidance": 23646,
    "control": 11000,
    "mixer": 8576,
    "telemetry": 965,
    "rest": 7041,
}


# Shares of the processor's time in the first 8 s of the mission under brickOS, as in the table of hal/rcx/README.md. If
# a figure changes by more than SHARE_TOLERANCE, correct it here and in the README.
SHARE_TOLERANCE = 0.015
KERNEL = {
    "h8:imu": {"program": 0.51, "kernel": 0.057, "subsystems": 0.074, "converter": 0.216, "idle": 0.098},
    "h8:rotation": {"program": 0.506, "kernel": 0.056, "subsystems": 0.072, "converter": 0.253, "idle": 0.068},
}
P99_MS = 11.0


def bench(target: str, profile: str, sensors: str) -> dict[str, Any]:
    duration = () if ":" in target else ("--seconds", "8")
    options = ("--target", target, "--profile", profile, "--sensors", sensors, *duration, "--json")
    found: dict[str, Any] = json.loads(brickpilot("bench", *options, cwd=ROOT, fresh=True).stdout)
    return found


def step_ms(sensors: str) -> int:
    flags = (ROOT / "firmware/targets/rcx/flags").read_text()
    named = re.search(rf"^{sensors}\).*-DSTEP_MS=(\d+)", flags, re.MULTILINE)
    assert named is not None
    return int(named[1])


def is_as_measured(found: float, measured: float) -> bool:
    return abs(found - measured) <= TOLERANCE * measured


@pytest.mark.parametrize(("target", "profile", "sensors"), MEASURED)
def test_a_step_is_done_in_time_and_takes_what_the_documents_say(target: str, profile: str, sensors: str) -> None:
    found = bench(target, profile, sensors)
    most = {name: counts["most"] for name, counts in found["stages"]["step"].items()}
    for name, measured in MEASURED[target, profile, sensors].items():
        assert is_as_measured(most[name], measured), f"{name}: {most[name]}, measured {measured}"
    if target == "h8:rotation":
        for name, measured in STAGES.items():
            stage = found["stages"][name]["states_external"]["most"]
            assert is_as_measured(stage, measured), f"{name}: {stage}, measured {measured}"
    if target in KERNEL:
        kernel = found["kernel"]
        assert sum(share["share"] for share in kernel["shares"].values()) == pytest.approx(1.0)
        for name, measured in KERNEL[target].items():
            assert kernel["shares"][name]["share"] == pytest.approx(measured, abs=SHARE_TOLERANCE), name
        assert kernel["tick_ms"]["p99"] <= P99_MS
    _, _, built_for = target.partition(":")
    if built_for:
        assert found["stack_bytes"] <= STACK
        assert most["states_external"] <= SHARE * step_ms(built_for) * 1e-3 * CLOCK_HZ
