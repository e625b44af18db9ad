"""One run under audit: its channels, its drives, and its motion in windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.signals import RATE_OF, SUMMED, of_motors

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_SAMPLES = 20
"""Least number of samples, or of equal samples in a row, that a test needs."""

LEAST_WINDOWS = 4
"""Least number of windows that count as evidence."""

EQUAL = 2.5
"""Lags, wrong lengths and unequal wheels change the ratio of two measurements of one motion by at most this factor."""

_FEWEST, _MOST = 8, 32  # number of windows of a run
_WINDOW_S = 0.25  # s: longer than the delays and lags of sensors, shorter than a manoeuvre
_KNOWN = 0.7  # a window counts only if this share of its samples is known
_TOGETHER = 0.9  # least correlation at which two channels count as measurements of the same motion
_TYPICAL = {
    "yaw_": 3.0, "wheel_travel": 0.5, "wheel_velocity": 0.5, "wheel_": 10.0, "position": 0.2, "velocity": 0.2,
    "angle": 10.0, "speed": 10.0, "accel_": 1.0,
}  # fmt: skip
_EDGE = 0.15  # share of a window: the velocity at a window's edge is a mean over this time before and after the edge


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of one run as measured, SI: (n,) each, NaN where blank."""

    time: Vector
    inputs: Mapping[str, Vector]
    outputs: Mapping[str, Vector]
    name: str = ""

    @cached_property
    def drives(self) -> Mapping[str, Vector]:
        """The drives "left", "right" and "yaw" (left less right), or "shaft", in the inputs' unit.

        A drive is 0 where its motor floats.
        """
        columns = np.nan_to_num(of_motors(self.inputs, catalogue.parameter("half_track").preset)).T
        if len(columns) == 1:
            return {"shaft": columns[0]}
        return {"left": columns[0], "right": columns[1], "yaw": columns[0] - columns[1]}

    @cached_property
    def interval(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))


@dataclass(frozen=True)
class Held:
    """The samples of a channel that is logged faster than it is sampled, so that several rows repeat each sample.

    Attributes:
        beat: time between two samples, s.
        fresh: (n,) whether a row has a new sample; all other rows repeat the sample before.
    """

    beat: float
    fresh: Mask

    def blank_repeats(self, values: Vector) -> None:
        """Sets the rows of `values` that repeat a blank sample to NaN."""
        sample = np.cumsum(self.fresh)
        values[np.isin(sample, sample[self.fresh & np.isnan(values)])] = np.nan


@dataclass(frozen=True, eq=False)
class RunView(Channels):
    """One run under audit, whose outputs are blanked as faults are found.

    Attributes:
        resolution: signal -> its resolution, SI.
        held: channel -> its `Held`, for channels that repeat each sample in several rows.
    """

    outputs: dict[str, Vector]
    resolution: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, Held] = field(default_factory=dict)

    def sampled(self, name: str) -> NDArray[np.intp]:
        """Returns the rows with a known, new sample of a channel."""
        known = np.isfinite(self.outputs[name])
        return np.flatnonzero(known & self.held[name].fresh if name in self.held else known)

    def once(self, name: str, part: slice = slice(None)) -> Vector:
        """Returns the values of a channel in a part of the run, without the rows that repeat a held sample."""
        values = self.outputs[name][part]
        return values[self.held[name].fresh[part]] if name in self.held else values

    def blank(self, masks: Mapping[str, Mask]) -> None:
        """Sets the samples of each signal to NaN where its mask is true."""
        for name, mask in masks.items():
            self.outputs[name][mask] = np.nan


