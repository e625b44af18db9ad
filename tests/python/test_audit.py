"""The audit finds, reports and leaves out samples that were damaged on purpose. From sound data it leaves out none."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import planted
import pytest
import synthetic
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from importing import import_wpilib
from test_measured import DATA

Table = dict[str, np.ndarray]
Spoil = Callable[[Table], None]

NOISE = {
    "accel_surge": 0.025, "accel_sway": 0.025, "yaw_rate": 0.014, "yaw_angle": 0.01,
    "wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "wheel_angle_left": 0.0, "wheel_angle_right": 0.0,
    "wheel_travel_left": 0.0005, "wheel_travel_right": 0.0005, "current_left": 0.005, "current_right": 0.005,
}  # fmt: skip
SPAN = {
    "accel": 19.62, "yaw_rate": 8.0, "yaw_angle": 20.0, "wheel_speed": 40.0, "wheel_angle": 200.0,
    "wheel_travel": 6.0, "current": 2.0,
}  # fmt: skip
ALL = {**synthetic.MANOEUVRES, "rest": (0.0, 0.0), "creep": (0.6, 0.6), "pivot": (5.0, 0.0)}
TWO = {"curve": (6.0, 3.0), "spin": (4.5, -4.5)}
STOPPED = ("t0_3", "t0_4", "t0_4_2")  # runs of the micromouse that end at a wall
ANALOGUE = ["accel_surge", "accel_sway", "yaw_rate", "current_left", "wheel_speed_right"]

needs_data = pytest.mark.skipif(not (DATA / "micromouse").is_dir(), reason=f"no measured sets in {DATA}")


def to_ten_bits(table: Table) -> None:
    for signal in table:
        for beginning, span in SPAN.items():
            if signal.startswith(beginning):
                table[signal] = np.round(table[signal] * 512 / span) * span / 512


def plant(folder: Path, damage: Spoil, *, jitter: bool = False, seed: int = 3) -> Dataset:
    """Writes two runs of 2 s at 100 Hz, with noise and ten bits on each signal, and damages the run "curve".

    Args:
        damage: changes the run's table in place.
        jitter: whether the sampling intervals vary.
    """

    def spoil(run: str, table: Table) -> None:
        to_ten_bits(table)
        if run == "curve":
            damage(table)

    folder = synthetic.write(
        folder, synthetic.robot(), NOISE, "mass = 0.6", seed=seed, manoeuvres=TWO, jitter=jitter, spoil=spoil
    )
    return read(folder)


def found(dataset: Dataset) -> set[tuple[str, str, str]]:
    return {(fault.run, fault.signal, fault.kind) for fault in dataset.faults}


def blanked(dataset: Dataset, signal: str, run: int = 0) -> list[int]:
    return np.flatnonzero(np.isnan(dataset.runs[run].outputs[signal])).tolist()


@pytest.mark.parametrize("quantised", [True, False])
@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0, 3.0])
def test_sound_runs_have_no_faults_at_rest_or_moving(noise: float, quantised: bool, tmp_path: Path) -> None:
    noises = {signal: noise * sd for signal, sd in NOISE.items()}
    for seed in range(13) if noise else (0, *range(1, 13, 2)):  # without noise, only odd seeds differ: by their times
        folder = synthetic.write(
            tmp_path / str(seed), synthetic.robot(), noises, "mass = 0.6", seed=seed, manoeuvres=ALL,
            jitter=seed % 2 == 1, spoil=lambda _, table: to_ten_bits(table) if quantised else None,
        )  # fmt: skip
        assert read(folder).faults == (), f"seed {seed}"


@pytest.mark.parametrize("jitter", [False, True])
@pytest.mark.parametrize("signal", sorted(NOISE))
def test_a_frozen_stretch_is_found_in_every_signal(signal: str, jitter: bool, tmp_path: Path) -> None:
    def freeze(table: Table) -> None:
        table[signal][70:120] = table[signal][70]

    dataset = plant(tmp_path / "s", freeze, jitter=jitter)
    assert found(dataset) == {("curve", signal, "frozen")}
    assert set(range(71, 120)) <= set(blanked(dataset, signal)) <= set(range(60, 126))


@pytest.mark.parametrize("signal", ANALOGUE)
def test_a_sensor_that_dies_in_a_run_is_found_to_its_end(signal: str, tmp_path: Path) -> None:
    def die(table: Table) -> None:
        table[signal][100:] = table[signal][100]

    dataset = plant(tmp_path / "s", die)
    assert found(dataset) == {("curve", signal, "frozen")}
    assert blanked(dataset, signal)[-1] == len(dataset.runs[0].time) - 1


@pytest.mark.parametrize("signal", ["yaw_rate", "wheel_speed_left", "current_right"])
def test_a_sensor_that_is_dead_in_one_run_is_known_by_the_other(signal: str, tmp_path: Path) -> None:
    dataset = plant(tmp_path / "s", lambda table: table[signal].fill(0.125))
    assert found(dataset) == {("curve", signal, "frozen")}
    assert len(blanked(dataset, signal)) == len(dataset.runs[0].time)


@pytest.mark.parametrize("value", [0.0, 999.0, -999.0])
@pytest.mark.parametrize("length", [1, 3])
@pytest.mark.parametrize(
    "signal", ["yaw_rate", "wheel_speed_left", "wheel_angle_right", "wheel_travel_left", "yaw_angle"]
)
def test_a_dropout_is_found_to_the_sample(signal: str, length: int, value: float, tmp_path: Path) -> None:
    def drop(table: Table) -> None:
        table[signal][100 : 100 + length] = value

    dataset = plant(tmp_path / "s", drop, jitter=True)
    assert found(dataset) == {("curve", signal, "dropout")}
    assert blanked(dataset, signal) == list(range(100, 100 + length))


@pytest.mark.parametrize("signal", ["accel_surge", "current_left"])
def test_a_blow_to_an_impulsive_signal_is_no_dropout_but_garbage_is(signal: str, tmp_path: Path) -> None:
    def strike(by: float) -> Spoil:
        def spoil(table: Table) -> None:
            table[signal][100] += by * np.ptp(table[signal])

        return spoil

    assert plant(tmp_path / "blow", strike(2.0)).faults == ()
    assert found(plant(tmp_path / "garbage", strike(100.0))) == {("curve", signal, "dropout")}


@pytest.mark.parametrize("what", ["wheel_speed", "wheel_angle", "wheel_travel"])
def test_a_row_with_left_and_right_swapped_is_found_on_both(what: str, tmp_path: Path) -> None:
    left, right = f"{what}_left", f"{what}_right"

    def swap(table: Table) -> None:
        table[left][110], table[right][110] = table[right][110], table[left][110]

    dataset = plant(tmp_path / "s", swap, jitter=True)
    assert found(dataset) == {("curve", left, "swapped"), ("curve", right, "swapped")}
    assert blanked(dataset, left) == blanked(dataset, right) == [110]


def ranged(folder: Path, signal: str, low: float, high: float) -> Dataset:
    toml = folder / "dataset.toml"
    text = toml.read_text(encoding="utf-8")
    before = f'{signal} = {{ column = "{signal}",'
    assert before in text
    toml.write_text(text.replace(before, f"{before} range = [{low}, {high}],"), encoding="utf-8")
    return read(folder)


def test_samples_at_the_stated_end_of_a_range_are_clipped_from_two_on(tmp_path: Path) -> None:
    def clip(table: Table) -> None:
        table["yaw_rate"][[60, 80, 81, 100, 101, 102]] = 5.0
        table["yaw_rate"][130:132] = -5.5

    plant(tmp_path / "s", clip)
    dataset = ranged(tmp_path / "s", "yaw_rate", -5.0, 5.0)
    clipped = [fault for fault in dataset.faults if fault.run == "curve"]
    time = dataset.runs[0].time
    assert [(fault.from_s, fault.to_s) for fault in clipped] == [
        (time[80], time[81]), (time[100], time[102]), (time[130], time[131]),
    ]  # fmt: skip


def test_an_unsigned_sensor_at_rest_is_not_clipped_at_zero(tmp_path: Path) -> None:
    plant(tmp_path / "s", lambda table: np.maximum(table["wheel_speed_left"], 0.0, out=table["wheel_speed_left"]))
    dataset = ranged(tmp_path / "s", "wheel_speed_left", 0.0, 40.0)
    assert ("curve", "wheel_speed_left", "clipped") not in found(dataset)


@pytest.mark.parametrize("signal", ["yaw_rate", "wheel_speed_left"])
def test_a_level_cut_off_is_clipped_and_not_frozen(signal: str, tmp_path: Path) -> None:
    def cut(table: Table) -> None:
        np.minimum(table[signal], 0.6 * table[signal].max(), out=table[signal])

    dataset = plant(tmp_path / "s", cut)
    assert found(dataset) == {("curve", signal, "clipped")}
    assert len(blanked(dataset, signal)) > 80


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_plateau_at_the_extreme_is_clipped_without_a_stated_range(sign: float, tmp_path: Path) -> None:
    def sway_and_clip(table: Table) -> None:
        noise = np.random.default_rng(1).normal(0.0, 0.014, len(table["t"]))
        table["yaw_rate"][:] = np.clip(3.0 * np.sin(9.0 * table["t"]) + noise, *sorted((-4.0 * sign, 2.0 * sign)))

    dataset = plant(tmp_path / "s", sway_and_clip)
    assert found(dataset) == {("curve", "yaw_rate", "clipped")}
    raw = dataset.runs[0].raw_outputs["yaw_rate"]
    assert blanked(dataset, "yaw_rate") == np.flatnonzero(raw == 2.0 * sign).tolist()


def test_the_raw_values_stay_and_what_is_found_is_told_once_a_group(tmp_path: Path) -> None:
    def drop_twice(table: Table) -> None:
        table["yaw_rate"][[90, 120]] = 0.0

    dataset = plant(tmp_path / "s", drop_twice)
    run = dataset.runs[0]
    assert run.raw_outputs["yaw_rate"][90] == 0.0
    assert not run.outputs["yaw_rate"].flags.writeable
    note = f"run curve: yaw_rate drops out in 2 places, first at {run.time[90]:.6g} s; 2 of 200 samples are left out"
    assert [text for text in dataset.notes if "yaw_rate" in text] == [note]
    assert json.loads(json.dumps([fault.to_json() for fault in dataset.faults]))[0] == {
        "run": "curve", "signal": "yaw_rate", "kind": "dropout", "from_s": run.time[90], "to_s": run.time[90],
    }  # fmt: skip


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a folder with the four measured data sets: three are copied, and frc is imported from its logs."""
    folder = tmp_path_factory.mktemp("measured")
    for name in ("linear_axis", "micromouse", "lego_ev3_motor"):
        shutil.copytree(DATA / name, folder / name)
    logs = [DATA / "frc_drivetrain" / f"{name}-data.json" for name in ("linear", "angular")]
    import_wpilib(logs, folder / "frc")
    return folder


