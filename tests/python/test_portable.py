"""`run`, `compare` and `discover` need no module that only Unix has, and no library of a link."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

UNIX_ONLY = ("termios", "fcntl", "pty", "tty", "resource", "pwd", "grp")
OF_A_LINK = ("can", "cantools", "cobs", "intelhex", "msgpack", "serial")

# Names of the module os that neither Windows nor macOS has.
LINUX_ONLY = ("sched_setscheduler", "sched_param", "SCHED_FIFO", "sched_getaffinity")

BLOCK = f"""
import os, sys
for name in {UNIX_ONLY + OF_A_LINK!r}:
    sys.modules[name] = None
for name in {LINUX_ONLY!r}:
    if hasattr(os, name):
        delattr(os, name)
"""

IMPORT_ALL = """
import importlib, pkgutil
rooms = ("data", "importers", "vehicle", "fit", "discover", "report", "cli")
count = 0
for room in rooms:
    package = importlib.import_module("brickpilot." + room)
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if module.name != "brickpilot.importers.rcx":  # it reads from a brick
            importlib.import_module(module.name)
            count += 1
import brickpilot
for name in brickpilot.__all__:
    getattr(brickpilot, name)
print(count)
"""


def python(code: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BLOCK + code], cwd=cwd, capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.parametrize(("platform", "ending"), [("linux", "so"), ("win32", "dll"), ("darwin", "dylib")])
def test_the_compiled_plant_has_the_ending_of_its_system(platform: str, ending: str, tmp_path: Path) -> None:
    program = f"""
import sys
from unittest import mock
from brickpilot import compiled
with mock.patch.object(sys, "platform", {platform!r}), mock.patch.object(compiled.FFI, "dlopen") as opened:
    compiled.interface()
print(opened.call_args.args[0])
"""
    done = python(program, tmp_path)
    assert Path(done.stdout.strip()).name == f"libbrickpilot_sim.{ending}", done.stderr


def test_a_console_without_greek_letters_gets_a_question_mark(tmp_path: Path) -> None:
    """A pipe on Windows has a code page of 256 characters, without Ω: a question mark replaces this sign."""
    program = "import sys; sys.stdout.reconfigure(encoding='cp1252')\n" + (
        "from brickpilot.cli import main\n"
        "@main.cli.command()\n"
        "def unit():\n"
        "    main.click.echo('22 \\N{GREEK CAPITAL LETTER OMEGA}')\n"
        "main.main(['unit'])"
    )
    done = python(program, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "22 ?\n", "")


def test_every_room_but_those_of_a_link_is_imported_without_them(tmp_path: Path) -> None:
    done = python(IMPORT_ALL, tmp_path)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100


def test_a_mission_is_flown_without_them(tmp_path: Path) -> None:
    done = python("from brickpilot.cli.main import main; main(['run', '--json'])", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert '"waypoints_reached": 8' in done.stdout


@pytest.mark.parametrize(
    "command",
    [
        ["flash", "avr", "x.hex"],
        ["hil", "--link", "tcp"],
        ["upload", "--link", "tcp:127.0.0.1:1"],
        ["import", "rcx", "tty", "--out", "x"],
    ],
)
def test_a_link_without_its_libraries_is_refused_in_one_line(command: list[str], tmp_path: Path) -> None:
    done = python(f"from brickpilot.cli.main import main; main({command!r})", tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert "pip install 'brickpilot[hil]'" in done.stderr
