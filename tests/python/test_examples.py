"""The example logs are those that their program writes, and `why` finds the effect that each log hides."""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path
from types import ModuleType

import pytest
from brickpilot.cli.export import export
from brickpilot.cli.main import COMMANDS as COMMAND_LINE
from command import brickpilot

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "tools" / "examples"
COMMANDS = re.findall(r"^\.venv/bin/brickpilot (why .*)$", (ROOT / "README.md").read_text(), re.MULTILINE)


def maker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_logs", EXAMPLES / "make_logs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_logs_are_what_their_program_writes() -> None:
    made = maker()
    for seed, (name, effects) in enumerate(made.HIDDEN.items()):
        assert made.log(effects, seed) == (EXAMPLES / f"{name}.csv").read_text()


@pytest.mark.parametrize("command", COMMANDS)
def test_the_readme_s_question_is_answered(command: str, tmp_path: Path) -> None:
    name = Path(shlex.split(command)[1]).stem
    (hidden,) = maker().HIDDEN[name]
    said = brickpilot(*shlex.split(command), "--verbose", "--out", str(tmp_path / "found"), cwd=ROOT)
    assert said.returncode == 0, said.stderr
    (what,) = [line for line in said.stdout.splitlines() if line.startswith("what is wrong: ")]
    assert f"({hidden})" in what
    assert {"veers": "does not drive straight", "stops_short": "stops short"}[name] in said.stdout


def test_the_readme_asks_about_each_example() -> None:
    assert len(COMMANDS) == len(maker().HIDDEN) == len(list(EXAMPLES.glob("*.csv")))


def test_every_command_has_a_line_of_shell_in_a_manual() -> None:
    places = ("README.md", "tools/README.md", "hal/README.md", "tools/docs/guides/*.md")
    manuals = "\n".join(path.read_text() for place in places for path in ROOT.glob(place))
    shown = re.findall(r"brickpilot ([a-z][a-z ]*[a-z])", manuals)
    names = [one.name or "" for one in COMMAND_LINE if one is not export]
    names += [f"export {kind}" for kind in export.commands]
    missing = [name for name in names if not any(f"{one} ".startswith(f"{name} ") for one in shown)]
    assert not missing
