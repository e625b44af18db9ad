"""Finds runs with a wrong clock, and rates that lag behind the angle or travel of the same sensor.

A wrong clock is fast or slow, drifts or jumps. Three tests find it. The first test finds a jump of the clock during
which no sum (an angle or a travel) grows. The second test compares a run's sampling interval with that of the other
runs, if the other runs' interval is constant to a fraction of a percent. The third test uses the ratio of a sum's
growth to the integral of its rate: this ratio depends only on the sensors, so it is equal in all runs.

A rate that lags is not a fault, because motor controllers report an averaged velocity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.fault import joined
from brickpilot.data.audit.view import EQUAL, RunView, Vector, cut, integral
from brickpilot.data.signals import RATE_OF

_BLOCKS = 20
_LEAST_SAMPLES = 60
_STEADY = 0.002  # sampling intervals, or a sensor's ratios, count as equal if their relative spread is below this
_OFF = 0.008  # relative difference of a run's interval from the other runs' interval: a smaller one is no fault
_ON_PURPOSE = 0.15  # an interval with a larger relative difference was chosen by the user
_ALIKE = 2 / 3  # least share of the runs that have the usual interval
_SMOOTH = 0.15  # largest residual of the parabola fitted to a drift, as a share of the drift's size
_ROUND = 3e-4  # a value counts as round if rounding changes it by less than this share
_WINDOWS = 24
_BOUNDED = 0.5  # a ratio's sd is multiplied by this, because the residuals of a summed signal are not independent
_RATIO_OFF, _DRIFTS = 0.012, 0.02  # largest deviation and trend of a ratio that bias and slip may cause
_SURE = 5.0  # limit, in standard errors: a larger deviation is certain
_WANDER = {"yaw_angle"}  # angles whose rate has a slowly changing bias, which looks like a wrong clock
_AGREE = 0.4  # two deviations agree if their relative difference is below this
_JUMP = 8.0  # in median sampling intervals: a longer step of the time is a clock's jump or lost rows
_STOOD = 0.35  # share of the motion expected during a jump: with less motion, the vehicle stood still
_LOCAL = 10  # number of samples before and after a jump from which the speeds there are computed
_STEPS = 10.0  # in resolutions: a jump is evidence only if at least this motion was expected during it
_LONGEST_S = 0.2  # longest delay that is tried, s; no sensor has a longer delay
_SPAN_S = 0.04  # s: the span over which a sum is differenced and a rate is averaged
_CLEARER = 0.8  # largest ratio (residual with the delay) / (residual without a delay) of a clear delay
_TRIED = 20  # number of delays that are tried in each direction, up to the longest delay
_AGREES = 0.5  # largest spread of the runs' delays, as a share of their median delay


@dataclass(frozen=True)
class ClockFault:
    """A wrong clock.

    Attributes:
        run: the run's number.
        start: the first sample whose time is wrong.
        factor: ratio of stated to true time; None: the ratio is not constant.
        evidence: the end of a sentence that begins with "its clock".
    """

    run: int
    start: int
    factor: float | None
    evidence: str


@dataclass(frozen=True)
class _Ratio:
    """`value`: (growth of an angle or travel) / (integral of its rate) in a run; `trend`: its relative change in it."""

    value: float
    sd: float
    trend: float
    trend_sd: float


def clock_faults(views: Sequence[RunView]) -> list[ClockFault]:
    """Returns at most one fault for each run, in the runs' order."""
    ratios = _ratios(views)
    usual = _usual(ratios)
    offs = [{name: _off(one, *usual[name]) for name, one in each.items() if name in usual} for each in ratios]
    found: dict[int, ClockFault] = {}
    for fault in (*_jumps(views), *_off_ratios(ratios, offs), *_off_intervals(views)):
        by = 0.0 if fault.factor is None else 1.0 / fault.factor - 1.0
        if fault.run not in found and not (by and _denied(offs[fault.run], by)):
            found[fault.run] = fault
    return [found[number] for number in sorted(found)]


