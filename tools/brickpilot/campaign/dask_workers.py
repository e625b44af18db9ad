"""The workers of a Dask scheduler. They call a function on each part of a campaign.

If a worker dies, Dask gives its part to another worker. A worker may join at any time, so each worker compares its
versions with those of this process before each part.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import threading
import time
import uuid
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from brickpilot.campaign import store
from brickpilot.campaign.run_parts import CHECK_S, Function, Futures, Results
from brickpilot.campaign.store import Versions
from brickpilot.errors import InputError, WorkFailedError

CONNECT_S = 5.0
"""s: time in which the scheduler has to answer."""
WORKERS_S = 10.0
"""s: time to wait for the first worker."""
ALONE_S = 60.0
"""s: a campaign without a worker for this time ends; a queue may need a minute to replace stopped workers."""

_AHEAD = 2  # number of parts given to each thread of a worker: one part runs, one part waits

_ONE_AT_A_TIME = threading.Lock()
"""The threads of a worker take turns, because BLAS or the function may not be safe in several threads."""


@contextmanager
def dask_workers(function: Function, scheduler: str) -> Iterator[Results]:
    """Yields the workers of the scheduler at this address, which call `function`.

    Raises:
        InputError: the library is not installed, no scheduler answers, no worker comes, or a worker's version differs.
    """
    try:
        import distributed  # noqa: F401  (makes the loggers that `_quiet` silences)
    except ImportError:
        raise InputError(
            "needs the library distributed: pip install 'brickpilot[cluster]'", field=_field(scheduler)
        ) from None
    with _quiet(), _client(scheduler) as client:
        workers = DaskWorkers(function, scheduler, client)
        workers.wait_for_workers()
        workers.compare_versions()
        yield workers.results


class DaskWorkers(Futures):
    """The workers of a scheduler; made by `dask_workers`. When the client closes, the scheduler drops the parts."""

    def __init__(self, function: Function, scheduler: str, client: Any) -> None:
        super().__init__(function)
        self._scheduler = scheduler
        self._client = client
        self._name = f"brickpilot-{uuid.uuid4().hex[:8]}"
        self._threads = 0
        self._checked = self._worked = time.monotonic()

    def most(self) -> int:
        return max(_AHEAD * self._threads, 1)

    def submit(self, key: str, task: bytes) -> Any:
        # The task is bytes, so that Dask does not inspect the argument, and the scheduler need not import the function.
        name = f"{self._name}-{key}"
        return self._client.submit(_called, store.versions_here(), self._scheduler, task, key=name, pure=False)

    def result(self, key: str, future: Any) -> Any:
        from distributed import CancelledError, KilledWorker

        try:
            return future.result(timeout=ALONE_S)
        except KilledWorker as error:
            times = error.allowed_failures + 1
            raise WorkFailedError(
                f"part {key} ended its worker {times} times, last {error.last_worker.address}"
            ) from None
        except (CancelledError, TimeoutError):
            if future.status == "error":  # the function itself raised the error
                raise
            raise self._gone() from None

    def check(self) -> None:
        """Counts the workers at most once in `CHECK_S`, because their number may change at any time.

        Raises:
            WorkFailedError: the scheduler does not answer any more, or there was no worker for a long time.
        """
        if time.monotonic() - self._checked >= CHECK_S:
            self._count()

    def _count(self) -> None:
        self._checked = time.monotonic()
        if self._client.status != "running":
            raise self._gone()
        try:
            self._threads = sum(self._client.nthreads().values())
        except OSError:
            raise self._gone() from None
        if self._threads:
            self._worked = self._checked
        elif self._checked - self._worked > ALONE_S:
            raise WorkFailedError(
                f"{self._scheduler} has had no worker for {ALONE_S:g} s; the parts that are done stay"
            )

    def _gone(self) -> WorkFailedError:
        return WorkFailedError(f"the Dask scheduler {self._scheduler} is gone; the parts that are done stay")

    def wait_for_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise InputError(
                f"has no worker after {WORKERS_S:g} s: start one with `dask worker {self._scheduler}`",
                field=_field(self._scheduler),
            ) from None
        self._count()

    def compare_versions(self) -> None:
        """Compares the versions of all workers with those of this process, before the workers run any part.

        The scheduler only forwards parts, so it may have another version of this program.
        """
        field = _field(self._scheduler)
        try:
            self._client.run_on_scheduler(store.versions_here)
        except Exception as error:  # an import on a worker may raise any error
            raise InputError(f"the scheduler cannot load this brickpilot: {error}", field=field) from None
        for address, versions in sorted(self._client.run(store.versions_here, on_error="return").items()):
            if not isinstance(versions, Versions):
                raise InputError(f"worker {address} cannot load this brickpilot: {versions}", field=field)
            _check_versions(address, versions, store.versions_here(), self._scheduler)


def _field(scheduler: str) -> str:
    return f"--scheduler {scheduler}"


def _client(scheduler: str) -> Any:
    """Returns a connected client of a scheduler.

    Raises:
        InputError: no scheduler answers.
    """
    from distributed import Client

    try:
        with ThreadPoolExecutor(1) as aside:  # another thread, because that of a notebook has an event loop already
            aside.submit(lambda: asyncio.run(asyncio.wait_for(_greet(scheduler), CONNECT_S))).result()
        return Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except Exception as error:  # another program's answer may raise any error
        raise InputError(f"no Dask scheduler answers there within {CONNECT_S:g} s", field=_field(scheduler)) from error


async def _greet(scheduler: str) -> None:
    """Waits for a scheduler's answer. A client would wait for ever for a program that only accepts the connection."""
    from distributed.comm import connect

    greeted = await connect(scheduler, timeout=CONNECT_S)
    await greeted.close()


def _check_versions(worker: str, versions: Versions, wanted: Versions, scheduler: str) -> None:
    if differences := versions.differences(wanted):
        raise InputError(
            f"worker {worker} has {differences}: install the same package on each worker", field=_field(scheduler)
        )


def _called(wanted: Versions, scheduler: str, task: bytes) -> Any:
    """Calls the function of a pickled task and returns its result. Runs on the worker."""
    versions = store.versions_here()
    if versions != wanted:
        from distributed import get_worker

        _check_versions(get_worker().address, versions, wanted, scheduler)
    with _ONE_AT_A_TIME:
        function, argument = pickle.loads(task)
        return function(argument)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silences Dask's log, which has many lines for each lost connection; an error reports the loss in one line."""
    loggers = [
        logging.getLogger(name)
        for name in logging.root.manager.loggerDict
        if name.startswith(("distributed", "tornado"))
    ]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="distributed")  # this module compares versions itself
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
