"""The pages of `calibrate` and `compare`: the values of a model, and how well the model fits every run.

`calibrate` shows the fitted parameters, the error before and after, and how the parameters were fitted. `compare` shows
a table of errors, then the measured and simulated signals of every run.
"""

from __future__ import annotations

from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.agreement import SignalError
from brickpilot.data.dataset import OwnUnit
from brickpilot.fit.calibration import Calibration, Gap
from brickpilot.fit.comparison import Comparison, RunComparison, Trace
from brickpilot.report import headline_text
from brickpilot.report.plot import Simulated, points_for, row_chart, superimposed
from brickpilot.report.quantities import ROLES, say
from brickpilot.report.template import render

_DRAWN = 24  # largest number of runs with plots


def calibrate_page(calibration: Calibration) -> str:
    """Returns the page of `calibrate` as one self-contained HTML text."""
    return render(
        "calibrate",
        title=f"{calibration.dataset}: calibration",
        calibration=calibration,
        **headline_text.shown(calibration.after, calibration.units),
        units=catalogue.outputs(),
        stated=_stated(calibration),
        correlation=list(zip(map(say, calibration.parameters), calibration.correlation, strict=False)),
        comparisons=_comparisons(calibration),
    )


def _comparisons(calibration: Calibration) -> list[tuple[str, str, list[Markup]]]:
    """Returns (run, role, figures) for all runs; if there are many, only for the runs with the largest errors."""
    worst: dict[str, float] = {}
    for gap in calibration.gaps:
        worst[gap.run] = max(worst.get(gap.run, 0.0), gap.after or 0.0)
    chosen = set(sorted(worst, key=lambda run: -worst[run])[:_DRAWN])
    drawn = [one for one in calibration.gaps if one.run in chosen]
    figures: dict[str, list[Markup]] = {}
    for gap in drawn:
        simulated: Simulated = {} if gap.unfitted is None else {"before": ("orange", gap.unfitted)}
        simulated = {**simulated, "after": ("blue", gap.simulated)}
        title = (
            f"{gap.run}: {say(gap.signal)}, measured, and simulated before and after the fit, and the residuals below"
        )
        chart = _superimposed(gap, gap.run, gap.signal, calibration.units[gap.signal], simulated, title, len(drawn))
        figures.setdefault(gap.run, []).append(chart)
    return [(run, ROLES[calibration.roles[run]], charts) for run, charts in figures.items()]


def _superimposed(
    one: Gap | Trace, run: str, signal: str, own: OwnUnit, simulated: Simulated, title: str, figures: int
) -> Markup:
    """Draws measured and simulated values in the unit and with the sign of the data set.

    Args:
        one, simulated: the measured and the simulated values of a run's signal, in SI.
        figures: the number of figures on the page.
    """
    factor, points = own.value(1.0), points_for(figures)
    owned = {name: (colour, factor * values) for name, (colour, values) in simulated.items()}
    return superimposed(
        one.time, say(signal), own.unit, factor * one.measured, owned, run=run, title=title, points=points
    )


def _stated(calibration: Calibration) -> Markup | None:
    """Draws `(fitted - stated) / (stated sd)` of each value with its interval; None: no value is stated with an sd."""
    labels, places, spans = [], [], []
    for name, one in calibration.parameters.items():
        stated = calibration.stated.get(name)
        if stated is not None and stated.sd:
            away = [(end - stated.value) / stated.sd for end in (one.value, *(one.ci95 or ()))]
            labels.append(say(name))
            places.append(away[0])
            spans.append((away[1], away[2]) if one.ci95 else None)
    if not labels:
        return None
    text = "; ".join(f"{label} {place:+.1f}" for label, place in zip(labels, places, strict=True))
    return row_chart(
        labels,
        {"fitted": ("blue", places)},
        spans,
        "fitted less stated",
        "sd",
        title=f"Fitted against stated values, in standard deviations of the stated value: {text}",
        lines=(0.0,),
        stretch=(-2.0, 2.0),
    )


def compare_page(comparison: Comparison) -> str:
    """Returns the page of `compare` as one self-contained HTML text.

    If there are many runs, only the runs with the largest errors are drawn; the table has all runs.
    """
    worst = sorted(comparison.runs, key=lambda run: -max((one.share or 0.0 for one in run.signals.values()), default=0))
    drawn = {run.name for run in worst[:_DRAWN]}
    figures: dict[str, list[Markup]] = {run.name: [] for run in comparison.runs}
    count = sum(len(run.traces) for run in comparison.runs if run.name in drawn)
    for run in (run for run in comparison.runs if run.name in drawn):
        for name, trace in run.traces.items():
            title = f"{run.name}: {say(name)}, measured and simulated, and the residual below"
            simulated: Simulated = {"simulated": ("blue", trace.simulated)}
            own = comparison.units[name.split(" ")[0]]
            figures[run.name].append(_superimposed(trace, run.name, name, own, simulated, title, count))
    return render(
        "compare",
        title=f"{comparison.dataset}: measured and simulated",
        comparison=comparison,
        **headline_text.shown(comparison.headline, comparison.units),
        undrawn=len(comparison.runs) - len(drawn),
        units=catalogue.outputs(),
        error_text=headline_text.error_text,
        rows={run.name: _rows(comparison, run) for run in comparison.runs},
        figures=figures,
    )


def _rows(comparison: Comparison, run: RunComparison) -> list[tuple[str, str, str, SignalError]]:
    """Returns (label, signal, horizon, error) for each signal in a free run, then in windows."""
    rows = [(name, name, "free_run", error) for name, error in run.signals.items()]
    return rows + [(f"{name} in windows", name, comparison.horizon, error) for name, error in run.windows.items()]
