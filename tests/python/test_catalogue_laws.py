"""Which laws belong together, and what a verdict calls them."""

from __future__ import annotations

import pytest
from brickpilot import catalogue


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
