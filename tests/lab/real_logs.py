"""Reads the table of public logs of the benchmark, and makes their data sets from clones of their repositories.

The head of real_logs.toml explains its keys.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from brickpilot.data import reading
from brickpilot.data.description import describe
from brickpilot.data.rows import CsvFormat, read_columns
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.importers.writer import NewDataset, NewRun, run_names, write
from brickpilot.public.logs import import_log

TABLE = Path(__file__).with_name("real_logs.toml")

_KINDS = ("table", "matlab", "wpilib")


@dataclass(frozen=True)
class HiddenTest:
    """A benchmark's own protocol: no fit uses `run`, and the error of `signal` counts from sample `skip` on.

    Attributes:
        unit: the unit of the benchmark's error; one SI unit of the signal is `scale` such units.
        published: published errors of other authors, in words.
    """

    run: str
    signal: str
    skip: int
    source: str
    unit: str
    scale: float
    published: str


@dataclass(frozen=True)
class RealLog:
    """One public log: its source, the import options, and the known facts of its machine.

    Attributes:
        repository: "owner/name"; empty: no public clone, the user has the log as a data set.
        files: groups of paths or patterns; the columns of a group's files are joined.
        mapping: ``SIGNAL=SOURCE[:UNIT]``, as for the importers.
        nominal: `[nominal]` of the data set.
        mechanisms: the mechanisms that an expert on the machine would look for.
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
        InputError: the file is not TOML, or an entry lacks a key or has an unknown key.
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


def clone_of(log: RealLog, fetched: Path) -> Path | None:
    """Returns the clone of a log's repository in `fetched`; None: there is no clone."""
    owner, _, name = log.repository.partition("/")
    places = (fetched / owner / name, fetched / f"{owner}+{name}", fetched / name)
    return next((place for place in places if place.is_dir()), None)


def build(log: RealLog, fetched: Path, out: Path) -> Path | None:
    """Makes the data set of a log in the new folder `out` and returns `out`; None: its repository has no clone.

    Raises:
        InputError: a file of the log is missing or damaged.
    """
    clone = clone_of(log, fetched)
    if clone is None:
        return None
    groups = [group for patterns in log.files for group in _found(clone, patterns)]
    with tempfile.TemporaryDirectory() as place:
        raw = Path(place) / log.name
        _imported(log, groups, raw)
        _reshaped(log, raw, out, groups[0][0])
    _completed(log, out)
    reading.read(out)
    return out


def build_once(log: RealLog, fetched: Path, out: Path) -> Path | None:
    """Returns the data set of a log; if it does not exist yet, `build` makes it."""
    return out if (out / "dataset.toml").is_file() else build(log, fetched, out)


def _found(clone: Path, patterns: Sequence[str]) -> list[tuple[Path, ...]]:
    """Returns the files whose columns are joined: one tuple for each match of the first pattern."""
    columns = [sorted(clone.glob(pattern)) for pattern in patterns]
    for pattern, files in zip(patterns, columns, strict=True):
        if not files:
            raise InputError("no such file; is the clone complete?", file=clone / pattern)
    return list(zip(*columns, strict=True))


def _imported(log: RealLog, groups: Sequence[tuple[Path, ...]], raw: Path) -> None:
    """Runs the importer of the log's kind."""
    first = [group[0] for group in groups]
    if log.kind == "wpilib":
        import_log(first, raw, kind="wpilib", name=log.name)
    elif log.kind == "matlab":
        import_log(first, raw, kind="matlab", mapping=log.mapping, vehicle=log.vehicle, frame=log.frame, name=log.name)
    else:
        tables = raw.parent / "tables"
        tables.mkdir()
        files = [_plain(log, group, tables / f"{run}.csv") for group, run in zip(groups, run_names(first), strict=True)]
        import_log(
            files, raw, kind="table", mapping=log.mapping,
            vehicle=log.vehicle, frame=log.frame, delimiter=log.delimiter, header=log.header, name=log.name,
        )  # fmt: skip


def _plain(log: RealLog, group: Sequence[Path], out: Path) -> Path:
    """Writes a table without comments: the joined columns of a group's files, with a time column if `step_s` is set."""
    columns = [_lines(path, log.comment) for path in group]
    rows = [log.delimiter.join(cells) for cells in zip_longest(*columns, fillvalue="")]
    if log.step_s:
        rows = [f"{number * log.step_s!r}{log.delimiter}{row}" for number, row in enumerate(rows)]
    out.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return out


def _lines(path: Path, comment: str) -> list[str]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("cannot be read as text", file=path) from error
    return [line for line in lines if line.strip() and not (comment and line.lstrip().startswith(comment))]


def _reshaped(log: RealLog, raw: Path, out: Path, source: Path) -> None:
    """Writes the imported data set again, without its first rows, with every `log.every`-th row, and cut into runs."""
    imported = describe(TomlFile(raw / "dataset.toml")).dataset
    runs: list[NewRun] = []
    layout = CsvFormat(",", True)
    for entry in imported.runs:
        columns = read_columns(entry.file, {name: name for name in imported.signals}, layout).values
        kept = np.arange(log.skip, len(columns["time"]), log.every)
        edges = np.linspace(0, len(kept), log.parts + 1).round().astype(int)
        for part, (begin, end) in enumerate(pairwise(edges), 1):
            name = entry.name if log.parts == 1 else f"{entry.name}_{part}"
            chosen = kept[begin:end]
            gap_s = entry.gap_s if part == 1 and entry.gap_s else None
            runs.append(NewRun(name, {signal: values[chosen] for signal, values in columns.items()}, gap_s))
    units = {name: signal.unit for name, signal in imported.signals.items()}
    write(NewDataset(imported.vehicle, imported.frame, units, runs, name=log.name), out, source)


def _completed(log: RealLog, out: Path) -> None:
    """Adds nominal values, and the runs that are held out, to a data set's description."""
    path = out / "dataset.toml"
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    document["nominal"] = dict(log.nominal or {})
    if log.held_out:
        for run in document["runs"]:
            out_of_fit = any(fnmatch(run["name"], pattern) for pattern in log.held_out)
            run["role"] = "held_out" if out_of_fit else "fit"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")


def describe_missing(logs: Sequence[RealLog], fetched: Path) -> list[str]:
    """Returns a line for each log whose repository is not in `fetched`."""
    return [
        f"{log.name}: not there; clone github.com/{log.repository} into {fetched / log.repository}"
        for log in logs
        if log.repository and clone_of(log, fetched) is None
    ]
