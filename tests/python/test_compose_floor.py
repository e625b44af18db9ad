"""Terms of a floor that is not level are composed from data of the plant, and written as equations."""

from __future__ import annotations

import numpy as np
import pytest
from brickpilot.data.axes import Segment
from brickpilot.discover.compose import atom, find_atoms
from brickpilot.report.composed_law import mathml
from brickpilot.vehicle.composed_terms import equation, legend
from test_compose import BASIS, by_plant, coefficient, terms


def test_waves_of_the_floor_are_told_from_a_force_by_the_accelerometer() -> None:
    waves = {"floor_add_sin_x": 0.04, "floor_add_cos_x": 0.03, "wavelength": 0.4}
    data = by_plant(composed_term=waves)
    found = data.composed()
    assert found is not None
    sizes = {term.basis.name: term.coefficient for term in found.terms}
    assert sizes == pytest.approx({"floor_add_sin_x": 0.04, "floor_add_cos_x": 0.03}, rel=0.1)
    assert found.settings["wavelength"] == pytest.approx(0.4, rel=0.02)
    assert {term.basis.mechanism for term in found.terms} == {"floor"}
    assert not any(part.place == "surge" for rival in data.weighed().rivals for part in rival.parts)


def test_a_ramp_is_found_on_its_strip() -> None:
    ramp = {"floor_add_patch": 0.03, "patch_x": 0.2, "patch_half_width": 0.1}
    found = by_plant(composed_term=ramp).composed()
    assert coefficient(found, "floor_add_patch") == pytest.approx(0.03, rel=0.1)
    assert found is not None
    assert found.settings["patch_x"] == pytest.approx(0.2, abs=0.02)
    assert found.settings["patch_half_width"] == pytest.approx(0.1, rel=0.1)


def test_a_slope_reads_as_on_paper() -> None:
    chosen, settings = terms(floor_add_sin_x=0.04), {"wavelength": 0.5}
    assert equation(chosen, settings) == "ΔS_x = 0.04 sin(2 π x/0.5)"
    written = legend(chosen, settings)
    assert "ΔS_x is added to the sine of the angle by which the floor falls along x; x, y the position" in written
    assert "<msub><mi>S</mi><mi>x</mi></msub>" in mathml(chosen, settings)


@pytest.mark.parametrize(("vehicle", "expected"), [("diff_drive", True), ("motor", False)])
def test_waves_of_the_floor_are_tried_as_one_and_not_under_a_motor(vehicle: str, *, expected: bool) -> None:
    time = np.arange(0.0, 4.0, 0.03)
    positions = {"position": 0.5 * time, "x": 0.5 * time}
    segments = [Segment("run", "accel_surge", slice(0, len(time)), time, 0.0, positions)]
    names = {one.names for one in find_atoms(vehicle, segments, np.sin(9 * time))}
    assert (("floor_add_sin_x", "floor_add_cos_x") in names) == expected
    assert ("surge_push_sin_x", "surge_push_cos_x") in names


def test_a_slope_costs_as_much_as_a_force() -> None:
    wave = (("wavelength", 0.5),)
    slope = atom((BASIS["floor_add_sin_x"], BASIS["floor_add_cos_x"]), wave)
    force = atom((BASIS["surge_push_sin_x"], BASIS["surge_push_cos_x"]), wave)
    assert slope.log_odds == force.log_odds
