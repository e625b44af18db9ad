"""Where no mass and no motor constant is known, the size of an effect is given in what the data identify."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from brickpilot.data import dataset
from brickpilot.fit.calibrate import calibrate
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
    data = dataset.read(write(tmp_path / "data", truth, NOISE, GEOMETRY))
    found = calibrate(data, effects=[effect]).parameters[f"{effect}.{parameter}"]
    assert found.ci95 is None
    assert found.identified is not None
    assert found.identified.unit == "V"
    volts = size * lever * truth.parameters["resistance"] / truth.parameters["torque_constant"]
    assert found.identified.ci95[0] < volts < found.identified.ci95[1]
    assert found.identified.value == pytest.approx(volts, rel=0.1)
