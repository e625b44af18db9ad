"""What a log shows before any model: timing, manoeuvre and repeats of runs; size, noise and blanks of signals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.holdout import kind_of, manoeuvre
from brickpilot.data.motion import wheel_angles
from brickpilot.data.noise import Noise, noise_of, step_of
from brickpilot.data.signals import SIGNALS

Array = NDArray[np.float64]

_LATE = 0.99  # quantile of the steps between samples that is reported beside their median
_EQUAL = 0.02  # of the larger command: two commands that differ by less are the same
_WINDOW_S, _LEAST_WINDOWS = 0.25, 4  # over which the sides are compared, and how many of them are needed
_FAST = 0.5  # of the fastest window: a slower one is a start or a stop


@dataclass(frozen=True)
class RunFacts:
    """One run.

    Attributes:
        role: "fit" or "held_out", as discovery takes it.
        manoeuvre: what is driven, such as "straight step forward".
        step_s: median time between samples, s; `late_s`: 99 of 100 are no longer.
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
    """One measured signal, over all runs.

    Attributes:
        rms, noise_sd: in `unit`, of a sample.
        colour: of the noise; see `data.noise.Noise`.
        resolution: the converter's step in `unit`; 0: none shows.
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
        share: how much less its wheel turns than the other, 0..1; low, high: its 95 % interval.
    """

    side: str
    share: float
    low: float
    high: float


def drives_straight_alone(dataset: Dataset) -> bool:
    """Returns whether all runs of a robot that are driven at all are driven straight."""
    kinds = {kind_of(np.nan_to_num(motor_inputs(run, dataset))) for run in dataset.runs}
    return dataset.vehicle == "diff_drive" and kinds - {"rest"} == {"straight"}


def weaker_side(dataset: Dataset) -> WeakerSide | None:
    """Returns which wheel turns less under equal commands; None: neither, or the runs do not tell.

    It compares how far both wheels turn in windows of 0.25 s in which both get the same voltage. No model is asked.
    """
    turns = np.array([turn for run in dataset.runs for turn in _equal_windows(run, dataset)]).reshape(-1, 2)
    sizes = np.abs(turns).min(axis=1, initial=np.inf)
    turns = turns[sizes > _FAST * np.max(sizes, initial=0.0)]
    if len(turns) < _LEAST_WINDOWS or (turns[:, 0] * turns[:, 1] <= 0).any():
        return None
    far, less = (np.abs(turns).sum(axis=0).argsort()[::-1]).tolist()
    share = float(1 - np.abs(turns[:, less]).sum() / np.abs(turns[:, far]).sum())
    each = 1 - turns[:, less] / turns[:, far]
    reach = 2.0 * float(np.std(each, ddof=1)) / math.sqrt(len(each))
    if share <= reach:
        return None
    return WeakerSide(("left", "right")[less], share, share - reach, share + reach)


def _equal_windows(run: Run, dataset: Dataset) -> Iterator[tuple[float, float]]:
    """Yields how far the left and the right wheel turn, rad or m, in each window in which both get one voltage."""
    turned = wheel_angles(run) or {name: one for name, one in run.outputs.items() if name.startswith("wheel_travel")}
    if dataset.vehicle != "diff_drive" or len(turned) < 2:
        return
    left, right = (turned[name] for name in sorted(turned))
    volts = np.nan_to_num(motor_inputs(run, dataset))
    larger = np.abs(volts).max(axis=1)
    equal = (larger > 0) & (np.abs(volts[:, 0] - volts[:, 1]) <= _EQUAL * larger)
    first = 0
    while first < len(run.time) - 1:
        last = int(np.searchsorted(run.time, run.time[first] + _WINDOW_S))
        if last >= len(run.time):
            return
        turn = float(left[last] - left[first]), float(right[last] - right[first])
        if equal[first:last].all() and np.isfinite(turn).all():
            yield turn
        first = last


def of_run(run: Run, role: str, inputs: Array) -> RunFacts:
    """Returns the facts of a run. `inputs`: what its motors got, (n, 1) or (n, 2) V."""
    time = run.time[_logged(run)]
    steps = np.diff(time)
    late = float(np.quantile(steps, _LATE))
    driven = manoeuvre(np.nan_to_num(inputs))
    return RunFacts(run.name, role, driven, len(time), float(time[-1] - time[0]), float(np.median(steps)), late)


def of_signals(dataset: Dataset) -> tuple[SignalFacts, ...]:
    """Returns the facts of every signal that was measured."""
    return tuple(
        _of_signal(dataset, name) for name in dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    )


def _of_signal(dataset: Dataset, name: str) -> SignalFacts:
    parts = [run.outputs[name][_logged(run)] for run in dataset.runs if name in run.outputs]
    known = [part[np.isfinite(part)] for part in parts]
    values, unit = np.concatenate(known), SIGNALS[name].unit
    if len(values) == 0:
        return SignalFacts(name, unit, 0.0, 0.0, Noise(0.0).colour, 0.0, 1.0)
    stated = dataset.signals.get(name)
    resolution = (stated.resolution if stated is not None else None) or step_of(known)
    noise = noise_of(parts, resolution)
    sd = (stated.noise_sd if stated is not None else None) or noise.sd
    missing = 1 - len(values) / sum(len(part) for part in parts)
    return SignalFacts(name, unit, float(np.sqrt(np.mean(values**2))), sd, noise.colour, resolution, missing)


def _logged(run: Run) -> NDArray[np.bool_]:
    """Returns which rows the log had: those with an output, and the ends; others were added where an input changes."""
    rows: NDArray[np.bool_] = np.any([np.isfinite(values) for values in run.raw_outputs.values()], axis=0)
    rows[[0, -1]] = True
    return rows
