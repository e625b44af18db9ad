"""The errors of this package: bad input, a failed simulation, and failed work."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

_FULL = {errno.ENOSPC, errno.EFBIG, errno.EDQUOT}


class SimulationError(Exception):
    """A run cannot be simulated to its end. The CLI prints one line and exits with status 1.

    Args:
        job: index of the run among those that were to be simulated; None: not known.
        status: `BP_E_` code of the plant.
    """

    def __init__(self, message: str, job: int | None = None, status: int | None = None) -> None:
        super().__init__(message)
        self.job = job
        self.status = status


class WorkFailedError(Exception):
    """The work failed, such as a mission that was not flown. The CLI prints one line and exits with status 1."""


class DiskFullError(WorkFailedError):
    """The disk is full.

    Args:
        path: the file or folder that is being written, as the user named it.
        reason: the words of the operating system.
    """

    def __init__(self, path: Path | str, reason: str) -> None:
        super().__init__(f"{path}: {reason}; nothing of it is written")
        self.reason = reason


class InputError(Exception):
    """Bad input. The message is one line that names the place, `file:line: field: fault`; the CLI exits with status 2.

    Args:
        message: what is wrong and what would be right, in one sentence without a newline.
        file: the file, as the user named it.
        line: 1-based line in that file, if the fault is in one line.
        field: the key, column, option or signal, e.g. ``nominal.mass``.
    """

    def __init__(
        self, message: str, *, file: Path | str | None = None, line: int | None = None, field: str | None = None
    ) -> None:
        place = ""
        if file is not None:
            place += f"{file}:" if line is None else f"{file}:{line}:"
        if field is not None:
            place += f" {field}:" if place else f"{field}:"
        super().__init__(" ".join(f"{place} {message}".strip().splitlines()))


@contextmanager
def disk_named(path: Path | str) -> Iterator[None]:
    """Raises an error of one line that names `path`, if the disk is full; the system's own error names no file.

    Args:
        path: the file or folder that is being written, as the user named it.

    Raises:
        DiskFullError: the disk or the quota is full, or a limit of file sizes is reached.
    """
    try:
        yield
    except DiskFullError as error:  # the error names a file below `path`, which the user did not name
        raise DiskFullError(path, error.reason) from error
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise DiskFullError(path, error.strerror or "full") from error


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Returns "; did you mean A or B?" with the known names most similar to `name`; empty: no name is similar."""
    close = get_close_matches(name, list(known), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(close)}?" if close else ""
