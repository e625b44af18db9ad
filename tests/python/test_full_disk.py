"""A full disk ends a command with one line that names the file, and leaves nothing half-written behind."""

from __future__ import annotations

import resource
import subprocess
from pathlib import Path

import pytest
from command import PROGRAM
from findings import measured
from new_users_logs import STRAIGHT, write_log
from test_campaign import CAMPAIGN, OTHER, SHORT

ROOM = 2048  # bytes that a file can have, as on a disk that becomes full while it is written


def on_a_full_disk(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Runs a command that can write no file of more than `ROOM` bytes; the error is the one of a full disk."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM))

    return subprocess.run(
        [PROGRAM, *words], cwd=cwd, capture_output=True, text=True, timeout=300, check=False, preexec_fn=limit
    )


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
    done = on_a_full_disk(*words, cwd=folder)
    said = [line for line in done.stderr.splitlines() if line.startswith("brickpilot: ")]
    assert (done.returncode, said) == (1, [f"brickpilot: {named}: File too large; nothing of it is written"])
    assert "Traceback" not in done.stderr
    assert {*folder.iterdir()} == before


def test_a_campaign_keeps_what_is_done_and_names_the_file(folder: Path) -> None:
    done = on_a_full_disk("campaign", "trial.toml", "--runs", "4", "--out", "flown", cwd=folder)
    said = [line for line in done.stderr.splitlines() if line.startswith("brickpilot: ")]
    assert done.returncode == 1
    assert len(said) == 1
    assert said[0].startswith("brickpilot: flown/")
    assert said[0].endswith(": File too large; what is done stays")
    assert not [path for path in (folder / "flown").rglob("*") if "unfinished" in path.name]
    again = subprocess.run(
        [PROGRAM, "campaign", "trial.toml", "--runs", "4", "--out", "flown"], cwd=folder, check=False
    )
    assert again.returncode == 0
