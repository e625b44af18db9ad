"""The benchmark on real logs: its figure, the data sets of public logs, the peers, the kept results and the table."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import tune_study
from brickpilot import catalogue
from brickpilot.data import holdout, reading
from brickpilot.data.holdout import Roles
from brickpilot.errors import InputError
from brickpilot.fit.comparison import compare
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay
from command import lab
from lab import measured, real_logs, real_results, real_run, real_score, real_table
from lab.peers import PEERS, Peer, grid

PAGE = Path(__file__).parents[2] / "tools/docs/benchmarks.md"
STEP = 0.01


def motor_run(volts, *, friction=0.3, start=0.0):
    """Returns the speed (n,) of a motor under `volts` (n,), 10 ms each: dv/dt = 8 u - 4 v - 8 friction sgn(v)."""
    speed, found = start, []
    for volt in np.repeat(volts, 10):
        found.append(speed)
        push = 8 * volt
        if speed == 0 and abs(push) <= 8 * friction:
            continue
        way = math.copysign(1.0, speed) if speed else math.copysign(1.0, push)
        after = speed + 1e-3 * (push - 4 * speed - 8 * friction * way)
        speed = 0.0 if speed * after < 0 else after
    return np.array(found[::10])


def steps(seed, count=300):
    random = np.random.default_rng(seed)
    return np.repeat(random.uniform(-6, 6, count // 30), 30)


def motor_set(folder, *, scramble=0.0, runs=4):
    """Writes and returns a data set of one motor; `scramble` is added to the speed of the held-out run."""
    folder.mkdir()
    tables = ['name = "bench"\nvehicle = "motor"\n[signals]']
    tables.append('time = { column = "t", unit = "s" }\nvoltage = { column = "u", unit = "V" }')
    tables.append('speed = { column = "v", unit = "rad/s" }\n[nominal]')
    for number in range(runs):
        volts, held = steps(number), number == runs - 1
        speed = motor_run(volts) + (scramble if held else 0.0)
        rows = [
            f"{STEP * row:.6g},{u!r},{v!r}"
            for row, (u, v) in enumerate(zip(volts.tolist(), speed.tolist(), strict=True))
        ]
        (folder / f"r{number}.csv").write_text("t,u,v\n" + "\n".join(rows) + "\n")
        role = "held_out" if held else "fit"
        tables.append(f'[[runs]]\nname = "r{number}"\nfile = "r{number}.csv"\nrole = "{role}"')
    (folder / "dataset.toml").write_text("\n".join(tables) + "\n")
    return reading.read(folder)


def roles_of(data):
    return holdout.assign(data, Replay(data).inputs)


def fit_of(data, predicted, signals=("speed",)):
    return real_score.fits(data, roles_of(data), predicted, signals)


def test_fit_percent_is_the_share_of_the_signal(tmp_path):
    data = motor_set(tmp_path / "a")
    measured = {run.name: run.outputs["speed"] for run in data.runs}
    exact = fit_of(data, {name: {"speed": values} for name, values in measured.items()})
    assert exact["fit"].pooled == pytest.approx(100.0)
    held = data.runs[-1].outputs["speed"]
    off = fit_of(data, {data.runs[-1].name: {"speed": held + 0.25 * float(np.sqrt(np.mean(held**2)))}})
    assert off["held_out"].by_signal["speed"] == pytest.approx(75.0)
    assert off["fit"].pooled == pytest.approx(0.0)  # runs without a prediction: nothing is explained


def test_the_figure_of_a_model_is_that_of_compare(tmp_path):
    data = motor_set(tmp_path / "a")
    model = Model("given", "motor", "coupled", catalogue.presets("motor"))
    figures = compare(data, model).headline
    found = fit_of(data, real_run._free_runs(data, model))
    for role in ("fit", "held_out"):
        assert found[role].pooled == figures.mean(role)
        assert found[role].by_signal == {"speed": figures.of("speed", role).fit_percent}


def test_fit_percent_of_a_diverged_model_is_the_worst(tmp_path):
    data = motor_set(tmp_path / "a")
    huge = {run.name: {"speed": np.full_like(run.time, 1e200)} for run in data.runs}
    assert fit_of(data, huge)["fit"].pooled == real_score.WORST


def test_a_path_counts_from_its_first_sample():
    path, other = np.array([5.0, 6.0, np.nan, 7.0]), np.array([0.0, 1.0, 1.0, 2.0])
    np.testing.assert_array_equal(real_score._known("angle", path, other), [[0, 1, 2], [0, 1, 2]])
    np.testing.assert_array_equal(real_score._known("speed", path, other), [[5, 6, 7], [0, 1, 2]])


def test_held_input_is_averaged_over_the_step_that_follows():
    time = np.array([0.0, 0.01, 0.02, 0.03])
    means = grid._held_means(time, np.array([0.0, 4.0, 4.0, 8.0]), np.array([0.0, 0.02]), 0.02)
    np.testing.assert_allclose(means, [2.0, 6.0])


@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_peer_fits_a_motor_and_never_sees_the_held_out_run(tmp_path, peer: Peer):
    if missing := peer.missing():
        pytest.skip(missing)
    data = motor_set(tmp_path / "a")
    predicted = peer.load()(data, roles_of(data))
    # SysIdentPy and nfoursid have no dry friction, and the dry friction of MuJoCo is a soft constraint.
    least = {"SysIdentPy NARX": 75.0, "nfoursid": 75.0, "mujoco.sysid": 85.0}.get(peer.name, 93.0)
    assert fit_of(data, predicted)["held_out"].pooled > least
    other = motor_set(tmp_path / "b", scramble=40.0)
    again = peer.load()(other, roles_of(other))
    for run in data.runs[:-1]:
        np.testing.assert_array_equal(again[run.name]["speed"], predicted[run.name]["speed"])


def test_peer_that_is_not_installed_is_a_line():
    peer = Peer("Nobody", "lab.peers.narx:fit", "no_such_package_here")
    assert (
        peer.missing() == "Nobody is left out: no_such_package_here is not installed; pip install 'brickpilot[peers]'"
    )
    assert Peer("Half", "", "json:no_such_name").missing() is not None
    assert Peer("Whole", "", "json:dumps").missing() is None


def test_setting_is_chosen_on_fit_runs_and_a_failing_one_is_left_out(tmp_path):
    data = motor_set(tmp_path / "a")
    asked = []

    def simulated(one, used, wanted, setting):
        asked.append((setting, tuple(used), tuple(wanted)))
        if setting == "fails":
            raise ValueError
        factor = {"good": 0.9, "bad": 0.1}[setting]
        return {name: factor * one.stretches[name].outputs for name in wanted}

    found = grid.choose([grid.on_grid(data, STEP)], ["fails", "bad", "good"], simulated, roles_of(data))
    assert asked[-1] == ("good", ("r0", "r1", "r2"), ("r0", "r1", "r2", "r3"))
    assert all("r3" not in used + wanted for _, used, wanted in asked[:-1])
    np.testing.assert_allclose(found["r3"]["speed"], 0.9 * data.runs[3].outputs["speed"])


def test_table_of_logs_is_sound():
    logs = real_logs.read()
    known = {effect.mechanism for effect in catalogue.effects()}
    assert len({log.name for log in logs}) == len(logs)
    assert sum(bool(log.repository) for log in logs) >= 6
    for log in logs:
        assert set(log.mechanisms) <= known, log.name
        assert all((log.machine, log.known, log.source, log.physics, log.mechanisms)), log.name


def test_table_of_logs_names_the_entry_that_is_wrong(tmp_path):
    path = tmp_path / "logs.toml"
    path.write_text(
        '[[log]]\nname = "a"\nmachine = ""\nknown = ""\nsource = ""\nphysics = ""\nmechanisms = []\nrate = 3\n'
    )
    with pytest.raises(InputError, match=r"logs\.toml: a: .*rate"):
        real_logs.read(path)


def a_log(**more):
    words = {"machine": "m", "known": "k", "source": "s", "physics": "p", "mechanisms": ("bearing",)}
    given = {"name": "pair", "repository": "some/robot", "files": (("in_*.txt", "out_*.txt"),), "vehicle": "motor"}
    return real_logs.RealLog(**{**words, **given, **more})


def test_files_side_by_side_become_runs(tmp_path):
    clone = tmp_path / "fetched" / "some+robot"
    clone.mkdir(parents=True)
    for name in ("in_1", "in_2", "out_1", "out_2"):
        values = [f"{row if name.startswith('in') else 10 * row}" for row in range(21)]
        (clone / f"{name}.txt").write_text("% a comment\n" + "\n".join(values) + "\n")
    log = a_log(
        comment="%", step_s=0.5, skip=1, every=2, parts=2, held_out=("in_2*",),
        mapping=("time=0", "voltage=1:mV", "speed=2"), nominal={"battery_voltage": 7.4},
    )  # fmt: skip
    data = reading.read(real_logs.build(log, tmp_path / "fetched", tmp_path / "out"))
    assert [run.name for run in data.runs] == ["in_1_1", "in_1_2", "in_2_1", "in_2_2"]
    assert [run.role for run in data.runs] == ["fit", "fit", "held_out", "held_out"]
    np.testing.assert_allclose(data.runs[1].time, [5.5, 6.5, 7.5, 8.5, 9.5])
    np.testing.assert_allclose(data.runs[0].inputs["voltage"], [1e-3, 3e-3, 5e-3, 7e-3, 9e-3])
    np.testing.assert_allclose(data.runs[0].outputs["speed"], [10, 30, 50, 70, 90])
    assert data.nominal["battery_voltage"].value == 7.4


def test_log_that_is_not_fetched_is_told(tmp_path):
    assert real_logs.build(a_log(), tmp_path, tmp_path / "out") is None
    (line,) = real_logs.describe_missing([a_log()], tmp_path)
    assert "github.com/some/robot" in line
    (tmp_path / "some" / "robot").mkdir(parents=True)
    with pytest.raises(InputError, match="no such file"):
        real_logs.build(a_log(), tmp_path, tmp_path / "out")


def test_no_folder_is_one_clear_line(tmp_path, monkeypatch):
    monkeypatch.delenv("BRICKPILOT_DATA", raising=False)
    done = lab("real", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "lab: FOLDER: no data: name a folder of data sets, or set BRICKPILOT_DATA to one\n"


def test_peers_run_on_a_folder_and_keep_the_rest(tmp_path):
    motor_set(tmp_path / "sets")
    kept = {
        "name": "bench",
        "figure": real_score.FIGURE,
        "discover": {"error": "kept"},
        "roles": {"fit": 3, "held_out": 1},
    }
    real_results.save({"bench": kept}, tmp_path / "r.json")
    done = lab(
        "real", "sets", "--part", "peers", "--peer", "WPILib kS/kV/kA", "--results", "r.json", "--json",
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (one,) = json.loads(done.stdout)["logs"]
    assert one["discover"] == {"error": "kept"}
    assert one["peers"]["WPILib kS/kV/kA"]["held_out"]["speed"] > 90
    assert real_results.load(tmp_path / "r.json")["bench"] == one


def test_hidden_test_is_fitted_without_its_run(tmp_path):
    pytest.importorskip("nonlinear_benchmarks")
    test = real_logs.HiddenTest("r3", "speed", 20, "a paper", "rad/s", 1.0, "0.1 rad/s")
    work = real_run.Work(discover=False, peers=PEERS[1:2])
    data = motor_set(tmp_path / "a")
    roles = Roles({run.name: "held_out" if run.name == "r3" else "fit" for run in data.runs}, "")
    predicted = PEERS[1].load()(data, roles)
    found = real_run._tested(data, test, work, {}, lambda *_: None)[PEERS[1].name]["rmse"]
    exact = np.sqrt(np.mean((data.runs[3].outputs["speed"] - predicted["r3"]["speed"])[20:] ** 2))
    assert found == pytest.approx(exact, rel=1e-5)
    assert 0 < found < 0.5


def a_result(name="bench", verdict="named", before=40.0, after=90.0, peer=80.0, attainable=95.0):
    said = {
        "verdict": verdict, "mechanism": None, "evidence": None, "term": None, "seconds": 3.0, "version": "0",
        "effects": [
            {"name": "coulomb_friction", "mechanism": "bearing", "claimed": verdict == "named", "confidence": 1.0,
             "parameters": {}, "equivalents": []}
        ],
        "fit": {"before": {"fit": {"pooled": before}, "held_out": {"pooled": before, "speed": before}},
                "after": {"fit": {"pooled": after}, "held_out": {"pooled": after, "speed": after}},
                "predictor": {"fit": {"pooled": 99.0}, "held_out": {"pooled": 99.0, "speed": 99.0}}},
        "attainable": {"fit": {}, "held_out": {"speed": attainable, "not measured": 10.0}},
    }  # fmt: skip
    peers = {PEERS[0].name: {"fit": {"pooled": peer}, "held_out": {"pooled": peer}, "seconds": 1.0}}
    return {"name": name, "roles": {"fit": 3, "held_out": 1}, "discover": said, "peers": peers}


def test_summary_counts_wins_and_what_was_removed():
    results = [a_result(), a_result("b", "unknown", after=70.0), a_result("c", before=60.0, after=50.0)]
    said = "\n".join(real_table.summary(results, {}))
    assert f"better than {PEERS[0].name} on 1 of 3" in said
    assert "predictor of `discover` is better than the best peer on 3 of 3" in said
    assert "no worse than the calibrated nominal model on 2 of 3" in said
    share = (0.6**2 - 0.1**2) / (0.6**2 - 0.05**2)
    grown = (0.4**2 - 0.5**2) / (0.4**2 - 0.05**2)
    assert f"median {50 * (share + grown):.0f} %, least {100 * grown:.0f} %, of 2 logs" in said


def test_figures_of_an_older_kind_are_told_from_those_of_now():
    old, now = a_result(), a_result("b") | {"figure": real_score.FIGURE}
    assert "The figures of 1 logs are still of an older kind" in "\n".join(real_table.summary([old, now], {}))
    assert "older kind" not in "\n".join(real_table.summary([now], {}))


def test_table_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{real_table.BEGIN}\nold\n{real_table.END}\nafter\n")
    text = list(real_table.lines({"bench": a_result()}, {}))
    real_table.write_between_marks(page, text)
    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("\nafter\n")
    assert real_table.between_marks(page) == text
    page.write_text("no marks")
    with pytest.raises(InputError, match="once each"):
        real_table.write_between_marks(page, text)


def test_table_of_the_manual_is_that_of_the_kept_results():
    kept = real_results.load(real_results.KEPT)
    assert len(kept) >= 10
    wanted = list(real_table.lines(kept, real_logs.by_name()))
    assert real_table.between_marks(PAGE) == wanted, (
        "run: sh tests/lab/run real --part none --results tests/lab/real_results.json --write tools/docs/benchmarks.md"
    )
    changed = {name: dict(one) for name, one in kept.items()}
    first = next(iter(changed))
    changed[first]["discover"] = {}
    assert list(real_table.lines(changed, real_logs.by_name())) != wanted


def test_a_table_says_of_which_commits_its_results_are():
    if (PAGE.parents[2] / ".git").exists():
        assert re.fullmatch(r"`[0-9a-f]{7,}`(, changed,)? of \d{4}-\d\d-\d\d", measured.state())
    assert (
        measured.told(["`a` of d", "`b` of d", "`a` of d"], "logs")
        == "measured at `a` of d (2 logs), `b` of d (1 logs)"
    )
    assert measured.told(["`a` of d", "`a` of d"], "logs") == "measured at `a` of d"
    assert measured.told([None], "logs") == f"measured at {measured.UNKNOWN}"
    assert measured.UNKNOWN not in "\n".join(real_table.lines(real_results.load(real_results.KEPT), {}))


def test_the_page_has_the_table_of_the_kept_gains():
    begin, end = tune_study.MARKS
    shown = PAGE.read_text(encoding="utf-8").partition(f"{begin}\n")[2].partition(f"\n{end}")[0]
    assert shown.splitlines() == tune_study.table()


def test_damaged_results_are_refused(tmp_path):
    path = tmp_path / "r.json"
    path.write_text('{"logs": [')
    with pytest.raises(InputError, match="not a file of results"):
        real_results.load(path)


def test_what_is_attainable_is_read_from_the_verdict():
    free = {"before": 1.0, "after": 2.0, "attainable": None, "held_out": {"attainable": 95.4321987}}
    found = real_run._attainable({"speed": {"free_run": free, "1_s": {"attainable": 7.0}}, "angle": {}})
    assert found == {"fit": {}, "held_out": {"speed": 95.4322}}


def test_finding_without_a_number_is_valid_json():
    value = real_run._value({"value": math.nan, "unit": "V", "ci95": (1.0, math.inf)})
    assert value == {"value": None, "unit": "V", "ci95": [1.0, None]}
    assert dataclasses.asdict(real_run.Work())["seed"] == 0
