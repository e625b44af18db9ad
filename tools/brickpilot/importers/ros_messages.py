"""Turns ROS messages into channels: ``TOPIC.FIELD``, with ``[INDEX]`` in an array and ``[JOINT]`` in a JointState."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.importers.channels import Channel, Log, Vector, by_name

_LARGEST = 64
"""Largest number of values in an array; a longer array, such as an image or a laser scan, is left out."""

_SAME_EPOCH = 10.0
"""Limit in s. If stamps and log times differ by more, they come from two clocks: no message takes so long to arrive."""

_HEADER = frozenset({"header", "stamp"})
_QUATERNION = {"x", "y", "z", "w"}


@dataclass
class Topic:
    """The messages of one topic while they are read.

    Attributes:
        name, type: the topic's name, and the type of its messages.
        log_ns, stamp_ns: the time in ns at which each message was recorded, and its header's stamp; 0: no stamp.
        values: field -> (number of the message, value) for each message that has the field.
        aliases: second name -> field, if the first message names the array's elements: ``velocity[0]`` ->
            ``velocity[left]``.
    """

    name: str
    type: str
    log_ns: list[int] = field(default_factory=list)
    stamp_ns: list[int] = field(default_factory=list)
    values: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)

    def add(self, log_ns: int, message: Any) -> None:
        number = len(self.log_ns)
        if number == 0:
            self.aliases.update(_aliases(message, f"{self.name}."))
        self.log_ns.append(log_ns)
        self.stamp_ns.append(_stamp(message))
        for name, value in _numbers(message, f"{self.name}."):
            self.values.setdefault(name, []).append((number, value))


def log_of(file: Path, topics: Iterable[Topic], others: Iterable[str] = (), *, cut: bool = False) -> Log:
    """Returns the log of the topics.

    The times of a topic are the stamps in its headers, or the log times if a stamp is missing. The stamps may follow
    another clock than the log, e.g. the clock of a simulation. Then the log times of the other topics are shifted to
    the stamps' clock by the median difference.
    """
    full = [topic for topic in topics if topic.log_ns]
    stamped = [topic for topic in full if all(topic.stamp_ns)]
    notes = [f"{topic.name} has no stamp in some headers: its log time is used" for topic in full if _mixed(topic)]
    delays = [log - stamp for topic in stamped for log, stamp in zip(topic.log_ns, topic.stamp_ns, strict=True)]
    delay = int(np.median(delays)) if delays else 0
    moved = delay if abs(delay) > 1e9 * _SAME_EPOCH else 0
    if moved and len(stamped) < len(full):
        notes.append(
            f"the stamps follow another clock than the log: {1e-9 * moved:.6g} s were taken from the log times"
        )
    if others:
        notes.append(f"without numbers that can be read: {', '.join(sorted(others))}")
    times = {id(topic): topic.stamp_ns if topic in stamped else [log - moved for log in topic.log_ns] for topic in full}
    first = min((min(time) for time in times.values()), default=0)
    channels = [channel for topic in full for channel in _channels(topic, times[id(topic)], first)]
    aliases = {alias: name for topic in full for alias, name in topic.aliases.items() if name in topic.values}
    return Log(file, by_name(channels), aliases, tuple(notes), cut)


def _mixed(topic: Topic) -> bool:
    return any(topic.stamp_ns) and not all(topic.stamp_ns)


def _channels(topic: Topic, time_ns: list[int], first: int) -> Iterator[Channel]:
    seconds = np.array([time - first for time in time_ns], dtype=np.int64) / 1e9
    for name, pairs in topic.values.items():
        numbers, values = zip(*pairs, strict=True)
        column: Vector = np.array(values, dtype=np.float64)
        if name.endswith(".yaw"):
            column = np.unwrap(column)
        yield Channel(name, topic.type, seconds[np.array(numbers)], column)


def _stamp(message: Any) -> int:
    """Returns the stamp in a message's header in ns; 0: there is no stamp."""
    stamp = _fields(_fields(_fields(message).get("header")).get("stamp"))
    nanoseconds = stamp.get("nanosec") or stamp.get("nsec") or 0
    return int(stamp.get("sec") or 0) * 10**9 + int(nanoseconds)


def _fields(message: Any) -> Mapping[str, Any]:
    """Returns field -> value of a message (a mapping, a dataclass or an object with slots); else empty."""
    if isinstance(message, Mapping):
        return message
    names: Any = getattr(message, "__dataclass_fields__", None) or getattr(message, "__slots__", ())
    return {name: getattr(message, name) for name in names if not name.startswith("_")}


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Yields name and value of each number in a message."""
    fields = _fields(message)
    joints = fields.get("name")
    for name, value in fields.items():
        if name in _HEADER or name.endswith("covariance"):
            continue
        if isinstance(value, (bool, int, float, np.number)):
            yield f"{prefix}{name}", float(value)
        elif isinstance(value, (list, tuple, np.ndarray)):
            yield from _array(f"{prefix}{name}", value, joints)
        elif not isinstance(value, (str, bytes, type(None))):
            yield from _numbers(value, f"{prefix}{name}.")
    if fields.keys() >= _QUATERNION:
        x, y, z, w = (fields[axis] for axis in "xyzw")
        yield f"{prefix}yaw", math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _array(name: str, values: Any, joints: Any) -> Iterator[tuple[str, float]]:
    if len(values) > _LARGEST:
        return
    named = _are_names(joints, values)
    for place, value in enumerate(values):
        if not isinstance(value, (bool, int, float, np.number)):
            return
        yield f"{name}[{joints[place] if named else place}]", float(value)


def _are_names(joints: Any, values: Any) -> bool:
    return isinstance(joints, (list, tuple)) and len(joints) == len(values)


def _aliases(message: Any, prefix: str) -> Iterator[tuple[str, str]]:
    """Yields (name by index, name by joint), as (``velocity[0]``, ``velocity[left]``), for each named element."""
    fields = _fields(message)
    joints = fields.get("name")
    for name, values in fields.items():
        if name != "name" and isinstance(values, (list, tuple, np.ndarray)) and _are_names(joints, values):
            yield from (
                (f"{prefix}{name}[{place}]", f"{prefix}{name}[{one}]") for place, one in enumerate(joints or ())
            )
