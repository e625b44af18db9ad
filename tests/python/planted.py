"""Plants faults in copies of measured data sets: in whole columns, such as a wrong unit, or in rows."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from numpy.typing import NDArray

Column = NDArray[np.float64]


def plant(
    source: Path, folder: Path, columns: Sequence[str], change: Callable[[Column], Column], *runs: str
) -> Dataset:
    """Copies the data set `source` to `folder`, applies `change` to `columns` of `runs`, and returns the copy.

    Without `runs`, all runs are changed.
    """
    shutil.copytree(source, folder)
    for file in sorted(folder.glob("*.csv")):
        if not runs or file.stem in runs:
            names = file.read_text(encoding="utf-8").splitlines()[0].split(",")
            table = _table(source / file.name).copy()
            for name in columns:
                at = names.index(name)
                table[:, at] = change(table[:, at])
            rows = "\n".join(",".join("" if cell != cell else repr(cell) for cell in row) for row in table.tolist())
            file.chmod(0o644)
            file.write_text(",".join(names) + "\n" + rows + "\n", encoding="utf-8")
    return read(folder)


def rewritten(source: Path, folder: Path, change: Callable[[list[str]], list[str]], *runs: str) -> Dataset:
    """Copies the data set `source` to `folder`, applies `change` to the rows of `runs`, and returns the copy.

    `change` gets all rows below the header. Without `runs`, all runs are changed.
    """
    shutil.copytree(source, folder)
    for file in sorted(folder.glob("*.csv")):
        if not runs or file.stem in runs:
            header, *rows = file.read_text(encoding="utf-8").splitlines()
            file.chmod(0o644)
            file.write_text("\n".join([header, *change(rows)]) + "\n", encoding="utf-8")
    return read(folder)


@functools.cache
def _table(file: Path) -> Column:
    return np.genfromtxt(file, delimiter=",", skip_header=1)


undamaged = functools.cache(read)
"""Returns the data set in a folder that no test changes. It is read only once."""


def thin(folder: Path, every: int) -> None:
    """Keeps only each `every`-th sample of each run, so that discovery and fits of long logs take less time."""
    for file in folder.glob("*.csv"):
        header, *rows = file.read_text(encoding="utf-8").splitlines(keepends=True)
        file.write_text(header + "".join(rows[::every]), encoding="utf-8")


def new_faults(dataset: Dataset, sound: Dataset) -> set[tuple[str, str, str]]:
    """Returns (run, signal, kind) of each data fault of `dataset` that the undamaged data set `sound` does not have."""
    return _named(dataset) - _named(sound)


def _named(dataset: Dataset) -> set[tuple[str, str, str]]:
    return {(fault.run, fault.signal, fault.kind) for fault in dataset.faults}
