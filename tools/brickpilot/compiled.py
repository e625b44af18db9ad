"""Loads the compiled plant, a shared library that is installed beside this package."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from cffi import FFI


@cache
def interface() -> tuple[FFI, Any]:
    """Returns cffi's `ffi` and the loaded library; its functions are described in `brickpilot_sim.h`."""
    folder = Path(__file__).parent
    header = (folder / "brickpilot_sim.h").read_text(encoding="utf-8")
    ffi = FFI()
    ffi.cdef("\n".join(line for line in header.splitlines() if not line.startswith("#")))
    return ffi, ffi.dlopen(str(folder / "libbrickpilot_sim.so"))
