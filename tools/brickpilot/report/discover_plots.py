"""Charts of discovery's page, as SVG elements inside it.

They are written directly and not by matplotlib, which would take longer to draw the sixty figures of twelve runs than
discovery takes to find the effect. Their colours come from the page's style sheet: light, dark or printed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from brickpilot.discover.finding import Manoeuvre, Whiteness
from brickpilot.report.plot import thin
from brickpilot.report.quantities import plain, scaled

Array = NDArray[np.float64]
Style = Literal["measured", "nominal", "augmented", "left", "right"]

_WIDTH, _LEFT, _RIGHT = 800.0, 76.0, 12.0  # of a chart, in its own units of about one pixel on a wide screen
_TOP, _BETWEEN, _BOTTOM = 6.0, 12.0, 40.0
_VALUES, _ERRORS, _VOLTAGES = 150.0, 100.0, 130.0  # heights of panels
_SMALL_WIDTH, _SMALL_LEFT = 300.0, 48.0  # of a chart in a row of charts
_ROW = 26.0
_ERROR_SD = 2.0  # half the width of the noise band, in standard deviations


@dataclass(frozen=True)
class Curve:
    """`value` against `time`, both of shape (n,); NaN is a dropout."""

    style: Style
    time: Array
    value: Array


@dataclass(frozen=True)
class _Axis:
    """Maps values from `low` to `high` onto chart positions from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: Array | float) -> Array:
        share = (np.asarray(value, dtype=np.float64) - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)

    def ticks(self, most: int) -> list[float]:
        """Returns about `most` round values within the axis."""
        values = MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(self.low, self.high)
        return [float(one) for one in values if self.low <= one <= self.high]


def superimposed(
    unit: str,
    above: Sequence[Curve],
    below: Sequence[Curve],
    noise_sd: float,
    stretch: tuple[float, float] | None = None,
    *,
    title: str,
    points: int,
) -> Markup:
    """Draws measured and simulated superimposed, as the paper's figs 4 and 5, and the residuals below.

    Args:
        unit: unit of the signal.
        above: the measured and simulated values.
        below: the residuals, each in the style of its simulation.
        noise_sd: standard deviation of a sample, in `unit`; the band of the lower panel is two of it on each side.
        stretch: (from, to) in s of the place that is shaded.
        title: accessible name of the chart.
        points: about how many points are drawn of each curve.
    """  # fmt: skip
    origin, label = _clock(above[0].time)
    x = _time_axis(above[0].time - origin)
    upper = _values_axis([one.value for one in above], _TOP, _VALUES)
    lower = _values_axis(
        [*(one.value for one in below), np.array([-_ERROR_SD * noise_sd, _ERROR_SD * noise_sd])],
        _TOP + _VALUES + _BETWEEN,
        _ERRORS,
    )
    parts = []
    if stretch is not None:
        start, end = (float(np.clip(x.at(one - origin), x.start, x.end)) for one in stretch)
        parts.append(_box("stretch", start, upper.end, end, lower.start))
    band = lower.at(np.array([_ERROR_SD * noise_sd, -_ERROR_SD * noise_sd]))
    parts.append(_box("noise", x.start, float(band[0]), x.end, float(band[1])))
    parts += _sides(upper, x, "{}", unit) + _sides(lower, x, "residual ({})", unit) + _feet(x, upper, lower, label)
    for axis, curves in ((upper, above), (lower, below)):
        parts += [_line(x, axis, one, origin, points) for one in curves]
    return _svg(_WIDTH, lower.start + _BOTTOM, title, parts)


def voltages(manoeuvre: Manoeuvre, *, single: bool, title: str) -> Markup:
    """Draws the motor voltages of a manoeuvre. `single` vehicles have one motor, whose voltage is the left one."""
    sides: list[tuple[Style, Sequence[tuple[float, float]]]] = [("left", manoeuvre.voltage_left)]
    if not single:
        sides.append(("right", manoeuvre.voltage_right))
    curves = [Curve(style, *np.array(points, dtype=np.float64).T) for style, points in sides]
    x = _Axis(0.0, manoeuvre.duration_s, _LEFT, _WIDTH - _RIGHT)
    y = _values_axis([one.value for one in curves], _TOP, _VOLTAGES)
    parts = _sides(y, x, "{}", "V") + _feet(x, y, y, "time (s)")
    parts += [_line(x, y, one, 0.0, len(one.time)) for one in curves]
    return _svg(_WIDTH, y.start + _BOTTOM, title, parts)


