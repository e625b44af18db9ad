"""Finds damaged samples of measured outputs: clipped, frozen, dropped out, or swapped with another column.

No model is needed. What is found cannot be the motion of a body with noise and quantisation on it; when in doubt a
sample is left alone. The yardstick of a sample is its distance from the line through its neighbours in time
(after the median filters of Hampel 1974), so that irregular sampling does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brickpilot import audit_stuck
from brickpilot.audit_stuck import Course, stretches
from brickpilot.dataset_toml import Signal
from brickpilot.signals import Frame, to_frd

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["swapped", "dropout", "clipped", "frozen"]

LEAST_SAMPLES = 20
"""A signal known in fewer samples of a run has no statistics and is only checked against its stated range."""

_DROPOUT_SAMPLES = 5
_DROPOUT_SHARE = 0.02  # of a signal's samples; more is no accident but how the signal is
_OUTLYING = 12.0  # scales of the residual
_BACK = 0.2  # of the jump: how near to each other the samples before and after are
_BEYOND_REST = 5.0  # times the largest residual of what is sound
_BEYOND_REST_AT_ZERO = 2.0
_BEYOND_REST_IMPULSIVE = 20.0
_IMPULSIVE = ("accel_", "current", "force")  # a blow or a commutation may last a single sample
_INPUT_STEP = 0.1  # of its largest value
_SWAP_APART = 8.0
_SWAP_HEALED = 0.2


@dataclass(frozen=True)
class Fault:
    """Damaged samples in a row: the first and the last at `from_s` and `to_s` of the run's own clock."""

    run: str
    signal: str
    kind: Kind
    from_s: float
    to_s: float

    def to_json(self) -> dict[str, str | float]:
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Record:
    """What is audited of one run: SI, one entry a sample, NaN where blank. `inputs`: (n,) each."""

    name: str
    time: Vector
    inputs: Mapping[str, Vector]
    outputs: Mapping[str, Vector]


@dataclass(frozen=True)
class Audited:
    """`outputs`: run -> signal -> values, NaN where damaged. `faults`: by run, in time. `notes`: a sentence a group."""

    outputs: Mapping[str, Mapping[str, Vector]]
    faults: tuple[Fault, ...]
    notes: tuple[str, ...]


def audit(records: Sequence[Record], signals: Mapping[str, Signal], frame: Frame) -> Audited:
    """Finds the damaged samples of all runs; a signal's resolution is taken from all of them together."""
    resolution = {name: _resolution(name, records, signals) for name in records[0].outputs} if records else {}
    courses = [
        Course(record.time, record.inputs, {name: values.copy() for name, values in record.outputs.items()}, resolution)
        for record in records
    ]
    faults: list[Fault] = []
    notes: list[str] = []
    sound = [_find_jumps(course, signals, frame) for course in courses]
    for record, course, masks in zip(records, courses, sound, strict=True):
        masks["clipped"] = {name: audit_stuck.clipped(course, name, signals[name].range) for name in course.outputs}
        _blank(course, masks["clipped"])
        masks["frozen"] = {name: audit_stuck.frozen(course, name, courses) for name in course.outputs}
        for name, stands in masks["frozen"].items():
            at_end = audit_stuck.at_extreme(course, name, stands)
            masks["clipped"][name] |= at_end
            stands &= ~at_end
        for kind, by_signal in masks.items():
            for name, mask in by_signal.items():
                found = [Fault(record.name, name, kind, *span) for span in _spans(record.time, mask)]
                faults.extend(found)
                if found:
                    notes.append(_note(found, int(np.count_nonzero(mask)), len(mask)))
    for course, masks in zip(courses, sound, strict=True):
        _blank(course, masks["clipped"])
        _blank(course, masks["frozen"])
    outputs = {record.name: dict(course.outputs) for record, course in zip(records, courses, strict=True)}
    order = {record.name: number for number, record in enumerate(records)}
    faults.sort(key=lambda one: (order[one.run], one.from_s, one.signal))
    return Audited(outputs, tuple(faults), tuple(notes))


def _find_jumps(course: Course, signals: Mapping[str, Signal], frame: Frame) -> dict[Kind, dict[str, Mask]]:
    swapped = _swapped(course, signals, frame)
    _blank(course, swapped)
    dropout = {name: _dropout(course, name, signals[name]) for name in course.outputs}
    _blank(course, dropout)
    return {"swapped": swapped, "dropout": dropout}


def _blank(course: Course, masks: Mapping[str, Mask]) -> None:
    for name, mask in masks.items():
        course.outputs[name][mask] = np.nan


def _spans(time: Vector, mask: Mask) -> list[tuple[float, float]]:
    return [(float(time[start]), float(time[stop - 1])) for start, stop in stretches(mask)]


def _note(found: list[Fault], samples: int, of: int) -> str:
    first = found[0]
    single = first.from_s == first.to_s
    when = f"at {first.from_s:.6g} s" if single else f"from {first.from_s:.6g} to {first.to_s:.6g} s"
    word = {"dropout": "drops out", "swapped": "is swapped with another column"}.get(first.kind, f"is {first.kind}")
    place = "" if len(found) == 1 else f" in {len(found)} places, first"
    return f"run {first.run}: {first.signal} {word}{place} {when}; {samples} of {of} samples are left out"


def _resolution(name: str, records: Sequence[Record], signals: Mapping[str, Signal]) -> float:
    """The stated step of a signal, else the smallest that occurs in any run; 0 where there is none."""
    if (stated := signals[name].resolution) is not None:
        return stated
    values = np.unique(np.concatenate([record.outputs[name] for record in records]))
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * np.max(np.abs(values), initial=0.0)]
    return float(steps.min()) if steps.size else 0.0


