"""Composed terms of what sensors read: found in data of the plant, and written as equations."""

from __future__ import annotations

import pytest
from brickpilot.discover.terms.equation import equation
from test_compose import by_plant, coefficient, terms


def test_a_share_of_the_other_axis_is_found_in_an_accelerometer() -> None:
    found = by_plant(composed_term={"accel_surge_add_b": 0.2}).composed()
    assert coefficient(found, "accel_surge_add_b") == pytest.approx(0.2, rel=0.1)
    assert found is not None
    assert found.places == ("accel_surge",)


def test_a_share_of_the_other_axis_reads_as_on_paper() -> None:
    written = equation(terms(accel_surge_add_b=0.2, accel_sway_add_a=-0.1), {})
    assert written.text == "Δa_read = 0.2 b; Δb_read = \u22120.1 a"
    assert "b the specific force to the right" in written.legend
