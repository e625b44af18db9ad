"""What the black box is told: what the simulator is told, and what the nominal simulation makes of it. No measurement.

A window also starts from what was measured there. So does the simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brickpilot.discover.yardstick.rows import Rows
from brickpilot.fit.horizons import Course, Track
from brickpilot.fit.replay import Outputs, Replay

Array = NDArray[np.float64]

_FILTERS_S = (0.1, 0.5, 2.0)  # time constants: a motor, a body, what is slow
_LAGS_S = (0.05, 0.15)
_STANDSTILL_SHARE = 0.03  # of the largest speed: below, a direction fades out
_SETTLING_S = 0.3


@dataclass
class Table:
    """Columns under construction: see `Features`."""

    rows: Rows
    columns: list[Array] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)

    def add(self, group: str, *columns: Array) -> None:
        """Adds columns (rows,) to a group; those that never change are left out."""
        for column in columns:
            known = np.nan_to_num(column)
            if np.ptp(known) > 0:
                self.columns.append(known)
                self.groups.append(group)

    def past(self, column: Array, times: tuple[float, ...] = _FILTERS_S) -> list[Array]:
        """Returns `column` (rows,) through first-order filters that start anew with each run."""
        return [self._by_run(column, partial(_filtered, t)) for t in times]

    def lagged(self, column: Array) -> list[Array]:
        """Returns `column` (rows,) as it was a while ago, and 0 before the run."""
        return [self._by_run(column, partial(_shifted, t)) for t in _LAGS_S]

    def rate(self, column: Array) -> Array:
        """Returns the change of `column` per second; the first row of a run has the value of the second."""
        return self._by_run(column, lambda one, step: np.gradient(one) / step if len(one) > 1 else np.zeros(1))

    def _by_run(self, column: Array, work: Callable[[Array, float], Array]) -> Array:
        found = np.zeros(len(column))
        for run in np.unique(self.rows.run):
            here = self.rows.run == run
            time = self.rows.time[here]
            step = max(float(np.median(np.diff(time))), 1e-6) if len(time) > 1 else 1.0
            found[here] = work(column[here], step)
        return found


@dataclass(frozen=True)
class Features:
    """The columns (rows, columns) of one horizon, and the group of each column in words."""

    columns: Array
    groups: tuple[str, ...]


def features(
    track: Track, course: Course, rows: Rows, free: Mapping[str, Outputs], here: Mapping[str, Outputs]
) -> Features:
    """Returns what the black box is told at one horizon.

    Args:
        free: run -> outputs of the nominal model's free run: what the past was like.
        here: run -> its outputs at this horizon.
    """
    table = Table(rows)
    runs = [one.run for one in course.stretches]

    def of(outputs: Mapping[str, Outputs], name: str) -> Array:
        return rows.mean(np.concatenate([outputs[run.name][name] for run in runs]))

    _inputs(table, track)
    names = free[runs[0].name].keys()
    for name in _speeds(names):
        _speed(table, of(here, name), of(free, name))
    if "yaw_rate" in names:
        _turning(table, of(here, "yaw_rate"), of(free, "yaw_rate"), of(here, "surge"))
    for name in sorted(names & {"wheel_angle_left", "wheel_angle_right", "angle"}):
        table.add("wheel angle", np.sin(of(here, name)), np.cos(of(here, name)))
    if "position" in names:
        table.add("position", of(here, "position"))
    _clocks(table, track)
    if course.marks:
        _start(table, track, course, free)
    return Features(np.column_stack(table.columns), tuple(table.groups))


def _speeds(names: Collection[str]) -> list[str]:
    """Returns the speeds that a vehicle's simulation gives, each motion once."""
    wheels = [name for name in ("wheel_speed_left", "wheel_speed_right") if name in names]
    return wheels or [next(name for name in ("speed", "velocity") if name in names)]


def _inputs(table: Table, track: Track) -> None:
    given = Replay(track.dataset).inputs
    whole = np.concatenate([given[run.name] for run in track.dataset.runs])
    for index in range(whole.shape[1]):
        floats = table.rows.mean(np.isnan(whole[:, index]).astype(np.float64))
        volts = np.nan_to_num(table.rows.mean(whole[:, index]))
        small = max(_STANDSTILL_SHARE * float(np.abs(volts).max()), 1e-12)
        table.add("input", volts, *table.past(volts), *table.lagged(volts), floats, *table.past(floats, (0.1,)))
        table.add("input", np.tanh(volts / small), table.rate(volts))


def _speed(table: Table, speed: Array, free: Array) -> None:
    small = max(_STANDSTILL_SHARE * float(np.abs(free).max()), 1e-12)
    side, slowed = np.tanh(speed / small), np.tanh(free / small)
    table.add(
        "speed", speed, speed * np.abs(speed), np.abs(speed), *table.past(free), *table.past(np.abs(free), (0.5,))
    )
    table.add("direction", side, *table.past(slowed))
    table.add("acceleration", table.rate(free), *table.past(table.rate(free), (0.1,)))


def _turning(table: Table, yaw_rate: Array, free: Array, surge: Array) -> None:
    small = max(_STANDSTILL_SHARE * float(np.abs(free).max()), 1e-12)
    table.add("turning", yaw_rate, np.abs(yaw_rate), yaw_rate * np.abs(yaw_rate), surge * yaw_rate)
    table.add("turning", np.abs(surge) * yaw_rate, np.tanh(yaw_rate / small), *table.past(free))
    table.add("turning", *table.past(np.tanh(free / small), (0.1, 0.5)), table.rate(free))


def _clocks(table: Table, track: Track) -> None:
    time, run = table.rows.time, table.rows.run
    table.add("time in run", time, np.exp(-time / _SETTLING_S))
    ages, age = [], 0.0
    for one in track.dataset.runs:
        age += one.gap_s
        ages.append(age)
        age += float(one.time[-1] - one.time[0])
    table.add("time since power-on", np.array(ages)[run] + time)


def _start(table: Table, track: Track, course: Course, free: Mapping[str, Outputs]) -> None:
    """Adds what was measured at the start of a window, and how far the free run was from it."""
    since = table.rows.mean(np.concatenate([one.since_start for one in course.stretches]))
    table.add("time in window", since)
    first = track.starts[course.stretches[0].run.name]
    for name in first:
        measured, away = [], []
        for one in course.stretches:
            value = track.starts[one.run.name].get(name, np.full(len(one.run.time), np.nan))[one.start]
            simulated = free[one.run.name].get(name)
            measured.append(value)
            away.append(value - simulated[one.start] if simulated is not None else np.full(len(value), np.nan))
        if name in _RATES:
            start, off = table.rows.mean(np.concatenate(measured)), table.rows.mean(np.concatenate(away))
            table.add("start state", start, off, off * since, off * np.exp(-since / _SETTLING_S))


_RATES = frozenset({"speed", "velocity", "yaw_rate"}) | {
    f"wheel_{kind}_{side}" for kind in ("speed", "velocity") for side in ("left", "right")
}


def _filtered(constant: float, values: Array, step: float) -> Array:
    """Returns `values` (n,) through a first-order filter that starts at 0, with a time constant in s."""
    kept = float(np.exp(-step / constant))
    return np.asarray(lfilter([1 - kept], [1.0, -kept], values))


def _shifted(lag: float, values: Array, step: float) -> Array:
    count = min(round(lag / step), len(values))
    return np.concatenate([np.zeros(count), values[: len(values) - count]])
