"""Stages the public C headers as pages. A header is the manual, so its comments become the text, and its code stays."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HEADERS = {
    "sim_host/include/brickpilot_sim.h": "The plant",
    "hal/include/hal.h": "The HAL",
    "sim_host/include/brickpilot_brick.h": "A brick in this process",
    "sim_host/include/brickpilot_avr.h": "A brick with an AVR",
}

_COMMENT = re.compile(r"\A\s*/\*(.*?)\*/[ \t]*(?:\n|\Z)", re.DOTALL)
_CODE_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_NAMES = (
    re.compile(r"\}\s*(\w+);"),  # typedef struct { ... } NAME;
    re.compile(r"^typedef [\w ]+?(\w+);", re.MULTILINE),
    re.compile(r"^[\w ]+[ *](\w+)\(", re.MULTILINE),  # a function
)


@dataclass(frozen=True)
class Chunk:
    """A part of a header: its comment as text, its code, and the names that it declares."""

    text: str
    code: str

    @property
    def names(self) -> list[str]:
        bare = _CODE_COMMENT.sub("", self.code)
        found = [name for pattern in _NAMES for name in pattern.findall(bare)]
        return list(dict.fromkeys(found)) or re.findall(r"\benum \{\s*(\w+)", bare)


def stage(root: Path, pages: Path) -> None:
    """Writes a page for each header, and their index."""
    folder = pages / "reference/c"
    folder.mkdir(parents=True)
    for name, title in HEADERS.items():
        source = (root / name).read_text(encoding="utf-8")
        (folder / f"{Path(name).stem}.md").write_text(page(name, title, source), encoding="utf-8")
    entries = "\n".join(Path(name).stem for name in HEADERS)
    intro = "# C\n\nThe public headers. A header is the manual: its comments are the text of these pages.\n"
    (folder / "index.md").write_text(f"{intro}\n```{{toctree}}\n\n{entries}\n```\n", encoding="utf-8")


def page(name: str, title: str, source: str) -> str:
    """Returns the page of a header."""
    parts = [f"# {title}: `{Path(name).name}`", f"`{name}`"]
    for chunk in chunks(source):
        if chunk.names:
            parts.append("## " + ", ".join(f"`{one}`" for one in chunk.names))
        if chunk.text:
            parts.append(chunk.text)
        if chunk.code:
            parts.append(f"```c\n{chunk.code}\n```")
    return "\n\n".join(parts) + "\n"


def chunks(source: str) -> Iterator[Chunk]:
    """Yields the parts of a header: what stands between blank lines at the outer level."""
    block: list[str] = []
    depth = 0
    for line in [*source.splitlines(), ""]:
        if line.strip() or depth:
            block.append(line)
            depth += line.count("{") + line.count("/*") - line.count("}") - line.count("*/")
        elif block:
            if (chunk := _chunk("\n".join(block))) is not None:
                yield chunk
            block = []


def _chunk(block: str) -> Chunk | None:
    code = "\n".join(line for line in block.splitlines() if not re.match(r"#(ifndef|define \w+_H$|endif)", line))
    comment = _COMMENT.match(code)
    text = _prose(comment.group(1)) if comment else ""
    code = code[comment.end() :] if comment else code
    return Chunk(text, code.strip("\n")) if text or code.strip() else None


def _prose(comment: str) -> str:
    """Returns a comment as Markdown: names of code are marked, and nothing else is markup."""
    lines = [re.sub(r"^\s*\*? ?", "", line).rstrip() for line in comment.strip().splitlines()]
    text = re.sub(r"([\\`*<>|\[\]])", r"\\\1", "\n".join(lines))
    return re.sub(r"(?<![\w`])(\w*_\w+(?:\(\))?|\w+\(\))", r"`\1`", text)
