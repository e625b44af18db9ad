"""Turns ArduPilot's dataflash logs (.bin) into a data set. pymavlink reads the logs."""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, by_name, check_file, is_wanted, libraries

_HEAD = b"\xa3\x95"
_NUMBERS = "bBhHiIfdgcCeELMqQ"  # format characters of numbers; all other characters mean texts and arrays
# The log's spelling of a unit -> the data set's spelling; empty: no unit.
_SPELLINGS = {"deg/s": "deg/s", "m/s/s": "m/s^2", "rad/s/s": "rad/s^2", "%": "%", "UNKNOWN": ""}
_DEFINITIONS = {"FMT", "FMTU", "UNIT", "MULT"}  # messages that define the format and units of other messages
_MICROSECONDS = "TimeUS"


@dataclass
class _Message:
    """The messages of one kind and instance while they are read."""

    format: Any
    time: list[int] = field(default_factory=list)
    rows: list[tuple[Any, ...]] = field(default_factory=list)


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the messages with a time. A channel is ``MESSAGE.FIELD``, or ``MESSAGE[1].FIELD`` for a second sensor.

    Raises:
        InputError: there is no such file, or it is no dataflash log.
    """
    check_file(file, _HEAD, "a dataflash log of ArduPilot")
    with libraries("ardupilot"):
        from pymavlink.DFReader import FORMAT_TO_STRUCT, DFReader_binary
    said = io.StringIO()  # pymavlink prints a message on each part that it cannot read
    try:
        with redirect_stderr(said), redirect_stdout(said), DFReader_binary(str(file)) as reader:
            messages, end = _messages(reader, texts)
    except Exception as error:  # pymavlink raises any kind of error on a damaged file
        raise InputError(f"is a damaged dataflash log: {error}", file=file) from error
    if not messages and texts is None:
        raise InputError("holds no messages with a time", file=file)
    damaged = any("Skipped" in line for line in said.getvalue().splitlines())
    notes = ("some of its bytes are damaged and were left out",) if damaged else ()
    channels = [channel for name, message in messages.items() for channel in _channels(name, message, FORMAT_TO_STRUCT)]
    return Log(file, by_name(channels), notes=notes, cut=file.read_bytes()[end:].startswith(_HEAD[:1]))


def _messages(reader: Any, texts: Collection[str] | None) -> tuple[dict[str, _Message], int]:
    """Returns name -> messages, and the byte position of the last message's end."""
    wanted = {name for name in reader.name_to_id if name not in _DEFINITIONS and is_wanted(name, texts)}
    messages: dict[str, _Message] = {}
    end = 0
    while (message := reader.recv_msg()) is not None:
        end = reader.offset
        form = message.fmt
        if form.name not in wanted or _MICROSECONDS not in form.colhash:
            continue
        name = form.name
        if form.instance_field is not None and (instance := getattr(message, form.instance_field)) != 0:
            name = f"{name}[{instance}]"
        kept = messages.setdefault(name, _Message(form))
        kept.time.append(message.TimeUS)
        kept.rows.append(tuple(getattr(message, column) for column in _fields(form)))
    return messages, end


def _fields(form: Any) -> list[str]:
    return [
        name
        for name, kind in zip(form.columns, form.format, strict=False)
        if kind in _NUMBERS and name not in (_MICROSECONDS, form.instance_field)
    ]


def _channels(name: str, message: _Message, structs: Mapping[str, Any]) -> Iterator[Channel]:
    time = np.array(message.time, dtype=np.float64) / 1e6
    columns = np.array(message.rows, dtype=np.float64).T
    for column, values in zip(_fields(message.format), columns, strict=True):
        kind = structs[message.format.format[message.format.colhash[column]]][0]
        unit = message.format.get_unit(column)
        yield Channel(f"{name}.{column}", np.dtype(kind).name, time, values, _SPELLINGS.get(unit, unit) or None)
