"""Finds files of the installed package that are older than the checkout, so that no test runs outdated code.

As a program, this file ends with status 1 if the installed package is older.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REMEDY = "the installed package is older than the checkout: run .venv/bin/pip install --no-deps ./tools"

COPIED = {
    "sim_host/include/brickpilot_sim.h": "brickpilot_sim.h",
    "hal/wire/brickpilot.dbc": "brickpilot.dbc",
    "hal/wire/settings.toml": "settings.toml",
    "sim_host/models/rcx.toml": "models/rcx.toml",
}
"""File of the checkout that is copied into the package -> its path in the package."""

COMPILED = ("sim_host", "firmware", "hal/wire", "hal/sil", "hal/link")
"""Folders whose C is compiled into the package."""


def outdated(root: Path, package: Path) -> Iterator[str]:
    """Yields one line for each file of the checkout at `root` that is not in the installed `package`.

    Python files, tables and headers are compared by content. A C file counts as missing if it is newer than the
    compiled library.
    """
    source = root / "tools/brickpilot"
    if package.resolve() != source.resolve():
        for path in sorted(source.rglob("*.py")):
            place = package / path.relative_to(source)
            if not place.is_file() or place.read_bytes() != path.read_bytes():
                yield f"{path.relative_to(root)}: {REMEDY}"
    for name, place in COPIED.items():
        if (package / place).read_bytes() != (root / name).read_bytes():
            yield f"{name}: {REMEDY}"
    library = package / "libbrickpilot_sim.so"
    built = library.stat().st_mtime
    for folder in COMPILED:
        for path in sorted((root / folder).rglob("*.[ch]")):
            if "targets" not in path.parts and path.stat().st_mtime > built:
                yield f"{path.relative_to(root)}: {REMEDY}"


if __name__ == "__main__":
    import sys

    import brickpilot

    sys.exit(next(outdated(ROOT, Path(brickpilot.__file__).parent), None) is not None)
