"""Motor and supply effects with memory: heat and charge carry over from run to run, and the motor cools at rest."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.vehicle.plant import OpenLoopRun, State, simulate
from brickpilot.vehicle.replay import Replay
from synthetic import robot, steps, write

HEATING = {"motor_heating": {"thermal_resistance": 2000.0, "time_constant": 20.0}}
NOMINAL = "resistance = 22.0"


def replayed(folder, gap_s: float) -> dict[str, dict[str, np.ndarray]]:
    write(folder, robot(), {"yaw_rate": 0.0}, NOMINAL, manoeuvres={"first": (6.0, -6.0), "second": (6.0, -6.0)})
    toml = folder / "dataset.toml"
    toml.write_text(f"gap_s = {gap_s}\n" + toml.read_text(encoding="utf-8"), encoding="utf-8")
    hot = dataclasses.replace(robot(), effects=HEATING)
    return Replay(reading.read(folder)).simulate([hot])[0]


def test_heat_goes_from_run_to_run(tmp_path) -> None:
    runs = replayed(tmp_path / "hot", 0.0)
    assert np.max(np.abs(runs["second"]["yaw_rate"] - runs["first"]["yaw_rate"])) > 0.01


def test_a_long_gap_between_runs_cools(tmp_path) -> None:
    runs = replayed(tmp_path / "cold", 1000.0)
    assert runs["second"]["yaw_rate"] == pytest.approx(runs["first"]["yaw_rate"], abs=1e-12)


def test_a_state_holds_heat_and_rest() -> None:
    time, voltages = steps(0.0, 0.0, seconds=0.1)
    hot = dataclasses.replace(robot(), effects=HEATING)
    start = State(heat=(50.0, 20.0), rest=10.0)
    final = simulate([(hot, OpenLoopRun(time=time, inputs=voltages, initial=start))])[0].final
    cooled = math.exp(-(10.0 + time[-1]) / 20.0)
    assert final.heat == pytest.approx((50.0 * cooled, 20.0 * cooled), rel=1e-4)
    assert final.rest == 0.0
