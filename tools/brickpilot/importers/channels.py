"""The result of every reader of a log with channels, and the functions that all these readers need.

A listing describes each channel: type, unit, samples, rate, times and range.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """A quantity of a log.

    Attributes:
        name: as the map names it, e.g. ``/drive/left``, ``IMU.GyrZ`` or ``/joint_states.velocity[left]``.
        type: its name in the file, e.g. ``double`` or ``sensor_msgs/msg/Imu``.
        time: s since the log began, one for each value; None: a column of a table, whose time is another column.
        values: as written in the file; NaN: blank.
        unit: the unit that the file states; None: it states none.
    """

    name: str
    type: str
    time: Vector | None
    values: Vector
    unit: str | None = None


@dataclass(frozen=True)
class Log:
    """What a reader found in a file.

    Attributes:
        file: as the user named it.
        channels: by name, in the order of the file.
        aliases: second name -> name, e.g. ``/joint_states.velocity[0]`` for that of the first joint.
        notes: for the user, a sentence each.
        cut: whether the file ends inside a record, as after a loss of power.
    """

    file: Path
    channels: Mapping[str, Channel]
    aliases: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    cut: bool = False


Reader = Callable[[Path, Collection[str] | None], Log]
"""Reads a file: (file, texts). Channels that no text names need not be decoded (`is_wanted`); None: all are read."""


@contextmanager
def libraries(extra: str) -> Iterator[None]:
    """Turns an import that fails into one line that says how to install the libraries.

    Raises:
        InputError: a library of `extra` is missing.
    """
    try:
        yield
    except ImportError as error:
        library = (error.name or str(error)).partition(".")[0]
        message = f"needs the library {library}, which is not installed: pip install 'brickpilot[{extra}]'"
        raise InputError(message) from error


def check_file(file: Path, start: bytes, kind: str) -> None:
    """Refuses a path that is no file, and a file that does not begin with `start`.

    Raises:
        InputError: it names the file, and `kind` as words, e.g. "a WPILOG file".
    """
    if not file.is_file():
        raise InputError("no such file" if not file.exists() else "is not a file", file=file)
    with file.open("rb") as content:
        if content.read(len(start)) != start:
            raise InputError(f"is not {kind}", file=file)


def is_wanted(group: str, texts: Collection[str] | None) -> bool:
    """Returns whether `group`, a topic, message or array, occurs in one of the texts that name the needed channels."""
    return texts is None or any(group in text for text in texts)


def in_order(time: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Returns times and values in the order of time; if a time repeats, the last value counts."""
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    last = np.append(np.diff(time) > 0, True)[: time.size]
    return time[last], values[last]


@dataclass(frozen=True)
class Listed:
    """A channel, as `brickpilot import --list` shows it.

    Attributes:
        name, type, unit: of the channel; unit None: the file states none.
        samples: how many values the channel has, without blanks.
        rate: samples per second, by their median step; None: fewer than two samples, or no times.
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
