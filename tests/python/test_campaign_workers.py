"""Workers of this machine: each part is kept once, even if workers die, and few parts are in memory at a time."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

import campaign_parts
import pytest
from brickpilot.campaign import workers
from brickpilot.campaign.run_parts import Part, PartProgress, run_parts
from brickpilot.errors import WorkFailedError


def silent(total: int = 1) -> PartProgress:
    return PartProgress(lambda done, total, text: None, total)


def results(function: Callable[[Any], Any], arguments: Iterator[Any] | list[Any], jobs: int = 2) -> dict[str, Any]:
    """Returns key of a part -> the result of local workers."""
    kept: dict[str, Any] = {}

    def keep(part: Part, result: Any) -> None:
        assert part.key not in kept
        kept[part.key] = result

    parts = (Part(f"p{number:05}", argument) for number, argument in enumerate(arguments))
    run_parts(function, parts, keep=keep, workers=workers.Local(jobs), progress=silent())
    return kept


def test_each_part_is_done_once_and_told() -> None:
    told: list[tuple[int, int, str]] = []
    kept = {}
    run_parts(
        campaign_parts.squared,
        [Part(str(number), number) for number in range(20)],
        keep=lambda part, result: kept.update({part.key: result}),
        workers=workers.Local(2),
        progress=PartProgress(lambda *one: told.append(one), 25, done=5, what="flights"),
    )
    assert kept == {str(number): number * number for number in range(20)}
    assert [done for done, _, _ in told] == list(range(5, 26))
    assert told[-1] == (25, 25, "25 of 25 flights")


def test_no_parts_need_no_worker() -> None:
    assert results(campaign_parts.squared, []) == {}


def test_few_parts_are_in_flight_at_a_time() -> None:
    drawn, kept = itertools.count(), 0
    ahead = 0

    def parts() -> Iterator[Part]:
        nonlocal ahead
        for _ in range(200):
            number = next(drawn)
            ahead = max(ahead, number + 1 - kept)
            yield Part(str(number), number)

    def keep(part: Part, result: int) -> None:
        nonlocal kept
        kept += 1

    run_parts(campaign_parts.squared, parts(), keep=keep, workers=workers.Local(2), progress=silent())
    assert kept == 200
    assert ahead <= 2 * 2  # parts at work, or finished but not kept yet


def test_a_worker_that_is_killed_loses_nothing(tmp_path: Path) -> None:
    arguments = [(number, str(tmp_path / str(number)) if number % 4 == 0 else "") for number in range(12)]
    assert sorted(results(campaign_parts.dies_once, arguments).values()) == list(range(12))
    assert len(list(tmp_path.iterdir())) == 3


def test_a_worker_that_is_killed_between_two_parts_is_replaced() -> None:
    with workers.Local(1).started(campaign_parts.process) as results_of:
        [(_, first)] = results_of([Part("a", None)])
        os.kill(first, signal.SIGKILL)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        [(part, second)] = results_of([Part("b", None)])
    assert part.key == "b"
    assert second != first


def test_a_part_that_ends_three_workers_ends_the_campaign_and_is_named() -> None:
    with pytest.raises(WorkFailedError) as refused:
        results(campaign_parts.dies, range(6))  # type: ignore[arg-type]
    assert str(refused.value) == "part p00003 ended its worker 3 times, last by signal 9 (Killed)"


def test_an_error_of_the_function_comes_as_it_is_with_the_workers_traceback() -> None:
    with pytest.raises(ValueError, match="no such thing as 7") as raised:
        results(campaign_parts.fails, [7])
    assert "campaign_parts.py" in raised.value.__notes__[0]


def test_an_error_that_cannot_be_sent_becomes_its_text() -> None:
    with pytest.raises(WorkFailedError, match="AwkwardError: 7 and 7"):
        results(campaign_parts.awkward, [7])


def test_workers_have_one_thread_of_blas() -> None:
    (found,) = results(campaign_parts.threads, [0]).values()
    assert found
    assert set(found) == {1}
    assert os.environ.get("MKL_NUM_THREADS") is None  # this process keeps its own number of threads


def test_a_worker_that_does_not_start_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(process: SpawnProcess) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(SpawnProcess, "start", start)
    with pytest.raises(OSError, match="no more processes"):
        results(campaign_parts.squared, [1])
    assert multiprocessing.active_children() == []


def test_an_answer_may_be_longer_than_a_pipe() -> None:
    assert [len(one) for one in results(campaign_parts.long_answer, [10_000_000] * 3).values()] == [10_000_000] * 3


def test_an_error_of_keep_stops_the_workers() -> None:
    pids = []

    def keep(part: Part, result: int) -> None:
        pids.append(result)
        raise OSError("full")

    with pytest.raises(OSError, match="full"):
        run_parts(
            campaign_parts.process, [Part("a", 0), Part("b", 0)], keep=keep, workers=workers.Local(1), progress=silent()
        )
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)
