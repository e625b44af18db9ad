"""The blind test: its rules, its rerun after an interruption, and one small complete run."""

from __future__ import annotations

import json
import math
import subprocess
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from brickpilot.campaign import workers
from brickpilot.data import reading
from brickpilot.errors import InputError, SimulationError
from click.testing import CliRunner
from command import lab
from lab import __main__ as program
from lab import blind_test, sets, table
from lab.result import RESULTS, append, load
from lab.score import (
    Share,
    composed,
    credit,
    decided,
    found,
    intervals_hold,
    kind,
    parameter_errors,
    right,
    visible,
    wrong,
)
from lab_results import ENCODERS, IMU, effect, result

CHECKOUT = Path(__file__).parents[2]


def claim(results, what):
    return next(one for one in table.claims(results) if one.what.startswith(what))


def test_interval_of_a_share_is_wilsons() -> None:
    low, high = Share(5, 10).interval
    assert (low, high) == (pytest.approx(0.2366, abs=1e-4), pytest.approx(0.7634, abs=1e-4))
    assert Share(0, 150).interval[1] == pytest.approx(0.02497, abs=1e-4)
    assert Share(0, 0).value is None
    assert Share(0, 0).interval is None


@pytest.mark.parametrize(
    ("sensors", "verdict", "effects", "expected"),
    [
        (ENCODERS, "named", [effect("a")], 1.0),
        (ENCODERS, "named", [effect("a"), effect("b")], 1.0),
        (ENCODERS, "named", [effect("b"), effect("a")], 0.0),
        (ENCODERS, "named", [effect("b")], 0.0),
        (ENCODERS, "ambiguous", [effect("b", "a", "c")], 0.5),
        (ENCODERS, "ambiguous", [effect("a", "b", "c", "d")], 0.0),
        (ENCODERS, "ambiguous", [effect("b", "c")], 0.0),
        (ENCODERS, "ambiguous", [effect("b", "a + c", "d")], 0.0),
        (IMU, "ambiguous", [effect("b", "a", "c", "d")], 1.0),
        (IMU, "ambiguous", [effect("b", "a", "c", "d", "e")], 0.0),
        (ENCODERS, "unknown", [effect("a")], 0.0),
        (ENCODERS, "none", [], 0.0),
    ],
)
def test_credit_of_a_single_effect(sensors, verdict, effects, expected) -> None:
    assert credit(result(["a"], verdict, *effects, sensors=sensors)) == expected


def test_a_set_that_ended_in_an_error_is_neither_right_nor_found() -> None:
    broken = result(["a"], "named", effect("a"), error="ValueError: no")
    assert credit(broken) == 0.0
    assert not right(broken)
    assert claim([broken], "sets that ended in an error").value == 1.0
    unmade = result([], "error", error="InputError: not made") | {"hidden": None, "visibility": {}}
    assert kind(unmade) == "unmade"
    assert claim([unmade], "nothing hidden, nominal values 2 %").of == 0


def test_kinds_and_visibility_come_from_the_truth() -> None:
    kinds = {"none": [], "single": ["a"], "pairs": ["a", "b"], "triples": ["a", "b", "c"], "odd": ["odd_x"]}
    assert {name: kind(result(hidden, "none")) for name, hidden in kinds.items()} == {name: name for name in kinds}
    assert visible(result(["a"], "none", moved=5.0))
    assert not visible(result(["a"], "none", moved=4.9))


def test_of_two_effects_an_ambiguous_verdict_stands_for_what_its_explanations_share() -> None:
    both = result(["a", "b"], "named", effect("b"), effect("a"))
    one_sure = result(["a", "b"], "ambiguous", effect("a", "a + c"), effect("b"))
    none_sure = result(["a", "b"], "ambiguous", effect("c", "d"))
    false_one = result(["a", "b"], "named", effect("a"), effect("c"))
    assert found(both) == {"a", "b"}
    assert found(one_sure) == {"a"}
    assert found(none_sure) == set()
    results = [both, one_sure, none_sure, false_one]
    assert claim(results, "pairs: both found").value == 0.25
    assert claim(results, "pairs: at least one found and no false one").value == 0.5
    assert claim(results, "pairs: both, ambiguous").value == pytest.approx(1.5 / 4)


