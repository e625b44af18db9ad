"""What a notebook shows of a result: a title, its sentences and a small table. All text is escaped."""

from __future__ import annotations

import numbers
from typing import TYPE_CHECKING, Any

from brickpilot.data.dataset import Dataset
from brickpilot.discover.check import Check
from brickpilot.discover.deadline import Span
from brickpilot.discover.finding import Finding
from brickpilot.fit.calibrate import Calibration
from brickpilot.fit.compare import Comparison
from brickpilot.report import check_text, discover_text, headline_text
from brickpilot.report.quantities import DASH, fit_text, number
from brickpilot.report.template import render
from brickpilot.vehicle.fly import Flown

if TYPE_CHECKING:
    import pandas

Result = Dataset | Comparison | Calibration | Check | Finding | Flown

_ROWS = 20
"""Of a table; a notebook is no page."""


def to_html(result: Result) -> str:
    """Returns a result as a piece of HTML that needs nothing else: what a notebook shows of it.

    Raises:
        TypeError: it is no result of this package.
    """
    if isinstance(result, Flown):
        return _flown(result)
    title, sentences = _words(result)
    return _table(title, sentences, result.to_frame())


def _words(result: Dataset | Comparison | Calibration | Check | Finding) -> tuple[str, list[str]]:
    """Returns the title of a result and the sentences above its table."""
    if isinstance(result, Dataset):
        return f"{result.name}: {result.vehicle}, {len(result.runs)} runs", list(result.notes)
    if isinstance(result, Comparison):
        signals = [_error(result, name) for name in result.headline.signals]
        return f"{result.dataset}: measured and simulated", [headline_text.sentence(result.headline), *signals]
    if isinstance(result, Calibration):
        groups = [f"Identifiable only in combination: {', '.join(group)}." for group in result.cannot_tell_apart]
        count = len(result.parameters)
        explained = headline_text.sentence(result.after)
        return f"{result.dataset}: calibration", [f"{count} parameters are fitted, in SI.", explained, *groups]
    if isinstance(result, Check):
        title, *_ = check_text.lines(result)
        return title, [
            headline_text.sentence(result.explained),
            f"Discovery will take {Span(*result.discover_range_s)}.",
            *result.notes,
        ]
    if isinstance(result, Finding):
        return f"{result.dataset.name}: what the simulator lacks", [discover_text.verdict(result)]
    raise TypeError(f"{type(result).__name__} is no result of brickpilot")


def _error(comparison: Comparison, signal: str) -> str:
    role = comparison.headline.role
    one = comparison.headline.of(signal, role)
    error = headline_text.error_text(one, comparison.units[signal])
    return f"{signal}: {fit_text(one.fit_percent)} on {headline_text.RUNS[role]}, and an error of {error} rms."


def _flown(flown: Flown) -> str:
    """Returns the figures that are one value, and why the mission failed."""
    import pandas

    single = {k: v for k, v in flown.figures.items() if isinstance(v, str | numbers.Real) and not k.endswith("sha256")}
    table = pandas.DataFrame({"figure": list(single), "value": list(single.values())}, dtype=object)
    plan = flown.flight.plan
    return _table(f"{plan.scenario.name}: flown", [] if flown.failure is None else [flown.failure], table)


def _table(title: str, sentences: list[str], frame: pandas.DataFrame) -> str:
    shown = [[_cell(value) for value in row] for row in frame.head(_ROWS).itertuples(index=False)]
    return render(
        "result",
        title=title,
        sentences=sentences,
        columns=list(frame.columns),
        rows=shown,
        more=max(len(frame) - _ROWS, 0),
    )


def _cell(value: Any) -> str:
    """Returns a value as the pages write it: four digits, and a dash for none."""
    if value is None or value != value:
        return DASH
    if isinstance(value, str | bool | numbers.Integral):
        return str(value)
    return number(float(value)) if isinstance(value, numbers.Real) else str(value)