def _off_intervals(views: Sequence[RunView]) -> list[ClockFault]:
    blocks = {k: _block_intervals(one.time) for k, one in enumerate(views) if len(one.time) >= _LEAST_SAMPLES}
    steady = {k: float(np.median(each)) for k, each in blocks.items() if _spread(each) < _STEADY}
    starts = [float(each[0]) for each in blocks.values()]
    usual = _usual_interval(list(steady.values()) if steady or len(starts) < 2 else starts)
    found: list[ClockFault] = []
    if usual is None:
        return found
    for k, each in blocks.items():
        off = float(np.median(each)) / usual - 1.0
        if k in steady and _OFF < abs(off) < _ON_PURPOSE:
            evidence = f"is off: samples {1e3 * steady[k]:.4g} ms apart, {1e3 * usual:.4g} ms in the other runs"
            found.append(ClockFault(k, 0, 1.0 + off, evidence))
        elif k not in steady and _drifts(each, usual):
            evidence = f"drifts: samples from {1e3 * each[0]:.4g} to {1e3 * each[-1]:.4g} ms apart"
            found.append(ClockFault(k, 0, float(np.mean(each)) / usual, evidence))
    return found


def _block_intervals(time: Vector) -> Vector:
    edges = np.linspace(0, len(time) - 1, _BLOCKS + 1).astype(int)
    return np.asarray(np.diff(time[edges]) / np.diff(edges), dtype=np.float64)


def _spread(values: Vector) -> float:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return float((high - low) / middle)


def _usual_interval(intervals: list[float]) -> float | None:
    """Returns the interval that most runs have; of two runs, the one that is rounder in ms or Hz; None: not known."""
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
    """Returns how many decimal places a value needs in scientific notation, at most 4."""
    scaled = value / 10.0 ** floor(log10(value))
    return next((digits for digits in range(4) if abs(round(scaled, digits) / scaled - 1.0) < _ROUND), 4)


def _drifts(blocks: Vector, usual: float) -> bool:
    """Whether the interval changes smoothly in the run, by more than noise causes and less than a user would choose."""
    place = np.linspace(-1.0, 1.0, len(blocks))
    smooth = np.polyval(np.polyfit(place, blocks, 2), place)
    change = float(np.ptp(smooth))
    residual = float(np.quantile(np.abs(blocks - smooth), 0.9))
    return _OFF * usual < change < 2 * _ON_PURPOSE * usual and residual < _SMOOTH * change


def _ratios(views: Sequence[RunView]) -> list[dict[str, _Ratio]]:
    """Returns for each run: sum (angle or travel) -> ratio of the sum's growth to its rate's integral."""
    present = set().union(*(view.outputs for view in views))
    pairs = [(sums, rate) for sums, rate in (*RATE_OF.items(), ("yaw_angle", "yaw_rate")) if {sums, rate} <= present]
    found: list[dict[str, _Ratio]] = [{} for _ in views]
    for sums, rate in pairs:
        cuts: dict[int, tuple[Vector, Vector, Vector]] = {}
        for number, view in enumerate(views):
            if len(view.time) >= _LEAST_SAMPLES:
                windows = cut(view.time, {sums: view.outputs[sums], rate: view.outputs[rate]}, _WINDOWS)
                if {sums, rate} <= windows.moved.keys():
                    # The coefficient of the fit's second column is the lag of the rate, or the bias of a gyro.
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
    """Fits `growth = ratio * rate + a * beside`.

    Args:
        beside: the change of the rate, whose coefficient is a lag; or the seconds, whose coefficient is a bias.
        lag: the sensor's lag in all runs, to be subtracted; None: the coefficient is fitted in this run.
    """
    place = np.linspace(-0.5, 0.5, len(growth))
    trend, trend_sd = _solve(np.column_stack([place * rate, rate, beside]), growth)
    if lag is None:
        solved, sds = _solve(np.column_stack([rate, beside]), growth)
        value, sd = float(solved[0]), float(sds[0])
    else:  # fits the sums instead of their growth: the error of a sum stays bounded while the path grows
        path, integral = (np.cumsum(one) - np.mean(np.cumsum(one)) for one in (growth - lag * beside, rate))
        value = float(path @ integral) / float(integral @ integral)
        sd = float(np.sqrt(np.sum((path - value * integral) ** 2) / (integral @ integral))) * _BOUNDED
    if not 1 / EQUAL < value < EQUAL:  # nothing moves, or growth or rate is in another unit
        return None
    return _Ratio(value, sd, float(trend[0]) / value, float(trend_sd[0]) / value)


