"""Writes a data-set folder: beside its place first, read back as a check, then renamed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from brickpilot.data import dataset
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError


@dataclass(frozen=True)
class Imported:
    """What an importer made: the folder, its runs in order, and one sentence each on what a user should know."""

    folder: Path
    runs: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class NewRun:
    """A run to be written: signal -> values in the signal's stated unit, NaN for a blank cell; all of one length."""

    name: str
    columns: Mapping[str, NDArray[np.float64]]
    gap_s: float | None = None


@dataclass(frozen=True)
class NewDataset:
    """A data set to be written. ``units``: signal -> unit, for every signal and in the order of the columns."""

    name: str
    vehicle: Vehicle
    frame: Frame
    units: Mapping[str, str]
    runs: Sequence[NewRun]
    nominal: Mapping[str, float] = field(default_factory=dict)
    notes: Sequence[str] = ()


def check_out(out: Path) -> None:
    """Refuses a place that holds something already.

    Raises:
        InputError: `out` is a file, or a folder that is not empty.
    """
    if out.is_dir() and not any(out.iterdir()):
        return
    if out.exists() or out.is_symlink():
        raise InputError("exists already; name a new folder", file=out, field="--out")


def write(new: NewDataset, out: Path, source: Path) -> Imported:
    """Writes `new` to the folder `out`, which does not exist or is empty.

    Args:
        new: the data set.
        out: its folder; missing parents are made.
        source: the log it comes from, named in an error.

    Raises:
        InputError: `out` is taken, cannot be written, or the result is no valid data set. Nothing is left behind then.
    """
    check_out(out)
    place = out.resolve()
    parent = next(folder for folder in place.parents if folder.is_dir())
    partial = parent / f".{place.name}.partial-{os.getpid()}"
    try:
        partial.mkdir()
        _fill(new, partial)
        read_back = dataset.read(partial)
        place.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(place)
    except OSError as error:
        raise InputError(error.strerror or "cannot be written", file=out, field="--out") from error
    except InputError as error:
        reason = str(error).replace(f"{partial}{os.sep}", "")
        raise InputError(f"makes no valid data set: {reason}", file=source) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return Imported(out, tuple(run.name for run in new.runs), (*new.notes, *read_back.notes))


def _fill(new: NewDataset, folder: Path) -> None:
    for run in new.runs:
        rows = zip(*(_cells(run.columns[signal]) for signal in new.units), strict=True)
        text = "\n".join([",".join(new.units), *(",".join(row) for row in rows)]) + "\n"
        (folder / f"{run.name}.csv").write_text(text, encoding="utf-8", newline="\n")
    (folder / "dataset.toml").write_text(_description(new), encoding="utf-8", newline="\n")


def _cells(values: NDArray[np.float64]) -> list[str]:
    return ["" if value != value else repr(value) for value in values.tolist()]


def _description(new: NewDataset) -> str:
    document = tomlkit.document()
    for note in new.notes:
        document.add(tomlkit.comment(note))
    document.update({"name": new.name, "vehicle": new.vehicle, "frame": new.frame})
    document["csv"] = _inline({"delimiter": ",", "header": True})
    signals = tomlkit.table()
    for signal, unit in new.units.items():
        signals[signal] = _inline({"column": signal, "unit": unit})
    document["signals"] = signals
    document["nominal"] = dict(new.nominal)
    runs = tomlkit.aot()
    for run in new.runs:
        entry = tomlkit.table()
        entry.update({"name": run.name, "file": f"{run.name}.csv"})
        if run.gap_s is not None:
            entry["gap_s"] = run.gap_s
        runs.append(entry)
    document["runs"] = runs
    return tomlkit.dumps(document)


def _inline(values: Mapping[str, object]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(values)
    return table
