"""The answer of `brickpilot why`: what is wrong, how sure that is, and what to do, each in a sentence or two."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from brickpilot.discover.finding import Finding
from brickpilot.report import discover_fit
from brickpilot.report.discover_text import (
    alternatives,
    explanation,
    found_names,
    leaves_more_than_noise,
    listed,
    one_mechanism,
    why_unclaimed,
)
from brickpilot.report.own_words import told
from brickpilot.report.quantities import fit_text, percent, quantity
from brickpilot.vehicle.compensation import NOMINAL, Compensation
from brickpilot.vehicle.drive_constants import Drives, drives
from brickpilot.vehicle.model import Model

_REMEDIES = {
    "supply": "Charge or replace the battery and shorten thin leads, or log its voltage for the simulation.",
    "drive": "Look at the motor driver: its dead band, its PWM frequency, and whether it brakes or floats at zero.",
    "timing": "Measure the time from a command to its effect, and send commands at a steady rate.",
    "motor": "Run the motors one by one without load and compare them: a warm or a worn one is weaker.",
    "gear": "Feel for play and tight spots in the gears.",
    "bearing": "Turn each wheel by hand. Clean and grease the axles, and look for a part that rubs.",
    "tyre": "Compare the radii of both wheels, clean tyres and floor, and try to accelerate and turn less hard.",
    "body": "Look at casters and cables, and at where the heavy parts sit.",
    "floor": "Level the floor, or drive each manoeuvre both ways over it.",
    "sensor": "Calibrate the sensor: at rest for its bias, over a known way or angle for its scale.",
}
"""Mechanism -> what a person can do to the machine."""

_OF_A_MOTOR = {
    "motor": "Run the motor without its load, cold and warm: a warm or a worn one is weaker.",
    "bearing": "Turn the shaft by hand. Clean and grease its bearings, and look for a part that rubs.",
    "body": "Look at cables, and at what the load drags along.",
    "floor": "Level the bench, or run each manoeuvre both ways.",
    "sensor": "Calibrate the sensor: at rest for its offset, over a known way or angle for its scale.",
}
"""The same for a motor and its load."""

_ALL = 99.0  # % of the signals: what is left is no complaint
_VEERS = math.radians(1.0)  # rad/m: less is hardly seen
_DIFFERS = 0.03  # of a speed or a way: less is hardly seen


@dataclass(frozen=True)
class Answer:
    """What a person who asked "why" wants to know.

    Attributes:
        what, sure: sentences.
        todo: what to do, the first thing first.
        symptoms: how the robot drives against how the simulation without the finding does, one sentence each.
    """

    what: str
    sure: str
    todo: tuple[str, ...]
    symptoms: tuple[str, ...]


def answer(finding: Finding, undone: Compensation | None, mend: str = "") -> Answer:
    """Returns the answer that a finding gives: a wrong wiring first, as all else rests on it.

    Args:
        undone: the compensation that was made of it; None: the firmware can undo nothing.
        mend: the options of `import` that mend a wrong wiring.
    """
    what, todo = _what(finding), _todo(finding, undone)
    if wiring := finding.dataset.wiring:
        mended = all(one.is_mended for one in wiring)
        after = "With that mended" if mended else "What follows rests on data that contradict themselves"
        what = f"{' '.join(one.sentence for one in wiring)} {after}: {what[0].lower()}{what[1:]}"
        first = "Mend the wiring, or state the log otherwise"
        todo = [f"{first}: {mend}." if mend else f"{first}.", *todo]
    found = Answer(what, _sure(finding), tuple(todo), tuple(_symptoms(finding)))
    return Answer(**{name: told(finding.dataset, value) for name, value in vars(found).items()})


def _what(finding: Finding) -> str:
    names = [explanation(one) for one in found_names(finding)]
    if finding.verdict == "none" and leaves_more_than_noise(finding):
        fit = discover_fit.headline(finding)
        if fit is not None and _is_all(finding):
            return f"Nothing is wrong: the simulation explains {fit_text(fit.after)} of the signals on {fit.runs}."
        size = "a part" if fit is None else f"{fit_text(fit.after)} of the measured signals on {fit.runs}"
        return f"The simulation explains {size}, and no cause was found for the rest."
    if finding.verdict == "none":
        return "Nothing is wrong that these logs would show: the simulation does what the robot does."
    if finding.verdict == "named":
        return f"The robot has {listed(names)}, and the simulation has not."
    if finding.verdict == "ambiguous":
        either = listed([explanation(one) for one in alternatives(finding)], "or")
        if (kind := one_mechanism(finding)) is not None:
            return f"It is in the {kind}, and the logs cannot tell which of these the robot has: {either}."
        return f"The robot has one of these, and the logs cannot tell which: {either}."
    if finding.mechanism is None:
        return "The robot does something that the simulation does not, and the logs do not say in which part."
    likely = f", most likely {listed(names)}" if names else ""
    return f"The robot does something that the simulation does not. It is in the {finding.mechanism}{likely}."


def _is_all(finding: Finding) -> bool:
    """Whether the simulation explains the signals so far that nobody would ask why."""
    fit = discover_fit.headline(finding)
    return fit is not None and fit.after is not None and fit.after >= _ALL


def _sure(finding: Finding) -> str:
    """Returns what proves the finding, and how much of the error it takes away."""
    parts = [_proof(finding)] if finding.verdict != "none" else []
    if (fit := discover_fit.headline(finding)) is not None:
        text = discover_fit.change(fit)
        parts.append(f"{text[0].upper()}{text[1:]}.")
    known = finding.yardstick.predictable.get("free_run")
    removed = None if known is None else known.removed if known.removed_held_out is None else known.removed_held_out
    added = any(one.claimed for one in finding.effects) or finding.term is not None
    if removed is not None and finding.verdict != "none" and added:
        parts.append(f"With it mended, {percent(max(removed, 0.0))} of the error that can be predicted at all is gone.")
    return " ".join(parts)


def _proof(finding: Finding) -> str:
    """Returns what proves the explanation, or why it is not proved."""
    if finding.verdict != "unknown" and finding.evidence is not None:
        return finding.evidence.sentence
    if finding.budget is not None and finding.budget.exhausted:
        return "Not proved: the time was too short to compare all explanations."
    if finding.term is not None:
        return "No name is proved: a term without a name explains more."
    if finding.evidence is not None and finding.evidence.kind == "fitted_only":
        return f"Not proved. {finding.evidence.sentence}"
    return f"No explanation is proved. {why_unclaimed(finding)}" if finding.effects else "No explanation is proved."


def _todo(finding: Finding, undone: Compensation | None) -> list[str]:
    found = []
    if finding.verdict != "none":
        shown = [finding.mechanism, *(one.mechanism for one in finding.effects)]
        remedies = _REMEDIES | (_OF_A_MOTOR if finding.dataset.vehicle == "motor" else {})
        found += [remedies[kind] for kind in dict.fromkeys(shown) if kind in remedies]
    for one in finding.nominal_findings:
        stated, fitted = quantity(one.stated, one.unit), quantity(one.fitted, one.unit)
        found.append(f"Measure {one.parameter} again: {stated} is stated, and the logs fit {fitted}.")
    if undone is not None and undone.undone:
        found.append(f"Or let the firmware undo it: compensation.toml does so for {listed(undone.undone)}.")
    elif (
        finding.verdict != "none"
        and undone is not None
        and any(NOMINAL in sources for sources in undone.sources.values())
    ):
        found.append("The firmware believes in the packaged robot: compensation.toml tells it of this one.")
    if finding.next_experiment is not None:
        found.append(finding.next_experiment.advice)
    found += _lengths(finding)
    if not found and leaves_more_than_noise(finding) and not _is_all(finding):
        return ["Drive more manoeuvres, or measure more signals: `brickpilot check` says which manoeuvres tell more."]
    return found or ["Nothing. Drive more manoeuvres if you still doubt it: `brickpilot check` says which."]


def _lengths(finding: Finding) -> list[str]:
    """Returns a line on lengths that nobody stated; empty: all are stated, or it is a motor."""
    known, used = finding.dataset.nominal, finding.augmented.parameters
    missing = [name for name in ("wheel_radius", "half_track") if name not in known]
    if finding.dataset.vehicle != "diff_drive" or not missing:
        return []
    values = listed([f"{name} of {quantity(used[name], 'm')}" for name in missing])
    options = " ".join(f"--nominal {name}=METRES" for name in missing)
    return [f"State {options}: the lengths here rest on a {values}, which nobody measured."]


def _symptoms(finding: Finding) -> list[str]:
    """Returns how the augmented model drives straight at full power, where it does not without what was found."""
    robot, simulation = drives(finding.augmented), drives(as_stated(finding))
    unit = "m" if finding.dataset.vehicle == "diff_drive" or finding.augmented.parameters.get("wheel_radius") else "rad"
    return [*_veering(robot, simulation), *_weakness(robot, simulation, unit), *_stopping(robot, simulation, unit)]


def as_stated(finding: Finding) -> Model:
    """Returns the model without the effects that were added, and with the nominal values as stated."""
    stated = {name: one.before for name, one in finding.nominal.items()}
    return dataclasses.replace(
        finding.augmented,
        parameters={**finding.augmented.parameters, **stated},
        effects=finding.nominal_model.effects,
    )


def _veering(robot: Drives, simulation: Drives) -> list[str]:
    if robot.veer is None or simulation.veer is None or abs(robot.veer - simulation.veer) < _VEERS:
        return []
    side = "right" if robot.veer > 0 else "left"
    return [f"It does not drive straight: it turns {abs(math.degrees(robot.veer)):.1f}° a metre to the {side}."]


def _weakness(robot: Drives, simulation: Drives, unit: str) -> list[str]:
    if simulation.top_speed <= 0 or abs(robot.top_speed / simulation.top_speed - 1) < _DIFFERS:
        return []
    slower = robot.top_speed < simulation.top_speed
    speeds = f"{quantity(robot.top_speed, unit + '/s')} instead of {quantity(simulation.top_speed, unit + '/s')}"
    return [f"It is {'weaker' if slower else 'stronger'} than the simulation: {speeds} at full power."]


def _stopping(robot: Drives, simulation: Drives, unit: str) -> list[str]:
    longest = max(robot.stop, simulation.stop)
    if longest <= 0 or abs(robot.stop - simulation.stop) < _DIFFERS * longest:
        return []
    ways = f"{quantity(robot.stop, unit)} instead of {quantity(simulation.stop, unit)}"
    return [f"It stops {'short' if robot.stop < simulation.stop else 'late'}: after {ways} from full power."]


def lines(found: Answer) -> Sequence[str]:
    """Returns the answer for a terminal: what is wrong, how sure that is and what to do first, then the rest."""
    return [
        f"what is wrong: {found.what}",
        f"how sure:      {found.sure}",
        f"what to do:    {found.todo[0]}",
        *(f"               {one}" for one in found.todo[1:]),
        *(f"so:            {one}" for one in found.symptoms),
    ]
