"""The workers of a campaign: processes of this machine, a Dask cluster, or this process itself.

Each process has its own pipe and shares no lock with the others: if a process is killed, only its part is lost. In the
pools of the standard library and of loky, one dead process breaks the whole pool, and its part is not known.
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
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from types import TracebackType
from typing import Any

from brickpilot.campaign.engine import Crew, Finished, Function, Part
from brickpilot.campaign.engine import Workers as Workers
from brickpilot.errors import InputError, WorkFailedError

_ADDRESS = re.compile(r"(tcp|tls)://([^\s/:]+|\[[0-9a-f:]+\]):\d{1,5}")


@dataclass(frozen=True)
class Local:
    """`jobs` processes of this machine, 1 or more. They start when they get their first parts."""

    jobs: int

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        return LocalCrew(function, self.jobs)


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

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        from brickpilot.campaign.dask_crew import dask_crew

        return dask_crew(function, self.scheduler)


class Here:
    """This process, which runs the parts one after the other; the parts need not be picklable."""

    @contextmanager
    def crew(self, function: Function) -> Iterator[Crew]:
        yield _HereCrew(function)


class _HereCrew:
    def __init__(self, function: Function) -> None:
        self._function = function
        self._given: list[Part] = []

    def room(self) -> int:
        return 1 - len(self._given)

    def give(self, part: Part) -> None:
        self._given.append(part)

    def wait(self) -> Sequence[Finished]:
        part = self._given.pop()
        return [Finished(part, self._function(part.argument))]


def chosen(jobs: int, scheduler: str | None) -> Local | Cluster:
    """Returns the workers that the options name: a scheduler's workers if `scheduler` is given.

    Raises:
        InputError: the scheduler's address is not valid.
    """
    return Local(jobs) if scheduler is None else Cluster(scheduler)


def shared(path: Path) -> Path:
    """Checks that a file or folder that a part's function reads exists on this worker, and returns its path.

    Raises:
        InputError: the file or folder is not on this worker.
    """
    if not path.exists():
        raise InputError(f"is missing on the worker {platform.node()}: each worker needs the same files", file=path)
    return path


DEATHS = 3
"""The campaign ends if one part has ended this number of workers. A worker may die by chance or for lack of memory."""

_STOP_S = 2.0  # s: time for a process to end by itself before it is killed
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

# "spawn" starts a new Python. A forked process would inherit locks that threads of BLAS or Arrow hold here.
_CONTEXT = multiprocessing.get_context("spawn")


@dataclass
class _Worker:
    process: SpawnProcess
    pipe: Connection
    part: Part | None = None


class LocalCrew:
    """A crew of processes, as a context manager."""

    def __init__(self, function: Function, jobs: int) -> None:
        self._function = function
        self._jobs = jobs
        self._workers: list[_Worker] = []
        self._deaths: Counter[str] = Counter()
        self._had_handler = True

    def __enter__(self) -> LocalCrew:
        is_main = threading.current_thread() is threading.main_thread()
        self._had_handler = not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
        if not self._had_handler:  # without a handler, SIGTERM ends only this process, and the workers go on
            signal.signal(signal.SIGTERM, _end)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._workers = [worker for worker in self._workers if worker.process.pid is not None]  # those that started
        for worker in self._workers:
            worker.pipe.close()  # a closed pipe ends a worker that waits for a part
            if worker.part is not None:
                worker.process.terminate()
        for worker in self._workers:
            _wait_for_end(worker)
        if not self._had_handler:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def room(self) -> int:
        return self._jobs - sum(worker.part is not None for worker in self._workers)

    def give(self, part: Part) -> None:
        idle = (worker for worker in self._workers if worker.part is None)
        worker = next(idle, None) or self._started()
        worker.part = part
        try:
            worker.pipe.send((self._function, part.argument))
        except (BrokenPipeError, ConnectionResetError):  # the worker died while it was idle
            self._forget(worker)
            self.give(part)

    def wait(self) -> Sequence[Finished]:
        while True:
            busy = [worker for worker in self._workers if worker.part is not None]
            events = set(wait([event for worker in busy for event in (worker.pipe, worker.process.sentinel)]))
            heard = [worker for worker in busy if events & {worker.pipe, worker.process.sentinel}]
            if finished := [part for part in map(self._heard, heard) if part is not None]:
                return finished

    def _started(self) -> _Worker:
        ours, theirs = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=_serve, args=(theirs,), name="brickpilot-worker")
        worker = _Worker(process, ours)
        self._workers.append(worker)  # before the worker starts, so that `__exit__` always ends it
        with _quiet_and_single_threaded():
            process.start()
        theirs.close()  # so that this process notices when the worker closes the pipe
        return worker

    def _heard(self, worker: _Worker) -> Finished | None:
        """Returns a worker's answer; if the worker died, gives its part to a worker again."""
        assert worker.part is not None
        part = worker.part
        try:
            if not worker.process.is_alive() and not worker.pipe.poll():
                raise EOFError  # the worker is dead, but one of its child processes holds the pipe open
            done, answer = worker.pipe.recv()
        except (EOFError, OSError):  # the pipe ended, perhaps in the middle of an answer
            self._forget(worker)
            self._deaths[part.key] += 1
            if self._deaths[part.key] == DEATHS:
                raise WorkFailedError(
                    f"part {part.key} ended its worker {DEATHS} times, last by {_how(worker.process.exitcode)}"
                ) from None
            self.give(part)
            return None
        worker.part = None
        if not done:
            raise answer
        return Finished(part, answer)

    def _forget(self, worker: _Worker) -> None:
        """Removes a dead worker."""
        self._workers.remove(worker)
        worker.pipe.close()
        _wait_for_end(worker)


