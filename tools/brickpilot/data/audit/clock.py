"""Finds runs whose clock runs fast or slow, drifts or jumps against that of other runs or against the motion itself.

Two witnesses: the sampling interval, where the logger otherwise keeps it to a fraction of a percent; and angles beside
their rates, whose ratio is a property of the sensors and not of a run. A ratio that is off in all runs alike may be a
scale; only where wheels and gyro, two sensors, are off by the same is it the clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.view import RunView
from brickpilot.data.audit.windows import cut
from brickpilot.data.signals import RATE_OF

Vector = NDArray[np.float64]

_BLOCKS = 20
_LEAST_SAMPLES = 60
_STEADY = 0.002  # spread of the sampling interval over a run's blocks, and from run to run
_LEAST_OFF, _MOST_OFF = 0.008, 0.15  # of the interval; more is another rate by design
_ALIKE = 2 / 3  # of the runs
_SMOOTH = 0.15  # of the drift: what is left of it beside a parabola
_ROUND = 3e-4
_WINDOWS = 24
_BOUNDED = 0.5  # sd of a ratio over what is left of the way, which is not independent from window to window
_RATIO_OFF = 0.012
_SURE = 5.0  # standard errors
_DENIES = 3.0  # standard errors
_WANDER = {"yaw_angle"}  # beside its rate: a bias that wanders looks like a clock
_SENSOR = 0.002  # spread of a ratio that is always there
_AGREE = 0.4  # of the deviation
_DRIFTS = 0.02
_GAP = 8.0  # usual intervals
_STOOD = 0.35  # of what the motion would have made of the gap
_LOCAL = 10  # samples
_STEPS = 10.0  # resolutions


@dataclass(frozen=True)
class ClockFault:
    """`run`: its number; `start`: first sample whose time is wrong; `factor`: stated over true time, None where that is
    not one number; `seen`: how it shows, for people, after "its clock"."""

    run: int
    start: int
    factor: float | None
    seen: str


@dataclass(frozen=True)
class _Ratio:
    """Growth of a sum over the integral of its rate, in one run, and the change of it from the start to the end."""

    value: float
    sd: float
    trend: float
    trend_sd: float


def clock_faults(views: Sequence[RunView]) -> list[ClockFault]:
    """At most one for each run, in the runs' order."""
    ratios = _ratios(views)
    usual = _usual(ratios)
    found: dict[int, ClockFault] = {}
    for fault in (*_jumps(views), *_off_ratios(ratios, usual), *_off_intervals(views)):
        if fault.run not in found and not (fault.factor and _is_truthful(ratios[fault.run], usual, fault.factor)):
            found[fault.run] = fault
    return [found[number] for number in sorted(found)]


def _off_intervals(views: Sequence[RunView]) -> list[ClockFault]:
    blocks = {k: _block_intervals(one.time) for k, one in enumerate(views) if len(one.time) >= _LEAST_SAMPLES}
    steady = {k: float(np.median(each)) for k, each in blocks.items() if _spread(each) < _STEADY}
    usual = _usual_interval(list(steady.values())) if steady else _common_start(list(blocks.values()))
    found: list[ClockFault] = []
    for k, each in blocks.items():
        if usual is None:
            break
        off = float(np.median(each)) / usual - 1.0
        if k in steady and _LEAST_OFF < abs(off) < _MOST_OFF:
            said = f"is off: samples {1e3 * steady[k]:.4g} ms apart, {1e3 * usual:.4g} ms in the other runs"
            found.append(ClockFault(k, 0, 1.0 + off, said))
        elif k not in steady and _drifts(each, usual):
            said = f"drifts: samples from {1e3 * each[0]:.4g} to {1e3 * each[-1]:.4g} ms apart"
            found.append(ClockFault(k, 0, float(np.mean(each)) / usual, said))
    return found


def _common_start(blocks: list[Vector]) -> float | None:
    """The interval with which all runs begin, where none keeps it."""
    starts = [float(each[0]) for each in blocks]
    alike = len(starts) > 1 and (max(starts) - min(starts)) < _LEAST_OFF * min(starts)
    return float(np.median(starts)) if alike else None


def _block_intervals(time: Vector) -> Vector:
    edges = np.linspace(0, len(time) - 1, _BLOCKS + 1).astype(int)
    return np.asarray(np.diff(time[edges]) / np.diff(edges), dtype=np.float64)


def _spread(values: Vector) -> float:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return float((high - low) / middle)


def _usual_interval(intervals: list[float]) -> float | None:
    """What most runs have; of two runs, or where all differ, the one round number of ms or Hz."""
    for one in intervals:
        alike = sum(abs(other / one - 1.0) < _STEADY for other in intervals)
        if alike >= max(2.0, _ALIKE * len(intervals)) or len(intervals) == 1:
            return one
    if len(intervals) == 2:
        digits = [min(_digits(one), _digits(1 / one)) for one in intervals]
        if digits[0] != digits[1]:
            return intervals[int(digits[1] < digits[0])]
    return None


