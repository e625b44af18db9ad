"""The topics of a recording of `brickpilot hil --record`: one for each message of the link, with its signals."""

from __future__ import annotations

import binascii
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from brickpilot.errors import InputError
from brickpilot.export.mcap_file import Sample, Topic, signals
from brickpilot.hil.traffic_log import Timed, read_timed
from brickpilot.link.messages import book

UNKNOWN = "/link/unknown"
"""The topic of frames that the DBC does not describe, and of damaged ones."""

_UNKNOWN_SCHEMA = {
    "title": "brickpilot.link.unknown",
    "type": "object",
    "properties": {
        "id": {"type": "integer"},
        "data": {"type": "string", "description": "hexadecimal"},
        "received": {"type": "integer", "description": "1: from the brick, 0: to it"},
    },
}


def read(file: Path) -> tuple[list[Topic], list[Sample]]:
    """Returns the topics and the messages of a recording. Times count from its first message, in ns.

    Raises:
        InputError: the file cannot be read, is no log of CAN traffic, or holds no message.
    """
    messages = read_timed(file)
    if not messages:
        raise InputError("holds no message", file=file)
    samples = _samples(messages)
    named = {sample.topic for sample in samples}
    found = [Topic(UNKNOWN, _UNKNOWN_SCHEMA, {})] if UNKNOWN in named else []
    for layout in book().database.messages:
        if f"/link/{layout.name}" in named:
            units = {signal.name: signal.unit or "1" for signal in layout.signals}
            found.append(signals(f"/link/{layout.name}", units | {"received": "1"}))
    return found, samples


def _samples(messages: Sequence[Timed]) -> list[Sample]:
    """Returns one sample for each frame. A clock that was set back stands still until it has caught up."""
    first, latest, found = messages[0].time_s, 0, []
    for one in messages:
        latest = max(latest, round((one.time_s - first) * 1e9))
        topic, values = _decoded(one)
        found.append(Sample(topic, latest, values | {"received": int(one.received)}))
    return found


def _decoded(one: Timed) -> tuple[str, dict[str, Any]]:
    layout = book().by_id.get(one.identifier)
    if layout is None or len(one.data) != 8:
        return UNKNOWN, {"id": one.identifier, "data": binascii.hexlify(one.data).decode()}
    values: Any = book().database.decode_message(one.identifier, one.data, decode_choices=False)
    return f"/link/{layout.name}", dict(values)
