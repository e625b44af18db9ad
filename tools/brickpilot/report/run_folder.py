"""Output folders and files. Each is written beside its place and then renamed, so that it is complete or absent."""

from __future__ import annotations

import glob
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError, disk_named
from brickpilot.vehicle.flight import Flight

try:
    import fcntl
except ImportError:  # no POSIX: what is left over stays
    fcntl = None  # type: ignore[assignment]

Array = NDArray[np.float64]


@contextmanager
def fresh_folder(out: Path, files: Collection[str]) -> Iterator[Path]:
    """Yields an empty folder beside `out` and renames it to `out` at the end; an error leaves nothing behind.

    An older `out` is replaced only if it holds no other files than `files`, those that the command writes. What a
    killed run of the same `out` has left beside it is removed.

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
        made = not out.parent.exists()
        with disk_named(out):
            out.parent.mkdir(parents=True, exist_ok=True)
            _remove_left_over(out)
            beside = Path(tempfile.mkdtemp(prefix=_prefix(out), dir=out.parent))
            lock = _locked(beside)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=out) from error
    try:
        with disk_named(out):
            yield beside
            beside.chmod(0o755)
            if out.exists():
                shutil.rmtree(out)
            beside.rename(out)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        if made and not any(out.parent.iterdir()):
            out.parent.rmdir()
        raise
    finally:
        if lock is not None:
            os.close(lock)


def _prefix(out: Path) -> str:
    return f".{out.name}-unfinished-"


def _locked(folder: Path) -> int | None:
    """Returns a lock on a folder that ends with this process; None: another process has it, or the system has none."""
    if fcntl is None:
        return None
    place = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(place)
        return None
    return place


def _remove_left_over(out: Path) -> None:
    """Removes the unfinished folders of `out` that no process holds."""
    for folder in out.parent.glob(f"{glob.escape(_prefix(out))}*"):
        with suppress(OSError):
            lock = _locked(folder)
            if lock is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(lock)


def write_file(text: str, path: Path) -> None:
    """Writes a file, whole or not at all, and the folders above it.

    Raises:
        InputError: it cannot be written.
        WorkFailedError: the disk is full.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with disk_named(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_text(text, encoding="utf-8")
            beside.replace(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from error
    finally:
        beside.unlink(missing_ok=True)


def write_log(columns: Mapping[str, Array], path: Path) -> None:
    """Writes columns as CSV: a header, then a row for each control step, with nine digits."""
    np.savetxt(
        path, np.column_stack(list(columns.values())), fmt="%.9g", delimiter=",", header=",".join(columns), comments=""
    )


def write(
    flight: Flight, figures: dict[str, Any], page: str, out: Path, ticks: Mapping[str, Array] | None = None
) -> None:
    """Writes `log.csv`, `summary.json` and `report.html` into `out`. Raises InputError as `fresh_folder` does.

    `ticks`: the columns of `ticks.csv`, of a flight over a link.
    """
    with fresh_folder(out, {"log.csv", "ticks.csv", "summary.json", "report.html"}) as folder:
        write_log(flight.log, folder / "log.csv")
        if ticks is not None:
            write_log(ticks, folder / "ticks.csv")
        (folder / "summary.json").write_text(json.dumps(figures, indent=2) + "\n")
        (folder / "report.html").write_text(page, encoding="utf-8")
