"""The inner loops of plant and firmware take as many instructions as tests/speed keeps, within its tolerance.

`run_gates` of tests/run builds the program whose instructions are counted.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from speed import counts

KEEP = "cmake --build --preset release --target speed_kernels && .venv/bin/python tests/speed/counts.py --write"


@pytest.fixture(scope="module")
def found() -> dict[str, float]:
    assert counts.PROGRAM.exists(), f"{counts.PROGRAM} is not built"
    assert shutil.which("valgrind"), "the counts need valgrind: sudo apt-get install valgrind"
    return counts.figures()


def test_inner_loops_take_as_many_instructions_as_were_kept(found: dict[str, float]) -> None:
    by, kept = counts.compiler(), counts.kept()
    if by not in kept:
        pytest.skip(f"no counts are kept of {by}, only of {', '.join(kept)}: {KEEP}")
    lines = counts.changed(found, kept[by])
    assert not lines, "\n".join([*lines, f"where the change is meant: {KEEP}"])


def test_parts_are_smaller_than_the_whole(found: dict[str, float]) -> None:
    whole, step, body, motor = (
        found[name]
        for name in (
            "full loop, a control step",
            "control step of the firmware",
            "body step of 10 motor steps",
            "motor step",
        )
    )
    assert step + body < whole
    assert counts.MOTOR_STEPS * motor < body


@pytest.mark.parametrize("share", [1.1, 0.9, 1.021])
def test_a_count_that_differs_by_more_than_the_tolerance_is_named(share: float) -> None:
    assert len(counts.changed({"a": 1000.0 * share, "b": 1000.0}, {"a": 1000.0, "b": 1000.0})) == 1
    assert not counts.changed({"a": 1019.0}, {"a": 1000.0})
    assert len(counts.changed({"a": 1.0}, {"b": 1.0})) == 2


def test_calls_and_libraries_do_not_count(tmp_path: Path) -> None:
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    out = tmp_path / "out"
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", counts.PROGRAM, "simulate_1"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    text = out.read_text()
    total = re.search(r"^(?:summary|totals): (\d+)", text, re.MULTILINE)
    assert total is not None
    every = {Path(path).name for path in re.findall(r"^c?ob=\(\d+\) (\S+)", text, re.MULTILINE)}
    assert len(every) >= 3  # the program, libc and libm
    assert sum(counts.own(text, name) for name in every) == int(total[1])
