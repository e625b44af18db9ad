"""Stages the documents as they stand in the checkout: READMEs, notebooks, and the files that they link to or show."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

OWN = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")
PAGES = "tools/docs"
CONTENTS = "contents.md"
FOLDERS = ("firmware", "hal", "sim_host", "tests", "tools")
NOT_OURS = {"uplot", "build"}
TOP = "README.md"
"""It becomes the front page, index.md, with the contents below it."""

REFERENCE = "tools/docs/reference.py"
"""A link to it leads to the pages that it makes."""

_LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")


def stage(root: Path, pages: Path) -> None:
    """Copies the documents of the checkout at `root` to the same places below `pages`."""
    for path in documents(root):
        text = path.read_text(encoding="utf-8")
        for target in _files(text):
            _copy(root, pages, (path.parent / target).resolve())
        _write(pages / path.relative_to(root), _to_pages(root, path, text))
    front = (pages / TOP).read_text(encoding="utf-8")
    _write(pages / "index.md", f"{front}\n{_contents(root)}")
    (pages / TOP).unlink()


def documents(root: Path) -> Iterator[Path]:
    """Yields the documents: those at the top, the pages of `tools/docs`, and every README and notebook."""
    yield from (root / name for name in OWN)
    yield from (path for path in sorted((root / PAGES).rglob("*.md")) if path.name != CONTENTS)
    for folder in FOLDERS:
        for path in sorted([*(root / folder).rglob("README.md"), *(root / folder).rglob("*.ipynb")]):
            parts = path.relative_to(root).parts
            if not NOT_OURS & set(parts) and not any(part.startswith(".") for part in parts):
                yield path


def _contents(root: Path) -> str:
    """Returns the contents of the site: contents.md, and below it the documents that it does not list."""
    listed = Path(__file__).with_name(CONTENTS).read_text(encoding="utf-8")
    names = [path.relative_to(root).with_suffix("").as_posix() for path in documents(root)]
    others = [
        name for name in names if f"{name}{TOP[-3:]}" != TOP and not re.search(rf"(^|<){name}(>|$)", listed, re.M)
    ]
    return listed + ("\n```{toctree}\n:hidden:\n:caption: More\n\n" + "\n".join(others) + "\n```\n" if others else "")


def _files(text: str) -> Iterator[str]:
    """Yields the relative targets of a document's links that are files but no documents."""
    for target, _ in _LINK.findall(text):
        if "://" not in target and not target.startswith("mailto:") and not target.endswith((".md", ".ipynb", "/")):
            yield target


def _copy(root: Path, pages: Path, file: Path) -> None:
    """Copies a linked file; a link that leads nowhere is left for Sphinx to report."""
    if file.is_file() and file.is_relative_to(root):
        place = pages / file.relative_to(root)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place)


def _to_pages(root: Path, path: Path, text: str) -> str:
    """Returns the text with its links to the top README and to the reference leading to their pages."""
    up = "../" * (len(path.relative_to(root).parts) - 1)
    text = text.replace(f"]({up}{TOP}", f"]({up}index.md")
    to_reference = os.path.relpath(root / REFERENCE, path.parent)
    return text.replace(f"]({to_reference})", f"]({up}reference/index.md)")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
