"""Turns WPILOG files, which robots with WPILib record, into a data set.

The format is WPILib's "Data Log File Format" of version 1.0. robotpy-wpiutil reads the files.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, by_name, check_file, is_wanted, libraries

_SCALARS = {"boolean": "getBoolean", "int64": "getInteger", "float": "getFloat", "double": "getDouble"}
_GETTERS = _SCALARS | {f"{name}[]": f"{get}Array" for name, get in _SCALARS.items()}


@dataclass
class _Entry:
    """The records of a channel while they are read. `samples`: for each element of an array, a list of (µs, value)."""

    name: str
    type: str
    unit: str | None
    samples: list[list[tuple[int, float]]] = field(default_factory=list)

    def add(self, record: Any) -> None:
        value = getattr(record, _GETTERS[self.type])()
        for number, element in enumerate(value if self.type.endswith("]") else (value,)):
            if number == len(self.samples):
                self.samples.append([])
            self.samples[number].append((record.getTimestamp(), float(element)))


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the entries that hold numbers. Each element of an array becomes a channel, as ``NAME[0]``.

    Raises:
        InputError: there is no such file, or it is no WPILOG file.
    """
    check_file(file, b"WPILOG", "a WPILOG file")
    with libraries("wpilib"):
        from wpiutil.log import DataLogReader
    content = file.read_bytes()
    entries: dict[str, _Entry] = {}
    others: set[str] = set()
    try:
        _fill(entries, others, DataLogReader(buffer=content), texts)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"is a damaged WPILOG file: {error}", file=file) from error
    notes = (f"without numbers: {', '.join(sorted(others))}",) if others and texts is None else ()
    return Log(file, by_name(_channels(entries.values())), notes=notes, cut=_is_cut(content))


def _fill(entries: dict[str, _Entry], others: set[str], reader: Iterable[Any], texts: Collection[str] | None) -> None:
    """Puts entries with numbers into `entries`, and the names of all other entries into `others`."""
    open_entries: dict[int, _Entry] = {}
    for record in reader:
        if not record.isControl():
            if (entry := open_entries.get(record.getEntry())) is not None:
                entry.add(record)
        elif record.isStart():
            start = record.getStartData()
            open_entries.pop(start.entry, None)
            if start.type not in _GETTERS:
                others.add(f"{start.name} ({start.type})")
            elif is_wanted(start.name, texts):
                new = _Entry(start.name, start.type, _unit(start.metadata))
                open_entries[start.entry] = entries.setdefault(start.name, new)


def _is_cut(content: bytes) -> bool:
    """Returns whether the last record is incomplete; the library leaves out such a record without a message.

    A record begins with a byte that holds the lengths of three numbers, each minus one: the entry (2 bits), the size of
    the content (2 bits) and the time (3 bits).
    """
    at = 12 + int.from_bytes(content[8:12], "little")
    while at < len(content):
        lengths = content[at]
        size_at = at + 2 + (lengths & 3)
        time_at = size_at + 1 + (lengths >> 2 & 3)
        at = time_at + 1 + (lengths >> 4 & 7) + int.from_bytes(content[size_at:time_at], "little")
    return at != len(content)


def _channels(entries: Iterable[_Entry]) -> Iterator[Channel]:
    for entry in entries:
        for number, samples in enumerate(entry.samples):
            name = f"{entry.name}[{number}]" if entry.type.endswith("]") else entry.name
            time, values = np.array(samples, dtype=np.float64).T
            yield Channel(name, entry.type, time / 1e6, values, entry.unit)


def _unit(metadata: str) -> str | None:
    """Returns the unit in an entry's metadata, in AdvantageKit's form: ``{"unit": "volts"}``."""
    try:
        stated = json.loads(metadata)
    except ValueError:
        return None
    unit = stated.get("unit") if isinstance(stated, dict) else None
    return unit if isinstance(unit, str) and unit else None
