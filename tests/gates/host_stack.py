"""Finds the largest stack of the firmware compiled for this machine, from the frames and calls that gcc reports."""

from __future__ import annotations

import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from stack_walk import UnboundedError

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = {"read", "write", "memset", "memcpy"}
"""Functions outside the firmware that gcc and firmware/targets/host/system.c call; their stack is not counted."""

_NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \(([^)]*)\)', re.MULTILINE)
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', re.MULTILINE)
_INDIRECT = "__indirect_call"


def compiled(folder: Path, sources: Sequence[Path], *flags: str) -> None:
    """Compiles C sources for this machine, and writes gcc's call graphs to a folder."""
    if platform.machine() == "x86_64":
        flags = (*flags, "-mno-red-zone")  # else gcc omits 128 bytes of a leaf function below its stack pointer
    for number, source in enumerate(sources):
        command = ["gcc", "-std=c99", "-O2", *flags, "-fstack-usage", "-fcallgraph-info=su", "-c", str(source)]
        subprocess.run([*command, "-o", str(folder / f"{number}.o")], check=True, cwd=ROOT)


def most(folder: Path, entry: str, indirect: Mapping[str, Sequence[str]]) -> int:
    """Returns the most bytes that a function takes together with the functions that it calls.

    Args:
        folder: the folder with the call graphs.
        entry: the function.
        indirect: function that calls through a pointer -> the functions that it may call.

    Raises:
        UnboundedError: recursion, a frame of unknown size, or an unlisted call through a pointer.
    """
    frames, calls = dict[str, int](), dict[str, set[str]]()
    for graph in folder.glob("*.ci"):
        text = graph.read_text(encoding="utf-8")
        for title, size, kind in _NODE.findall(text):
            name = title.rpartition(":")[2]
            if kind != "static":
                raise UnboundedError(f"{name}: a frame whose size is {kind}")
            # Static functions of two files may have the same name: the larger frame and all calls count.
            frames[name] = max(frames.get(name, 0), int(size))
        for source, target in _EDGE.findall(text):
            calls.setdefault(source.rpartition(":")[2], set()).add(target.rpartition(":")[2])
    known = dict[str, int]()

    def deepest(name: str, within: tuple[str, ...]) -> int:
        if name in within:
            raise UnboundedError("recursion: " + " -> ".join((*within[within.index(name) :], name)))
        if name in known or name in LIBRARY:
            return known.get(name, 0)
        if name not in frames:
            raise UnboundedError(f"{within[-1] if within else name}: {name} has no known frame")
        called = set(calls.get(name, ()))
        if _INDIRECT in called:
            if name not in indirect:
                raise UnboundedError(f"{name} calls through a pointer, and no list says where")
            called = (called - {_INDIRECT}) | set(indirect[name])
        known[name] = frames[name] + max((deepest(one, (*within, name)) for one in sorted(called)), default=0)
        return known[name]

    return deepest(entry, ())
