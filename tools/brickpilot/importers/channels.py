"""Defines `Log`, the result of each function that reads a log, and functions that several readers use.

`brickpilot import --list` shows type, unit, samples, rate, times and range of each channel.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """One quantity over time in a log.

    Attributes:
        name: the channel's name in ``--map``, e.g. ``/drive/left``, ``IMU.GyrZ`` or ``/joint_states.velocity[left]``.
        type: the type's name in the file, e.g. ``double`` or ``sensor_msgs/msg/Imu``.
        time: the time of each value in s since the log began; None: the channel is a column of a table, and another
            column is the time.
        values: the values as written in the file; NaN: blank.
        unit: the unit that the file states; None: the file states no unit.
    """

    name: str
    type: str
    time: Vector | None
    values: Vector
    unit: str | None = None


@dataclass(frozen=True)
class Log:
    """The content that a reader found in a file.

    Attributes:
        file: the path as the user gave it.
        channels: name -> channel, in the order of the file.
        aliases: second name of a channel -> its name, e.g. ``/joints.velocity[0]`` -> ``/joints.velocity[left]``.
        notes: sentences for the user.
        cut: whether the file ends inside a record, as after a loss of power.
        of: what the log consists of: ``channel``; or ``column`` or ``variable``, if the log is a table, whose
            channels have no times.
        others: name of a column that cannot be a channel -> the reason, which follows the name in an error.
    """

    file: Path
    channels: Mapping[str, Channel]
    aliases: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    cut: bool = False
    of: Literal["channel", "column", "variable"] = "channel"
    others: Mapping[str, str] = field(default_factory=dict)


def by_name(channels: Iterable[Channel]) -> dict[str, Channel]:
    """Returns name -> channel."""
    return {channel.name: channel for channel in channels}


Reader = Callable[[Path, Collection[str] | None], Log]
"""Reads a log: (file, texts) -> log. It may read only channels that a text names (`is_wanted`); texts None: all."""


@contextmanager
def libraries(extra: str) -> Iterator[None]:
    """Turns a failed import into an error that says how to install the libraries.

    Raises:
        InputError: a library of `extra` is missing.
    """
    try:
        yield
    except ImportError as error:
        library = (error.name or str(error)).partition(".")[0]
        message = f"needs the library {library}, which is not installed: pip install 'brickpilot[{extra}]'"
        raise InputError(message) from error


def check_file(file: Path, start: bytes = b"", kind: str = "") -> None:
    """Refuses a path that is no file, and a file that does not begin with `start`.

    Raises:
        InputError: the message names the file and its `kind`, e.g. "a WPILOG file".
    """
    if not file.is_file():
        raise InputError("no such file" if not file.exists() else "is not a file", file=file)
    with file.open("rb") as content:
        if content.read(len(start)) != start:
            raise InputError(f"is not {kind}", file=file)


def is_wanted(group: str, texts: Collection[str] | None) -> bool:
    """Returns whether one of `texts` contains `group`, the name of a topic, message or array; `texts` None: true."""
    return texts is None or any(group in text for text in texts)


def in_order(time: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Returns times and values in order of time; if a time repeats, only its last value is kept."""
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    last = np.append(np.diff(time) > 0, True)[: time.size]
    return time[last], values[last]


@dataclass(frozen=True)
class Listed:
    """The description of a channel that `brickpilot import --list` shows.

    Attributes:
        name, type, unit: the channel's name, type and unit; None: the file states no unit.
        samples: number of values without blanks.
        rate: samples per second, from the median time step; None: fewer than two samples, or no times.
        first, last: the times of the first and the last sample in s; None: no times.
        lowest, highest: the lowest and the highest value; None: all values are blank.
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
    """The content of a file: its channels in the file's order, notes, and whether the file ends inside a record."""

    channels: list[Listed]
    notes: tuple[str, ...]
    cut: bool


def contents(log: Log) -> Contents:
    """Returns the contents of a log.

    The columns of a table have no times. The first column that only increases, preferably in s, is taken as the time
    of all columns.
    """
    clock = _clock(log.channels)
    notes = [*log.notes]
    if clock is not None and clock.unit != "s":
        notes.append(f"the rate and the times are those of column {clock.name}, in its unit")
    times = None if clock is None else clock.values
    return Contents([_of(channel, times) for channel in log.channels.values()], tuple(notes), log.cut)


def _clock(channels: Mapping[str, Channel]) -> Channel | None:
    """Returns the first column that only increases; columns in s are preferred."""
    rising = [
        channel
        for channel in channels.values()
        if channel.time is None and channel.values.size > 1 and (np.diff(channel.values) > 0).all()
    ]
    return next((channel for channel in rising if channel.unit == "s"), rising[0] if rising else None)


def _of(channel: Channel, clock: Vector | None) -> Listed:
    there = np.isfinite(channel.values)
    values = np.sort(channel.values[there])
    time = channel.time if channel.time is not None else clock
    times = np.sort(time[there]) if time is not None and time.size == there.size else np.empty(0)
    steps = np.diff(times)
    rate = 1.0 / float(np.median(steps[steps > 0])) if (steps > 0).any() else None
    ends = [(float(numbers[0]), float(numbers[-1])) if numbers.size else (None, None) for numbers in (times, values)]
    return Listed(channel.name, channel.type, channel.unit, values.size, rate, *ends[0], *ends[1])
