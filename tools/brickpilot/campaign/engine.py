"""Runs a function over many parts, on the processes of this machine or on a Dask cluster.

    def flown(seed: int) -> dict[str, float]: ...            # at the top of a module

    parts = (Part(f"{seed:06}", seed) for seed in range(100_000))
    run(flown, parts, keep=keep, workers=workers.Local(2), progress=Progress(show, total=100_000))

A part is taken from the generator when a worker is free, so only a few parts are in memory. The result of a part must
depend only on the part's argument; then no result depends on the number, the order or the failures of workers. `Crew`
and `Workers` are the interface that the local and the Dask workers share.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
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


@dataclass(frozen=True)
class Finished:
    """A part, and the result of the function for this part."""

    part: Part
    result: Any


class Crew(Protocol):
    """Workers that are ready."""

    def room(self) -> int:
        """Returns how many more parts may be given now; at least 1 if the crew has no part."""

    def give(self, part: Part) -> None:
        """Gives a part to a worker, without waiting for it."""

    def wait(self) -> Sequence[Finished]:
        """Waits until at least one given part is finished, and returns all finished parts.

        A part whose worker died is given again.

        Raises:
            WorkFailedError: a part crashes each worker that gets it, or no worker is left. Exception: what the function
            raised."""


class Workers(Protocol):
    """The place where a campaign runs."""

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        """Returns the workers that call `function`. At the end of the `with`, the workers stop or forget `function`.

        Raises:
            InputError: the workers cannot be reached, or have another version.
        """


Result = TypeVar("Result")


@dataclass(frozen=True)
class Progress:
    """Reports the progress of a campaign.

    Attributes:
        show: called with (parts done, all parts, text) at the start and after each part.
        total: number of all parts, including those that were done before.
        done: number of parts that were done before.
        what: the plural noun for parts in the text.
    """

    show: Callable[[int, int, str], None]
    total: int
    done: int = 0
    what: str = "parts"

    def after(self, finished: int) -> None:
        """Shows that `finished` parts are done, in addition to those that were done before."""
        done = self.done + finished
        self.show(done, self.total, f"{done} of {self.total} {self.what}")


def run(
    function: Callable[[Any], Result],
    parts: Iterable[Part],
    *,
    keep: Callable[[Part, Result], None],
    workers: Workers,
    progress: Progress,
) -> None:
    """Calls a function on the argument of each part, and hands each result to `keep`.

    Args:
        function: a function that is defined at the top of a module that the workers can import.
        parts: the parts, which are taken one by one; each worker has only a few parts at a time.
        keep: called in this process with each part and its result, in the order in which the parts finish.
        workers: `workers.Local`, `workers.Cluster` or `workers.Here`.

    Raises:
        InputError: the workers cannot be reached, or are not of this version.
        WorkFailedError: a part ends each worker that gets it, or no worker is left.
        Exception: the error that the function or `keep` raised. No further part is begun.
    """
    left, finished = iter(parts), 0
    progress.after(finished)
    with workers.crew(function) as crew:
        flying = _fill(crew, left)
        while flying:
            ready = crew.wait()
            flying += _fill(crew, left) - len(ready)  # before results are kept, so that no worker waits for the disk
            for done in ready:
                keep(done.part, done.result)
                finished += 1
                progress.after(finished)


def _fill(crew: Crew, left: Iterator[Part]) -> int:
    """Gives parts to the crew as long as it has room, and returns the number of these parts."""
    given = 0
    for part in islice(left, crew.room()):
        crew.give(part)
        given += 1
    return given
