"""The peers of `brickpilot bench`: SciPy is as accurate as the plant on the same robot, MuJoCo does no extra work."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from brickpilot.bench import speed
from brickpilot.errors import SimulationError
from brickpilot.vehicle.model import Model, rcx


def shortened(name: str) -> speed.Manoeuvre:
    """Returns the first 0.6 s of a manoeuvre, a curve; of the manoeuvre with held inputs, all three seconds."""
    manoeuvre: speed.Manoeuvre = getattr(speed, name)()
    return manoeuvre if name == "held" else dataclasses.replace(manoeuvre, voltages=manoeuvre.voltages[:200])


@pytest.mark.parametrize("name", ["held", "controlled"])
def test_scipy_is_as_accurate_as_the_plant_and_no_more_than_asked(name: str) -> None:
    manoeuvre = shortened(name)
    for setting in speed.loosest(rcx(), manoeuvre):
        assert setting.scipy_m <= setting.plant_m < 1e-5
        looser = setting.tolerance * 10
        if looser <= speed.TOLERANCES[0]:
            exact = speed.solve(rcx(), manoeuvre, 1e-10, "LSODA")[:, 5:]
            rough = speed.solve(rcx(), manoeuvre, looser, setting.method)[:, 5:]
            assert np.abs(rough - exact).max() > setting.plant_m


def test_scipy_is_charged_for_few_slopes_where_each_step_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    manoeuvre, calls, real = shortened("controlled"), [0], speed.slope_of

    def counted(model: Model) -> Callable[..., list[float]]:
        slope = real(model)

        def one(*arguments: Any) -> list[float]:
            calls[0] += 1
            return slope(*arguments)

        return one

    settings = speed.loosest(rcx(), manoeuvre)
    monkeypatch.setattr(speed, "slope_of", counted)
    needed = {}
    for one in settings:
        before = calls[0]
        speed.solve(rcx(), manoeuvre, one.tolerance, one.method)
        needed[str(one)] = (calls[0] - before) / len(manoeuvre.voltages)
    assert min(needed.values()) < 12, needed


def test_scipys_robot_is_the_plants() -> None:
    manoeuvre = speed.held()
    found = speed.solve(rcx(), manoeuvre, 1e-8, "LSODA")[:, 5:]
    assert np.abs(found - speed.simulate_plant(rcx(), manoeuvre)).max() < 1e-5
    assert np.abs(found).max() > 0.3


def test_a_robot_that_is_not_the_plants_has_no_equal_accuracy(monkeypatch: pytest.MonkeyPatch) -> None:
    model, heavy = rcx(), dataclasses.replace(rcx(), parameters={**rcx().parameters, "mass": 1.0})
    real = speed.solve

    def solve(given: Model, manoeuvre: speed.Manoeuvre, tolerance: float, method: str) -> speed.Array:
        return real(given if tolerance == 1e-10 else heavy, manoeuvre, tolerance, method)

    monkeypatch.setattr(speed, "solve", solve)
    with pytest.raises(SimulationError, match="no tolerance"):
        speed.loosest(model, shortened("controlled"))


def test_mujoco_does_no_work_that_its_robot_does_not_need() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = speed._mujoco_model()
    assert model is speed._mujoco_model()  # compiled once, outside the timed part
    idle = (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    idle += (mujoco.mjtDisableBit.mjDSBL_GRAVITY, mujoco.mjtDisableBit.mjDSBL_SENSOR)
    assert all(model.opt.disableflags & int(one) for one in idle)
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert speed._mujoco(0.3) == 0.3


def test_the_machine_is_named() -> None:
    assert " cores, " in speed.this_machine()
    assert any(name in speed.compiler() for name in ("gcc", "clang"))
    assert speed.cores() >= 1
