"""Which laws belong together, and what a verdict calls them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import rcx


def test_a_plain_law_is_called_by_its_name() -> None:
    assert catalogue.family("coulomb_friction") == "coulomb_friction"
    assert catalogue.law("coulomb_friction", {"torque": 0.01}) == "coulomb_friction"


def test_a_variant_is_called_by_its_family_and_what_differs() -> None:
    assert catalogue.family("stiction_stribeck") == "coulomb_friction"
    assert catalogue.law("stiction_stribeck", {}) == "coulomb_friction, but larger near standstill"


@pytest.mark.parametrize(
    ("values", "law", "mechanism"),
    [
        ({"torque": 0.01}, "direction_asymmetry", "bearing"),
        (
            {"torque": 0.0, "gain": 0.1},
            "direction_asymmetry, but in the gain of the drive",
            "drive",
        ),
        (
            {"torque": 0.01, "gain": 0.1},
            "direction_asymmetry, but in the gain of the drive",
            "bearing",
        ),
        (
            {"drag": 0.01, "gain": 0.1},
            "direction_asymmetry, but in the linear losses and in the gain of the drive",
            "bearing",
        ),
    ],
)
def test_parameters_that_act_change_the_law_and_alone_the_mechanism(
    values: dict[str, float], law: str, mechanism: str
) -> None:
    assert catalogue.law("direction_asymmetry", values) == law
    assert catalogue.mechanism("direction_asymmetry", values) == mechanism


def test_every_variant_shares_the_mechanism_of_its_family() -> None:
    variants = [info for info in catalogue.effects() if info.variant_of]
    assert len(variants) >= 5
    for info in variants:
        family = catalogue.effect(catalogue.family(info.name))
        assert (family.mechanism, family.variant_of) == (info.mechanism, "")


def added(effects: dict[str, dict[str, float]], left: float, right: float) -> np.ndarray:
    """Returns what `effects` add to the signals, but the summed yaw, of a robot that drives at two voltages for 1 s."""
    time = np.arange(0, 1, 0.003)
    run = plant.OpenLoopRun(time, np.tile([left, right], (len(time), 1)))
    plain, other = plant.simulate([(rcx(), run), (dataclasses.replace(rcx(), effects=effects), run)])
    return np.array([other.outputs[name] - plain.outputs[name] for name in plain.outputs if name != "yaw_angle"])


def test_exactly_the_offsets_of_readings_have_no_shape() -> None:
    """They add a constant, whatever moves: no shape of their law can be wrong."""
    for info in catalogue.effects():
        if info.composed or not info.is_searched:
            continue
        presets = {info.name: {row.name: row.preset for row in info.parameters}}
        curve, spin = added(presets, 8.0, 5.0), added(presets, -4.0, 4.0)
        is_constant = curve.any() and np.allclose([curve, spin], curve[:, :1], atol=1e-9)
        assert is_constant == info.shapeless, info.name
    assert [info.name for info in catalogue.effects() if info.shapeless] == ["accel_bias", "gyro_bias"]
