"""The next experiment as files: a scenario, a table and a C array that drive the same voltages."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from brickpilot.report.experiment_files import ARRAY, SCENARIO, TABLE, files_of, steps
from brickpilot.vehicle import scenario
from brickpilot.vehicle.manoeuvres import Manoeuvre, commands, manoeuvres
from command import brickpilot

ALL = manoeuvres("diff_drive", 9.0)


def held(found: list[tuple[float, float, float]], time: np.ndarray) -> np.ndarray:
    """Returns (n, 2): the voltages that the steps hold at `time`."""
    rows = np.array(found)
    return rows[np.searchsorted(rows[:, 0], time, side="right") - 1, 1:]


@pytest.mark.parametrize("drive", ALL, ids=lambda one: one.name)
def test_the_steps_drive_the_manoeuvre(drive: Manoeuvre, tmp_path: Path) -> None:
    """Constant voltages are exact; in a ramp the error is at most what the voltage changes in half a step of 0.05 s."""
    time = np.arange(0.0, drive.duration_s, 0.001) + 0.0005
    steepest = 9.0 * 0.4 / 4.0  # V/s of the ramps
    wrong = np.abs(held(steps(drive), time) - commands(drive, time))
    assert wrong.max() <= (steepest * 0.05 / 2 + 1e-3 if "slow" in drive.name else 1e-9)

    texts = files_of(drive, "diff_drive")
    (tmp_path / SCENARIO).write_text(texts[SCENARIO])
    read = scenario.load(tmp_path / SCENARIO)
    assert read.duration == drive.duration_s
    assert [(one.from_s, one.left, one.right) for one in read.segments] == steps(drive)
    rows = list(csv.reader(texts[TABLE].splitlines()))
    assert rows[0] == ["from_s", "voltage_left", "voltage_right"]
    assert [tuple(map(float, row)) for row in rows[1:]] == steps(drive)


def test_the_scenario_flies(tmp_path: Path) -> None:
    (tmp_path / SCENARIO).write_text(files_of(ALL[0], "diff_drive")[SCENARIO])
    said = brickpilot("run", SCENARIO, "--out", "flown", cwd=tmp_path)
    assert said.returncode == 0, said.stderr


@pytest.mark.parametrize("vehicle", ["diff_drive", "motor"])
def test_the_array_compiles_and_ends_at_rest(vehicle: str, tmp_path: Path) -> None:
    (tmp_path / ARRAY).write_text(files_of(ALL[0], vehicle)[ARRAY])
    source = tmp_path / "main.c"
    source.write_text(
        f'#include "{ARRAY}"\n#include <stdio.h>\nint main(void)\n{{\n'
        "    for (unsigned k = 0; k < sizeof NEXT_EXPERIMENT / sizeof *NEXT_EXPERIMENT; k++)\n"
        '        printf("%u\\n", (unsigned)NEXT_EXPERIMENT[k].from_ms);\n}\n'
    )
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    subprocess.run([compiler, "-std=c11", "-Wall", "-Werror", source, "-o", tmp_path / "a.out"], check=True)
    said = subprocess.run([tmp_path / "a.out"], capture_output=True, text=True, check=True).stdout.split()
    assert [int(one) for one in said] == [round(1000 * at) for at, *_ in steps(ALL[0])] + [
        round(1000 * ALL[0].duration_s)
    ]
    assert ("mv_right" in (tmp_path / ARRAY).read_text()) is (vehicle == "diff_drive")


def test_a_motor_has_no_scenario_and_24_volts_are_beyond_one() -> None:
    assert set(files_of(ALL[0], "motor")) == {TABLE, ARRAY}
    assert set(files_of(manoeuvres("diff_drive", 24.0)[0], "diff_drive")) == {TABLE, ARRAY}
    assert re.search(r"\n0\.5,24\.0,24\.0\n", files_of(manoeuvres("diff_drive", 24.0)[0], "diff_drive")[TABLE])
