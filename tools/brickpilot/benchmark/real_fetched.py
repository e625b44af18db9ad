"""Makes data sets of the public logs, from clones of their repositories."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from fnmatch import fnmatch
from itertools import pairwise, zip_longest
from pathlib import Path

import numpy as np
import tomlkit

from brickpilot.benchmark.real_logs import RealLog
from brickpilot.data import reading
from brickpilot.data.description import describe
from brickpilot.data.rows import CsvFormat, read_columns
from brickpilot.errors import InputError
from brickpilot.importers.matlab import import_matlab
from brickpilot.importers.table import import_table
from brickpilot.importers.wpilib import import_wpilib
from brickpilot.importers.writer import NewDataset, NewRun, run_names, write


def clone_of(log: RealLog, fetched: Path) -> Path | None:
    """Returns the clone of a log's repository among those in `fetched`; None: it is not there."""
    owner, _, name = log.repository.partition("/")
    places = (fetched / owner / name, fetched / f"{owner}+{name}", fetched / name)
    return next((place for place in places if place.is_dir()), None)


def build(log: RealLog, fetched: Path, out: Path) -> Path | None:
    """Makes the data set of a log in the new folder `out`; returns it, or None where its repository is not there.

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
    """Does as `build`, unless the data set is there already."""
    return out if (out / "dataset.toml").is_file() else build(log, fetched, out)


def _found(clone: Path, patterns: Sequence[str]) -> list[tuple[Path, ...]]:
    """Returns the files that stand side by side: one tuple for each match of the first pattern."""
    columns = [sorted(clone.glob(pattern)) for pattern in patterns]
    for pattern, files in zip(patterns, columns, strict=True):
        if not files:
            raise InputError("no such file; is the clone complete?", file=clone / pattern)
    return list(zip(*columns, strict=True))


def _imported(log: RealLog, groups: Sequence[tuple[Path, ...]], raw: Path) -> None:
    """Runs the importer of the log's kind."""
    first = [group[0] for group in groups]
    if log.kind == "wpilib":
        import_wpilib(first, raw, name=log.name)
    elif log.kind == "matlab":
        import_matlab(first, raw, log.mapping, vehicle=log.vehicle, frame=log.frame, name=log.name)
    else:
        tables = raw.parent / "tables"
        tables.mkdir()
        files = [_plain(log, group, tables / f"{run}.csv") for group, run in zip(groups, run_names(first), strict=True)]
        import_table(
            files, raw, log.mapping,
            vehicle=log.vehicle, frame=log.frame, delimiter=log.delimiter, header=log.header, name=log.name,
        )  # fmt: skip


def _plain(log: RealLog, group: Sequence[Path], out: Path) -> Path:
    """Writes a table without comments, with the files of a group side by side and a column of time where asked for."""
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
    """Writes the imported data set again: without its first rows, one row of so many, cut into runs."""
    imported = describe(raw / "dataset.toml")
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
    write(NewDataset(log.name, imported.vehicle, imported.frame, units, runs), out, source)


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
