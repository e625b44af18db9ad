"""A full disk ends a command with one line that names the file, and leaves nothing half-written behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import brickpilot
from findings import measured
from new_users_logs import STRAIGHT, write_log
from test_campaign import CAMPAIGN, OTHER, SHORT
from test_outputs_whole import Begun

ROOM = 2048  # bytes that a file can have, as on a disk that becomes full while it is written


def on_a_full_disk(*words: str, cwd: Path) -> tuple[int, list[str]]:
    """Runs a command that can write no file of more than `ROOM` bytes; the error is the one of a full disk."""
    return Begun(*words, cwd=cwd, room=ROOM).ended()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("full")
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN)):
        (made / f"{name}.toml").write_text(text)
    write_log(made / "log.csv", "planar", STRAIGHT, {})
    measured(made / "set")
    return made


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("run", "--out", "made"), "made"),
        (("import", "log.csv", "--guess", "--out", "made"), "made"),
        (("compare", "set", "--out", "made"), "made"),
        (("discover", "set", "--budget", "1", "--out", "made"), "made"),
        (("export", "mjcf", "--out", "made.xml"), "made.xml"),
    ],
)
def test_nothing_is_written_and_the_line_names_what(words: tuple[str, ...], named: str, folder: Path) -> None:
    before = {*folder.iterdir()}
    said = [f"brickpilot: {named}: File too large; nothing of it is written"]
    assert on_a_full_disk(*words, cwd=folder) == (1, said)
    assert {*folder.iterdir()} == before


def test_a_campaign_keeps_what_is_done_and_names_the_file(folder: Path) -> None:
    flown = ("campaign", "trial.toml", "--runs", "4", "--out", "flown")
    status, said = on_a_full_disk(*flown, cwd=folder)
    assert status == 1
    assert len(said) == 1
    assert said[0].startswith("brickpilot: flown/")
    assert said[0].endswith(": File too large; what is done stays")
    assert not [path for path in (folder / "flown").rglob("*") if "unfinished" in path.name]
    assert brickpilot(*flown, cwd=folder).returncode == 0