def test_false_positives_count_every_verdict_but_none_and_need_a_hundred_sets() -> None:
    clean = [result([], "none")] * 98
    few = claim(clean, "nothing hidden, nominal values 2 %")
    assert (few.value, few.holds) == (0.0, None)
    enough = claim([*clean, result([], "unknown"), result([], "ambiguous", effect("a", "b"))], few.what)
    assert (enough.value, enough.holds) == (0.02, True)
    assert claim([*clean, *[result([], "named", effect("a"))] * 3], few.what).holds is False
    assert claim([result([], "named", effect("a"), nominal_error=0.05)], few.what).of == 0


def test_off_library_asks_for_a_term_that_removes_the_gap_and_for_no_name() -> None:
    term = {"equation": "u", "removed_held_out": 0.9}
    most = {"before": 5.0, "after": 1.5, "removed": 0.8, "floor": "stated"}
    good = result(["odd_x"], "unknown", term=term, held_out=most)
    weak = result(["odd_x"], "unknown", term=term, held_out=most | {"removed": 0.79})
    misnamed = result(["odd_x"], "named", effect("a"), held_out=most)
    beside = result(["odd_x"], "unknown", effect("a"), term=term, held_out=most)
    unsure = result(["odd_x"], "ambiguous", effect("a", "b"), held_out=most)
    assert [composed(one) for one in (good, weak, misnamed, unsure)] == [True, False, False, False]
    assert [wrong(one) for one in (good, misnamed, beside, unsure)] == [False, True, True, False]
    assert right(good)
    assert not right(misnamed)


def test_parameter_errors_are_relative_and_angles_wrap() -> None:
    hidden = {"a": {"torque": 2.0, "phase": 3.1, "drag": 0.0}}
    named = result(hidden, "named", effect("a", torque=2.2, phase=-3.1, drag=0.5, other=1.0))
    assert parameter_errors([named], main=True) == [pytest.approx(0.1)]
    assert parameter_errors([named], main=False) == [pytest.approx(0.1), pytest.approx((2 * math.pi - 6.2) / math.pi)]
    assert parameter_errors([result(hidden, "named", effect("b", torque=1.0))], main=False) == []


def test_intervals_are_checked_where_the_name_is_right() -> None:
    hidden = {"a": {"torque": 2.0, "phase": 3.1, "drag": 0.0}}
    values = {"torque": (2.2, 2.1, 2.3), "phase": (-3.1, -3.3, -2.9), "drag": (0.1, -0.1, 0.3)}
    held = intervals_hold([result(hidden, "named", effect("a", **values)), result(hidden, "named", effect("b"))])
    assert (held.hits, held.of) == (2, 3)


def test_the_next_experiment_decides_if_the_truth_alone_is_named_after_it() -> None:
    def after(verdict, *effects):
        return {"verdict": verdict, "effects": list(effects), "term": None}

    unsure = effect("a", "b")
    settled = result(["a"], "ambiguous", unsure, follow=after("named", effect("a")))
    misled = result(["a"], "ambiguous", unsure, follow=after("named", effect("b")))
    nothing = result(["a"], "ambiguous", unsure)
    assert decided(settled)
    assert not decided(misled)
    results = [settled, misled, nothing, result(["a"], "named", effect("a"))]
    assert claim(results, "ambiguous, single").value == 0.5
    assert claim(results, "ambiguous: no experiment").value == pytest.approx(1 / 3)
    assert claim(results, "any set: ambiguous").value == 0.75


