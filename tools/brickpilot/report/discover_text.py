"""The sentences of discovery's page: names in plain English, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset
from brickpilot.data.facts import yaw_over_wheels
from brickpilot.data.gap import Gap
from brickpilot.discover import numbers
from brickpilot.discover.finding import NOMINAL_VALUES, Effect, Finding, Parameter
from brickpilot.fit.uncertainty import Combination
from brickpilot.report import discover_fit
from brickpilot.report.quantities import RUNS, Shown, ascii_text, gap_text, in_words, percent, quantity, say
from brickpilot.report.user_terms import shown_finding, told
from brickpilot.vehicle.replay import RUN_KINDS

OVER_NOISE = 1.1
"""A gap above this value, in multiples of the noise, is reported as remaining."""

_PLAUSIBLE = 1.3
"""Largest gap, in multiples of the noise, at which the page says that a calibrated model lacks nothing."""


def words(effect: str) -> str:
    """Returns words for an effect or for a value that differs between runs; the name, if the table has no words."""
    if effect == NOMINAL_VALUES:
        return "nominal values other than stated"
    if effect in RUN_KINDS:
        return f"{RUN_KINDS[effect].words[0].lower()}{RUN_KINDS[effect].words[1:]} that differs from run to run"
    known = catalogue.effects_of((effect,))
    return known[0].words if known else say(effect)


def explanation(names: str | Sequence[str]) -> str:
    """Returns effects in words, each followed by its name in parentheses.

    `names` is a sequence of names, or one text with names joined by " + "; an empty sequence: "nothing is missing".
    """
    chosen = names.split(" + ") if isinstance(names, str) else names
    if not chosen:
        return "nothing is missing"
    return " with ".join(words(name) if name == NOMINAL_VALUES else f"{words(name)} ({name})" for name in chosen)


def listed(items: Sequence[str], last: str = "and") -> str:
    """Returns "a, b and c"."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} {last} {items[-1]}" if items else ""


def either(rivals: Sequence[str]) -> str:
    """Returns rivals, whose names are joined by " + ", in words; an effect that all rivals share is named once."""
    names = [one.split(" + ") for one in rivals]
    shared = [name for name in names[0] if all(name in other for other in names)]
    if not shared:
        return listed([explanation(one) for one in names], "or")
    rests = [[name for name in one if name not in shared] for one in names]
    own = [f"with {explanation(one)}" if one else "alone" for one in rests]
    return f"{explanation(shared)}, {listed(own, 'or')}"


def gap_change(before: float | None, after: float | None) -> str:
    """Returns how a gap changes: "falls from 24.8 to 1.03 times the noise", or "is 1.03 times the noise"."""
    start, end = gap_text(before), gap_text(after)
    if before is None or after is None or start == end:
        return f"is {end} times the noise"
    return f"{'falls' if after < before else 'grows'} from {start} to {end} times the noise"


def sizes(parameters: Mapping[str, Parameter]) -> str:
    """Returns the values of an effect as a list; a single value has no name before it."""
    shown = {name: str(shown_parameter(one)) for name, one in parameters.items()}
    return next(iter(shown.values())) if len(shown) == 1 else listed([f"{say(k)} {v}" for k, v in shown.items()])


def shown_parameter(one: Parameter) -> Shown:
    """Returns a size with its interval: the parameter's value, or the combination that the data identify."""
    _, known = known_size("", one)
    return quantity(known.value, known.unit, known.ci95)


def known_size(name: str, one: Parameter) -> tuple[str, Parameter | Combination]:
    """Returns name and size of a parameter, or of the combination that the data identify: "torque, as voltage"."""
    if one.ci95 is None and one.identified is not None:
        return f"{name}, as {one.identified.name}", one.identified
    return name, one


def alternatives(finding: Finding) -> list[str]:
    """Returns every equivalent explanation, the best one first; " + " joins the names of an explanation."""
    rivals = [rival.name for one in finding.effects for rival in one.equivalents]
    asked = () if finding.next_experiment is None else finding.next_experiment.separates
    return list(dict.fromkeys([" + ".join(found_names(finding)), *(rivals or asked)]))


def found_names(finding: Finding) -> list[str]:
    """Returns the names of the best explanation's effects and of its values that differ between runs."""
    return [*(one.name for one in finding.effects), *(one.kind for one in finding.run_values)]


def one_mechanism(finding: Finding) -> str | None:
    """Returns the mechanism that all equivalent explanations share; None: they have several mechanisms."""
    weighed = {frozenset(one.effects): one.mechanisms for one in finding.explanations}
    of_effects = {one.name: one.mechanism for one in catalogue.effects()}
    of_names = of_effects | {kind: one.mechanism for kind, one in RUN_KINDS.items()}
    kinds: set[str] = set()
    for rival in alternatives(finding):
        names = rival.split(" + ")
        kinds.update(weighed.get(frozenset(names)) or [of_names.get(name, name) for name in names])
    return kinds.pop() if len(kinds) == 1 else None


