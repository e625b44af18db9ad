"""Figures as SVG elements of a page: small, sharp in print, readable in light and dark."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

# These differ in lightness as well as in hue (Okabe & Ito 2008), and show on white and on near-black.
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#808080"

_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text, which can be selected and searched
    "svg.hashsalt": "brickpilot",  # the same figure gives the same bytes
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}


def figure(
    rows: int = 1, *, width: float = 8.0, row_height: float = 1.8, sharex: bool = True
) -> tuple[Figure, list[Axes]]:
    """Returns a figure with `rows` panels, one above the other, each `width` by `row_height` inches."""
    with matplotlib.rc_context(_STYLE):
        drawn = Figure(figsize=(width, rows * row_height + 0.4), layout="constrained")
        axes = drawn.subplots(rows, 1, sharex=sharex, squeeze=False)
    return drawn, [axes[row, 0] for row in range(rows)]


def to_svg(drawn: Figure, title: str) -> str:
    """Returns the figure as an `<svg>` element with the accessible name `title`. Black becomes the text colour."""
    buffer = io.StringIO()
    for legend in filter(None, (axis.get_legend() for axis in drawn.axes)):
        legend.set_frame_on(False)  # its box would be white in dark mode
    with matplotlib.rc_context(_STYLE):
        drawn.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"(?<=[:\s\"])#000000", "currentColor", svg)
    svg = re.sub(r"<text style=\"", '<text fill="currentColor" style="', svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1)


def thin(time: Array, value: Array, points: int = 1200) -> tuple[Array, Array]:
    """Returns about `points` samples that keep the smallest and the largest value of each stretch, so all peaks stay.

    `time` and `value` have the shape (n,). NaN stays as a dropout.
    """
    if len(time) <= points:
        return time, value
    width = -(-len(time) // (points // 2))
    padded = np.full(points // 2 * width, np.nan)
    padded[: len(value)] = value
    stretches = padded.reshape(-1, width)
    dropouts, starts = np.isnan(stretches), width * np.arange(points // 2)
    least = starts + np.where(dropouts, np.inf, stretches).argmin(axis=1)
    most = starts + np.where(dropouts, -np.inf, stretches).argmax(axis=1)
    kept = np.unique(np.concatenate([[0, len(time) - 1], least, most]))
    kept = kept[kept < len(time)]
    return time[kept], value[kept]
