"""Drives, concludes, and drives what separates the rivals, until one explanation is left and a course confirms it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from brickpilot.ask.courses import Limits, courses, deciding, safe
from brickpilot.discover.finding import NOMINAL_VALUES, Finding, verdict_json
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.scenario import Scenario

Stopped = Literal["decided", "undecidable", "fence", "link", "budget"]

STOPPED: dict[Stopped, str] = {
    "decided": "One explanation is left, and a further mission has confirmed it.",
    "undecidable": "No mission that fits the space separates what is left.",
    "fence": "The robot came to the fence, so its motors were stopped. Bring it back to its start.",
    "link": "The link was lost, so the robot stopped.",
    "budget": "The number of missions or the battery's charge is used up.",
}
"""Why the questions ended -> the sentence for the user."""


@dataclass(frozen=True)
class Driven:
    """One flight of a course, as its host saw it.

    Attributes:
        seconds: the time that it took.
        battery_v: the battery's voltage at its end.
        ended: "fence" or "link" if it ended early; None: it was flown to its end.
    """

    seconds: float
    battery_v: float
    ended: Literal["fence", "link"] | None


@dataclass(frozen=True)
class Answered:
    """A course, and what all courses up to it say.

    Attributes:
        name: what was driven.
        why: why it was chosen.
        weights: explanation -> its weight, of those that together hold 95 % of it.
    """

    name: str
    why: str
    seconds: float
    weights: dict[str, float]


@dataclass(frozen=True)
class Asked:
    """The conclusion, and how it was reached.

    Attributes:
        finding: what `discover` says of all courses.
        stopped: why no further course was driven.
    """

    finding: Finding
    manoeuvres: tuple[Answered, ...]
    stopped: Stopped

    @property
    def sentence(self) -> str:
        """Why no further course was driven, in words."""
        return STOPPED[self.stopped]

    def to_json(self) -> dict[str, Any]:
        """Returns the object of `ask --json`."""
        manoeuvres = [dataclasses.asdict(answered) for answered in self.manoeuvres]
        return verdict_json(self.finding) | {"manoeuvres": manoeuvres, "stopped": self.stopped}


Choice = Callable[[Finding, Sequence[Scenario], Sequence[str]], tuple[Scenario, str] | None]
"""Takes the finding, all courses and the titles of those driven. Returns the next one and why; None: none helps."""


def ask(
    believed: Model, sensors: str, limits: Limits, drive: Callable[[Scenario], Driven],
    conclude: Callable[[], Finding], choose: Choice | None = None,
) -> Asked:  # fmt: skip
    """Asks until one explanation is left, nothing separates what is left, or a limit is reached.

    One course shows one kind of motion, in which other causes may hide. So an answer counts if the data with a further
    course give it again.

    Args:
        believed: the model of the robot as its owner believes it.
        sensors: "imu" or "imu+encoders".
        drive: drives a course and keeps its recording.
        conclude: says what all recordings up to now show.
        choose: chooses the next course; None: the course that separates the rivals most.

    Raises:
        InputError: no course fits the limits.
    """
    every = courses(limits)
    possible = [course for course, flown in zip(every, safe(every, [believed], sensors, limits), strict=True) if flown]
    if not possible:
        raise InputError(f"no mission stays within {limits.space_m:g} m of the start", field="space")

    choose = choose or partial(_next, sensors=sensors, limits=limits)
    course, why = possible[0], "the first mission"
    made: list[Answered] = []
    answers: list[tuple[str, frozenset[str]]] = []
    while True:
        driven = drive(course)
        found = conclude()
        weights = {" + ".join(one.effects) or NOMINAL_VALUES: round(one.weight, 4) for one in found.explanations}
        made.append(Answered(course.title, why, round(driven.seconds, 3), weights))
        stopped: Stopped | None = driven.ended
        answers.append((found.verdict, frozenset(one.name for one in found.effects if one.claimed)))
        if stopped is None and found.verdict in ("named", "none") and answers[-2:-1] == answers[-1:]:
            stopped = "decided"  # a further course, with motion of another kind, has not changed the answer
        low = limits.battery_v is not None and driven.battery_v < limits.battery_v
        if stopped is None and (len(made) >= limits.most or low):
            stopped = "budget"
        if stopped is None:
            following = choose(found, possible, [one.name for one in made])
            if following is not None:
                course, why = following
                continue
            stopped = "undecidable"
        return Asked(found, tuple(made), stopped)


def _next(
    found: Finding, offered: Sequence[Scenario], driven: Sequence[str], sensors: str, limits: Limits
) -> tuple[Scenario, str] | None:
    """Returns the next course: the one that separates the rivals most; without rivals, one that was not driven."""
    new = [one for one in offered if one.title not in driven]
    rivals = rivals_of(found)
    if len(rivals) < 2:
        why = "the answer has no rival, so a mission of another kind has to confirm or refute it"
        return (new[0], why) if new else None
    decided = deciding(rivals, found.noise_sd, offered, sensors, limits)
    if decided is None:
        return None
    course, apart, signal = decided
    return course, f"the rivals differ by {apart:.2g} times the noise in {signal}"


def rivals_of(found: Finding) -> list[Model]:
    """Returns the models of the best explanation and of its rivals; one model if there is no rival."""
    best = dataclasses.replace(found.augmented, by_run={})
    held = found.effects[0].equivalents if found.effects else ()
    return [best, *(Model(one.name, best.vehicle, best.profile, one.nominal, one.effects) for one in held)]
