"""Workers that are this process, where starting processes would cost more than the flights of a test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from brickpilot.campaign import conduct, file
from brickpilot.campaign.crew import Crew, Finished, Function, Part


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


class Here:
    """One worker: this process itself."""

    @contextmanager
    def crew(self, function: Function) -> Iterator[Crew]:
        yield _HereCrew(function)


def conducted(path: Path, out: Path, count: int | None = None) -> dict[str, Any]:
    """Conducts the campaign of a file in this process and returns its summary."""
    given = file.load(path, count=count)
    return conduct.conduct(given, out, Here(), lambda *_: None, f"brickpilot campaign {path.name}")
