"""Shows a result in a notebook or a terminal: a title, sentences and a small table. HTML is escaped."""

from __future__ import annotations

import numbers
import textwrap
from typing import TYPE_CHECKING, Any

from brickpilot.changed.change import Changed
from brickpilot.data.dataset import Dataset
from brickpilot.discover.deadline import Span
from brickpilot.discover.finding import Finding
from brickpilot.fit.calibration import Calibration
from brickpilot.fit.comparison import Comparison
from brickpilot.readiness.data_check import Check
from brickpilot.report import changed_page, check_text, discover_text, headline_text
from brickpilot.report.quantities import DASH, RUNS, ascii_text, fit_text, number
from brickpilot.report.template import render
from brickpilot.report.why_page import Why
from brickpilot.vehicle.flight_figures import Flown

if TYPE_CHECKING:
    import pandas

Result = Dataset | Comparison | Calibration | Check | Finding | Flown | Why | Changed

_ROWS = 20
"""Largest number of rows in a table; a notebook has less room than a page."""

_LINES, _WIDE = 10, 110
"""Largest number of lines in a text for a terminal, and of characters in a line."""


def to_html(result: Result) -> str:
    """Returns a result as a self-contained piece of HTML, which a notebook shows.

    Raises:
        TypeError: `result` is not of a type in `Result`.
    """
    title, sentences = _words(result)
    frame = _figures(result) if isinstance(result, Flown) else result.to_frame()
    rows = [[_cell(value) for value in row] for row in frame.head(_ROWS).itertuples(index=False)]
    more = max(len(frame) - _ROWS, 0)
    return render("result", title=title, sentences=sentences, columns=list(frame.columns), rows=rows, more=more)


def to_text(result: Result) -> str:
    """Returns a result in at most ten lines of plain text: its title and its sentences, without its table.

    Raises:
        TypeError: `result` is not of a type in `Result`.
    """
    title, sentences = _words(result)
    told = ascii_text("\n".join(sentences)).splitlines()
    lines = [line for one in told for line in textwrap.wrap(one, _WIDE, initial_indent="  ", subsequent_indent="  ")]
    cut = len(lines) >= _LINES
    return "\n".join([title, *(lines[: _LINES - 2] if cut else lines), *(["  ..."] if cut else [])])


def _words(result: Result) -> tuple[str, list[str]]:
    """Returns the title of a result and the sentences above its table."""
    if isinstance(result, Why):
        found = result.answer
        return f"{result.finding.dataset.name}: why", [found.what, found.sure, *found.todo]
    if isinstance(result, Changed):
        title = f"{', '.join(result.after)}: what changed since {result.before}"
        return title, [text for one in changed_page.said(result) for text in (one.what, one.sure, *one.todo)]
    if isinstance(result, Flown):
        return f"{result.flight.plan.scenario.name}: flown", [] if result.failure is None else [result.failure]
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
    return f"{signal}: {fit_text(one.fit_percent)} on the {RUNS[role]}, and an error of {error} rms."


def _figures(flown: Flown) -> pandas.DataFrame:
    """Returns the figures of a flight that are single values, without the hashes."""
    import pandas

    single = {k: v for k, v in flown.figures.items() if isinstance(v, str | numbers.Real) and not k.endswith("sha256")}
    return pandas.DataFrame({"figure": list(single), "value": list(single.values())}, dtype=object)


def _cell(value: Any) -> str:
    """Returns a value as the pages write it: a number with four digits, and a dash for a missing value."""
    if value is None or value != value:
        return DASH
    if isinstance(value, str | bool | numbers.Integral):
        return str(value)
    return number(float(value)) if isinstance(value, numbers.Real) else str(value)