@needs_data
@pytest.mark.parametrize("name", ["linear_axis", "frc"])
def test_measured_sets_without_damage_stay_whole(name: str, measured: Path) -> None:
    assert read(measured / name).faults == ()


@needs_data
def test_the_lego_motors_angle_that_stands_is_found_by_its_speed(measured: Path) -> None:
    assert found(read(measured / "lego_ev3_motor")) == {("duty_20", "angle", "frozen")}


@needs_data
def test_the_micromouse_loses_what_its_sensors_lost_and_what_follows_a_collision(measured: Path) -> None:
    """The gyro saturates at 2000 deg/s minus its bias, the battery voltage drops to 0 V, and a travel jumps by 12 mm.

    Three straight runs end with a collision: all later samples of the accelerometer are left out.
    """
    dataset = read(measured / "micromouse")
    assert found(dataset) == {
        ("r0_6", "battery_voltage", "dropout"), ("r1_0", "battery_voltage", "dropout"),
        ("r0_8", "wheel_travel_left", "dropout"), ("r0_8", "yaw_rate", "clipped"), ("r1_0", "yaw_rate", "clipped"),
        *((run, f"wheel_travel_{side}", "collision") for run in STOPPED for side in ("left", "right")),
    }  # fmt: skip
    hit = {fault.run: fault.from_s for fault in dataset.faults if fault.kind == "collision"}
    for run in dataset.runs:
        before = run.time < hit.get(run.name, np.inf)
        gone = np.isnan(run.outputs["yaw_rate"]) & before
        assert (np.abs(run.raw_outputs["yaw_rate"][gone]) > 34.6).all()
        assert not np.isnan(run.outputs["accel_surge"][before]).any()
        assert np.isnan(run.outputs["accel_surge"][~before]).all()