def _solve(columns: NDArray[np.float64], values: Vector) -> tuple[Vector, Vector]:
    """Returns the least-squares coefficients and their sds; the sds are infinite if the columns are dependent."""
    fitted, _, rank, _ = np.linalg.lstsq(columns, values, rcond=1e-9)
    solved = np.asarray(fitted, dtype=np.float64)
    if rank < columns.shape[1]:
        return solved, np.full(columns.shape[1], np.inf)
    residual = values - columns @ solved
    spread = float(residual @ residual) / max(len(values) - columns.shape[1], 1)
    return solved, np.asarray(np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * spread), dtype=np.float64)


def _usual(ratios: Sequence[Mapping[str, _Ratio]]) -> dict[str, tuple[float, float]]:
    """Returns sum (angle or travel) -> median and spread of its ratio in the runs, if three or more runs have one."""
    found: dict[str, tuple[float, float]] = {}
    for name in dict.fromkeys(name for one in ratios for name in one):
        values = np.array([one[name].value for one in ratios if name in one and np.isfinite(one[name].sd)])
        if len(values) >= 3:
            middle = float(np.median(values))
            found[name] = middle, 1.4826 * float(np.median(np.abs(values - middle)))
    return found


def _off_ratios(
    ratios: Sequence[Mapping[str, _Ratio]],
    offs: Sequence[Mapping[str, tuple[float, float]]],
) -> list[ClockFault]:
    found: list[ClockFault] = []
    for number, (each, its_offs) in enumerate(zip(ratios, offs, strict=True)):
        sure = {name: one for name, one in its_offs.items() if abs(one[0]) > _SURE * one[1]}
        off = float(np.mean([one for one, _ in sure.values()])) if sure else 0.0
        if not sure.keys() <= _WANDER and _agree(list(sure.values()), _RATIO_OFF) and not _denied(its_offs, off):
            evidence = f"is off: {' and '.join(sure)} grow otherwise than the rates, unlike in the other runs"
            found.append(ClockFault(number, 0, 1.0 / (off + 1.0), evidence))
        elif not each.keys() <= _WANDER and _agree([(one.trend, one.trend_sd) for one in each.values()], _DRIFTS):
            evidence = f"drifts: {' and '.join(each)} depart from the integrals of the rates"
            found.append(ClockFault(number, 0, None, evidence))
    return found


def _off(ratio: _Ratio, middle: float, spread: float) -> tuple[float, float]:
    return ratio.value / middle - 1.0, float(np.hypot(np.hypot(ratio.sd, spread), _STEADY))


def _denied(offs: Mapping[str, tuple[float, float]], by: float) -> bool:
    """Whether one of the ratios certainly contradicts a clock fault of the relative size `by`."""
    return any(abs(off - by) > max(_AGREE * abs(by), _SURE * sd) for off, sd in offs.values())


def _agree(offs: Sequence[tuple[float, float]], least: float) -> bool:
    """Whether all deviations are certain, and of about the same size. `offs`: deviation and its sd, for each sensor."""
    values = np.array([off for off, _ in offs])
    sure = all(abs(off) > max(least, _SURE * sd) for off, sd in offs)
    return bool(sure and np.ptp(values) < _AGREE * np.abs(values).min())


def _jumps(views: Sequence[RunView]) -> list[ClockFault]:
    """Finds clocks that jump ahead while no angle or travel grows. If rows were lost, angle and travel would grow."""
    found: list[ClockFault] = []
    for number, view in enumerate(views):
        steps = np.diff(view.time)
        inner = slice(_LOCAL + 1, -_LOCAL - 1)
        for at in np.flatnonzero(steps[inner] > _JUMP * np.median(steps)) + _LOCAL + 1:
            if _stood(view, int(at)):
                evidence = f"jumps by {steps[at]:.3g} s, during which nothing moves"
                found.append(ClockFault(number, int(at) + 1, None, evidence))
                break
    return found


