"""No room of the Python package imports a forbidden room. A planted import is named: file, line, what is allowed."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest
from python_layers import BASE, MAY, modules, python_cycles, python_faults, room_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "tools/brickpilot"

# Room -> rooms that it must not import, written from the architecture's text, so that the gate's table is tested too.
MUST_NOT = {
    "data": {"importers", "vehicle", "fit", "discover"},
    "importers": {"vehicle", "fit", "hil"},
    "vehicle": {"fit", "discover", "report", "link"},
    "fit": {"discover", "bench", "report"},
    "discover": {"bench", "report", "hil", "changed", "ask"},
    "changed": {"report", "importers", "public"},
    "ask": {"report", "importers", "hil", "public"},
    "readiness": {"report", "importers", "public"},
    "report": {"bench", "importers"},
    "link": {"fit", "hil", "data"},
    "hil": {"fit", "discover", "flash"},
    "flash": {"fit", "hil"},
    "firmware": {"fit", "report", "flash"},
    "campaign": {"bench", "importers", "flash"},
    "export": {"fit", "discover", "report", "flash"},
    "tune": {"discover", "bench", "flash"},
    "bench": {"report", "flash", "importers"},
    "gen": {"importers", "link", "hil"},
    "public": {"flash"},
    "cli": set[str](),
}
AT_RUN_TIME = {"cli", "bench", "gen"}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Returns a package with one module in each room, in which no module imports another one."""
    root = tmp_path / "brickpilot"
    for room in MAY:
        (root / room).mkdir(parents=True)
        (root / room / "__init__.py").write_text("")
        (root / room / "part.py").write_text('"""A part."""\n')
    for name in BASE:
        (root / f"{name}.py").write_text("")
    return root


def test_every_import_keeps_to_the_layers() -> None:
    assert len(modules(PACKAGE)) > 100
    assert [str(fault) for fault in python_faults(PACKAGE)] == []


def test_no_modules_import_one_another_in_a_circle() -> None:
    assert python_cycles(PACKAGE) == []


def test_every_room_has_a_rule_and_every_rule_a_room() -> None:
    assert {room_of(name) for name in modules(PACKAGE)} - BASE == set(MAY) == set(MUST_NOT)


def named_twice(files: Iterable[Path]) -> list[str]:
    """Returns the file names that occur in more than one folder, except __init__.py."""
    counts = Counter(one.name for one in files if one.name != "__init__.py")
    return sorted(name for name, count in counts.items() if count > 1)


def test_no_two_modules_have_one_name(tmp_path: Path) -> None:
    assert named_twice(PACKAGE.rglob("*.py")) == []
    assert named_twice([tmp_path / "fit/check.py", tmp_path / "cli/check.py", tmp_path / "fit/one.py"]) == ["check.py"]


def test_only_the_command_line_and_the_generator_stand_on_top() -> None:
    for room, may in MAY.items():
        assert not may & (AT_RUN_TIME - ({"bench"} if room == "cli" else set())), room


@pytest.mark.parametrize("room", MAY)
def test_a_forbidden_import_is_named(package: Path, room: str) -> None:
    part = package / room / "part.py"
    for other in sorted(MUST_NOT[room] | AT_RUN_TIME - {room, "bench" if room == "cli" else room}):
        part.write_text(f'"""A part."""\n\nfrom brickpilot.{other} import part\n')
        (fault,) = python_faults(package)
        assert str(fault).startswith(f"{room}/part.py:3: imports brickpilot.{other}.part; {room} may import ")
        assert other not in str(fault).split("may import ")[1].split(", ")


@pytest.mark.parametrize("room", MAY)
def test_what_is_allowed_is_not_named(package: Path, room: str) -> None:
    lines = [f"from brickpilot.{other} import part as part_{other}" for other in sorted(MAY[room] | {room})]
    (package / room / "other.py").write_text("\n".join(["from brickpilot.errors import InputError", *lines]))
    assert python_faults(package) == []


@pytest.mark.parametrize(
    "text",
    [
        "import brickpilot.cli.part",
        "from brickpilot import cli",
        "from brickpilot.cli import part",
        "from brickpilot.cli.part import something",
        "from ..cli import part",
        "from .. import cli",
        "def run():\n    from brickpilot.cli import part",
        "if TYPE_CHECKING:\n    from brickpilot.cli import part",
        'importlib.import_module("brickpilot.cli.part")',
    ],
)
def test_no_way_to_write_an_import_gets_past(package: Path, text: str) -> None:
    (package / "fit/part.py").write_text(text)
    (fault,) = python_faults(package)
    assert fault.what.startswith("imports brickpilot.cli")


def test_a_module_beside_the_rooms_may_import_none(package: Path) -> None:
    (package / "catalogue.py").write_text(
        "from brickpilot.compiled import interface\nfrom brickpilot.fit import part\n"
    )
    assert [str(fault) for fault in python_faults(package)] == [
        "catalogue.py:2: imports brickpilot.fit.part; catalogue may import no room"
    ]


def test_one_importer_alone_may_use_the_link(package: Path) -> None:
    for name in ("rcx", "table"):
        (package / f"importers/{name}.py").write_text("from brickpilot.link import part\n")
    (fault,) = python_faults(package)
    assert str(fault) == "importers/table.py:1: imports brickpilot.link.part; importers may import data, importers"


def test_a_room_without_a_rule_is_named(package: Path) -> None:
    (package / "utils").mkdir()
    (package / "utils/__init__.py").write_text("")
    (package / "more.py").write_text("")
    assert [str(fault) for fault in python_faults(package)] == [
        "more.py:1: no rule says what more may import",
        "utils/__init__.py:1: no rule says what utils may import",
    ]


def test_a_circle_of_modules_is_named(package: Path) -> None:
    (package / "fit/part.py").write_text("from brickpilot.fit import other\n")
    (package / "fit/other.py").write_text("def late():\n    from brickpilot.fit.part import one\n")
    assert python_cycles(package) == ["brickpilot.fit.other -> brickpilot.fit.part -> brickpilot.fit.other"]
    (package / "fit/other.py").write_text("if TYPE_CHECKING:\n    from brickpilot.fit.part import one\n")
    assert python_cycles(package) == []


def test_python_reads_no_c_header_but_the_plants_interface() -> None:
    writers = {"gen", "firmware", "export"}  # these rooms write C code, of the firmware and of an FMU
    others = [path for path in PACKAGE.rglob("*.py") if not writers & set(path.relative_to(PACKAGE).parts)]
    named = {header for path in others for header in re.findall(r"\w+\.h\b", path.read_text())}
    assert named <= {
        "brickpilot_sim.h",
        "brickpilot_avr.h",
        "brickpilot_brick.h",
        "robot_constants.h",
        "motor_constants.h",
        "next_experiment.h",
    }  # the package writes the last three


def test_only_the_command_line_prints() -> None:
    printers = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "click.echo", "click.secho"):
                printers.add(path.relative_to(PACKAGE).as_posix())
    assert {one for one in printers if not one.startswith("cli/")} <= {"gen/__main__.py"}
