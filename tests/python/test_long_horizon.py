"""The fit to whole runs: it follows free runs, finds a late channel, and keeps the search's model where it cannot."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data import dataset
from brickpilot.discover import long_horizon
from brickpilot.discover.calibrate import calibrate
from brickpilot.discover.prepare import Prepared, prepare
from brickpilot.discover.search import Searched
from brickpilot.discover.verdict import Verdict, judge
from brickpilot.discover.written import Written, write

LATE_S = 0.06
STATIC, PER_SPEED, INERTIA = 0.8, 0.5, 0.1
HEAD = """name = "late"
vehicle = "motor"
csv = { delimiter = ",", header = true }
[signals]
time = { column = "t", unit = "s" }
voltage = { column = "u", unit = "V" }
speed = { column = "w", unit = "rad/s" }
angle = { column = "a", unit = "rad" }
[nominal]
"""


def motor_run(volts: float) -> np.ndarray:
    """Returns rows of time, voltage, late speed and angle of a motor with dry friction, stepped by Euler's method."""
    step = 1e-3
    time = np.arange(0, 3, step)
    command = volts * np.where(time < 0.3, 0.0, np.where(time < 1.6, 1.0, -0.6))
    speed, angle = np.zeros_like(time), np.zeros_like(time)
    for k in range(len(time) - 1):
        drive = np.sign(speed[k]) * STATIC if speed[k] else np.clip(command[k], -STATIC, STATIC)
        speed[k + 1] = speed[k] + step / INERTIA * (command[k] - drive - PER_SPEED * speed[k])
        angle[k + 1] = angle[k] + step * speed[k]
    late = np.interp(time - LATE_S, time, speed)
    noise = np.random.default_rng(int(10 * volts)).normal(size=(2, len(time)))
    return np.column_stack([time, command, late + 0.02 * noise[0], angle + 0.005 * noise[1]])[::10]


@pytest.fixture(scope="module")
def late_motor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("late")
    rows = ""
    for number, volts in enumerate((4.0, 6.0, 5.0)):
        np.savetxt(folder / f"{number}.csv", motor_run(volts), delimiter=",", header="t,u,w,a", comments="")
        role = "held_out" if number == 2 else "fit"
        rows += f'[[runs]]\nname = "{number}"\nfile = "{number}.csv"\nrole = "{role}"\n'
    (folder / "dataset.toml").write_text(HEAD + rows)
    return folder


@pytest.fixture(scope="module")
def plain(late_motor: Path) -> tuple[Prepared, Verdict, Written]:
    """The data, and the calibrated nominal model as a search that found nothing would write it."""
    prepared = prepare(dataset.read(late_motor), None, seed=0, jobs=2)
    nominal = calibrate(prepared)
    verdict = judge(prepared, Searched(nominal, nominal, ()))
    return prepared, verdict, write(prepared, verdict, None)


def test_free_runs_are_followed_and_the_late_channel_joins(plain: tuple[Prepared, Verdict, Written]) -> None:
    prepared, verdict, written = plain
    found = long_horizon.follow_whole_runs(prepared, verdict, written)
    assert any(catalogue.effect(name).mechanism == "bearing" for name in found.model.effects)
    assert found.model.effects["speed_delay"]["delay"] == pytest.approx(LATE_S, abs=0.01)
    low, high = found.estimates["speed_delay.delay"].ci95
    assert low < LATE_S < high
    errors = long_horizon.free_run_errors(prepared, found.simulated["augmented"])
    before = long_horizon.free_run_errors(prepared, written.simulated["augmented"])
    assert errors["fit"]["speed"] < 0.05 < before["fit"]["speed"]
    assert errors["held_out"]["speed"] < 0.05
    assert "does not claim" in found.notes[-1]
    assert found.kind == written.kind


def test_a_fit_that_held_out_runs_contradict_is_not_kept(plain: tuple[Prepared, Verdict, Written]) -> None:
    """The held-out run has its motor reversed: whatever follows the fit runs makes it worse."""
    prepared, verdict, written = plain
    runs = []
    for run in prepared.measured.runs:
        sign = -1.0 if run.name == "2" else 1.0
        runs.append(dataclasses.replace(run, outputs={name: sign * one for name, one in run.outputs.items()}))
    turned = dataclasses.replace(prepared, measured=dataclasses.replace(prepared.measured, runs=tuple(runs)))
    found = long_horizon.follow_whole_runs(turned, verdict, written)
    assert found.model == written.model
    assert "was kept" in found.notes[-1]
