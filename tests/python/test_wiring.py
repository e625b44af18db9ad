"""Wrong wiring is named before any fit, and mended if it is certain; right wiring is left alone."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import miswired_logs as logs
import numpy as np
import pytest
from brickpilot.data.audit.wiring import miswired
from brickpilot.data.facts import yaw_over_wheels
from brickpilot.data.reading import channels_of, read
from command import brickpilot
from importing import import_table
from serial_logs import HEADER, driven, lines_of, write_log


@cache
def robot(name: str) -> list[logs.Log]:
    return logs.logs(name, seed=1)


@pytest.mark.parametrize("name", logs.ROBOTS)
def test_a_robot_that_is_wired_right_is_left_alone(name: str) -> None:
    assert miswired([logs.channels(log) for log in robot(name)], logs.nominal(name)) == ()


@pytest.mark.parametrize("name", logs.ROBOTS)
def test_a_gyro_of_another_scale_shows_against_wheels_and_stated_lengths(name: str) -> None:
    """The scale is found within 0.002, with and without a bias; a right scale is found as 1."""
    for scale, bias in ((1.0, 0.0), (1.05, 0.0), (0.9, 0.05)):
        spoilt = [log | {"yaw_rate": scale * log["yaw_rate"] + bias} for log in robot(name)]
        found = yaw_over_wheels(logs.dataset(spoilt, name))
        assert found is not None
        assert found.size == pytest.approx(scale, abs=0.002)
        assert found.low < found.size < found.high < found.low + 0.01


@pytest.mark.parametrize("fault", logs.FAULTS)
@pytest.mark.parametrize("name", logs.ROBOTS)
def test_each_fault_is_named(name: str, fault: str) -> None:
    spoilt = logs.spoil(robot(name), [fault])
    found = miswired([logs.channels(log) for log in spoilt], logs.nominal(name))
    assert logs.is_right(robot(name), found, [fault], spoilt), [one.sentence for one in found]


@pytest.mark.parametrize("name", logs.ROBOTS)
def test_two_faults_at_once_are_named(name: str) -> None:
    chosen = logs.pairs()[::7]
    right = []
    for pair in chosen:
        spoilt = logs.spoil(robot(name), pair)
        found = miswired([logs.channels(log) for log in spoilt], logs.nominal(name))
        right.append(logs.is_right(robot(name), found, pair, spoilt))
    assert sum(right) >= 0.95 * len(chosen)


def test_measured_robots_are_wired_right() -> None:
    data = Path(os.environ.get("BRICKPILOT_DATA", "/nowhere"))
    folders = sorted(data.glob("*/dataset.toml"))
    if not folders:
        pytest.skip("no measured data")
    for folder in folders:
        dataset = read(folder)
        assert dataset.wiring == (), (folder, [one.sentence for one in dataset.wiring])


def test_the_log_is_mended_by_the_options_that_import_prints(tmp_path: Path) -> None:
    log = driven()
    log[:, [3, 4]] = log[:, [4, 3]]
    write_log(tmp_path / "log.csv", [HEADER, *lines_of(log)])
    words = ["import", "log.csv", "--guess", "--frame", "FLU", "--split", "rests", "--out"]
    said = brickpilot(*words, "set", cwd=tmp_path)
    first, second = said.stdout.splitlines()[:2]
    assert first.startswith("wiring: The left and the right encoder are swapped (")
    assert first.endswith("% sure, mended here).")
    head, _, options = second.partition(": ")
    assert head == "to mend it in the log"
    assert options.split() == [
        "--map", "wheel_angle_left=encR/960:rotation", "--map", "wheel_angle_right=encL/960:rotation",
    ]  # fmt: skip
    again = brickpilot(*words, "right", *options.split(), cwd=tmp_path)
    assert again.returncode == 0
    assert "wiring" not in again.stdout
    for one, other in zip(read(tmp_path / "set").runs, read(tmp_path / "right").runs, strict=True):
        np.testing.assert_allclose(one.outputs["wheel_angle_left"], other.outputs["wheel_angle_left"])


def test_a_frame_that_is_stated_stands_and_the_gyro_is_the_finding(tmp_path: Path) -> None:
    turned = driven() * [1, 1, 1, 1, 1, -1]
    made = import_table(
        [write_log(tmp_path / "log.csv", [HEADER, *lines_of(turned)])], tmp_path / "set", guessed=True, frame="FLU",
        split=("rests",),
    )  # fmt: skip
    dataset = read(made.folder)
    assert dataset.frame == "FLU"
    assert [one.signals for one in dataset.wiring] == [("yaw_rate",)]
    assert "the sign of yaw_rate" in made.wiring[0].lower()
    assert made.mend == "--map yaw_rate=-gz:deg/s"
    assert all(np.isfinite(run.outputs["yaw_rate"]).any() for run in dataset.runs)
    assert channels_of(dataset.runs[1]).outputs["yaw_rate"].min() < -1.0  # it turns to the left
