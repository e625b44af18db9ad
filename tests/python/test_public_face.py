"""The names that `import brickpilot` gives: their examples run, they have types, and the import loads no module."""

from __future__ import annotations

import ast
import doctest
import importlib
import json
import pydoc
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import brickpilot as bp
import nbformat
import numpy as np
import pandas as pd
import pytest
import synthetic
from brickpilot.report import discover_text
from command import brickpilot
from markupsafe import escape

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "tools/examples/hidden_effect.ipynb"
SCRIPT = "<script>alert(1)</script>"

USER_SCRIPT = """\
import brickpilot as bp

dataset = bp.read("bench")
fitted = bp.calibrate(dataset, seed=1)
comparison: bp.Comparison = bp.compare(dataset, fitted.model)
share: float | None = comparison.share("held_out", "speed")
finding = bp.discover(dataset, jobs=1)
worth: bp.Check = bp.check(dataset, seed=1, jobs=1)
names: list[str] = [effect.name for effect in finding.effects]
flown: bp.Flown = bp.fly("mission", sensors="imu", seed=2)
why: str | None = flown.failure
page: str = bp.to_html(finding)
"""


@pytest.mark.parametrize(
    "module",
    [
        "brickpilot",
        "brickpilot.data.dataset",
        "brickpilot.readiness.data_check",
        "brickpilot.fit.calibration",
        "brickpilot.fit.comparison",
        "brickpilot.public.analysis",
        "brickpilot.public.logs",
        "brickpilot.vehicle.flight_figures",
    ],
)
def test_the_examples_of_the_docstrings_run(module: str) -> None:
    assert all(callable(getattr(bp, name).__wrapped__) for name in bp._CALLS)  # loads each function for doctest
    with pd.option_context("display.width", 120):
        result = doctest.testmod(importlib.import_module(module))
    assert result.attempted >= 4
    assert result.failed == 0


def test_each_public_name_is_there() -> None:
    assert set(bp.__all__) <= set(dir(bp))
    assert all(getattr(bp, name) is not None for name in bp.__all__)
    with pytest.raises(AttributeError, match="no attribute 'replay'"):
        _ = bp.replay


