"""The numbers behind the figures of a campaign's page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign.file import Campaign
from brickpilot.campaign.inputs import Input
from brickpilot.campaign.summary import Table
from brickpilot.report.campaign_page import Histogram, Scatter

Array = NDArray[np.float64]

SHOWN = (
    "cross_track_rms_m", "closest_approach_max_m", "position_estimate_error_m", "heading_rms_rad", "time_s", "charge_c",
)  # fmt: skip
"""The figures whose distribution the page draws."""

MOST_DOTS = 1500
"""Runs of a scatter plot: more points overlap and take long to draw."""

STRONGEST = 3
"""Inputs of each figure that are drawn against it."""

_DRAWN_OUT = (0.001, 0.999)  # quantiles: a histogram's range; runs beyond it are counted in the outermost bars
_BARS = 40


def histograms(table: Table, figures: Mapping[str, Mapping[str, Any]]) -> list[Histogram]:
    """Returns the distributions of the runs' figures, for success and failure apart."""
    success = table.numbers("success") > 0
    found = []
    for name in SHOWN:
        values = table.numbers(name)
        known = np.isfinite(values)
        if known.sum() < 2:
            continue
        low, high = np.quantile(values[known], _DRAWN_OUT)
        edges = np.linspace(low, high if high > low else low + abs(low) * 1e-3 + 1e-9, _BARS + 1)
        inside = np.clip(values, edges[0], edges[-1])
        counts = [np.histogram(inside[known & chosen], edges)[0] for chosen in (success, ~success)]
        found.append(Histogram(name, figures[name]["unit"], edges, *(one.astype(np.float64) for one in counts)))
    return found


def scatters(campaign: Campaign, table: Table, sensitivity: Mapping[str, Any] | None) -> list[Scatter]:
    """Returns each figure against its strongest inputs; the first runs stand for all."""
    if sensitivity is None:
        return []
    inputs = {one.name: one for one in campaign.drawn}
    success = table.numbers("success")[:MOST_DOTS] > 0
    found = []
    for figure, indices in sensitivity["figures"].items():
        if figure == "success":
            continue
        values = table.numbers(figure)[:MOST_DOTS]
        for index in indices[:STRONGEST]:
            one = inputs[index["input"]]
            x = table.numbers(one.name)[:MOST_DOTS]
            found.append(_scatter(figure, one, x, values, success))
    return found


def _scatter(figure: str, one: Input, x: Array, values: Array, success: NDArray[np.bool_]) -> Scatter:
    known = np.isfinite(x) & np.isfinite(values)
    order = np.argsort(x[known], kind="stable")
    return Scatter(figure, one.name, one.unit, x[known][order], values[known][order], success[known][order])
