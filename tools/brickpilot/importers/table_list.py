"""Reads all columns of a text file, so that they can be listed before any is chosen."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log
from brickpilot.importers.formula import Place
from brickpilot.importers.text_table import read_table


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the columns that hold numbers; `texts` chooses none, as a text file is read whole.

    Raises:
        InputError: no such file, or no table in it.
    """
    table = read_table(file)
    channels: dict[str, Channel] = {}
    others = []
    for name in table.names:
        try:
            channels[name] = Channel(name, "number", None, table.column(name, Place(name))[0])
        except InputError:
            others.append(name)
    notes = (f"without numbers: {', '.join(others)}",) if others else ()
    return Log(file, channels, notes=(*table.notes, *notes))
