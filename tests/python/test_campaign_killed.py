"""A campaign that is killed at random moments and resumed gives the same bytes as an undisturbed campaign."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import campaign_program
import pytest

PROGRAM = Path(campaign_program.__file__)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of an undisturbed campaign on one worker."""
    folder = tmp_path_factory.mktemp("alone")
    campaign_program.main(folder, "1")
    return (folder / campaign_program.TABLE).read_bytes()


def begun(folder: Path, jobs: int, *more: str) -> subprocess.Popen[str]:
    """Starts the campaign, in a process group of its own, as a terminal does.

    It obeys Ctrl-C even if these tests are a background job of a shell, which ignores Ctrl-C.
    """
    return subprocess.Popen(
        [sys.executable, str(PROGRAM), str(folder), str(jobs), *more],
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def parts_of(folder: Path) -> int:
    return len(list((folder / "parts").glob("p*.parquet")))


def wait_for_parts(folder: Path, number: int, program: subprocess.Popen[str]) -> None:
    until = time.monotonic() + 60
    while parts_of(folder) < number and program.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.001)


def all_gone(group: int) -> bool:
    """Returns whether all processes of a group end within some seconds."""
    until = time.monotonic() + 20
    while time.monotonic() < until:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def killed_and_resumed(folder: Path, kills: int, seed: int) -> bytes:
    """Returns the table of a campaign that was killed `kills` times, at moments spread over its parts."""
    drawn = random.Random(seed)
    for kill in range(kills):
        program = begun(folder, drawn.choice((1, 2)))
        wait_for_parts(folder, round(len(campaign_program.KEYS) * (kill + drawn.random()) / kills), program)
        time.sleep(drawn.uniform(0, 0.02))
        program.kill()
        program.communicate()
        assert all_gone(program.pid)  # the workers too
    campaign_program.main(folder, "2")
    return (folder / campaign_program.TABLE).read_bytes()


def test_two_workers_give_the_bytes_of_one(alone: bytes, tmp_path: Path) -> None:
    campaign_program.main(tmp_path, "2")
    assert (tmp_path / campaign_program.TABLE).read_bytes() == alone


def test_a_campaign_that_is_killed_three_times_gives_the_same_bytes(alone: bytes, tmp_path: Path) -> None:
    assert killed_and_resumed(tmp_path, kills=3, seed=1) == alone


@pytest.mark.campaign
def test_a_campaign_that_is_killed_twenty_times_gives_the_same_bytes(alone: bytes, tmp_path: Path) -> None:
    assert killed_and_resumed(tmp_path, kills=20, seed=2) == alone


def test_ctrl_c_keeps_the_parts_and_ends_the_workers(alone: bytes, tmp_path: Path) -> None:
    program = begun(tmp_path, 2, "slow")
    wait_for_parts(tmp_path, 5, program)
    os.killpg(program.pid, signal.SIGINT)
    _, said = program.communicate(timeout=20)
    assert program.returncode != 0, said
    # The program says it once, at the end; workers print nothing. Ctrl-C may arrive while the program handles another
    # error (`mkdir` of a folder that exists), and then Python prints a traceback of each.
    assert said.splitlines().count("KeyboardInterrupt") == 1, said
    assert said.strip().endswith("KeyboardInterrupt")
    assert all_gone(program.pid)
    kept = parts_of(tmp_path)
    assert 5 <= kept < len(campaign_program.KEYS)
    campaign_program.main(tmp_path, "1")
    assert (tmp_path / campaign_program.TABLE).read_bytes() == alone
