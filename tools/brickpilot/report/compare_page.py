"""The pages of `compare` and `calibrate`: tables on top, then measured and simulated superimposed, error below."""

from __future__ import annotations

import numpy as np

from brickpilot import __version__, catalogue
from brickpilot.fit.calibrate import Calibration
from brickpilot.fit.compare import Comparison, Trace
from brickpilot.report.plot import BLUE, GREY, ORANGE, figure, thin, to_svg
from brickpilot.report.run_page import environment

_POINTS = 500
_NONE = "\N{EN DASH}"
_ROLES = {"fit": "fit", "held_out": "held out"}


def per_cent(share: float | None) -> str:
    """ "16.1 %", or a dash where the signal had no energy."""
    if share is None:
        return _NONE
    return (
        f"{100 * share:.2g}\N{NO-BREAK SPACE}%"
        if share < 0.1
        else f"{100 * share:.0f}\N{NO-BREAK SPACE}%"
        if share < 10
        else "> 1000\N{NO-BREAK SPACE}%"
    )


def superimposed(run: str, signal: str, trace: Trace) -> str:
    """Analogue matching, as the paper's figs 4 and 5: measured under simulated, and simulated minus measured below."""
    unit = catalogue.outputs().get(signal.split(" ")[0], "")
    drawn, (above, below) = figure(2, row_height=1.35)
    time = trace.time - trace.time[0]
    above.plot(*thin(time, trace.measured, _POINTS), color=GREY, linewidth=2.4, alpha=0.75, label="measured")
    above.plot(*thin(time, trace.simulated, _POINTS), color=BLUE, label="simulated")
    above.set_title(signal.replace("_", " "), loc="left", fontsize=9)
    above.set_ylabel(f"({unit})", fontsize=8)
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 0.95), ncols=2, frameon=False, fontsize=8)
    below.plot(*thin(time, trace.simulated - trace.measured, _POINTS), color=ORANGE)
    below.axhline(0.0, color=GREY, linewidth=0.6)
    below.set_ylabel(f"error ({unit})", fontsize=8)
    below.set_xlabel("time (s)")
    drawn.align_ylabels([above, below])
    return to_svg(drawn, f"{run}: {signal}, measured and simulated")


def compare_page(comparison: Comparison) -> str:
    """One self-contained HTML page."""
    signals = list(dict.fromkeys(name for run in comparison.runs for name in run.signals))
    rates = list(dict.fromkeys(name for run in comparison.runs for name in run.windows))
    labelled = [(name, name, False) for name in signals]
    labelled += [(f"{name} in {comparison.window_s:g} s windows", name, True) for name in rates]
    summary = [
        (label, *(per_cent(comparison.share(role, name, windows=windows)) for role in _ROLES))
        for label, name, windows in labelled
    ]
    runs = []
    for run in comparison.runs:
        errors = [(name, error, False) for name, error in run.signals.items()]
        errors += [(f"{name} in windows", error, True) for name, error in run.windows.items()]
        rows = [
            {
                "signal": name,
                "unit": catalogue.outputs().get(name.split(" ")[0], ""),
                "share": per_cent(error.share),
                "rms_error": _number(error.rms_error),
                "rms_signal": _number(error.rms_signal),
                "ils": _number(error.ils),
                "ils_normalised": _number(error.ils_normalised),
            }
            for name, error, _ in errors
        ]
        figures = [superimposed(run.name, name, trace) for name, trace in run.traces.items()]
        runs.append({"name": run.name, "role": _ROLES[run.role], "rows": rows, "figures": figures})
    title = f"{comparison.dataset}: measured and simulated"
    return _page("compare", title, comparison=comparison, summary=summary, runs=runs)


def calibrate_page(calibration: Calibration) -> str:
    """One self-contained HTML page."""
    parameters = [
        {
            "name": name,
            "value": _number(one.value),
            "unit": one.unit,
            "low": _NONE if one.ci95 is None else _number(one.ci95[0]),
            "high": _NONE if one.ci95 is None else _number(one.ci95[1]),
            "identifiable": one.identifiable,
            "basis": one.basis,
        }
        for name, one in calibration.parameters.items()
    ]
    combinations = [
        {
            "name": one.name,
            "formula": one.formula,
            "unit": one.unit,
            "value": _number(one.value),
            "ci95": [_number(v) for v in one.ci95],
        }
        for one in calibration.combinations
    ]
    gaps = [
        {
            "run": gap.run,
            "role": _ROLES[gap.role],
            "signal": gap.signal,
            "before": per_cent(gap.before),
            "after": per_cent(gap.after),
        }
        for gap in calibration.gaps
    ]
    scales = [
        {
            "signal": name,
            "unit": catalogue.outputs().get(name, ""),
            "size": _number(s.size),
            "noise": _number(s.noise),
            "tau": f"{s.tau:.0f}",
        }
        for name, s in calibration.scales.items()
    ]
    return _page(
        "calibrate",
        f"{calibration.dataset}: calibration",
        calibration=calibration,
        parameters=parameters,
        combinations=combinations,
        gaps=gaps,
        scales=scales,
        starts=[(start.name, f"{start.cost:.6g}") for start in calibration.starts],
    )


def _page(template: str, title: str, **content: object) -> str:
    return environment().get_template(f"{template}.html.j2").render(title=title, version=__version__, **content)


def _number(value: float | None) -> str:
    return _NONE if value is None or not np.isfinite(value) else f"{value:.4g}"
