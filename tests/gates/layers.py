"""States which C and assembly files may include which others, and lists each line that breaks these rules."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

SUFFIXES = (".c", ".h", ".S", ".s", ".inc")
TOPS = ("firmware", "hal", "sim_host")
INCLUDE = re.compile(r'^\s*(?:#\s*include\s*[<"]([^">]+)[">]|\.include\s*"([^"]+)")')

# Folders in which the compilers look for an include.
SEARCHED = ("firmware", "hal", "hal/include", "sim_host", "sim_host/include", "")

FIRMWARE = {
    f"firmware/{room}" for room in ("core", "model", "estimator", "autopilot", "control", "mixer", "monitor", "app")
}
HAL = {"hal/include", "hal/wire"}

# Room -> other rooms that it may include. A room may always include itself.
MAY: dict[str, set[str]] = {
    "firmware/core": set(),
    **{
        f"firmware/{stage}": {"firmware/core"}
        for stage in ("model", "estimator", "autopilot", "control", "mixer", "monitor")
    },
    "firmware/app": FIRMWARE | HAL,
    "hal/include": {"hal/wire"},
    "hal/wire": set(),
    "hal/h8": set(),
    "sim_host/include": set(),
    "sim_host/models": set(),
    "sim_host/effects": {"sim_host/include"},
    "sim_host/plant": {"sim_host/effects", "sim_host/include", "sim_host/models"},
    "sim_host/sensors": {"sim_host/include", "sim_host/models"},
    "sim_host/fmi": {"sim_host/plant", "sim_host/effects", "sim_host/include"},
    "sim_host/run": {f"sim_host/{room}" for room in ("plant", "effects", "sensors", "include", "models")}
    | {"firmware/app", "hal/sil", "hal/include"},
    "sim_host/avr": {f"sim_host/{room}" for room in ("run", "plant", "effects", "sensors", "include", "models")}
    | {"hal/avr", "hal/sil"},
    "sim_host/brick": {"sim_host/include", "firmware/app", "hal/link", *HAL},
}

# Targets that use another port in addition to the port of the same name.
ALSO = {"firmware/targets/h8sim": {"hal/link"}, "firmware/targets/host": {"hal/h8sim"}}

# The rooms of the firmware that may hold assembly, only for arithmetic. Every stage also runs from its C code.
ASSEMBLY = (Path("firmware/core/h8"), Path("firmware/model/h8"))

# The compiler's own headers that a folder without an SDK may include. sim_host and the ports may include any header.
STANDARD = {"stdbool.h", "stddef.h", "stdint.h"}


class Fault(NamedTuple):
    """A line that breaks a rule."""

    path: str
    line: int
    what: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.what}"


def room_of(path: Path) -> str:
    """Returns the room of a file, from its path below the root: hal/rcx, firmware/targets/rcx, firmware/core."""
    return "/".join(path.parts[: 3 if path.parts[:2] == ("firmware", "targets") else 2])


def may_include(room: str) -> set[str] | None:
    """Returns the rooms that `room` may include besides itself, or None if no rule names `room`."""
    if room in MAY:
        return MAY[room]
    parts = room.split("/")
    if parts[0] == "hal":  # a port
        return HAL
    if parts[:2] == ["firmware", "targets"] and len(parts) == 3:
        return {"firmware/app", f"hal/{parts[2]}", *HAL} | ALSO.get(room, set())
    return None


def sources(root: Path) -> Iterator[Path]:
    """Yields the C and assembly files of the product, below `root`."""
    for top in TOPS:
        yield from sorted(p.relative_to(root) for p in (root / top).rglob("*") if p.suffix in SUFFIXES)


def found(root: Path, include: str) -> Path | None:
    """Returns the product's file that an include names, or None for a file of the compiler or an SDK."""
    return next((Path(top, include) for top in SEARCHED if (root / top / include).is_file()), None)


def includes(root: Path, path: Path) -> Iterator[tuple[int, str]]:
    """Yields line and name of each include of a file."""
    for number, line in enumerate((root / path).read_text(encoding="utf-8").splitlines(), 1):
        if match := INCLUDE.match(line):
            yield number, match[1] or match[2]


def c_faults(root: Path) -> list[Fault]:
    """Returns each include that a room may not use, each assembly file out of place, and each file without a rule."""
    faults = []
    for path in sources(root):
        room, name = room_of(path), path.as_posix()
        may = may_include(room)
        if may is None:
            faults.append(Fault(name, 1, f"no rule says what {room} may include"))
            continue
        if path.suffix not in (".c", ".h") and room in FIRMWARE and path.parent not in ASSEMBLY:
            faults.append(Fault(name, 1, f"is assembly; only {' and '.join(map(str, ASSEMBLY))} may hold it"))
        allowed = ", ".join(sorted({room, *may}))
        for line, include in includes(root, path):
            other = found(root, include)
            if other is None:
                if room in (*FIRMWARE, *HAL) and include not in STANDARD:
                    faults.append(
                        Fault(name, line, f"includes <{include}>; {room} may include {allowed} and standard types")
                    )
            elif ".." in other.parts or room_of(other) not in {room, *may}:
                faults.append(Fault(name, line, f"includes {include}; {room} may include {allowed}"))
    return faults


def c_cycles(root: Path) -> list[str]:
    """Returns at least one cycle of each group of headers that include one another."""
    graph = {path.as_posix(): set[str]() for path in sources(root)}
    for path in sources(root):
        for _, include in includes(root, path):
            if (other := found(root, include)) and other.as_posix() in graph:
                graph[path.as_posix()].add(other.as_posix())
    return cycles(graph)


def cycles(graph: Mapping[str, set[str]]) -> list[str]:
    """Returns at least one cycle of each part of `graph` that has cycles, as "a -> b -> a"."""
    done: set[str] = set()
    circles = []

    def visit(node: str, trail: list[str]) -> None:
        if node in trail:
            circle = trail[trail.index(node) :]
            first = circle.index(min(circle))
            circles.append(" -> ".join([*circle[first:], *circle[:first], min(circle)]))
        elif node not in done:
            for other in sorted(graph.get(node, ())):
                visit(other, [*trail, node])
            done.add(node)

    for node in sorted(graph):
        visit(node, [])
    return sorted(set(circles))
