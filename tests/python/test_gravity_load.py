"""Discovery finds gravity on a motor's arm that turns by less than one turn; SciPy simulates motor and arm."""

from __future__ import annotations

import math

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

RESISTANCE, CONSTANT, INERTIA, DRAG = 4.0, 0.4, 6e-3, 2e-4  # ohm, N m/A and V s/rad, kg m^2, N m s/rad
WEIGHT, RAISED = 0.25, 0.6  # N m, of the level arm; rad, angle above the horizontal where the sensor reads 0
STEP, NOISE = 0.01, 0.002  # s; rad/s and rad


def swung(random: np.random.Generator) -> pd.DataFrame:
    """Returns a noisy log of the arm, whose equation of motion SciPy's RK45 solves."""
    time = np.arange(0.0, 6.0, STEP)
    voltage = np.repeat(random.uniform(-3.0, 3.0, 12), 50)

    def slope(at: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        current = (voltage[min(int((at + 1e-9) / STEP), len(voltage) - 1)] - CONSTANT * speed) / RESISTANCE
        torque = CONSTANT * current - DRAG * speed - WEIGHT * math.cos(angle + RAISED)
        return [speed, torque / INERTIA]

    found, state = np.empty((len(time), 2)), np.array([-math.pi / 2 - RAISED, 0.0])  # the arm hangs down
    for k, at in enumerate(time):
        found[k] = state
        state = solve_ivp(slope, (at, at + STEP * (1 - 1e-9)), state, rtol=1e-9, atol=1e-10).y[:, -1]
    noisy = found + random.normal(0.0, NOISE, found.shape)
    return pd.DataFrame({"time": time, "voltage": voltage, "angle": noisy[:, 0], "speed": noisy[:, 1]})


@pytest.fixture(scope="module")
def arm() -> bp.Dataset:
    random = np.random.default_rng(5)
    logs = {f"swing {k}": swung(random) for k in range(4)}
    assert max(np.ptp(one["angle"]) for one in logs.values()) < 1.2 * math.pi
    known = {
        "resistance": RESISTANCE, "torque_constant": CONSTANT, "emf_constant": CONSTANT, "wheel_inertia": INERTIA,
        "viscous_friction": DRAG, "inductance": 0.0,
    }  # fmt: skip
    return bp.Dataset.from_frames(logs, vehicle="motor", nominal=known)


def test_gravity_on_an_arm_is_found_without_a_full_turn(arm: bp.Dataset) -> None:
    """Cogging of order 1, with one period per turn, is the same law, so cogging may be the rival."""
    found = bp.discover(arm)
    assert found.verdict in ("named", "ambiguous")
    assert ("gravity_load",) in [tuple(one.effects) for one in found.explanations]
    assert {name for one in found.explanations for name in one.effects} <= {"gravity_load", "cogging"}


def test_weight_and_level_are_calibrated(arm: bp.Dataset) -> None:
    found = bp.calibrate(arm, effects=["gravity_load"])
    values = found.model.effects["gravity_load"]
    assert values["torque"] == pytest.approx(WEIGHT, rel=1e-3)
    assert values["level"] == pytest.approx(-RAISED, abs=2e-3)
    assert found.after.of("angle", "fit").fit_percent > 99