def test_power_by_effect_and_by_visibility() -> None:
    small = result(["a"], "none", size=0.25, moved=1.5)
    large = result(["a"], "named", effect("a"), size=1.0, moved=6.0)
    other = result(["a"], "named", effect("b"), size=1.0, moved=7.0)
    cells = {(row["effect"], row["size"]): row for row in table.power([small, large, other])}
    assert cells["a", 0.25]["detected"] == 0.0
    assert (cells["a", 1.0]["detected"], cells["a", 1.0]["right"], cells["a", 1.0]["sets"]) == (1.0, 0.5, 2)
    curve = table.curve([small, large, other])
    assert [(row["from"], row["to"], row["detected"], row["right"]) for row in curve] == [
        (1.0, 2.0, 0.0, 0.0),
        (5.0, 10.0, 1.0, 0.5),
    ]


def test_the_table_says_what_holds() -> None:
    results = [result(["a"], "named", effect("a"), elapsed_s=20.0)]
    made = table.table(results)
    holds = {one["what"]: one["holds"] for one in made["claims"]["all"]}
    assert holds["single, clearly visible, wheel speeds measured: right name"] is True
    assert holds["time to answer, worst"] is False
    text = "\n".join(table.lines(made))
    assert "[+] single, clearly visible, wheel speeds measured: right name" in text
    assert "[-] time to answer, worst" in text
    assert json.loads(json.dumps(made)) == json.loads(json.dumps(made, allow_nan=False))


def test_results_are_appended_completely_and_a_cut_off_line_is_dropped(tmp_path) -> None:
    path = tmp_path / "out" / RESULTS
    append(path, result(["a"], "none", name="one"))
    with path.open("a") as file:
        file.write('{"name": "two", "eng')
    assert [one["name"] for one in load(path)] == ["one"]
    append(path, result(["a"], "none", name="three"))
    append(path, result(["a"], "named", name="one"))
    assert [(one["name"], one["verdict"]) for one in load(path)] == [("one", "named"), ("three", "none")]
    path.write_text("[]\n" + path.read_text())
    with pytest.raises(InputError, match=rf"{RESULTS}:1: is not a line"):
        load(path)


class Recorded(sets.Maker):
    """Makes empty folders and keeps their names."""

    def __init__(self, broken=()) -> None:
        self.made, self.broken = [], broken

    def make(self, tasks, out, jobs) -> None:
        for task in tasks:
            if task.name in self.broken:
                raise SimulationError("diverged")
            (out / task.name).mkdir(parents=True)
        self.made.append([task.name for task in tasks])


def test_a_rerun_continues_where_the_last_one_stopped_and_repeats_errors(tmp_path, monkeypatch) -> None:
    tasks = [sets.Task(f"s{i}", "mujoco", i, "single", 0) for i in range(10)]
    tasks += [sets.Task("s0", "planar", 0, "single", 0)]
    done = []

    def run_one(task, folder, *_):
        if len(done) == 3:
            raise KeyboardInterrupt
        assert folder.is_dir()
        done.append(task)
        error = "ValueError: no" if task.name == "s1" else None
        return result([], "none", name=task.name, engine=task.engine, seed=task.seed, error=error)

    monkeypatch.setattr(blind_test, "run_one", run_one)
    shown = []
    options = {"workers": workers.Here(), "progress": lambda *one: shown.append(one)}
    with pytest.raises(KeyboardInterrupt):
        blind_test.run(tasks, tmp_path, work=blind_test.Work(Recorded(), 1), **options)
    assert [task.name for task in done] == ["s0", "s1", "s2"]
    done.clear()
    done.extend([None] * 4)
    maker = Recorded()
    results = blind_test.run(tasks, tmp_path, work=blind_test.Work(maker, 1), **options)
    assert [(task.name, task.engine) for task in done[4:]] == [
        ("s1", "mujoco"), *((f"s{i}", "mujoco") for i in range(3, 10)), ("s0", "planar"),
    ]  # fmt: skip
    assert maker.made == [[task.name] for task in done[4:]]
    assert len(results) == 11
    assert shown[-1] == (11, 11, "11 of 11 sets")
    again = blind_test.run(tasks[2:], tmp_path, work=blind_test.Work(Recorded(broken=["s5"]), 1), **options)
    assert again == results == load(tmp_path / RESULTS)


