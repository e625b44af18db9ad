"""A file of topics with times, in the format MCAP: the messages are JSON, and each channel has its JSON schema."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot import __version__
from brickpilot.errors import InputError


@dataclass(frozen=True)
class Topic:
    """One channel.

    Attributes:
        schema: JSON schema of a message; its title is the schema's name.
        units: field -> unit, kept in the channel's metadata.
    """

    name: str
    schema: Mapping[str, Any]
    units: Mapping[str, str]


@dataclass(frozen=True)
class Sample:
    """One message: its topic, its time in ns, and what it says."""

    topic: str
    time_ns: int
    message: Mapping[str, Any]


def signals(name: str, fields: Mapping[str, str]) -> Topic:
    """Returns a topic of plain numbers, from field -> unit. A number that is not known is null."""
    kinds = {field: {"type": ["number", "null"], "description": unit} for field, unit in fields.items()}
    schema = {"title": f"brickpilot{name.replace('/', '.')}", "type": "object", "properties": kinds}
    return Topic(name, schema | {"required": list(fields)}, fields)


def write(topics: Iterable[Topic], samples: Iterable[Sample], attachments: Mapping[str, bytes]) -> bytes:
    """Returns the MCAP file.

    Args:
        samples: in the order of their times.
        attachments: name -> JSON text.

    Raises:
        InputError: the library mcap is not installed.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError as error:
        raise InputError(f"needs the library {error.name}: pip install 'brickpilot[export]'", field="mcap") from error
    buffer = io.BytesIO()
    writer = Writer(buffer)
    writer.start("", f"brickpilot {__version__}")
    channels = {}
    for topic in topics:
        text = json.dumps(topic.schema).encode()
        schema = writer.register_schema(str(topic.schema["title"]), "jsonschema", text)
        units = {"units": json.dumps(dict(topic.units))} if topic.units else {}
        channels[topic.name] = writer.register_channel(topic.name, "json", schema, units)
    dump = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode
    for sample in samples:
        writer.add_message(channels[sample.topic], sample.time_ns, dump(sample.message).encode(), sample.time_ns)
    for name, content in attachments.items():
        writer.add_attachment(0, 0, name, "application/json", content)
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()
