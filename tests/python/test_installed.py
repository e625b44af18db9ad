"""A test run stops if the installed package is older than the checkout."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import brickpilot
import pytest
from installed import COMPILED, COPIED, REMEDY, ROOT, outdated

PACKAGE = Path(brickpilot.__file__).parent


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Returns a copy of the checkout from which the package was installed."""
    for folder in ("tools/brickpilot", *COMPILED):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_a_checkout_that_was_installed_is_not_outdated(tree: Path) -> None:
    assert [*outdated(tree, PACKAGE)] == []


@pytest.mark.parametrize("name", ["tools/brickpilot/errors.py", "tools/brickpilot/new.py", *COPIED])
def test_a_file_that_differs_is_named(tree: Path, name: str) -> None:
    when = PACKAGE.stat().st_mtime - 3600  # so that only the content shows the change, not the file's time
    with (tree / name).open("a") as file:
        file.write("\n")
    os.utime(tree / name, (when, when))
    assert [*outdated(tree, PACKAGE)] == [f"{name}: {REMEDY}"]


@pytest.mark.parametrize("name", ["sim_host/plant/plant.c", "firmware/core/fix.h"])
def test_c_that_is_newer_than_the_library_is_named(tree: Path, name: str) -> None:
    later = (PACKAGE / "libbrickpilot_sim.so").stat().st_mtime + 10
    os.utime(tree / name, (later, later))
    assert [*outdated(tree, PACKAGE)] == [f"{name}: {REMEDY}"]
