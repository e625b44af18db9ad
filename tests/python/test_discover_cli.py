"""`brickpilot discover` gives scripts the promised keys, files and exit status, and one line for an error.

After Ctrl-C, it leaves no file.
"""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from bad_datasets import BAD
from brickpilot import catalogue
from brickpilot.vehicle import compensation, model
from command import PROGRAM, brickpilot
from synthetic import motor, write

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden import folder as hidden_folder
from hidden import manoeuvre
from hidden.recipe import RCX, Recipe

TORQUE = 0.006
"""The hidden dry friction, N m."""

_NUMBER = (int, float)
KEYS: dict[str, type | tuple[type, ...]] = {
    "verdict": str,
    "effects": list,
    "where": list,
    "gap": dict,
    "nominal": dict,
    "data_faults": list,
    "next_experiment": (dict, type(None)),
    "elapsed_s": float,
    "seed": int,
    "version": str,
}


@dataclass(frozen=True)
class Done:
    """A finished call of `brickpilot discover`. `data`: the data set; `out`: the folder that the call wrote."""

    data: Path
    out: Path
    stdout: str
    stderr: str

    @property
    def verdict(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.out / "verdict.json").read_text())
        return found


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a data set of the packaged robot with dry friction at its wheels, made by the planar engine."""
    runs = [
        manoeuvre.steps(name, 4.0, (0.3, left, right), (3.0, 0.0, 0.0))
        for name, left, right in (
            ("ahead", 6.0, 6.0),
            ("slowly", 2.5, 2.5),
            ("back", -5.0, -5.0),
            ("spin", 3.3, -3.3),
            ("spin_back", -2.4, 2.4),
            ("curve", 7.0, 3.0),
            ("curve_left", 2.0, 6.0),
        )
    ]
    hidden = {"coulomb_friction": {"torque": TORQUE}}
    recipe = Recipe("dry-wheels", hidden, RCX, engine="planar", runs=tuple(runs), seed=4)
    return hidden_folder.write(recipe, tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a data set of a motor with dry friction, for tests that need no diff_drive: its search takes seconds."""
    driven = {f"at_{volts:g}": (volts, 0.0) for volts in (2.5, 4.0, 7.0, -3.0, -5.0, -8.0)}
    truth = dataclasses.replace(motor(), effects={"coulomb_friction": {"torque": TORQUE}})
    folder = tmp_path_factory.mktemp("small") / "dry-motor"
    return write(folder, truth, {"speed": 0.05}, "", manoeuvres=driven, roles=["fit"] * 5 + ["held_out"])


