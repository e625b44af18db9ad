"""The answer of `brickpilot changed`, as text and as a page.

The answer says what changed, how certain the change is, since when, how well the old model fits, and what to do.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from brickpilot.changed.change import Change, Changed, Trace, subject
from brickpilot.changed.what_changed import BEFORE
from brickpilot.data.signals import SIGNALS
from brickpilot.report.discover_text import listed
from brickpilot.report.plot import Simulated, points_for, superimposed
from brickpilot.report.quantities import ascii_text, fit_text, percent, quantity, say
from brickpilot.report.template import render
from brickpilot.report.user_terms import told

_NOTHING = "No change is larger than the usual difference between two recordings of the same state."
_NO_NEED = (
    "An explanation without a difference between the recordings predicts as well as any other explanation. The "
    "predicted stretches were not used in the fit."
)
_UNKNOWN = "Something is different, and no known change explains it."


@dataclass(frozen=True)
class Said:
    """The sentences on one later recording.

    Attributes:
        todo: what to do, the first thing first.
    """

    recording: str
    what: str
    sure: str
    todo: tuple[str, ...]


def said(found: Changed) -> list[Said]:
    """Returns the sentences on each later recording, in words that suit the vehicle."""
    return [Said(name, *told(found.dataset, _sentences(found, name))) for name in found.after]


def _sentences(found: Changed, name: str) -> tuple[str, str, tuple[str, ...]]:
    changes = [one for one in found.changes if one.recording == name]
    verdict, step = found.verdicts[name], found.steps[name][-1]
    if verdict == "nothing":
        return _NOTHING, step.why if step.stage == "runs" else _NO_NEED, ("Go on: there is nothing to repair.",)
    if verdict == "unknown":
        return _UNKNOWN, step.why, (f"brickpilot why on {name} alone names what its simulation lacks.",)
    text = "; ".join(sentence(one) for one in changes)
    return (
        f"{text[:1].upper()}{text[1:]}{_since(changes[0])}.",
        _sure(changes, ambiguous=verdict == "ambiguous"),
        tuple(dict.fromkeys(one.advice for one in changes if one.advice)),
    )


def sentence(one: Change) -> str:
    """Returns a change with its values: "dry friction rose by 40 % (38 to 43 %), from 0.30 to 0.42 V"."""
    if one.before == 0 or one.after == 0 or one.percent is None:
        return one.words
    return f"{one.words}, from {quantity(one.before, one.unit)} to {quantity(one.after, one.unit)}"


def _since(one: Change) -> str:
    if one.since is None:
        return ""
    low, high = one.since.ci95
    return f", since {one.since.at_s:.1f} s of {one.since.run} ({low:.1f} to {high:.1f} s)"


def _sure(changes: list[Change], *, ambiguous: bool) -> str:
    if not ambiguous:
        weight = percent(min(one.weight for one in changes))
        return f"No other explanation is left: this explanation has {weight} of the weight."
    rivals = [" and ".join(subject(name) for name in rival) or "nothing" for rival in changes[0].rivals]
    held = listed([f"{subject(one.parameter)} has {percent(one.weight)}" for one in changes])
    return f"Weight of the explanations with a change: {held}. Another explanation is {listed(rivals, 'or')}."


def lines(found: Changed) -> list[str]:
    """Returns the lines for a terminal."""
    made: list[str] = []
    for one in said(found):
        if len(found.after) > 1:
            made.append(f"{one.recording}:")
        made += [f"what changed: {one.what}", f"how sure: {one.sure}", f"what to do: {' '.join(one.todo)}"]
        made.append(f"{'signal':28}{'old model, before':>20}{'old model, after':>20}{'with the change':>20}")
        for signal, fit in found.fits[one.recording].items():
            cells = map(fit_text, (fit.old_model_before, fit.old_model_after, fit.explained_after))
            made.append(f"{say(signal):28}" + "".join(f"{cell:>20}" for cell in cells))
    if found.shared:
        made.append(f"{'value':28}{'all that agree':>36}  differs in")
        for row in found.shared:
            value = str(quantity(row.value.value, row.unit, row.value.ci95))
            made.append(f"{row.what:28}{value:>36}  {listed(_names(found, row.apart)) or '-'}")
    return [ascii_text(line) for line in made]


def _names(found: Changed, recordings: Iterable[str]) -> list[str]:
    """Returns the names of recordings as the user gave them."""
    return [found.before if recording == BEFORE else recording for recording in recordings]


def page(found: Changed, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        command: the command line that repeats the comparison.
    """
    names = list(dict.fromkeys(one.what for one in found.constants))
    alone = {(one.recording, one.what): one for one in found.constants}
    recordings = dict.fromkeys(one.recording for one in found.constants)
    rows = {row: [alone.get((row, name)) for name in names] for row in recordings}
    points = points_for(sum(map(len, found.traces.values())))
    return render(
        "changed",
        title=f"{', '.join(found.after)}: what changed since {found.before}",
        said=said(found),
        several=len(found.after) > 1,
        fits={name: found.fits[name] for name in found.after},
        changes=[(one, told(found.dataset, sentence(one))) for one in found.changes],
        figures={name: [_figure(one, points) for one in traces] for name, traces in found.traces.items()},
        constants=list(zip(_names(found, rows), rows.values(), strict=True)),
        names=names,
        shared={one.what: one for one in found.shared},
        steps=[(name, one) for name, steps in found.steps.items() for one in steps],
        notes=found.notes,
        command=command,
    )


def _figure(one: Trace, points: int) -> dict[str, object]:
    simulated: Simulated = {"old model": ("orange", one.old), "with the change": ("blue", one.explained)}
    signal, unit = say(one.signal), SIGNALS[one.signal].unit
    title = f"{one.run}: {signal}, measured, and simulated by the old model and with the change"
    chart = superimposed(one.time, signal, unit, one.measured, simulated, run=one.run, title=title, points=points)
    return {"run": one.run, "signal": signal, "chart": chart}
