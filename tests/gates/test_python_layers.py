"""The layers of the Python package hold."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "tools/brickpilot"


def test_python_reads_no_c_header_but_the_plants_interface() -> None:
    named = {h for p in PACKAGE.rglob("*.py") for h in re.findall(r"\w+\.h\b", p.read_text()) if "gen" not in p.parts}
    assert named <= {"brickpilot_sim.h", "brickpilot_brick.h"}


def test_only_the_command_line_prints() -> None:
    printers = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "click.echo", "click.secho"):
                printers.add(path.relative_to(PACKAGE).as_posix())
    assert {one for one in printers if not one.startswith("cli")} <= {"terminal.py", "gen/__main__.py"}
