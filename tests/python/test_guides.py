"""The tutorial and the guides work as typed: each command and each program of a page, in order, in one folder."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import brickpilot as bp
import pytest
from command import brickpilot

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["tools/README.md", *(f"tools/docs/guides/my_{one}.md" for one in ("log", "robot", "simulator"))]
PAGES.append("tools/docs/guides/campaign.md")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INSTALLING = ("sh tools/fly", ". .venv/bin/activate", "pip install ", "python -m build ")
"""Commands that a checkout needs once: the tests skip them. Blocks that need a device or a network are `console`."""


def type_page(text: str, folder: Path, kept: Path) -> list[str]:
    """Types a page's blocks: commands of `sh`, programs of `python`, files of `toml`. Returns the commands that ran.

    Two pages run `why` on the same log: the folder `kept` keeps the files that the first search writes.
    """
    typed = []
    for kind, body in BLOCK.findall(text):
        if kind == "toml":
            (folder / body.split("\n")[0].removeprefix("# ")).write_text(body)
        elif kind == "python":
            subprocess.run([sys.executable, "-c", body], cwd=folder, check=True, timeout=120, capture_output=True)
        for line in body.splitlines() if kind == "sh" else ():
            if line.startswith(INSTALLING):
                continue
            words = shlex.split(line, comments=True)
            assert words[0] == "brickpilot", f"nobody has tried: {line}"
            *rest, option, out = words
            found = kept / re.sub(r"\W+", "_", " ".join(rest))
            is_search = (words[1], option) == ("why", "--out")
            if is_search and found.is_dir():
                shutil.copytree(found, folder / out)
                typed.append(line)
                continue
            done = brickpilot(*words[1:], cwd=folder)
            assert done.returncode == ("exit status 1" in line), f"{line}\n{done.stdout}{done.stderr}"
            if is_search:
                shutil.copytree(folder / out, found)
            typed.append(line)
    return typed


def told(folder: Path) -> None:
    """Checks what the tutorial says about the results of its commands."""
    verdict = json.loads((folder / "runs/why/verdict.json").read_text())
    (effect,) = verdict["effects"]
    assert effect["name"] == "coulomb_friction"
    assert effect["parameters"]["torque"]["identified"]["value"] == pytest.approx(1.35, abs=0.01)
    compared = (json.loads((folder / f"runs/{name}/compare.json").read_text()) for name in ("before", "after"))
    fits = [one["headline"]["held_out"]["free_run"]["fit_percent"] for one in compared]
    assert fits == pytest.approx([92.4, 99.9], abs=0.1)
    flights = [json.loads((folder / f"runs/{name}/summary.json").read_text()) for name in ("told_nothing", "told")]
    assert [one["waypoints_reached"] for one in flights] == [8, 8]
    wrong_by = [1000 * one["position_estimate_error_m"] for one in flights]
    assert wrong_by == pytest.approx([14, 8], abs=1)


def asked(folder: Path) -> None:
    """Checks what `brickpilot ask` has found and the files that it has written."""
    told = json.loads((folder / "runs/ask/ask.json").read_text())
    assert told["stopped"] == "decided"
    assert len(told["manoeuvres"]) >= 2
    assert all(0.94 < sum(one["weights"].values()) <= 1.001 for one in told["manoeuvres"])
    parameters = {one["name"]: one["parameters"] for one in told["effects"]}
    assert {*parameters} - {"gyro_bias", "accel_bias"} == {"motor_asymmetry"}
    difference = parameters["motor_asymmetry"]["difference"]["value"]
    assert difference == pytest.approx(0.1, abs=0.01)
    written = bp.load_model(folder / "runs/ask/model.toml")
    assert written.effects["motor_asymmetry"]["difference"] == pytest.approx(difference)
    page = (folder / "runs/ask/ask.html").read_text()
    assert all(one["name"] in page for one in (*told["manoeuvres"], *told["effects"]))
    assert len([*(folder / "runs/ask/flights").glob("*/log.csv")]) == len(told["manoeuvres"])


SAYS: dict[str, Callable[[Path], None]] = {"tools/README.md": told, "tools/docs/guides/my_robot.md": asked}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kept")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_works_as_typed(page: str, tmp_path: Path, kept: Path) -> None:
    (tmp_path / "tools").symlink_to(ROOT / "tools")
    typed = type_page((ROOT / page).read_text(encoding="utf-8"), tmp_path, kept)
    assert len(typed) >= 3
    if page in SAYS:
        SAYS[page](tmp_path)


@pytest.mark.parametrize(
    "block",
    [
        "```sh\nbrickpilot effects nothing_of_that_name\n```",
        "```sh\nmake all\n```",
        "```python\nimport brickpilot as bp\nbp.read('nowhere')\n```",
    ],
)
def test_a_command_that_does_not_work_would_be_found(block: str, tmp_path: Path) -> None:
    with pytest.raises((AssertionError, subprocess.CalledProcessError)):
        type_page(block, tmp_path, tmp_path)


def test_the_tutorial_is_one_screen_and_the_page_short() -> None:
    lines = (ROOT / "tools/README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    start = next(number for number, line in enumerate(lines) if line.startswith("## Tutorial"))
    end = next(number for number, line in enumerate(lines) if line.startswith("## ") and number > start)
    assert end - start <= 40