def exchange(first: int, other: int, cells: slice = slice(None)) -> Callable[[list[str]], list[str]]:
    """Returns a function that exchanges the cells `cells` of rows `first` and `other`."""

    def change(rows: list[str]) -> list[str]:
        table = [row.split(",") for row in rows]
        table[first][cells], table[other][cells] = table[other][cells], table[first][cells]
        return [",".join(row) for row in table]

    return change


def exchange_cells(row: int, first: int, other: int) -> Callable[[list[str]], list[str]]:
    def change(rows: list[str]) -> list[str]:
        cells = rows[row].split(",")
        cells[first], cells[other] = cells[other], cells[first]
        return [*rows[:row], ",".join(cells), *rows[row + 1 :]]

    return change


@needs_data
@pytest.mark.parametrize(
    ("name", "run", "row", "cells", "signals"),
    [
        ("micromouse", "r0_6", 900, (1, 2), ["wheel_travel_left", "wheel_travel_right"]),
        ("micromouse", "t0_2", 900, (1, 2), ["wheel_travel_left", "wheel_travel_right"]),
        ("frc", "angular-data_fast-forward", 250, (2, 5), ["wheel_travel_left", "wheel_travel_right"]),
        ("frc", "angular-data_fast-forward", 250, (3, 6), ["wheel_velocity_left", "wheel_velocity_right"]),
    ],
)
def test_a_row_of_a_measured_set_with_two_cells_swapped_is_found(
    name: str, run: str, row: int, cells: tuple[int, int], signals: list[str], measured: Path, tmp_path: Path
) -> None:
    dataset = planted.rewritten(measured / name, tmp_path / "s", exchange_cells(row, *cells), run)
    assert planted.new_faults(dataset, planted.undamaged(measured / name)) == {
        (run, signal, "swapped") for signal in signals
    }


