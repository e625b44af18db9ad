"""Reads the recipes of CONTRIBUTING.md, and follows them on a copy of the checkout."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = shutil.ignore_patterns("build", ".venv", "runs", ".git", "__pycache__", ".*_cache", ".hypothesis", "corpus")


@dataclass(frozen=True)
class Recipe:
    """One recipe: the files of its table, with placeholders such as NAME, and the test files named as its proof."""

    files: tuple[str, ...]
    proofs: tuple[str, ...]


def recipes() -> dict[str, Recipe]:
    """Returns title -> recipe of CONTRIBUTING.md."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    found = {}
    for section in text[text.index("## Recipes") :].split("\n### ")[1:]:
        title, _, body = section.partition("\n")
        proof = body[body.index("Proof:") :]
        found[title] = Recipe(
            tuple(re.findall(r"^\| `([^`]+)` \|", body, re.MULTILINE)), tuple(re.findall(r"`([^`]+)`", proof))
        )
    return found


class Copy:
    """A copy of the checkout in which a recipe is followed. `touched`: the paths that the methods have changed."""

    def __init__(self, folder: Path) -> None:
        self.root = Path(shutil.copytree(ROOT, folder / "checkout", ignore=SKIPPED))
        self.touched: set[str] = set()

    def write(self, path: str, text: str) -> None:
        """Writes a new file."""
        assert not (self.root / path).exists(), path
        (self.root / path).write_text(text, encoding="utf-8")
        self.touched.add(path)

    def insert(self, path: str, before: str, text: str) -> None:
        """Puts `text` before the first occurrence of `before`."""
        old = (self.root / path).read_text(encoding="utf-8")
        assert before in old, f"{path} has no {before!r}"
        (self.root / path).write_text(old.replace(before, text + before, 1), encoding="utf-8")
        self.touched.add(path)

    def replace(self, path: str, of: str, to: str) -> None:
        """Replaces the only occurrence of `of`."""
        old = (self.root / path).read_text(encoding="utf-8")
        assert old.count(of) == 1, f"{path} has {of!r} {old.count(of)} times"
        (self.root / path).write_text(old.replace(of, to), encoding="utf-8")
        self.touched.add(path)
