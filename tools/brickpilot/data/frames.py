"""Makes a data set from DataFrames in memory, with the same checks as for a folder."""

from __future__ import annotations

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.rows import Columns
from brickpilot.data.signals import SIGNALS
from brickpilot.data.toml_file import Key, TomlFile
from brickpilot.errors import InputError

if TYPE_CHECKING:
    import pandas

Column = str | tuple[str, str] | Mapping[str, Any]
"""A signal's column: a name (SI unit); (name, unit); or a mapping of the keys that a data set's file may state."""

_ARGUMENTS = {"role": "roles"}  # key -> argument of `Dataset.from_frames` with another name


class StatedTables(TomlFile):
    """The arguments of `Dataset.from_frames`, as the tables that a dataset.toml would hold. Errors name no file."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.path = Path("from_frames")
        self.data = _plain(data)
        self._lines = {}
        self._check_integers((), self.data)

    def file_beside(self, key: Key, value: object) -> Path:
        """Returns the run's name as errors show it, because a frame has no file."""
        return Path(f"run {value}")


@dataclass(frozen=True)
class FrameColumns(Columns):
    """Columns of a DataFrame; its rows count from 0, as in `frame.iloc`."""

    def fault(self, message: str, row: int, field: str | None = None) -> InputError:
        """Returns the error that names the run, the row and the field."""
        return InputError(message, file=f"{self.source}, row {row}", field=field)


def tables(
    frames: Mapping[str, pandas.DataFrame],
    signals: Mapping[str, Column] | None,
    of_runs: Mapping[str, Mapping[str, Any]],
    stated: Mapping[str, Any],
) -> StatedTables:
    """Returns the tables that a dataset.toml of these frames would hold.

    Args:
        frames: run -> its table.
        signals: signal -> column; None: each column that has the name of a signal, in SI.
        of_runs: key of a run's table -> run -> its value.
        stated: the other keys of the file; None: not stated.

    Raises:
        InputError: there is no frame, a frame is no DataFrame, or an argument names an unknown run.
    """
    import pandas

    if not isinstance(frames, Mapping) or not frames:
        got = "an empty mapping" if isinstance(frames, Mapping) else f"a {type(frames).__name__}"
        raise InputError(f"got {got}: needs at least one run, {{name: DataFrame}}", field="from_frames")
    for name, frame in frames.items():
        if not isinstance(frame, pandas.DataFrame):
            raise InputError(f"is a {type(frame).__name__}, not a DataFrame", file=f"run {name}")
    for key, values in of_runs.items():
        if not isinstance(values, Mapping):
            raise InputError(
                f"{values!r} is not a mapping of runs to values", field=f"from_frames: {_ARGUMENTS.get(key, key)}"
            )
        for name in values:
            if name not in frames:
                message = f"no run {name!r}; the runs are {', '.join(map(str, frames))}"
                raise InputError(message, field=f"from_frames: {_ARGUMENTS.get(key, key)}")
    if signals is None:
        first = next(iter(frames.values()))
        signals = {name: name for name in SIGNALS if name in first.columns or name == first.index.name}
    columns = {"time": "time"} | dict(signals)
    runs = [
        {"name": name, "file": name} | {key: values[name] for key, values in of_runs.items() if name in values}
        for name in frames
    ]
    given = {key: value for key, value in stated.items() if value is not None}
    described = {name: _signal(name, column) for name, column in columns.items()}
    return StatedTables(given | {"signals": described, "runs": runs})


def read_frame(run: Path, frame: pandas.DataFrame, wanted: Mapping[str, str | int]) -> FrameColumns:
    """Returns the wanted columns of a frame; the index counts as a column if it has the column's name.

    Args:
        run: the run's name in errors.
        wanted: signal -> column.

    Raises:
        InputError: a missing or double column, a cell that is not a number, or no rows.
    """
    names = [str(name) for name in frame.columns]
    if not len(frame):
        raise InputError("holds no rows of data", file=run)
    columns = FrameColumns({}, range(len(frame)), run)
    for signal, column in wanted.items():
        count = names.count(str(column))
        if count > 1:
            raise InputError("column occurs more than once", file=run, field=str(column))
        if count == 1:
            cells = frame.iloc[:, names.index(str(column))]
        elif column == frame.index.name:
            cells = frame.index.to_series()
        else:
            raise InputError(f"no column {column!r} among {', '.join(names[:20])}", file=run, field=signal)
        columns.values[signal] = _numbers(columns, f"{signal} (column {column})", cells)
    return columns


def _signal(name: str, column: Column) -> dict[str, Any]:
    """Returns the table of a signal; an unknown signal is refused later, by the checks of all files."""
    unit = SIGNALS[name].unit if name in SIGNALS else "1"
    if isinstance(column, Mapping):
        return {"unit": unit, **column}
    if isinstance(column, tuple) and len(column) == 2:
        return {"column": column[0], "unit": column[1]}
    return {"column": column, "unit": unit}


def _numbers(columns: FrameColumns, field: str, cells: pandas.Series) -> NDArray[np.float64]:
    """Returns the cells as numbers; NaN where a cell is missing."""
    if cells.dtype.kind in "iuf":
        return np.array(cells.to_numpy(dtype=np.float64, na_value=np.nan))
    if cells.dtype.kind in "mM":
        raise InputError(f"holds {cells.dtype}; give it as a number", file=columns.source, field=field)
    missing = cells.isna().to_numpy()
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if missing[row]:
            continue
        if isinstance(cell, bool | np.bool_) or not isinstance(cell, numbers.Real):
            raise columns.fault(f"{str(cell)[:40]!r} is not a number (None or NaN: no value)", row, field)
        values[row] = float(cell)
    return values


def _plain(value: Any) -> Any:
    """Returns the value as a TOML file would give it: no numpy scalar, tuple or foreign mapping."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value
