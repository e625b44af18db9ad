"""Flies gain sets with drawn robots on the workers of a campaign."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from brickpilot.campaign.engine import Crew, Part, Workers
from brickpilot.tune.task import Batch, Outcome, Problem, Raw, fly_batch

FLIGHTS = 8
"""Of a part: long enough that handing it out costs nothing, short enough that all workers end at the same time."""


@dataclass
class Flyer:
    """Flies on workers that stay from call to call, since each needs a second to start.

    Attributes:
        flown: called with the number of flights after each part.
        count: flights so far.
    """

    problem: Problem
    crew: Crew
    flown: Callable[[int], None]
    count: int = field(default=0)

    def fly(self, sets: Sequence[Raw], stream: int, places: Sequence[int]) -> list[list[Outcome]]:
        """Returns the outcomes of each gain set: all are flown by the same robots, with the same noise."""
        parts: deque[Part] = deque()
        for number, gains in enumerate(sets):
            for begin in range(0, len(places), FLIGHTS):
                batch = Batch(self.problem, gains, stream, tuple(places[begin : begin + FLIGHTS]))
                parts.append(Part(f"{stream}-{places[0]}-{number}-{begin}", batch))
        found: dict[str, list[Outcome]] = {}
        waiting = len(parts)
        while waiting:
            while parts and self.crew.room() > 0:
                self.crew.give(parts.popleft())
            for done in self.crew.wait():
                found[done.part.key] = done.result
                waiting -= 1
                self.count += len(done.result)
                self.flown(self.count)
        return [
            [one for begin in range(0, len(places), FLIGHTS) for one in found[f"{stream}-{places[0]}-{number}-{begin}"]]
            for number in range(len(sets))
        ]


@contextmanager
def flyer(problem: Problem, workers: Workers, flown: Callable[[int], None]) -> Iterator[Flyer]:
    """Yields what flies the problem; its workers stop at the end."""
    with workers.crew(fly_batch) as crew:
        yield Flyer(problem, crew, flown)
