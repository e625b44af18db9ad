"""The audit finds a collision only where a vehicle loses speed at a constant command; no window starts at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.data.motion import cut_into_windows
from brickpilot.data.reading import read
from test_audit import ALL, NOISE, found, needs_data
from test_measured import DATA

Table = dict[str, np.ndarray]

WHEELS = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
AHEAD = {"ahead": (6.0, 6.0), "back": (-5.0, -5.0)}


def stop(table: Table, at: float, *, over: float = 0.03, left: float = 0.1, sides: tuple[str, ...] = ("left", "right")):
    """Slows the wheels down from `at` s on: `over` s later they have the share `left` of their speed."""
    share = np.interp(table["t"], [at, at + over], [1.0, left])
    for side in sides:
        table[f"wheel_speed_{side}"] *= share


def written(folder: Path, spoil, manoeuvres=AHEAD) -> Dataset:
    return read(synthetic.write(folder, synthetic.robot(), WHEELS, "mass = 0.6", manoeuvres=manoeuvres, spoil=spoil))


@pytest.mark.parametrize("run", ["ahead", "back"])
@pytest.mark.parametrize("left", [-0.3, 0.0, 0.4])
def test_a_vehicle_that_runs_into_something_is_found_and_the_rest_of_its_run_left_out(
    run: str, left: float, tmp_path: Path
) -> None:
    data = written(tmp_path / "s", lambda name, table: stop(table, 0.8, left=left) if name == run else None)
    assert {(one[0], one[2]) for one in found(data)} == {(run, "collision")}
    hit = next(one for one in data.runs if one.name == run)
    known = hit.time[np.isfinite(hit.outputs["wheel_speed_left"])]
    assert known[-1] == pytest.approx(0.75, abs=0.06)
    assert np.isfinite(hit.raw_outputs["wheel_speed_left"]).all()
    assert any("as in a collision" in note for note in data.notes)


@pytest.mark.parametrize("why", ["slowly", "a little", "a rough patch", "one wheel", "at the end of the drive"])
def test_a_loss_of_speed_that_has_another_reason_is_no_collision(why: str, tmp_path: Path) -> None:
    def slow(name: str, table: Table) -> None:
        if name == "ahead" and why == "slowly":
            stop(table, 0.5, over=0.8, left=0.2)
        elif name == "ahead" and why == "a little":
            stop(table, 0.8, left=0.75)
        elif name == "ahead" and why == "a rough patch":
            stop(table, 0.8, over=0.08, left=0.55)
        elif name == "ahead" and why == "one wheel":
            stop(table, 0.8, sides=("left",))
        elif name == "ahead":
            stop(table, 1.4, left=0.0)

    assert not {one for one in found(written(tmp_path / "s", slow)) if one[2] == "collision"}


def test_ordinary_manoeuvres_hold_no_collision(tmp_path: Path) -> None:
    folder = synthetic.write(tmp_path / "s", synthetic.robot(), NOISE, "mass = 0.6", manoeuvres=ALL)
    assert read(folder).faults == ()


def test_no_window_starts_at_rest_or_after_a_collision(tmp_path: Path) -> None:
    manoeuvres = AHEAD | {"rest": (0.0, 0.0), "creep": (0.7, 0.7)}
    data = written(tmp_path / "s", lambda n, table: stop(table, 0.8, left=0.0) if n == "ahead" else None, manoeuvres)
    cut = cut_into_windows(data, {run.name: motor_inputs(run, data) for run in data.runs}, 0.25)
    assert cut is not None
    starts = {name: [run.time[0] for run in cut.runs if run.name.startswith(name)] for name in manoeuvres}
    assert 2 <= len(starts["ahead"]) <= 4
    assert max(starts["ahead"]) < 0.8
    assert len(starts["back"]) == 8
    assert starts["rest"] == []
    assert len(starts["creep"]) >= 5


@needs_data
def test_three_of_the_four_straight_runs_of_a_mouse_end_in_a_collision() -> None:
    data = read(DATA / "micromouse")
    assert {fault.run for fault in data.faults if fault.kind == "collision"} == {"t0_3", "t0_4", "t0_4_2"}
    assert not {fault.run for fault in read(DATA / "linear_axis").faults}
