"""The page of `changed`: what is different, how well the old model follows, and what each recording tells alone."""

from __future__ import annotations

from brickpilot.changed.change import Changed, Constant, Trace
from brickpilot.changed.what_changed import BEFORE
from brickpilot.data.signals import SIGNALS
from brickpilot.report import changed_text, discover_plots
from brickpilot.report.discover_plots import measured
from brickpilot.report.discover_text import say
from brickpilot.report.plot import Curve, points_for
from brickpilot.report.quantities import percent, quantity
from brickpilot.report.template import render
from brickpilot.report.user_terms import told


def page(found: Changed, command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        command: the command line that repeats it.
    """
    names = list(dict.fromkeys(one.what for one in found.constants))
    alone = {(one.recording, one.what): one for one in found.constants}
    rows = list(dict.fromkeys(one.recording for one in found.constants))
    points = points_for(sum(map(len, found.traces.values())))
    return render(
        "changed",
        title=f"{', '.join(found.after)}: what changed since {found.before}",
        said=changed_text.said(found),
        several=len(found.after) > 1,
        fits={name: changed_text.fit_rows(found, name) for name in found.after},
        changes=[
            (
                one.recording,
                told(found.dataset, changed_text.sentence(one)),
                one.mechanism,
                str(quantity(one.change.value, one.unit, one.change.ci95)),
                percent(one.weight),
            )
            for one in found.changes
        ],
        figures={name: [_figure(one, points) for one in traces] for name, traces in found.traces.items()},
        constants=[
            (
                found.before if row == BEFORE else row,
                [
                    str(quantity(one.value, one.unit, one.ci95)) if (one := alone.get((row, name))) else ""
                    for name in names
                ],
            )
            for row in rows
        ],
        names=names,
        steps=[(name, one) for name, steps in found.steps.items() for one in steps],
        notes=found.notes,
        command=command,
    )


def _value(one: Constant | None) -> str:
    return str(quantity(one.value, one.unit, one.ci95)) if one else ""


def _figure(one: Trace, points: int) -> dict[str, object]:
    above = [measured(one.measured), Curve("old model", one.old, "orange"), Curve("with the change", one.explained)]
    below = [
        Curve("old model", one.measured - one.old, "orange"),
        Curve("with the change", one.measured - one.explained),
    ]
    said = say(one.signal)
    title = f"{one.run}: {said}, measured, by the old model and with what changed"
    time = one.time - one.time[0]
    chart = discover_plots.superimposed(
        time, said, SIGNALS[one.signal].unit, above, below, 0.0, run=one.run, title=title, points=points
    )
    return {"run": one.run, "signal": said, "chart": chart}
