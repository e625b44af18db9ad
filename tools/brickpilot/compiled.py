"""Loads the compiled libraries that are installed beside this package: the plant, and a brick."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import Any

from cffi import FFI

from brickpilot.errors import InputError

_ENDINGS = {"win32": ".dll", "darwin": ".dylib"}  # endings of a shared library; elsewhere ".so"


@cache
def interface(name: str = "brickpilot_sim") -> tuple[FFI, Any]:
    """Returns cffi's `ffi` and a loaded library. The header of the same name describes the library's functions."""
    folder = Path(__file__).parent
    ffi = FFI()
    ffi.cdef(_declarations(folder / f"{name}.h"))
    return ffi, ffi.dlopen(str(library(name)))


def library(name: str = "brickpilot_sim") -> Path:
    """Returns the file of a library that is installed beside this package."""
    return Path(__file__).parent / f"lib{name}{_ENDINGS.get(sys.platform, '.so')}"


@cache
def closed_loop(file: Path) -> Any:
    """Loads and returns a library that `sim_host/run/build` made: `bp_fly` with another firmware, on the same plant.

    Raises:
        InputError: the library was compiled in a checkout that has another plant than this package.
    """
    ffi, plant = interface()
    loop: Any = ffi.dlopen(str(file))
    if loop.bp_plant_size() != plant.bp_plant_size():
        raise InputError("has another plant than the installed package; run pip install ./tools", field="the checkout")
    return loop


def _declarations(header: Path) -> str:
    """Returns the declarations of a header and of this package's headers that the header includes."""
    lines = []
    for line in header.read_text(encoding="utf-8").splitlines():
        if line.startswith('#include "'):
            lines.append(_declarations(header.parent / line.split('"')[1]))
        elif not line.startswith("#"):
            lines.append(line)
    return "\n".join(lines)
