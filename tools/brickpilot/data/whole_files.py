"""Reads text files, and writes files atomically: each file is written under another name and then renamed.

Removes unfinished files that killed processes left behind.
"""

from __future__ import annotations

import codecs
import glob
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from brickpilot.errors import InputError, disk_named

try:
    import fcntl
except ImportError:  # no POSIX: unfinished files of killed processes stay
    fcntl = None  # type: ignore[assignment]


SIZE_LIMIT = 256 * 2**20
"""Bytes; `read_text` refuses a larger file before it reads it."""


def read_text(path: Path, size_limit: int = SIZE_LIMIT, *, damaged: bool = False) -> str:
    """Returns the text of a file, in which each line end is one character.

    Args:
        path: UTF-8 text.
        size_limit: the size in bytes above which a file is refused; a multiple of 2**20.
        damaged: True: bytes that are no text are replaced, and the file may be UTF-16.

    Raises:
        InputError: the file cannot be read, is larger than `size_limit`, or is no text.
    """
    try:
        if not path.is_file():
            raise InputError("no such file" if not path.exists() else "is not a file", file=path)
        if path.stat().st_size > size_limit:
            raise InputError(f"is larger than {size_limit // 2**20} MiB", file=path)
        content = path.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=path) from error
    wide = damaged and content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace" if damaged else "strict")
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text", file=path, line=error.object[: error.start].count(b"\n") + 1) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def beside(place: Path, *, is_folder: bool = False) -> Iterator[Path]:
    """Yields a new empty file or folder beside `place`. The caller fills and renames it; otherwise it is removed.

    First removes the unfinished files for the same `place` that killed processes left behind. Such a file is not
    locked, because a lock ends with the process that holds the lock.

    Raises:
        OSError: no file or folder can be made there.
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
            break  # otherwise another process removed the new file as a leftover, before it was locked
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


def plain_name(name: str) -> str:
    """Returns `name` with "_" for all but letters and digits; every file system and program accepts the result."""
    return re.sub(r"\W", "_", name, flags=re.ASCII) or "model"


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Writes each path's bytes and makes missing folders; no file is renamed before all files are written.

    Raises:
        InputError: a file cannot be written.
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


def write_whole(path: Path | str, text: str) -> None:
    """Writes a text file so that a reader finds the old content or the new content, never a part of it.

    The text is written to a file beside `path`, which is then renamed.

    Raises:
        WorkFailedError: the disk is full.
    """
    target = Path(path)
    with disk_named(target), beside(target) as made:
        made.write_text(text, encoding="utf-8")
        made.replace(target)
