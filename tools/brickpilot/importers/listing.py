"""Describes the channels of a log: type, unit, samples, rate, times and range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from brickpilot.importers.channels import Channel, Log, Vector


@dataclass(frozen=True)
class Listed:
    """A channel, as `brickpilot import --list` shows it.

    Attributes:
        name, type, unit: of the channel; unit None: the file states none.
        samples: how many values it has, without blanks.
        rate: samples per second, by the median of their distances; None: fewer than two, or no times.
        first, last: s, the times of the first and the last sample; None: no times.
        lowest, highest: of the values; None: all are blank.
    """

    name: str
    type: str
    unit: str | None
    samples: int
    rate: float | None
    first: float | None
    last: float | None
    lowest: float | None
    highest: float | None


@dataclass(frozen=True)
class Contents:
    """The content of a file: its channels in the file's order, notes, and whether it ends inside a record."""

    channels: list[Listed]
    notes: tuple[str, ...]
    cut: bool


def contents(log: Log) -> Contents:
    """Returns what a log holds.

    The columns of a table have no times of their own. Their times are the values of the first column that only
    increases.
    """
    clock = _clock(log.channels)
    notes = [*log.notes]
    if clock is not None and clock.unit != "s":
        notes.append(f"the rate and the times are those of column {clock.name}, in its unit")
    times = None if clock is None else clock.values
    return Contents([_of(channel, times) for channel in log.channels.values()], tuple(notes), log.cut)


def _clock(channels: Mapping[str, Channel]) -> Channel | None:
    """Returns the first column in s that only increases, or else the first column in any unit that does."""
    rising = [
        one for one in channels.values() if one.time is None and one.values.size > 1 and (np.diff(one.values) > 0).all()
    ]
    return next((one for one in rising if one.unit == "s"), rising[0] if rising else None)


def _of(channel: Channel, clock: Vector | None) -> Listed:
    there = np.isfinite(channel.values)
    values = channel.values[there]
    time = channel.time if channel.time is not None else clock
    if time is not None:
        time = np.sort(time[there]) if time.size == there.size else None
    steps = np.diff(time) if time is not None else np.empty(0)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else None
    return Listed(
        channel.name, channel.type, channel.unit, values.size, None if step is None else 1.0 / step,
        _at(time, 0), _at(time, -1), float(values.min()) if values.size else None,
        float(values.max()) if values.size else None,
    )  # fmt: skip


def _at(time: Vector | None, place: int) -> float | None:
    return float(time[place]) if time is not None and time.size else None
