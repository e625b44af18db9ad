"""Every build stops if a generated file is older than its input, and one line says which command to run."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from brickpilot.gen.__main__ import generate

ROOT = Path(__file__).resolve().parents[2]
RUN = "run .venv/bin/python -m brickpilot.gen"
VEHICLE = "sim_host/models/rcx.toml"
FOLDERS = ("firmware", "hal", "sim_host", "tests")


def generated(root: Path) -> set[Path]:
    return {path for folder in FOLDERS for path in (root / folder).rglob("*_gen.[ch]")}


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Returns a copy of the files that a build of the firmware and the simulator needs."""
    for folder in ("firmware", "hal", "sim_host"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for file in ("CMakeLists.txt", "tools/check_generated"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    return tmp_path


def run(root: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=300, check=False)


def change(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"# another value\n")


def check(root: Path) -> tuple[int, str]:
    done = run(root, "tools/check_generated")
    assert done.stdout == ""
    return done.returncode, done.stderr


def test_the_checkout_is_fresh() -> None:
    assert check(ROOT) == (0, "")


def test_every_generated_file_comes_from_the_generator() -> None:
    assert generated(ROOT) == {path for path in generate(ROOT) if path.suffix != ".dbc"}


@pytest.mark.parametrize(
    ("changed", "first"),
    [
        (VEHICLE, "params_gen.h"),
        ("hal/wire/brickpilot.dbc", "codecs_gen.c"),
        ("hal/wire/settings.toml", "params_gen.h"),
    ],
)
def test_a_changed_input_is_named(copy: Path, changed: str, first: str) -> None:
    assert check(copy) == (0, "")
    change(copy / changed)
    assert check(copy) == (1, f"{first} is older than {changed}: {RUN}\n")


def test_line_endings_do_not_count(copy: Path) -> None:
    for path in (copy / VEHICLE, copy / "firmware/app/params_gen.h"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert check(copy) == (0, "")


def test_a_file_without_its_input_is_named(copy: Path) -> None:
    (copy / VEHICLE).unlink()
    assert check(copy) == (1, f"params_gen.h was made from {VEHICLE}, which is not there: {RUN}\n")
    (copy / "firmware/app/params_gen.h").write_text("/* by hand */\n")
    assert check(copy) == (1, f"params_gen.h does not say what it was made from: {RUN}\n")


def test_a_changed_input_stops_cmake_at_the_build_and_at_the_next_configuration(copy: Path) -> None:
    line = f"params_gen.h is older than {VEHICLE}: {RUN}"
    configure = ("cmake", "-S", ".", "-B", "build", "-DBRICKPILOT_TESTS=OFF")
    build = ("cmake", "--build", "build", "--target", "hal_sil")
    assert run(copy, *configure).returncode == 0
    assert run(copy, *build).returncode == 0
    change(copy / VEHICLE)
    for command in (build, ("cmake", "--build", "build", "--target", "plant"), configure):
        done = run(copy, *command)
        assert done.returncode != 0, command
        assert (done.stdout + done.stderr).splitlines().count(line) == 1, done.stdout + done.stderr
    assert not list(copy.glob("build/sim_host/**/*.o")), "the plant was compiled with old values"


@pytest.mark.parametrize("script", ["firmware/targets/rcx/build", "firmware/targets/h8sim/build"])
def test_a_changed_input_stops_the_builds_for_the_rcx(copy: Path, tmp_path: Path, script: str) -> None:
    change(copy / VEHICLE)
    done = run(copy, script, str(tmp_path / "out"))
    assert done.returncode == 1
    assert done.stderr == f"params_gen.h is older than {VEHICLE}: {RUN}\n"
    assert not list(copy.glob("out/**/*.o"))
