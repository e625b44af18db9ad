"""The regions of a hidden effect: spans of a signal in which the engine's run with the effect differs from the run
without the effect.

No parameter is fitted to make up for the effect, so regions also show all later consequences of the effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from hidden.recipe import Floats, Track

WINDOW_S = 0.1
"""Length of the windows over which the rms of the difference is taken, s."""
ABOVE = 1.0
"""A window belongs to a region if the rms of the difference in the window is above this, in noise sd."""
BRIDGED_S = 0.3
"""Two regions that are less than this apart become one region, s."""

SLOW_M_S, SLOW_RAD_S = 0.02, 0.05
"""Lowest values of the thresholds of `conditions` for speed, m/s, and yaw rate, rad/s; the thresholds grow with the
run's largest speed and yaw rate."""

COVERS, LIFT = 0.6, 1.3
"""A region gets a condition only if samples with the condition have at least the share `COVERS` of the region's sum of
squared differences, and more than `LIFT` times the condition's share of the run's time."""


@dataclass(frozen=True)
class Region:
    """A span of one signal of one run in which the effect is visible.

    Attributes:
        from_s, to_s: start and end of the span, s after the start of the run.
        share: 0..1, the region's share of the squared differences, in noise variances, summed over all regions.
        when: a condition of `conditions` on the vehicle's motion; "throughout" if no condition fits the region.
    """

    run: str
    signal: str
    from_s: float
    to_s: float
    share: float
    when: str


def of(
    names: Sequence[str],
    changed: Sequence[Mapping[str, Floats]],
    plain: Sequence[Mapping[str, Floats]],
    tracks: Sequence[Track],
    noise_sd: Mapping[str, float],
    sample_s: float,
) -> list[dict[str, object]]:
    """Returns each region as a dictionary with the keys of `Region`, ordered by run, signal and time.

    Args:
        names: names of the runs.
        changed, plain: for each run, signal -> (n,) noise-free values, with the effect and without the effect.
        tracks: the tracks with the effect.
        noise_sd: signal -> noise sd.
    """
    found: list[tuple[Region, float]] = []
    for name, with_it, without, track in zip(names, changed, plain, tracks, strict=True):
        for signal, values in with_it.items():
            square = ((values - without[signal]) / noise_sd[signal]) ** 2
            for first, last in _spans(square, sample_s):
                inside = slice(first, last)
                when = _condition(track, square, inside, sample_s)
                region = Region(name, signal, round(first * sample_s, 3), round(last * sample_s, 3), 0.0, when)
                found.append((region, float(square[inside].sum())))
    total = sum(part for _, part in found)
    return [asdict(region) | {"share": round(part / total, 5)} for region, part in found]


def _spans(square: Floats, sample_s: float) -> list[tuple[int, int]]:
    """Returns (first, end) of each span in which the rms over each window is above `ABOVE`; sample `end` is outside.

    Args:
        square: (n,) squared difference in noise variances.
    """
    window = max(1, round(WINDOW_S / sample_s))
    count = -(-len(square) // window)
    sums = np.add.reduceat(square, np.arange(count) * window)
    above = sums / np.minimum(window, len(square) - np.arange(count) * window) > ABOVE**2
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]]).astype(np.int8)))
    out: list[tuple[int, int]] = []
    for first, end in edges.reshape(-1, 2).tolist():
        start, stop = first * window, min(end * window, len(square))
        if out and (start - out[-1][1]) * sample_s < BRIDGED_S:
            out[-1] = (out[-1][0], stop)
        else:
            out.append((start, stop))
    return out


def conditions(speed: Floats, turn: Floats) -> dict[str, NDArray[np.bool_]]:
    """Returns condition -> (n,) whether the condition holds. `speed`: surge, m/s; `turn`: yaw rate, rad/s clockwise."""
    fast = max(0.5 * float(np.abs(speed).max()), SLOW_M_S)
    turning = max(0.2 * float(np.abs(turn).max()), SLOW_RAD_S)
    return {
        "speed > 0": speed > 0.1 * fast,
        "speed < 0": speed < -0.1 * fast,
        "near standstill": np.abs(speed) < 0.1 * fast,
        "at high speed": np.abs(speed) > fast,
        "turning right": turn > turning,
        "turning left": turn < -turning,
        "turning": np.abs(turn) > turning,
    }


def _condition(track: Track, square: Floats, inside: slice, sample_s: float) -> str:
    """Returns the condition whose share of a region's squared difference is largest relative to its share of time."""
    hold = round(sample_s / track.oversample_s)
    speed, turn = track.surge[::hold][: len(square)], track.yaw_rate[::hold][: len(square)]
    part = np.zeros(len(square))
    part[inside] = square[inside]
    best, lift = "throughout", LIFT
    for text, mask in conditions(speed, turn).items():
        covered, time = float(part[mask].sum() / part.sum()), float(mask.mean())
        if covered >= COVERS and time > 0 and covered / time > lift:
            best, lift = text, covered / time
    return best
