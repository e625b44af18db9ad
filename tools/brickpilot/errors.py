"""What can go wrong, and whose fault it is."""

from __future__ import annotations

from pathlib import Path


class SimulationError(Exception):
    """A run that could not be simulated to its end. The CLI prints it in one line and exits 1.

    Args:
        job: index of the run among those asked for.
        status: BP_E_ code of the plant.
    """

    def __init__(self, message: str, job: int | None = None, status: int | None = None) -> None:
        super().__init__(message)
        self.job = job
        self.status = status


class InputError(Exception):
    """Bad input, told in one line that names the place, `file:line: field: what is wrong`: the CLI exits 2 with it.

    Args:
        message: what is wrong and what would be right; one sentence, no newline.
        file: the file it stands in, as the user named it.
        line: 1-based line in that file, where one line is to blame.
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
