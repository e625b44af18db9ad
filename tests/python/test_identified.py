"""If no mass and no motor constant is known, an effect's size has a unit that the data determine, such as V."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.fit import uncertainty
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.parameters import plan
from brickpilot.vehicle.combinations import not_told_apart, signatures_of
from synthetic import motor, robot, write

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


def test_of_what_the_signals_do_not_tell_apart_one_is_fitted_and_the_rest_keep_their_share(tmp_path: Path) -> None:
    """The signals show only sums: of the robot's mass and its wheels' inertia, and of back-EMF and friction."""
    data = reading.read(write(tmp_path / "data", robot(wheel_radius=0.0408, half_track=0.0565), NOISE, GEOMETRY))
    chosen = plan(data)
    assert [one.name for one in chosen.free] == ["mass", "yaw_inertia", "emf_constant"]
    held = {one.name for one in chosen.held}
    assert held == {"wheel_inertia", "resistance", "torque_constant", "viscous_friction", "rolling_friction"}
    twice, start = chosen.at(chosen.start() + np.log(2.0)).parameters, chosen.model.parameters
    doubled = {"mass", "yaw_inertia", "emf_constant", "wheel_inertia", "viscous_friction", "rolling_friction"}
    assert {name for name, value in twice.items() if value > 1.5 * start[name] > 0} == doubled
    assert {*calibrate(data).parameters} == {*held, *(one.name for one in chosen.free)}
    far = chosen.at(chosen.start() + np.log(1e6)).parameters
    assert far["rolling_friction"] == next(one.info.maximum for one in chosen.held if one.name == "rolling_friction")


def test_friction_of_a_known_torque_tells_how_much_torque_a_volt_makes() -> None:
    names = {"wheel_inertia", "resistance", "torque_constant", "emf_constant", "viscous_friction"}

    def held(effects: dict[str, dict[str, float]]) -> set[str]:
        signatures = signatures_of(dataclasses.replace(motor(), effects=effects), {"speed"}, ())
        return not_told_apart({name: signatures[name] for name in names})

    assert len(held({})) == 3
    assert len(held({"coulomb_friction": {"torque": 0.02}})) == 2


def test_slopes_that_may_be_errors_tell_nothing_and_pull_nowhere() -> None:
    """Two parameters have sensitivities that differ by a thousandth; a third one has another sensitivity."""
    random = np.random.default_rng(0)
    first, third = random.normal(size=500), random.normal(size=500)
    slopes = np.column_stack([first, first + 1e-3 * random.normal(size=500), third])
    cleaned = uncertainty._without_errors(slopes, np.ones(500))
    assert cleaned == pytest.approx(slopes, abs=3e-3)
    assert np.linalg.svd(cleaned, compute_uv=False)[2] < 1e-9
    clear = np.column_stack([first, first + 0.1 * third, third[::-1]])
    assert uncertainty._without_errors(clear, np.ones(500)) == pytest.approx(clear, abs=1e-9)
