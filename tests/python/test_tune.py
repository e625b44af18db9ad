"""`brickpilot tune`: gains for the robots that the data allow, judged on other robots, kept only if better."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuned
from brickpilot.campaign import workers
from brickpilot.tune import task, tuner
from brickpilot.tune import tuner as judging
from brickpilot.tune.page import page, sentence
from brickpilot.tune.task import Outcome, Scale, score
from brickpilot.tune.tuner import JUDGE, SCALE, judge, rate, to_json, tune
from brickpilot.vehicle import gains, model, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.settings import defaults, settings
from command import brickpilot
from pages import assert_self_contained, figures

BY = Scale(acceptance=0.1, time=20.0, wear=30.0, longest=60.0)
GOOD = Outcome(True, 0.0, 0.03, 20.0, 30.0, "")
BAD = Outcome(False, 0.25, 0.05, float("nan"), 30.0, "time ran out")


@pytest.fixture(scope="module")
def poor(tmp_path_factory: pytest.TempPathFactory) -> tuned.Tuned:
    return tuned.poor(tmp_path_factory.mktemp("tuned"))


def test_a_poor_start_is_made_good_for_robots_that_the_search_has_not_flown(poor: tuned.Tuned) -> None:
    judged = poor.judged
    assert judged.rate_before.successes < 0.2 * tuned.JUDGES
    assert judged.rate_after.successes > 0.9 * tuned.JUDGES
    assert judged.better
    assert not poor.kept_start
    assert sentence(poor).endswith(" The share of robots that arrive and score got better.")
    assert dict(poor.gains) == dict(poor.found) != dict(poor.problem.start)
    for name, low, high in zip(poor.space.names, poor.space.low, poor.space.high, strict=True):
        assert low <= poor.found[name] <= high
        settings()[name].check(poor.found[name])


def test_the_same_seed_gives_the_same_gains_on_processes_and_another_seed_others(
    poor: tuned.Tuned, tmp_path: Path
) -> None:
    options = {"robots": tuned.ROBOTS, "judges": 20, "budget": tuner.Budget(11, None), "show": lambda *_: None}
    here, there = (tune(poor.problem, who, **options) for who in (tuned.Here(), workers.Local(2)))
    assert to_json(here) == to_json(there)
    other = dataclasses.replace(poor.problem, seed=1)
    assert to_json(tune(other, tuned.Here(), **options))["gains"] != to_json(here)["gains"]


def test_all_sets_of_a_generation_are_flown_by_the_same_robots_and_the_next_by_others(tmp_path: Path) -> None:
    given = tuned.ready(tmp_path)
    with tuner.flyer(given, tuned.Here(), lambda _: None) as fly:
        one, other = fly.fly([given.start, given.start], tuner.SEARCH, range(10))
        assert one == other
        assert len(set(one)) == 10
        assert not set(fly.fly([given.start], tuner.SEARCH, range(10, 20))[0]) & set(one)
        assert not set(fly.fly([given.start], JUDGE, range(10))[0]) & set(one)
        assert fly.fly([given.start], tuner.SEARCH, [3])[0] == one[3:4]


def test_gains_that_are_not_better_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = tuned.ready(tmp_path)
    worse = {**given.start, "heading_kp": 90, "heading_ki": 0, "pivot": 15000}
    monkeypatch.setattr("brickpilot.tune.tuner.search", lambda *_: tuner.Searched(worse, ()))
    kept = tune(given, tuned.Here(), robots=4, judges=20, budget=tuned.BUDGET, show=lambda *_: None)
    assert kept.kept_start
    assert dict(kept.gains) == given.start
    assert kept.judged.is_worse_in_success
    assert "The gains found are not better beyond chance, so the gains before are kept." in page(kept, "again")


def test_the_judge_counts_pairs_and_gives_wilsons_interval() -> None:
    before = [GOOD] * 90 + [BAD] * 10
    after = [BAD] * 2 + [GOOD] * 98
    found = judge(before, after, BY, 0)
    assert (found.gained, found.lost) == (10, 2)
    assert found.p == pytest.approx(2 * sum((1, 12, 66)) / 2**12)  # C(12, n)
    z, share = 1.959964, 0.9
    middle, half = share + z * z / 200, z * np.sqrt(share * 0.1 / 100 + z * z / 40000)
    assert (found.rate_before.low, found.rate_before.high) == pytest.approx(
        ((middle - half) / (1 + z * z / 100), (middle + half) / (1 + z * z / 100)), rel=1e-5
    )
    assert found.better
    assert not judge(after, before, BY, 0).better
    same = judge(before, before, BY, 0)
    assert (same.better, same.p, same.changes[0].low, same.changes[0].high) == (False, 1.0, 0.0, 0.0)


def test_the_resamples_have_random_numbers_that_no_robot_has(monkeypatch: pytest.MonkeyPatch) -> None:
    seen, of_scipy = [], judging.bootstrap

    def watched(*given: Any, rng: np.random.Generator, **more: Any) -> Any:
        seen.append(np.random.default_rng(rng.bit_generator.seed_seq).random())  # type: ignore[attr-defined]
        return of_scipy(*given, rng=rng, **more)

    monkeypatch.setattr(judging, "bootstrap", watched)
    judge([GOOD, BAD, GOOD, GOOD], [GOOD, GOOD, BAD, GOOD], BY, 5)
    of_robots = {
        np.random.default_rng(np.random.SeedSequence(5, spawn_key=(stream, place))).random()
        for stream in (tuner.SEARCH, SCALE, JUDGE)
        for place in range(100)
    }
    assert seen
    assert not of_robots & set(seen)


def test_intervals_of_paired_differences_cover_the_truth_as_often_as_they_say() -> None:
    random, covered = np.random.default_rng(0), 0
    for seed in range(100):
        robots = random.gamma(4.0, 0.01, 80)  # some robots are hard for both gain sets
        before = [GOOD._replace(cross_track=one) for one in robots]
        after = [
            GOOD._replace(cross_track=max(one - 0.003 + e, 0.0))
            for one, e in zip(robots, random.normal(0, 0.002, 80), strict=True)
        ]
        change = judge(before, after, BY, seed).changes[1]
        covered += change.low <= -0.003 <= change.high
    assert 88 <= covered <= 100


def test_success_comes_first_in_the_score() -> None:
    slow = GOOD._replace(cross_track=0.2, time=60.0, wear=120.0)
    assert score(GOOD, BY) == pytest.approx(0.3 + 0.5 + 0.1)
    assert score(BAD._replace(missed=0.125), BY) > score(slow, BY) + 10 * score(GOOD, BY)
    assert score(GOOD._replace(success=False), BY) > score(slow, BY)  # a fault after the last waypoint
    diverged = Outcome(False, 1.0, float("nan"), float("nan"), float("nan"), "the simulation diverged")
    assert np.isfinite(score(diverged, BY))
    assert score(diverged, BY) > task.MISSED
    assert rate([GOOD, BAD]).share == 0.5


def test_the_space_holds_raw_integers_in_their_ranges_and_no_pair_in_contradiction() -> None:
    firmware = dict(defaults("coupled"))
    start = {name: firmware[name] for name in task.TUNED}
    start |= {"speed_kp": 0, "heading_ki": 32767}
    around = task.around(start, firmware)
    assert around.raw(around.coordinates(start)) == start
    random = np.random.default_rng(0)
    low, high = around.bounds()
    for _ in range(300):
        raw = around.raw(random.uniform(low - 1, high + 1))
        for name, value in raw.items():
            assert isinstance(value, int)
            settings()[name].check(value)
        assert raw["align"] <= raw["pivot"]
        assert raw["cruise"] >= settings()["cruise"].raw(settings()["creep"].value(firmware["creep"]))
    assert around.raw(high)["speed_kp"] > 100  # a gain that is 0 at the start can grow
    assert around.raw(high)["heading_ki"] == 32767


def test_the_page_has_before_and_after_and_every_gain(poor: tuned.Tuned) -> None:
    html = page(poor, "brickpilot tune --model bench.toml")
    assert_self_contained(html)
    assert "<script>alert" not in html
    drawn = figures(html)
    assert len([name for name in drawn if name.startswith("tracks of")]) >= 2
    assert "gains after over those before, in the ranges searched" in drawn
    for name in poor.space.names:
        assert f"<td>{name}</td>" in html
    assert re.search(r"60 robots fly the mission only with the gains found, 0 only with those before", html)


def test_the_command_writes_gains_that_run_flies(tmp_path: Path) -> None:
    model.save(dataclasses.replace(rcx(), name="bench"), tmp_path / "bench.toml")
    (tmp_path / "short.toml").write_text(tuned.SHORT)
    words = ("--model", "bench.toml", "--board", "packaged", "--scenario", "short.toml", "--robots", "4")
    done = brickpilot(
        "tune", *words, "--judges", "20", "--budget", "11", "--jobs", "1", "--out", "made", "--json", cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    made = tmp_path / "made"
    assert {path.name for path in made.iterdir()} == {"gains.toml", "mission.toml", "report.html", "summary.json"}
    assert told == json.loads((made / "summary.json").read_text())
    raw = {name: one["raw_before" if told["kept_start"] else "raw_after"] for name, one in told["gains"].items()}
    assert gains.load(made / "gains.toml").raw == raw
    assert told["success"]["after"]["robots"] == 20
    flown = brickpilot("run", "made/mission.toml", "--gains", "made/gains.toml", "--json", cwd=tmp_path)
    assert (flown.returncode, json.loads(flown.stdout)["gains"]) == (0, raw)
    again = scenario.load(made / "mission.toml")
    assert dataclasses.replace(again, packaged=False) == scenario.load(tmp_path / "short.toml")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "tune: needs a robot: --model FILE or --dataset DIR, one of them"),
        (("--model", "a", "--dataset", "b"), "tune: needs a robot: --model FILE or --dataset DIR, one of them"),
        (("--model", "none.toml"), "none.toml: no such file"),
        (("--model", "bench.toml", "--budget", "many"), "--budget many: needs a number of gain sets, as 200, or of"),
        (("--model", "bench.toml", "--budget", "1.5"), "--budget 1.5: needs a number of gain sets"),
        (("--model", "bench.toml", "--board", "packaged", "--scenario", "spin_one_motor"), "is a manoeuvre"),
        (("--model", "bench.toml", "--scheduler", "here"), "--scheduler here: needs the address of a Dask scheduler"),
    ],
)
def test_a_wrong_request_is_one_line_and_leaves_nothing(words: tuple[str, ...], says: str, tmp_path: Path) -> None:
    model.save(dataclasses.replace(rcx(), name="bench"), tmp_path / "bench.toml")
    done = brickpilot("tune", *words, "--out", "made", "--json", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"brickpilot: {says}") or says in done.stderr
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bench.toml"]
