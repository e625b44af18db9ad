"""hal/template builds, fails the contract suite with a line for each function, and its README's recipe makes a port."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/release/tests"
UNITY = ROOT / "build/unity"
FUNCTIONS = re.findall(r"^\w+ (hal_\w+)\(", (ROOT / "hal/include/hal.h").read_text(), re.MULTILINE)


def not_done(output: str) -> list[str]:
    """Returns the functions that the suite names, each on its own line."""
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
    """Returns a copy of the checkout without history and Python package, with the test framework from its build."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for name in listed:
        if not name.startswith(("tools/brickpilot/", "tests/python/", "tests/fuzz/")) and (ROOT / name).is_file():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(UNITY, tmp_path / "build/unity")
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
    assert sum(sizes["firmware_targets_mybrick_main.o"][1:]) < 960  # limit of RAM in the README, bytes
    assert 12_000 < sizes["brickpilot"][0] < 24_576  # limit of flash in the README, bytes


def test_the_recipe_leads_to_a_port_without_marks_whose_contract_holds(copy: Path) -> None:
    """Runs steps 1 to 3 of the README word for word, with the drivers of hal/sil and the devices of port_sil.c."""
    readme = (ROOT / "hal/template/README.md").read_text()
    first, main, last = (
        re.search(rf"^```{kind}\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)[1]  # type: ignore[index]
        for kind in ("sh", "shell", "bash")
    )

    def run(script: str) -> str:
        done = subprocess.run(["sh", "-ec", script], cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("".join(first.splitlines(keepends=True)[:6]))  # copies and renames, and adds the port to hal/CMakeLists.txt
    port, world = copy / "hal/mybrick/mybrick.c", copy / "tests/contract/port_mybrick.c"
    marks = world.read_text().partition("/* Put all devices")[0]
    shutil.copy(ROOT / "hal/sil/sil.h", copy / "hal/mybrick/sil.h")
    port.write_text(
        '#include "mybrick/not_done.h"\n' + (ROOT / "hal/sil/sil.c").read_text().replace("sil/", "mybrick/")
    )
    bound = "    sil_bind(&port);\n}"
    drivers = (ROOT / "tests/contract/port_sil.c").read_text().replace("sil/", "mybrick/")
    assert drivers.count(bound) == 1
    world.write_text(marks + drivers.replace(bound, bound.replace("}", "    list_what_is_not_done();\n}")))
    copies, build = main.splitlines()[:2], main.splitlines()[2]
    assert build.startswith("firmware/targets/mybrick/build")
    run("\n".join(copies))
    program = copy / "firmware/targets/mybrick/main.c"
    text, count = re.subn(r"    NOT_DONE\(.*\);\n", "", program.read_text())
    assert count == 1
    program.write_text(text)
    run("cmake --preset release\n" + last)
    assert run("build/release/tests/contract_mybrick").count(":PASS") == 9
    left = run(
        "grep -rlE 'NOT_DONE|not_done' hal/mybrick firmware/targets/mybrick tests/contract/port_mybrick.c || true"
    )
    assert left == ""


@pytest.mark.parametrize(
    ("of", "to", "rule"),
    [
        (
            "*out = bound->rotation;",
            "out->left = 0;",
            "a read gives the newest value, in the unit and the range of hal.h",
        ),
        ("return bound->rotation_status;", "return HAL_OK;", "without a new value a read returns HAL_STALE and leaves"),
        (
            "    return bound->imu_status;",
            "    hal_status_t was = bound->imu_status;\n    bound->imu_status = HAL_STALE;\n    return was;",
            "a second read in the same step gives the same value again",
        ),
        (
            "bound->left_q15 = left_q15;",
            "bound->left_q15 = right_q15;",
            "a duty, -32767..32767 for -1..1, acts at once",
        ),
        (
            "SIL_LINK_SIZE)\n        return false;",
            "SIL_LINK_SIZE)\n        return true;",
            "returns false where there is no",
        ),
        ("bound->link_out_size == SIL_LINK_SIZE", "bound->link_out_size == 7", "has room for eight messages in a step"),
        ("*message = bound->link_in[0];", "*message = bound->link_in[1];", "messages come whole, in order and once"),
        ("return bound->clock_ms;", "return bound->clock_ms / 2;", "the clock counts milliseconds and never goes back"),
    ],
)
def test_a_failure_names_the_rule_that_is_broken(tmp_path: Path, of: str, to: str, rule: str) -> None:
    text = (ROOT / "hal/sil/sil.c").read_text()
    assert of in text
    (tmp_path / "sil.c").write_text(text.replace(of, to, 1))
    (unity,) = UNITY.rglob("unity.c")
    folders = (unity.parent, ROOT / "hal", ROOT / "hal/include", ROOT / "tests/contract")
    sources = (tmp_path / "sil.c", ROOT / "tests/contract/hal_contract.c", ROOT / "tests/contract/port_sil.c", unity)
    program = tmp_path / "contract"
    subprocess.run(["cc", *(f"-I{folder}" for folder in folders), *sources, "-o", program], check=True)
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode > 0
    broken = re.findall(r":FAIL: .* Broken rule: (.*)$", done.stdout, re.MULTILINE)
    assert broken, done.stdout
    assert any(rule in line for line in broken), broken
    assert len(broken) == done.stdout.count(":FAIL")
