"""The notebooks run, and give the outputs that are stored in them: a stale notebook fails."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import nbformat
import notebooks
import pytest

FILES = sorted(notebooks.EXAMPLES.glob("*.ipynb"))
RELATIVE, ABSOLUTE = 0.02, 1e-9
REMEDY = "run .venv/bin/python tools/docs/notebooks.py and look at what has changed"
KEPT_KB = 200


def read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)


def differences(kept: Any, fresh: Any) -> list[str]:
    return notebooks.differences(kept, fresh, relative=RELATIVE, absolute=ABSOLUTE)


def test_there_are_four_of_them() -> None:
    assert [path.stem for path in FILES] == ["hidden_effect", "hil_can", "model_to_brick", "paper"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_what_it_is_kept_with(path: Path) -> None:
    assert differences(read(path), notebooks.run(path)) == [], f"{path.name} is stale: {REMEDY}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_notebook_is_small_and_names_no_machine(path: Path) -> None:
    assert path.stat().st_size < 1024 * KEPT_KB
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"(?<![\w./])/(tmp|home|root|work|Users)/", text)
    assert "Traceback" not in text
    assert "application/vnd.jupyter.widget" not in text


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_notebook_ends_with_two_or_three_exercises(path: Path) -> None:
    last = read(path).cells[-1].source
    assert last.startswith("## Exercises\n\n1. ")
    assert len(re.findall(r"^\d\. ", last, re.MULTILINE)) in (2, 3)


def stale(change: str) -> Any:
    """Returns the paper's notebook with one stored output changed, as if the notebook had not been run again."""
    book = copy.deepcopy(read(notebooks.EXAMPLES / "paper.ipynb"))
    for cell in notebooks.code_cells(book):
        if change == "figure" and notebooks.pictures(cell):
            cell.outputs = [one for one in cell.outputs if "image/png" not in one.get("data", {})]
            return book
        if change != "figure" and "949 degrees/s" in notebooks.said(cell):
            cell.outputs[0]["text"] = cell.outputs[0]["text"].replace(*change.split(">"))
            return book
    raise AssertionError(change)


@pytest.mark.parametrize("change", ["949>970", "949>-949", "coupled>corrected", "degrees>degrees 1", "figure"])
def test_a_number_a_word_or_a_figure_that_differs_is_told(change: str) -> None:
    (told,) = differences(read(notebooks.EXAMPLES / "paper.ipynb"), stale(change))
    assert told.startswith("cell ")


def test_another_rounding_is_no_difference() -> None:
    assert differences(read(notebooks.EXAMPLES / "paper.ipynb"), stale("949>949.4")) == []
