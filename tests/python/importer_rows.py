"""Finds files of the importers' folder that the table of importers misses."""

from __future__ import annotations

import ast
import re
from pathlib import Path


def files_without_a_row(room: Path) -> list[str]:
    """Returns one line for each importer without a row, and for each other file with neither row nor user.

    An importer is a file with a public function `import_...`. A user of a file is a file of the room that imports it.
    """
    trees = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(room.glob("*.py"))}
    listed = set(re.findall(r"""(?:kind|module)="(\w+)",""", (room / "__init__.py").read_text(encoding="utf-8")))
    used = {
        node.module.rpartition(".")[2]
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
    }
    importers = {
        name
        for name, tree in trees.items()
        if any(isinstance(node, ast.FunctionDef) and node.name.startswith("import_") for node in tree.body)
    }
    return [
        f"{room.name}/{name}.py has no row in IMPORTERS of {room.name}/__init__.py"
        for name in trees
        if name != "__init__" and name not in listed and (name in importers or name not in used)
    ]
