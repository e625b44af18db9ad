"""Turns ULog files, which PX4 records, into a data set. pyulog reads the files.

The format is the "ULog File Format" of the PX4 guide.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, by_name, check_file, is_wanted, libraries


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the logged messages. A channel is ``TOPIC.FIELD``, or ``TOPIC[1].FIELD`` for a second sensor.

    Raises:
        InputError: there is no such file, or it is no ULog file.
    """
    check_file(file, b"ULog\x01\x12\x35", "a ULog file")
    with libraries("px4"):
        from pyulog import ULog
    with redirect_stdout(io.StringIO()):  # pyulog prints a message on each damage
        try:
            log = ULog(str(file))
        except Exception as error:  # pyulog raises any kind of error on a damaged file
            raise InputError(f"is a damaged ULog file: {error}", file=file) from error
    damaged = log.file_corruption or any("timestamp" not in data.data for data in log.data_list)
    notes = ("some of its bytes are damaged and were left out",) if damaged else ()
    timed = [data for data in log.data_list if "timestamp" in data.data]  # messages with damaged definitions lack times
    channels = [channel for data in timed if is_wanted(data.name, texts) for channel in _channels(data)]
    return Log(file, by_name(channels), notes=notes, cut=not damaged and _is_cut(file.read_bytes()))


def _is_cut(content: bytes) -> bool:
    """Returns whether the last message is incomplete; pyulog leaves out such a message without a warning.

    Messages follow a head of 16 bytes; each message begins with the size of its content, 16 bits, and a letter.
    """
    at = 16
    while at < len(content):
        at += 3 + int.from_bytes(content[at : at + 2], "little")
    return at != len(content)


def _channels(data: Any) -> Iterator[Channel]:
    """Yields the fields of a message. The fields' time is the `timestamp`, in s since the board's start."""
    topic = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
    time = data.data["timestamp"] / 1e6
    types = {field.field_name: field.type_str for field in data.field_data}
    for name, values in data.data.items():
        if name != "timestamp" and types.get(name) != "char":
            yield Channel(f"{topic}.{name}", types.get(name, ""), time, values.astype(np.float64))
