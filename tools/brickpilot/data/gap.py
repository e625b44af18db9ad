"""The gap: the rms difference of measured and simulated signals in free runs, in noise sds, and where it is large."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brickpilot.data.audit.view import stretches
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.holdout import Roles
from brickpilot.data.signals import SUMMED, Array

Outputs = Mapping[str, Array]

_SHOWN_S = 0.1  # s: length of the windows in which the rms of a difference is computed
_BRIDGED_S = 0.3  # s: two spans with a shorter break between them become one
_CONDITION_SHARE = 0.6  # a condition, such as "turning right", is named only if it covers this share of a place's gap
_CONDITION_LIFT = 1.3  # a condition's share of the gap has to exceed this factor times its share of the time


@dataclass(frozen=True)
class Place:
    """A place of the gap: a time span in one signal of one run.

    Attributes:
        share_of_gap: the sum of squared differences (in noise sds) in this place, divided by the sum over all places,
            0..1.
        when: the motion of the vehicle in this place, such as "turning right".
    """

    run: str
    signal: str
    from_s: float
    to_s: float
    share_of_gap: float
    when: str


@dataclass(frozen=True)
class Gap:
    """rms of measured minus simulated values in free runs, in noise sds, before and after discovery; None: no runs."""

    before: float | None
    after: float | None

    @property
    def grows(self) -> bool:
        return self.before is not None and self.after is not None and self.after > self.before


def gaps(
    dataset: Dataset, simulated: Mapping[str, Mapping[str, Outputs]], roles: Roles, noise_sd: Mapping[str, float]
) -> tuple[dict[str, Gap], dict[str, Gap]]:
    """Returns role -> gap, and signal -> gap, for the models before ("nominal") and after ("augmented") discovery.

    For a signal that sums up motion, only the difference's change since the run's start counts. All signals have the
    same weight, and all samples of a signal have the same weight.
    """

    def rms(runs: Sequence[Run], outputs: Mapping[str, Outputs], signals: Iterable[str]) -> float | None:
        squares = []
        for signal in signals:
            both = [run for run in runs if signal in run.outputs and signal in outputs[run.name]]
            left = np.concatenate([np.empty(0), *(residual(run, signal, outputs[run.name][signal]) for run in both)])
            known = left[np.isfinite(left)]
            if len(known):
                squares.append(float(np.mean(known**2)) / noise_sd[signal] ** 2)
        return float(np.sqrt(np.mean(squares))) if squares else None

    def gap(runs: Sequence[Run], signals: Iterable[str]) -> Gap:
        return Gap(rms(runs, simulated["nominal"], signals), rms(runs, simulated["augmented"], signals))

    by_role = {
        role: gap([roles.samples(run, role) for run in dataset.runs if run.name in names], noise_sd)
        for role, names in (("fit", roles.fit()), ("held_out", roles.tested()))
    }
    return by_role, {signal: gap(dataset.runs, [signal]) for signal in noise_sd}


def residual(run: Run, signal: str, simulated: Array) -> Array:
    """Returns measured minus simulated, (n,); NaN where not measured. A residual of a `SUMMED` signal starts at 0."""
    left = run.outputs[signal] - simulated
    if signal in SUMMED:
        known = np.flatnonzero(np.isfinite(left))
        return left - left[known[0]] if len(known) else left
    return left


def places(
    dataset: Dataset,
    changed: Mapping[str, Outputs],
    plain: Mapping[str, Outputs],
    motion: Mapping[str, Outputs],
    noise_sd: Mapping[str, float],
    above: float,
) -> tuple[Place, ...]:
    """Returns the spans of runs and signals in which `changed` and `plain` differ, the largest share of the gap first.

    Args:
        changed, plain: the outputs to compare: run -> signal -> (n,), SI, over whole runs; NaN: unknown.
        motion: run -> outputs of the augmented model, which give `Place.when`.
        noise_sd: signal -> noise sd of a sample.
        above: limit in noise sds: a window of `_SHOWN_S` s belongs to a span if its rms difference is larger.
    """
    spans: list[tuple[Run, str, slice, Array]] = []
    for run in dataset.runs:
        for signal, sd in noise_sd.items():
            if signal in changed[run.name] and signal in plain[run.name]:
                apart = (changed[run.name][signal] - plain[run.name][signal]) / sd
                square = np.nan_to_num(apart - apart[0] if signal in SUMMED else apart) ** 2
                spans += [(run, signal, span, square) for span in _spans(run.time, square, above)]
    total = sum(float(square[span].sum()) for _, _, span, square in spans)
    places_found = []
    for run, signal, span, square in spans:
        part = np.zeros(len(square))
        part[span] = square[span]
        first, last = (round(float(run.time[index]), 3) for index in (span.start, span.stop - 1))
        when = _condition(run.time, motion[run.name], part)
        places_found.append(Place(run.name, signal, first, last, float(part.sum()) / total, when))
    return tuple(sorted(places_found, key=lambda place: -place.share_of_gap))


def _spans(time: Array, square: Array, above: float) -> list[slice]:
    """Returns the spans whose windows of `_SHOWN_S` s have an rms above `above`; joins spans with a short break."""
    number = np.floor((time - time[0]) / _SHOWN_S).astype(np.intp)
    means = np.bincount(number, square) / np.maximum(np.bincount(number), 1)
    shown = means[number] > above**2
    spans: list[slice] = []
    for first, end in stretches(shown):
        if spans and time[first] - time[spans[-1].stop - 1] < _BRIDGED_S:
            spans[-1] = slice(spans[-1].start, end)
        else:
            spans.append(slice(first, end))
    return spans


def _condition(time: Array, outputs: Outputs, part: Array) -> str:
    """Returns the condition of motion with the largest (share of the gap) / (share of the time), or "throughout".

    Args:
        part: (n,) squared differences, 0 outside the place.
    """
    still = np.zeros(len(time))
    speed, turn = (
        np.nan_to_num(next((outputs[name] for name in names if name in outputs), still))
        for names in (("surge", "velocity", "speed"), ("yaw_rate",))
    )
    fast, turning = 0.5 * float(np.abs(speed).max()), 0.2 * float(np.abs(turn).max())
    change = np.abs(np.gradient(speed, time)) if len(time) > 2 else still
    conditions = {
        "speed > 0": speed > 0.1 * fast,
        "speed < 0": speed < -0.1 * fast,
        "near standstill": np.abs(speed) < 0.1 * fast,
        "at high speed": np.abs(speed) > fast,
        "turning right": turn > turning,
        "turning left": turn < -turning,
        "turning": np.abs(turn) > turning,
        "while the speed changes": change > 0.2 * float(change.max()),
    }
    best, lift = "throughout", _CONDITION_LIFT
    if float(np.ptp(speed) + np.ptp(turn)) == 0:
        return best
    for text, mask in conditions.items():
        inside, share = float(part[mask].sum() / part.sum()), float(mask.mean())
        if inside >= _CONDITION_SHARE and share > 0 and inside / share > lift:
            best, lift = text, inside / share
    return best