def _stood(view: RunView, at: int) -> bool:
    """Whether all angles and travels stood still during the jump after sample `at`, but grew before and after it."""
    time, votes = view.time, []
    for name in {*RATE_OF, "yaw_angle"} & view.outputs.keys():
        sums = view.outputs[name]
        before = (sums[at] - sums[at - _LOCAL]) / (time[at] - time[at - _LOCAL])
        after = (sums[at + 1 + _LOCAL] - sums[at + 1]) / (time[at + 1 + _LOCAL] - time[at + 1])
        path = min(before, after, key=abs) * (time[at + 1] - time[at])
        if abs(path) > _STEPS * view.resolution[name]:
            votes.append(abs(sums[at + 1] - sums[at]) < _STOOD * abs(path))
    return bool(votes) and all(votes)


def delays(views: Sequence[RunView]) -> dict[str, float]:
    """Returns rate -> delay in s behind the derivative of its angle or travel, if the delay is alike in all runs."""
    found: dict[str, float] = {}
    for sums, rate in RATE_OF.items():
        each = [one for view in views if (one := _delay(view, sums, rate)) is not None]
        middle = float(np.median(each)) if each else 0.0
        spread = 1.4826 * float(np.median(np.abs(np.array(each) - middle))) if each else 0.0
        # A delay of less than one row may be due to the moment at which the row is written.
        if abs(middle) > np.median([view.interval for view in views]) and spread < _AGREES * abs(middle):
            found[rate] = middle
    return found


def delay_note(found: dict[str, float]) -> str:
    """Describes the delays of rates in a sentence. `found`: rate -> delay in s."""
    late = [f"{name} by {1e3 * abs(seconds):.0f} ms" for name, seconds in found.items()]
    way = "behind" if next(iter(found.values())) > 0 else "ahead of"
    return (
        f"timing: {joined(late)} {'is' if len(late) == 1 else 'are'} {way} the derivative of the travel or angle of "
        "the same wheel, as after a filter; a model without this delay describes it as a delay of the vehicle"
    )


def _delay(view: RunView, sums: str, rate: str) -> float | None:
    """Returns the delay in one run, s; 0: no clear delay; None: the run lacks a signal or enough samples of it."""
    if not {sums, rate} <= view.outputs.keys() or view.interval > _SPAN_S:
        return None
    summed, rated = (view.sampled(name) for name in (sums, rate))
    time = np.arange(view.time[0] + _LONGEST_S + _SPAN_S, view.time[-1] - _LONGEST_S - _SPAN_S, view.interval)
    if min(len(summed), len(rated), len(time)) < _LEAST_SAMPLES:
        return None
    travel = view.outputs[sums][summed]
    grown = _growth(time, view.time[rated], integral(view.time[rated], view.outputs[rate][rated]))

    def off(delay: float) -> float:
        moved = _growth(time - delay, view.time[summed], travel)
        scale = float(moved @ grown) / max(float(moved @ moved), 1e-300)
        return float(np.sqrt(np.mean((grown - scale * moved) ** 2)))

    tried = np.linspace(-_LONGEST_S, _LONGEST_S, 2 * _TRIED + 1)
    left = np.array([off(delay) for delay in tried.tolist()])
    best = int(np.argmin(left))
    if left[best] > _CLEARER * left[_TRIED] or best in (0, len(tried) - 1):
        return 0.0
    finer = np.linspace(tried[best - 1], tried[best + 1], 2 * _TRIED + 1)
    return float(finer[int(np.argmin([off(delay) for delay in finer.tolist()]))])


def _growth(time: Vector, at: Vector, values: Vector) -> Vector:
    """Returns the change of `values` over a span of `_SPAN_S` centred on each entry of `time`."""
    return np.asarray(np.interp(time + _SPAN_S / 2, at, values) - np.interp(time - _SPAN_S / 2, at, values))