def autocorrelation(one: Whiteness, *, title: str) -> Markup:
    """Draws the autocorrelation of a residual over the lag, with the 95 % band of white noise."""
    rho = np.array(one.correlation)
    lags = one.lag_s * np.arange(1.0, len(rho) + 1.0)
    x = _Axis(0.0, one.lag_s * (len(rho) + 1), _SMALL_LEFT, _SMALL_WIDTH - _RIGHT)
    low, high = min(-0.3, 1.1 * float(rho.min(initial=0.0))), max(0.3, 1.1 * float(rho.max(initial=0.0)))
    y = _Axis(low, high, 116.0, 8.0)
    top, bottom = y.at(np.array([one.bound, -one.bound]))
    parts = [_box("noise", x.start, max(float(top), y.end), x.end, min(float(bottom), y.start))]
    parts += _sides(y, x, "", "", most=4) + _feet(x, y, y, "lag (s)", most=5)
    zero = float(y.at(0.0))
    stems = "".join(f"M{a:.1f} {zero:.1f}V{b:.1f}" for a, b in zip(x.at(lags), y.at(rho), strict=True))
    return _svg(_SMALL_WIDTH, y.start + _BOTTOM, title, [*parts, f'<path class="stem" d="{stems}"/>'])


def gaps(rows: Sequence[tuple[str, float | None, float | None]], *, title: str) -> Markup:
    """Draws a row for each (label, gap before, gap after) on a log scale; a line marks the noise, 1."""
    known = [max(one, 0.01) for _, *pair in rows for one in pair if one is not None and np.isfinite(one)]
    low, high = 0.85 * min(1.0, *known, 1.0), 1.15 * max(2.0, *known, 2.0)
    left = 200.0
    x = _Axis(math.log10(low), math.log10(high), left, _WIDTH - 24.0)
    bottom = 10.0 + _ROW * len(rows)
    decades = range(int(np.floor(x.low)), int(np.ceil(x.high)) + 1)
    steps = (1, 2, 5) if x.high - x.low < 2.5 else (1,)
    ticks = [step * 10.0**decade for decade in decades for step in steps if low <= step * 10.0**decade <= high]
    parts = []
    for tick in ticks:
        at = float(x.at(math.log10(tick)))
        parts += [f'<path class="{"one" if tick == 1 else "grid"}" d="M{at:.1f} 10V{bottom:.1f}"/>']
        parts += [_text(at, bottom + 15.0, plain(tick), "middle")]
    parts.append(_text((x.start + x.end) / 2, bottom + 32.0, "gap: rms residual over noise", "middle"))
    for number, (label, *pair) in enumerate(rows):
        middle = 10.0 + _ROW * (number + 0.5)
        parts.append(_text(left - 14.0, middle + 4.0, label, "end"))
        places = [float(x.at(math.log10(max(one, 0.01)))) for one in pair if one is not None and np.isfinite(one)]
        if len(places) == 2:
            parts.append(f'<path class="span" d="M{places[0]:.1f} {middle:.1f}H{places[1]:.1f}"/>')
        for at, style in zip(places, ("nominal", "augmented"), strict=False):
            parts.append(f'<circle class="dot {style}" cx="{at:.1f}" cy="{middle:.1f}" r="5"/>')
    return _svg(_WIDTH, bottom + _BOTTOM, title, parts)


def fits(rows: Sequence[tuple[str, float | None, float | None, float | None]], *, title: str) -> Markup:
    """Draws a row for each (label, fit before, after, attainable) in percent; what lies far below 0 is at the edge."""
    known = [one for _, *values in rows for one in values if one is not None]
    low = max(-20.0, 10.0 * math.floor(min([*known, 90.0]) / 10.0))
    left = 200.0
    x = _Axis(low, 100.0, left, _WIDTH - 24.0)
    bottom = 10.0 + _ROW * len(rows)
    parts = []
    for tick in x.ticks(6):
        at = float(x.at(tick))
        parts += [
            f'<path class="grid" d="M{at:.1f} 10V{bottom:.1f}"/>',
            _text(at, bottom + 15.0, plain(tick), "middle"),
        ]
    parts.append(_text((x.start + x.end) / 2, bottom + 32.0, "fit (%)", "middle"))
    for number, (label, *values) in enumerate(rows):
        middle = 10.0 + _ROW * (number + 0.5)
        parts.append(_text(left - 14.0, middle + 4.0, label, "end"))
        before, after, most = (None if one is None else float(x.at(max(one, low))) for one in values)
        if before is not None and after is not None:
            parts.append(f'<path class="span" d="M{before:.1f} {middle:.1f}H{after:.1f}"/>')
        if most is not None:
            parts.append(f'<path class="one" d="M{most:.1f} {middle - 9:.1f}V{middle + 9:.1f}"/>')
        for place, style in ((before, "nominal"), (after, "augmented")):
            if place is not None:
                parts.append(f'<circle class="dot {style}" cx="{place:.1f}" cy="{middle:.1f}" r="5"/>')
    return _svg(_WIDTH, bottom + _BOTTOM, title, parts)


