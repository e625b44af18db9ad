"""The same seed gives the same bytes at -O3 and at -O0. tests/run builds both programs before this test."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def trace(preset: str) -> list[str]:
    program = ROOT / "build" / preset / "tests" / "loop_trace"
    assert program.is_file(), f"not built: cmake --preset {preset} && cmake --build --preset {preset}"
    return subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines()


def test_optimised_and_unoptimised_builds_fly_the_same_bytes() -> None:
    release = trace("release")
    assert len(release) == 5
    assert release == trace("debug")