def _end(number: int, frame: object) -> None:
    """Ends this process by an exception, so that each `with` closes; the exit status is that of a shell."""
    sys.exit(128 + number)


def _wait_for_end(worker: _Worker) -> None:
    """Waits `_STOP_S` for the end of a worker, then kills it."""
    worker.process.join(_STOP_S)
    if worker.process.is_alive():
        worker.process.kill()
        worker.process.join()


def _how(exitcode: int | None) -> str:
    """Returns how a process ended, in words."""
    if exitcode is None or exitcode >= 0:
        return f"exit status {exitcode}"
    return f"signal {-exitcode} ({signal.strsignal(-exitcode)})"


@contextmanager
def _quiet_and_single_threaded() -> Iterator[None]:
    """Each process that starts in this block has one thread of BLAS and ignores Ctrl-C, which this process handles."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    has_masks = hasattr(signal, "pthread_sigmask")  # Windows has none
    if has_masks:
        resource_tracker.ensure_running()  # otherwise the first worker starts the tracker, which unblocks Ctrl-C again
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if has_masks else set()  # a child keeps the mask
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        if has_masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(pipe: Connection) -> None:
    """Calls each function that arrives through the pipe, until the other end is closed. Runs in the worker."""
    while True:
        try:
            function, argument = pipe.recv()
        except EOFError:
            return
        except Exception as error:  # a module that this process cannot import
            answer: tuple[bool, Any] = (False, _portable(error))
        else:
            answer = _called(function, argument)
        try:
            pipe.send(answer)
        except (BrokenPipeError, ConnectionResetError):
            return
        except Exception as error:  # the answer cannot be pickled; no part of it was sent
            pipe.send((False, WorkFailedError(f"a worker cannot send what it made: {error}")))


def _called(function: Function, argument: Any) -> tuple[bool, Any]:
    """Returns whether the function returned, and what it returned or raised."""
    try:
        return True, function(argument)
    except Exception as error:
        return False, _portable(error)


def _portable(error: Exception) -> Exception:
    """Returns an error that can be sent. A note has the worker's traceback, because a traceback cannot be sent."""
    error.add_note("".join(traceback.format_exception(error)).rstrip())
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return WorkFailedError(f"{type(error).__name__}: {error}")
    return error
