"""Manoeuvres: commanded voltages between break points, and the lists of manoeuvres that the suites use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Manoeuvre:
    """One run's commanded voltages, linear between break points.

    Attributes:
        name: name of the run and of its file.
        time: (k,) s from the run's start, never decreasing; a step consists of two points at the same time.
        left: (k,) V, constant before the first and after the last point.
        right: (k,) V.
        duration_s: length of the run, above 0.
    """

    name: str
    time: tuple[float, ...]
    left: tuple[float, ...]
    right: tuple[float, ...]
    duration_s: float

    def __post_init__(self) -> None:
        if not self.time or not len(self.time) == len(self.left) == len(self.right):
            raise ValueError(f"{self.name}: break points need one time, left and right each")
        if any(later < earlier for earlier, later in zip(self.time, self.time[1:], strict=False)):
            raise ValueError(f"{self.name}: break points go back in time")
        if not self.duration_s > 0:
            raise ValueError(f"{self.name}: lasts {self.duration_s} s")

    def held(self, sample_s: float) -> tuple[Floats, Floats, Floats]:
        """Returns the brick's outputs: time (n,) s, left (n,) and right (n,) V. Sample k is held until sample k + 1.

        At the time of a voltage step, the second of the step's two points counts.
        """
        time: Floats = np.arange(round(self.duration_s / sample_s) + 1, dtype=float) * sample_s
        return time, _at(time, self.time, self.left), _at(time, self.time, self.right)


def _at(time: Floats, points: Sequence[float], volts: Sequence[float]) -> Floats:
    at, values = np.asarray(points, dtype=float), np.asarray(volts, dtype=float)
    after = np.searchsorted(at, time + 1e-9, side="right")
    left, right = np.clip(after - 1, 0, len(at) - 1), np.clip(after, 0, len(at) - 1)
    span = at[right] - at[left]
    share = np.where(span > 0, (time - at[left]) / np.where(span > 0, span, 1.0), 0.0)
    return np.asarray(values[left] + np.clip(share, 0.0, 1.0) * (values[right] - values[left]), dtype=float)


def from_table(table: Mapping[str, Any]) -> Manoeuvre:
    """Returns a manoeuvre from the ``next_experiment`` of a verdict.

    Args:
        table: ``name``, ``duration_s``, ``voltage_left`` and ``voltage_right``: lists of [s, V].

    Raises:
        ValueError: the break points are not a manoeuvre.
    """
    sides = [np.asarray(table[key], dtype=float).reshape(-1, 2) for key in ("voltage_left", "voltage_right")]
    times = sorted({float(t) for side in sides for t in side[:, 0]})
    points = [t for t in times for _ in range(2)]
    volts = [[value for t in times for value in _both_sides(side, t)] for side in sides]
    return Manoeuvre(str(table["name"]), tuple(points), tuple(volts[0]), tuple(volts[1]), float(table["duration_s"]))


def _both_sides(side: Floats, time: float) -> tuple[float, float]:
    """Returns the voltages just before and just after `time`."""
    at, volts = side[:, 0], side[:, 1]
    exact = np.flatnonzero(at == time)
    if len(exact):
        return float(volts[exact[0]]), float(volts[exact[-1]])
    between = float(np.interp(time, at, volts))
    return between, between


def steps(name: str, duration_s: float, *stages: tuple[float, float, float]) -> Manoeuvre:
    """Returns a manoeuvre that holds 0 V, then the voltages of each stage (start in s, left in V, right in V)."""
    time, left, right = [0.0], [0.0], [0.0]
    for start, volts_left, volts_right in stages:
        time += [start, start]
        left += [left[-1], volts_left]
        right += [right[-1], volts_right]
    return Manoeuvre(name, tuple(time), tuple(left), tuple(right), duration_s)


def ramps(name: str, duration_s: float, *points: tuple[float, float, float]) -> Manoeuvre:
    """Returns a manoeuvre of straight lines between points (time in s, left in V, right in V)."""
    time, left, right = zip(*points, strict=True)
    return Manoeuvre(name, time, left, right, duration_s)


def chirp(name: str, duration_s: float, amplitude: float, periods: Sequence[float], *, opposite: bool) -> Manoeuvre:
    """Returns square waves of +-`amplitude` V, one for each of `periods` (s) in turn; at the end the voltage is 0."""
    stages, now, index = [], 0.0, 0
    while now < duration_s - 1.0:
        half = 0.5 * periods[(index // 2) % len(periods)]
        volts = amplitude if index % 2 == 0 else -amplitude
        stages.append((now, volts, -volts if opposite else volts))
        now, index = now + half, index + 1
    return steps(name, duration_s, *stages, (min(now, duration_s - 0.5), 0.0, 0.0))


def catalogue(scale: float = 1.0) -> dict[str, Manoeuvre]:
    """Returns fourteen manoeuvres by name. `scale` multiplies all times."""
    s = scale
    d = 10.0 * s
    drives = [
        steps("forward_half", d, (0.5 * s, 4.5, 4.5), (7 * s, 0, 0)),
        steps("backward_half", d, (0.5 * s, -4.5, -4.5), (7 * s, 0, 0)),
        steps("forward_back_full", d, (0.0, 9, 9), (4 * s, -9, -9), (8 * s, 0, 0)),
        steps("spin_right", d, (0.5 * s, 3.3, -3.3), (5 * s, 1.8, -1.8), (8 * s, 0, 0)),
        steps("spin_left", d, (0.0, -3.3, 3.3), (5 * s, -1.8, 1.8), (8 * s, 0, 0)),
        steps("curve_right", d, (0.0, 7, 3), (6 * s, 4, 1.5), (9 * s, 0, 0)),
        steps("curve_left", d, (0.5 * s, 3, 7), (6 * s, 1.5, 4), (9 * s, 0, 0)),
        steps("left_alone", d, (0.0, 6, 0), (4 * s, -6, 0), (8 * s, 0, 0)),
        steps("right_alone", d, (0.5 * s, 0, 6), (4 * s, 0, -6), (8 * s, 0, 0)),
        ramps("ramp_through_zero", d, (0, 0, 0), (2 * s, 5, 5), (7 * s, -5, -5), (9 * s, 0, 0)),
        ramps("creep", d, (0, 0, 0), (4 * s, 1.6, 1.6), (6 * s, 0.6, -0.6), (9 * s, -1.6, 1.6), (9.5 * s, 0, 0)),
        chirp("square_waves", d, 5.0, [1.6 * s, 0.8 * s, 0.4 * s], opposite=False),
        chirp("square_spins", d, 3.0, [1.6 * s, 0.8 * s, 0.4 * s], opposite=True),
        steps("long_run", 2 * d, (0.5 * s, 6, 6.0), (16 * s, 3, 3), (18 * s, 0, 0)),
    ]  # fmt: skip
    return {drive.name: drive for drive in drives}


def twelve() -> tuple[Manoeuvre, ...]:
    """Returns the standard list: twelve runs of 10 s."""
    return tuple(run for name, run in catalogue().items() if name not in ("backward_half", "long_run"))


def short() -> tuple[Manoeuvre, ...]:
    """Returns eight runs of 5 s, for continuous integration."""
    names = ("forward_half", "forward_back_full", "spin_right", "spin_left", "curve_left", "left_alone",
             "ramp_through_zero", "square_waves")  # fmt: skip
    runs = catalogue(0.5)
    return tuple(runs[name] for name in names)


def varied(runs: Sequence[Manoeuvre], random: np.random.Generator) -> tuple[Manoeuvre, ...]:
    """Returns the runs with each run's voltages scaled by its own random share of 82 to 100 %."""
    shares = random.uniform(0.82, 1.0, len(runs))
    return tuple(
        replace(run, left=tuple(share * v for v in run.left), right=tuple(share * v for v in run.right))
        for run, share in zip(runs, shares.tolist(), strict=True)
    )
