"""Puts channels with different times on the rows of one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brickpilot.data.signals import SIGNALS
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Vector, in_order

_SAME = 0.01  # of a row's duration; a smaller shift gets no note
_ROWS = 10_000_000  # a larger table is refused: --rate is too high


def columns(channels: Mapping[str, Channel], rate: float | None) -> tuple[dict[str, Vector], list[str]]:
    """Returns signal -> values on common rows, with `time`, and notes for the user.

    The rows are the times of the output with most samples, or follow `rate`. A sample of an output stands in the row
    nearest to its time, at most half a row away; the other rows are blank, because nothing is interpolated. An input
    holds until it changes. Without `rate`, a row is added where an input changes between two rows; measured signals are
    blank there. With `rate`, it changes in the nearest row. The first row is the first at which all inputs are known.

    Args:
        channels: signal -> channel with times, and with at least one output.
        rate: rows per second; None: those of the fastest output.

    Raises:
        InputError: no output, a channel without samples, or no rows.
    """
    tracks = {signal: _track(one) for signal, one in channels.items()}
    inputs = {signal: track for signal, track in tracks.items() if SIGNALS[signal].kind == "input"}
    outputs = {signal: track for signal, track in tracks.items() if SIGNALS[signal].kind == "output"}
    if not outputs:
        raise InputError("no output is mapped, so that there is nothing to compare with a simulation", field="--map")
    rows = _rows(outputs, rate)
    half = 0.5 * _step(rows)
    late = half if rate is not None else _SAME * 2 * half
    rows = rows[rows > max((time[0] for time, _ in inputs.values()), default=-np.inf) - late]
    if rows.size < 2:
        raise InputError("inputs and outputs share fewer than two rows of time", field="--map")
    changes = _changes(inputs, rows, late) if rate is None else np.empty(0)
    with_changes = np.union1d(rows, changes)
    measured = np.searchsorted(with_changes, rows)
    notes = [f"{changes.size} rows are added where an input changes between two rows"] if changes.size else []
    made: dict[str, Vector] = {"time": with_changes}
    for signal in channels:
        time, values = tracks[signal]
        if signal in inputs:
            made[signal] = _held(time, values, with_changes, late)
            continue
        made[signal] = np.full(with_changes.size, np.nan)
        made[signal][measured], shift = _placed(time, values, rows, half)
        if shift > _SAME * 2 * half:
            notes.append(f"{signal} is up to {1e3 * shift:.3g} ms from the time of its row; --rate gives finer rows")
    return made, notes


def _changes(inputs: Mapping[str, tuple[Vector, Vector]], rows: Vector, late: float) -> Vector:
    """Returns the times between the rows at which an input changes, where they are more than `late` s from a row."""
    times = [np.empty(0)]
    for time, values in inputs.values():
        same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
        times.append(time[1:][~same])
    at = np.unique(np.concatenate(times))
    at = at[(at > rows[0]) & (at < rows[-1])]
    right = np.searchsorted(rows, at)
    at = at[(at - rows[right - 1] > late) & (rows[right] - at > late)]
    alone: Vector = at[np.diff(at, prepend=-np.inf) > late]  # two inputs that change together have one row
    return alone


def aligned(channels: Sequence[Channel], held: bool) -> tuple[Vector, list[Vector], float]:
    """Returns the times of the fastest channel, each channel's values at them, and the largest shift in s.

    A command is held; a measured value stands at the nearest time, and the others are blank.
    """
    tracks = [_track(channel) for channel in channels]
    rows = max((time for time, _ in tracks), key=lambda time: time.size)
    half = 0.5 * _step(rows)
    values, shifts = [], [0.0]
    for time, samples in tracks:
        if held:
            values.append(_held(time, samples, rows, half))
        else:
            column, shift = _placed(time, samples, rows, half)
            values.append(column)
            shifts.append(shift)
    shift = max(shifts)
    return rows, values, shift if shift > _SAME * 2 * half else 0.0


def _track(channel: Channel) -> tuple[Vector, Vector]:
    assert channel.time is not None
    finite = np.isfinite(channel.time)
    if not finite.any():
        raise InputError(f"channel {channel.name!r} has no samples")
    return in_order(channel.time[finite], channel.values[finite])


def _rows(outputs: Mapping[str, tuple[Vector, Vector]], rate: float | None) -> Vector:
    if rate is None:
        return max((time for time, _ in outputs.values()), key=lambda time: time.size)
    first = min(time[0] for time, _ in outputs.values())
    last = max(time[-1] for time, _ in outputs.values())
    if (last - first) * rate > _ROWS:
        raise InputError(f"would make more than {_ROWS:,} rows", field="--rate")
    return np.asarray(first + np.arange(int(np.floor((last - first) * rate)) + 1) / rate)


def _step(rows: Vector) -> float:
    return float(np.median(np.diff(rows))) if rows.size > 1 else 0.0


def _held(time: Vector, values: Vector, rows: Vector, half: float) -> Vector:
    """Returns the values at the rows, each held from the row nearest to its time; NaN before the first."""
    last = np.searchsorted(time, rows + half, side="left") - 1
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def _placed(time: Vector, values: Vector, rows: Vector, half: float) -> tuple[Vector, float]:
    """Returns the values at the rows nearest to their times, and the largest distance in s."""
    column = np.full(rows.size, np.nan)
    right = np.clip(np.searchsorted(rows, time), 1, rows.size - 1)
    nearest = np.where(time - rows[right - 1] <= rows[right] - time, right - 1, right)
    distance = np.abs(time - rows[nearest])
    far_first = np.argsort(-distance, kind="stable")  # so that the sample nearest to a row is written last
    kept = far_first[distance[far_first] <= half * (1 + 1e-9)]
    column[nearest[kept]] = values[kept]
    return column, float(distance[kept].max()) if kept.size else 0.0
