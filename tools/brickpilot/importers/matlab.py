"""Turns MATLAB .mat files, v4 to v7.3, into a data set.

A signal's place is ``VARIABLE``, or ``VARIABLE[COLUMN]`` for a column of a matrix, from 0; a field of a struct is
``struct.field``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log
from brickpilot.importers.chosen import SignalImporter
from brickpilot.importers.mapping import Place, Signals, Source, read_formulas, take, units_of, unknown_name
from brickpilot.importers.mat_file import load


def _signals(file: Path, sources: Mapping[str, Source], _rate: float | None, _cut: bool) -> Signals:
    variables = _with_fields(load(file))
    formulas = read_formulas(sources, list(variables))
    samples = _column(file, "time", formulas["time"].places[0], variables).size

    def checked(signal: str, place: Place) -> NDArray[np.float64]:
        values = _column(file, signal, place, variables)
        if values.size != samples:
            raise InputError(f"has {values.size} values where time has {samples}", file=file, field=signal)
        return values

    return Signals(file, *take(file, formulas, checked), units_of(sources))


def read(file: Path) -> Log:
    """Reads the vectors and the columns of matrices; a field of a struct is ``struct.field``.

    Raises:
        InputError: there is no such file, or it cannot be read.
    """
    variables = _with_fields(load(file))
    channels, others = {}, []
    for name, value in variables.items():
        shape = np.shape(value)
        is_matrix = len(shape) == 2 and min(shape) > 1
        try:
            for place in [Place(name, index) for index in range(shape[1])] if is_matrix else [Place(name)]:
                values = _column(file, name, place, variables)
                channels[str(place)] = Channel(str(place), "matrix", None, values)
        except InputError:
            others.append(name)
    notes = (f"without a vector of numbers: {', '.join(others)}",) if others else ()
    return Log(file, channels, notes=notes)


def _with_fields(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Returns name -> value of all variables and of all fields of structs; a field follows its struct."""
    every = {}
    for name, value in variables.items():
        if not str(name).startswith("__"):
            every[str(name)] = value
            if isinstance(value, Mapping):
                every |= {f"{name}.{field}": content for field, content in _with_fields(value).items()}
    return every


def _column(file: Path, signal: str, place: Place, variables: Mapping[str, Any]) -> NDArray[np.float64]:
    if place.name not in variables:
        raise InputError(unknown_name("variable", place.name, variables), file=file, field=signal)
    matrix = np.asarray(variables[place.name])
    if matrix.dtype.kind not in "fiub" or matrix.ndim not in (1, 2):
        raise InputError(f"{place.name!r} is not a vector or matrix of real numbers", file=file, field=signal)
    if place.index is not None:
        if matrix.ndim != 2 or place.index >= matrix.shape[1]:
            raise InputError(f"{place.name!r} has no column {place.index}, counted from 0", file=file, field=signal)
        matrix = matrix[:, place.index]
    elif matrix.ndim == 2 and min(matrix.shape) != 1:
        raise InputError(f"{place.name!r} is a matrix; name a column: {place.name}[0]", file=file, field=signal)
    column = matrix.astype(np.float64).ravel()
    if np.isinf(column).any():
        raise InputError(f"{place.name!r} holds an infinite value", file=file, field=signal)
    return column


import_matlab = SignalImporter(_signals, is_whole=True)
