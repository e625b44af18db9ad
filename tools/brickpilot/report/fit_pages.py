"""The pages of `calibrate` and `compare`: the values of a model, and how well it fits every run.

`calibrate` shows the fitted parameters, the error before and after, and how they were fitted. `compare` shows a table
of errors, then the measured and simulated signals of every run.
"""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from brickpilot import catalogue
from brickpilot.data.dataset import OwnUnit
from brickpilot.fit.calibration import Calibration, Gap
from brickpilot.fit.comparison import Comparison, RunComparison, Trace
from brickpilot.report import headline_text, plot
from brickpilot.report.plot import Curve, measured, points_for, row_chart
from brickpilot.report.quantities import DASH, ROLES, fit_number, number, signed
from brickpilot.report.template import render

_DRAWN = 24  # most runs with plots


def calibrate_page(calibration: Calibration) -> str:
    """Returns the page of `calibrate` as one self-contained HTML text."""
    return render(
        "calibrate",
        title=f"{calibration.dataset}: calibration",
        calibration=calibration,
        parameters=_parameters(calibration),
        combinations=_combinations(calibration),
        sentence=headline_text.sentence(calibration.after),
        definition=headline_text.DEFINITION,
        horizons=[headline_text.horizon_text(name) for name in calibration.after.horizons],
        summary=headline_text.tables(calibration.after, calibration.units),
        gaps=_gaps(calibration),
        scales=_scales(calibration),
        stated=_stated(calibration),
        correlation=_correlation(calibration),
        comparisons=_comparisons(calibration),
        starts=[(start.name, f"{start.cost:.6g}") for start in calibration.starts],
    )


def _parameters(calibration: Calibration) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "value": number(one.value),
            "unit": one.unit,
            "low": DASH if one.ci95 is None else number(one.ci95[0]),
            "high": DASH if one.ci95 is None else number(one.ci95[1]),
            "identifiable": one.identifiable,
            "basis": one.basis,
        }
        for name, one in calibration.parameters.items()
    ]


def _combinations(calibration: Calibration) -> list[dict[str, object]]:
    return [
        {
            "name": one.name,
            "formula": one.formula,
            "unit": one.unit,
            "value": number(one.value),
            "ci95": [number(end) for end in one.ci95],
        }
        for one in calibration.combinations
    ]


def _gaps(calibration: Calibration) -> list[dict[str, str]]:
    return [
        {
            "run": gap.run,
            "role": ROLES[gap.role],
            "signal": gap.signal,
            "before": fit_number(calibration.before.of_run(gap.run, gap.signal).fit_percent),
            "after": fit_number(calibration.after.of_run(gap.run, gap.signal).fit_percent),
        }
        for gap in calibration.gaps
    ]


def _scales(calibration: Calibration) -> list[dict[str, str]]:
    return [
        {
            "signal": name,
            "unit": catalogue.outputs().get(name, ""),
            "size": number(scale.size),
            "noise": number(scale.noise),
            "tau": f"{scale.tau:.0f}",
        }
        for name, scale in calibration.scales.items()
    ]


def _comparisons(calibration: Calibration) -> list[tuple[str, str, list[Markup]]]:
    """Returns (run, role, figures) of the drawn runs: all, or if there are many, those with the largest error."""
    worst: dict[str, float] = {}
    for gap in calibration.gaps:
        worst[gap.run] = max(worst.get(gap.run, 0.0), gap.after or 0.0)
    chosen = set(sorted(worst, key=lambda run: -worst[run])[:_DRAWN])
    drawn = [one for one in calibration.gaps if one.run in chosen]
    figures: dict[str, list[Markup]] = {}
    for one in drawn:
        figures.setdefault(one.run, []).append(
            _superimposed(one, calibration.units[one.signal], points_for(len(drawn)))
        )
    return [(run, ROLES[calibration.roles[run]], found) for run, found in figures.items()]


def _superimposed(one: Gap, own: OwnUnit, points: int) -> Markup:
    """Draws a measured signal and its simulations before and after the fit, and the residuals below."""
    factor = own.value(1.0)
    above, below = [measured(factor * one.measured)], []
    if one.unfitted is not None:
        above.append(Curve("before", factor * one.unfitted, "orange"))
        below.append(Curve("before", factor * (one.measured - one.unfitted), "orange"))
    above.append(Curve("after", factor * one.simulated))
    below.append(Curve("after", factor * (one.measured - one.simulated)))
    said = one.signal.replace("_", " ")
    return plot.superimposed(
        one.time - one.time[0],
        said,
        own.unit,
        above,
        below,
        0.0,
        run=one.run,
        title=f"{one.run}: {said}, measured, and simulated before and after the fit, and the residuals below",
        points=points,
    )


def _stated(calibration: Calibration) -> Markup | None:
    """Draws how far each fitted value lies from the stated one, in stated sd, with its interval; None: none stated."""
    labels, places, spans = [], [], []
    for name, one in calibration.parameters.items():
        stated = calibration.stated.get(name)
        if stated is not None and stated.sd:
            away = [(end - stated.value) / stated.sd for end in (one.value, *(one.ci95 or ()))]
            labels.append(name.replace("_", " "))
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


def _correlation(calibration: Calibration) -> list[tuple[str, list[dict[str, str | bool]]]]:
    """Returns a row for each fitted parameter: its correlation with each parameter. `shade` is the absolute value."""
    rows = []
    for name, row in zip(calibration.parameters, calibration.correlation, strict=False):
        cells: list[dict[str, str | bool]] = [
            {"text": signed(one, 2), "shade": f"{abs(one):.2f}", "below": one < 0} for one in row
        ]
        rows.append((name.replace("_", " "), cells))
    return rows


def superimposed(run: str, signal: str, trace: Trace, own: OwnUnit, points: int) -> Markup:
    """Draws measured and simulated superimposed, as the paper's figs 4 and 5, and measured minus simulated below."""
    said, factor = signal.replace("_", " "), own.value(1.0)
    above = [measured(factor * trace.measured), Curve("simulated", factor * trace.simulated)]
    below = [Curve("residual", factor * (trace.measured - trace.simulated))]
    time = trace.time - trace.time[0]
    title = f"{run}: {said}, measured and simulated, and the residual below"
    return plot.superimposed(time, said, own.unit, above, below, 0.0, run=run, title=title, points=points)


def compare_page(comparison: Comparison) -> str:
    """Returns the page of `compare` as one self-contained HTML text.

    If there are many runs, those with the largest errors are drawn; the table has all runs.
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
    """Returns the names of the runs with plots: all, or if many, those with the largest error of a signal."""
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