def _digits(value: float) -> int:
    """How many figures it takes to write a value."""
    scaled = value / 10.0 ** floor(log10(value))
    return next((digits for digits in range(4) if abs(round(scaled, digits) / scaled - 1.0) < _ROUND), 4)


def _drifts(blocks: Vector, usual: float) -> bool:
    """Whether the interval changes smoothly over the run, by more than a steady clock and less than by design."""
    place = np.linspace(-1.0, 1.0, len(blocks))
    smooth = np.polyval(np.polyfit(place, blocks, 2), place)
    change = float(np.ptp(smooth))
    worst = float(np.max(np.abs(smooth / usual - 1.0)))
    left = float(np.quantile(np.abs(blocks - smooth), 0.9))
    return _LEAST_OFF * usual < change and worst < 2 * _MOST_OFF and left < _SMOOTH * change


def _ratios(views: Sequence[RunView]) -> list[dict[str, _Ratio]]:
    """Of each run, by the name of the sum."""
    present = set().union(*(view.outputs for view in views))
    pairs = [(sums, rate) for sums, rate in (*RATE_OF.items(), ("yaw_angle", "yaw_rate")) if {sums, rate} <= present]
    found: list[dict[str, _Ratio]] = [{} for _ in views]
    for sums, rate in pairs:
        cuts: dict[int, tuple[Vector, Vector, Vector]] = {}
        for number, view in enumerate(views):
            if len(view.time) >= _LEAST_SAMPLES:
                windows = cut(view.time, {sums: view.outputs[sums], rate: view.outputs[rate]}, _WINDOWS)
                if {sums, rate} <= windows.moved.keys():
                    # beside the rate: a lag of it, or the bias of a gyro
                    beside = windows.changed.get(rate, windows.seconds)
                    known = np.isfinite(windows.moved[sums]) & np.isfinite(windows.moved[rate]) & np.isfinite(beside)
                    if np.count_nonzero(known) > _WINDOWS // 2 and np.any(windows.moved[rate][known]):
                        cuts[number] = windows.moved[sums][known], windows.moved[rate][known], beside[known]
        lags = [_solve(np.column_stack([rate, beside]), growth)[0][1] for growth, rate, beside in cuts.values()]
        lag = float(np.median(lags)) if lags and sums in RATE_OF else None
        for number, each in cuts.items():
            if (ratio := _ratio(*each, lag)) is not None:
                found[number][sums] = ratio
    return found


def _ratio(growth: Vector, rate: Vector, beside: Vector, lag: float | None) -> _Ratio | None:
    """`lag`: that of the sensor, from all runs, to be taken off; None: what is beside is a bias of this run."""
    place = np.linspace(-0.5, 0.5, len(growth))
    trend, trend_sd = _solve(np.column_stack([place * rate, rate, beside]), growth)
    if lag is None:
        solved, sds = _solve(np.column_stack([rate, beside]), growth)
        value, sd = float(solved[0]), float(sds[0])
    else:  # by the sums: what a sum is off by at a sample does not grow, while the way does
        way, said = (np.cumsum(one) - np.mean(np.cumsum(one)) for one in (growth - lag * beside, rate))
        value = float(way @ said) / float(said @ said)
        sd = float(np.sqrt(np.sum((way - value * said) ** 2) / (said @ said))) * _BOUNDED
    if value <= 0.0:
        return None
    return _Ratio(value, sd, float(trend[0]) / value, float(trend_sd[0]) / value)


def _solve(columns: NDArray[np.float64], values: Vector) -> tuple[Vector, Vector]:
    """Least squares: the coefficients and their sd, infinite where the columns do not tell them."""
    fitted, _, rank, _ = np.linalg.lstsq(columns, values, rcond=1e-9)
    solved = np.asarray(fitted, dtype=np.float64)
    if rank < columns.shape[1]:
        return solved, np.full(columns.shape[1], np.inf)
    left = values - columns @ solved
    spread = float(left @ left) / max(len(values) - columns.shape[1], 1)
    return solved, np.asarray(np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * spread), dtype=np.float64)


def _usual(ratios: Sequence[Mapping[str, _Ratio]]) -> dict[str, tuple[float, float]]:
    """Of each pair the median over the runs and the spread about it, where three runs or more have it."""
    found: dict[str, tuple[float, float]] = {}
    for name in dict.fromkeys(name for one in ratios for name in one):
        values = np.array([one[name].value for one in ratios if name in one and np.isfinite(one[name].sd)])
        if len(values) >= 3:
            middle = float(np.median(values))
            found[name] = middle, 1.4826 * float(np.median(np.abs(values - middle)))
    return found