def interval(low: float, value: float, high: float, *, inside: tuple[float, float]) -> Markup:
    """Draws a dot with its interval and a line at 0, within `inside`. It is decoration: the numbers stand beside it."""
    x = _Axis(*inside, 4.0, 116.0)
    start, middle, end, zero = (float(np.clip(x.at(one), 2.0, 118.0)) for one in (low, value, high, 0.0))
    return Markup(
        '<svg class="whisker" viewBox="0 0 120 18" aria-hidden="true">'
        f'<path class="zero" d="M{zero:.1f} 1V17"/><path class="span" d="M{start:.1f} 9H{end:.1f}"/>'
        f'<circle class="dot augmented" cx="{middle:.1f}" cy="9" r="4"/></svg>'
    )


def _clock(time: Array) -> tuple[float, str]:
    """Returns the origin of a run's time axis and its label; times since 1970 are too long for a tick."""
    origin = float(time[0])
    if abs(origin) <= 10.0 * float(time[-1] - time[0]):
        return 0.0, "time (s)"
    return origin, f"time (s), counted from {origin:.10g} s"


def _time_axis(time: Array) -> _Axis:
    return _Axis(float(time[0]), float(time[-1]), _LEFT, _WIDTH - _RIGHT)


def _values_axis(values: Sequence[Array], top: float, height: float) -> _Axis:
    """Returns an axis with room for all of `values` and a small margin."""
    known = np.concatenate([one[np.isfinite(one)] for one in values])
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    margin = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return _Axis(low - margin, high + margin, top + height, top)


def _sides(y: _Axis, x: _Axis, label: str, unit: str, most: int = 4) -> list[str]:
    """Draws the horizontal grid with numbers in a short unit, and `label` with that unit at the left."""
    factor, shown = scaled(max(abs(y.low), abs(y.high)), unit)
    parts = []
    for tick in y.ticks(most):
        at = float(y.at(tick))
        parts.append(f'<path class="grid" d="M{x.start:.1f} {at:.1f}H{x.end:.1f}"/>')
        parts.append(_text(x.start - 6.0, at + 4.0, plain(tick / factor), "end"))
    parts.append(f'<path class="edge" d="M{x.start:.1f} {y.end:.1f}V{y.start:.1f}"/>')
    if label:
        middle, text = (y.start + y.end) / 2, escape(label.format(shown))
        parts.append(f'<text class="label" transform="translate(14 {middle:.1f}) rotate(-90)">{text}</text>')
    return parts


def _feet(x: _Axis, upper: _Axis, lower: _Axis, label: str, most: int = 8) -> list[str]:
    """Draws the vertical grid through all panels, and the time axis below the last."""
    parts = []
    for tick in x.ticks(most):
        at = float(x.at(tick))
        parts += [f'<path class="grid" d="M{at:.1f} {axis.end:.1f}V{axis.start:.1f}"/>' for axis in {upper, lower}]
        parts.append(_text(at, lower.start + 16.0, plain(tick), "middle"))
    return [*parts, _text((x.start + x.end) / 2, lower.start + 34.0, label, "middle")]


def _line(x: _Axis, y: _Axis, curve: Curve, origin: float, points: int) -> str:
    time, value = thin(curve.time, curve.value, points)
    across, down = x.at(time - origin), y.at(value)
    known = np.isfinite(down)
    steps, pen_up = [], True
    for a, b, is_known in zip(across.tolist(), down.tolist(), known.tolist(), strict=True):
        if is_known:
            steps.append(f"{'M' if pen_up else 'L'}{a:.1f} {b:.1f}{'h0' if pen_up else ''}")  # h0: a lone sample shows
        pen_up = not is_known
    return f'<path class="curve {curve.style}" d="{"".join(steps)}"/>'


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _box(style: str, left: float, top: float, right: float, bottom: float) -> str:
    size = f'width="{max(right - left, 0.5):.1f}" height="{max(bottom - top, 0.5):.1f}"'
    return f'<rect class="{style}" x="{left:.1f}" y="{top:.1f}" {size}/>'


def _svg(width: float, height: float, title: str, parts: Sequence[str]) -> Markup:
    return Markup(
        f'<svg class="chart" role="img" aria-label="{escape(title, quote=True)}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}">'
        f"{''.join(parts)}</svg>"
    )
