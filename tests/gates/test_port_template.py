"""hal/template builds, fails the contract suite with a line for each function, and its README's recipe makes a port."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/release/tests"
FUNCTIONS = re.findall(r"^\w+ (hal_\w+)\(", (ROOT / "hal/include/hal.h").read_text(), re.MULTILINE)


def not_done(output: str) -> list[str]:
    """Functions that the suite names, each on a line of its own."""
    return re.findall(r"^(hal_\w+): not done yet: \S.*$", output, re.MULTILINE)


def test_the_header_names_every_function_once() -> None:
    assert len(FUNCTIONS) == len(set(FUNCTIONS)) >= 8


def test_the_template_fails_with_a_line_for_each_function() -> None:
    program = BUILD / "contract_template"
    assert program.is_file(), "not built: cmake --preset release && cmake --build --preset release"
    done = subprocess.run([program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode > 0, "the suite passes a port that does nothing, or the template crashes"
    assert not_done(done.stdout) == FUNCTIONS
    results = re.findall(r":(test_\w+):(\w+)(?::(.*))?$", done.stdout, re.MULTILINE)
    assert len(results) >= 9
    for test, result, why in results:
        assert result == "FAIL", f"{test}: {result} of a port that does nothing"
        assert not_done(why), f"{test} fails without a function's name: {why}"


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The checkout without its history, and with the test framework that its build has fetched."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for name in listed:
        if not name.startswith(("tools/brickpilot/", "tests/python/", "tests/fuzz/")) and (ROOT / name).is_file():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(BUILD / "unity", tmp_path / "build/release/tests/unity")
    return tmp_path


def test_the_recipe_makes_a_port_that_names_what_is_left(copy: Path) -> None:
    readme = (ROOT / "hal/template/README.md").read_text()
    (recipe,) = re.findall(r"^```sh\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    *commands, run = recipe.splitlines()
    subprocess.run(["sh", "-ec", "\n".join(commands)], cwd=copy, check=True, stdout=subprocess.DEVNULL)
    done = subprocess.run(run, cwd=copy, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode > 0
    assert not_done(done.stdout) == FUNCTIONS

    port = copy / "hal/mybrick/mybrick.c"
    text = port.read_text()
    driver = text.replace('NOT_DONE("set the duty of both motors");', "")
    assert driver != text
    port.write_text(driver)
    subprocess.run(commands[-1].split(), cwd=copy, check=True, stdout=subprocess.DEVNULL)
    done = subprocess.run(run, cwd=copy, capture_output=True, text=True, timeout=60, check=False)
    assert not_done(done.stdout) == [name for name in FUNCTIONS if name != "hal_motors_write"]

    port.write_text(re.sub(r"^void hal_motors_write.*?^}\n", "", text, flags=re.MULTILINE | re.DOTALL))
    built = subprocess.run(commands[-1].split(), cwd=copy, capture_output=True, text=True, check=False)
    assert built.returncode != 0
    assert "undefined reference to `hal_motors_write'" in built.stdout + built.stderr


def test_the_recipe_makes_a_main_program_for_this_machine_and_for_another_chip(tmp_path: Path) -> None:
    for folder in ("firmware", "hal", "tests/contract", "sim_host/models", "tests/numeric"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools/check_generated", tmp_path / "tools")
    readme = (ROOT / "hal/template/README.md").read_text()
    (recipe,) = re.findall(r"^```sh\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    copies = [line for line in recipe.splitlines() if not re.match(r"cmake|build/", line)]
    here, there = re.findall(r"^```shell\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)

    def run(script: str) -> list[str]:
        done = subprocess.run(["sh", "-ec", script], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout.splitlines()

    told = run("\n".join(copies) + "\n" + here)
    said = {line.partition(":")[0] for line in told if ": not done yet: " in line}
    assert said == {*FUNCTIONS, "wait_for_tick"}

    sizes = {line.split()[0]: [int(one) for one in line.split()[1:]] for line in run(there)[1:]}
    assert sum(sizes["firmware_targets_mybrick_main.o"][1:]) < 720  # what the README says of RAM
    assert 12_000 < sizes["brickpilot"][0] < 20_480  # and of flash