def _bridge(time: Vector, values: Vector, length: int) -> tuple[Vector, Vector]:
    """For each stretch of `length` inside a run: its samples' least distance from the line between the two samples
    around it, and how far these are apart."""
    count = len(values) - length - 1
    before, after = values[:count], values[length + 1 :]
    span = time[length + 1 :] - time[:count]
    away = np.full(count, np.inf)
    for inner in range(1, length + 1):
        share = (time[inner : inner + count] - time[:count]) / span
        away = np.minimum(away, np.abs(values[inner : inner + count] - before - share * (after - before)))
    return away, np.abs(after - before)


def _scale(residual: Vector, resolution: float) -> float:
    """Size of what noise, motion and resolution make of a residual, from its median and its ninth decile."""
    return max(1.4826 * float(np.median(residual)), float(np.quantile(residual, 0.9)) / 1.6449, resolution)


def _dropout(course: Course, name: str, signal: Signal) -> Mask:
    values = course.outputs[name]
    found = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < LEAST_SAMPLES:
        return found
    time, level = course.time[known], values[known]
    residual, _ = _bridge(time, level, 1)
    scale = _scale(residual, course.resolution[name])
    if scale == 0.0:
        return found
    zero = signal.to_si * signal.offset
    impulsive = name.startswith(_IMPULSIVE)
    stepped = _driven_anew(course)[known] if impulsive else np.zeros(len(known), dtype=bool)
    events = _events(time, level, scale)
    rest = _sound_residual(residual, events)
    for away, start, length in sorted(events):
        jolted = bool(stepped[start : start + length].any())
        stays_zero = bool(np.all(np.isin(level[start : start + length], (0.0, zero, -zero))))
        beyond = _BEYOND_REST_IMPULSIVE if impulsive else _BEYOND_REST
        if not jolted and away > (_BEYOND_REST_AT_ZERO if stays_zero else beyond) * rest:
            found[known[start : start + length]] = True
        else:
            rest = max(rest, away)
    return found if np.count_nonzero(found) <= max(_DROPOUT_SHARE * len(known), 3) else np.zeros_like(found)


def _events(time: Vector, level: Vector, scale: float) -> list[tuple[float, int, int]]:
    """Stretches that jump away and back: (jump, start, length), the shortest explanation of each sample."""
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
    """The largest residual that no event has a part in."""
    sound = np.ones(len(residual), dtype=bool)
    for _, start, length in events:
        sound[max(start - 2, 0) : start + length] = False
    return float(residual[sound].max()) if sound.any() else 0.0


def _swapped(course: Course, signals: Mapping[str, Signal], frame: Frame) -> dict[str, Mask]:
    """Single rows in which the cells of two columns, exchanged, lie on both signals' lines again."""
    masks = {name: np.zeros(len(course.time), dtype=bool) for name in course.outputs}
    if len(course.time) < LEAST_SAMPLES:
        return masks
    for first, second in combinations(course.outputs, 2):
        if signals[first].unit != signals[second].unit:
            continue
        lines = [_line(course, name) for name in (first, second)]
        (line, away, scale), (other_line, other_away, other_scale) = lines
        there = _as_read_from(signals[second], course.outputs[second], signals[first], frame)
        here = _as_read_from(signals[first], course.outputs[first], signals[second], frame)
        with np.errstate(invalid="ignore"):
            hit = (away > _SWAP_APART * scale) & (other_away > _SWAP_APART * other_scale)
            hit &= np.abs(there - line) < np.maximum(_SWAP_HEALED * away, 3 * scale)
            hit &= np.abs(here - other_line) < np.maximum(_SWAP_HEALED * other_away, 3 * other_scale)
        hit &= ~_driven_anew(course)
        alone = hit & ~np.r_[False, hit[:-1]] & ~np.r_[hit[1:], False]
        if 0 < np.count_nonzero(alone) <= max(_DROPOUT_SHARE * len(alone), 3):
            masks[first] |= alone
            masks[second] |= alone
    return masks


def _driven_anew(course: Course) -> Mask:
    """Samples within one of a step of an input, where a row may leave both its neighbours' lines by right."""
    step = np.zeros(len(course.time) + 1, dtype=bool)
    for values in course.inputs.values():
        driven = np.nan_to_num(values)
        step[1:-1] |= np.abs(np.diff(driven)) > _INPUT_STEP * np.max(np.abs(driven))
    near: Mask = step[:-1] | step[1:]
    near[1:] |= near[:-1].copy()
    near[:-1] |= near[1:].copy()
    return near


def _line(course: Course, name: str) -> tuple[Vector, Vector, float]:
    """The line through each sample's neighbours, the sample's distance from it, and the scale of these distances."""
    values, time = course.outputs[name], course.time
    line = np.full_like(values, np.nan)
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    line[1:-1] = values[:-2] + share * (values[2:] - values[:-2])
    away = np.abs(values - line)
    known = away[np.isfinite(away)]
    return line, away, _scale(known, course.resolution[name]) if known.size else np.inf


def _as_read_from(own: Signal, values: Vector, other: Signal, frame: Frame) -> Vector:
    """What the reader would make of the cells of `own`, which it read as `values`, in the column of `other`."""
    raw = (to_frd(own.name, values, frame) / own.to_si - own.offset) / own.scale
    return to_frd(other.name, other.to_si * (other.scale * raw + other.offset), frame)