def test_a_maker_that_makes_no_set_ends_the_benchmark_and_a_single_missing_set_does_not(tmp_path) -> None:
    tasks = [sets.Task(name, "mujoco", 0, "single", 0) for name in ("whole", "broken")]
    work = blind_test.Work(Recorded(broken=["broken"]), 1)
    options = {"work": work, "workers": workers.Here(), "progress": lambda *_: None}
    with pytest.raises(SimulationError, match="diverged"):
        blind_test.run(tasks[1:], tmp_path, **options)
    results = blind_test.run(tasks, tmp_path, **options)
    assert [(one["name"], one["verdict"]) for one in results] == [("whole", "error"), ("broken", "error")]
    assert "is missing: the set was not made" in results[1]["error"]


class Backwards:
    """Workers of this process: the last part finishes first."""

    @contextmanager
    def started(self, function):
        yield lambda parts: ((part, function(part.argument)) for part in reversed(list(parts)))


def test_results_stand_in_order_whoever_was_first(tmp_path) -> None:
    tasks = [sets.Task(f"s{i}", "mujoco", i, folder=tmp_path) for i in range(6)]
    asked = {"work": blind_test.Work(None, 1), "progress": lambda *_: None}
    expected = [one["name"] for one in blind_test.run(tasks, tmp_path / "a", workers=workers.Here(), **asked)]
    assert expected == [task.name for task in tasks]
    assert [one["name"] for one in blind_test.run(tasks, tmp_path / "b", workers=Backwards(), **asked)] == expected
    lines = {(tmp_path / place / RESULTS).read_bytes() for place in "ab"}
    assert len(lines) == 1


def test_a_worker_without_the_files_of_a_set_says_so(tmp_path) -> None:
    task = sets.Task("s", "mujoco", 0, folder=tmp_path / "s")
    work = blind_test.Work(None, 1)
    with pytest.raises(InputError, match=r"/s: is missing on the worker \S+: each worker needs the same files$"):
        blind_test.run([task], tmp_path, work=work, workers=workers.Local(1), progress=lambda *_: None)


def refused(*arguments, cwd) -> str:
    done = lab(*arguments, cwd=cwd)
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    return done.stderr


def test_bad_use_gives_one_line(tmp_path) -> None:
    assert "--scheduler here: needs the address" in refused("discover", "--scheduler", "here", cwd=tmp_path)
    assert "no results here" in refused("discover", "--table", cwd=tmp_path)
    assert "holds no data set" in refused("discover", "--data", ".", cwd=tmp_path)
    (tmp_path / "one").mkdir()
    (tmp_path / "one.truth.json").write_text("{}")
    assert "one.truth.json: is not the truth" in refused("discover", "--data", ".", cwd=tmp_path)


def test_a_missing_package_gives_one_line(monkeypatch) -> None:
    monkeypatch.setattr(sets, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="needs the package mujoco"):
        sets.planned(Recorded(), "ci", "mujoco", 0, (), None)


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """Returns a folder with two sets of suite ci, made by the maker of the checkout."""
    pytest.importorskip("mujoco")
    parent = tmp_path_factory.mktemp("small")
    maker = sets.Maker()
    tasks = sets.planned(maker, "ci", "mujoco", 0, ["ci-coulomb_friction-enc", "ci-gyro_bias-*"], None)
    maker.make(tasks, parent, 1)
    return parent


