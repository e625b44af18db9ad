"""Composed terms in sensor readings: found in data of the plant, and written as equations."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import pytest
from brickpilot.data.axes import Segment
from brickpilot.data.signals import SIGNALS as MEASURABLE
from brickpilot.discover.compose import find_atoms
from brickpilot.report.composed_law import mathml
from brickpilot.vehicle import plant
from brickpilot.vehicle.composed_terms import equation, legend
from brickpilot.vehicle.plant import OpenLoopRun
from synthetic import robot
from test_compose import BASIS, by_plant, coefficient, data_of, terms


def test_a_share_of_the_other_axis_is_found_in_an_accelerometer() -> None:
    found = by_plant(composed_term={"accel_surge_add_b": 0.2}).composed()
    assert coefficient(found, "accel_surge_add_b") == pytest.approx(0.2, rel=0.1)
    assert found is not None
    assert {term.basis.place for term in found.terms} == {"accel_surge"}


def test_a_share_of_the_other_axis_reads_as_on_paper() -> None:
    chosen = terms(accel_surge_add_b=0.2, accel_sway_add_a=-0.1)
    assert equation(chosen, {}) == "Δa_read = 0.2 b; Δb_read = \u22120.1 a"
    assert "b the specific force to the right" in legend(chosen, {})


def test_discs_off_their_axles_are_found_with_their_order() -> None:
    truth = robot(mass=0.92, resistance=22.5)

    def measured(time: np.ndarray, volts: np.ndarray) -> Mapping[str, np.ndarray]:
        outputs = dict(plant.simulate([(truth, OpenLoopRun(time, volts))])[0].outputs)
        for side, size in (("left", 0.04), ("right", -0.04)):
            more = size * np.cos(outputs[f"wheel_angle_{side}"] - 0.5)
            outputs[f"wheel_speed_{side}"] = outputs[f"wheel_speed_{side}"] * (1 + more)
        return outputs

    found = data_of(measured, robot()).composed()
    assert found is not None
    names = {term.basis.name: term.coefficient for term in found.terms}
    assert names.keys() == {"encoder_gain_diff_sin_angle", "encoder_gain_diff_cos_angle"}
    assert np.hypot(*names.values()) == pytest.approx(0.04, rel=0.1)
    assert found.settings["order"] == pytest.approx(1.0, rel=0.01)
    assert {term.basis.mechanism for term in found.terms} == {"sensor"}


def test_a_rotation_sensor_s_error_reads_as_on_paper() -> None:
    chosen = terms(encoder_gain_one=0.05, encoder_gain_diff_cos_angle=-0.04)
    assert equation(chosen, {"order": 2.0}) == "Δw_read = 0.05 w \u2212 0.04 s cos(2 θ) w"
    assert ElementTree.fromstring(mathml(chosen, {"order": 2.0})).tag == "math"
    written = legend(chosen, {"order": 2.0})
    assert "added to the speed of each wheel that is read" in written
    assert "θ its angle" in written


def places(vehicle: str, signal: str) -> set[str]:
    time = np.arange(0.0, 4.0, 0.03)
    segments = [Segment("run", signal, slice(0, len(time)), time, 0.0, {"angle": 5 * time})]
    return {one.place for one in find_atoms(vehicle, segments, np.sin(9 * time))}


def test_rotation_sensors_are_doubted_where_one_of_them_was_logged() -> None:
    wheels = {name for name in MEASURABLE if name.startswith("wheel_")}
    assert len(wheels) == 8
    assert all("encoder" in places("diff_drive", name) for name in wheels)
    assert "encoder" not in places("diff_drive", "yaw_rate")
    assert "encoder" not in places("motor", "speed")
    assert BASIS["encoder_gain_diff_sin_angle"].tuned == ("order",)