def explanation_lines(finding: Finding) -> list[str]:
    """Returns the explanations that hold 95 % of the weight, for a terminal; empty if there is only one."""
    if len(finding.explanations) < 2:
        return []
    head = f"{'weight':>8}  explanations that hold 95 % of the weight"
    rows = [head]
    for one in finding.explanations:
        names = f"{' + '.join(one.effects)} ({', '.join(one.mechanisms)})" if one.effects else "no effect"
        rows.append(f"{ascii_text(percent(one.weight)):>8}  {names}")
    return rows


def left_predictable(finding: Finding) -> str:
    """Returns a sentence on the share of the remaining error that a black box predicts; empty: no share is known."""
    shares = finding.predictable_left
    if not shares:
        return ""
    parts = [f"{percent(share)} of {say(signal)}" for signal, share in shares.items()]
    return (
        f"Of the squared error that the best explanation leaves, a black box predicts {listed(parts)} on fit runs that "
        f"it has not seen. More than {percent(numbers.SHARED_REST)} says that something is missing."
    )


def verdict(finding: Finding) -> str:
    """Returns the verdict in a few sentences that are clear without the page."""
    by_run = "".join(f" {one.sentence()}" for one in finding.run_values)
    own = shown_finding(finding)
    apart = contradiction(finding.dataset) if finding.verdict in ("none", "unknown") else None
    first = f"{apart} " if apart else ""
    left = ""
    if own.law_differs:
        which = "a law is" if len(own.effects) > 1 else "the law is"
        left = f" What is left is more than noise: {which} not quite right, or something smaller is missing too."
    return told(finding.dataset, first + _verdict(own) + left + _moved_values(own)) + by_run


def contradiction(dataset: Dataset) -> str | None:
    """Returns a sentence on how far the measured yaw and the wheels' yaw contradict each other; None: no contradiction.

    A fit can hide a contradiction, because the fit may change the lengths within a ruler's error. If a larger sd
    of the lengths is stated, a larger difference is allowed.
    """
    ratio = yaw_over_wheels(dataset)
    lengths = [dataset.nominal[name] for name in ("wheel_radius", "half_track") if name in dataset.nominal]
    shares = [(one.sd or 0.0) / one.value for one in lengths]
    # A length that is stated without an sd gets the sd of a ruler.
    limit = max(numbers.RULER, 2 * math.hypot(*(one for one in shares if one > 1.01 * numbers.RULER)))
    if ratio is None or (ratio.low <= 1 + limit and ratio.high >= 1 - limit):
        return None
    size, *ends = (abs(one - 1) for one in (ratio.size, ratio.low, ratio.high))
    text, interval = in_words(size, "1", (min(ends), max(ends)))
    gyro = "the gyro" if "yaw_rate" in dataset.signals else "yaw_angle"
    return (
        f"These data contradict themselves: {gyro} turns {text} {'more' if ratio.size > 1 else 'less'} than the wheels "
        f"do{interval}. Its scale, the counts a turn, wheel_radius or half_track is wrong by as much, and the logs "
        "cannot tell which."
    )


def leaves_more_than_noise(finding: Finding) -> bool:
    """Returns whether the gap on the runs that prove the verdict is clearly above the noise."""
    after = _proof(finding)[1].after
    return after is not None and after > _PLAUSIBLE


def _moved_values(finding: Finding) -> str:
    """Returns a sentence on fitted nominal values that disagree with the stated values; empty: all values agree."""
    moved = [
        f"{say(one.parameter)} ({quantity(one.fitted, one.unit)} instead of {quantity(one.stated, one.unit)}, "
        f"{one.sd_away:.0f} standard deviations away)"
        for one in finding.nominal_findings
    ]
    if not moved:
        return ""
    known = alternatives(finding) if finding.effects else []
    names = dict.fromkeys(name for one in finding.nominal_findings for name in one.rivals if name not in known)
    rivals = [explanation(name) for name in names]
    hidden = f" Or they hide an effect: {listed(rivals, 'or')}." if rivals else ""
    return f" The data do not fit what is stated of {listed(moved)}.{hidden}"


def _verdict(finding: Finding) -> str:
    if finding.verdict == "none":
        return _none(finding)
    if finding.verdict == "unknown":
        return _unknown(finding)
    if finding.verdict == "ambiguous":
        return _ambiguous(finding)
    if not finding.effects:
        kinds = listed([explanation(one.kind) for one in finding.run_values])
        return f"What the simulator does not know is {kinds}. Without it, {_proved_change(finding)}."
    many = len(finding.effects) > 1
    count = f"{_number_word(len(finding.effects))} effects: " if many else ""
    named = _with_sizes(finding.effects)
    return f"The simulator lacks {count}{named}. With {'them' if many else 'it'}, {_proved_change(finding)}."


