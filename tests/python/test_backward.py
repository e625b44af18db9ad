"""What a model does not need is removed, in whatever order it was found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from brickpilot.discover import backward
from brickpilot.fit import uncertainty

FLOOR = 2500.0
COSTS = {(): 35_000.0, ("lag",): 12_000.0, ("slip",): 1_150.0, ("lag", "slip"): 1_030.0}
"""Penalised costs: the slip takes 33,850 away, and the lag 120 beside it: a law that is a little off leaves as much."""


def model(*names: str, gain: float = 0.0) -> Any:
    cost = COSTS[names] - gain
    return SimpleNamespace(names=names, chosen=names, cost=cost, penalised_cost=cost)


@pytest.fixture
def error(monkeypatch) -> Any:
    monkeypatch.setattr(backward, "largest_prior_shift", lambda _, one: 0.0)
    monkeypatch.setattr(backward, "without", lambda found, one: model(*(name for name in found.names if name != one)))
    monkeypatch.setattr(backward, "refine", lambda _, found, jobs: sorted(found, key=lambda one: one.penalised_cost))
    return SimpleNamespace(floor_cost=lambda: FLOOR)


def test_what_gains_little_of_what_a_later_effect_took_away_is_needless(error):
    assert backward.prune(error, model(), model("lag", "slip"), 1).names == ("slip",)


def test_what_gains_more_than_that_stays(error):
    assert backward.prune(error, model(), model("lag", "slip", gain=100.0), 1).names == ("lag", "slip")


def test_candidates_of_the_model_that_the_search_began_with_stay(error):
    assert backward.prune(error, model("lag"), model("lag", "slip"), 1).names == ("lag", "slip")


def test_a_parameter_that_one_stretch_alone_tells_spoils_no_other_interval():
    rng = np.random.default_rng(0)
    slopes = np.column_stack([rng.normal(size=400), np.where(np.arange(400) < 10, 4e3, 0.0)])
    error = rng.normal(size=400)
    curvature = np.linalg.inv(slopes.T @ slopes + np.diag([0.0, 1e-9]))
    problem: Any = SimpleNamespace(stretches=lambda least: (np.arange(400) // 10, 40))
    scatter, degrees = uncertainty._scatter(problem, slopes * error[:, None], slopes, slopes, curvature)
    assert degrees == 38
    assert np.sqrt(scatter[0, 0]) == pytest.approx(0.05, rel=0.3)
    assert np.linalg.eigvalsh(scatter).min() > -1e-12 * scatter.max()
    assert scatter[1, 1] > 1e3 * curvature[1, 1]
