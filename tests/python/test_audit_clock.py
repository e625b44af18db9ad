"""Clocks that drift, run fast or leap are found in their runs; lost rows and other sample rates are no clock faults."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import planted
import pytest
import synthetic
from brickpilot.data import reading
from importing import import_wpilib
from test_audit import DATA, needs_data
from test_dataset import measured

Column = planted.Column
EVERY = "every run"
NOISE = {
    "yaw_rate": 0.014, "yaw_angle": 0.005,
    "wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "wheel_angle_left": 0.01, "wheel_angle_right": 0.01,
}  # fmt: skip


def drift(by: float) -> Callable[[Column], Column]:
    """Returns a function that makes a clock drift: its rate is right at first, and 1 + 2 `by` times that at the end."""
    return lambda time: time + by * (time - time[0]) ** 2 / (time[-1] - time[0])


def fast(by: float) -> Callable[[Column], Column]:
    return lambda time: time[0] + (1.0 + by) * (time - time[0])


def leap(by: float) -> Callable[[Column], Column]:
    return lambda time: time + by * (np.arange(len(time)) >= len(time) // 2)


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Returns a function: name of a measured set -> its folder. The logs of FRC are imported once."""
    folder = tmp_path_factory.mktemp("frc") / "frc"

    def path(name: str) -> Path:
        if name != "frc":
            return measured(name)
        if not folder.exists():
            logs = measured("frc_drivetrain")
            import_wpilib([logs / f"{one}-data.json" for one in ("linear", "angular")], folder)
        return folder

    return path


CLOCKS = [
    ("micromouse", "t_s", drift(0.02), "t0_2"), ("micromouse", "t_s", drift(0.05), "r0_8"),
    ("micromouse", "t_s", drift(0.02), EVERY), ("micromouse", "t_s", fast(0.015), "t0_4_2"),
    ("micromouse", "t_s", leap(0.1), "r1_0"), ("micromouse", "t_s", leap(0.5), EVERY),
    ("linear_axis", "t_s", drift(0.02), "trajectory"), ("linear_axis", "t_s", drift(0.02), EVERY),
    ("linear_axis", "t_s", fast(-0.03), "trajectory_with_pulses"), ("linear_axis", "t_s", leap(0.1), "trajectory"),
    ("lego_ev3_motor", "t_s", drift(0.05), "duty_m100"), ("lego_ev3_motor", "t_s", leap(0.1), "duty_m100"),
    ("frc", "time", drift(0.02), "angular-data_slow-forward"), ("frc", "time", drift(0.05), EVERY),
    ("frc", "time", fast(0.03), "linear-data_slow-forward"), ("frc", "time", leap(0.3), "linear-data_slow-forward"),
]  # fmt: skip


@needs_data
@pytest.mark.parametrize(("name", "column", "change", "where"), CLOCKS)
def test_a_wrong_clock_planted_in_a_measured_set_is_found(
    name: str, column: str, change: Callable[[Column], Column], where: str, sets: Callable[[str], Path], tmp_path: Path
) -> None:
    runs = [] if where == EVERY else [where]
    sound = reading.read(sets(name))
    found = planted.plant(sets(name), tmp_path / "s", [column], change, *runs)
    expected = {(run.name, "time", "clock") for run in sound.runs if not runs or run.name in runs}
    assert planted.new_faults(found, sound) == expected
    for run, before in zip(found.runs, sound.runs, strict=True):  # a collision blanks the end of a run with any clock
        known, was_known = (any(np.isfinite(one[-1]) for one in each.outputs.values()) for each in (run, before))
        assert known == (was_known and (run.name, "time", "clock") not in expected)


@needs_data
@pytest.mark.parametrize("name", sorted(folder.name for folder in DATA.glob("*") if (folder / "dataset.toml").exists()))
def test_lost_rows_of_a_measured_set_are_no_fault_of_its_clock(name: str, tmp_path: Path) -> None:
    random = np.random.default_rng(0)

    def lose(lines: list[str]) -> list[str]:
        kept = random.random(len(lines)) > 0.05
        kept[: len(lines) // 2] = True
        kept[len(lines) // 2 : len(lines) // 2 + 12] = False
        return [line for line, keep in zip(lines, kept, strict=True) if keep]

    found = planted.rewritten(measured(name), tmp_path / "s", lose)
    assert not {kind for _, _, kind in planted.new_faults(found, planted.undamaged(measured(name)))} - {"frozen"}


@pytest.mark.parametrize("jitter", [False, True])
def test_angles_beside_rates_tell_a_clock_of_one_run(jitter: bool, tmp_path: Path) -> None:
    def spoil(run: str, table: dict[str, Column]) -> None:
        if run == "curve":
            table["t"] = fast(0.1)(table["t"])

    folder = synthetic.write(tmp_path / "s", synthetic.robot(), NOISE, "mass = 0.6", jitter=jitter, spoil=spoil)
    found = reading.read(folder)
    assert [(fault.run, fault.signal, fault.kind) for fault in found.faults] == [("curve", "time", "clock")]
    assert found.faults[0].factor == pytest.approx(1.1, rel=0.02)
    assert any(note.startswith("run curve: its clock is off") for note in found.notes)
