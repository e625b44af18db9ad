"""Finds names of effects in the files of `tools`, where only the C table should list effects."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

TABLE = Path("sim_host/effects/effects.c")
# These files may name effects. The README's picture shows one effect, the example logs contain effects, the example
# campaigns draw effects, and the exporter has a function for each effect that rigid-body simulators can represent.
MAY_NAME = frozenset(
    {
        Path("tools/brickpilot/export/machine.py"),
        Path("tools/docs/pictures.py"),
        Path("tools/examples/gain_sweep.toml"),
        Path("tools/examples/make_logs.py"),
        Path("tools/examples/tolerances.toml"),
    }
)
# Documents and notebooks report which effects were found in which data sets.
DOCUMENTS = frozenset({".ipynb", ".md", ".svg"})


def names(root: Path) -> list[str]:
    """Returns the names of the rows of the table."""
    return re.findall(r"^ +EFFECT\((\w+)\)", (root / TABLE).read_text(), re.MULTILINE)


def sources(root: Path) -> Iterator[Path]:
    """Yields the files of `tools` that must not name an effect."""
    for path in sorted((root / "tools").rglob("*")):
        hidden = any(part.startswith((".", "__pycache__", "build")) for part in path.relative_to(root).parts)
        if path.is_file() and not hidden and path.suffix not in DOCUMENTS and path.relative_to(root) not in MAY_NAME:
            yield path


def faults(root: Path) -> list[str]:
    """Returns one line for each place in `tools` that names an effect."""
    known = names(root)
    word = re.compile(rf"(?<![\w])({'|'.join(known)})(?![\w])") if known else re.compile(r"(?!)")
    found = []
    for path in sources(root):
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            found += [
                f"{path.relative_to(root)}:{number} names the effect {name}; "
                f"read what it is for from an attribute of its row in sim_host/effects/{name}.c"
                for name in dict.fromkeys(word.findall(line))
            ]
    return found
