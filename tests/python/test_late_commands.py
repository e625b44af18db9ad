"""Slip does not explain a log with a row every 40 ms whose commands act late, each with its own delay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from brickpilot.data.reading import read
from brickpilot.discover import pipeline
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun
from importing import import_table
from synthetic import robot

DRIVES = ((4, 4), (-5, -5), (5, -5), (-4, 4), (6, 3), (3, 6), (7, 7), (-6, 6))
MAPPING = [
    "time=millis:ms", "voltage_left=vL", "voltage_right=vR", "wheel_angle_left=encL/960:rotation",
    "wheel_angle_right=encR/960:rotation", "yaw_rate=gz:deg/s",
]  # fmt: skip
NOMINAL = {"mass": 0.6, "wheel_radius": 0.028, "half_track": 0.07}
SLIPS = {"wheel_slip", "side_slip"}


def commands(rng: np.random.Generator) -> np.ndarray:
    """Returns (n, 3): time in s, left V, right V: eight drives of four commands each, with rests between them."""
    rows, time = [(0.0, 0.0, 0.0)], 0.5
    for left, right in DRIVES:
        for _ in range(4):
            share = rng.uniform(0.4, 1.0)
            rows.append((time, left * share, right * share))
            time += rng.uniform(0.25, 0.5)
        rows.append((time, 0.0, 0.0))
        time += 2.5
    return np.array(rows)


def write_logs(folder: Path, truth: Model, latest_s: float, seed: int) -> None:
    """Writes rows every 40 ms, and the commands; each command acts up to `latest_s` s after the robot has logged it."""
    rng = np.random.default_rng(seed)
    given = commands(rng)
    grid = np.arange(0.0, given[-1, 0], 0.001)
    acts = given[:, 0] + rng.uniform(0.0, latest_s, len(given)) * (given[:, 0] > 0)
    sim = plant.simulate([(truth, OpenLoopRun(grid, given[np.searchsorted(acts, grid, side="right") - 1, 1:]))])[0]
    counts = [np.floor(sim.outputs[f"wheel_angle_{side}"] / (2 * np.pi) * 960) for side in ("left", "right")]
    turning = np.degrees(sim.outputs["yaw_rate"]) + rng.normal(0, 0.5, grid.size)
    logged = given[np.searchsorted(given[:, 0], grid, side="right") - 1, 1:]
    lines = [
        f"{k},{logged[k, 0]:.4f},{logged[k, 1]:.4f},{counts[0][k]:.0f},{counts[1][k]:.0f},{turning[k]:.2f}"
        for k in range(0, grid.size, 40)
    ]
    (folder / "log.csv").write_text("\n".join(["millis,vL,vR,encL,encR,gz", *lines, ""]))
    events = [f"{1000 * time:.0f},{left:.4f},{right:.4f}" for time, left, right in given]
    (folder / "commands.csv").write_text("\n".join(["millis,vL,vR", *events, ""]))


def likely(folder: Path, inputs: str | None) -> set[str]:
    """Returns the effects of the verdict, claimed or not."""
    made = import_table(
        [folder / "log.csv"], folder / "set", MAPPING, vehicle="diff_drive", split=["rests"], inputs=inputs,
        nominal=NOMINAL,
    )  # fmt: skip
    assert len(made.runs) == len(DRIVES)
    return {effect.name for effect in pipeline.discover(read(made.folder), seed=0, jobs=1).effects}


@pytest.mark.parametrize("with_events", [False, True])
def test_commands_that_act_late_are_not_called_wheel_slip(tmp_path: Path, with_events: bool) -> None:
    write_logs(tmp_path, robot(), latest_s=0.04, seed=1)
    found = likely(tmp_path, str(tmp_path / "commands.csv") if with_events else None)
    assert not found & SLIPS
    if with_events:
        assert found & {"input_delay", "sensor_delay", "actuator_lag", "start_delay"}


def test_wheels_that_do_slip_are_called_so(tmp_path: Path) -> None:
    truth = robot()
    slipping = Model(truth.name, truth.vehicle, truth.profile, truth.parameters, {"wheel_slip": {"creep": 0.1}})
    write_logs(tmp_path, slipping, latest_s=0.0, seed=1)
    assert likely(tmp_path, str(tmp_path / "commands.csv")) & SLIPS