def test_the_type_checker_gets_the_names_that_are_loaded() -> None:
    tree = ast.parse(Path(bp.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    imported = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    typed = {one.asname or one.name: f"{node.module}:{one.name}" for node in imported for one in node.names}
    assert typed == {**bp._NAMES, **bp._CALLS}
    assert {*typed, "__version__"} == set(bp.__all__)


def test_the_import_loads_nothing_else() -> None:
    program = "import sys, brickpilot; print('numpy' in sys.modules, [m for m in sys.modules if 'brickpilot.' in m])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "False []\n"


FIRST = (
    "pass",
    "from brickpilot.discover import pipeline",
    "import brickpilot.discover.pipeline as p",
    "from brickpilot import discover",
    "bp.discover_effects",
)
"""Lines that run before `bp.discover` is called: each line loads other modules, or loads them in another order."""


def test_discover_is_the_function_and_the_package() -> None:
    """Each line runs in a fork of a process that has loaded NumPy and SciPy, which takes long, but not brickpilot."""
    program = f"""
import os, sys
import numpy, scipy.linalg, scipy.optimize, scipy.signal, scipy.stats
for first in {FIRST!r}:
    assert not any(name.startswith("brickpilot") for name in sys.modules)
    if child := os.fork():
        assert os.waitpid(child, 0)[1] == 0, first
        continue
    import brickpilot as bp
    exec(first)
    try:
        bp.discover("no data set", seed=3)
    except bp.InputError as error:
        print(error)
    from brickpilot.discover import numbers
    import inspect
    print(bp.discover.numbers is numbers, inspect.signature(bp.discover) == inspect.signature(bp.discover_effects))
    break
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == 2 * len(FIRST)
    assert all(one.startswith("no data set: no such data set") for one in lines[::2])
    assert set(lines[1::2]) == {"True True"}


@pytest.mark.parametrize("name", sorted(bp._CALLS))
def test_help_of_a_package_that_can_be_called_has_the_arguments(name: str) -> None:
    text = pydoc.plain(pydoc.render_doc(getattr(bp, name)))
    assert f"{name}(" in text
    assert "Args:" in text
    assert "Raises:" in text


def test_what_a_caller_gives_is_checked_at_the_door(tmp_path: Path) -> None:
    with pytest.raises(
        bp.InputError, match=r"^dataset: is a DataFrame: give a Dataset, its folder, or Dataset.from_fr"
    ):
        bp.check(pd.DataFrame())
    with pytest.raises(bp.InputError, match="no such data set"):
        bp.check(str(tmp_path / "absent"))
    for call in (bp.check, bp.calibrate, bp.compare, bp.discover, bp.why):
        data = synthetic_motor(tmp_path / call_name(call))
        with pytest.raises(bp.InputError, match=r"^jobs: needs a whole number from 1 to 256, not 0$"):
            call(data, jobs=0)
        with pytest.raises(bp.InputError, match=r"^seed: needs a whole number from 0, not -1$"):
            call(data, seed=-1)
    with pytest.raises(bp.InputError, match=r"m.toml"):
        bp.compare(data, model="m.toml")
    with pytest.raises(bp.InputError, match=r"^model: is a int: give a Model or its file"):
        bp.compare(data, model=3)
    with pytest.raises(bp.InputError, match="coulomb_fiction"):
        bp.calibrate(data, effects="coulomb_fiction")
    assert "coulomb_friction.torque" in bp.calibrate(data, effects="coulomb_friction").parameters
    with pytest.raises(bp.InputError, match=r"^from_frames: got a DataFrame: needs at least one run, {name: Data"):
        bp.Dataset.from_frames(pd.DataFrame())
    with pytest.raises(bp.InputError, match="vehicle: is missing"):
        bp.Dataset.from_frames({"a": pd.DataFrame({"time": [0.0, 0.1], "voltage": 1.0, "speed": 0.0})})


def call_name(function: Any) -> str:
    return str(getattr(function, "__name__", "x")).rpartition(".")[2]


def synthetic_motor(folder: Path) -> Path:
    return synthetic.write(
        folder, synthetic.motor(), {"speed": 0.1}, "", manoeuvres={"a": (4.0, 0.0), "b": (-5.0, 0.0)}
    )


def test_a_motor_without_volts_is_meant_or_an_error() -> None:
    frame = pd.DataFrame({"time": [0.0, 0.1, 0.2], "voltage": [0.0, np.nan, 3.0], "speed": [0.0, 1.0, 2.0]})
    with pytest.raises(bp.InputError, match=r"run a, row 1: voltage: is NaN; say floats=True"):
        bp.Dataset.from_frames({"a": frame}, vehicle="motor")
    dataset = bp.Dataset.from_frames({"a": frame}, vehicle="motor", floats=True)
    assert np.isnan(dataset.motor_inputs(dataset.runs[0])).any()


def test_a_run_as_a_table_has_the_frame_of_the_data_set() -> None:
    frame = pd.DataFrame({"time": [0.0, 0.1], "voltage_left": 1.0, "voltage_right": 2.0, "yaw_rate": [0.1, 0.3]})
    for name in ("FLU", "FRD"):
        dataset = bp.Dataset.from_frames({"a": frame}, vehicle="diff_drive", frame=name)
        np.testing.assert_allclose(dataset.to_frame("a")["yaw_rate"], frame["yaw_rate"])
    with pytest.raises(bp.InputError, match=r"^run: 'b' is not one of a$"):
        dataset.to_frame("b")


def checked(folder: Path, script: str) -> str:
    """Returns what mypy --strict says of a user's script with the installed package."""
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", folder / "cache", "script.py"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False).stdout


def test_a_users_script_has_types(tmp_path: Path) -> None:
    said = checked(tmp_path, USER_SCRIPT)
    assert said.startswith("Success"), said
    wrong = USER_SCRIPT.replace("names: list[str]", "names: list[int]").replace("seed=1", "sede=1")
    said = checked(tmp_path, wrong)
    assert 'Unexpected keyword argument "sede" for "calibrate"' in said
    assert "script.py:9: error: List comprehension has incompatible type" in said


class Tags(HTMLParser):
    """Collects the tags and the attributes of a text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.attributes = set[str](), list[Any]()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[Any]) -> None:
        self.tags.add(tag)
        self.attributes += attrs


@pytest.fixture(scope="module")
def results() -> list[Any]:
    """Returns one result of each kind that the functions return, for a data set whose name is an HTML tag."""
    time = np.arange(0.0, 1.0, 0.01)
    volts = np.where(time > 0.1, 4.0, 0.0)
    frame = pd.DataFrame({"time": time, "voltage": volts, "speed": np.cumsum(volts) * 0.02})
    dataset = bp.Dataset.from_frames({"low": frame, "b<i>": frame}, vehicle="motor", name="<img>", frame="FRD")
    model = bp.Model(SCRIPT, "motor", "coupled", {})
    finding = bp.discover(dataset, jobs=1, budget_s=1.0)
    others = [bp.check(dataset, jobs=1), bp.compare(dataset, model), bp.calibrate(dataset), bp.fly("forward_1m")]
    return [dataset, finding, *others]


def test_a_notebook_shows_each_result_with_all_text_escaped(results: list[Any]) -> None:
    for result in results:
        shown = result._repr_html_()
        tags = Tags(shown)
        assert tags.tags <= {"div", "p", "b", "table", "tr", "th", "td"}
        assert tags.attributes == []
        assert "&lt;img&gt;" in shown or isinstance(result, bp.Flown)
        assert all(str(name) in shown for name in result.to_frame().columns) or isinstance(result, bp.Flown)
    finding = results[1]
    assert str(escape(discover_text.verdict(finding))) in finding._repr_html_()
    assert list(finding.to_frame("ranking").columns) == ["effects", "prediction_error", "removed", "why"]
    with pytest.raises(TypeError, match="str is no result of brickpilot"):
        bp.to_html(SCRIPT)


def test_a_result_prints_as_some_lines_that_say_what_it_says(results: list[Any]) -> None:
    for result in results:
        lines = str(result).splitlines()
        assert 1 <= len(lines) <= 10, type(result)
        assert max(map(len, lines)) <= 130, type(result)
    assert " ".join(discover_text.verdict(results[1]).split())[:60] in " ".join(str(results[1]).split())
    assert str(results[3]).splitlines()[0] == "<img>: measured and simulated"
    with pytest.raises(TypeError, match="str is no result of brickpilot"):
        bp.to_text(SCRIPT)


def test_the_notebook_finds_the_hidden_effect_in_ten_lines() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)  # test_notebooks.py runs it and compares its outputs
    cells = {cell["id"]: cell for cell in notebook.cells}
    find = cells["find"]["source"]
    assert sum(isinstance(node, ast.stmt) for node in ast.parse(find).body) <= 10
    assert len(find.replace("\n\n", "\n").splitlines()) <= 11
    (shown,) = cells["find"]["outputs"]
    assert "coulomb_friction" in shown["data"]["text/html"]
    assert "The simulator lacks" in shown["data"]["text/html"]
    assert "image/png" in cells["draw"]["outputs"][0]["data"]


def test_a_flight_has_the_keys_of_the_command(tmp_path: Path) -> None:
    command = ("run", "mission", "--sensors", "imu", "--seed", "4", "--json", "--out", "out")
    flown = bp.fly("mission", sensors="imu", seed=4)
    done = brickpilot(*command, cwd=tmp_path, timeout=120)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert {**printed, "times_real_time": 0} == {**flown.figures, "times_real_time": 0}
    written = pd.read_csv(tmp_path / "out/log.csv")
    np.testing.assert_allclose(written.to_numpy(), flown.to_frame().to_numpy(), rtol=1e-8)
    with pytest.raises(bp.InputError, match=r"^sensors: 'sonar' is not one of ideal, imu"):
        bp.fly(sensors="sonar")
