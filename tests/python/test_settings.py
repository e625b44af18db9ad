"""hal/wire/settings.toml is the only list of settings: a new row reaches firmware, wire and command line by itself."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import brickpilot
import pytest
from brickpilot import catalogue
from brickpilot.errors import InputError
from brickpilot.link.messages import book
from brickpilot.vehicle.settings import load, settings

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "hal/wire/settings.toml"
TOOLS = ROOT / "tools/brickpilot"

ROW = (
    'trial_time = {{ number = {}, field = "config.trial_ms", format = "time", low = 5, high = 500, '
    '{}meaning = "a trial" }}\n'
)

# Files that may name a setting, besides the table: each gives a setting its value.
NAMED = {
    "firmware/simulate.py",  # the cruise speed that scales the mission
    "firmware/robot.py",  # the rules by which the gains of another robot follow, and the cruise speed that they use
    "firmware/params_header.py",  # rest_speed, checks of pairs of gains, and the scale of the travel
    "vehicle/settings.py",  # defaults that follow from other values
    "gen/value_headers.py",  # settings that the reference controller in floating point lacks
    "link/brick.py",  # what a flight needs
    "public/flights.py",  # an argument of the same name
    "public/making.py",  # the cruise speed that the image has
    "tune/tuner.py",  # a scenario's cruise
    "tune/task.py",  # the gains that are tuned, and their ranges
    "vehicle/gains.py",  # pairs of gains: one may not exceed the other
    "vehicle/flight.py",  # a scenario's cruise
    "vehicle/compensation.py",  # the equations, and the gains in the damping ratio of the heading controller
    "constants.py",  # reads the value of a setting from the vehicle file
}


def test_the_dbc_has_the_names_and_numbers_of_the_table() -> None:
    numbers = {name: setting.number for name, setting in settings().items()}
    assert book().choices("PARAMETER_REQUEST", "parameter") == numbers
    assert load(TABLE) == settings()


def test_a_raw_value_stands_for_what_its_format_says() -> None:
    cruise = settings()["cruise"]
    assert (cruise.raw(0.4), cruise.value(6400), cruise.range) == (6400, 0.4, "1..32767")


def test_no_setting_is_typed_a_second_time_in_the_tools() -> None:
    of_the_plant = {info.name for info in catalogue.parameters()} | {effect.name for effect in catalogue.effects()}
    names = {name for one in settings().values() for name in (one.name, one.compensation)} - of_the_plant - {""}
    found = set()
    for path in TOOLS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and node.value in names:
                found.add(path.relative_to(TOOLS).as_posix())
    assert found <= NAMED


@pytest.mark.parametrize(
    ("of", "to", "says"),
    [
        ("number = 43", "number = 44", "settings.count_mismatch.number: 44 should be 43"),
        ('format = "time", low = 20', 'format = "hours", low = 20', "settings.silent_time.format: 'hours' is not one"),
        ("low = 20, high = 10000", "low = 20, high = 19", "settings.silent_time.high: 19 is outside 20.."),
        ("low = 20, high = 10000", "low = 20, high = 70000", "a field of 32 bits takes 1..2147483647"),
        ("low = -32000, high = 32000", "low = -32000, high = 40000", "a signed field has 16 bits"),
        ('meaning = "speed on a leg"', 'help = "speed on a leg"', "settings.cruise.help: unknown key"),
        (', meaning = "speed on a leg"', "", "settings.cruise.meaning: needs a text"),
    ],
)
def test_a_wrong_row_is_refused_with_its_line(tmp_path: Path, of: str, to: str, says: str) -> None:
    text = TABLE.read_text()
    line = text[: text.index(of)].count("\n") + 1
    path = tmp_path / "settings.toml"
    path.write_text(text.replace(of, to))
    with pytest.raises(InputError) as refused:
        load(path)
    assert str(refused.value).startswith(f"{path}:{line}: ")
    assert says in str(refused.value)


def run(root: Path, *command: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(root / "package"), "LC_ALL": "C"}
    return subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=300, check=False)


def append(root: Path, row: str) -> None:
    with (root / "hal/wire/settings.toml").open("a") as table:
        table.write(row)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Returns a copy of what a brick and its generated files need of the checkout."""
    for folder in ("firmware", "hal", "sim_host", "tests/numeric", "tests/unit/link"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / "tools").mkdir()
    for file in ("CMakeLists.txt", "tools/check_generated"):
        shutil.copy(ROOT / file, tmp_path / file)
    return tmp_path


def build(root: Path) -> subprocess.CompletedProcess[str]:
    options = ("-DBRICKPILOT_TESTS=OFF", "-DCMAKE_BUILD_TYPE=Debug")
    configured = run(root, "cmake", "-S", ".", "-B", "build", *options)
    assert configured.returncode == 0, configured.stdout + configured.stderr
    return run(root, "cmake", "--build", "build", "--target", "brick", "-j", "2")


@pytest.fixture
def brick(copy: Path) -> Iterator[str]:
    """Yields the link of a brick whose firmware has one more setting, which the package in `copy` also knows."""
    append(copy, ROW.format(len(settings()), "default = 0.25, "))
    made = run(copy, sys.executable, "-m", "brickpilot.gen")
    assert made.returncode == 0, made.stdout + made.stderr
    built = build(copy)
    assert built.returncode != 0
    assert "has no member named 'trial_ms'" in built.stderr + built.stdout, "the forgotten field is not named"

    header = copy / "firmware/app/loop.h"
    text = header.read_text()
    header.write_text(text.replace("\n} loop_config_t;", "\n    uint16_t trial_ms;\n} loop_config_t;"))
    assert header.read_text() != text
    built = build(copy)
    assert built.returncode == 0, built.stdout + built.stderr

    package = copy / "package/brickpilot"
    shutil.copytree(Path(brickpilot.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("settings.toml", "brickpilot.dbc"):
        shutil.copy(copy / "hal/wire" / name, package)
    process = subprocess.Popen([copy / "build/sim_host/brick", "--pty"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_new_row_reaches_firmware_wire_and_command_line(copy: Path, brick: str) -> None:
    command = (sys.executable, "-c", "from brickpilot.cli.main import main; main()")
    listed = run(copy, *command, "hil", "--link", brick, "--settings", "--json")
    assert listed.returncode == 0, listed.stderr
    assert json.loads(listed.stdout)["trial_time"] == 250

    def upload(value: int) -> subprocess.CompletedProcess[str]:
        return run(copy, *command, "upload", "--link", brick, "--set", f"trial_time={value}", "--json")

    done = upload(500)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["settings"] == {"trial_time": 500}
    for outside in (4, 501):
        refused = upload(outside)
        assert (refused.returncode, "trial_time" in refused.stderr) == (2, True), refused.stderr


def test_a_row_without_a_default_is_named(copy: Path) -> None:
    append(copy, ROW.format(len(settings()), ""))
    made = run(copy, sys.executable, "-m", "brickpilot.gen")
    assert made.returncode == 1
    assert made.stderr == (
        "hal/wire/settings.toml: trial_time: has no default, and [controller.coupled] of sim_host/models/rcx.toml has "
        "no value of that name\n"
    )


def test_a_row_stops_the_build_until_the_generator_has_run(copy: Path) -> None:
    append(copy, ROW.format(len(settings()), "default = 0.25, "))
    done = run(copy, "tools/check_generated")
    assert done.returncode == 1
    assert done.stderr.startswith("params_gen.h is older than hal/wire/settings.toml: run ")
