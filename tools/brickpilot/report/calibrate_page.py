"""The page of `calibrate`: the fitted parameters, the error before and after, and how they were fitted."""

from __future__ import annotations

from brickpilot import catalogue
from brickpilot.fit.calibrate import Calibration
from brickpilot.report.quantities import DASH, ROLES, error_percent, number
from brickpilot.report.template import render


def calibrate_page(calibration: Calibration) -> str:
    """Returns the page of `calibrate` as one self-contained HTML text."""
    return render(
        "calibrate",
        title=f"{calibration.dataset}: calibration",
        calibration=calibration,
        parameters=_parameters(calibration),
        combinations=_combinations(calibration),
        gaps=_gaps(calibration),
        scales=_scales(calibration),
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
            "before": error_percent(gap.before),
            "after": error_percent(gap.after),
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
