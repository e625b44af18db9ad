"""Size of the firmware on the RCX, and instructions of one control step: no more than they were."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# The goal is 12 KB with the HAL's port, and a step of half of 3 ms. When a figure falls, its limit falls with it.
LIMITS = {
    "-DBODY_WITHOUT_PAPER": {"bytes": 20400, "step": 17100, "telemetry": 2600},
    "-DBODY_WITHOUT_COUPLED": {"bytes": 21100, "step": 20900, "telemetry": 2600},
}


@pytest.mark.parametrize("profile", LIMITS)
def test_the_firmware_grows_neither_larger_nor_slower_on_the_rcx(profile: str) -> None:
    done = subprocess.run([ROOT / "hal/h8sim/count", profile], stdout=subprocess.PIPE, text=True, check=True)
    found = {name: int(count) for name, count in re.findall(r"^(\w+) +(\d+) instructions$", done.stdout, re.MULTILINE)}
    whole = re.search(r"^firmware and messages +(\d+) bytes$", done.stdout, re.MULTILINE)
    assert whole is not None
    found["bytes"] = int(whole[1])
    for name, most in LIMITS[profile].items():
        assert 0.9 * most < found[name] <= most, f"{name}: {found[name]}, limit {most}"
