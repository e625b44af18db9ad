"""Calls a function on several items at the same time.

Threads of Python take turns, so that two of them gained a fifth in a search. So this process is copied (fork): a copy
has all that the function needs, and sends back what it returns. This process works, too: a copy costs 6 ms, and
forgets what it has simulated. Where processes cannot be copied safely, which is everywhere but on Linux, threads take
the copies' place. Results do not depend on either, nor on the number of jobs.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, BinaryIO, TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_TURN = struct.Struct("=I")
_MOST_AT_ONCE = 4096  # items whose turns a pipe holds on every Linux


@dataclass(frozen=True)
class _Raised:
    """What a copy sends in the place of a result."""

    error: Exception


def side_by_side(work: Callable[[_Item], _Result], items: Sequence[_Item], jobs: int) -> list[_Result]:
    """Returns the results of `work` in the order of `items`, of which `jobs` are worked on at a time.

    Args:
        work: its results are picklable. What it changes may be lost with the copy that it ran in.
        jobs: no more than this process has processors are used.

    Raises:
        Exception: what `work` raised, of the first item for which it did.
    """
    jobs = min(jobs, len(items), _processors())
    if jobs < 2:
        return [work(item) for item in items]
    if sys.platform == "linux":
        first, rest = items[:_MOST_AT_ONCE], items[_MOST_AT_ONCE:]
        return _in_copies(work, first, jobs) + side_by_side(work, rest, jobs)
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(work, items))


def _processors() -> int:
    """Returns how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def _in_copies(work: Callable[[_Item], _Result], items: Sequence[_Item], jobs: int) -> list[_Result]:
    """Does as `side_by_side`, here and in copies of this process. What a copy that died did not send is done here."""
    with _turns(len(items)) as turns:
        copies: dict[int, BinaryIO] = {}
        try:
            for _ in range(jobs - 1):
                child, results = _copy(work, items, turns)
                copies[child] = results
            found = _taken(work, items, turns)
            for results in copies.values():
                with contextlib.suppress(EOFError, pickle.UnpicklingError):
                    found |= pickle.load(results)
        except BaseException:
            for child in copies:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            raise
        finally:
            for child, results in copies.items():
                results.close()
                with contextlib.suppress(ChildProcessError):  # a program that ignores SIGCHLD has no ends to wait for
                    os.waitpid(child, 0)
    made = []
    for index, item in enumerate(items):
        value = found[index] if index in found else work(item)
        if isinstance(value, _Raised):
            raise value.error
        made.append(value)
    return made


@contextlib.contextmanager
def _turns(count: int) -> Iterator[int]:
    """Gives a pipe from which each reader takes the number of the next item, until none is left."""
    reading, writing = os.pipe()
    os.write(writing, b"".join(map(_TURN.pack, range(count))))
    os.close(writing)
    try:
        yield reading
    finally:
        os.close(reading)


def _copy(work: Callable[[_Item], Any], items: Sequence[_Item], turns: int) -> tuple[int, BinaryIO]:
    """Returns the process number of a copy that takes turns, and the pipe that it writes its results to."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of other threads: `work` needs none
        child = os.fork()
    if child:
        os.close(writing)
        return child, os.fdopen(reading, "rb")
    status = 1
    try:
        gc.disable()  # what this process holds is not the copy's to end
        os.close(reading)
        found = _taken(work, items, turns)
        with os.fdopen(writing, "wb") as results:
            pickle.dump(found, results, pickle.HIGHEST_PROTOCOL)
        status = 0
    finally:
        os._exit(status)


def _taken(work: Callable[[_Item], Any], items: Sequence[_Item], turns: int) -> dict[int, Any]:
    """Takes turns until none is left, and returns index -> result."""
    found = {}
    while turn := os.read(turns, _TURN.size):
        (index,) = _TURN.unpack(turn)
        found[index] = _done(work, items[index])
    return found


def _done(work: Callable[[_Item], Any], item: _Item) -> Any:
    """Returns what `work` returned, or the error that it raised."""
    try:
        return work(item)
    except Exception as error:
        return _Raised(error)
