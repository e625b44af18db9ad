"""The page of a campaign: success rates, causes of failure, distributions, worst runs, and sensitivity indices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.report.plot import Array, Colour, Curve, Figure, Panel, row_chart, to_html
from brickpilot.report.quantities import DASH, number, scaled, unit_text
from brickpilot.report.template import render

WORDS = {
    "success": "success",
    "cross_track_rms_m": "cross-track error, rms",
    "cross_track_max_m": "cross-track error, largest",
    "heading_rms_rad": "heading error, rms",
    "closest_approach_max_m": "widest pass of a waypoint",
    "position_estimate_error_m": "error of the position estimate, rms",
    "time_s": "time to the last waypoint",
    "charge_c": "charge from the battery",
    "duty_travel": "travel of the motors' duty",
    "ended_at_s": "end of the mission",
    "waypoints_reached": "waypoints reached",
    "overshoots": "overshoots",
    "saturated_surge_steps": "steps with surge saturated",
    "saturated_yaw_steps": "steps with yaw saturated",
    "reached_all": "all waypoints reached",
}
"""Figure -> its name on the page."""

_MOST_ROWS = 20  # largest number of inputs in a chart of sensitivity indices


@dataclass(frozen=True)
class Histogram:
    """The distribution of a figure: number of runs that `succeeded` and `failed` in each bar, (bars,), and `edges`."""

    figure: str
    unit: str
    edges: Array  # (bars + 1,)
    succeeded: Array
    failed: Array


@dataclass(frozen=True)
class Scatter:
    """The `values` of a figure and the values `x` of an input for the same n runs, (n,) each; `x` does not decrease."""

    figure: str
    input: str
    unit: str
    x: Array
    values: Array
    success: NDArray[np.bool_]


def page(summary: Mapping[str, Any], histograms: Sequence[Histogram], scatters: Sequence[Scatter], command: str) -> str:
    """Returns the page as one self-contained HTML text.

    Args:
        summary: the content of `summary.json`.
        command: the command line of the campaign.
    """
    sensitivity = summary["sensitivity"]
    indices = {} if sensitivity is None else sensitivity["figures"]
    return render(
        "campaign",
        title=f"Campaign: {summary['name']}",
        summary=summary,
        verdict=verdict(summary),
        rates=_rates_chart(summary),
        histograms=[(WORDS[one.figure], _histogram(one)) for one in histograms],
        rows=[_row(name, one) for name, one in summary["figures"].items() if one["known"]],
        method=None if sensitivity is None else sensitivity["method"],
        indices=[(WORDS[name], _index_chart(name, rows[:_MOST_ROWS])) for name, rows in indices.items() if rows],
        scatters=[(f"{WORDS[one.figure]} against {one.input}", _scatter(one)) for one in scatters],
        command=command,
    )


def _rate_text(rate: Mapping[str, Any]) -> str:
    """Returns a success rate with its interval: "94.2 % (92.1 % to 95.8 %)"."""
    middle, low, high = (f"{100 * share:.1f}\N{NO-BREAK SPACE}%" for share in (rate["rate"], *rate["ci95"]))
    return f"{middle} ({low} to {high})"


def verdict(summary: Mapping[str, Any]) -> str:
    """Returns the result in one or two sentences."""
    success = summary["success"]
    text = (
        f"{success['count']} of {success['of']} missions succeeded: {_rate_text(success)}. Success is every waypoint "
        "reached, and no fault; the interval is 95 %."
    )
    if summary["design"] != "morris":
        return text
    rare = "Morris's design often flies the ends of each distribution"
    return f"{text} {rare}, so robots that are drawn at random have another rate."


def _rates_chart(summary: Mapping[str, Any]) -> Markup:
    """Draws the success rate of all runs and, for an input with few values, the success rate at each of its values."""
    rows = [("all runs", summary["success"])]
    for name, values in summary["by_choice"].items():
        rows += [(f"{name} = {value}", rate) for value, rate in values.items()]
    text = "; ".join(f"{label} {_rate_text(rate)}" for label, rate in rows)
    return row_chart(
        [label for label, _ in rows],
        {"succeeded": ("blue", [100 * rate["rate"] for _, rate in rows])},
        [(100 * rate["ci95"][0], 100 * rate["ci95"][1]) for _, rate in rows],
        "missions that succeeded",
        "%",
        title=f"success rates: {text}",
    )


def _histogram(one: Histogram) -> Markup:
    """Draws all runs as bars, and the failed runs as bars in front of them."""
    factor, unit = scaled(float(np.abs(one.edges).max()), one.unit) if one.unit else (1.0, "")
    middles = (one.edges[:-1] + one.edges[1:]) / 2 / factor
    curves = [Curve("all runs", one.succeeded + one.failed, "blue", shape="bars")]
    if one.failed.any():
        curves.append(Curve("failed", one.failed, "orange", shape="bars"))
    return to_html(
        Figure(f"distribution of {WORDS[one.figure]}", middles, [Panel("runs", "", curves)], WORDS[one.figure], unit)
    )


def _row(name: str, one: Mapping[str, Any]) -> list[str]:
    """Returns a row of the table of figures: name, unit, number of runs with the figure, mean, sd and quantiles."""
    top = max(abs(one["min"]), abs(one["max"]))
    factor, unit = scaled(top, one["unit"]) if one["unit"] else (1.0, "")
    cells = [number(one[key] / factor) for key in ("mean", "sd", "min", "q05", "median", "q95", "max")]
    return [WORDS[name], unit or DASH, str(one["known"]), *cells]


def _index_chart(figure: str, rows: Sequence[Mapping[str, Any]]) -> Markup:
    """Draws the sensitivity indices of a figure, with the strongest input at the top."""
    with_total = "total" in rows[0]
    curves: dict[str, tuple[Colour, list[float | None]]] = {}
    if with_total:
        curves["total"] = ("orange", [one["total"] for one in rows])
    curves["alone" if with_total else "index"] = ("blue", [one["index"] for one in rows])
    text = "; ".join(f"{one['input']} {number(one['total' if with_total else 'index'])}" for one in rows)
    return row_chart(
        [one["input"] for one in rows],
        curves,
        [tuple(one["total_ci95" if with_total else "ci95"]) for one in rows],
        "index",
        "",
        title=f"what {WORDS[figure]} depends on: {text}",
        lines=(0.0,),
    )


def _scatter(one: Scatter) -> Markup:
    kinds: tuple[tuple[str, Colour, NDArray[np.bool_]], ...] = (
        ("succeeded", "blue", one.success),
        ("failed", "orange", ~one.success),
    )
    curves = [
        Curve(name, np.where(chosen, one.values, np.nan), colour, shape="marks")
        for name, colour, chosen in kinds
        if chosen.any()
    ]
    unit = one.figure.rpartition("_")[2]
    title = f"{WORDS[one.figure]} against {one.input}"
    panel = Panel(WORDS[one.figure], unit if unit in ("m", "s", "rad") else "", curves, 220)
    return to_html(Figure(title, one.x, [panel], one.input, unit_text(one.unit)))
