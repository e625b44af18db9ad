"""Calls a function on many arguments, in processes of this machine or on a Dask cluster. A part is one call.

    def flown(seed: int) -> dict[str, float]: ...            # at the top of a module

    parts = (Part(f"{seed:06}", seed) for seed in range(100_000))
    run_parts(flown, parts, keep=keep, workers=workers.Local(2), progress=PartProgress(show, total=100_000))

A part is taken from the generator when a worker is free, so only a few parts are in memory. The result of a part must
depend only on the part's argument; then no result depends on the number, the order or the failures of workers.
"""

from __future__ import annotations

import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeVar

Function = Callable[[Any], Any]
"""A picklable function, which is defined at the top of a module that the workers can import."""


@dataclass(frozen=True)
class Part:
    """One call of the function.

    Attributes:
        key: the part's name, unique in a campaign. `store.Parts` accepts letters, digits, "-" and "_".
        argument: the function's argument; picklable.
    """

    key: str
    argument: Any


Results = Callable[[Iterable[Part]], Iterator[tuple[Part, Any]]]
"""Takes parts one by one, and yields each part with its result, in the order in which the parts finish.

If a worker dies, another worker begins its part again. If every worker dies that gets a certain part, or if no worker
is left, the function raises WorkFailedError. It also raises every error of the called function."""


class Workers(Protocol):
    """The processes that do the parts of a campaign."""

    def started(self, function: Function) -> AbstractContextManager[Results]:
        """Returns the workers that call `function`. At the end of the `with`, they stop or forget `function`.

        Raises:
            InputError: the workers cannot be reached, or have another version.
        """


CHECK_S = 2.0
"""s: time between two checks of the workers."""


class Futures(ABC):
    """Workers that return a future for each part, a future of `concurrent.futures` or of Dask."""

    def __init__(self, function: Function) -> None:
        self._function = function

    @abstractmethod
    def most(self) -> int:
        """Returns the largest number of parts that may be in progress at this moment; at least 1."""

    @abstractmethod
    def submit(self, key: str, task: bytes) -> Any:
        """Begins a part and returns its future. `task`: the pickled function and argument."""

    @abstractmethod
    def result(self, key: str, future: Any) -> Any:
        """Returns the result of a finished part, or raises its error."""

    @abstractmethod
    def check(self) -> None:
        """Raises WorkFailedError if the workers do not answer any more. It is called at least every `CHECK_S`."""

    def results(self, parts: Iterable[Part]) -> Iterator[tuple[Part, Any]]:
        """Yields each part with its result: see `Results`."""
        left, ended = iter(parts), SimpleQueue[tuple[Part, Any]]()
        begun: dict[str, Any] = {}

        def begin() -> None:
            for part in islice(left, max(self.most() - len(begun), 0)):
                begun[part.key] = self.submit(part.key, pickle.dumps((self._function, part.argument)))
                begun[part.key].add_done_callback(lambda future, part=part: ended.put((part, future)))

        begin()
        while begun:
            finished = []
            try:
                finished.append(ended.get(timeout=CHECK_S))
                while not ended.empty():
                    finished.append(ended.get())
            except Empty:
                pass
            self.check()
            ready = [(part, self.result(part.key, begun.pop(part.key))) for part, _ in finished]
            begin()  # before the results are used, so that no worker waits for the disk
            yield from ready


Result = TypeVar("Result")


@dataclass(frozen=True)
class PartProgress:
    """Reports the progress of a campaign.

    Attributes:
        show: called with (parts done, all parts, text) at the start and after each part.
        total: number of all parts, including those that were done before.
        done: number of parts that were done before.
        what: the noun for parts in the text, in the plural.
    """

    show: Callable[[int, int, str], None]
    total: int
    done: int = 0
    what: str = "parts"

    def after(self, finished: int) -> None:
        """Shows that `finished` parts are done, in addition to the parts that were done before."""
        done = self.done + finished
        self.show(done, self.total, f"{done} of {self.total} {self.what}")


def run_parts(
    function: Callable[[Any], Result],
    parts: Iterable[Part],
    *,
    keep: Callable[[Part, Result], None],
    workers: Workers,
    progress: PartProgress,
) -> None:
    """Calls a function on the argument of each part, and hands each result to `keep`.

    Args:
        function: a function that is defined at the top of a module that the workers can import.
        parts: the parts, which are taken one by one; each worker has only a few parts at a time.
        keep: called in this process with each part and its result, in the order in which the parts finish.
        workers: `workers.Local`, `workers.Cluster` or `workers.Here`.

    Raises:
        InputError: the workers cannot be reached, or have another version of this program.
        WorkFailedError: every worker dies that gets a certain part, or no worker is left.
        Exception: the error that the function or `keep` raised. No further part is begun.
    """
    progress.after(0)
    with workers.started(function) as results:
        for finished, (part, result) in enumerate(results(parts), 1):
            keep(part, result)
            progress.after(finished)
