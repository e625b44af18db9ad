"""A track, seen from above, which `track.js` draws and plays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.report.plot import ACROSS, MOST_POINTS, UP, Curve, compact, element, thin

Array = NDArray[np.float64]


def track_to_html(
    time: Array,
    heading: Array,
    lines: Sequence[Curve],
    circles: Sequence[tuple[float, float, float, bool]],
    *,
    link: str,
    title: str = "track over the waypoints, seen from above",
) -> Markup:
    """Returns a track, seen from above, as an element of a page that can be played.

    Args:
        time, heading: of the run, (n,): s, and rad clockwise from straight up.
        lines: (2, n) each: to the right, then up, m. The first one is played, and has the samples of `time`.
        circles: the waypoints: place to the right and up, radius, m, and whether it was reached.
        link, title: see `Figure`.
    """
    kept = thin(np.concatenate([one.values for one in lines if one.values.shape[1] == len(time)]), MOST_POINTS)
    spec = {
        "track": True,
        "link": link,
        "label": "seen from above: x, forward at the start (m)",
        "across": "y, to the right (m)",
        "time": compact(time[kept], ACROSS),
        "heading": compact(heading[kept], UP),
        "lines": [_way(one, kept, len(time)) for one in lines],
        "circles": [
            {"name": str(number), "x": x, "y": y, "radius": radius, "reached": reached}
            for number, (x, y, radius, reached) in enumerate(circles, 1)
        ],
    }
    return element(spec, title, 400)


def _way(one: Curve, kept: NDArray[np.intp], samples: int) -> dict[str, Any]:
    played = one.values.shape[1] == samples
    across, up = one.values[:, kept] if played else one.values
    return {
        "name": one.name,
        "colour": one.colour,
        "width": one.width,
        "dash": [6, 4] if one.dashed else None,
        "played": played,
        "x": compact(across, UP),
        "y": compact(up, UP),
    }
