"""Figures of discovery's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.discover.finding import Whiteness
from brickpilot.report.plot import Colour, Curve, Figure, Panel, row_chart, to_html
from brickpilot.vehicle.manoeuvres import Manoeuvre

Array = NDArray[np.float64]

_ERROR_SD = 2.0  # half the width of the noise band, in standard deviations
_ERRORS, _SMALL = 100, 110  # heights of panels, pixels
_LEAST_GAP, _LEAST_FIT = 0.01, -20.0  # what lies below is drawn there
_WHISKER = 120.0  # width of an interval in a table


def measured(values: Array) -> Curve:
    """Returns the curve of a measured signal, drawn behind the simulated ones."""
    return Curve("measured", values, "grey", 2.2)


def superimposed(
    time: Array, signal: str, unit: str, above: Sequence[Curve], below: Sequence[Curve], noise_sd: float,
    stretch: tuple[float, float] | None = None, *, run: str, title: str, points: int,
) -> Markup:  # fmt: skip
    """Draws measured and simulated superimposed, as the paper's figs 4 and 5, and the residuals below.

    Args:
        time: of the run, s, (n,).
        signal, unit: of the values.
        above: the measured and simulated values.
        below: the residuals, each in the colour of its simulation.
        noise_sd: standard deviation of a sample, in `unit`; the band of the lower panel is two of it on each side.
        stretch: (from, to) in s of the place that is shaded.
        run: the figures of one run are linked.
        title: accessible name of the chart.
        points: about how many points are drawn.
    """
    band = (-_ERROR_SD * noise_sd, _ERROR_SD * noise_sd) if noise_sd else None
    panels = [Panel(signal, unit, above), Panel(f"residual of {signal}", unit, below, _ERRORS, band)]
    return to_html(Figure(title, time, panels, link=run, stretch=stretch), points)


def voltages(manoeuvre: Manoeuvre, *, single: bool, title: str) -> Markup:
    """Draws the motor voltages of a manoeuvre. `single` vehicles have one motor, whose voltage is the left one."""
    sides = {"voltage" if single else "left": manoeuvre.voltage_left}
    if not single:
        sides["right"] = manoeuvre.voltage_right
    times = np.unique([moment for points in sides.values() for moment, _ in points])
    before_and_after = np.repeat(times, 2) + np.tile([-1e-9, 1e-9], len(times))  # a step has two values at one time
    curves = [
        Curve(name, np.interp(before_and_after, *np.array(points, dtype=np.float64).T), colour, width, dashed=dashed)
        for (name, points), (colour, width, dashed) in zip(sides.items(), _SIDES, strict=False)
    ]
    return to_html(Figure(title, np.repeat(times, 2), [Panel("motor voltage", "V", curves, 130)]))


_SIDES: tuple[tuple[Colour, float, bool], ...] = (("blue", 2.4, False), ("orange", 1.6, True))


def autocorrelation(one: Whiteness, *, title: str) -> Markup:
    """Draws the autocorrelation of a residual over the lag, with the 95 % band of white noise."""
    rho = np.array(one.correlation)
    lags = one.lag_s * np.arange(1.0, len(rho) + 1.0)
    panel = Panel("autocorrelation", "", [Curve("autocorrelation", rho, shape="bars")], _SMALL, (-one.bound, one.bound))
    return to_html(Figure(title, lags, [panel], "lag", "s"))


def gaps(rows: Sequence[tuple[str, float | None, float | None]], *, single: bool, title: str) -> Markup:
    """Draws a row for each (label, gap before, gap after) on a log scale; a line marks the noise, 1.

    `single`: there is only one model, so the gap before is not drawn.
    """
    curves: dict[str, tuple[Colour, list[float | None]]] = {
        "before": ("orange", [_at_least(before, _LEAST_GAP) for _, before, _ in rows]),
        "after": ("blue", [_at_least(after, _LEAST_GAP) for _, _, after in rows]),
    }
    if single:
        curves = {"simulated": curves["after"]}
    label = "gap: rms residual over noise"
    return _row_chart([one for one, *_ in rows], curves, label, "", title=title, lines=(1.0,), log=True)


def fits(rows: Sequence[tuple[str, float | None, float | None, float | None]], *, single: bool, title: str) -> Markup:
    """Draws a row for each (label, fit before, after, attainable) in percent; values far below 0 are at the edge.

    `single`: there is only one model, so the fit before is not drawn.
    """
    before = [_at_least(one, _LEAST_FIT) for _, one, _, _ in rows]
    after = [_at_least(one, _LEAST_FIT) for _, _, one, _ in rows]
    most = [_at_least(one, _LEAST_FIT) for _, _, _, one in rows]
    models: dict[str, tuple[Colour, list[float | None]]] = {"before": ("orange", before), "after": ("blue", after)}
    if single:
        models = {"simulated": ("blue", after)}
    models["attainable"] = ("green", most)
    return _row_chart([one for one, *_ in rows], models, "fit", "%", title=title)


def _at_least(value: float | None, least: float) -> float | None:
    return None if value is None or not np.isfinite(value) else max(value, least)


def _row_chart(
    labels: Sequence[str], curves: Mapping[str, tuple[Colour, Sequence[float | None]]], label: str, unit: str, *,
    title: str, lines: Sequence[float] = (), log: bool = False,
) -> Markup:  # fmt: skip
    """Draws a row for each label with a mark for each curve, joined; curves are name -> (colour, a value per row)."""
    ends = [[one for _, values in curves.values() if (one := values[row]) is not None] for row in range(len(labels))]
    spans = [(min(known), max(known)) if known else None for known in ends]
    return row_chart(labels, curves, spans, label, unit, title=title, lines=lines, log=log)


def interval(low: float, value: float, high: float, *, inside: tuple[float, float]) -> Markup:
    """Draws a dot with its interval and a line at 0, within `inside`. It is decoration: the numbers stand beside it."""
    share = (np.array([low, value, high, 0.0]) - inside[0]) / (inside[1] - inside[0])
    start, middle, end, zero = np.clip(4.0 + share * (_WHISKER - 8.0), 2.0, _WHISKER - 2.0)
    return Markup(
        f'<svg class="whisker" viewBox="0 0 {_WHISKER:.0f} 18" aria-hidden="true">'
        f'<path class="zero" d="M{zero:.1f} 1V17"/><path class="span" d="M{start:.1f} 9H{end:.1f}"/>'
        f'<circle class="dot" cx="{middle:.1f}" cy="9" r="4"/></svg>'
    )
