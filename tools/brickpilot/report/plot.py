"""Figures of a page: each figure is a description in JSON, which `figures.js` draws with uPlot in the browser.

The same figure gives the same bytes. Colours come from the style sheet: light, dark or printed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.report.quantities import scaled

if TYPE_CHECKING:
    from brickpilot.discover.finding import Whiteness
    from brickpilot.vehicle.manoeuvres import Manoeuvre


Array = NDArray[np.float64]
Colour = Literal["blue", "orange", "green", "purple", "grey"]
Shape = Literal["line", "step", "marks", "bars"]

MOST_POINTS, _LEAST_POINTS = 2000, 300  # largest and smallest number of points that one figure draws
_ROW = 26  # height of a row in pixels
_PAGE_POINTS = 40_000  # largest number of points in all figures of a page together, about 1.5 MB
ACROSS, UP = 1e6, 2e4  # x values, and a curve's values, are rounded so that their range has this many steps


@dataclass(frozen=True)
class Curve:
    """One signal of a panel. `values` has the shape (n,) of the figure's `x`; NaN is a dropout."""

    name: str
    values: Array
    colour: Colour = "blue"
    width: float = 1.3
    dashed: bool = False
    shape: Shape = "line"


@dataclass(frozen=True)
class Panel:
    """Curves with one vertical axis.

    Attributes:
        label, unit: the label and unit of the vertical axis; values are shown in a convenient multiple of the unit.
        height: the height in pixels.
        band: (low, high) of the shaded band, such as the noise; None: no band.
        rows: names that the axis shows at the values 0, 1, ...; empty: the axis shows numbers.
        spans: (row, low, high) of each horizontal line, such as an interval.
        asked: (row, low, high) of each shaded part of a row, such as a requested range.
        log: whether the vertical axis is logarithmic, for counts.
    """

    label: str
    unit: str
    curves: Sequence[Curve]
    height: int = 150
    band: tuple[float, float] | None = None
    rows: Sequence[str] = ()
    spans: Sequence[tuple[int, float, float]] = ()
    asked: Sequence[tuple[int, float, float]] = ()
    log: bool = False


@dataclass(frozen=True)
class Figure:
    """Panels, one above the other, with a common axis `x` of shape (n,), which does not decrease.

    Attributes:
        title: the accessible name of the figure.
        x_label, x_unit: the label and unit of the axis `x`.
        link: name of a group of figures that share cursor and zoom, such as all figures of a run; empty: no group.
        stretch: (from, to) of the shaded part of `x`.
        lines: values of `x` at which a line crosses all panels.
        reach: further values of `x` that the axis has to include.
        log: whether the axis `x` is logarithmic.
    """

    title: str
    x: Array
    panels: Sequence[Panel]
    x_label: str = "time"
    x_unit: str = "s"
    link: str = ""
    stretch: tuple[float, float] | None = None
    lines: Sequence[float] = ()
    reach: Sequence[float] = ()
    log: bool = False


