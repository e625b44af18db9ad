"""Work in copies of this process keeps its order, passes errors on, survives a copy that dies, and ends on Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from brickpilot import side_by_side as module
from brickpilot.side_by_side import side_by_side

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are made on Linux alone")


@pytest.fixture(autouse=True)
def many_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pretends that there are 64 processors: a worker of xdist has only one."""
    monkeypatch.setattr(module, "_processors", lambda: 64)


def test_results_come_in_the_order_of_the_items() -> None:
    def late(item: int) -> int:
        time.sleep(0.01 * (item % 3))
        return item**2

    items = list(range(9, 0, -1))
    for jobs in (1, 2, 5, 40):
        assert side_by_side(late, items, jobs) == [item**2 for item in items]
    assert side_by_side(late, [], 2) == []


@on_linux
def test_each_item_is_worked_on_once_by_this_process_or_a_copy() -> None:
    def work(item: int) -> int:
        time.sleep(0.02)
        return os.getpid()

    found = side_by_side(work, range(12), 3)
    assert len(set(found)) == 3
    assert os.getpid() in found


@on_linux
def test_more_items_than_a_pipe_has_turns_for() -> None:
    count = 2 * module._MOST_AT_ONCE + 3
    assert side_by_side(lambda item: item + 1, range(count), 2) == list(range(1, count + 1))


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_error_of_the_first_item_that_raised_is_raised(jobs: int) -> None:
    def work(item: int) -> int:
        if item > 2:
            raise KeyError(item)
        return item

    with pytest.raises(KeyError, match="3"):
        side_by_side(work, range(6), jobs)


@on_linux
def test_what_a_copy_that_was_killed_had_is_done_here() -> None:
    here = os.getpid()

    def work(item: int) -> int:
        if item == 1 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return 10 * item

    assert side_by_side(work, range(5), 2) == [0, 10, 20, 30, 40]


@on_linux
def test_a_program_that_ignores_the_ends_of_its_children_gets_its_results_too() -> None:
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        assert side_by_side(lambda item: -item, range(4), 2) == [0, -1, -2, -3]
    finally:
        signal.signal(signal.SIGCHLD, before)


@on_linux
def test_a_result_larger_than_a_pipe_comes_whole() -> None:
    found = side_by_side(lambda item: bytes([item]) * 3_000_000, range(4), 2)
    assert [one == bytes([item]) * 3_000_000 for item, one in enumerate(found)] == [True] * 4


@on_linux
def test_ctrl_c_ends_the_copies_too(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import os, signal, time\n"
        "from pathlib import Path\n"
        "from brickpilot import side_by_side as module\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)  # a run in the background ignores it\n"
        "def work(item):\n"
        f"    Path({str(tmp_path)!r}, f'{{item}}.pid').write_text(str(os.getpid()))\n"
        "    time.sleep(60)\n"
        "module._processors = lambda: 2\n"
        "module.side_by_side(work, [1, 2], 2)\n"
    )
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, str(program)], start_new_session=True, **quiet) as run:  # type: ignore[call-overload]
        names = [tmp_path / f"{item}.pid" for item in (1, 2)]
        began = time.monotonic()
        while not all(one.is_file() and one.read_text() for one in names):
            assert time.monotonic() - began < 30
            time.sleep(0.02)
        run.send_signal(signal.SIGINT)  # only to the program, not to its copies
        _, said = run.communicate(timeout=20)
    assert b"KeyboardInterrupt" in said
    for one in names:
        with pytest.raises(ProcessLookupError):
            os.kill(int(one.read_text()), 0)


def test_threads_take_the_place_of_copies_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    found = side_by_side(lambda item: (os.getpid(), item), range(6), 2)
    assert found == [(os.getpid(), item) for item in range(6)]


def test_no_more_jobs_than_processors_are_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_processors", lambda: 1)
    assert set(side_by_side(lambda _: os.getpid(), range(6), 4)) == {os.getpid()}
