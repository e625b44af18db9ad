"""Functions that import logs of one kind, for short calls in tests: (files, out, mapping, **options)."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from brickpilot.importers.writer import Imported
from brickpilot.public.logs import import_log


def import_kind(kind: str, files: list[Path], out: Path, mapping: Any = None, **options: Any) -> Imported:
    if mapping is not None:
        options["mapping"] = mapping
    return import_log(files, out, kind=kind, **options)


import_flight = partial(import_kind, "flight")
import_matlab = partial(import_kind, "matlab")
import_table = partial(import_kind, "table")
import_wpilib = partial(import_kind, "wpilib")