def points_for(figures: int) -> int:
    """Returns how many points each figure of a page with `figures` figures may draw; the page then has a few MB."""
    return min(MOST_POINTS, max(_LEAST_POINTS, _PAGE_POINTS // max(figures, 1)))


def thin(columns: Array, points: int) -> NDArray[np.intp]:
    """Returns the indices of about `points` samples: in each section, those with a column's smallest or largest value.

    `columns` has the shape (columns, n). All peaks and the first and last sample are kept.
    """
    count, samples = columns.shape
    if samples <= points:
        return np.arange(samples)
    kept = _extremes(columns, max(points // (2 * count), 1))
    more = points // (2 * count) * points // len(kept)  # fewer are kept if one sample is the extreme of several columns
    return kept if len(kept) > 0.8 * points or more < 1 else _extremes(columns, min(more, points // 2))


def _extremes(columns: Array, stretches: int) -> NDArray[np.intp]:
    count, samples = columns.shape
    width = -(-samples // stretches)
    padded = np.full((count, stretches * width), np.nan)
    padded[:, :samples] = columns
    parts = padded.reshape(count, stretches, width)
    dropouts, starts = np.isnan(parts), width * np.arange(stretches)
    least = starts + np.where(dropouts, np.inf, parts).argmin(axis=2)
    most = starts + np.where(dropouts, -np.inf, parts).argmax(axis=2)
    kept = np.unique(np.concatenate([[0, samples - 1], least.ravel(), most.ravel()]))
    return np.asarray(kept[kept < samples])


def to_html(figure: Figure, points: int = MOST_POINTS) -> Markup:
    """Returns the figure as an element of a page. About `points` samples are drawn; the page says how many."""
    kept = thin(np.array([one.values for panel in figure.panels for one in panel.curves]), points)
    spec = {
        "link": figure.link,
        "x": {
            "name": figure.x_label,
            "label": f"{figure.x_label} ({figure.x_unit})" if figure.x_unit else figure.x_label,
            "values": _five_digits(figure.x[kept]) if figure.log else compact(figure.x[kept], ACROSS),
            "log": figure.log,
            "reach": list(figure.reach),
        },
        "stretch": figure.stretch,
        "lines": list(figure.lines),
        "panels": [_panel(one, figure, kept) for one in figure.panels],
    }
    thinned = f"{len(kept)} of {len(figure.x)} samples are drawn." if len(kept) < len(figure.x) else ""
    height = sum(one.height + 56 for one in figure.panels) + 36
    return element(spec, figure.title, height, thinned)


Marks = Mapping[str, tuple[Colour, Sequence[float | None]]]
"""Name of a mark -> (its colour, its value in each row; None: no mark in this row)."""


def row_chart(
    labels: Sequence[str], curves: Marks,
    spans: Sequence[tuple[float, float] | None], label: str, unit: str, *, title: str,
    lines: Sequence[float] = (), stretch: tuple[float, float] | None = None, log: bool = False,
    asked: Sequence[tuple[float, float] | None] = (),
) -> Markup:  # fmt: skip
    """Draws a row for each label; the first label is at the top.

    Args:
        curves: the marks.
        spans: for each row, (low, high) of the line under the row's marks; None: no line.
        label, unit: the label and unit of the axis along the rows.
        lines, stretch, log: as in `Figure`.
        asked: for each row, (low, high) of the shaded part; None: no shaded part.
    """
    last = len(labels) - 1
    marks = sorted(
        (value, name, last - row)
        for name, (_, values) in curves.items()
        for row, value in enumerate(values)
        if value is not None
    )
    drawn = [
        Curve(name, np.array([float(row) if one == name else np.nan for _, one, row in marks]), colour, shape="marks")
        for name, (colour, _) in curves.items()
    ]
    panel = Panel(
        "",
        "",
        drawn,
        _ROW * len(labels) + 10,
        rows=list(reversed(labels)),
        spans=[(last - row, *span) for row, span in enumerate(spans) if span is not None],
        asked=[(last - row, *span) for row, span in enumerate(asked) if span is not None],
    )
    reach = [*lines, *(stretch or ()), *(end for span in (*spans, *asked) if span is not None for end in span)]
    x = np.array([value for value, *_ in marks])
    return to_html(Figure(title, x, [panel], label, unit, "", stretch, lines, reach, log))


def element(spec: dict[str, Any], title: str, height: int, note: str = "") -> Markup:
    """Returns the element that `figures.js` fills. Texts in `spec` are escaped, so they cannot become markup.

    The page reserves `height` pixels for the figure. `note` stands below the figure.
    """
    text = htmlsafe_json_dumps(spec, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    below = f'<p class="thinned">{escape(note)}</p>' if note else ""
    return Markup(
        f'<div class="plot" role="group" aria-label="{escape(title, quote=True)}" '
        f'style="min-height: {height}px">'
        f'<script type="application/json">{text}</script>{below}</div>'
    )


def _panel(panel: Panel, figure: Figure, kept: NDArray[np.intp]) -> dict[str, Any]:
    known = np.concatenate([[0.0], *(one.values[np.isfinite(one.values)] for one in panel.curves)])
    factor, unit = scaled(float(np.abs(known).max()), panel.unit) if panel.unit else (1.0, "")
    return {
        "label": f"{panel.label} ({unit})" if unit else panel.label,
        "height": panel.height,
        "band": None if panel.band is None else [one / factor for one in panel.band],
        "rows": list(panel.rows),
        "spans": [list(one) for one in panel.spans],
        "asked": [list(one) for one in panel.asked],
        "log": panel.log,
        "curves": [_curve(one, figure.x, kept, factor) for one in panel.curves],
    }


def _curve(one: Curve, x: Array, kept: NDArray[np.intp], factor: float) -> dict[str, Any]:
    return {
        "name": one.name,
        "colour": one.colour,
        "width": one.width,
        "dash": [6, 4] if one.dashed else None,
        "shape": one.shape,
        "gap": _longest_step(one, x, kept),
        "values": compact(one.values[kept] / factor, UP),
    }


def _longest_step(one: Curve, x: Array, kept: NDArray[np.intp]) -> float:
    """Returns the distance in `x` above which no line joins two samples; samples of a slow sensor stay joined."""
    known = x[np.isfinite(one.values)]
    if len(known) < 2:
        return 0.0
    drawn = float(np.diff(x[kept]).max()) if len(kept) < len(x) else 0.0
    return float(f"{1.5 * float(np.median(np.diff(known))) + 2.0 * drawn:.3g}")


def _five_digits(values: Array) -> list[float]:
    """Returns the values with five digits each, for a logarithmic axis, which cannot show a value rounded to 0."""
    return [float(f"{one:.5g}") for one in values.tolist()]


def compact(values: Array, steps: float) -> list[float | None]:
    """Returns the values for JSON, rounded to about their range divided by `steps`; a dropout is None."""
    known = values[np.isfinite(values)]
    size = float(np.abs(known).max(initial=0.0)) if len(known) < 2 or np.ptp(known) == 0 else float(np.ptp(known))
    decimals = math.ceil(math.log10(steps / size)) if size > 0 else 0
    rounded = np.round(values, decimals) + 0.0  # turns -0 into 0
    whole = decimals <= 0
    return [None if not math.isfinite(one) else int(one) if whole else one for one in rounded.tolist()]


_ERROR_SD = 2.0  # half the width of the noise band, in standard deviations
_ERRORS, _SMALL = 100, 110  # heights of the panel of residuals and of a small panel, in pixels
_LEAST_GAP, _LEAST_FIT = 0.01, -20.0  # least gap and least fit on an axis; a smaller value is drawn at this limit
_WHISKER = 120.0  # width of the drawing of an interval in a table, in pixels


Simulated = Mapping[str, tuple[Colour, Array]]
"""Name of a simulation -> its colour and its values (n,)."""


def superimposed(
    time: Array, signal: str, unit: str, measured: Array, simulated: Simulated, *, run: str, title: str, points: int,
    noise_sd: float = 0.0, stretch: tuple[float, float] | None = None,
) -> Markup:  # fmt: skip
    """Draws measured and simulated values in one panel, as in the paper's figs 4 and 5, and below it the residuals.

    Args:
        time: the times of the run's samples in s, (n,); the axis counts from the first one.
        signal, unit: the name and unit of the values.
        measured: the measured values, (n,).
        run: the name of the run; all figures of a run are linked.
        title: accessible name of the chart.
        points: approximate number of points that are drawn.
        noise_sd: standard deviation of the noise, in `unit`; the band of the lower panel is two sd on each side.
        stretch: (from, to) of the shaded time, on the clock of `time`.
    """
    curves = [Curve(name, values, colour) for name, (colour, values) in simulated.items()]
    residuals = [replace(one, values=measured - one.values) for one in curves]
    band = (-_ERROR_SD * noise_sd, _ERROR_SD * noise_sd) if noise_sd else None
    panels = [
        Panel(signal, unit, [Curve("measured", measured, "grey", 2.2), *curves]),
        Panel(f"residual of {signal}", unit, residuals, _ERRORS, band),
    ]
    shaded = None if stretch is None else (stretch[0] - time[0], stretch[1] - time[0])
    return to_html(Figure(title, time - time[0], panels, link=run, stretch=shaded), points)


def voltages(manoeuvre: Manoeuvre, *, single: bool, title: str) -> Markup:
    """Draws the motor voltages of a manoeuvre. `single`: the vehicle has one motor, whose voltage is `voltage_left`."""
    sides = [manoeuvre.voltage_left] if single else [manoeuvre.voltage_left, manoeuvre.voltage_right]
    times = np.unique([moment for points in sides for moment, _ in points])
    before_and_after = np.repeat(times, 2) + np.tile([-1e-9, 1e-9], len(times))  # a step has two values at one time
    left, *right = (np.interp(before_and_after, *np.array(points, dtype=np.float64).T) for points in sides)
    curves = [Curve("voltage" if single else "left", left, "blue", 2.4)]
    curves += [Curve("right", values, "orange", 1.6, dashed=True) for values in right]
    return to_html(Figure(title, np.repeat(times, 2), [Panel("motor voltage", "V", curves, 130)]))


def autocorrelation(one: Whiteness, *, title: str) -> Markup:
    """Draws the autocorrelation of a residual over the lag, with the 95 % band of white noise."""
    rho = np.array(one.correlation)
    lags = one.lag_s * np.arange(1.0, len(rho) + 1.0)
    panel = Panel("autocorrelation", "", [Curve("autocorrelation", rho, shape="bars")], _SMALL, (-one.bound, one.bound))
    return to_html(Figure(title, lags, [panel], "lag", "s"))


_ROW_MARKS: tuple[tuple[str, Colour], ...] = (("before", "orange"), ("after", "blue"), ("attainable", "green"))

Rows = Sequence[tuple[str, *tuple[float | None, ...]]]
"""Rows of (label, value before, value after); a row of fits has the attainable fit as a fourth item."""


def gaps(rows: Rows, *, single: bool, title: str) -> Markup:
    """Draws the gap before and after on a log scale; a line at 1 marks the noise. `single`: see `_joined_marks`."""
    marks, spans = _joined_marks(rows, single, _LEAST_GAP)
    label = "gap: rms residual over noise"
    return row_chart([row[0] for row in rows], marks, spans, label, "", title=title, lines=(1.0,), log=True)


def fits(rows: Rows, *, single: bool, title: str) -> Markup:
    """Draws the fit before, the fit after and the attainable fit, in percent. `single`: see `_joined_marks`."""
    marks, spans = _joined_marks(rows, single, _LEAST_FIT)
    return row_chart([row[0] for row in rows], marks, spans, "fit", "%", title=title)


def _joined_marks(rows: Rows, single: bool, least: float) -> tuple[Marks, list[tuple[float, float] | None]]:
    """Returns the marks of a row chart, and for each row the line that joins them; values below `least` become `least`.

    `single`: there is only one model, so the values before are not drawn, and the values after are named
    "simulated".
    """
    drawn = [
        [None if value is None or not np.isfinite(value) else max(value, least) for value in values]
        for _, *values in rows
    ]
    columns = zip(*drawn, strict=True)
    marks: Marks = {name: (colour, values) for (name, colour), values in zip(_ROW_MARKS, columns, strict=False)}
    if single:
        marks = {"simulated" if name == "after" else name: mark for name, mark in marks.items() if name != "before"}
    ends = [[value for value in row if value is not None] for row in zip(*(v for _, v in marks.values()), strict=True)]
    return marks, [(min(known), max(known)) if known else None for known in ends]


def interval(low: float, value: float, high: float, *, inside: tuple[float, float]) -> Markup:
    """Draws a value as a dot with its interval, and a line at 0, in the range `inside`; a table has the numbers."""
    share = (np.array([low, value, high, 0.0]) - inside[0]) / (inside[1] - inside[0])
    start, middle, end, zero = np.clip(4.0 + share * (_WHISKER - 8.0), 2.0, _WHISKER - 2.0)
    return Markup(
        f'<svg class="whisker" viewBox="0 0 {_WHISKER:.0f} 18" aria-hidden="true">'
        f'<path class="zero" d="M{zero:.1f} 1V17"/><path class="span" d="M{start:.1f} 9H{end:.1f}"/>'
        f'<circle class="dot" cx="{middle:.1f}" cy="9" r="4"/></svg>'
    )