def test_the_next_experiment_is_added_to_the_same_set(small, tmp_path) -> None:
    maker = sets.Maker()
    steps = [[0.0, 0.0], [0.5, 0.0], [0.5, 3.0], [2.0, 3.0]]
    asked = {"name": "a turn, then on", "duration_s": 3.0, "voltage_left": steps, "voltage_right": [[0.0, 0.0]]}
    made = maker.follow(small / "ci-coulomb_friction-enc", asked, tmp_path)
    before, after = reading.read(small / "ci-coulomb_friction-enc"), reading.read(made)
    assert [run.name for run in after.runs] == [*(run.name for run in before.runs), "next_experiment"]
    for one, other in zip(before.runs, after.runs, strict=False):
        np.testing.assert_array_equal(one.outputs["yaw_rate"], other.outputs["yaw_rate"])
    added = after.runs[-1]
    assert added.role == "fit"
    assert added.time[-1] == pytest.approx(3.0)
    np.testing.assert_array_equal(added.inputs["voltage_left"][added.time >= 0.5], 3.0)
    assert added.outputs["wheel_speed_left"][added.time > 1.5].mean() > 1.0
    assert abs(added.outputs["wheel_speed_left"][added.time < 0.5].mean()) < 0.1


def test_wheel_speeds_are_measured_if_the_verdict_asks_for_them(small, tmp_path) -> None:
    maker = sets.Maker()
    asked = {"name": None, "signal": "wheel_speed_left"}
    made = maker.follow(small / "ci-gyro_bias-imu", asked, tmp_path)
    before, after = reading.read(small / "ci-gyro_bias-imu"), reading.read(made)
    assert set(after.runs[0].outputs) - set(before.runs[0].outputs) == {"wheel_speed_left", "wheel_speed_right"}
    pairs = zip(before.runs, after.runs, strict=True)
    same = [np.mean(one.outputs["yaw_rate"] == other.outputs["yaw_rate"]) for one, other in pairs]
    assert min(same) > 0.99
    assert maker.follow(small / "ci-coulomb_friction-enc", asked, tmp_path) is None
    assert maker.follow(small / "ci-gyro_bias-imu", asked | {"signal": "current_left"}, tmp_path) is None


def test_a_small_complete_run(small, tmp_path) -> None:
    arguments = ["discover", "--data", str(small), "--only", "*coulomb*", "--out", str(tmp_path / "out")]
    done = lab(*arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    table = json.loads(done.stdout)
    assert (table["sets"], table["engines"], table["errors"]) == (1, ["mujoco"], {})
    kept = load(tmp_path / "out" / RESULTS)[0]
    assert kept["hidden"] == {"coulomb_friction": {"torque": 0.005}}
    assert credit(kept) == 1.0
    assert parameter_errors([kept], main=True)[0] < 0.1
    assert kept["held_out"]["after"] == pytest.approx(1.0, abs=0.1)
    assert kept["held_out"]["before"] > 3.0
    again = lab(*arguments, cwd=tmp_path)
    assert "right name" in again.stdout
    assert len((tmp_path / "out" / RESULTS).read_text().splitlines()) == 1
    typed = ["sh", CHECKOUT / "tests/lab/run", "discover", "--out", "out", "--table"]
    shown = subprocess.run(typed, cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=True)
    assert shown.stdout == again.stdout


def test_sets_are_made_and_deleted(tmp_path, monkeypatch) -> None:
    """Discovery does not run here: another test checks the effects that it finds in a set."""
    judged = []

    def run_one(task, folder, *_):
        judged.append((folder, reading.read(folder).name))
        return result([], "none", name=task.name, engine=task.engine, seed=task.seed, seed_offset=task.seed_offset)

    monkeypatch.setattr(blind_test, "run_one", run_one)
    monkeypatch.chdir(tmp_path)
    options = ["--suite", "same", "--engine", "planar", "--limit", "1", "--seed-offset", "0", "--out", "out", "--json"]
    done = CliRunner().invoke(program.lab, ["discover", *options])
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in Path("out").iterdir()) == ["report.html", RESULTS, "table.json", "table.md"]
    ((folder, name),) = judged
    assert not folder.exists()
    kept = load(Path("out") / RESULTS)[0]
    assert (kept["name"], kept["verdict"], kept["seed_offset"], kept["error"]) == (name, "none", 0, None)