@needs_data
def test_two_rows_of_a_measured_set_swapped_are_refused_by_their_time_or_found(measured: Path, tmp_path: Path) -> None:
    source = measured / "micromouse"
    with pytest.raises(InputError, match=r"r0_6\.csv:402: time: does not increase"):
        planted.rewritten(source, tmp_path / "whole", exchange(399, 419), "r0_6")
    dataset = planted.rewritten(source, tmp_path / "s", exchange(399, 419, slice(1, None)), "r0_6")
    wheels = ("wheel_travel_left", "wheel_travel_right")
    assert planted.new_faults(dataset, read(source)) == {("r0_6", name, "dropout") for name in wheels}
    run = next(run for run in dataset.runs if run.name == "r0_6")
    assert all(np.flatnonzero(np.isnan(run.outputs[name])).tolist() == [399, 419] for name in wheels)


@needs_data
@pytest.mark.parametrize("share", [0.5, 0.8])
@pytest.mark.parametrize(
    ("name", "column", "run", "signal"),
    [
        ("micromouse", "yaw_rate_radps", "r0_6", "yaw_rate"),
        ("lego_ev3_motor", "speed_degps", "duty_80", "speed"),
        ("frc", "wheel_velocity_left", "linear-data_fast-forward", "wheel_velocity_left"),
    ],
)
def test_a_range_clipped_in_a_measured_set_is_found(
    name: str, column: str, run: str, signal: str, share: float, measured: Path, tmp_path: Path
) -> None:
    ends: list[float] = []

    def clip(values: np.ndarray) -> np.ndarray:
        ends[:] = share * np.nanmin(values), share * np.nanmax(values)
        return np.clip(values, *ends)

    dataset = planted.plant(measured / name, tmp_path / "s", [column], clip, run)
    (found,) = planted.new_faults(dataset, planted.undamaged(measured / name))
    assert found[:2] == (run, signal)
    assert found[2] in {"clipped", "frozen"}  # a speed that is always outside the range looks frozen
    outputs = next(one for one in dataset.runs if one.name == run)
    raw = outputs.raw_outputs[signal]
    assert np.isnan(outputs.outputs[signal][np.abs(raw) >= 0.9999 * np.abs(raw).max()]).mean() > 0.9


