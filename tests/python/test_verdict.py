"""The verdict's rules, each on explanations made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from brickpilot.discover import pipeline, verdict
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

    monkeypatch.setattr(verdict, "passes_gates", lambda _, __, ___, one, ____: one is not friction)
    assert verdict._determined(prepared, nothing, nap, [pair, nap], None) == [nap]


def test_what_holds_a_fallen_explanation_s_effects_may_take_its_place() -> None:
    """Nothing was left of the best explanation, so that every other one counted as the same with more effects.

    A drive that loses voltage against the current was so told as nothing.
    """
    best, other = explanation("loss", "friction", cost=100.0), explanation("loss", "stiction", cost=120.0)
    far, nothing = explanation("drag", cost=900.0), explanation(cost=110.0)
    best.cost = 100.0
    found: Any = SimpleNamespace(best=best, rounds=[SimpleNamespace(tried=[best, other, far, nothing])])
    assert verdict._near_best(found, None) == [best, other]
    assert verdict._near_best(found, explanation("loss", cost=100.0)) == []
    assert verdict._near_best(found, best) == [other]


def test_a_ripple_that_explains_half_of_windows_is_listed_without_a_claim() -> None:
    def judged(removed: float, *, periodic: bool = True) -> Any:
        found = SimpleNamespace(cost=100.0 - 90.0 * removed, is_periodic=periodic, chosen=("ripple",))
        nominal: Any = SimpleNamespace(cost=100.0, chosen=())
        return verdict.Verdict("named", nominal, found, (found,), (found,), 10.0, 1.0)  # type: ignore[arg-type]

    suspected = verdict.suspected_in_windows(judged(0.6))
    assert suspected is not None
    assert (suspected.kind, suspected.best, suspected.rivals) == ("unknown", suspected.nominal, ())
    assert suspected.removed_by(suspected.unclaimed) == pytest.approx(0.6)  # type: ignore[arg-type]
    assert verdict.suspected_in_windows(judged(0.4)) is None
    assert verdict.suspected_in_windows(judged(0.6, periodic=False)) is None


def test_a_term_takes_the_place_of_many_effects_of_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """An encoder that reads too little was told as wheel radius, torque constant and centre of mass together."""
    fitted = SimpleNamespace(parameter_count=1, cost=1.2)
    term = SimpleNamespace(alone=True, terms=SimpleNamespace(fitted=fitted))
    monkeypatch.setattr(pipeline, "compose", lambda *_: term)
    found = explanation("radius", "torque", "mass", cost=2.0)
    found.parameter_count = 3
    windows: Any = SimpleNamespace(verdict=SimpleNamespace(best=found))
    whole = pipeline.Explained(None, None, SimpleNamespace(noise=1.0))  # type: ignore[arg-type]
    assert pipeline._simpler_term(whole, windows, None).composed is term  # type: ignore[arg-type, union-attr]
    fitted.cost = 2.0  # more than noise
    assert pipeline._simpler_term(whole, windows, None) is None  # type: ignore[arg-type]
    fitted.cost, fitted.parameter_count = 1.2, 3
    assert pipeline._simpler_term(whole, windows, None) is None  # type: ignore[arg-type]
    fitted.parameter_count, found.chosen = 1, ("radius", "torque")
    assert pipeline._simpler_term(whole, windows, None) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("removed", "kept"), [(0.5, 1), (0.2, 0)])
def test_values_of_the_runs_do_not_take_what_unclaimed_effects_explain(
    monkeypatch: pytest.MonkeyPatch, removed: float, kept: int
) -> None:
    """A drive's loss, suspected and not claimed, left delays that differed from run to run, and the verdict none."""
    values = SimpleNamespace(removed=removed, applied=False, kind=pipeline.KINDS[0])
    monkeypatch.setattr(pipeline, "values_that_differ", lambda *_: values)
    lasting: Any = SimpleNamespace(until=lambda _: SimpleNamespace(allows=lambda _: True))
    found: Any = SimpleNamespace(best=None, removed_unclaimed=0.3)
    explained = pipeline.Explained(lasting, None, found)  # type: ignore[arg-type]
    assert pipeline._explain_with_run_values(explained, None) == (explained, (values,) * kept)  # type: ignore[arg-type]


def test_a_torque_that_goes_with_the_current_is_the_motor_s() -> None:
    of = {one.name: one.mechanism for one in basis()}
    with_current = {one.name for one in basis() if one.place == "wheel" and "i" in one.symbols}
    assert with_current
    assert {of[name] for name in with_current} == {"motor"}
    assert of["wheel_loss_linear"] == "bearing"
    assert of["gyro_add_current_sum"] == "sensor"
    assert {one.mechanism for one in basis() if one.place == "drive"} == {"drive"}
