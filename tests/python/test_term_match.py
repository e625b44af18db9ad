"""Composed terms that are a law of the library under another name."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import pytest
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.terms.composed import ComposedTerms
from brickpilot.discover.terms.match import Match, matches
from brickpilot.vehicle import plant
from brickpilot.vehicle.plant import OpenLoopRun, State
from synthetic import robot
from test_compose import RUNS, Data, by_plant, data_of

DRIVEN = Excitation({"voltage": 8.0, "yaw_rate": 8.0})


def found_in(data: Data) -> ComposedTerms:
    found = data.composed()
    assert found is not None
    return found


def matched(data: Data) -> list[Match]:
    return matches(data.prepared.coarse, data.base, found_in(data), DRIVEN)


def best(data: Data) -> Match:
    return matched(data)[0]


@pytest.mark.parametrize(
    ("term", "coefficient", "effect", "law", "mechanism", "parameter", "size"),
    [
        ("yaw_loss_linear", 0.004, "viscous_scrub", "yaw_scrub, but viscous", "tyre", "drag", 0.004),
        ("surge_loss_abs_u", 0.9, "quadratic_drag", "quadratic_drag", "body", "drag", 0.9),
        ("wheel_dry_constant", 0.004, "coulomb_friction", "coulomb_friction", "bearing", "torque", 0.004),
    ],
)
def test_a_term_that_is_an_effect_is_called_by_its_law_and_has_its_size(
    term: str, coefficient: float, effect: str, law: str, mechanism: str, parameter: str, size: float
) -> None:
    one = best(by_plant(composed_term={term: coefficient}))
    assert (one.effect, one.law, one.mechanism) == (effect, law, mechanism)
    assert one.is_equal
    assert one.values[parameter] == pytest.approx(size, rel=0.1)


def test_a_gain_that_falls_with_time_is_a_battery_that_discharges_by_time() -> None:
    fading = dataclasses.replace(robot(mass=0.92, resistance=22.5), effects={"battery_fade": {"rate": 0.08}})
    ages = iter(4.0 * number for number in range(len(RUNS)))

    def measured(time: np.ndarray, volts: np.ndarray) -> Mapping[str, np.ndarray]:
        return plant.simulate([(fading, OpenLoopRun(time, volts, State(age=next(ages))))])[0].outputs

    one = best(data_of(measured, robot()))
    assert one.law == "battery_discharge, but by time"
    assert one.correlation > 0.99
    assert one.values["rate"] == pytest.approx(0.08, rel=0.1)


def test_a_term_that_no_effect_does_equals_none() -> None:
    data = by_plant(composed_term={"surge_push_sin_time": 0.4, "frequency": 1.3})
    found = matched(data)
    assert not any(one.is_equal for one in found)
    assert [one.correlation for one in found] == sorted((one.correlation for one in found), reverse=True)