@pytest.fixture(scope="module")
def done(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Done:
    here = tmp_path_factory.mktemp("discovered")
    ended = brickpilot("discover", str(data), "--out", "out", "--json", "--seed", "3", cwd=here, fresh=True)
    assert ended.returncode == 0, ended.stderr
    return Done(data, here / "out", ended.stdout, ended.stderr)


def is_finite(value: object) -> bool:
    return isinstance(value, _NUMBER) and not isinstance(value, bool) and math.isfinite(value)


def test_json_is_one_object_and_nothing_else(done: Done) -> None:
    assert done.stderr == ""
    assert done.stdout.count("\n") == 1
    assert json.loads(done.stdout) == done.verdict


def test_the_object_has_every_key_with_its_type(done: Done) -> None:
    found = done.verdict
    for key, kind in KEYS.items():
        assert isinstance(found[key], kind), key
    assert (found["verdict"], found["seed"]) == ("named", 3)
    assert found["elapsed_s"] > 0
    known = {effect.name: effect for effect in catalogue.effects()}
    for effect in found["effects"]:
        assert effect["acts_on"] == known[effect["name"]].acts_on
        assert 0 <= effect["confidence"] <= 1
        assert isinstance(effect["equivalents"], list)
        units = {one.name: one.unit for one in known[effect["name"]].parameters}
        for name, parameter in effect["parameters"].items():
            assert parameter["unit"] == units[name]
            low, high = parameter["ci95"]
            assert is_finite(low) and is_finite(high)  # noqa: PT018
            assert low < parameter["value"] < high
            assert low > 0 or high < 0
    runs = {path.stem for path in done.data.glob("*.csv")}
    for place in found["where"]:
        assert place["run"] in runs
        assert place["from_s"] < place["to_s"]
        assert 0 < place["share_of_gap"] <= 1
        assert isinstance(place["signal"], str)
        assert isinstance(place["when"], str)
    assert sum(place["share_of_gap"] for place in found["where"]) <= 1 + 1e-9
    assert found["gap"]["unit"] == "residual rms / noise sd"
    gaps = [found["gap"]["fit"], found["gap"]["held_out"], *found["gap"]["by_signal"].values()]
    assert len(gaps) == 2 + 5
    for gap in gaps:
        assert is_finite(gap["before"]) and is_finite(gap["after"])  # noqa: PT018
    for change in found["nominal"].values():
        assert is_finite(change["before"]) and is_finite(change["after"])  # noqa: PT018


def test_what_was_hidden_is_found_and_the_gap_goes_down_to_the_noise(done: Done) -> None:
    found = done.verdict
    ((effect),) = found["effects"]
    assert effect["name"] == "coulomb_friction"
    assert effect["parameters"]["torque"]["value"] == pytest.approx(TORQUE, rel=0.05)
    for role in ("fit", "held_out"):
        assert found["gap"][role]["before"] > 3
        assert found["gap"][role]["after"] <= 1.1


def test_the_files_are_those_that_are_documented(done: Done) -> None:
    assert {path.name for path in done.out.iterdir()} == {
        "report.html", "verdict.json", "model.toml", "compensation.toml"
    }  # fmt: skip
    assert done.out.stat().st_mode & 0o777 == 0o755
    page = (done.out / "report.html").read_text(encoding="utf-8")
    assert "coulomb_friction" in page
    assert "brickpilot discover" in page
    assert model.load(done.out / "model.toml").effects["coulomb_friction"]["torque"] == pytest.approx(TORQUE, rel=0.05)


def test_compare_with_the_written_model_shows_the_smaller_gap(done: Done, tmp_path: Path) -> None:
    def errors(*options: str) -> dict[str, dict[str, float]]:
        ended = brickpilot("compare", str(done.data), "--json", "--out", "compared", *options, cwd=tmp_path)
        assert ended.returncode == 0, ended.stderr
        runs = json.loads(ended.stdout)["runs"]
        return {run["name"]: {name: one["rms_error"] for name, one in run["signals"].items()} for run in runs}

    nominal, augmented = errors(), errors("--model", str(done.out / "model.toml"))
    assert augmented.keys() == done.verdict["roles"].keys()
    for name in augmented:
        for wheel in ("wheel_speed_left", "wheel_speed_right"):
            assert augmented[name][wheel] < 0.5 * nominal[name][wheel]


def test_a_second_run_from_the_written_model_finds_nothing_more(small: Path, tmp_path: Path) -> None:
    for words in ((), ("--model", "out/model.toml")):
        ended = brickpilot("discover", str(small), *words, "--out", "again" if words else "out", "--json", cwd=tmp_path)
        assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert (found["verdict"], found["effects"]) == ("none", [])
    assert found["gap"]["held_out"]["after"] <= 1.1
    first, kept = (model.load(tmp_path / out / "model.toml").effects for out in ("out", "again"))
    assert kept.keys() == first.keys() == {"coulomb_friction"}
    assert kept["coulomb_friction"]["torque"] == pytest.approx(TORQUE, rel=0.05)


def test_the_compensation_takes_away_most_of_what_the_friction_costs_a_flight(done: Done, tmp_path: Path) -> None:
    written = done.out / "compensation.toml"
    assert "coulomb_friction" in compensation.load(written).undone

    def flown(*options: str) -> dict[str, Any]:
        ended = brickpilot("run", "--sensors", "imu", "--seed", "1", *options, "--json", "--out", "flown", cwd=tmp_path)
        figures: dict[str, Any] = json.loads(ended.stdout)
        assert ended.returncode == (figures["waypoints_reached"] < 8), ended.stderr
        return figures

    robot = ("--model", str(done.out / "model.toml"))
    own, without, compensated = flown(), flown(*robot), flown(*robot, "--compensation", str(written))
    assert compensated["waypoints_reached"] == 8
    errors = [one["position_estimate_error_m"] for one in (own, compensated, without)]
    assert errors[1] - errors[0] < 0.5 * (errors[2] - errors[0])  # the firmware itself learns a part of the friction
    assert compensated["cross_track_rms_m"] < without["cross_track_rms_m"]


def test_progress_goes_to_stderr_and_the_verdict_to_stdout(small: Path, tmp_path: Path) -> None:
    """Unlike in the other tests, the command runs with one job and without --out."""
    ended = brickpilot("discover", str(small), "--jobs", "1", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    stages = ended.stderr.splitlines()
    assert len(stages) >= 4
    assert all(len(stage) < 100 and "\r" not in stage for stage in stages)
    assert any(stage.startswith("searching for effect 1") for stage in stages)
    assert "coulomb_friction.torque" in ended.stdout
    assert "searching for" not in ended.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]
    assert f"report: {Path('runs') / 'discover-synthetic' / 'report.html'}" in ended.stdout.splitlines()


def refused(*arguments: str, cwd: Path) -> str:
    """Returns the line with which `brickpilot discover ARGUMENTS` refuses, and checks that it writes nothing else."""
    before = sorted(cwd.rglob("*"))
    ended = brickpilot("discover", *arguments, cwd=cwd, timeout=60)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.count("\n") == 1
    assert "Traceback" not in ended.stderr
    assert sorted(cwd.rglob("*")) == before
    return ended.stderr


@pytest.mark.parametrize("bad", BAD[::12], ids=lambda bad: bad.name)
def test_a_bad_data_set_is_refused_where_it_is_bad(bad: Any, tmp_path: Path) -> None:
    folder = bad.write(tmp_path / "bad")
    said = refused(str(folder), cwd=tmp_path)
    assert bad.file in said
    assert bad.says in said


def test_bad_options_are_refused(data: Path, done: Done, tmp_path: Path) -> None:
    assert "nowhere" in refused("nowhere", cwd=tmp_path)
    assert "missing.toml" in refused(str(data), "--model", "missing.toml", cwd=tmp_path)
    assert "--jobs" in refused(str(data), "--jobs", "0", cwd=tmp_path)
    assert "--jobs" in refused(str(data), "--jobs", "many", cwd=tmp_path)
    assert "--seed" in refused(str(data), "--seed", "-1", cwd=tmp_path)
    (tmp_path / "broken.toml").write_text('name = "half\n')
    assert "broken.toml:1" in refused(str(data), "--model", "broken.toml", cwd=tmp_path)
    model.save(motor(), tmp_path / "motor.toml")
    said = refused(str(data), "--model", "motor.toml", cwd=tmp_path)
    assert "motor.toml" in said
    assert "vehicle" in said


def test_a_folder_with_anything_else_in_it_is_left_alone(data: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("all of it\n")
    said = refused(str(data), "--out", "out", cwd=tmp_path)
    assert "thesis.txt" in said
    assert (tmp_path / "out" / "thesis.txt").read_text() == "all of it\n"


def test_its_own_folder_is_replaced(done: Done, tmp_path: Path) -> None:
    """A second call with the same --out replaces all files. It names no effect, so it leaves no compensation.toml."""
    shutil.copytree(done.out, tmp_path / "out")
    driven = {"go": (4.0, 0.0), "on": (7.0, 0.0)}
    still = write(tmp_path / "still", motor(), {"speed": 0.05}, "battery_voltage = 9.0", manoeuvres=driven)
    ended = brickpilot("discover", str(still), "--out", "out", "--json", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["verdict"] == "none"
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"report.html", "verdict.json", "model.toml"}


def test_where_every_run_is_held_out_there_is_nothing_to_fit(tmp_path: Path) -> None:
    driven = {"go": (4.0, 0.0)}
    folder = write(tmp_path / "data", motor(), {"speed": 0.05}, "", manoeuvres=driven, roles=["held_out"])
    assert "held out" in refused(str(folder), cwd=tmp_path)


@pytest.mark.parametrize("stage", ["preparing the data", "searching for effect 1", "computing intervals"])
def test_ctrl_c_leaves_nothing_behind(stage: str, small: Path, tmp_path: Path) -> None:
    work = subprocess.Popen(
        [str(PROGRAM), "discover", str(small), "--out", "out"],
        cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background jobs of a shell ignore SIGINT
    )  # fmt: skip
    assert work.stderr is not None
    for line in work.stderr:
        if line.startswith(stage):  # the line may continue with the expected time
            break
    work.send_signal(signal.SIGINT)
    said, complained = work.communicate(timeout=60)
    assert (work.returncode, said) == (130, "")
    assert complained.splitlines()[-1] == "brickpilot: interrupted"
    assert "Traceback" not in complained
    assert list(tmp_path.iterdir()) == []
