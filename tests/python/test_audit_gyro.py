"""The audit compares gyro and wheels: turns show a mirrored gyro; turns beyond a gyro's range determine no geometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.audit.contradictions import _turned
from brickpilot.data.audit.relations import Geometry
from brickpilot.data.audit.view import cut
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from test_audit import found

Table = dict[str, np.ndarray]

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
TURNS = {
    "ahead": (5.0, 5.0), "slow_spin": (1.5, -1.5), "slow_left": (-1.5, 1.5), "spin": (6.0, -6.0), "left": (-6.0, 6.0),
    "curve": (6.0, 3.0),
}  # fmt: skip


def written(folder: Path, spoil, *runs: str) -> Dataset:
    manoeuvres = {name: volts for name, volts in TURNS.items() if not runs or name in runs}
    return read(synthetic.write(folder, synthetic.robot(), NOISE, "", manoeuvres=manoeuvres, spoil=spoil))


def saturate(limit: float):
    """Returns a function that cuts a table's gyro at `limit` rad/s and adds noise, so that no plateau shows it."""

    def spoil(_: str, table: Table) -> None:
        noise = np.random.default_rng(1).normal(0.0, 0.014, len(table["t"]))
        table["yaw_rate"] = np.clip(table["yaw_rate"], -limit, limit) + noise

    return spoil


def learnt(data: Dataset) -> float:
    """Returns the ratio of yaw rate to difference of the wheel speeds that the audit finds."""
    windows = {k: cut(run.time, run.raw_outputs) for k, run in enumerate(data.runs)}
    return _turned(windows, list(NOISE), Geometry(None, None, {}))["yaw_rate", "speed"]


@pytest.mark.parametrize("runs", [tuple(TURNS), ("spin",), ("slow_left", "curve")])
def test_a_mirrored_gyro_is_found_in_the_turns(runs: tuple[str, ...], tmp_path: Path) -> None:
    def mirror(run: str, table: Table) -> None:
        if run in runs:
            table["yaw_rate"] *= -1.0

    assert {(one[1], one[2]) for one in found(written(tmp_path / "s", mirror))} == {("yaw_rate", "sign")}


def test_a_mirrored_gyro_is_found_although_it_saturates(tmp_path: Path) -> None:
    def mirror(run: str, table: Table) -> None:
        saturate(4.0)(run, table)
        table["yaw_rate"] *= -1.0

    assert {(one[1], one[2]) for one in found(written(tmp_path / "s", mirror))} == {("yaw_rate", "sign")}


@pytest.mark.parametrize("limit", [3.0, 5.0])
def test_geometry_comes_from_turns_below_saturation(limit: float, tmp_path: Path) -> None:
    mostly_fast = ("slow_spin", "spin", "left")
    true = learnt(written(tmp_path / "true", lambda *_: None, *mostly_fast))
    parameters = synthetic.robot().parameters
    assert true == pytest.approx(parameters["wheel_radius"] / (2 * parameters["half_track"]), rel=0.15)
    data = written(tmp_path / "saturated", saturate(limit), *mostly_fast)
    assert learnt(data) == pytest.approx(true, rel=0.12)
    assert not {one for one in found(data) if one[2] in ("unit", "sign")}


def test_a_gyro_that_agrees_has_no_fault(tmp_path: Path) -> None:
    assert written(tmp_path / "s", lambda *_: None).faults == ()
