"""Where no mass and no motor constant is known, the size of an effect is given in what the data identify."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.fit import uncertainty
from brickpilot.fit.calibration import calibrate
from synthetic import robot, write

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
GEOMETRY = "wheel_radius = 0.0408\nhalf_track = 0.0565\n"


@pytest.mark.parametrize(
    ("effect", "parameter", "size", "lever"),
    [("coulomb_friction", "torque", 0.006, 1.0), ("yaw_scrub", "moment", 0.03, 0.0408 / (2 * 0.0565))],
)
def test_a_torque_without_a_scale_is_given_as_a_voltage(
    tmp_path: Path, effect: str, parameter: str, size: float, lever: float
) -> None:
    base = robot(wheel_radius=0.0408, half_track=0.0565)
    truth = dataclasses.replace(base, effects={effect: {parameter: size}})
    data = reading.read(write(tmp_path / "data", truth, NOISE, GEOMETRY))
    found = calibrate(data, effects=[effect]).parameters[f"{effect}.{parameter}"]
    assert found.ci95 is None
    assert found.identified is not None
    assert found.identified.unit == "V"
    volts = size * lever * truth.parameters["resistance"] / truth.parameters["torque_constant"]
    assert found.identified.ci95[0] < volts < found.identified.ci95[1]
    assert found.identified.value == pytest.approx(volts, rel=0.1)


def test_slopes_that_may_be_errors_tell_nothing_and_pull_nowhere() -> None:
    """Two parameters that move the signals alike but for a thousandth, and one that moves them otherwise."""
    random = np.random.default_rng(0)
    first, third = random.normal(size=500), random.normal(size=500)
    slopes = np.column_stack([first, first + 1e-3 * random.normal(size=500), third])
    cleaned = uncertainty._without_errors(slopes, np.ones(500))
    assert cleaned == pytest.approx(slopes, abs=3e-3)
    assert np.linalg.svd(cleaned, compute_uv=False)[2] < 1e-9
    clear = np.column_stack([first, first + 0.1 * third, third[::-1]])
    assert uncertainty._without_errors(clear, np.ones(500)) == pytest.approx(clear, abs=1e-9)
