"""Turns bags of ROS 2 (a folder with metadata.yaml) and ROS 1 (.bag) into a data set. rosbags reads the bags."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.importers.channels import Log, is_wanted, libraries
from brickpilot.importers.ros_messages import Topic, log_of


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the topics of a bag. `file`: the bag's folder, its metadata.yaml, its .db3 file, or a .bag file.

    Raises:
        InputError: there is no such bag, or the bag cannot be read.
    """
    bag = _bag(file)
    with libraries("ros"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    topics: dict[str, Topic] = {}
    others: set[str] = set()
    try:
        # Bags of older releases lack message definitions; the messages of common packages have not changed since.
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            wanted = [connection for connection in reader.connections if is_wanted(connection.topic, texts)]
            known = [connection for connection in wanted if connection.msgtype in reader.typestore.fielddefs]
            others.update(
                f"{connection.topic} ({connection.msgtype})" for connection in wanted if connection not in known
            )
            for connection, log_ns, data in reader.messages(known) if known else ():
                topic = topics.setdefault(connection.topic, Topic(connection.topic, connection.msgtype))
                topic.add(log_ns, reader.deserialize(data, connection.msgtype))
    except InputError:
        raise
    except Exception as error:  # rosbags, sqlite and YAML raise many kinds of error on a damaged bag
        raise InputError(f"is a bag that cannot be read: {error}", file=file) from error
    return log_of(file, topics.values(), others)


def _bag(file: Path) -> Path:
    """Returns the path for rosbags: the folder of a bag of ROS 2, or the file of ROS 1."""
    if not file.exists():
        raise InputError("no such file", file=file)
    if file.suffix == ".bag" and file.is_file():
        return file
    folder = file if file.is_dir() else file.parent
    if not (folder / "metadata.yaml").is_file():
        raise InputError("is no bag: there is no metadata.yaml (`ros2 bag reindex` writes one)", file=file)
    return folder
