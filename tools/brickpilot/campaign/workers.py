"""The workers of a campaign: processes of this machine, a Dask cluster, or this process itself.

Each process of this machine has its own pipe and shares no lock with the others, so if a process is killed, only its
part is lost. In a `ProcessPoolExecutor`, one dead process would break the whole pool, and the pool would not name the
part of the dead process. Also, the pool's processes would go on if this process were killed.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import platform
import re
import signal
import sys
import threading
import traceback
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from brickpilot.campaign.run_parts import Function, Futures, Part, Results
from brickpilot.errors import InputError, WorkFailedError

_ADDRESS = re.compile(r"(tcp|tls)://([^\s/:]+|\[[0-9a-f:]+\]):\d{1,5}")


@dataclass(frozen=True)
class Local:
    """`jobs` processes of this machine, 1 or more. They start when they get their first parts."""

    jobs: int

    @contextmanager
    def started(self, function: Function) -> Iterator[Results]:
        processes = _Processes(function, self.jobs)
        with _sigterm_as_exception():
            try:
                yield processes.results
            finally:
                processes.stop()


@dataclass(frozen=True)
class Cluster:
    """The workers of the Dask scheduler at an address, ``tcp://HOST:PORT``.

    Raises:
        InputError: `scheduler` is no such address.
    """

    scheduler: str

    def __post_init__(self) -> None:
        if not _ADDRESS.fullmatch(self.scheduler):
            raise InputError(
                "needs the address of a Dask scheduler, tcp://HOST:PORT", field=f"--scheduler {self.scheduler}"
            )

    def started(self, function: Function) -> AbstractContextManager[Results]:
        from brickpilot.campaign.dask_workers import dask_workers

        return dask_workers(function, self.scheduler)


class Here:
    """This process, which runs the parts one after the other; the parts need not be picklable."""

    @contextmanager
    def started(self, function: Function) -> Iterator[Results]:
        def results(parts: Iterable[Part]) -> Iterator[tuple[Part, Any]]:
            return ((part, function(part.argument)) for part in parts)

        yield results


def chosen(jobs: int, scheduler: str | None) -> Local | Cluster:
    """Returns the workers that the options name: a scheduler's workers if `scheduler` is given.

    Raises:
        InputError: the scheduler's address is not valid.
    """
    return Local(jobs) if scheduler is None else Cluster(scheduler)


def shared(path: Path) -> Path:
    """Returns the path of a file or folder that a part's function reads, if it exists on this worker.

    Raises:
        InputError: the file or folder is not on this worker.
    """
    if not path.exists():
        raise InputError(f"is missing on the worker {platform.node()}: each worker needs the same files", file=path)
    return path


DEATHS = 3
"""The campaign ends if one part has killed this number of workers. A worker may die by chance or for lack of memory."""

_STOP_S = 2.0  # s: time for a process to end by itself before it is killed
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

# "spawn" starts a new Python. A forked process would inherit locks that threads of BLAS or Arrow hold here.
_CONTEXT = multiprocessing.get_context("spawn")


class _Process:
    """A process that calls functions, and the pipe to this process."""

    def __init__(self) -> None:
        self._pipe, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=_serve, args=(theirs,), name="brickpilot-worker")
        with _one_thread_of_blas():
            self._process.start()
        theirs.close()  # so that this process notices when the worker closes the pipe

    def call(self, task: bytes) -> Any:
        """Has the process do a task. Returns (True, the function's result) or (False, the function's error).

        Raises:
            EOFError, OSError: the process ended, perhaps in the middle of an answer.
        """
        self._pipe.send_bytes(task)
        return pickle.loads(self._pipe.recv_bytes())

    def is_alive(self) -> bool:
        return self._process.is_alive()

    def terminate(self) -> None:
        """Ends a process that calls a function."""
        self._process.terminate()
        self._wait()

    def close(self) -> str:
        """Ends a process that calls no function, and returns in words how the process ended."""
        self._pipe.close()  # ends a process that waits for a task
        self._wait()
        code = self._process.exitcode
        if code is None or code >= 0:
            return f"exit status {code}"
        return f"signal {-code} ({signal.strsignal(-code)})"

    def _wait(self) -> None:
        """Waits `_STOP_S` for the end of the process, then kills it."""
        self._process.join(_STOP_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class _Processes(Futures):
    """Threads, each of which waits for one process."""

    def __init__(self, function: Function, jobs: int) -> None:
        super().__init__(function)
        self._jobs = jobs
        self._threads = ThreadPoolExecutor(jobs, initializer=_block_ctrl_c)
        self._lock = threading.Lock()
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()
        self._stopped = False

    def most(self) -> int:
        return self._jobs

    def submit(self, key: str, task: bytes) -> Future[Any]:
        return self._threads.submit(self._called, key, task)

    def result(self, key: str, future: Any) -> Any:
        return future.result()

    def check(self) -> None:
        """Does nothing: a process that ended is replaced."""

    def stop(self) -> None:
        """Ends all processes."""
        with self._lock:
            self._stopped = True
            busy = list(self._busy)
        for process in busy:
            process.terminate()
        self._threads.shutdown()
        for process in self._idle:
            process.close()

    def _called(self, key: str, task: bytes) -> Any:
        """Returns the result of a task's function. If the process ends, another process begins the task again."""
        how = ""
        for _ in range(DEATHS):
            process = self._taken()
            try:
                returned, answer = process.call(task)
            except (EOFError, OSError):
                how = process.close()
                self._busy.remove(process)
                continue
            self._busy.remove(process)
            self._idle.append(process)
            if not returned:
                raise answer
            return answer
        raise WorkFailedError(f"part {key} ended its worker {DEATHS} times, last by {how}")

    def _taken(self) -> _Process:
        """Returns an idle process, or a new one, which is busy from now on."""
        with self._lock:
            if self._stopped:
                raise CancelledError
            process = self._idle.pop() if self._idle else _Process()
            if not process.is_alive():  # it ended while it was idle
                process.close()
                process = _Process()
            self._busy.add(process)
            return process


@contextmanager
def _sigterm_as_exception() -> Iterator[None]:
    """Makes SIGTERM raise an exception in this block, so that each `with` closes; the exit status is 128 + SIGTERM.

    Without a handler, SIGTERM would end only this process, and the workers would go on. A handler that the caller has
    set stays.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _block_ctrl_c() -> None:
    """Blocks Ctrl-C in this thread and in the processes that it starts; only the main thread handles Ctrl-C."""
    if hasattr(signal, "pthread_sigmask"):  # Windows has no such mask
        resource_tracker.ensure_running()  # its start unblocks Ctrl-C, so it has to start before the next line
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


@contextmanager
def _one_thread_of_blas() -> Iterator[None]:
    """Gives each process that starts in this block one thread of BLAS."""
    before = {name: os.environ[name] for name in _ONE_THREAD if name in os.environ}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name in _ONE_THREAD:
            del os.environ[name]
        os.environ.update(before)


def _serve(pipe: Connection) -> None:
    """Answers each task that arrives through the pipe, until the other end is closed. Runs in the worker."""
    with suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _answer(task: bytes) -> bytes:
    """Does a task. Returns, pickled, (True, the function's result) or (False, the function's error).

    A note of the error has the worker's traceback, because a traceback cannot be pickled.
    """
    try:
        function, argument = pickle.loads(task)
        return pickle.dumps((True, function(argument)))
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)).rstrip())
        try:
            answer = pickle.dumps((False, error))
            pickle.loads(answer)
        except Exception:
            return pickle.dumps((False, WorkFailedError(f"{type(error).__name__}: {error}")))
        return answer
