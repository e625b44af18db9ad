"""The firmware of a user's robot gives bit for bit the same motor commands in this process and behind a link."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path

import numpy as np
import pytest
from brickpilot import compiled
from brickpilot.errors import InputError
from brickpilot.firmware import boards, robot, simulate
from brickpilot.hil import checkout as project
from brickpilot.vehicle import flight
from test_firmware import OWN, ROOT, write
from test_gains import TUNED

STEPS = 1500  # the rest at the start, and 2.5 s of driving


@pytest.mark.parametrize(("name", "board", "sensors"), [("middle", "rcx", "imu"), ("heavy", "avr", "imu+encoders")])
def test_gains_as_settings_in_process_are_those_compiled_into_the_firmware(
    name: str, board: str, sensors: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    own = robot.load(write(tmp_path, name, OWN[name]))
    mission = simulate.mission(own, None)
    plan = dataclasses.replace(simulate.plan(own, mission, sensors, 0), steps=STEPS)
    flags = boards.flags_of(boards.BOARDS[board], sensors, ROOT)
    tuned = robot.with_gains(own, TUNED)
    boards.write_headers(tuned, mission, boards.BOARDS[board], boards.step_of(flags), tmp_path / "own", ROOT)
    linked = simulate.fly_own(ROOT, tmp_path / "own", [f for f in flags if f[:2] == "-D"], plan, tmp_path).flight
    library = boards.closed_loop(own, boards.BOARDS[board], sensors).library()
    in_process = flight.fly(dataclasses.replace(plan, firmware=library, gains=TUNED))
    np.testing.assert_array_equal(in_process.motors, linked.motors)
    assert np.abs(linked.motors).max() > 5_000
    untuned = flight.fly(dataclasses.replace(plan, firmware=library))
    assert not np.array_equal(untuned.motors, linked.motors)


def test_a_library_of_another_plant_is_refused(tmp_path: Path) -> None:
    source = tmp_path / "other.c"
    source.write_text("int bp_plant_size(void) { return 77; }\n")
    subprocess.run(["cc", "-shared", "-fPIC", str(source), "-o", str(tmp_path / "other.so")], check=True)
    with pytest.raises(InputError, match="the checkout: has another plant than the installed package"):
        compiled.closed_loop(tmp_path / "other.so")


def test_without_a_checkout_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Here the sources that an installed package contains are missing, too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(project, "_PACKED", tmp_path / "sources")
    with pytest.raises(InputError, match="needs a checkout of the project"):
        boards.closed_loop(robot.load(write(tmp_path, "small", OWN["small"])), boards.RCX, "imu")
