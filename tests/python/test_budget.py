"""A discovery that has to end early reports the work that it left out, and names no effect that it did not compare."""

from __future__ import annotations

import dataclasses
import json
import re
import time
from pathlib import Path
from typing import Any

import pytest
from brickpilot.data import reading
from brickpilot.data.dataset import Dataset
from brickpilot.discover import deadline, pipeline
from brickpilot.discover.deadline import Deadline
from brickpilot.discover.finding import Finding, verdict_json
from command import brickpilot
from synthetic import motor, write

NOMINAL = ("resistance", "torque_constant", "emf_constant", "wheel_inertia", "viscous_friction")
FIRST_EFFECT = "the search for effect 1"
VOLTS = {"low": (3.0, 0.0), "high": (6.0, 0.0), "back": (-5.0, 0.0), "other": (4.0, 0.0)}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Returns data of a motor with dry friction, for which the search is short."""
    known = motor(wheel_inertia=1e-3)
    truth = dataclasses.replace(known, effects={"coulomb_friction": {"torque": 0.02}})
    stated = "\n".join(f"{name} = {known.parameters[name]}" for name in NOMINAL)
    options = {"manoeuvres": VOLTS, "roles": ["fit", "fit", "fit", "held_out"]}
    return reading.read(write(tmp_path_factory.mktemp("data") / "set", truth, {"speed": 0.02}, stated, **options))


@pytest.fixture(scope="module")
def whole(data: Dataset) -> tuple[Finding, float]:
    """The finding without a budget, and the seconds that it took."""
    began = time.perf_counter()
    return pipeline.discover(data, jobs=1), time.perf_counter() - began


def plain(found: Any) -> dict[str, Any]:
    return {key: value for key, value in verdict_json(found).items() if key not in ("elapsed_s", "budget")}


def test_a_budget_that_is_not_used_up_changes_nothing(data: Dataset, whole: tuple[Finding, float]) -> None:
    free, limited = whole[0], pipeline.discover(data, jobs=1, budget_s=1e6)
    assert plain(free) == plain(limited)
    assert verdict_json(free)["budget"] is None
    assert limited.budget is not None
    assert (limited.budget.seconds, limited.budget.exhausted, limited.budget.skipped) == (1e6, False, ())
    assert limited.budget.estimated_s > 0


def test_without_time_the_first_round_is_cut_and_nothing_is_claimed(
    data: Dataset, whole: tuple[Finding, float]
) -> None:
    began = time.perf_counter()
    cut = pipeline.discover(data, jobs=1, budget_s=1e-3)
    assert time.perf_counter() - began < whole[1]
    assert [effect.name for effect in whole[0].effects if effect.claimed] == ["coulomb_friction"]
    assert cut.verdict == "unknown"
    assert not any(effect.claimed for effect in cut.effects)
    assert cut.budget is not None
    assert cut.budget.exhausted
    assert cut.budget.skipped[0] == FIRST_EFFECT
    assert any(note.startswith("The budget of 0.001 s left out: ") for note in cut.notes)


def test_a_deadline_passes_at_its_share_of_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(deadline.time, "perf_counter", lambda: now[0])
    whole = Deadline(10.0, began=100.0)
    half = whole.until(0.5)
    now[0] = 104.9
    assert half.allows("a")
    now[0] = 105.1
    assert not half.allows("b")
    assert whole.allows("c")
    now[0] = 110.1
    assert not whole.allows("d")
    assert list(whole.left_out) == ["b", "d"]
    assert Deadline(None, began=0.0).allows("e")


def test_the_command_prints_the_estimate_and_the_time_left(data: Dataset, tmp_path: Path) -> None:
    ended = brickpilot("discover", str(data.path.parent), "--budget", "0.001", "--out", "out", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    lines = ended.stderr.splitlines()
    assert any(re.fullmatch(r"estimate: \d+ to \d+ s", line) for line in lines)
    found = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert found["budget"]["seconds"] == 0.001
    assert found["budget"]["exhausted"]
    assert found["budget"]["skipped"][0] == FIRST_EFFECT
    refused = brickpilot("discover", str(data.path.parent), "--budget", "0", cwd=tmp_path)
    assert refused.returncode == 2
