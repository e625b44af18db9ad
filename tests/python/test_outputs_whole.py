"""Each command leaves its output whole or absent: if killed, on a full disk, without permission, or run twice at once.

`COMMANDS` has a row for each command. The short form kills only the commands in `OF_EACH_KIND`, at 3 moments; `--full`
kills each command at 100 random moments and fills its disk at 20 random sizes. A campaign keeps its finished runs
instead, and has tests of its own (`test_campaign_killed.py`, `test_full_disk.py`).
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import time
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from brickpilot.vehicle import model
from command import PROGRAM, Copy
from findings import measured
from new_users_logs import STRAIGHT, write_log
from test_campaign import SHORT

PLACE = Path("place")
OUT = str(PLACE / "made")
"""The output of a row, in a folder of its own; a row may append the ending of a file's name."""


@dataclass(frozen=True)
class Command:
    """A command: its words, a size in bytes below its largest file's, and its file's ending; "": it writes a folder."""

    words: tuple[str, ...]
    bytes: int
    ending: str = ""

    @property
    def out(self) -> Path:
        return Path(f"{OUT}{self.ending}")


def row(words: str, size: int, ending: str = "") -> Command:
    return Command((*words.split(), "--out", f"{OUT}{ending}"), size, ending)


COMMANDS = {
    "run": row("run short.toml", 400_000),
    "hil": row("hil short.toml --link tcp", 400_000),
    "import": row("import log.csv --guess", 16_000),
    "why": row("why log.csv --budget 1", 150_000),
    "compare": row("compare set", 130_000),
    "calibrate": row("calibrate set", 170_000),
    "discover": row("discover set --budget 1", 180_000),
    "tune": row("tune --model model.toml --scenario short.toml --robots 4 --judges 20 --budget 2", 150_000),
    "firmware": row("firmware --model model.toml --board template", 8_000_000),
    "export mjcf": row("export mjcf", 3_000, ".xml"),
    "export urdf": row("export urdf", 2_500, ".urdf"),
    "export fmu": row("export fmu", 180_000, ".fmu"),
    "export mcap": row("export mcap flown", 300_000, ".mcap"),
    "export parquet": row("export parquet flown", 240_000, ".parquet"),
}
COMPILES = {"tune", "firmware", "export fmu"}
MAGIC = {".parquet": b"PAR1", ".mcap": b"\x89MCAP0\r\n"}
"""Ending of the name -> last bytes of a complete file."""

OF_EACH_KIND = {"run", "import", "export mcap"}
"""Commands that the short form kills, and runs twice at once. They write a folder, a data set, and files."""

