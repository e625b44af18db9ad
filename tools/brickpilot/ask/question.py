"""Drives the courses that separate the rivals, until one explanation is left and a further course confirms it."""

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
    "undecidable": "No mission that fits the space separates the explanations that are left.",
    "fence": "The robot came to the fence, so its motors were stopped. Bring it back to its start.",
    "link": "The link was lost, so the robot stopped.",
    "budget": "The number of missions or the battery's charge is used up.",
}
"""Why no further course is driven -> the sentence for the user."""


@dataclass(frozen=True)
class Driven:
    """One flight of a course, as the host recorded it.

    Attributes:
        seconds: the duration of the flight, s.
        battery_v: the battery's voltage at the end, V.
        ended: "fence" (the robot left the space) or "link" (it was lost) if this ended the flight; None: complete.
    """

    seconds: float
    battery_v: float
    ended: Literal["fence", "link"] | None


@dataclass(frozen=True)
class Answered:
    """A driven course, and the result from the data of this course and of all earlier courses.

    Attributes:
        name: the title of the course.
        why: why the course was chosen.
        weights: explanation -> its weight, for the explanations that together hold 95 % of the weight.
    """

    name: str
    why: str
    seconds: float
    weights: dict[str, float]


@dataclass(frozen=True)
class Asked:
    """The finding from all courses, and the courses.

    Attributes:
        finding: what `discover` finds in the data of all courses.
        manoeuvres: the courses, in the order in which they were driven.
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
"""Takes the finding, all courses and the titles of the driven courses. Returns the next course and the reason for it;
None: no course helps."""


def ask(
    believed: Model, sensors: str, limits: Limits, drive: Callable[[Scenario], Driven],
    conclude: Callable[[], Finding], choose: Choice | None = None,
) -> Asked:  # fmt: skip
    """Drives until one explanation is left, no course separates the explanations that are left, or a limit is reached.

    One course shows one kind of motion, which may not show every cause. So an answer counts only if the data with a
    further course give the same answer.

    Args:
        believed: the owner's model of the robot.
        sensors: "imu" or "imu+encoders".
        drive: drives a course and keeps the recording.
        conclude: returns the finding of `discover` from all recordings so far.
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
    finding: Finding, offered: Sequence[Scenario], driven: Sequence[str], sensors: str, limits: Limits
) -> tuple[Scenario, str] | None:
    """Returns the course that separates the rivals most or, without rivals, a course that was not driven yet."""
    new = [one for one in offered if one.title not in driven]
    rivals = rivals_of(finding)
    if len(rivals) < 2:
        why = "the answer has no rival, so a mission of another kind has to confirm or refute it"
        return (new[0], why) if new else None
    decided = deciding(rivals, finding.noise_sd, offered, sensors, limits)
    if decided is None:
        return None
    course, apart, signal = decided
    return course, f"the rivals differ by {apart:.2g} times the noise in {signal}"


def rivals_of(finding: Finding) -> list[Model]:
    """Returns the models of the best explanation and of its rivals; one model if there is no rival."""
    best = dataclasses.replace(finding.augmented, by_run={})
    held = finding.effects[0].equivalents if finding.effects else ()
    return [best, *(Model(rival.name, best.vehicle, best.profile, rival.nominal, rival.effects) for rival in held)]
