"""The verdict's rules, each on explanations made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from brickpilot.discover import verdict
from brickpilot.discover.terms.basis import basis


def explanation(*names: str, cost: float) -> Any:
    return SimpleNamespace(names=names, chosen=names, penalised_cost=cost)


def test_what_an_explanation_is_without_its_undetermined_effect_is_a_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two effects fit best, but one of them is undetermined: the other one alone competes with the best that is left.

    On the log of a drivetrain dry friction was so lost, and a carpet's nap was named.
    """
    nap, pair = explanation("nap", cost=410.0), explanation("friction", "mismatch", cost=313.0)
    friction = explanation("friction", cost=361.0)
    prepared: Any = SimpleNamespace(fine=None, jobs=1)
    monkeypatch.setattr(verdict, "drop_undetermined", lambda _, one, __: friction if one is pair else one)
    monkeypatch.setattr(verdict, "_is_possible", lambda *_: True)
    monkeypatch.setattr(verdict, "passes_gates", lambda *_: True)
    nothing: Any = None
    found = verdict._determined(prepared, nothing, nap, [pair, nap], None)
    assert [one.names for one in found] == [("friction",), ("nap",)]

    monkeypatch.setattr(verdict, "passes_gates", lambda _, __, one, ___: one is not friction)
    assert verdict._determined(prepared, nothing, nap, [pair, nap], None) == [nap]


def test_a_torque_that_goes_with_the_current_is_the_motor_s() -> None:
    of = {one.name: one.mechanism for one in basis()}
    with_current = {one.name for one in basis() if one.place == "wheel" and "i" in one.symbols}
    assert with_current
    assert {of[name] for name in with_current} == {"motor"}
    assert of["wheel_loss_linear"] == "bearing"
    assert of["gyro_add_current_sum"] == "sensor"
    assert {one.mechanism for one in basis() if one.place == "drive"} == {"drive"}
