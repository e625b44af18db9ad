"""Facts that a log shows without a model: timing and manoeuvre of runs; size, noise and blanks of signals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.audit.view import Channels, integral
from brickpilot.data.audit.wiring_motion import Motion
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.holdout import kind_of, manoeuvre, turning_share
from brickpilot.data.motion import wheel_angles
from brickpilot.data.noise import Noise, noise_of, step_of
from brickpilot.data.signals import SIGNALS, Array

_LATE = 0.99  # this quantile of the time steps is reported beside the median
_EQUAL = 0.02  # share of the larger command: two commands count as equal if they differ by less
_WINDOW_S, _LEAST_WINDOWS = 0.25, 4  # length in s, and least number, of the windows in which two sides are compared
_FAST = 0.5  # share of the fastest window's motion: windows with less motion are ignored
_CORRECTION = 0.05  # limit, as a share of a run's driven rows: if fewer rows turn the robot, the run counts as straight
_REST = 10  # least number of samples before a run's first command from which the gyro's bias is taken
_BLOCKS = 20  # number of blocks of consecutive windows; their scatter gives the error of a ratio


@dataclass(frozen=True)
class RunFacts:
    """The facts of one run.

    Attributes:
        role: "fit" or "held_out": how discovery uses the run.
        manoeuvre: the kind of drive, such as "straight step forward".
        step_s: median time between samples, s; `late_s`: the 99 % quantile of this time, s.
    """

    name: str
    role: str
    manoeuvre: str
    samples: int
    duration_s: float
    step_s: float
    late_s: float


@dataclass(frozen=True)
class SignalFacts:
    """The facts of one measured signal, over all runs.

    Attributes:
        rms, noise_sd: rms of the signal, and sd of the noise in one sample, in `unit`.
        colour: the noise's colour; see `data.noise.Noise`.
        resolution: the converter's step in `unit`; 0: no step is visible.
        missing: share of the samples that are blank or left out as damaged, 0..1.
    """

    name: str
    unit: str
    rms: float
    noise_sd: float
    colour: str
    resolution: float
    missing: float


@dataclass(frozen=True)
class WeakerSide:
    """The side of a robot that moves less while both motors get the same command.

    Attributes:
        side: "left" or "right".
        share: the share, 0..1, by which this side's wheel turns less than the other wheel; low, high: the ends of the
            share's 95 % interval.
    """

    side: str
    share: float
    low: float
    high: float


def drives_straight_alone(dataset: Dataset) -> bool:
    """Returns whether a robot drives straight whenever its motors are driven, except for short corrections."""
    if dataset.vehicle == "motor":
        return False
    driven = [np.nan_to_num(motor_inputs(run, dataset)) for run in dataset.runs]
    is_straight = {kind_of(inputs) for inputs in driven} - {"rest"} == {"straight"}
    return is_straight and all(turning_share(inputs) < _CORRECTION for inputs in driven)


@dataclass(frozen=True)
class Measure:
    """A value that is computed from the channels without a model, and the ends of its 95 % interval."""

    size: float
    low: float
    high: float


def weaker_side(dataset: Dataset) -> WeakerSide | None:
    """Returns which wheel turns less under equal commands; None: no clear difference, or too few windows.

    The motions of the two wheels are compared in windows of 0.25 s in which both motors get the same voltage. No model
    is needed.
    """
    windows = _equal_windows(dataset)
    if len(windows) < _LEAST_WINDOWS:
        return None
    turns = windows[:, :2]
    stronger, weaker = (np.abs(turns).sum(axis=0).argsort()[::-1]).tolist()
    share = float(1 - np.abs(turns[:, weaker]).sum() / np.abs(turns[:, stronger]).sum())
    half_width = _half_width(1 - turns[:, weaker] / turns[:, stronger])
    if share <= half_width:
        return None
    return WeakerSide(("left", "right")[weaker], share, share - half_width, share + half_width)


def bend(dataset: Dataset, wheel_radius: float) -> Measure | None:
    """Returns the path's curvature under equal commands, rad/m, positive to the right; None: its sign is not clear.

    Args:
        wheel_radius: m, converts measured wheel angles to distance.
    """
    windows = _equal_windows(dataset)
    windows = windows[np.isfinite(windows[:, 2])]
    if len(windows) < _LEAST_WINDOWS:
        return None
    is_angle = any(wheel_angles(run) for run in dataset.runs)
    ways = windows[:, :2].mean(axis=1) * (wheel_radius if is_angle else 1.0)
    size, half_width = float(windows[:, 2].sum() / ways.sum()), _half_width(windows[:, 2] / ways)
    return None if abs(size) <= half_width else Measure(size, size - half_width, size + half_width)


def yaw_over_wheels(dataset: Dataset) -> Measure | None:
    """Returns (measured yaw) / (yaw computed from the wheels' motion and the stated lengths); None: not known.

    A constant bias of the gyro is removed. The ratio is not known if slip or the gyro's range disturbs it.
    """
    stated = {name: known.value for name, known in dataset.nominal.items()}
    if dataset.vehicle != "diff_drive":
        return None
    motion = Motion([Channels(run.time, run.inputs, run.outputs) for run in dataset.runs])
    expected = motion.geometry(stated)
    if expected is None or motion.yaw is None or motion.turning() is None:
        return None
    left, right = (motion.at[name] for name in motion.wheels)
    by_wheels, by_gyro = expected * (left - right), motion.at[motion.yaw]
    known = np.isfinite(by_wheels) & np.isfinite(by_gyro)
    by_wheels, by_gyro = (values[known] - values[known].mean() for values in (by_wheels, by_gyro))
    blocks = zip(np.array_split(by_wheels, _BLOCKS), np.array_split(by_gyro, _BLOCKS), strict=True)
    parts = [np.array([wheels @ gyro, wheels @ wheels]) for wheels, gyro in blocks]
    whole = sum(parts, np.zeros(2))
    without = np.array([(whole - part)[0] / (whole - part)[1] for part in parts])  # jackknife: without one block each
    sd = math.sqrt((len(parts) - 1) / len(parts) * float(np.sum((without - without.mean()) ** 2)))
    size = float(whole[0] / whole[1])
    return Measure(size, size - 2 * sd, size + 2 * sd)


def _half_width(each: Array) -> float:
    """Returns half the width of the 95 % interval of the mean of `each`."""
    return 2.0 * float(np.std(each, ddof=1)) / math.sqrt(len(each))


def _equal_windows(dataset: Dataset) -> Array:
    """Returns (w, 3): motion of the left and right wheel, rad or m, and yaw, rad, in fast windows with equal commands.

    A window is fast if its motion is at least half of the fastest window's. The result is empty if the wheels turn in
    opposite directions in a fast window.
    """
    of_runs = [window for run in dataset.runs for window in _windows(run, dataset)]
    windows: Array = np.array(of_runs, dtype=np.float64).reshape(-1, 3)
    sizes = np.abs(windows[:, :2]).min(axis=1, initial=np.inf)
    windows = windows[sizes > _FAST * np.max(sizes, initial=0.0)]
    return windows[:0] if (windows[:, 0] * windows[:, 1] <= 0).any() else windows


def _windows(run: Run, dataset: Dataset) -> Iterator[tuple[float, float, float]]:
    """Yields, for each window with equal voltages, the motion of the left and the right wheel, and the yaw."""
    travels = {name: travel for name, travel in run.outputs.items() if name.startswith("wheel_travel")}
    turned = wheel_angles(run) or travels
    if dataset.vehicle == "motor" or len(turned) < 2:
        return
    left, right = (turned[name] for name in sorted(turned))
    volts = np.nan_to_num(motor_inputs(run, dataset))
    yaw = _yaw(run, volts)
    larger = np.abs(volts).max(axis=1)
    equal = (larger > 0) & (np.abs(volts[:, 0] - volts[:, 1]) <= _EQUAL * larger)
    first = 0
    while first < len(run.time) - 1:
        last = int(np.searchsorted(run.time, run.time[first] + _WINDOW_S))
        if last >= len(run.time):
            return
        turn = float(left[last] - left[first]), float(right[last] - right[first])
        if equal[first:last].all() and np.isfinite(turn).all():
            yield (*turn, float(yaw[last] - yaw[first]))
        first = last


def _yaw(run: Run, volts: Array) -> Array:
    """Returns the yaw angle, rad: as measured, or else the integral of (yaw rate - its mean at rest); else NaN."""
    if "yaw_angle" in run.outputs:
        return run.outputs["yaw_angle"]
    rate = run.outputs.get("yaw_rate", np.full_like(run.time, np.nan))
    known = np.isfinite(rate)
    if not known.any():
        return rate
    still = rate[: int(np.argmax((volts != 0).any(axis=1)))]
    bias = float(np.nanmean(still)) if np.isfinite(still).sum() >= _REST else 0.0
    return integral(run.time, np.interp(run.time, run.time[known], rate[known]) - bias)


def of_run(run: Run, role: str, inputs: Array) -> RunFacts:
    """Returns the facts of a run. `inputs`: the voltages of the run's motors, (n, 1) or (n, 2) V."""
    time = run.time[_logged(run)]
    steps = np.diff(time)
    return RunFacts(
        name=run.name,
        role=role,
        manoeuvre=manoeuvre(np.nan_to_num(inputs)),
        samples=len(time),
        duration_s=float(time[-1] - time[0]),
        step_s=float(np.median(steps)),
        late_s=float(np.quantile(steps, _LATE)),
    )


def of_signals(dataset: Dataset) -> tuple[SignalFacts, ...]:
    """Returns the facts of every signal that was measured."""
    names = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    return tuple(_of_signal(dataset, name) for name in names)


def _of_signal(dataset: Dataset, name: str) -> SignalFacts:
    parts = [run.outputs[name][_logged(run)] for run in dataset.runs if name in run.outputs]
    known = [part[np.isfinite(part)] for part in parts]
    values, unit = np.concatenate(known), SIGNALS[name].unit
    if len(values) == 0:
        return SignalFacts(name, unit, 0.0, 0.0, Noise(0.0).colour, 0.0, 1.0)
    stated = dataset.signals.get(name)
    resolution = (stated and stated.resolution) or step_of(known)
    noise = noise_of(parts, resolution)
    sd = (stated and stated.noise_sd) or noise.sd
    missing = 1 - len(values) / sum(len(part) for part in parts)
    return SignalFacts(name, unit, float(np.sqrt(np.mean(values**2))), sd, noise.colour, resolution, missing)


def _logged(run: Run) -> NDArray[np.bool_]:
    """Returns the logged rows: rows with an output, and the first and last row. The program added the other rows."""
    rows: NDArray[np.bool_] = np.any([np.isfinite(values) for values in run.raw_outputs.values()], axis=0)
    rows[[0, -1]] = True
    return rows
