"""Turns MCAP files, which ROS 2 and Foxglove record, into a data set. mcap and mcap-ros2-support read the files."""

from __future__ import annotations

import json
import struct
from collections.abc import Collection
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.importers.channels import Log, check_file, is_wanted, libraries
from brickpilot.importers.ros_messages import Topic, log_of

_MAGIC = b"\x89MCAP0\r\n"


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the topics with messages of ROS 2 (CDR with .msg definitions) or in JSON.

    Raises:
        InputError: there is no such file, or it is no MCAP file.
    """
    check_file(file, _MAGIC, "an MCAP file")
    with libraries("ros"):
        from mcap.exceptions import EndOfFile
        from mcap.reader import NonSeekingReader
        from mcap_ros2.decoder import DecoderFactory
    topics: dict[str, Topic] = {}
    others: set[str] = set()
    decoders = DecoderFactory()
    cut = False
    with file.open("rb") as content:
        reader = NonSeekingReader(content, validate_crcs=True)
        try:
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if not is_wanted(channel.topic, texts):
                    continue
                kind = schema.name if schema is not None else channel.message_encoding
                encoding = channel.message_encoding
                decode = json.loads if encoding == "json" else decoders.decoder_for(encoding, schema)
                if decode is None:
                    others.add(f"{channel.topic} ({kind})")
                    continue
                topics.setdefault(channel.topic, Topic(channel.topic, kind)).add(message.log_time, decode(message.data))
        except (EndOfFile, struct.error):
            cut = True
        except Exception as error:  # mcap and its decompressors raise many kinds of error on a damaged file
            raise InputError(f"is a damaged MCAP file: {error}", file=file) from error
    return log_of(file, topics.values(), others, cut=cut)
