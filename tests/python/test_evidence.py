"""The last check: held-out runs confirm a model, say nothing of it, or speak against it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from brickpilot.data import dataset
from brickpilot.discover import gates
from brickpilot.discover.evidence import HeldOutChange, _sentence
from brickpilot.discover.pipeline import discover
from brickpilot.discover.predictability import settled
from brickpilot.discover.yardstick.record import Predictable, Yardstick
from synthetic import robot, write

CHANGE = HeldOutChange(before=1000.0, after=300.0, claimed=700.0, least=12.0, noise=290.0, draws=1.0)
NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
NOMINAL = "\n".join(
    f"{name} = {{ value = {robot().parameters[name]}, sd = {robot().parameters[name] * 0.02} }}"
    for name in ("mass", "yaw_inertia", "wheel_radius", "half_track", "resistance", "torque_constant", "emf_constant")
)


@pytest.mark.parametrize(
    ("change", "error", "falls", "partly", "said"),
    [
        (CHANGE, 0.5, True, False, "confirm"),
        (CHANGE, 0.5, True, True, "little of the error"),
        (dataclasses.replace(CHANGE, claimed=5.0, before=301.0), 1.0, False, False, "do not excite"),
        (dataclasses.replace(CHANGE, after=900.0), 0.9, True, False, "contradict"),
        (dataclasses.replace(CHANGE, after=1100.0), 0.9, True, False, "contradict"),
        (CHANGE, 0.7, False, False, "as a whole does not fall"),
        (CHANGE, 1.01, True, False, "grows"),
        (dataclasses.replace(CHANGE, claimed=5.0), 1.01, False, False, "do not excite"),
        (dataclasses.replace(CHANGE, claimed=5.0), gates.FREE_RUN_GROWS + 0.01, False, False, "grows"),
    ],
)
def test_each_objection_of_the_held_out_runs_is_said(
    change: HeldOutChange, error: float, falls: bool, partly: bool, said: str
) -> None:
    assert said in _sentence(change, error, falls=falls, partly=partly)


def test_the_removed_share_is_negative_where_the_cost_grows() -> None:
    assert dataclasses.replace(CHANGE, after=1355.0).removed == pytest.approx(-0.5)
    assert dataclasses.replace(CHANGE, noise=1000.0).removed is None


def test_an_effect_of_the_fit_runs_alone_is_not_named(tmp_path: Path) -> None:
    """The held-out run is that of a robot without the effect: what explains the fit runs makes it worse."""
    moves = {"straight": (4.0, 4.0), "straight_back": (-5.0, -5.0), "spin": (4.0, -4.0), "again": (5.0, 5.0)}
    roles = ["fit", "fit", "fit", "held_out"]
    with_friction = dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": 0.012}})
    told = {"manoeuvres": moves, "roles": roles}
    honest = write(tmp_path / "honest", with_friction, NOISE, NOMINAL, **told)
    without = write(tmp_path / "without", robot(), NOISE, NOMINAL, **told)
    found = discover(dataset.read(honest), jobs=1)
    assert found.verdict == "named"
    assert found.evidence is not None
    assert found.evidence.kind == "held_out"
    assert all(one.claimed for one in found.effects)

    (honest / "again.csv").write_bytes((without / "again.csv").read_bytes())
    swapped = discover(dataset.read(honest), jobs=1)
    assert swapped.verdict == "unknown"
    assert not any(one.claimed for one in swapped.effects)
    assert "coulomb_friction" in {name for rank in swapped.ranking for name in rank.names}
    gap = swapped.gap["held_out"]
    assert gap.before is not None
    assert gap.after is not None
    assert gap.after <= gap.before


def _yardstick(low: float | None) -> Yardstick:
    interval = None if low is None else (low, 1.0)
    return Yardstick(predictable={"free_run": Predictable(0.5, interval, 0.5, interval, None, None, {}, ())})


@pytest.mark.parametrize(
    ("kind", "low", "settles"),
    [
        ("unknown", 0.5, "unknown"),
        ("unknown", -0.1, "none"),
        ("unknown", None, "unknown"),
        ("none", 0.1, "none"),
        ("none", 0.5, "unknown"),
        ("named", -0.1, "named"),
    ],
)
def test_something_is_missing_if_the_error_is_predictable(kind: str, low: float | None, settles: str) -> None:
    verdict = SimpleNamespace(best=SimpleNamespace(chosen=()), unclaimed=None, removed_by=lambda _: np.nan)
    written = SimpleNamespace(kind=kind, composed=None)
    assert settled(verdict, written, _yardstick(low)) == settles  # type: ignore[arg-type]
