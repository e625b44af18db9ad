"""MATLAB .mat files, v4 to v7.3, turned into a data set.

A signal's place is ``VARIABLE``, or ``VARIABLE[COLUMN]`` for a column of a matrix, from 0; a field of a struct is
``struct.field``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log
from brickpilot.importers.chosen import Read, SignalImporter
from brickpilot.importers.formula import Place, unknown_name
from brickpilot.importers.mapping import Source, read_formulas, take, units_of
from brickpilot.importers.mat_file import load


def _signals(file: Path, sources: Mapping[str, Source], _rate: float | None, _cut: bool) -> Read:
    variables = load(file)
    names = _names(variables)

    def column(signal: str, place: Place) -> NDArray[np.float64]:
        return _column(file, signal, place, variables, names)

    formulas = read_formulas(sources, names)
    samples = column("time", formulas["time"].places[0]).size

    def checked(signal: str, place: Place) -> NDArray[np.float64]:
        values = column(signal, place)
        if values.size != samples:
            raise InputError(f"has {values.size} values where time has {samples}", file=file, field=signal)
        return values

    return Read(take(formulas, checked, file), units_of(sources))


def read(file: Path) -> Log:
    """Reads the vectors and the columns of matrices; a field of a struct is ``struct.field``.

    Raises:
        InputError: no such file, or the file cannot be read.
    """
    variables = load(file)
    channels, others = {}, []
    for name in _names(variables):
        try:
            for place in _places(name, variables):
                text = name if place.index is None else f"{name}[{place.index}]"
                channels[text] = Channel(text, "matrix", None, _column(file, name, place, variables, ()))
        except InputError:
            others.append(name)
    notes = (f"without a vector of numbers: {', '.join(others)}",) if others else ()
    return Log(file, channels, notes=notes)


def _places(name: str, variables: Mapping[str, Any]) -> list[Place]:
    """Returns the place of a vector, or the places of a matrix's columns."""
    value: Any = variables
    for part in name.split("."):
        value = value[part]
    shape = np.shape(value)
    if len(shape) == 2 and min(shape) > 1:
        return [Place(name, index) for index in range(shape[1])]
    return [Place(name)]


def _names(variables: Mapping[str, Any]) -> list[str]:
    """Returns the names of all variables; a field of a struct is ``struct.field``."""
    names = []
    for name, value in variables.items():
        if str(name).startswith("__"):
            continue
        names.append(str(name))
        if isinstance(value, Mapping):
            names.extend(f"{name}.{field}" for field in _names(value))
    return names


def _column(
    file: Path, signal: str, place: Place, variables: Mapping[str, Any], names: Sequence[str]
) -> NDArray[np.float64]:
    value: Any = variables
    for part in place.name.split("."):
        if not isinstance(value, Mapping) or part not in value:
            raise InputError(unknown_name("variable", place.name, names), file=file, field=signal)
        value = value[part]
    matrix = np.asarray(value)
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
