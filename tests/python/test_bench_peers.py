"""SciPy beside the plant in `brickpilot bench`: the same robot, at an accuracy that is the plant's or better."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot.benchmark import machine, scipy_robot
from brickpilot.errors import SimulationError
from brickpilot.vehicle.model import Model, rcx


def shortened(name: str) -> scipy_robot.Manoeuvre:
    """The first second, which drives a curve, and for held inputs the two others too."""
    manoeuvre: scipy_robot.Manoeuvre = getattr(scipy_robot, name)()
    return manoeuvre if name == "held" else dataclasses.replace(manoeuvre, voltages=manoeuvre.voltages[:200])


@pytest.mark.parametrize("name", ["held", "controlled"])
def test_scipy_is_as_accurate_as_the_plant_and_no_more_than_asked(name: str) -> None:
    manoeuvre = shortened(name)
    for setting in scipy_robot.loosest(rcx(), manoeuvre):
        assert setting.scipy_m <= setting.plant_m < 1e-5
        looser = setting.tolerance * 10
        if looser <= scipy_robot.TOLERANCES[0]:
            exact = scipy_robot.solve(rcx(), manoeuvre, 1e-10, "LSODA")[:, 5:]
            rough = scipy_robot.solve(rcx(), manoeuvre, looser, setting.method)[:, 5:]
            assert np.abs(rough - exact).max() > setting.plant_m


def test_scipys_robot_is_the_plants() -> None:
    manoeuvre = scipy_robot.held()
    found = scipy_robot.solve(rcx(), manoeuvre, 1e-8, "LSODA")[:, 5:]
    assert np.abs(found - scipy_robot.simulate(rcx(), manoeuvre)).max() < 1e-5
    assert np.abs(found).max() > 0.3


def test_a_robot_that_is_not_the_plants_has_no_equal_accuracy(monkeypatch: pytest.MonkeyPatch) -> None:
    model, heavy = rcx(), dataclasses.replace(rcx(), parameters={**rcx().parameters, "mass": 1.0})
    real = scipy_robot.solve

    def solve(given: Model, manoeuvre: scipy_robot.Manoeuvre, tolerance: float, method: str) -> scipy_robot.Array:
        return real(given if tolerance == 1e-10 else heavy, manoeuvre, tolerance, method)

    monkeypatch.setattr(scipy_robot, "solve", solve)
    with pytest.raises(SimulationError, match="no tolerance"):
        scipy_robot.loosest(model, shortened("controlled"))


def test_the_machine_is_named() -> None:
    assert " cores, " in machine.describe()
    assert any(name in machine.compiler() for name in ("gcc", "clang"))
    assert machine.cores() >= 1
