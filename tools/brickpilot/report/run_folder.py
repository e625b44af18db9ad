"""Writes folders and files under another name, then renames them, so that each output is complete or absent."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.whole_files import beside, write_whole
from brickpilot.errors import InputError, disk_named
from brickpilot.vehicle.flight import Flight

Array = NDArray[np.float64]


@contextmanager
def fresh_folder(out: Path, files: Collection[str]) -> Iterator[Path]:
    """Yields an empty folder beside `out` and renames it to `out` at the end; after an error, the folder is removed.

    An older `out` is replaced only if it holds no files other than `files`, which the command writes. The function
    also removes a folder that a killed run with the same `out` left behind.

    Raises:
        InputError: `out` is no folder, holds other files, or cannot be written.
        WorkFailedError: the disk is full.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError("is not a folder, so no results can be written there", file=out)
    try:
        others = sorted({path.name for path in out.iterdir()} - set(files)) if out.is_dir() else []
        if others:
            raise InputError(f"holds other files, such as {others[0]}; name a new or an empty folder", file=out)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=out) from error
    made = not out.parent.exists()
    try:
        with ExitStack() as stack:
            try:
                with disk_named(out):
                    out.parent.mkdir(parents=True, exist_ok=True)
                    folder = stack.enter_context(beside(out, is_folder=True))
            except OSError as error:
                raise InputError(f"cannot be written: {error.strerror}", file=out) from error
            with disk_named(out):
                yield folder
            _put(folder, out)
    except BaseException:
        if made and out.parent.is_dir() and not any(out.parent.iterdir()):
            out.parent.rmdir()
        raise


def _put(folder: Path, out: Path) -> None:
    try:
        if out.exists():
            shutil.rmtree(out)
        folder.rename(out)
    except OSError as error:
        raise InputError(f"is being written by another run: {error.strerror}", file=out) from error


def write_file(text: str, path: Path) -> None:
    """Writes a file, completely or not at all, and makes the folders above it.

    Raises:
        InputError: the file cannot be written.
        WorkFailedError: the disk is full.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from error


def write_log(columns: Mapping[str, Array], path: Path) -> None:
    """Writes columns as CSV: a header, then a row for each control step, with nine digits."""
    np.savetxt(
        path, np.column_stack(list(columns.values())), fmt="%.9g", delimiter=",", header=",".join(columns), comments=""
    )


def write(
    flight: Flight, figures: dict[str, Any], page: str, out: Path, ticks: Mapping[str, Array] | None = None
) -> None:
    """Writes `log.csv`, `summary.json` and `report.html` into `out`. Raises InputError as `fresh_folder` does.

    `ticks`: the columns of `ticks.csv`, for a flight over a link.
    """
    with fresh_folder(out, {"log.csv", "ticks.csv", "summary.json", "report.html"}) as folder:
        write_log(flight.log, folder / "log.csv")
        if ticks is not None:
            write_log(ticks, folder / "ticks.csv")
        (folder / "summary.json").write_text(json.dumps(figures, indent=2) + "\n")
        (folder / "report.html").write_text(page, encoding="utf-8")
