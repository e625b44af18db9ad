"""The interface between the engine and its workers, which the local and the Dask workers share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

Function = Callable[[Any], Any]
"""Picklable: it stands at the top of a module that the workers can import."""


@dataclass(frozen=True)
class Part:
    """One call of the function.

    Attributes:
        key: its name, once in a campaign. `store.Parts` takes letters, digits, "-" and "_".
        argument: what the function gets; picklable.
    """

    key: str
    argument: Any


@dataclass(frozen=True)
class Finished:
    """A part and what the function returned for it."""

    part: Part
    result: Any


class Crew(Protocol):
    """Workers that are ready."""

    def room(self) -> int:
        """Returns how many more parts may be given now. It is more than 0 if no part is in flight."""

    def give(self, part: Part) -> None:
        """Gives a part to a worker, without waiting for it."""

    def wait(self) -> Sequence[Finished]:
        """Waits until at least one given part is finished, and returns all finished ones.

        A part whose worker died is given again.

        Raises:
            WorkFailedError: a part ends each worker that gets it, or no worker is left.
            Exception: what the function raised.
        """


class Workers(Protocol):
    """Where a campaign runs."""

    def crew(self, function: Function) -> AbstractContextManager[Crew]:
        """Returns the workers that will call `function`; they stop, or forget it, at the end of the `with`.

        Raises:
            InputError: they cannot be reached, or are not of this version.
        """
