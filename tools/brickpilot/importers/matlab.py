"""MATLAB .mat files, v4 to v7.3, turned into a data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.signals import Frame, Vehicle
from brickpilot.errors import InputError
from brickpilot.importers.mapping import Source, parse_mapping, units_of
from brickpilot.importers.mat_file import load
from brickpilot.importers.writer import Imported, NewDataset, NewRun, check_out, run_names, write


def import_matlab(
    files: Sequence[Path],
    out: Path,
    mapping: Sequence[str],
    *,
    vehicle: Vehicle,
    frame: Frame = "FRD",
    nominal: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Imported:
    """Makes a data set of .mat files; each file becomes a run of the same name.

    Args:
        files: .mat files that hold the same variables.
        out: the new folder.
        mapping: ``SIGNAL=VARIABLE:UNIT``, or ``SIGNAL=VARIABLE[COLUMN]:UNIT`` for a column of a matrix, from 0;
            ``:UNIT`` is optional for the SI unit; a field of a struct is ``struct.field``.
        vehicle, frame, nominal, name: as in a data set; the default name is that of the folder.

    Raises:
        InputError: naming file and variable, or the option. Nothing is written then.
    """
    check_out(out)
    sources = parse_mapping(mapping)
    names = run_names(files)
    runs = [NewRun(run, _columns(file, sources)) for run, file in zip(names, files, strict=True)]
    new = NewDataset(name or out.resolve().name, vehicle, frame, units_of(sources), runs, nominal or {})
    return write(new, out, files[0])


def _columns(file: Path, sources: Mapping[str, Source]) -> dict[str, NDArray[np.float64]]:
    variables = load(file)
    columns = {signal: _column(file, signal, source, variables) for signal, source in sources.items()}
    samples = columns["time"].size
    for signal, values in columns.items():
        if values.size != samples:
            raise InputError(f"has {values.size} values where time has {samples}", file=file, field=signal)
    return columns


def _column(file: Path, signal: str, source: Source, variables: Mapping[str, Any]) -> NDArray[np.float64]:
    value: Any = variables
    for part in source.name.split("."):
        if not isinstance(value, Mapping) or part not in value:
            known = ", ".join(str(name) for name in variables if not str(name).startswith("__"))
            raise InputError(f"no variable {source.name!r} among {known[:200]}", file=file, field=signal)
        value = value[part]
    matrix = np.asarray(value)
    if matrix.dtype.kind not in "fiub" or matrix.ndim not in (1, 2):
        raise InputError(f"{source.name!r} is not a vector or matrix of real numbers", file=file, field=signal)
    if source.index is not None:
        if matrix.ndim != 2 or source.index >= matrix.shape[1]:
            raise InputError(f"{source.name!r} has no column {source.index}, counted from 0", file=file, field=signal)
        matrix = matrix[:, source.index]
    elif matrix.ndim == 2 and min(matrix.shape) != 1:
        raise InputError(f"{source.name!r} is a matrix; name a column: {source.name}[0]", file=file, field=signal)
    column = matrix.astype(np.float64).ravel()
    if np.isinf(column).any():
        raise InputError(f"{source.name!r} holds an infinite value", file=file, field=signal)
    return column
