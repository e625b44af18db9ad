"""Scores of results of quick suites (with verdicts made by hand), the true regions, and the suites themselves."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden import effects, folder, manoeuvre, measure, other_laws, quick_suites, regions, scales, suites
from hidden.recipe import BENCH, Recipe
from lab import law_claims, law_score, real_table, table
from lab_results import effect, result

TOOLS = Path(__file__).parents[2] / "tools"

SAME = {"law": "same", "mechanisms": None, "names": ["coulomb_friction"]}
OTHER = {"law": "other", "mechanisms": ["supply"], "names": ["battery_discharge", "battery_fade"]}
ODD = {"law": "odd", "mechanisms": ["floor", "body"], "names": []}


def said(law, verdict, *names, mechanism=None, suspected=(), left=1.0, **more):
    """Returns a result of a quick suite whose one hidden effect is `law`; None: nothing is hidden."""
    made = result([] if law is None else ["x"], verdict, *(effect(name) for name in names))
    more = {"laws": {} if law is None else {"x": law}, "mechanism": mechanism, "group": "other"} | more
    more |= {"suspected": [effect(name) for name in suspected], "wrong": more.get("wrong", {})}
    held = {"before": 5.0, "after": left, "removed": 0.9, "floor": "stated"}
    empty = {"called": [], "left_prior": [], "where": [], "regions": [], "cpu_s": 3.0}
    return {**empty, **made, "held_out": held, **more}


@pytest.mark.parametrize(
    ("law", "verdict", "names", "mechanism", "expected"),
    [
        (SAME, "named", ["coulomb_friction"], "bearing", True),
        (SAME, "named", ["coulomb_friction"], None, True),
        (SAME, "named", ["yaw_scrub"], "tyre", False),
        (SAME, "none", [], None, False),
        (OTHER, "unknown", [], "supply", True),
        (OTHER, "unknown", [], "drive", False),
        (OTHER, "unknown", [], None, False),
        (ODD, "unknown", [], "body", True),
        (ODD, "named", ["coulomb_friction"], "bearing", False),
    ],
)
def test_a_mechanism_is_right_whatever_the_law(law, verdict, names, mechanism, expected) -> None:
    assert law_score.mechanism_right(said(law, verdict, *names, mechanism=mechanism)) is expected


@pytest.mark.parametrize(
    ("held", "expected"),
    [([["bearing"]], True), ([["tyre"], ["bearing", "imu"]], True), ([["tyre"]], False), ([[]], False), (None, False)],
)
def test_a_set_holds_the_truth_if_one_explanation_has_its_mechanism(held, expected) -> None:
    assert law_score.set_holds(said(SAME, "ambiguous", "yaw_scrub", held=held)) is expected


def test_a_suspected_name_gives_its_mechanism_where_the_verdict_gives_none() -> None:
    unsure = said(OTHER, "unknown", suspected=["battery_discharge"])
    assert law_score.said_mechanism(unsure) == "supply"
    assert law_score.name_right(unsure)
    assert law_score.law_right(unsure)
    assert law_score.false_names(unsure) == []


@pytest.mark.parametrize(
    ("law", "verdict", "names", "left", "expected"),
    [
        (SAME, "named", ["coulomb_friction"], 9.0, True),
        (SAME, "named", ["rolling_sqrt"], 1.0, True),  # of the same family
        (SAME, "named", ["coulomb_friction", "yaw_scrub"], 1.0, False),
        (SAME, "unknown", [], 1.0, False),
        (OTHER, "named", ["battery_fade"], 1.05, True),  # only noise is left: no law can be refuted
        (OTHER, "named", ["battery_fade"], 1.5, False),
        (OTHER, "named", ["motor_heating"], 1.0, False),
        (OTHER, "unknown", [], 1.5, True),
        (ODD, "named", ["coulomb_friction"], 1.0, False),
    ],
)
def test_a_law_is_right_or_said_to_differ(law, verdict, names, left, expected) -> None:
    mechanism = "bearing" if law is SAME else "supply"
    assert law_score.law_right(said(law, verdict, *names, mechanism=mechanism, left=left)) is expected


def test_rivals_hold_the_right_law_alone() -> None:
    rivals = result(["x"], "ambiguous", effect("motor_heating", "battery_fade", "yaw_scrub"))
    assert law_score.law_right(said(OTHER, "ambiguous") | {"effects": rivals["effects"]})
    both = result(["x"], "ambiguous", effect("motor_heating", "battery_fade + yaw_scrub"))
    assert not law_score.law_right(said(OTHER, "ambiguous") | {"effects": both["effects"]})
    for rival in ("battery_fade + supply_gain", "supply_gain", "nominal values"):  # no effects of the library
        other = result(["x"], "ambiguous", effect("motor_heating", rival))
        assert not law_score.law_right(said(OTHER, "ambiguous") | {"effects": other["effects"]})


def test_a_false_name_is_one_given_as_certain_outside_the_family() -> None:
    assert law_score.false_names(said(OTHER, "named", "battery_discharge", "yaw_scrub")) == ["yaw_scrub"]
    assert law_score.false_names(said(ODD, "named", "yaw_scrub")) == ["yaw_scrub"]
    assert law_score.false_names(said(None, "named", "yaw_scrub")) == ["yaw_scrub"]
    assert law_score.false_names(said(None, "ambiguous", "yaw_scrub")) == []
    assert law_score.false_names(said(None, "none")) == []


def test_a_wrong_nominal_value_is_reported_by_itself_or_as_its_effect() -> None:
    wrong = {"wrong": {"mass": -0.2, "yaw_inertia": -0.1}, "called": ["payload_mass"]}
    assert law_score.nominal_found(said(None, "none", left_prior=["yaw_inertia"], **wrong))
    assert law_score.nominal_found(said(None, "named", "payload_mass", **wrong))
    assert law_score.nominal_found(said(None, "ambiguous", suspected=["payload_mass"], **wrong))
    assert not law_score.nominal_found(said(None, "ambiguous", suspected=["yaw_scrub"], **wrong))
    assert not law_score.nominal_found(said(None, "none", left_prior=["resistance"], **wrong))
    assert not law_score.nominal_found(said(None, "none", **wrong))
    assert law_score.false_names(said(None, "named", "payload_mass", **wrong)) == []


def place(run, signal, first, last, when="throughout"):
    return {"run": run, "signal": signal, "from_s": first, "to_s": last, "share_of_gap": 1.0, "when": when}


def test_places_are_compared_in_seconds_of_each_signal() -> None:
    known = [place("a", "yaw_rate", 1.0, 3.0, "turning"), place("a", "yaw_rate", 4.0, 5.0), place("b", "speed", 0, 1)]
    told = [place("a", "yaw_rate", 2.0, 5.0, "turning"), place("b", "yaw_rate", 0.0, 1.0)]
    one = said(OTHER, "unknown", where=told, regions=known)
    seconds = law_score.overlap(one)
    assert (seconds.said, seconds.known, seconds.both) == pytest.approx((4.0, 4.0, 2.0))
    assert seconds.f1 == pytest.approx(0.5)
    assert law_score.condition_share(one) == (1, 1)
    twice = said(OTHER, "unknown", where=[*told, *told], regions=known)
    assert law_score.overlap(twice) == seconds  # the same span, reported twice, adds nothing
    assert law_score.overlap(said(OTHER, "unknown", where=told)).f1 is None
    assert law_score.overlap(said(OTHER, "unknown", regions=known)).f1 == 0.0


def test_each_suite_is_reported_apart_with_intervals() -> None:
    right = [said(OTHER, "unknown", mechanism="supply", cpu_s=float(k)) for k in range(8)]
    wrong = [said(OTHER, "named", "yaw_scrub", mechanism="tyre", cpu_s=9.0) for _ in range(2)]
    clean = [said(None, "none", group="nulls") for _ in range(3)] + [said(None, "named", "yaw_scrub", group="nulls")]
    made = law_claims.by_suite([*right, *wrong, *clean])
    assert [name.split(":")[0] for name in made] == ["other", "nulls"]
    others = {claim.what: claim for claim in next(iter(made.values()))}
    assert others["mechanism right"].value == 0.8
    assert others["mechanism right"].interval == (pytest.approx(0.490, abs=1e-3), pytest.approx(0.943, abs=1e-3))
    assert others["mechanism right"].holds is False
    assert others["a wrong name given as certain"].value == 0.2
    assert others["processor time"].interval == (1.0, 9.0)
    nulls = {claim.what: claim for claim in list(made.values())[1]}
    assert (nulls["a name given as certain"].value, nulls["a name given as certain"].holds) == (0.25, None)


def test_an_interval_of_a_median_covers_as_often_as_it_says() -> None:
    random = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        low, high = law_claims.median("x", random.normal(size=15).tolist(), "").interval
        held += low <= 0.0 <= high
    assert held / 400 >= 0.94
    assert law_claims.median("x", [1.0, 2.0, 3.0], "").interval is None
    assert law_claims.median("x", [], "").value is None


def test_the_table_holds_the_suites_beside_the_long_ones_and_is_written(tmp_path) -> None:
    results = [said(OTHER, "unknown", mechanism="supply"), result(["a"], "named", effect("a"))]
    made = table.table(results)
    single = {one["what"]: one["of"] for one in made["claims"]["all"]}
    assert single["single, clearly visible, wheel speeds measured: right name"] == 1  # without the quick suite's result
    text = "\n".join(table.lines(made))
    assert "== suite other: one effect, by another law ==" in text
    assert "[+] mechanism right" in text
    table.write(made, tmp_path)
    assert json.loads((tmp_path / "table.json").read_text())["sets"] == 2
    page = (tmp_path / "table.md").read_text()
    begin, end = table.MARKS
    shown = (TOOLS / "docs/benchmarks.md").read_text()
    assert shown.count(begin) == shown.count(end) == 1
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    real_table.write_between_marks(readme, page.splitlines(), table.MARKS)
    assert readme.read_text() == f"before\n{begin}\n{page}{end}\nafter\n"
    assert "| `other` | one effect, by another law: mechanism right | 100.0 % | 20.7..100.0 | 1 | >= 95 % |" in page


def test_the_regions_of_a_sensors_error_are_its_signal_alone() -> None:
    runs = manoeuvre.steps("ahead", 2.0, (0.5, 5, 5)), manoeuvre.steps("still", 1.0)
    recipe = Recipe("set", {"encoder_one_side": {"error": 0.05}}, engine="planar", runs=runs)
    (region,) = measure.shown(recipe).regions
    assert (region["run"], region["signal"]) == ("ahead", "wheel_speed_left")
    assert 0.45 <= region["from_s"] <= 0.7  # from the speed on at which the error is larger than the noise
    assert region["to_s"] == pytest.approx(2.0, abs=0.01)
    assert (region["share"], region["when"]) == (1.0, "at high speed")
    assert measure.shown(replace(recipe, hidden={})).regions == []


def test_a_region_says_what_the_vehicle_was_doing() -> None:
    run = manoeuvre.steps("turns", 4.0, (0.0, 3, 3), (1.5, 3, -3), (3.0, 3, 3))
    recipe = Recipe("set", {"gyro_scale": {"error": 0.1}}, engine="planar", runs=(run,))
    (region,) = measure.shown(recipe).regions
    assert region["signal"] == "yaw_rate"
    assert region["from_s"] == pytest.approx(1.5, abs=0.2)
    assert region["to_s"] == pytest.approx(3.8, abs=0.2)  # as the spin decays, the error falls from 28 sd of the noise
    assert region["when"] in ("turning right", "turning")


def test_spans_bridge_short_breaks_and_keep_long_ones() -> None:
    square = np.zeros(1000)
    square[100:200] = square[250:300] = square[700:800] = 4.0
    assert regions._spans(square, 0.01) == [(100, 200), (250, 300), (700, 800)]
    assert regions._spans(square, 0.001) == [(100, 300), (700, 800)]


def test_a_straight_run_does_not_turn() -> None:
    """The turn rate is only rounding error: no condition may result from it."""
    speed, turn = np.linspace(0.0, 0.5, 100), 1e-9 * np.sin(np.arange(100))
    found = regions.conditions(speed, turn)
    assert not any(found[name].any() for name in ("turning", "turning left", "turning right"))
    assert found["at high speed"].sum() == 50
    assert not regions.conditions(0 * speed, turn)["speed > 0"].any()


# ---- the suites


def test_quick_suites_hold_every_effect_and_every_other_law() -> None:
    assert [next(iter(one.hidden)) for one in quick_suites.same()] == list(effects.LIBRARY)
    made = {next(iter(one.hidden)) for engine in ("mujoco", "planar") for one in quick_suites.other(0, engine)}
    assert made == set(other_laws.OTHER)
    assert len(quick_suites.nulls()) == 200
    assert not any(one.hidden for one in (*quick_suites.nulls(), *quick_suites.nominal()))
    for suite in quick_suites.SUITES.values():
        ours, theirs = suite(suites.CALIBRATION), suite(suites.REPORT)
        assert all(one.suite for one in ours)
        assert not {one.seed for one in ours} & {one.seed for one in theirs}
        assert all(one.vehicle != other.vehicle for one, other in zip(ours, theirs, strict=True))


def test_a_wrong_value_has_an_sd_that_denies_it_and_no_sd_means_none() -> None:
    for recipe in quick_suites.nominal():
        believed = folder.nominal(recipe)
        assert all("sd" in value for value in believed.values())
        for name, off in recipe.wrong.items():
            true = getattr(recipe.vehicle, name)
            assert believed[name]["value"] == pytest.approx(true * (1 + off))
            assert abs(off) >= 4 * recipe.nominal_error
    bare = [one for one in quick_suites.nulls() if one.sds == "none"]
    assert len(bare) > 50
    assert not any("sd" in value for value in folder.nominal(bare[0]).values())


@pytest.mark.parametrize("kind", scales.KINDS)
def test_robots_of_other_scales_drive_within_their_sensors(kind) -> None:
    runs = scales.at_voltage(manoeuvre.short(), kind)
    assert max(max(map(abs, run.left)) for run in runs) == pytest.approx(kind.battery_voltage)
    tracks = measure.tracks(Recipe("set", vehicle=kind, engine="planar", runs=runs))
    for track in tracks:
        assert np.abs(track.yaw_rate).max() < measure.RANGE["yaw_rate"] - 5 * measure.NOISE_SD["yaw_rate"]
        assert np.abs(track.wheel_speed_left).max() < measure.RANGE["wheel_speed_left"]
        slip = kind.wheel_radius * track.wheel_speed_left - (track.surge + kind.half_track * track.yaw_rate)
        assert np.sqrt(np.mean(slip**2)) / kind.wheel_radius < measure.NOISE_SD["wheel_speed_left"] / 2
    assert max(np.abs(track.yaw_rate).max() for track in tracks) > 2.0
    assert kind.mass != BENCH.mass


def test_a_claimed_name_is_right_for_another_law_if_it_is_said_to_differ() -> None:
    """For a law of the library, the statement that the law differs is wrong.

    So a verdict that always states a difference does not score better.
    """
    other = said(OTHER, "named", "battery_fade", mechanism="supply", left=5.0)
    assert not law_score.law_right(other)
    assert law_score.law_right(other | {"law_differs": True})
    same = said(SAME, "named", "coulomb_friction", mechanism="bearing", left=1.0)
    assert law_score.law_right(same)
    assert not law_score.law_right(same | {"law_differs": True})
