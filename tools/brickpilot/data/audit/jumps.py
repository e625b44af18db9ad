"""Finds short jumps of a signal that go back at once: dropouts, and rows with two swapped cells.

A sample is judged by its residual: its distance from the line through its neighbours in time. So the sampling may be
irregular. The method follows the median filters of Hampel (1974).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from brickpilot.data.audit.fault import Kind
from brickpilot.data.audit.view import LEAST_SAMPLES, Mask, RunView, Vector
from brickpilot.data.description import Signal
from brickpilot.data.signals import Frame, to_frd

_DROPOUT_SAMPLES = 5
_DROPOUT_SHARE = 0.02  # largest share of a signal's samples that are dropouts; if more jump, it is motion
_OUTLYING = 12.0  # least size of a jump, in usual sizes of the residual (`_scale`)
_BACK = 0.2  # largest difference between the samples before and after a jump, as a share of its size
_BEYOND_REST = 5.0  # least ratio of a dropout's size to the largest residual of sound samples
_BEYOND_ALL = 50.0  # for `_IMPULSIVE`: least ratio of a dropout's size to the other samples' span; worn gears reach 20
_IMPULSIVE = ("accel_", "current", "force")  # in these, an impact or a motor's commutation may last a single sample
_INPUT_STEP = 0.1  # share of an input's largest value: a larger change is a step
_SWAP_APART = 8.0  # least distance of a swapped cell from the line through its neighbours, in usual residuals
_SWAP_MENDED = 0.2  # largest ratio of (a cell's distance from its line after the exchange) to (the distance before)


def jumps(view: RunView, signals: Mapping[str, Signal], frame: Frame) -> dict[Kind, dict[str, Mask]]:
    """Returns the samples of swapped cells and of dropouts, by signal, and blanks both in `view`."""
    swapped = _swapped(view, signals, frame)
    view.blank(swapped)
    dropout = {name: _dropout(view, name, signals[name]) for name in view.outputs}
    view.blank(dropout)
    return {"swapped": swapped, "dropout": dropout}


def _bridge(time: Vector, values: Vector, length: int) -> tuple[Vector, Vector]:
    """Measures how far each stretch of `length` samples jumps away and back.

    Returns, for each stretch, the least distance of its samples from the line between the two samples around the
    stretch, and the difference of these two samples.
    """
    count = len(values) - length - 1
    before, after = values[:count], values[length + 1 :]
    span = time[length + 1 :] - time[:count]
    away = np.full(count, np.inf)
    for inner in range(1, length + 1):
        share = (time[inner : inner + count] - time[:count]) / span
        away = np.minimum(away, np.abs(values[inner : inner + count] - before - share * (after - before)))
    return away, np.abs(after - before)


def _scale(residual: Vector, resolution: float) -> float:
    """Returns the usual size of a residual: the largest of resolution, sd by median, and sd by 90 % quantile."""
    return max(1.4826 * float(np.median(residual)), float(np.quantile(residual, 0.9)) / 1.6449, resolution)


def _dropout(view: RunView, name: str, signal: Signal) -> Mask:
    values = view.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    known = view.sampled(name)
    if len(known) < LEAST_SAMPLES:
        return found
    time, level = view.time[known], values[known]
    residual, _ = _bridge(time, level, 1)
    scale = _scale(residual, view.resolution[name])
    if scale == 0.0:
        return found
    zero = signal.to_si * signal.offset
    events = _events(time, level, scale)
    rest = _sound_residual(residual, events)
    for away, start, length in sorted(events):
        stays_zero = bool(np.all(np.isin(level[start : start + length], (0.0, zero, -zero))))
        beyond = _BEYOND_REST * rest
        if name.startswith(_IMPULSIVE) and not stays_zero:
            beyond = _BEYOND_ALL * float(np.ptp(np.delete(level, slice(start, start + length))))
        if away > beyond:
            found[known[start : start + length]] = True
        else:
            rest = max(rest, away)
    return found if np.count_nonzero(found) <= max(_DROPOUT_SHARE * len(known), 3) else np.zeros_like(found)


def _events(time: Vector, level: Vector, scale: float) -> list[tuple[float, int, int]]:
    """Returns (jump, start, length) of stretches that jump away and back; of overlapping ones, only the shortest."""
    events: list[tuple[float, int, int]] = []
    taken = np.zeros(len(level), dtype=bool)
    for length in range(1, min(_DROPOUT_SAMPLES, len(level) - 2) + 1):
        away, apart = _bridge(time, level, length)
        for before in np.flatnonzero((away > _OUTLYING * scale) & (apart < _BACK * away)):
            start = int(before) + 1
            if not taken[start : start + length].any():
                taken[start : start + length] = True
                events.append((float(away[before]), start, length))
    return events


def _sound_residual(residual: Vector, events: list[tuple[float, int, int]]) -> float:
    """Returns the largest residual outside the events."""
    sound = np.ones(len(residual), dtype=bool)
    for _, start, length in events:
        sound[max(start - 2, 0) : start + length] = False
    return float(residual[sound].max()) if sound.any() else 0.0


def _swapped(view: RunView, signals: Mapping[str, Signal], frame: Frame) -> dict[str, Mask]:
    """Finds single rows in which two cells fit the lines of their signals only after they are exchanged."""
    masks = {name: np.zeros(len(view.time), dtype=bool) for name in view.outputs}
    if len(view.time) < LEAST_SAMPLES:
        return masks
    for first, second in combinations(view.outputs, 2):
        if signals[first].unit != signals[second].unit:
            continue
        lines = [_line(view, name) for name in (first, second)]
        (line, away, scale), (other_line, other_away, other_scale) = lines
        there = _as_read_from(signals[second], view.outputs[second], signals[first], frame)
        here = _as_read_from(signals[first], view.outputs[first], signals[second], frame)
        with np.errstate(invalid="ignore"):
            hit = (away > _SWAP_APART * scale) & (other_away > _SWAP_APART * other_scale)
            hit &= np.abs(there - line) < np.maximum(_SWAP_MENDED * away, 3 * scale)
            hit &= np.abs(here - other_line) < np.maximum(_SWAP_MENDED * other_away, 3 * other_scale)
        hit &= ~_near_input_step(view)
        alone = hit & ~np.r_[False, hit[:-1]] & ~np.r_[hit[1:], False]
        if 0 < np.count_nonzero(alone) <= max(_DROPOUT_SHARE * len(alone), 3):
            masks[first] |= alone
            masks[second] |= alone
    return masks


def _near_input_step(view: RunView) -> Mask:
    """Returns the samples next to a step of an input. There, sound samples may be off their neighbours' line."""
    step = np.zeros(len(view.time) + 1, dtype=bool)
    for values in view.inputs.values():
        driven = np.nan_to_num(values)
        step[1:-1] |= np.abs(np.diff(driven)) > _INPUT_STEP * np.max(np.abs(driven))
    near: Mask = step[:-1] | step[1:]
    near[1:] |= near[:-1].copy()
    near[:-1] |= near[1:].copy()
    return near


def _line(view: RunView, name: str) -> tuple[Vector, Vector, float]:
    """Returns the line through each sample's neighbours, the samples' distances from this line, and their usual size.

    Line and distance are NaN in blank rows, in rows beside a blank, and in rows that repeat a sample.
    """
    line = np.full_like(view.outputs[name], np.nan)
    rows = view.sampled(name) if name in view.held else np.arange(len(view.time))
    values, time = view.outputs[name][rows], view.time[rows]
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    line[rows[1:-1]] = values[:-2] + share * (values[2:] - values[:-2])
    away = np.abs(view.outputs[name] - line)
    known = away[np.isfinite(away)]
    return line, away, _scale(known, view.resolution[name]) if known.size else np.inf


def _as_read_from(own: Signal, values: Vector, other: Signal, frame: Frame) -> Vector:
    """Returns the values of `own` as if they were read from the column of `other`."""
    raw = (to_frd(own.name, values, frame) / own.to_si - own.offset) / own.scale
    return to_frd(other.name, other.to_si * (other.scale * raw + other.offset), frame)
