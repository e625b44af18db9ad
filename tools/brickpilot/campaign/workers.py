"""The workers of a campaign: processes of this machine, a Dask cluster, or this process itself."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from brickpilot.campaign.crew import Crew, Finished, Function, Part
from brickpilot.campaign.crew import Workers as Workers
from brickpilot.errors import InputError

_ADDRESS = re.compile(r"(tcp|tls)://([^\s/:]+|\[[0-9a-f:]+\]):\d{1,5}")


@dataclass(frozen=True)
class Local:
    """Processes of this machine.

    Attributes:
        jobs: their number, 1 or more.
    """

    jobs: int

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        from brickpilot.campaign.local_crew import LocalCrew

        return LocalCrew(function, self.jobs)


@dataclass(frozen=True)
class Cluster:
    """The workers of a Dask scheduler.

    Attributes:
        scheduler: its address.
    """

    scheduler: str

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        from brickpilot.campaign.dask_crew import DaskCrew

        return DaskCrew(function, self.scheduler)


@dataclass(frozen=True)
class Here:
    """This process, which does one part after the other, in order; its parts need not be picklable."""

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


def local(jobs: int) -> Local:
    """Returns so many processes of this machine. They start when they get their first parts."""
    return Local(jobs)


def cluster(scheduler: str) -> Cluster:
    """Returns the workers of a Dask scheduler, as ``tcp://HOST:PORT``.

    Raises:
        InputError: that is no such address.
    """
    if not _ADDRESS.fullmatch(scheduler):
        raise InputError("needs the address of a Dask scheduler, tcp://HOST:PORT", field=f"--scheduler {scheduler}")
    return Cluster(scheduler)


def chosen(jobs: int, scheduler: str | None) -> Local | Cluster:
    """Returns the workers that the options name; a scheduler takes precedence.

    Raises:
        InputError: the scheduler's address is not valid.
    """
    return local(jobs) if scheduler is None else cluster(scheduler)


def shared(path: Path) -> Path:
    """Returns a file or folder that the function of a part reads, for use in that function.

    Raises:
        InputError: it is not on this worker.
    """
    if not path.exists():
        raise InputError(f"is missing on the worker {platform.node()}: each worker needs the same files", file=path)
    return path
