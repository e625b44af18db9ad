"""The fit keeps each direction, each manoeuvre and the largest input; a note says what is held out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.holdout import Roles, assign, manoeuvre
from brickpilot.data.reading import read
from brickpilot.discover import seal
from brickpilot.discover.prepare import prepare
from brickpilot.fit.blocks import Bins, blocks
from brickpilot.importers.split import manoeuvres
from brickpilot.vehicle import model as model_file
from test_measured import DATA

Array = np.ndarray

NOISE = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "yaw_rate": 0.01}


def written(folder: Path, manoeuvres: Mapping[str, tuple[float, float]], *, stretch: float = 1.0) -> Dataset:
    """Returns the runs of `synthetic`, 2 s each, with all times multiplied by `stretch`."""

    def slow(_: str, table: dict[str, Array]) -> None:
        table["t"] = table["t"] * stretch

    options = {"manoeuvres": manoeuvres, "roles": [""] * len(manoeuvres), "spoil": slow}
    return read(synthetic.write(folder, synthetic.robot(), NOISE, "mass = 0.6", **options))


def roles_of(data: Dataset, *, stretches: bool = False) -> Roles:
    return assign(data, {run.name: motor_inputs(run, data) for run in data.runs}, stretches=stretches)


def driven(run: Run, data: Dataset) -> Array:
    return np.nan_to_num(motor_inputs(run, data))


@pytest.mark.parametrize(
    ("left", "right", "kind"),
    [
        (5, 5, "straight step forward"), (-5, -5, "straight step backward"), (5, -5, "spin step right"),
        (-5, 5, "spin step left"), (6, 3, "curve step forward, left wheel faster"),
        (3, 6, "curve step forward, right wheel faster"), (-6, -3, "curve step backward, left wheel faster"),
        (0, 0, "rest"),
    ],
)  # fmt: skip
def test_a_manoeuvre_has_a_kind_and_a_direction(left: float, right: float, kind: str) -> None:
    assert manoeuvre(np.full((50, 2), [left, right], dtype=float)) == kind
    if left == right:
        assert manoeuvre(np.full((50, 1), left, dtype=float)) == kind.removeprefix("straight ")


@pytest.mark.parametrize("ratio", np.round(np.linspace(-1.0, 1.0, 21), 2).tolist())
def test_import_check_and_hold_out_call_a_manoeuvre_by_one_name(ratio: float) -> None:
    """All three use the same limit between a straight run and a curve."""
    time = np.arange(0.0, 3.0, 0.01)
    volts = np.where((time > 1.0) & (time < 2.0), 5.0, 0.0)
    inputs = {"voltage_left": volts, "voltage_right": ratio * volts}
    ((imported, _),) = manoeuvres(time, inputs)
    assert manoeuvre(np.column_stack(list(inputs.values()))).split()[0] == imported
    mixed = {"duty_mean": (1 + ratio) / 2 * volts / 9, "duty_diff": (1 - ratio) * volts / 9}
    assert manoeuvres(time, mixed)[0][0] == imported


def test_the_only_curve_is_not_taken_for_a_straight_run_and_held_out(tmp_path: Path) -> None:
    four = {"ahead": (5.0, 5.0), "back": (-4.0, -4.0), "spin": (3.0, -3.0), "curve": (5.0, 2.9)}
    data = written(tmp_path / "s", four)
    assert manoeuvre(driven(data.runs[3], data)) == "curve step forward, left wheel faster"
    assert roles_of(data).held_out() == []


def test_what_occurs_once_in_a_direction_is_fitted(tmp_path: Path) -> None:
    once = {"ahead": (5.0, 5.0), "back": (-5.0, -5.0), "right": (4.0, -4.0), "left": (-4.0, 4.0), "curve": (6.0, 3.0)}
    roles = roles_of(written(tmp_path / "s", once))
    assert roles.held_out() == []
    assert "each manoeuvre occurs once in a direction" in roles.note


@pytest.mark.parametrize("sign", [1, -1])
def test_of_several_runs_in_one_direction_neither_the_largest_nor_the_smallest_is_held_out(
    sign: int, tmp_path: Path
) -> None:
    many = {f"run_{k}": (sign * (1.0 + k), sign * (1.0 + k)) for k in range(7)} | {"other": (-sign * 8.0, -sign * 8.0)}
    assert roles_of(written(tmp_path / "s", many)).held_out() == ["run_1", "run_4"]


def test_of_two_runs_the_smaller_is_held_out_if_it_is_much_like_the_larger(tmp_path: Path) -> None:
    alike = roles_of(written(tmp_path / "alike", {"one": (5.0, 5.0), "other": (4.5, 4.5)}))
    unlike = roles_of(written(tmp_path / "unlike", {"one": (5.0, 5.0), "other": (1.0, 1.0)}))
    assert (alike.held_out(), unlike.held_out()) == (["other"], [])


def test_the_last_drive_of_a_run_is_held_out_and_how_it_stops_is_fitted(tmp_path: Path) -> None:
    data = written(tmp_path / "s", {"ahead": (5.0, 5.0), "back": (-5.0, -5.0)}, stretch=4.0)
    roles = roles_of(data, stretches=True)
    assert roles.held_out() == []
    assert roles.tested() == ["ahead", "back"]
    for run in data.runs:
        inside = np.isfinite(roles.samples(run, "held_out").outputs["yaw_rate"])
        outside = np.isfinite(roles.samples(run, "fit").outputs["yaw_rate"])
        assert np.array_equal(inside, ~outside)
        used = np.sum(driven(run, data) ** 2, axis=1)
        assert used[inside].sum() == pytest.approx(0.25 * used.sum(), rel=0.05)
        assert outside[-1]  # the motors are shorted there
    assert "the last part of the drive in ahead, back" in roles.note


def test_a_stretch_leaves_half_of_each_direction_in_the_fit(tmp_path: Path) -> None:
    data = written(tmp_path / "s", {"both": (5.0, 5.0)}, stretch=4.0)
    run = data.runs[0]
    back = run.time > run.time[0] + 4.6  # a quarter of the drive, at its end
    volts = driven(run, data)
    volts[back] *= -1.0
    roles = assign(data, {run.name: volts}, stretches=True)
    fitted = np.isfinite(roles.samples(run, "fit").outputs["yaw_rate"])
    assert np.sum(volts[fitted & (volts[:, 0] < 0), 0]) <= 0.5 * np.sum(volts[volts[:, 0] < 0, 0])


def test_what_is_held_out_is_compared_and_not_fitted(tmp_path: Path) -> None:
    data = written(tmp_path / "s", {"ahead": (5.0, 5.0), "back": (-5.0, -5.0)}, stretch=4.0)
    prepared, sealed = prepare(data, None, seed=0, jobs=1)
    held_out = seal._held_out(prepared, sealed.open())
    assert held_out is not None
    fitted = {(block.run, round(float(at), 6)) for block in prepared.fine.blocks for at in block.middle}
    tested = {(block.run, round(float(at), 6)) for block in held_out.blocks for at in block.middle}
    assert tested
    assert not fitted & tested


def test_a_hole_in_a_run_is_no_change_from_bin_to_bin(tmp_path: Path) -> None:
    def hide(_: str, table: dict[str, Array]) -> None:
        table["wheel_angle_left"][60:120] = np.nan

    noise = {"wheel_angle_left": 0.001, "wheel_angle_right": 0.001}
    options = {"manoeuvres": {"ahead": (5.0, 5.0)}, "roles": ["fit"], "spoil": hide}
    data = read(synthetic.write(tmp_path / "s", synthetic.robot(), noise, "mass = 0.6", **options))
    found, _ = blocks(data, model_file.rcx(), {"ahead"}, Bins(0.03))
    changes = {block.signal: np.abs(block.measured).max() for block in found}
    assert changes["wheel_angle_left"] <= 1.05 * changes["wheel_angle_right"]


@pytest.mark.skipif(not (DATA / "lego_ev3_motor").is_dir(), reason=f"no measured sets in {DATA}")
def test_a_lego_motor_is_fitted_at_its_least_and_its_largest_duty_in_both_directions() -> None:
    roles = roles_of(read(DATA / "lego_ev3_motor"))
    assert roles.held_out() == ["duty_m40", "duty_40"]
