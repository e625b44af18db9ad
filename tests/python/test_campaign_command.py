"""`brickpilot campaign` writes the same bytes in one process, on a Dask cluster, and if it was killed and continued.

`test_campaign.py` compares one process with two.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command import PROGRAM, brickpilot
from dask_cluster import Cluster
from test_campaign import CAMPAIGN, OTHER, SHORT, contents
from test_campaign_killed import all_gone

RUNS = 10
COMMAND = ("campaign", "trial.toml", "--runs", str(RUNS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("command")
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN)):
        (found / f"{name}.toml").write_text(text)
    return found


def flown(folder: Path, out: str, *where: str) -> dict[str, bytes]:
    """Runs a campaign to its end and returns its three files."""
    done = brickpilot(*COMMAND, "--out", out, *where, cwd=folder)
    assert done.returncode == 0, done.stderr
    return contents(folder / out)


@pytest.fixture(scope="module")
def alone(folder: Path) -> dict[str, bytes]:
    return flown(folder, "alone", "--jobs", "1")


def test_a_dask_cluster_gives_the_bytes_of_one_process(folder: Path, alone: dict[str, bytes], tmp_path: Path) -> None:
    """`test_campaign_cluster.py` has two workers, which finish parts out of order."""
    with Cluster(tmp_path) as cluster:
        cluster.add_worker("one")
        assert flown(folder, "cluster", "--scheduler", cluster.address) == alone
    assert len(list((folder / "cluster" / "parts").iterdir())) == RUNS
    assert flown(folder, "seed", "--jobs", "1", "--seed", "8") != alone  # so the comparison can fail


def killed(folder: Path, out: str, parts: int, pause: float, jobs: int) -> int:
    """Starts the command, kills its group `pause` s after `parts` parts are written, and returns its status."""
    program = subprocess.Popen(
        [PROGRAM, *COMMAND, "--out", out, "--jobs", str(jobs)],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0,
    )  # fmt: skip
    until = time.monotonic() + 60
    while len(list((folder / out / "parts").glob("*.parquet"))) < parts and program.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.002)
    time.sleep(pause)
    if program.poll() is None:
        os.killpg(program.pid, signal.SIGKILL)
    status = program.wait(20)
    assert all_gone(program.pid)
    return status


def resumed(folder: Path, out: str, kills: int, seed: int) -> dict[str, bytes]:
    """Returns the files of a campaign that is killed `kills` times, the last time during or after their writing."""
    drawn = random.Random(seed)
    moments = [(drawn.randrange(RUNS), drawn.uniform(0, 0.02)) for _ in range(kills - 1)]
    moments = [*sorted(moments), (RUNS, drawn.uniform(0, 0.3))]
    states = [killed(folder, out, parts, pause, drawn.choice((1, 2))) for parts, pause in moments]
    assert -signal.SIGKILL in states
    return flown(folder, out, "--jobs", "2")


def test_a_command_that_is_killed_twice_gives_the_same_bytes(folder: Path, alone: dict[str, bytes]) -> None:
    assert resumed(folder, "killed", kills=2, seed=3) == alone


@pytest.mark.campaign
def test_a_command_that_is_killed_twenty_times_gives_the_same_bytes(folder: Path, alone: dict[str, bytes]) -> None:
    assert resumed(folder, "often", kills=20, seed=4) == alone


def test_sigterm_ends_the_workers_at_once(tmp_path: Path) -> None:
    """Each part has so many long runs that it takes longer than the two seconds within which the workers must end."""
    for name, text in (("short", SHORT), ("other", OTHER), ("trial", CAMPAIGN)):
        far = text.replace("duration_s = 4", "duration_s = 300").replace("[0.3, 0]", "[30, 0]")
        (tmp_path / f"{name}.toml").write_text(far)
    command = [str(PROGRAM), "campaign", "trial.toml", "--runs", "20000", "--jobs", "2", "--out", str(tmp_path / "out")]
    program = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0
    )
    until = time.monotonic() + 60
    while sum(map(can_fly, begun := children(program.pid))) < 2:
        assert time.monotonic() < until
        time.sleep(0.05)
    time.sleep(0.3)  # both workers now fly their parts
    until = time.monotonic() + 2.0
    program.terminate()
    assert program.wait(timeout=2.0) == 128 + signal.SIGTERM
    while any(map(is_alive, begun)) and time.monotonic() < until:
        time.sleep(0.02)
    alive = [child for child in begun if is_alive(child)]
    for child in alive:
        os.kill(child, signal.SIGKILL)
    assert not alive


def can_fly(process: int) -> bool:
    """Returns whether a process has loaded the plant, as a worker does when its first part begins."""
    try:
        return "libbrickpilot_sim" in Path(f"/proc/{process}/maps").read_text()
    except OSError:
        return False


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(process: int) -> list[int]:
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True, check=False)
    return [int(line) for line in found.stdout.split()]
