"""The page of `compare`: a table of errors, then every run's signals measured and simulated."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.dataset import OwnUnit
from brickpilot.fit.comparison import Comparison, RunComparison, Trace
from brickpilot.report import discover_plots, headline_text
from brickpilot.report.discover_plots import measured
from brickpilot.report.plot import Curve, points_for
from brickpilot.report.quantities import ROLES, fit_number, number
from brickpilot.report.template import render

_DRAWN = 24  # runs with plots, at most: a page with hundreds takes long to make and to read


def superimposed(run: str, signal: str, trace: Trace, own: OwnUnit, points: int) -> Markup:
    """Draws measured and simulated superimposed, as the paper's figs 4 and 5, and measured minus simulated below."""
    said, factor = signal.replace("_", " "), own.value(1.0)
    above = [measured(factor * trace.measured), Curve("simulated", factor * trace.simulated)]
    below = [Curve("residual", factor * (trace.measured - trace.simulated))]
    time = trace.time - trace.time[0]
    title = f"{run}: {said}, measured and simulated, and the residual below"
    return discover_plots.superimposed(time, said, own.unit, above, below, 0.0, run=run, title=title, points=points)


def compare_page(comparison: Comparison) -> str:
    """Returns the page of `compare` as one self-contained HTML text.

    If there are many runs, those with the largest errors are drawn; the table has all.
    """
    drawn = drawn_runs(comparison.runs)
    points = points_for(sum(len(run.traces) for run in comparison.runs if run.name in drawn))
    return render(
        "compare",
        title=f"{comparison.dataset}: measured and simulated",
        comparison=comparison,
        sentence=headline_text.sentence(comparison.headline),
        definition=headline_text.DEFINITION,
        horizons=[headline_text.horizon_text(name) for name in comparison.headline.horizons],
        summary=headline_text.tables(comparison.headline, comparison.units),
        undrawn=len(comparison.runs) - len(drawn),
        runs=[
            {
                "name": run.name,
                "role": ROLES[run.role],
                "rows": _rows(comparison, run),
                "figures": [
                    superimposed(run.name, name, trace, comparison.units[name.split(" ")[0]], points)
                    for name, trace in run.traces.items()
                ]
                if run.name in drawn
                else [],
            }
            for run in comparison.runs
        ],
    )


def drawn_runs(runs: Sequence[RunComparison]) -> set[str]:
    """Returns the names of the runs with plots: all, or of many those with the largest error of any signal."""
    worst = sorted(runs, key=lambda run: -max((one.share or 0.0 for one in run.signals.values()), default=0.0))
    return {run.name for run in worst[:_DRAWN]}


def _rows(comparison: Comparison, run: RunComparison) -> list[dict[str, str]]:
    """Returns a row for each signal of `run`, then one for each signal in windows."""
    errors = [(name, name, "free_run", error) for name, error in run.signals.items()]
    errors += [(f"{name} in windows", name, comparison.horizon, error) for name, error in run.windows.items()]
    rows = []
    for label, name, horizon, error in errors:
        found = comparison.headline.of_run(run.name, name, horizon)
        rows.append(
            {
                "signal": label,
                "unit": catalogue.outputs().get(name, ""),
                "fit": fit_number(found.fit_percent),
                "rms_error": headline_text.error_text(found, comparison.units[name]),
                "ils": number(error.ils),
                "ils_normalised": number(error.ils_normalised),
            }
        )
    return rows
