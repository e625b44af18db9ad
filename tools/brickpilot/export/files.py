"""Writes the files of this room, each beside its place and then renamed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from brickpilot.data.unfinished import beside
from brickpilot.errors import InputError, disk_named


def plain_name(name: str) -> str:
    """Returns a name with "_" for whatever is no letter, digit or "_", so that any file system and program takes it."""
    return re.sub(r"\W", "_", name, flags=re.ASCII) or "model"


def write(contents: Mapping[Path, bytes]) -> None:
    """Writes each path's bytes and the folders above it; all of them beside their places before the first is renamed.

    Raises:
        InputError: one cannot be written.
        WorkFailedError: the disk is full.
    """
    path = Path()
    try:
        with ExitStack() as stack:
            made = {}
            for path, content in contents.items():
                if path.is_dir():
                    raise InputError("is a folder, so no file can be written there", file=path)
                with disk_named(path):
                    path.parent.mkdir(parents=True, exist_ok=True)
                    made[path] = stack.enter_context(beside(path))
                    made[path].write_bytes(content)
            for path in contents:
                made[path].replace(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from error
