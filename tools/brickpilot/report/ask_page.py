"""The answer of `brickpilot ask`, as text and page: what was driven, and how the weights of explanations changed."""

from __future__ import annotations

from brickpilot.ask.question import Asked
from brickpilot.report import discover_text
from brickpilot.report.quantities import ascii_text, percent
from brickpilot.report.template import render


def lines(asked: Asked) -> list[str]:
    """Returns the lines for a terminal."""
    made = []
    for number, one in enumerate(asked.manoeuvres, 1):
        held = ", ".join(f"{name} {percent(weight)}" for name, weight in one.weights.items())
        made += [f"{number}. {one.name}, {one.seconds:.1f} s ({one.why}): {held}"]
    return [ascii_text(line) for line in (*made, asked.sentence, *_finding_lines(asked))]


def _finding_lines(asked: Asked) -> list[str]:
    made = [discover_text.verdict(asked.finding)]
    for effect in asked.finding.effects:
        made += [f"{effect.name}: {discover_text.sizes(effect.parameters)}"]
    return made


def page(asked: Asked, robot: str, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        robot: the robot's name.
        command: the command line that repeats the missions.
    """
    names = list(dict.fromkeys(name for one in asked.manoeuvres for name in one.weights))
    return render(
        "ask",
        title=f"{robot}: what the robot asked",
        sentence=asked.sentence,
        verdict=discover_text.verdict(asked.finding),
        driven=asked.manoeuvres,
        weights=[
            (discover_text.explanation(name), [one.weights.get(name) for one in asked.manoeuvres]) for name in names
        ],
        sizes=[(effect.name, discover_text.sizes(effect.parameters)) for effect in asked.finding.effects],
        notes=asked.finding.notes,
        command=command,
    )
