"""The machine on which something was measured: its processor, its cores, and the compiler of the compiled plant.

It is apart from `speed`, so that `scaling` needs no library of a link.
"""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path

from brickpilot import compiled


def describe() -> str:
    """Returns one line: "Intel(R) Xeon(R) Processor, 2 cores, gcc (Debian 12.2.0-14) 12.2.0"."""
    return f"{processor()}, {cores()} cores, {compiler()}"


def processor() -> str:
    """Returns the name of the processor, as Linux or Python's platform tells it."""
    told = Path("/proc/cpuinfo")
    named = re.search(r"^model name\s*: (.+)$", told.read_text(), re.MULTILINE) if told.exists() else None
    return named[1].strip() if named else platform.processor() or platform.machine()


def cores() -> int:
    """Returns the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiler() -> str:
    """Returns what the compiler wrote into the plant's library about itself."""
    told = re.search(rb"GCC: (\([^)\0]*\) [\d.]+)|(?:Apple )?clang version [\d.]+", compiled.library().read_bytes())
    if told is None:
        return "a compiler that does not tell its name"
    return f"gcc {told[1].decode()}" if told[1] else told[0].decode()