def _none(finding: Finding) -> str:
    role, gap = _proof(finding)
    if gap.after is None:
        return "These data show no missing effect."
    fit = discover_fit.headline(finding)
    if fit is not None:
        size = discover_fit.change(fit)
    else:
        size = f"the gap of the calibrated model on the {RUNS[role]} is {gap_text(gap.after)} times the noise"
    if leaves_more_than_noise(finding):
        return f"No effect is named: {size}, but no effect that was tried explains enough of the error to be credible."
    return f"These data show no missing effect: {size}{', and noise alone would give 1' if fit is None else ''}."


def _ambiguous(finding: Finding) -> str:
    rivals = alternatives(finding)
    kind = one_mechanism(finding)
    place = "An effect is missing" if kind is None else f"The cause is in the {kind}"
    if NOMINAL_VALUES in rivals:
        place = "An effect is missing, or what is stated is wrong"
    open_between = f"these data do not decide between {_number_word(len(rivals))} explanations"
    sentence = f"{place}, and {open_between}: {either(rivals)}. With the first of them, {_proved_change(finding)}."
    return sentence + (f" {finding.next_experiment.advice}" if finding.next_experiment else "")


def _unknown(finding: Finding) -> str:
    found = _with_sizes([one for one in finding.effects if one.claimed])
    sentence = "Something is missing, and no effect of the library explains it."
    if unclaimed := [one for one in finding.effects if not one.claimed]:
        sentence = _suspected(finding, unclaimed)
    elif found:
        sentence = f"The simulator lacks {found}. Something else is missing too, and no effect of the library fits it."
    if finding.term is None:
        change = _proved_change(finding)
        return f"{sentence} With the named effects, {change}." if found else f"{sentence} {change.capitalize()}."
    equation = finding.term.equation.partition(". ")[0]  # the page explains the symbols of the equation further down
    role, _ = _proof(finding)
    does = "is added"
    if role == "held_out" and finding.term.removed_held_out is not None:
        does = f"explains {percent(finding.term.removed_held_out)} of the gap above the noise on the {RUNS[role]}"
    return f"{sentence} A composed term, {equation}, {does}. With it, {_proved_change(finding)}."


def _suspected(finding: Finding, unclaimed: Sequence[Effect]) -> str:
    """Returns sentences on the effects that explain the fit runs best, and on why these effects are not proved."""
    names = listed([explanation(one.name) for one in unclaimed])
    return (
        f"Something is missing, most likely in the {finding.mechanism}. On the fit runs, {names} "
        f"{'go' if len(unclaimed) > 1 else 'goes'} {percent(unclaimed[0].removed)} of the way to noise. "
        f"{why_unclaimed(finding)}"
    )


def why_unclaimed(finding: Finding) -> str:
    """Returns a sentence on why the effects of the best explanation are not proved."""
    if finding.term is not None:
        return "A term without a name explains more."
    if finding.evidence is not None and finding.evidence.kind == "fitted_only":
        return finding.evidence.sentence
    if finding.budget is not None and finding.budget.exhausted:
        return "The time was too short to compare all explanations."
    left = finding.predictable_left or {}
    signal = max(left, key=lambda name: left[name], default=None)
    if signal is not None and left[signal] > numbers.SHARED_REST:
        return f"A black box still predicts {percent(left[signal])} of what is left of {say(signal)}."
    return "The measured samples do not show this for certain, or too much other error is left."


def _with_sizes(effects: Sequence[Effect]) -> str:
    """Returns a list of effects with their parameters; semicolons separate effects, and commas separate parameters."""
    parts = [f"{explanation(one.name)}, {sizes(one.parameters)}" for one in effects]
    return f"{'; '.join(parts[:-1])}; and {parts[-1]}" if len(parts) > 1 else "".join(parts)


def _proof(finding: Finding) -> tuple[str, Gap]:
    """Returns the role of the runs whose gap the verdict states, "held_out" or else "fit", and this gap."""
    held_out = finding.gap.get("held_out")
    if held_out is not None and held_out.after is not None:
        return "held_out", held_out
    return "fit", finding.gap.get("fit", Gap(None, None))


def _proved_change(finding: Finding) -> str:
    """Returns how the fit changes on the runs that prove the verdict; if no fit was measured, how the gap changes."""
    fit = discover_fit.headline(finding)
    role, gap = _proof(finding)
    if fit is not None:
        role, changed = fit.role, discover_fit.change(fit)
    elif gap.after is None:
        return "the gap could not be measured"
    else:
        changed = f"the gap on the {RUNS[role]} {gap_change(gap.before, gap.after)}"
    return changed if role == "held_out" else f"{changed}, and no held-out run confirms it"


def _number_word(count: int) -> str:
    return {2: "two", 3: "three", 4: "four", 5: "five"}.get(count, str(count))
