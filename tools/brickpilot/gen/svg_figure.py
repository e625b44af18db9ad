"""Pictures of the READMEs as SVG, by matplotlib, which the package does not need at run time."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# These differ in lightness as well as in hue (Okabe & Ito 2008), and show on white and on near-black.
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#808080"

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
    """Returns the figure as an `<svg>` element with the accessible name `title`. Black becomes grey."""
    buffer = io.StringIO()
    for legend in filter(None, (axis.get_legend() for axis in drawn.axes)):
        legend.set_frame_on(False)  # its box would be white in dark mode
    with matplotlib.rc_context(_STYLE):
        drawn.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"(?<=[:\s\"])#000000", GREY, svg)
    svg = re.sub(r"<text style=\"", f'<text fill="{GREY}" style="', svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1)
