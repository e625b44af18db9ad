"""Writes a text file so that a reader finds the old content or the new one, never a part of it."""

from __future__ import annotations

import os
from pathlib import Path

from brickpilot.errors import disk_named


def write(path: Path | str, text: str) -> None:
    """Writes `text` to a file beside `path` and renames it to `path`. Raises WorkFailedError if the disk is full."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with disk_named(target):
            beside.write_text(text, encoding="utf-8")
            os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)
