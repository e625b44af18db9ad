"""Loads the compiled libraries that are installed beside this package: the plant, and a brick."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import Any

from cffi import FFI

_ENDINGS = {"win32": ".dll", "darwin": ".dylib"}  # of a shared library, else ".so"


@cache
def interface(name: str = "brickpilot_sim") -> tuple[FFI, Any]:
    """Returns cffi's `ffi` and a loaded library; its functions are described in the header of the same name."""
    folder = Path(__file__).parent
    header = (folder / f"{name}.h").read_text(encoding="utf-8")
    ffi = FFI()
    ffi.cdef("\n".join(line for line in header.splitlines() if not line.startswith("#")))
    return ffi, ffi.dlopen(str(folder / f"lib{name}{_ENDINGS.get(sys.platform, '.so')}"))
