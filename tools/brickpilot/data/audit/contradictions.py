"""Finds whole channels that contradict the other channels of their run: a reversed sign, or another unit.

Nothing is fitted and no model is needed: only relations that hold for any machine are used (`relation_list`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import log

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.blame import Contradiction, most_likely
from brickpilot.data.audit.fault import FACTORS, clock_factors_of
from brickpilot.data.audit.other_runs import against_other_runs
from brickpilot.data.audit.relation_list import WHEEL_KINDS, Geometry
from brickpilot.data.audit.run_set import TYPICAL_INTERVAL_S, RunSet, is_output
from brickpilot.data.audit.view import RunView, drives
from brickpilot.data.audit.windows import LEAST_SAMPLES, Windows, cut

Vector = NDArray[np.float64]

_MOST = 8  # contradictions that are searched for
_LEAST_WINDOWS = 4  # of a run, for a ratio
_UNSATURATED = 0.8  # of the fastest turn of all runs: slower turns show the geometry
_TURNS = 0.3  # rad/s: least rate of a turn that shows the geometry
_TOGETHER = 0.9  # correlation of the yaw and the difference of the wheels, for the same
_TURN_PER_METRE = (0.5, 50.0)  # 1 / (2 b): b from 1 cm to 1 m
_TURN_PER_RADIAN = (0.03, 1.2)  # r / (2 b)


def contradictions(
    views: Sequence[RunView], *, wheel_radius: float | None, half_track: float | None
) -> list[Contradiction]:
    """Returns the whole channels that are wrong, the surest first. Lengths in m; None: not known."""
    windows = {k: _windows(view) for k, view in enumerate(views) if len(view.time) >= LEAST_SAMPLES}
    names = [name for name in dict.fromkeys(n for one in windows.values() for n in one.moved) if is_output(name)]
    rough = {k: {name: _roughness(values) for name, values in views[k].outputs.items()} for k in windows}
    geometry = Geometry(wheel_radius, half_track, {})
    found = _clocks_in_other_units(windows)
    found += _search(windows, names, rough, geometry)
    # The turn of the body by its wheels is learnt only now, from wheels that do not contradict each other.
    if learnt := _turned(windows, names, geometry):
        found += _search(windows, names, rough, replace(geometry, turned=learnt))
    return found + against_other_runs(RunSet(windows, names, rough, geometry))


def _clocks_in_other_units(windows: dict[int, Windows]) -> list[Contradiction]:
    """Returns runs whose sampling interval differs from the others by a unit of time, and corrects their windows."""
    intervals = {number: one.interval for number, one in windows.items()}
    odd: dict[int, float] = {}
    for number, interval in intervals.items():
        others = [other for k, other in intervals.items() if k != number]
        if others and (factors := clock_factors_of(interval / float(np.median(others)))):
            odd[number] = factors[0]
    if len(odd) == len(intervals) == 2:
        odd = dict([max(odd.items(), key=lambda one: abs(log(intervals[one[0]] / TYPICAL_INTERVAL_S)))])
    for number, factor in odd.items():
        windows[number] = windows[number].divided({"time": factor})
    return [Contradiction(("time",), factor, (number,), ()) for number, factor in odd.items()]


def _search(
    windows: dict[int, Windows],
    names: Sequence[str],
    roughness: Mapping[int, Mapping[str, float]],
    geometry: Geometry,
) -> list[Contradiction]:
    """Returns the surest contradictions one after the other; each is corrected in `windows` before the next."""
    found: list[Contradiction] = []
    while len(found) < _MOST:
        runs = RunSet(windows, names, roughness, geometry)
        best = most_likely(runs)
        if best is None:
            break
        found.append(best)
        for number in best.runs:
            windows[number] = windows[number].divided(dict.fromkeys(best.names, best.factor))
    return found


def _windows(view: RunView) -> Windows:
    driven = {f"drive_{which}": drive for which, drive in drives(view.inputs).items() if which != "yaw"}
    return cut(view.time, {**view.outputs, **driven})


def _turned(windows: Mapping[int, Windows], names: Iterable[str], geometry: Geometry) -> dict[tuple[str, str], float]:
    """Returns the yaw per difference of the wheels in most runs, for a data set that does not state the geometry.

    A value that no small vehicle has is divided by the first factor of a unit that makes it plausible. The relation is
    then broken in all runs. The fastest turns are left out, because a gyro at the end of its range would give another
    geometry.
    """
    found: dict[tuple[str, str], float] = {}
    for kind in WHEEL_KINDS:
        left, right = f"wheel_{kind}_left", f"wheel_{kind}_right"
        for yaw in {"yaw_rate", "yaw_angle"} & set(names):
            if not {left, right} <= set(names) or geometry.turn(yaw, kind) is not None:
                continue
            limits = _TURN_PER_METRE if geometry.metres(kind) == 1.0 else _TURN_PER_RADIAN
            per = float(np.sqrt(limits[0] * limits[1]))
            fastest = max((_fastest(one, yaw) for one in windows.values()), default=0.0)
            for below in (_UNSATURATED * fastest, np.inf):  # without slower turns, all turns are used
                ratios = [
                    turn
                    for one in windows.values()
                    if (turn := _turn_ratio(one, yaw, left, right, per, below)) is not None
                ]
                if ratios:
                    break
            if ratios:
                found[yaw, kind] = _plausible(float(np.median(ratios)), limits)
    return found


def _fastest(windows: Windows, yaw: str) -> float:
    """Returns the largest mean rate of turn in a window, rad/s."""
    return float(np.nanmax(np.abs(windows.moved[yaw] / windows.seconds), initial=0.0)) if yaw in windows.moved else 0.0


def _turn_ratio(windows: Windows, yaw: str, left: str, right: str, per: float, below: float) -> float | None:
    """Returns yaw per difference of the wheels from windows that turn more slowly than `below` rad/s; None: too few."""
    if not {yaw, left, right} <= windows.moved.keys():
        return None
    turn, apart = windows.moved[yaw], windows.moved[left] - windows.moved[right]
    known = np.isfinite(turn) & np.isfinite(apart) & (np.abs(turn) < below * windows.seconds)
    if np.count_nonzero(known) < _LEAST_WINDOWS:
        return None
    turn, apart, seconds = turn[known], apart[known], windows.seconds[known]
    power, other = float(turn @ turn), float(apart @ apart)
    rates = [float(np.sqrt(np.mean((values / seconds) ** 2))) for values in (turn, per * apart)]
    if min(rates) == 0.0 or max(rates) < _TURNS:
        return None
    return float(np.sqrt(power / other)) if abs(turn @ apart) > _TOGETHER * np.sqrt(power * other) else None


def _plausible(ratio: float, limits: tuple[float, float]) -> float:
    if limits[0] <= ratio <= limits[1]:
        return ratio
    listed = [one for factor in FACTORS for one in (factor, 1 / factor)]
    return next((ratio / one for one in listed if limits[0] <= ratio / one <= limits[1]), ratio)


def _roughness(values: Vector) -> float:
    """Returns the mean size of the second differences, which show noise and resolution more than motion; 0: none."""
    rough = np.abs(np.diff(values, 2))
    return float(np.mean(rough[np.isfinite(rough)])) if np.isfinite(rough).any() else 0.0
