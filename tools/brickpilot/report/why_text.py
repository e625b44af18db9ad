"""The answer of `brickpilot why`: what is wrong, how certain the cause is, and what to do, in a few sentences."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brickpilot import catalogue
from brickpilot.data.facts import WeakerSide, bend, drives_straight_alone, weaker_side
from brickpilot.data.holdout import kind_of
from brickpilot.discover.finding import Finding
from brickpilot.report import discover_fit, experiment_files
from brickpilot.report.discover_text import (
    alternatives,
    contradiction,
    either,
    explanation,
    found_names,
    leaves_more_than_noise,
    listed,
    one_mechanism,
    sizes,
    why_unclaimed,
    words,
)
from brickpilot.report.quantities import fit_text, in_words, percent, quantity
from brickpilot.report.user_terms import clauses, shown_finding, told
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.drive_constants import drives
from brickpilot.vehicle.manoeuvres import Manoeuvre, commands
from brickpilot.vehicle.model import Model

Ending = Literal["nothing", "cause", "missing", "contradiction"]

_ALL = 99.0  # fit in percent: from this value on, no error is left to explain
_OF_WHEELS = 0.5  # unequal wheel angles are the cause if they give more than this share of the path's curvature
_WORSE = 0.05  # percentage points of fit: an explanation that lowers the fit by more does not explain whole runs
_VEERS = math.radians(1.0)  # rad/m: a smaller curvature is hardly visible
_DIFFERS = 0.03  # share of a speed or a distance: a smaller difference is hardly visible
_GRID_S = 0.05  # s: time step at which a manoeuvre is examined
_STATED = 4  # number of effects whose smallest visible size is stated


@dataclass(frozen=True)
class Answer:
    """The answer to the question why a robot differs from its simulation.

    Attributes:
        ending: "nothing": nothing is wrong; "cause": a cause is known; "missing": no known cause explains all, and
            `todo` begins with what to drive next; "contradiction": the data contradict each other.
        what, sure: sentences on what is wrong, and on how certain this is.
        todo: what to do, the first thing first.
        symptoms: one sentence for each difference in driving between the augmented model and the model as stated.
        next: the manoeuvre to drive next; None: no manoeuvre is needed.
    """

    ending: Ending
    what: str
    sure: str
    todo: tuple[str, ...]
    symptoms: tuple[str, ...]
    next: Manoeuvre | None = None


def answer(
    finding: Finding, undone: Compensation | None, mend: str = "", advised: Callable[[], Sequence[Manoeuvre]] = tuple
) -> Answer:
    """Returns the answer that a finding gives; a wrong wiring comes first, because all other results depend on it.

    Args:
        undone: the compensation that was made from the finding; None: the firmware cannot compensate it.
        mend: the options of `brickpilot import` that correct a wrong wiring.
        advised: returns the most informative manoeuvres; it is called only if the finding asks for no manoeuvre.
    """
    ending, what = _what(finding)
    apart = contradiction(finding.dataset) if ending == "nothing" else None
    if apart is not None:
        ending, what = "contradiction", apart
    is_straight = drives_straight_alone(finding.dataset)
    straight = is_straight and ending != "nothing"
    names = {name for rival in alternatives(finding) for name in rival.split(" + ")}
    of_sides = any(info.over_mean for effect in catalogue.effects_of(names) for info in effect.parameters)
    is_sided = straight or (ending == "missing" and finding.verdict == "ambiguous" and of_sides)
    sided = _sided(finding) if is_sided else None
    if sided is not None:
        which = sided.which if straight else f"The logs cannot tell which it is: {_either(finding)}."
        ending, what = "missing", f"{sided.what} {which}"
    elif straight and finding.verdict == "named" and ending == "cause":
        ending = "missing"
        alike = "friction, motors, the battery, slip and the gyro look much alike in them"
        what = f"Something is missing, and straight runs cannot tell what: {alike}."
    asked = None if ending == "nothing" or apart is not None else finding.next_experiment
    manoeuvre = None if asked is None else asked.manoeuvre
    if manoeuvre is None and (ending == "missing" or (is_straight and ending == "nothing")):
        offers = advised()
        turning = (
            one
            for one in offers
            if is_straight and kind_of(commands(one, np.arange(0.0, one.duration_s, _GRID_S))) != "straight"
        )
        manoeuvre = next(turning, offers[0] if offers and ending == "missing" else None)
    todo = [*_drive(finding, manoeuvre, ending), *_todo(finding, undone, ending)]
    if apart is not None:
        todo = [
            "Turn the robot by a known angle, such as ten full turns: that tells the gyro's scale.",
            "Roll it straight along a measured way, too: that tells how far it goes in one count.",
        ]
    if wiring := finding.dataset.wiring:
        mended = all(one.is_mended for one in wiring)
        said = " ".join([*(one.sentence for one in wiring), *([f"To state it right: {mend}."] if mend else [])])
        without = "Without it" if all(one.kind == "frozen" for one in wiring) else "With that mended"
        what = f"{said} {without}: {what}" if mended else f"These data contradict themselves: {said}"
        ending = "cause" if mended else "contradiction"
        todo = ["Mend the wiring, or state the log otherwise. If all is wired as stated, say --as-wired.", *todo]
    sure, symptoms = _sure(finding, ending), _symptoms(finding)
    if sided is not None:
        sure = "The wheels themselves show it, without a model."
        symptoms = [f"It turns to the {sided.to} when it is to drive straight."]
    elif apart is not None:
        sure, symptoms = "The gyro and the wheels themselves show it, without a model.", []
    data = finding.dataset
    return Answer(
        ending, told(data, what), told(data, sure), told(data, tuple(todo)), told(data, tuple(symptoms)), manoeuvre
    )


@dataclass(frozen=True)
class _Sided:
    """How the left and the right side move differently under equal commands.

    Attributes:
        what: how the sides move, as a sentence.
        which: the causes that remain possible, as a sentence.
        to: the side to which the robot turns.
    """

    what: str
    which: str
    to: str


def _sided(finding: Finding) -> _Sided | None:
    """Returns how the sides differ in runs under equal commands, by measured signals alone; None: no difference."""
    weaker, bent, known = weaker_side(finding.dataset), None, finding.augmented.parameters
    track = 2 * known["half_track"]
    if weaker is not None and weaker.share < _VEERS * track:
        weaker = None
    if "wheel_radius" in known:
        bent = bend(finding.dataset, known["wheel_radius"])
    motor = "Straight runs cannot tell whether its motor, its drive, friction or a wheel's radius is the cause."
    if bent is None or abs(bent.size) < _VEERS:
        return None if weaker is None else _Sided(f"{_side(weaker)}.", motor, weaker.side)
    to = "right" if bent.size > 0 else "left"
    ends = sorted(abs(math.degrees(one)) for one in (bent.low, bent.high))
    bends = f"the path bends {abs(math.degrees(bent.size)):.1f}° a metre to the {to} ({ends[0]:.1f} to {ends[1]:.1f}°)"
    share = abs(bent.size) * track
    if weaker is not None and weaker.side == to and weaker.share > _OF_WHEELS * share:
        return _Sided(f"{_side(weaker)}, and {bends}.", motor, to)
    alike = "alike" if weaker is None else f"alike but for {in_words(weaker.share, '1')[0]}"
    seen = f"Under equal commands {bends}, and the wheels turn {alike}: the {to} wheel goes {percent(share)} less far."
    rest = "Straight runs cannot tell whether a wheel's radius, a motor, slip or the gyro is the cause."
    return _Sided(seen, rest, to)


def _side(one: WeakerSide) -> str:
    size, interval = in_words(one.share, "1", (one.low, one.high))
    other = "right" if one.side == "left" else "left"
    return (
        f"The {one.side} side is {size} weaker than the {other}{interval}: under equal commands its wheel turns that "
        "much less"
    )


def _either(finding: Finding) -> str:
    """Returns the explanations that the data allow, each as a clause on its values, or in words if it has no clause."""
    rivals = {one.name: one.parameters for effect in finding.effects for one in effect.equivalents}
    if len(finding.effects) == 1:
        rivals[finding.effects[0].name] = finding.effects[0].parameters
    meant = {name: clauses(finding.dataset, name, values) for name, values in rivals.items() if " + " not in name}
    known = alternatives(finding)
    if not meant.keys() & {*known}:
        return either(known)
    return listed([listed(meant.get(one, [])) or explanation(one) for one in known], "or")


def _what(finding: Finding) -> tuple[Ending, str]:
    fit = discover_fit.headline(finding)
    if finding.verdict == "none" and finding.nominal_findings:
        moved = [
            f"{one.parameter} is {quantity(one.fitted, one.unit)}, and {quantity(one.stated, one.unit)} is stated"
            for one in finding.nominal_findings
        ]
        return "cause", f"What is stated is wrong: {listed(moved)}."
    if finding.verdict == "none":
        if leaves_more_than_noise(finding) and (fit is None or min(fit.before, fit.after) < _ALL):
            size = "a part" if fit is None else f"{fit_text(fit.after)} of the measured signals on the {fit.runs}"
            return "missing", f"Something is missing: the simulation explains {size}; no known cause explains the rest."
        does = "the simulation does what the robot does"
        if fit is not None and leaves_more_than_noise(finding):
            does = f"the simulation explains {fit_text(fit.after)} of the signals on the {fit.runs}"
        where = " as far as straight runs show" if drives_straight_alone(finding.dataset) else ""
        return "nothing", f"Nothing is wrong{where}: {does}. {_visible(finding)}".rstrip()
    if finding.verdict == "named":
        if fit is not None and fit.after < fit.before - _WORSE:
            best = listed([explanation(one) for one in found_names(finding)])
            return "missing", f"Something is missing: {best} would explain the most, but not whole runs."
        return "cause", _cause(finding)
    if finding.verdict == "ambiguous":
        kind = one_mechanism(finding)
        where = "Something is missing" if kind is None else f"Something is missing in the {kind}"
        return "missing", f"{where}, and the logs cannot tell which it is: {_either(finding)}."
    if finding.mechanism is None:
        return "missing", "Something is missing: robot and simulation differ, and no log shows in which part."
    likely = f", most likely {listed([explanation(one) for one in found_names(finding)])}" if finding.effects else ""
    return "missing", f"Something is missing in the {finding.mechanism}{likely}."


def _cause(finding: Finding) -> str:
    """Returns the named effects as clauses on their values, or as words and sizes if the table has no clause."""
    said, named = [], []
    for one, shown in zip(finding.effects, shown_finding(finding).effects, strict=True):
        meant = clauses(finding.dataset, one.name, one.parameters)
        if meant:
            said.append(f"{listed(meant)} ({one.name})")
        else:
            named.append(f"{explanation(one.name)}, {sizes(shown.parameters)}")
    named += [explanation(one.kind) for one in finding.run_values]
    parts = [*([f"the robot has {'; '.join(named)}"] if named else []), *said]
    text = listed(parts) if len(parts) < 3 else f"{'; '.join(parts[:-1])}; and {parts[-1]}"
    return f"{text[0].upper()}{text[1:]}. The simulation does not know it."


def _visible(finding: Finding) -> str:
    """Returns a sentence on the smallest visible sizes of a few common effects, one for each mechanism."""
    common = {one.mechanism: one for one in catalogue.effects_of(finding.power) if one.prior == "common"}
    power, parts = shown_finding(finding).power, []
    for effect in list(common.values())[:_STATED]:
        least = power[effect.name]
        parts.append(f"{effect.words} from {in_words(least.size, least.unit)[0]} on")
    return f"These data would have shown {listed(parts, 'or')}." if parts else ""


def _sure(finding: Finding, ending: Ending) -> str:
    """Returns sentences on what proves the finding, and on the share of the error that the finding removes."""
    found = finding.verdict != "none" and ending != "nothing"
    parts = [_proof(finding)] if found else []
    if (fit := discover_fit.headline(finding)) is not None:
        text = discover_fit.change(fit)
        parts.append(f"{text[0].upper()}{text[1:]}.")
    known = finding.yardstick.predictable.get("free_run")
    removed = None if known is None else known.removed if known.removed_held_out is None else known.removed_held_out
    added = any(one.claimed for one in finding.effects) or finding.term is not None
    if removed is not None and found and added:
        parts.append(f"The finding removes {percent(max(removed, 0.0))} of the error that can be predicted at all.")
    if found and (guesses := finding.dataset.guesses):
        parts.append(f"Not confirmed: nobody stated {listed(guesses)}.")
    return " ".join(parts)


def _proof(finding: Finding) -> str:
    """Returns what proves the explanation, or why it is not proved."""
    if finding.verdict != "unknown" and finding.evidence is not None:
        if finding.dataset.guesses and finding.evidence.kind == "held_out" and not finding.evidence.contradicted:
            return "Held-out runs agree."
        return finding.evidence.sentence
    if finding.budget is not None and finding.budget.exhausted:
        return "Not proved: the time was too short to compare all explanations."
    if finding.term is not None:
        return "No name is proved: a term without a name explains more."
    if finding.evidence is not None and finding.evidence.kind == "fitted_only":
        return f"Not proved. {finding.evidence.sentence}"
    return f"No explanation is proved. {why_unclaimed(finding)}" if finding.effects else "No explanation is proved."


def _drive(finding: Finding, manoeuvre: Manoeuvre | None, ending: Ending) -> list[str]:
    """Returns the sentence on what to drive next; empty if no manoeuvre is asked for."""
    asked = None if ending == "nothing" else finding.next_experiment
    if manoeuvre is None:
        if asked is not None:
            return [asked.advice]
        return ["Measure more signals: no manoeuvre would tell much more."] if ending == "missing" else []
    file = next(iter(reversed(experiment_files.files_of(manoeuvre, finding.dataset.vehicle))))
    if asked is not None and asked.manoeuvre is manoeuvre:
        return [f"{asked.advice} {file} has it."]
    return [f'Drive "{manoeuvre.name}" next, {manoeuvre.duration_s:g} s: {file} has it. Then ask why of both logs.']


def _todo(finding: Finding, undone: Compensation | None, ending: Ending) -> list[str]:
    found = []
    if finding.verdict in ("named", "ambiguous") or any(one.claimed for one in finding.effects):
        found += [
            catalogue.advice(one.name, {name: p.value for name, p in one.parameters.items()}) for one in finding.effects
        ]
        for rival in (rival for one in finding.effects for rival in one.equivalents):
            found += [f"If it is {words(one.name)}: {one.advice}" for one in catalogue.effects_of((rival.name,))]
    for one in finding.nominal_findings:
        stated, fitted = quantity(one.stated, one.unit), quantity(one.fitted, one.unit)
        found.append(f"Measure {one.parameter} again: {stated} is stated, and the logs fit {fitted}.")
    if ending == "cause" and undone is not None and undone.undone:
        found.append(f"Or let the firmware undo it: compensation.toml does so for {listed(undone.undone)}.")
    if ending == "nothing" and drives_straight_alone(finding.dataset):
        found.append("What shows in turns alone, such as the gyro's scale or slip, was not tested.")
    elif ending == "nothing":
        found.append("Nothing needs to be done.")
    found += _lengths(finding)
    return found or ["Nothing. Drive more manoeuvres if you still doubt it: `brickpilot check` says which."]


def _lengths(finding: Finding) -> list[str]:
    """Returns a line on lengths that the user did not state; empty: all are stated, or the vehicle is a motor."""
    known, used = finding.dataset.nominal, finding.augmented.parameters
    missing = [name for name in ("wheel_radius", "half_track") if name not in known]
    if finding.dataset.vehicle == "motor" or not missing:
        return []
    values = listed([f"{name} of {quantity(used[name], 'm')}" for name in missing])
    options = " ".join(f"--nominal {name}=METRES" for name in missing)
    return [f"State {options}: the lengths here rest on a {values}, which nobody measured."]


def _symptoms(finding: Finding) -> list[str]:
    """Returns sentences on how the augmented model and the model without the finding differ in straight drives."""
    robot, simulation = drives(finding.augmented), drives(as_stated(finding))
    unit = "m" if finding.dataset.vehicle != "motor" or finding.augmented.parameters.get("wheel_radius") else "rad"
    symptoms = []
    if robot.veer is not None and simulation.veer is not None and abs(robot.veer - simulation.veer) >= _VEERS:
        bend = f"{abs(math.degrees(robot.veer)):.1f}° a metre to the {'right' if robot.veer > 0 else 'left'}"
        symptoms.append(f"It does not drive straight: it turns {bend}.")
    if simulation.top_speed > 0 and abs(robot.top_speed / simulation.top_speed - 1) >= _DIFFERS:
        verb = "weaker" if robot.top_speed < simulation.top_speed else "stronger"
        speeds = [quantity(one.top_speed, f"{unit}/s") for one in (robot, simulation)]
        symptoms.append(f"It is {verb} than the simulation: {speeds[0]} instead of {speeds[1]} at full power.")
    longest = max(robot.stop, simulation.stop)
    if longest > 0 and abs(robot.stop - simulation.stop) >= _DIFFERS * longest:
        ways = [quantity(one.stop, unit) for one in (robot, simulation)]
        early = "short" if robot.stop < simulation.stop else "late"
        symptoms.append(f"It stops {early}: after {ways[0]} instead of {ways[1]} from full power.")
    return symptoms


def as_stated(finding: Finding) -> Model:
    """Returns the model without the effects that were added, and with the nominal values as stated."""
    stated = {name: one.before for name, one in finding.nominal.items()}
    return dataclasses.replace(
        finding.augmented,
        parameters={**finding.augmented.parameters, **stated},
        effects=finding.nominal_model.effects,
    )


def lines(found: Answer, notes: Sequence[str], guesses: Sequence[str], *, verbose: bool = False) -> list[str]:
    """Returns the answer for a terminal: what is wrong, how sure this is and what to do first, then the notes.

    Args:
        notes: sentences on how the log was read.
        guesses: the guesses in `Dataset.guesses`.
        verbose: whether all actions, symptoms and notes are included; if not, there are at most four lines.
    """
    short = [f"what is wrong: {found.what}", f"how sure:      {found.sure}", f"what to do:    {found.todo[0]}"]
    if verbose:
        steps = [f"               {one}" for one in found.todo[1:]]
        return [
            *short,
            *steps,
            *(f"so:            {one}" for one in found.symptoms),
            *(f"note: {one}" for one in notes),
        ]
    loud = f"{listed(guesses)} {'are guesses' if len(guesses) > 1 else 'is a guess'}; " if guesses else ""
    more = len(notes) + len(found.todo[1:]) + len(found.symptoms)
    return [*short, *([f"note: {loud}{more} more lines stand on the page, or come with --verbose"] if more else [])]