each = pytest.mark.parametrize("name", COMMANDS)
of_each_kind = pytest.mark.parametrize(
    "name", [pytest.param(one, marks=() if one in OF_EACH_KIND else pytest.mark.campaign) for one in COMMANDS]
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the inputs of the rows."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / PLACE).mkdir()
    (folder / "short.toml").write_text(SHORT)
    write_log(folder / "log.csv", "planar", STRAIGHT, {})
    measured(folder / "set")
    model.save(model.rcx(), folder / "model.toml")
    Begun("run", "short.toml", "--out", "flown", cwd=folder).ended()
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


class Begun(Copy):
    """A command in a process group of its own; its files may have `room` bytes at most."""

    def __init__(self, *words: str, cwd: Path, room: int | None = None) -> None:
        self._said, err = os.pipe()  # unlike a file, a pipe has no limit of size
        with open(os.devnull, "w") as nowhere:
            super().__init__([str(PROGRAM), *words], cwd, nowhere.fileno(), err, room=room, in_group=True)
        os.close(err)

    def ended(self) -> tuple[int, list[str]]:
        """Returns the exit status, and the lines that begin with the program's name; fails on a traceback."""
        with os.fdopen(self._said) as pipe:
            said = pipe.read()
        assert "Traceback" not in said, said
        return self.wait(300), [line for line in said.splitlines() if line.startswith("brickpilot: ")]


@cache
def whole(name: str, folder: Path) -> tuple[frozenset[str], float]:
    """Runs a command undisturbed. Returns its files and its time (s)."""
    began = time.monotonic()
    assert Begun(*COMMANDS[name].words, cwd=folder).ended() == (0, []), name
    seconds, place = time.monotonic() - began, folder / PLACE
    found = files(place), seconds
    assert max(one.stat().st_size for one in place.rglob("*") if one.is_file()) > COMMANDS[name].bytes
    emptied(place)
    return found


def emptied(place: Path) -> None:
    """Removes the visible files and folders of a folder, and leaves the hidden ones."""
    for path in place.iterdir():
        if not path.name.startswith("."):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def files(place: Path) -> frozenset[str]:
    return frozenset(str(one.relative_to(place)) for one in place.rglob("*") if one.is_file())


def assert_whole_or_absent(name: str, folder: Path, expected: frozenset[str]) -> bool:
    """Returns whether the output exists. If so, a folder has all its files, and each file is complete.

    A hidden file is no output: the next run of the same name removes it.
    """
    place = folder / PLACE
    there = frozenset(one for one in files(place) if not one.startswith("."))
    if there and not COMMANDS[name].ending:
        assert there == expected
    assert there <= expected
    for path in map(place.joinpath, there):
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix in {".html", ".xml", ".urdf"}:
            assert path.read_text().rstrip().endswith(("</html>", "</mujoco>", "</robot>")), path
        elif path.suffix in MAGIC:
            assert path.read_bytes().endswith(MAGIC[path.suffix]), path
        elif path.suffix == ".fmu":
            assert zipfile.is_zipfile(path)
    return bool(there)


@of_each_kind
def test_a_killed_command_leaves_its_output_whole_or_absent_and_the_next_one_cleans_up(
    name: str, made: Path, folder: Path, full: bool
) -> None:
    draw, (expected, seconds) = random.Random(name), whole(name, made)
    for _ in range(100 if full else 3):
        # A command writes near its end: the short form kills it only there.
        moment = draw.uniform(0.0 if full else 0.7, 1.1) * seconds
        process = Begun(*COMMANDS[name].words, cwd=folder)
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
        process.ended()
        assert_whole_or_absent(name, folder, expected)
        emptied(folder / PLACE)
    (folder / PLACE / f".{COMMANDS[name].out.name}-unfinished-left").touch()  # as if killed while writing
    assert Begun(*COMMANDS[name].words, cwd=folder).ended()[0] == 0
    assert files(folder / PLACE) == expected


@each
def test_on_a_full_disk_nothing_is_left_and_one_line_names_the_output(name: str, folder: Path, full: bool) -> None:
    draw, command, before = random.Random(name), COMMANDS[name], {*folder.rglob("*")}
    for _ in range(20 if full else 1):
        room = draw.randrange(command.bytes)
        status, said = Begun(*command.words, cwd=folder, room=room).ended()
        assert (status, len(said)) == (1, 1), (room, said)
        if said[0] != f"brickpilot: {command.out}: File too large; nothing of it is written":
            # A compiler runs out of room in its temporary folder, so the line names the compiler.
            assert name in COMPILES, said
            assert "compil" in said[0], said
        assert {*folder.rglob("*")} == before


@each
def test_where_nothing_may_be_written_one_line_says_so(name: str, folder: Path) -> None:
    """Root may write into any ordinary folder, so for root the output goes into a folder of /proc."""
    (folder / PLACE).rmdir()
    if os.getuid() == 0:
        (folder / PLACE).symlink_to("/proc/self/fdinfo")
    else:
        (folder / PLACE).mkdir(mode=0o555)
    status, said = Begun(*COMMANDS[name].words, cwd=folder).ended()
    assert status in (1, 2)
    assert len(said) == 1
    assert OUT in said[0], said
    assert os.getuid() == 0 or not list((folder / PLACE).iterdir())


@of_each_kind
def test_of_two_that_write_one_output_it_is_that_of_one(name: str, made: Path, folder: Path) -> None:
    expected, _ = whole(name, made)
    twins = [Begun(*COMMANDS[name].words, cwd=folder) for _ in range(2)]
    found = [one.ended() for one in twins]
    assert 0 in [status for status, _ in found]
    assert all(status == 0 or len(said) == 1 for status, said in found), found
    assert_whole_or_absent(name, folder, expected)
    assert files(folder / PLACE) == expected
