"""An importer is one file and one row: the table makes the command line, and a file without a row is named."""

from __future__ import annotations

import inspect
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import brickpilot
import pytest
from brickpilot.cli.import_log import import_command
from brickpilot.importers import IMPORTERS, Importer, Option
from click.testing import CliRunner
from importer_rows import files_without_a_row

PACKAGE = Path(brickpilot.__file__).parent
ROOM = Path(__file__).parents[2] / "tools/brickpilot/importers"

# The file and the row of a new importer, as CONTRIBUTING.md asks for them.
FILE = '''
"""Lines of "time volts speed" turned into a data set."""

from pathlib import Path

import numpy as np

from brickpilot.importers.writer import NewDataset, NewRun


def import_lines(files, *, vehicle):
    rows = np.loadtxt(files[0])
    columns = dict(zip(("time", "voltage", "speed"), rows.T, strict=True))
    units = {"time": "s", "voltage": "V", "speed": "rad/s"}
    return NewDataset(vehicle, "FRD", units, [NewRun("only", columns)])
'''
ROW = """
    Importer(
        kind="lines",
        help="Lines of three numbers.",
        example="lines log.txt --vehicle motor --out bench",
        options=(VEHICLE,),
    ),
"""


COMMANDS = """
import contextlib, io, json, sys
sys.path.insert(0, ".")
from brickpilot.cli.main import main
for arguments in json.loads(sys.argv[1]):
    status, said, error = 0, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(error):
        try:
            main(["import", *arguments])
        except SystemExit as ended:
            status = ended.code or 0
    print(json.dumps([status, said.getvalue(), error.getvalue()]))
"""


class Ended(NamedTuple):
    """Exit status, standard output and standard error of a command."""

    status: int
    said: str
    error: str


def commands_of(folder: Path, *commands: list[str]) -> list[Ended]:
    """Runs commands of `import` with the package in a folder, in one process, because a process takes long to start."""
    called = [sys.executable, "-c", COMMANDS, json.dumps(commands)]
    done = subprocess.run(called, cwd=folder, capture_output=True, text=True, timeout=120, check=True)
    return [Ended(*json.loads(line)) for line in done.stdout.splitlines()]


def test_each_row_names_a_function_that_takes_its_options() -> None:
    for row in IMPORTERS:
        parameters = inspect.signature(row.maker()).parameters
        wanted = {option.keyword for option in row.options}
        assert wanted | ({"progress"} if row.reports_progress else set()) <= parameters.keys(), row.kind
        needed = {one.name for one in list(parameters.values())[1:] if one.default is one.empty}
        assert needed <= wanted, row.kind
        assert row.example.startswith(f"{row.kind} "), row.kind


def test_kinds_and_files_are_in_the_table_once() -> None:
    modules = {row.module or row.kind for row in IMPORTERS}
    assert len({row.kind for row in IMPORTERS}) == len(modules) == len(IMPORTERS)


def test_every_file_of_the_room_has_a_row_or_serves_one() -> None:
    assert files_without_a_row(ROOM) == []


def test_a_file_without_a_row_is_named_in_one_line(tmp_path: Path) -> None:
    room = shutil.copytree(ROOM, tmp_path / "importers")
    (room / "lines.py").write_text(FILE, encoding="utf-8")
    (fault,) = files_without_a_row(room)
    assert fault == "importers/lines.py has no row in IMPORTERS of importers/__init__.py"


def test_one_file_and_one_row_make_an_importer(tmp_path: Path) -> None:
    package = shutil.copytree(PACKAGE, tmp_path / "brickpilot")  # its compiled modules, too, which saves time
    (package / "importers/lines.py").write_text(FILE, encoding="utf-8")
    table = package / "importers/__init__.py"
    text = table.read_text(encoding="utf-8")
    assert text.count("IMPORTERS = (\n") == 1
    table.write_text(text.replace("IMPORTERS = (\n", f"IMPORTERS = ({ROW}"), encoding="utf-8")
    assert files_without_a_row(package / "importers") == []

    (tmp_path / "log.txt").write_text("0 6 0\n0.1 6 1\n0.2 6 2\n", encoding="utf-8")
    shown, refused, misused, done = commands_of(
        tmp_path,
        ["--help"],
        ["lines", "log.txt", "--out", "bench"],
        ["lines", "log.txt", "--vehicle", "motor", "--map", "time=0", "--out", "bench"],
        ["lines", "log.txt", "--vehicle", "motor", "--out", "bench", "--json"],
    )
    assert "lines: Lines of three numbers." in shown.said
    assert refused == (2, "", "brickpilot: --vehicle: is needed to import lines\n")
    assert (misused.status, misused.error.count("\n")) == (2, 1)
    assert misused.error.startswith("brickpilot: --map: works only with matlab, table, ")
    assert (done.status, done.error) == (0, "")
    assert json.loads(done.said) == {"dataset": "bench", "runs": ["only"], "notes": [], "wiring": [], "mend": ""}


def test_an_option_of_a_row_of_its_own_reaches_the_function(monkeypatch: pytest.MonkeyPatch) -> None:
    rate = Option("beat", "--beat", "Beats per second.", metavar="HZ", required=True)
    row = Importer("beats", "Beats.", "beats log --beat 5 --out bench", (rate,))
    given: dict[str, object] = {}

    class Made:
        folder, runs, notes, wiring, mend = Path("bench"), ("a", "b"), ("slow",), (), ""

    monkeypatch.setattr(Importer, "import_files", lambda self, files, out, **rest: given.update(rest) or Made)
    command = import_command((*IMPORTERS, row))
    done = CliRunner().invoke(command, ["beats", "log", "--beat", "5", "--nominal", "mass=2", "--out", "bench"])
    assert done.output == "note: slow\nbench: 2 runs\n"
    assert given == {"nominal": {"mass": 2.0}, "name": None, "beat": "5"}
