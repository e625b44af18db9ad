"""Figures of a flight over a link: how long replies took, how punctual ticks were, what went wrong when."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.constants import STEP_S
from brickpilot.report.plot import Colour, Curve, Figure, Panel, to_html
from brickpilot.report.quantities import plain
from brickpilot.report.run_page import LINK

Array = NDArray[np.float64]

_BARS = 60
_HEIGHT = 140
_WIDEST = 99.5  # percentile of the jitter up to which bars stand; what lies beyond is in the outermost ones
_KINDS: dict[str, tuple[str, Colour]] = {
    "late_ticks": ("late tick", "orange"),
    "lost_frames": ("lost frame", "blue"),
    "refused_frames": ("refused frame", "purple"),
    "safe_stops": ("safe stop", "green"),
}


def shown(ticks: Mapping[str, Array], *, realtime: bool, replies: bool = True) -> dict[str, Any]:
    """Returns what the page shows of the ticks: figures with the sentences above them; a figure may be None.

    Args:
        ticks: the columns of ticks.csv, each (n,).
        realtime: ticks follow a clock, so that they can be unpunctual.
        replies: each set of readings gets a motor command; a brick with its own sensors and motors sends none.
    """
    return {
        "trouble": trouble(ticks),
        "round_trip": round_trip(ticks) if replies else None,
        "jitter": jitter(ticks) if realtime else None,
    }


def trouble(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns a time line of late ticks, lost and refused frames and safe stops."""
    counts = {name: int(ticks[name].sum()) for name in _KINDS}
    said = ", ".join(f"{count} {_KINDS[name][0]}{'' if count == 1 else 's'}" for name, count in counts.items())
    if not any(counts.values()):
        return f"{said}.", None
    at = np.flatnonzero(sum(ticks[name] for name in _KINDS))
    curves = [
        Curve(words, np.where(ticks[name][at] > 0, float(row), np.nan), colour, shape="marks")
        for row, (name, (words, colour)) in enumerate(_KINDS.items())
    ]
    panel = Panel("", "", curves, 26 * len(curves) + 10, rows=[words for words, _ in _KINDS.values()])
    reach = (0.0, float(ticks["time_s"][-1]))
    line = Figure(f"time line of the link: {said}", ticks["time_s"][at], [panel], link=LINK, reach=reach)
    return f"{said}.", to_html(line)


def round_trip(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns the histogram of the times from sending the sensors' readings to the motor command."""
    known = ticks["round_trip_ms"][np.isfinite(ticks["round_trip_ms"])]
    if not len(known):
        return "No reply came.", None
    known = np.maximum(known, 1e-3)
    edges = np.geomspace(known.min() / 1.05, known.max() * 1.05, _BARS + 1)
    half, most, all_of_it = (plain(float(np.percentile(known, share)), 3) for share in (50, 99, 100))
    said = f"Half of {len(known)} replies took up to {half} ms, 99 % up to {most} ms, and the slowest {all_of_it} ms"
    return f"{said}.", _histogram(f"round trip: {said}", known, edges, "round trip", log=True)


def jitter(ticks: Mapping[str, Array]) -> tuple[str, Markup | None]:
    """Returns the histogram of how much longer than a step each period was."""
    periods = 1e3 * (np.diff(ticks["begun_s"]) - STEP_S)
    known = periods[np.isfinite(periods)]
    if not len(known):
        return "There is one tick alone.", None
    far = max(float(np.percentile(np.abs(known), _WIDEST)), 1e-3)
    sd, most = plain(float(np.std(known)), 3), plain(float(np.abs(known).max()), 3)
    said = f"The period is {1e3 * STEP_S:g} ms; it differs by {sd} ms (standard deviation), and by up to {most} ms"
    text = f"{said}. Periods beyond {plain(far, 3)} ms are in the outermost bars."
    edges = np.linspace(-far, far, _BARS + 1)
    return text, _histogram(f"jitter: {said}", np.clip(known, -far, far), edges, "period less its nominal value")


def _histogram(title: str, values: Array, edges: Array, label: str, *, log: bool = False) -> Markup:
    counts = np.histogram(values, edges)[0].astype(np.float64)
    middle = np.sqrt(edges[:-1] * edges[1:]) if log else (edges[:-1] + edges[1:]) / 2
    ticks = Curve("ticks", np.where(counts > 0, counts, np.nan), shape="bars")
    return to_html(Figure(title, middle, [Panel("ticks", "", [ticks], _HEIGHT, log=True)], label, "ms", log=log))
