"""Rows that repeat a held sample are no new data; a machine that stands is not frozen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.data.motion import cut_into_windows
from brickpilot.data.reading import read
from test_audit import NOISE, TWO, found, needs_data, plant, to_ten_bits
from test_measured import DATA

Table = dict[str, np.ndarray]

WHEELS = ["wheel_speed_left", "wheel_speed_right", "wheel_travel_left", "wheel_travel_right"]


def hold(table: Table, names: list[str], rows: float, *, phase: int = 0) -> np.ndarray:
    """Holds each sample of the columns `names` for `rows` rows; returns the rows of the new samples."""
    place = np.arange(len(table["t"]))
    taken = np.maximum(np.floor((place - phase) / rows) * rows + phase, 0).astype(int)
    for name in names:
        table[name] = table[name][taken]
    return np.unique(taken)


def held(folder: Path, rows: float, names: list[str], **options: object) -> tuple[Dataset, np.ndarray]:
    samples: list[np.ndarray] = []

    def spoil(_: str, table: Table) -> None:
        to_ten_bits(table)
        samples.append(hold(table, names, rows))

    written = synthetic.write(
        folder, synthetic.robot(), NOISE, "mass = 0.6", seed=3, manoeuvres=TWO, spoil=spoil, **options
    )
    return read(written), samples[0]


@pytest.mark.parametrize("rows", [2, 3, 5])
@pytest.mark.parametrize("names", [WHEELS, ["yaw_rate"], ["accel_surge", "accel_sway", "yaw_rate"]])
def test_each_held_sample_is_kept_once_in_its_first_row(rows: int, names: list[str], tmp_path: Path) -> None:
    data, samples = held(tmp_path / "s", rows, names)
    assert data.faults == ()
    run = data.runs[0]
    for name in names:
        kept = np.flatnonzero(np.isfinite(run.outputs[name]))
        assert len(kept) == pytest.approx(len(samples), rel=0.1)
        assert np.mean(np.isin(kept, samples)) > 0.9
        assert np.isfinite(run.raw_outputs[name]).all()
    others = [name for name in run.outputs if name not in names]
    assert all(np.isfinite(run.outputs[name]).all() for name in others)
    assert np.isfinite(run.inputs["voltage_left"]).all()
    told = [note for note in data.notes if "hold a sample" in note]
    assert len(told) == 1
    assert f"{10 * rows} ms" in told[0]


def test_a_beat_that_is_no_whole_number_of_rows_is_found(tmp_path: Path) -> None:
    data, _ = held(tmp_path / "s", 2.5, ["yaw_rate"])
    kept = np.isfinite(data.runs[0].outputs["yaw_rate"])
    assert np.mean(kept) == pytest.approx(0.4, abs=0.03)
    note = next(note for note in data.notes if "hold a sample" in note)
    assert float(note.split(" for ")[1].split()[0]) == pytest.approx(25.0, rel=0.05)


@pytest.mark.parametrize("jitter", [False, True])
def test_what_is_sampled_in_every_row_is_not_held(jitter: bool, tmp_path: Path) -> None:
    for noise in (0.0, 1.0):
        noises = {signal: noise * sd for signal, sd in NOISE.items()}
        folder = synthetic.write(
            tmp_path / f"{noise}", synthetic.robot(), noises, "mass = 0.6", manoeuvres=TWO, jitter=jitter,
            spoil=lambda _, table: to_ten_bits(table),
        )  # fmt: skip
        assert not [note for note in read(folder).notes if "hold a sample" in note]


def test_counts_at_a_constant_speed_change_at_a_beat_and_are_not_held(tmp_path: Path) -> None:
    def count(_: str, table: Table) -> None:
        for side in ("left", "right"):
            table[f"wheel_angle_{side}"] = 0.5 * np.floor(np.arange(len(table["t"])) / 4)

    noise = {"wheel_angle_left": 0.0, "wheel_angle_right": 0.0}
    folder = synthetic.write(
        tmp_path / "s", synthetic.robot(), noise, "mass = 0.6", manoeuvres={"curve": (6.0, 6.0)}, spoil=count
    )
    assert not [note for note in read(folder).notes if "hold a sample" in note]


@pytest.mark.parametrize("what", ["wheel_speed", "wheel_travel"])
def test_a_swapped_row_is_found_among_held_ones_and_no_held_row_is_swapped(what: str, tmp_path: Path) -> None:
    left, right = f"{what}_left", f"{what}_right"

    def spoil(swapped: bool) -> Callable[[Table], None]:
        def change(table: Table) -> None:
            if swapped:
                table[left][99], table[right][99] = table[right][99], table[left][99]
            hold(table, WHEELS, 3)

        return change

    assert plant(tmp_path / "held", spoil(swapped=False)).faults == ()
    assert found(plant(tmp_path / "swapped", spoil(swapped=True))) == {
        ("curve", left, "swapped"), ("curve", right, "swapped"),
    }  # fmt: skip


def test_a_frozen_stretch_is_longer_than_a_held_sample(tmp_path: Path) -> None:
    def freeze(table: Table) -> None:
        table["yaw_rate"][40:130] = table["yaw_rate"][40]
        hold(table, ["yaw_rate"], 3)

    data = plant(tmp_path / "frozen", freeze)
    assert found(data) == {("curve", "yaw_rate", "frozen")}


def still(seconds: float) -> Callable[[str, Table], None]:
    """Returns a function that lets the wheels stand for `seconds` after the voltage step, with speeds of exactly 0."""

    def spoil(_: str, table: Table) -> None:
        for side in ("left", "right"):
            speed = table[f"wheel_speed_{side}"]
            speed += np.random.default_rng(1).normal(0.0, 0.4, len(speed))
            speed[table["t"] < 0.1 + seconds] = 0.0
            speed[:] = np.round(speed, 2)

    return spoil


@pytest.mark.parametrize("seconds", [0.02, 0.15, 0.3])
def test_a_wheel_that_stands_before_it_starts_is_not_frozen(seconds: float, tmp_path: Path) -> None:
    noise = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
    folder = synthetic.write(
        tmp_path / "s", synthetic.robot(), noise, "mass = 0.6", manoeuvres=TWO, spoil=lambda _, table: None
    )
    assert read(folder).faults == ()

    def delayed(run: str, table: Table) -> None:
        late = int(seconds / 0.01)
        for side in ("left", "right"):
            table[f"wheel_speed_{side}"] = np.concatenate([np.zeros(late), table[f"wheel_speed_{side}"][:-late]])
        still(seconds)(run, table)

    folder = synthetic.write(tmp_path / "t", synthetic.robot(), noise, "mass = 0.6", manoeuvres=TWO, spoil=delayed)
    assert read(folder).faults == ()


def test_a_speed_that_is_zero_in_full_motion_is_frozen(tmp_path: Path) -> None:
    def die(table: Table) -> None:
        table["wheel_speed_left"] += np.random.default_rng(1).normal(0.0, 0.4, len(table["t"]))
        table["wheel_speed_left"][80:110] = 0.0

    assert found(plant(tmp_path / "s", die)) == {("curve", "wheel_speed_left", "frozen")}


@pytest.mark.parametrize("blank", [True, False])
def test_a_drive_that_floats_at_no_command_is_no_fault(blank: bool, tmp_path: Path) -> None:
    """The wheels coast: they turn without a command. A blank command means a floating motor."""

    def coast(_: str, table: Table) -> None:
        last = int(np.flatnonzero(table["voltage_left"])[-1])
        for side in ("left", "right"):
            speed = table[f"wheel_speed_{side}"]
            noise = speed - np.round(speed, 0)
            decay = np.exp(-(table["t"][last:] - table["t"][last]) / 0.6)
            table[f"wheel_speed_{side}"][last:] = float(np.median(speed[last - 20 : last])) * decay + 0.1 * noise[last:]
            table[f"voltage_{side}"][last + 1 :] = np.nan if blank else 0.0

    noise = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
    folder = synthetic.write(tmp_path / "s", synthetic.robot(), noise, "mass = 0.6", manoeuvres=TWO, spoil=coast)
    assert read(folder).faults == ()


@needs_data
def test_the_wheels_of_a_mouse_stand_before_they_start() -> None:
    kinds = {(fault.run, fault.kind) for fault in read(DATA / "micromouse_wheels").faults}
    assert kinds == {("controller_delay_impact10ms", "dropout")}  # one reading of 0 at 184 rpm


def test_windows_of_a_held_motor_start_from_its_measured_motion(tmp_path: Path) -> None:
    """The first row of a window seldom has a new sample, so its state comes from the samples near it."""
    truth = synthetic.motor(resistance=5.0, torque_constant=0.3, emf_constant=0.3, wheel_inertia=0.01)
    true: dict[str, np.ndarray] = {}

    def spoil(run: str, table: Table) -> None:
        true[run] = table["speed"].copy()
        hold(table, ["speed"], 4)

    noise = {"speed": 1e-4}
    folder = synthetic.write(
        tmp_path / "s", truth, noise, "resistance = 5.0", manoeuvres={"ahead": (6.0, 0.0)}, spoil=spoil
    )
    data = read(folder)
    assert any("hold a sample" in note for note in data.notes)
    ready = cut_into_windows(data, {run.name: motor_inputs(run, data) for run in data.runs}, 0.31)
    assert ready is not None
    assert len(ready.runs) > 4
    fastest = float(true["ahead"].max())
    for run in ready.runs:
        at = float(np.interp(run.time[0], data.runs[0].time, true["ahead"]))
        assert run.outputs["speed"][0] == pytest.approx(at, abs=0.12 * fastest)


@pytest.mark.parametrize("blank", [2, 3])
def test_a_channel_that_is_blank_between_its_samples_is_not_held(blank: int, tmp_path: Path) -> None:
    def spoil(_: str, table: Table) -> None:
        table["yaw_rate"][np.arange(len(table["t"])) % blank != 0] = np.nan

    written = synthetic.write(
        tmp_path / "s", synthetic.robot(), NOISE, "mass = 0.6", seed=3, manoeuvres=TWO, spoil=spoil
    )
    data = read(written)
    assert [note for note in data.notes if "hold a sample" in note] == []
    assert np.count_nonzero(np.isfinite(data.runs[0].outputs["yaw_rate"])) == -(-len(data.runs[0].time) // blank)
