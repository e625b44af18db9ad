"""Files that are written beside their place and then renamed, and the removal of those that a killed run left."""

from __future__ import annotations

import glob
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

try:
    import fcntl
except ImportError:  # no POSIX: leftovers stay
    fcntl = None  # type: ignore[assignment]


@contextmanager
def beside(place: Path, *, is_folder: bool = False) -> Iterator[Path]:
    """Yields a new and empty file, or folder, beside `place`, to be filled and renamed; else it is removed at the end.

    Leftovers of a killed run of the same `place` are removed first. They have no lock, because it ends with its
    process.

    Raises:
        OSError: nothing can be made there.
    """
    prefix = f".{place.name}-unfinished-"
    for path in place.parent.glob(f"{glob.escape(prefix)}*"):
        with suppress(OSError):
            if (lock := _locked(path)) is not None:
                _remove(path)
                os.close(lock)
    while True:
        made = place.with_name(f"{prefix}{token_hex(6)}")
        made.mkdir() if is_folder else made.touch(exist_ok=False)
        lock = _locked(made)
        if lock is not None or fcntl is None:
            break  # else another run treated it as a leftover in between
    try:
        yield made
    finally:
        _remove(made)
        if lock is not None:
            os.close(lock)


def _locked(path: Path) -> int | None:
    """Returns a lock; None: another process holds the lock or has removed the file, or the system has no locks."""
    if fcntl is None:
        return None
    with suppress(FileNotFoundError):
        handle = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        except OSError:
            pass
        os.close(handle)
    return None


def _remove(path: Path) -> None:
    with suppress(OSError):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
