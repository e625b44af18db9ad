"""Coefficients of the firmware's motor model for a robot of unknown inductance."""

from __future__ import annotations

import math

import pytest
from brickpilot.vehicle import coefficients, combinations
from brickpilot.vehicle.model import rcx


@pytest.mark.parametrize("step", [0.003, 0.009])
def test_a_motor_without_inductance_has_the_current_of_its_voltage(step: float) -> None:
    values = {**rcx().parameters, "inductance": 0.0}
    inertia = combinations.mean_inertia(values)
    found = coefficients.motor_step(values, inertia, step)
    stiff = values["torque_constant"] / values["resistance"]
    damping = stiff * values["emf_constant"] + combinations.loss(values)
    pole = math.exp(-damping / inertia * step)
    assert found.transition[1, 1] == pytest.approx(pole, rel=1e-4)
    assert found.voltage[1] == pytest.approx(stiff / damping * (1 - pole), rel=1e-3)
    current = (1 - values["emf_constant"] * found.voltage[1]) / values["resistance"]
    assert found.voltage[0] == pytest.approx(current, rel=1e-3)
    assert abs(found.transition[0, 0]) < 1e-3