@needs_data
@pytest.mark.parametrize("part", [(0.0, 1.0), (0.4, 1.0), (0.4, 0.5)])
@pytest.mark.parametrize(
    ("name", "column", "run", "signal"),
    [
        ("micromouse", "yaw_rate_radps", "r0_8", "yaw_rate"),
        ("frc", "yaw_angle", "angular-data_slow-forward", "yaw_angle"),
        ("frc", "wheel_velocity_left", "linear-data_fast-forward", "wheel_velocity_left"),
        ("linear_axis", "position_m", "trajectory", "position"),
    ],
)
def test_a_channel_of_a_measured_set_that_freezes_is_found_for_as_long_as_it_does(
    name: str, column: str, run: str, signal: str, part: tuple[float, float], measured: Path, tmp_path: Path
) -> None:
    def freeze(values: np.ndarray) -> np.ndarray:
        start, stop = (int(share * len(values)) for share in part)
        return np.concatenate([values[:start], np.full(stop - start, values[start]), values[stop:]])

    dataset = planted.plant(measured / name, tmp_path / "s", [column], freeze, run)
    assert planted.new_faults(dataset, planted.undamaged(measured / name)) == {(run, signal, "frozen")}
    time = next(one.time for one in dataset.runs if one.name == run)
    (found,) = (fault for fault in dataset.faults if (fault.run, fault.signal, fault.kind) == (run, signal, "frozen"))
    length = part[1] - part[0]
    assert found.to_s - found.from_s == pytest.approx(length * (time[-1] - time[0]), rel=0.05)


def rewrite(file: Path, column: str, rows: slice, values: Callable[[Sequence[str]], list[str]]) -> None:
    lines = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    at = lines[0].index(column)
    picked = lines[1:][rows]
    for line, value in zip(picked, values([line[at] for line in picked]), strict=True):
        line[at] = value
    file.write_text("".join(",".join(line) + "\n" for line in lines), encoding="utf-8")


@needs_data
@pytest.mark.parametrize(
    ("file", "column", "rows", "kind", "signal"),
    [
        ("linear_axis/trajectory.csv", "position_m", slice(9000, 9300), "frozen", "position"),
        ("linear_axis/trajectory.csv", "position_m", slice(9000, 9002), "dropout", "position"),
        ("micromouse/t0_4.csv", "yaw_rate_radps", slice(800, 900), "frozen", "yaw_rate"),
        ("micromouse/t0_2.csv", "accel_surge_mps2", slice(800, 900), "frozen", "accel_surge"),
        ("micromouse/t0_2.csv", "travel_right_m", slice(800, 803), "dropout", "wheel_travel_right"),
        ("micromouse/t0_2.csv", "travel_right_m", slice(800, 900), "frozen", "wheel_travel_right"),
        ("lego_ev3_motor/duty_80.csv", "speed_degps", slice(60, 62), "dropout", "speed"),
        ("lego_ev3_motor/duty_80.csv", "speed_degps", slice(50, 105), "frozen", "speed"),
        ("lego_ev3_motor/duty_80.csv", "angle_deg", slice(60, 90), "frozen", "angle"),
    ],
)
def test_damage_planted_in_a_measured_set_is_found(
    file: str, column: str, rows: slice, kind: str, signal: str, measured: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "set"
    shutil.copytree(measured / Path(file).parent, folder)
    sound = found(read(folder))
    change = (lambda cells: [cells[0]] * len(cells)) if kind == "frozen" else (lambda cells: ["0"] * len(cells))
    rewrite(folder / Path(file).name, column, rows, change)
    assert found(read(folder)) - sound == {(Path(file).stem, signal, kind)}
