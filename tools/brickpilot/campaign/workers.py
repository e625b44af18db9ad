"""Where a campaign runs: on processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from dataclasses import dataclass

from brickpilot.campaign.crew import Crew, Function
from brickpilot.campaign.crew import Workers as Workers
from brickpilot.errors import InputError

_ADDRESS = re.compile(r"(tcp|tls)://[^\s/:]+:\d{1,5}")


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


def chosen(jobs: int, scheduler: str | None) -> Workers:
    """Returns the workers that the options `--jobs` and `--scheduler` ask for; a scheduler comes first.

    Raises:
        InputError: the scheduler's address is none.
    """
    return local(jobs) if scheduler is None else cluster(scheduler)
