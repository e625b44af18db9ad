"""Turns MATLAB .mat files, v4 to v7.3, into a data set.

A channel is named ``VARIABLE``, or ``VARIABLE[COLUMN]`` for a column of a matrix, counted from 0; a field of a struct
is ``struct.field``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.importers.channels import Channel, Log
from brickpilot.importers.mat_file import load


def read(file: Path, texts: Collection[str] | None = None) -> Log:
    """Reads the vectors and the columns of matrices; a field of a struct is ``struct.field``.

    Raises:
        InputError: there is no such file, or the file cannot be read.
    """
    channels: dict[str, Channel] = {}
    aliases, others = {}, {}
    for name, value in _with_fields(load(file)).items():
        matrix = np.asarray(value)
        if matrix.dtype.kind not in "fiub" or matrix.ndim not in (1, 2) or not matrix.size:
            others[name] = "is not a vector or matrix of real numbers"
            continue
        if matrix.ndim == 2 and min(matrix.shape) != 1:
            columns = {f"{name}[{index}]": column for index, column in enumerate(matrix.T)}
        else:
            columns = {name: matrix.ravel()}
            aliases[f"{name}[0]"] = name
        for place, column in columns.items():
            if np.isinf(column).any():
                others[place] = "holds an infinite value"
            else:
                channels[place] = Channel(place, "matrix", None, column.astype(np.float64))
    aliases = {alias: name for alias, name in aliases.items() if name in channels}
    notes = (f"without a vector of numbers: {', '.join(others)}",) if others and texts is None else ()
    return Log(file, channels, aliases, notes, of="variable", others=others)


def _with_fields(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Returns name -> value of all variables and of all fields of structs; a field follows its struct."""
    every = {}
    for name, value in variables.items():
        if not str(name).startswith("__"):
            every[str(name)] = value
            if isinstance(value, Mapping):
                every |= {f"{name}.{field}": content for field, content in _with_fields(value).items()}
    return every