def _off_ratios(ratios: Sequence[Mapping[str, _Ratio]], usual: Mapping[str, tuple[float, float]]) -> list[ClockFault]:
    found: list[ClockFault] = []
    shared = _off_in_all(usual)
    for number, each in enumerate(ratios):
        if shared is not None and each:
            found.append(
                ClockFault(
                    number,
                    0,
                    shared,
                    "is off, as the angles of wheels and of the gyro say beside their rates, in all runs",
                )
            )
            continue
        if each.keys() <= _WANDER:
            continue
        judged = {name: _off(one, *usual[name]) for name, one in each.items() if name in usual}
        sure = {name: one for name, one in judged.items() if abs(one[0]) > _SURE * one[1]}
        trends = [(one.trend, one.trend_sd) for one in each.values()]
        off = float(np.mean([one for one, _ in sure.values()])) if sure else 0.0
        if not sure.keys() <= _WANDER and _agree(list(sure.values()), _RATIO_OFF) and not _denied(judged, off):
            ratio = off + 1.0
            said = f"is off, as {' and '.join(sure)} beside the rates say and not in the other runs"
            found.append(ClockFault(number, 0, 1.0 / ratio, said))
        elif trends and _agree(trends, _DRIFTS):
            found.append(ClockFault(number, 0, None, f"drifts, as {' and '.join(each)} beside the rates say"))
    return found


def _off(ratio: _Ratio, middle: float, spread: float) -> tuple[float, float]:
    return ratio.value / middle - 1.0, float(np.hypot(np.hypot(ratio.sd, spread), _SENSOR))


def _denied(offs: Mapping[str, tuple[float, float]], by: float) -> bool:
    """Whether one that could tell says that it is not off by as much."""
    return any(abs(off - by) > max(_AGREE * abs(by), _DENIES * sd) for off, sd in offs.values())


def _agree(offs: Sequence[tuple[float, float]], least: float) -> bool:
    """Whether all are surely off, and by the same."""
    values = np.array([off for off, _ in offs])
    sure = all(abs(off) > max(least, _SURE * sd) for off, sd in offs)
    return bool(sure and np.ptp(values) < _AGREE * np.abs(values).min())


def _off_in_all(usual: Mapping[str, tuple[float, float]]) -> float | None:
    """Stated over true time where the pairs of wheels and gyro are off by the same in all runs."""
    offs = [(middle - 1.0, max(spread, _SENSOR)) for middle, spread in usual.values()]
    kinds = {"yaw" if name.startswith("yaw_") else "wheel" for name in usual}
    if len(kinds) < 2 or not _agree(offs, _RATIO_OFF):
        return None
    return 1.0 / float(np.mean([middle for middle, _ in usual.values()]))


def _is_truthful(ratios: Mapping[str, _Ratio], usual: Mapping[str, tuple[float, float]], factor: float) -> bool:
    """Whether an angle beside its rate says that the clock is right, for all its interval."""
    for name, one in ratios.items():
        if name in usual and factor != 1.0:
            off, sd = _off(one, *usual[name])
            if sd < 0.2 * abs(factor - 1.0) and abs(off) < _AGREE * abs(factor - 1.0):
                return True
    return False


def _jumps(views: Sequence[RunView]) -> list[ClockFault]:
    """Clocks that leap ahead while what moves does not: not rows that are lost, over which it moves on."""
    found: list[ClockFault] = []
    for number, view in enumerate(views):
        steps = np.diff(view.time)
        if len(view.time) < _LEAST_SAMPLES:
            continue
        for at in np.flatnonzero(steps > _GAP * np.median(steps)):
            if (_LOCAL < at < len(view.time) - _LOCAL - 1) and _stood(view, int(at)):
                found.append(
                    ClockFault(number, int(at) + 1, None, f"leaps by {steps[at]:.3g} s, in which nothing moves")
                )
                break
    return found


def _stood(view: RunView, at: int) -> bool:
    """Whether every sum that moved on both sides of the gap after sample `at` hardly moved in it."""
    time, votes = view.time, []
    for name in (*RATE_OF, "yaw_angle"):
        if name in view.outputs:
            sums = view.outputs[name]
            before = (sums[at] - sums[at - _LOCAL]) / (time[at] - time[at - _LOCAL])
            after = (sums[at + 1 + _LOCAL] - sums[at + 1]) / (time[at + 1 + _LOCAL] - time[at + 1])
            way = min(before, after, key=abs) * (time[at + 1] - time[at])
            if before * after > 0.0 and abs(way) > _STEPS * view.resolution[name]:
                votes.append(abs(sums[at + 1] - sums[at]) < _STOOD * abs(way))
    return bool(votes) and all(votes)
