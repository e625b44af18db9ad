"""Checks which rooms (subpackages) of the Python package each room imports; returns a fault for each broken rule."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from layers import Fault, cycles

PACKAGE = "brickpilot"

# Modules beside the rooms, which any room may import. catalogue reads the C table of effects through compiled;
# constants reads rcx.toml; text_template renders the templates of any room.
BASE = {"__init__", "errors", "compiled", "catalogue", "constants", "side_by_side", "text_template"}

# Room -> other rooms that it may import. A room may always import itself. Only `cli` prints, and nothing imports it.
MAY: dict[str, set[str]] = {
    "data": set(),
    "importers": {"data"},
    "vehicle": {"data"},
    "fit": {"data", "vehicle"},
    "discover": {"data", "vehicle", "fit"},
    "changed": {"data", "vehicle", "fit", "discover"},
    "ask": {"data", "vehicle", "fit", "discover"},
    "readiness": {"data", "vehicle", "fit", "discover"},
    "report": {"data", "vehicle", "fit", "discover", "changed", "ask", "readiness"},
    "link": {"vehicle"},
    "hil": {"data", "vehicle", "link"},
    "flash": {"vehicle", "link"},
    "firmware": {"data", "vehicle", "link", "hil"},
    "campaign": {"data", "vehicle", "fit", "report", "hil"},
    "bench": {"vehicle", "hil"},
    "export": {"data", "vehicle", "link", "hil"},
    "tune": {"data", "vehicle", "fit", "report", "hil", "firmware", "campaign"},
    "public": {
        "data", "importers", "vehicle", "fit", "discover", "changed", "ask", "readiness", "report", "link", "hil",
        "firmware", "campaign", "export", "tune",
    },
    "cli": {
        "data", "importers", "vehicle", "fit", "discover", "changed", "ask", "readiness", "report", "link", "hil",
        "flash", "firmware", "campaign", "bench", "export", "tune", "public",
    },
    "gen": {"vehicle", "firmware"},
}  # fmt: skip

# The only files that may import more than the other files of their room: the first fetches a recording from the robot,
# the second loads a program into a simulated brick.
ALSO = {
    "importers/rcx.py": {"link"},
    "hil/rcx_flight.py": {"flash"},
}


def modules(package: Path) -> dict[str, Path]:
    """Returns the modules of a package by their dotted names."""
    found = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def nodes(tree: ast.AST, run: bool) -> Iterator[ast.AST]:
    """Yields the nodes of a module; with `run`, without the code that only the type checker reads."""
    for node in ast.iter_child_nodes(tree):
        if run and isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        yield node
        yield from nodes(node, run)


def imports(name: str, path: Path, known: dict[str, Path], *, run: bool = False) -> Iterator[tuple[int, str]]:
    """Yields line and name of each module of the package that a module imports, in any place and any form.

    Args:
        name: the module's name.
        path: its file.
        known: `modules` of the package.
        run: whether to leave out imports that only the type checker reads.
    """
    for node in nodes(ast.parse(path.read_text(encoding="utf-8")), run):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
                base = ".".join([*parts[: len(parts) - node.level + 1], *filter(None, [node.module])])
            names = [f"{base}.{alias.name}" if f"{base}.{alias.name}" in known else base for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            names = [one.value for one in node.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
        else:
            continue
        for found in names:
            while found and found not in known:  # a name inside a module
                found = found.rpartition(".")[0]
            if found and found != name:
                yield node.lineno, found


def room_of(name: str) -> str:
    """Returns the room of a module, or its own name if it is in no room."""
    return name.split(".")[1] if "." in name else "__init__"


def python_faults(package: Path) -> list[Fault]:
    """Returns each import that a room may not use, and each module without a rule."""
    known = modules(package)
    faults = []
    for name, path in known.items():
        room, file = room_of(name), path.relative_to(package).as_posix()
        if room in BASE:
            may = BASE
        elif room in MAY:
            may = {room} | BASE | MAY[room] | ALSO.get(file, set())
        else:
            faults.append(Fault(file, 1, f"no rule says what {room} may import"))
            continue
        allowed = ", ".join(sorted(may - BASE)) or "no room"
        # The package's __init__ loads names late. For the type checker it imports them from any room: this is allowed.
        for line, other in imports(name, path, known, run=name == PACKAGE):
            if room_of(other) not in may:
                faults.append(Fault(file, line, f"imports {other}; {room} may import {allowed}"))
    return faults


def python_cycles(package: Path) -> list[str]:
    """Returns each cycle of modules that import one another when they run."""
    known = modules(package)
    return cycles({name: {other for _, other in imports(name, path, known, run=True)} for name, path in known.items()})