def stretches(mask: Mask, least: int = 1) -> list[tuple[int, int]]:
    """Returns start and stop (exclusive) of each stretch of `least` true values or more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    long = np.diff(edges)[::2] >= least
    return list(zip(edges[::2][long].tolist(), edges[1::2][long].tolist(), strict=True))


def driven_by(name: str) -> str:
    """Returns which of the `drives` moves a channel; "": no single drive moves it."""
    if name.endswith(("_left", "_right")):
        return name.rsplit("_", 1)[1]
    if name.startswith("yaw_"):
        return "yaw"
    return "shaft" if name in {"speed", "angle", "position", "velocity", "current", "force"} else ""


def typical_motion(name: str) -> float:
    """Returns the fastest motion that a channel of a small machine usually measures, SI; 0: not known."""
    return next((value for start, value in _TYPICAL.items() if name.startswith(start)), 0.0)


@dataclass(frozen=True, eq=False)
class Windows:
    """The motion of one run in windows, as each channel measures it.

    In each window, a rate is integrated, and an angle is differenced. Then both have the same unit and can be compared,
    even if their noise, filters and sampling differ.

    Attributes:
        interval: median time between samples, s.
        seconds: (w,), the length of each window.
        moved: channel -> (w,), the integral of a rate or the growth of an angle or a travel, SI; NaN in windows with
            too few known samples.
        changed: channel of a wheel or motor -> (w,), the change of its rate from a window's start to its end.
        roughness: channel -> mean size of the second differences of its logged samples, in which noise and resolution
            exceed motion; 0: not known.
    """

    interval: float
    seconds: Vector
    moved: Mapping[str, Vector]
    changed: Mapping[str, Vector]
    roughness: Mapping[str, float]

    def of(self, name: str) -> Vector:
        """Returns the motion of a channel or a drive, (w,), NaN where it is not known; "drive_yaw": left less right."""
        if name == "drive_yaw":
            return self.of("drive_left") - self.of("drive_right")
        return self.moved.get(name, np.full_like(self.seconds, np.nan))

    def rms(self, values: Vector) -> float:
        """Returns the rms of (w,) values, each divided by its window's length in s; 0 if no value is known."""
        known = np.isfinite(values)
        return float(np.sqrt(np.mean((values[known] / self.seconds[known]) ** 2))) if known.any() else 0.0

    def unbiased(self, values: Vector) -> Vector:
        """Returns (w,) values less their mean rate, because a bias or a slope adds a constant rate."""
        known = np.isfinite(values)
        return values - self.seconds * (np.sum(values[known]) / max(float(np.sum(self.seconds[known])), 1e-300))

    def divided(self, factors: Mapping[str, float]) -> Windows:
        """Returns the windows with channels divided by `factors`: channel -> factor; "time" stands for the clock."""
        clock = factors.get("time", 1.0)

        def by(name: str, power: int) -> float:
            return 1.0 / (factors.get(name, 1.0) * clock**power)

        moved = {name: values * by(name, 0 if name in SUMMED else 1) for name, values in self.moved.items()}
        changed = {name: values * by(name, -1 if name in SUMMED else 0) for name, values in self.changed.items()}
        return replace(self, interval=self.interval / clock, seconds=self.seconds / clock, moved=moved, changed=changed)


def cut(time: Vector, channels: Mapping[str, Vector], count: int = 0) -> Windows:
    """Cuts one run into `count` windows; 0: into 8 to 32 of about 0.25 s. `channels`: (n,) each, NaN where unknown."""
    count = count or int(np.clip((time[-1] - time[0]) / _WINDOW_S, _FEWEST, _MOST))
    edges = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], count + 1)))
    moved: dict[str, Vector] = {}
    changed: dict[str, Vector] = {}
    roughness: dict[str, float] = {}
    for name, values in channels.items():
        known = np.isfinite(values)
        rough = np.abs(np.diff(values, 2))
        roughness[name] = float(np.mean(rough[np.isfinite(rough)])) if np.isfinite(rough).any() else 0.0
        if np.count_nonzero(known) < 2:
            continue
        whole = values if known.all() else np.interp(time, time[known], values[known])
        sums = whole if name in SUMMED else integral(time, whole)
        thin = np.diff(np.concatenate([[0], np.cumsum(known)])[edges]) < _KNOWN * np.diff(edges)
        moved[name] = np.where(thin, np.nan, np.diff(sums[edges]))
        if name in RATE_OF or name in RATE_OF.values():
            changed[name] = np.where(thin, np.nan, np.diff(_rate_at(time, sums, edges)))
    return Windows(float(np.median(np.diff(time))), np.diff(time[edges]), moved, changed, roughness)


def integral(time: Vector, rate: Vector) -> Vector:
    """Returns the integral of a rate from the first sample on, by the trapezoidal rule."""
    steps = (rate[1:] + rate[:-1]) / 2 * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def ratio_of(motion: Vector, against: Vector) -> float | None:
    """Returns the signed ratio of two motions, (w,) each; None: too few windows, or they do not move together."""
    known = np.isfinite(motion) & np.isfinite(against)
    y, x = motion[known], against[known]
    power = float(np.sqrt((y @ y) * (x @ x)))
    if len(y) < LEAST_WINDOWS or abs(float(y @ x)) < _TOGETHER * power or power == 0.0:
        return None
    return float(np.copysign(np.sqrt((y @ y) / (x @ x)), y @ x))


def _rate_at(time: Vector, sums: Vector, edges: NDArray[np.intp]) -> Vector:
    half = max(1, round(_EDGE * float(np.median(np.diff(edges)))))
    before, after = np.maximum(edges - half, 0), np.minimum(edges + half, len(time) - 1)
    return (sums[after] - sums[before]) / (time[after] - time[before])
