"""Runs the notebooks of tools/examples and keeps their outputs: `.venv/bin/python tools/docs/notebooks.py [FILE...]`.

A test runs them again and compares what they say, so a stale notebook fails.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
LONGEST_S = 300

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w])")


def run(path: Path) -> Any:
    """Returns the notebook with the outputs of a fresh run in its own folder.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell fails, as where an assertion does not hold.
    """
    book = nbformat.read(path, as_version=4)
    NotebookClient(
        book, timeout=LONGEST_S, kernel_name="python3", resources={"metadata": {"path": path.parent}}
    ).execute()
    for number, cell in enumerate(code_cells(book), 1):
        cell.metadata = {}
        cell.execution_count = number
        cell.outputs = [_stable(output) for output in cell.outputs]
    return book


def code_cells(book: Any) -> list[Any]:
    return [cell for cell in book.cells if cell.cell_type == "code"]


def said(cell: Any) -> str:
    """Returns what a cell printed and what its last line gave, as text."""
    return " ".join(_text(output) for output in cell.outputs)


def _text(output: Any) -> str:
    data = output.get("data", {})
    if "image/png" in data:
        return ""
    return str(output.get("text") or re.sub(r"<[^>]*>", " ", data.get("text/html", "")) or data.get("text/plain", ""))


def pictures(cell: Any) -> int:
    """Returns how many figures a cell has drawn."""
    return sum("image/png" in output.get("data", {}) for output in cell.outputs)


def differences(kept: Any, fresh: Any, *, relative: float, absolute: float) -> list[str]:
    """Returns a line for each code cell whose text or figures differ. Numbers may differ by the tolerances."""
    found = []
    for number, (old, new) in enumerate(zip(code_cells(kept), code_cells(fresh), strict=True), 1):
        if pictures(old) != pictures(new):
            found.append(f"cell {number}: {pictures(old)} figures are kept, and it draws {pictures(new)}")
        if not _alike(said(old), said(new), relative, absolute):
            found.append(f"cell {number}: it says {said(new)!r}, and {said(old)!r} is kept")
    return found


def _alike(one: str, other: str, relative: float, absolute: float) -> bool:
    """Whether two texts have the same words, in any spacing, and numbers within the tolerances."""
    if [_NUMBER.sub("#", one).split(), len(_NUMBER.findall(one))] != [
        _NUMBER.sub("#", other).split(),
        len(_NUMBER.findall(other)),
    ]:
        return False
    pairs = zip(map(float, _NUMBER.findall(one)), map(float, _NUMBER.findall(other)), strict=True)
    return all(abs(a - b) <= absolute + relative * max(abs(a), abs(b)) for a, b in pairs)


def _stable(output: Any) -> Any:
    """Returns an output without what differs from run to run, and without plain text where there is a table."""
    if "data" in output:
        output["metadata"] = {}
        if "text/html" in output["data"]:
            output["data"].pop("text/plain", None)
    if output.output_type == "execute_result":
        output["execution_count"] = None
    return output


def main(names: list[str]) -> None:
    for path in [Path(name) for name in names] or sorted(EXAMPLES.glob("*.ipynb")):
        nbformat.write(run(path), path)
        print(path)


if __name__ == "__main__":
    main(sys.argv[1:])
