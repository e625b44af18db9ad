"""A run without tests, or with only skipped tests, does not pass."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ONE_OF_THREE = """import pytest

def test_here():
    pass

@pytest.mark.parametrize("n", [1, 2])
def test_elsewhere(n):
    pytest.skip("not here")
"""


def run_pytest(folder: Path, *options: str) -> tuple[int, str]:
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "tools/pyproject.toml"), "--rootdir", str(ROOT)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "tests")}
    plugins = [word for name in ("conftest", "no:cacheprovider", "no:hypothesispytest") for word in ("-p", name)]
    done = subprocess.run(
        [*command, *plugins, str(folder), *options],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["alone", "under xdist"])
def test_skips_have_a_ceiling_and_are_no_tests(tmp_path: Path, workers: tuple[str, ...]) -> None:
    (tmp_path / "test_three.py").write_text(ONE_OF_THREE)
    if not workers:
        assert run_pytest(tmp_path)[0] == 0
    assert run_pytest(tmp_path, "--most-skips", "2", *workers)[0] == 0
    status, said = run_pytest(tmp_path, "--most-skips", "1", *workers)
    assert (status, "2 tests were skipped, and 1 are the most" in said) == (1, True), said
    status, said = run_pytest(tmp_path, "-k", "elsewhere", *workers)
    assert (status, "all 2 tests were skipped: nothing was tested" in said) == (1, True), said


def test_every_part_of_the_tests_has_a_ceiling() -> None:
    script = (ROOT / "tests/run").read_text()
    assert script.count("-m pytest") == script.count('-m pytest --most-skips "$(most_skips "$part")"') == 1


def test_ctest_without_a_test_fails() -> None:
    presets = json.loads((ROOT / "CMakePresets.json").read_text())["testPresets"]
    assert {one["name"]: one["execution"]["noTestsAction"] for one in presets} == dict.fromkeys(
        ("release", "debug", "sanitize", "coverage"), "error"
    )
    command = ["ctest", "--preset", "release", "-R", "no_such_test"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode != 0
