"""The public logs that the benchmark knows: reads real_logs.toml, whose head explains the keys."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError

TABLE = Path(__file__).with_name("real_logs.toml")

_KINDS = ("table", "matlab", "wpilib")


@dataclass(frozen=True)
class HiddenTest:
    """A benchmark's own protocol: fits see no sample of `run`; the error of `signal` counts after `skip` samples."""

    run: str
    signal: str
    skip: int
    source: str


@dataclass(frozen=True)
class RealLog:
    """One public log: where it is, how it becomes a data set, and what is known of its machine.

    Attributes:
        repository: "owner/name"; empty: the user has the log as a data set.
        files: groups of paths or patterns; the files of a group stand side by side.
        mapping: ``SIGNAL=SOURCE[:UNIT]``, as the importers take it.
        nominal: `[nominal]` of the data set.
        mechanisms: those that a knower of the machine would look for.
    """

    name: str
    machine: str
    known: str
    source: str
    physics: str
    mechanisms: tuple[str, ...]
    repository: str = ""
    kind: str = "table"
    files: tuple[tuple[str, ...], ...] = ()
    test: HiddenTest | None = None
    mapping: tuple[str, ...] = ()
    vehicle: Vehicle = "diff_drive"
    frame: Frame = "FRD"
    delimiter: str = ","
    header: bool = False
    comment: str = ""
    step_s: float = 0.0
    skip: int = 0
    every: int = 1
    parts: int = 1
    held_out: tuple[str, ...] = ()
    nominal: Mapping[str, Any] | None = None


def read(path: Path = TABLE) -> tuple[RealLog, ...]:
    """Returns the logs of a table.

    Raises:
        InputError: the file is no TOML, or an entry lacks a key or has an unknown one.
    """
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8"))["log"]
        return tuple(_log(path, dict(entry)) for entry in entries)
    except (OSError, tomllib.TOMLDecodeError, KeyError) as error:
        raise InputError(f"is not a table of logs: {error}", file=path) from error


def _log(path: Path, entry: dict[str, Any]) -> RealLog:
    groups = entry.pop("files", [])
    entry["files"] = tuple((one,) if isinstance(one, str) else tuple(one) for one in groups)
    entry["mapping"] = tuple(entry.pop("map", ()))
    for key in ("mechanisms", "held_out"):
        entry[key] = tuple(entry.get(key, ()))
    try:
        if "test" in entry:
            entry["test"] = HiddenTest(**entry["test"])
        log = RealLog(**entry)
    except TypeError as error:
        raise InputError(str(error), file=path, field=str(entry.get("name"))) from error
    if log.kind not in _KINDS or bool(log.files) != bool(log.repository) or min(log.every, log.parts) < 1:
        message = f"needs one of {', '.join(_KINDS)}, both repository and files or neither, and every and parts above 0"
        raise InputError(message, file=path, field=log.name)
    return log


def by_name(path: Path = TABLE) -> dict[str, RealLog]:
    """Returns the logs of a table by the names of their data sets."""
    return {log.name: log for log in read(path)}
