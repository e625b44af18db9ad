"""Reads the variables of a .mat file.

A separate process reads the file, because a damaged file can crash scipy's reader. That process loads this module, so
the module imports little.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
from scipy.io import loadmat

from brickpilot.errors import InputError
from brickpilot.importers.channels import check_file


def load(file: Path) -> Mapping[str, Any]:
    """Returns variable -> array as MATLAB shows it; a struct becomes a mapping.

    scipy reads v4 to v7.2, h5py reads v7.3 (HDF5).

    Raises:
        InputError: there is no such file, or the file cannot be read.
    """
    check_file(file)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as child:
        try:
            variables = child.submit(parse, file).result()
        except BrokenProcessPool as error:
            raise InputError("is not a readable .mat file: its reader crashed", file=file) from error
    if variables is None:
        raise InputError("is not a readable .mat file", file=file)
    return variables


def parse(file: Path) -> dict[str, Any] | None:
    """Does the same as `load`, but in this process; returns None if the file cannot be read."""
    try:
        try:
            return dict(loadmat(str(file), simplify_cells=True))
        except NotImplementedError:  # scipy raises this error for v7.3
            with h5py.File(file, "r") as content:
                return _tree(content)
    except Exception:  # the readers raise any kind of error on a damaged file
        return None


def _tree(group: h5py.Group) -> dict[str, Any]:
    return {
        name: _tree(item) if isinstance(item, h5py.Group) else np.asarray(item[()]).T
        for name, item in group.items()
        if not name.startswith("#")
    }
