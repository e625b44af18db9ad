"""Calls a function on several items at the same time.

Only one thread of Python runs at a time, so two threads make a search only a fifth faster. On Linux this process copies
itself (fork) instead. A copy has all data that the function needs, and sends back the results. A copy takes 6 ms to
make, and what it stored is lost when it ends. Therefore this process works on items, too, and does not only wait. Other
systems do not copy processes safely, so this process uses threads there. No result depends on the system or on `jobs`.
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
from typing import Any, BinaryIO, TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_TURN = struct.Struct("=I")
_MOST_AT_ONCE = 4096  # largest number of items: a pipe of any Linux can hold their numbers


def side_by_side(work: Callable[[_Item], _Result], items: Sequence[_Item], jobs: int) -> list[_Result]:
    """Returns the results of `work` in the order of `items`; works on up to `jobs` items at a time.

    Args:
        work: returns picklable results that are no exceptions. In a copy of this process, changes that `work` makes to
            objects are lost.
        jobs: limited to the number of processors that this process may use.

    Raises:
        Exception: the error that `work` raised for the first failed item.
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
    """Works on the items in this process and in copies of it. If a copy dies, this process repeats the copy's items."""
    with _turns(len(items)) as turns:
        copies: dict[int, BinaryIO] = {}
        try:
            for _ in range(jobs - 1):
                child, results = _copy(work, items, turns)
                copies[child] = results
            by_index = _work_through(work, items, turns)
            for results in copies.values():
                with contextlib.suppress(EOFError, pickle.UnpicklingError):
                    by_index |= pickle.load(results)
        except BaseException:
            for child in copies:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            raise
        finally:
            for child, results in copies.items():
                results.close()
                with contextlib.suppress(ChildProcessError):  # a program that ignores SIGCHLD has no child to wait for
                    os.waitpid(child, 0)
    made = []
    for index, item in enumerate(items):
        value = by_index[index] if index in by_index else work(item)
        if isinstance(value, Exception):
            raise value
        made.append(value)
    return made


@contextlib.contextmanager
def _turns(count: int) -> Iterator[int]:
    """Yields a pipe that holds the numbers of all items. Each reader takes the next number, until the pipe is empty."""
    reading, writing = os.pipe()
    os.write(writing, b"".join(map(_TURN.pack, range(count))))
    os.close(writing)
    try:
        yield reading
    finally:
        os.close(reading)


def _copy(work: Callable[[_Item], Any], items: Sequence[_Item], turns: int) -> tuple[int, BinaryIO]:
    """Returns the process number of a copy that takes items, and the pipe to which the copy writes its results."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns if other threads run; `work` needs none
        child = os.fork()
    if child:
        os.close(writing)
        return child, os.fdopen(reading, "rb")
    status = 1
    try:
        gc.disable()  # the copy must not destroy objects of this process
        os.close(reading)
        by_index = _work_through(work, items, turns)
        with os.fdopen(writing, "wb") as results:
            pickle.dump(by_index, results, pickle.HIGHEST_PROTOCOL)
        status = 0
    finally:
        os._exit(status)


def _work_through(work: Callable[[_Item], Any], items: Sequence[_Item], turns: int) -> dict[int, Any]:
    """Works on the items whose numbers it reads from `turns`. Returns index -> the result, or the error of `work`."""
    by_index = {}
    while turn := os.read(turns, _TURN.size):
        (index,) = _TURN.unpack(turn)
        try:
            by_index[index] = work(items[index])
        except Exception as error:
            by_index[index] = error
    return by_index
