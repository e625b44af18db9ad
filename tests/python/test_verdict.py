"""The error that is left decides between a name and `unknown`. test_criterion.py tests how evidence is weighed."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.discover import adequacy, numbers, verdict
from brickpilot.discover.adequacy import Adequacy
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import FINE, Explanation, fit, is_possible, joined, refine
from brickpilot.discover.parts import Excitation, RunPart, library_parts
from brickpilot.discover.prepare import SD_SHARE, calibrate, prepare
from brickpilot.discover.search import Library, Search
from brickpilot.fit.parameters import Plan
from brickpilot.fit.problem import Problem
from brickpilot.vehicle.composed_terms import basis
from brickpilot.vehicle.model import Model
from synthetic import robot, write
from test_criterion import CHANCE, found_in, judged, made

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
STATED = "\n".join(f"{name} = {value}" for name, value in robot().parameters.items() if value and "per" not in name)
MOVES = {
    f"{name}_{volts:g}": (left * volts, right * volts)
    for volts in (3.0, 5.0)
    for name, left, right in (("ahead", 1, 1), ("back", -1, -1), ("spin", 1, -1), ("curve", 1, 0.4))
}
FRICTION = {"coulomb_friction": {"torque": 0.006}}


def test_a_model_whose_values_stand_in_for_an_effect_does_not_hide_it(tmp_path: Path) -> None:
    """With a resistance near 0 the inductance acts as a lag. A fit that starts there finds no lag of the drive."""
    truth = dataclasses.replace(robot(inductance=0.004), effects={"actuator_lag": {"time_constant": 0.05}})
    stated = "\n".join(f"{name} = {truth.parameters[name]}" for name in SD_SHARE if truth.parameters[name])
    moves, noise = {"ahead": (4.0, 4.0), "back": (-5.0, -5.0), "spin": (4.0, -4.0)}, dict(NOISE, yaw_rate=0.005)
    folder = write(tmp_path / "set", truth, noise, stated, manoeuvres=moves, roles=["fit"] * 3)
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    point = np.array(nominal.point)
    point[[one.name in ("resistance", "torque_constant") for one in nominal.plan.free]] -= np.log(100.0)
    moved = fit(Problem(prepared.coarse, nominal.plan), (), nominal.plan, point, FINE)
    assert moved is not None
    assert moved.cost < nominal.cost
    assert moved.model.parameters["resistance"] < 0.01 * truth.parameters["resistance"]
    library = Library(prepared.excitation, 1)
    search = Search(prepared.coarse, moved, library, prepared.excitation, 1, prepared.deadline, lambda _: None)
    best = search.run(Judge.of(prepared.coarse, 0)).ranked()[0].explanation
    assert best.names == ("actuator_lag",)
    assert best.model.parameters["resistance"] == pytest.approx(truth.parameters["resistance"], rel=0.05)
    assert best.model.effects["actuator_lag"]["time_constant"] == pytest.approx(0.05, rel=0.05)


def test_an_effect_that_hides_in_a_stated_value_is_searched_even_where_little_is_left(tmp_path: Path) -> None:
    """Rotation sensors that count 15 % too much make the wheels look too small, even if only noise is left."""
    truth = dataclasses.replace(robot(), effects={"encoder_scale": {"error": 0.15}})
    folder = write(tmp_path / "set", truth, NOISE, STATED, manoeuvres=MOVES, roles=["fit"] * len(MOVES))
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    judge = Judge.of(prepared.coarse, 0)
    judge = dataclasses.replace(judge, top=judge.of_explanation(nominal).total - 100)
    library = Library(prepared.excitation, 1)
    search = Search(prepared.coarse, nominal, library, prepared.excitation, 1, prepared.deadline, lambda _: None)
    assert frozenset({"encoder_scale"}) in search.run(judge).table


@pytest.mark.parametrize(("drag", "is_searched"), [(0.06, False), (0.3, True)])
def test_a_second_law_is_searched_only_beyond_what_the_first_one_s_shape_may_leave(
    drag: float, is_searched: bool, tmp_path: Path
) -> None:
    """A drag of 0.06 N s/m leaves 31 times what counts as one nat, but less than 5 % of the squares."""
    truth = dataclasses.replace(robot(), effects={**FRICTION, "surge_drag": {"drag": drag}})
    folder = write(tmp_path / "set", truth, NOISE, STATED, manoeuvres=MOVES, roles=["fit"] * len(MOVES))
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    library, said = Library(prepared.excitation, 2), list[str]()
    search = Search(prepared.coarse, nominal, library, prepared.excitation, 1, prepared.deadline, said.append)
    named = verdict.weigh(search.run(Judge.of(prepared.coarse, 0))).best.names
    assert ("searching for effect 2" in said) == is_searched
    assert named == (("coulomb_friction", "surge_drag") if is_searched else ("coulomb_friction",))


def test_where_no_part_alone_surely_predicts_better_no_two_are_tried(tmp_path: Path) -> None:
    """Otherwise parts that predict better only together give false names for a sensor law that the library lacks."""
    folder = write(tmp_path / "set", robot(), NOISE, STATED, manoeuvres=MOVES, roles=["fit"] * len(MOVES))
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    judge = Judge.of(prepared.coarse, 0)
    judge = dataclasses.replace(judge, top=judge.of_explanation(nominal).total + 200)
    library, said = Library(prepared.excitation, 2), list[str]()
    search = Search(prepared.coarse, nominal, library, prepared.excitation, 1, prepared.deadline, said.append)
    found = search.run(judge)
    assert "searching for effect 1" in said
    assert "searching for effect 2" not in said
    assert all(len(key - {"gyro_bias"}) <= 1 for key in found.table)  # beside an offset another part may be sure


def test_two_parts_that_make_one_law_are_tried_as_that(tmp_path: Path) -> None:
    """Friction in only one direction equals dry friction plus a constant offset."""
    truth = dataclasses.replace(robot(), effects={"direction_asymmetry": {"torque": -0.01}})
    moves = {"ahead": (4.0, 4.0), "back": (-5.0, -5.0), "spin": (4.0, -4.0)}
    folder = write(tmp_path / "set", truth, NOISE, STATED, manoeuvres=moves, roles=["fit"] * 3)
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    library = Library(prepared.excitation, 2)
    search = Search(prepared.coarse, nominal, library, prepared.excitation, 1, prepared.deadline, lambda _: None)
    parts = {one.name: one for one in library_parts(nominal.model) if one.free == ("torque",)}
    both = joined(nominal, parts["coulomb_friction"], {"torque": 0.004})
    both = joined(both, parts["constant_offset"], {"torque": -0.004})
    (both,) = refine(prepared.coarse, [both], 1)
    other_laws = search._in_other_laws(both)
    (one_law,) = refine(prepared.coarse, [one for one in other_laws if one.names == ("direction_asymmetry",)], 1)
    assert one_law.names == ("direction_asymmetry",)
    assert one_law.cost < both.cost + 5
    there = search._in_other_laws(joined(both, one_law.parts[-1], {"torque": -0.01}))
    assert ("direction_asymmetry",) not in [one.names for one in there]  # the model has this law already
    assert dataclasses.replace(search, base=both)._in_other_laws(both) == []  # the parts of the base stay
    assert one_law.model.effects["direction_asymmetry"]["torque"] == pytest.approx(-0.01, rel=0.1)


@pytest.mark.parametrize(
    ("left", "is_adequate", "said"),
    [
        (Adequacy({"speed": 0.1, "yaw_rate": 0.2}, {"speed": 0.1}, {"speed": 0.9}), True, ""),
        (Adequacy({"speed": 0.1, "yaw_rate": 0.21}, {}, {}), False, "21 % of the error of yaw_rate"),
        (Adequacy({}, {"speed": 5.0}, {"speed": 0.51}), True, ""),
        (Adequacy({}, {"speed": 0.31}, {"speed": 0.49}), False, "0.31 nats a value. The best explanation removes 49 %"),
        (Adequacy({}, {"speed": 0.29}, {"speed": 0.0}), True, ""),
        (Adequacy({}, {"speed": 0.0, "yaw_rate": 0.31}, {"speed": 1.0, "yaw_rate": 0.49}), False, "error of yaw_rate"),
        (Adequacy({}, {}, {}), True, ""),
    ],
)
def test_what_is_left_is_too_much_if_it_is_predictable_or_most_of_it(
    left: Adequacy, is_adequate: bool, said: str
) -> None:
    assert left.is_adequate == is_adequate
    assert said in left.sentence
    assert bool(left.sentence) != is_adequate


def left_by(folder: Path, effects: dict[str, dict[str, float]], name: str | None, *, spoil=None) -> Adequacy:
    """Returns the adequacy, for a robot with `effects`, of the nominal model; or of that model with effect `name`."""
    truth = dataclasses.replace(robot(), effects=effects)
    folder = write(folder, truth, NOISE, STATED, manoeuvres=MOVES, roles=["fit"] * len(MOVES), spoil=spoil)
    prepared, nominal = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    judge, best = Judge.of(prepared.coarse, 0), nominal
    if name is not None:
        part = next(one for one in library_parts(nominal.model) if one.effect == name)
        best = refine(prepared.coarse, [joined(nominal, part, effects[name])], 1)[0]
    nothing = judge.of_explanation(nominal)
    return adequacy.adequacy(judge, judge.of_explanation(best), nothing, nothing, 0)


def test_dry_friction_is_predictable_until_it_is_explained(tmp_path: Path) -> None:
    lacking = left_by(tmp_path / "lacking", FRICTION, None)
    assert not lacking.is_adequate
    assert lacking.most_predictable > 0.5
    assert {*lacking.explained.values()} == {0.0}
    assert lacking.leaves_more_than_noise
    right = left_by(tmp_path / "right", FRICTION, "coulomb_friction")
    assert right.is_adequate
    assert right.most_predictable < 0.1
    assert min(right.explained.values()) > 0.95
    assert max(right.left.values()) < 0.1


@pytest.mark.parametrize(("share", "is_adequate"), [(1.0, True), (1.05, True), (1.4, False)])
def test_a_law_may_be_wrong_by_a_share_of_what_it_explains(tmp_path: Path, share: float, is_adequate: bool) -> None:
    """A black box predicts all error that friction of a wrong size leaves: 0.2 % or 16 % of what friction explains."""
    size = FRICTION["coulomb_friction"]["torque"]
    truth = dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": share * size}})
    folder = write(tmp_path / "data", truth, NOISE, STATED, manoeuvres=MOVES, roles=["fit"] * len(MOVES))
    prepared, _ = calibrate(prepare(reading.read(folder), None, seed=0, jobs=1)[0])
    judge, stated = Judge.of(prepared.coarse, 0), robot()
    best = dataclasses.replace(stated, effects=FRICTION)
    left = adequacy.predictable(judge, best, stated, 0)
    assert (max(left.values()) <= numbers.SHARED_REST) is is_adequate
    alone = adequacy.predictable(judge, stated, stated, 0)
    assert max(alone.values()) > 0.5


def test_of_noise_nothing_is_predicted(tmp_path: Path) -> None:
    nothing = left_by(tmp_path / "noise", {}, None)
    assert nothing.is_adequate
    assert nothing.most_predictable < 0.1


def test_an_error_that_nobody_can_predict_is_too_much_where_nothing_is_explained(tmp_path: Path) -> None:
    """A slow random walk on each run's yaw rate: no law and no black box predicts it on an unseen run."""
    random = np.random.default_rng(4)

    def wander(_: str, table: dict[str, np.ndarray]) -> None:
        table["yaw_rate"] = table["yaw_rate"] + np.cumsum(random.normal(0, 0.06, len(table["t"])))

    for effects, name in (({}, None), (FRICTION, "coulomb_friction")):  # also if another signal is explained
        left = left_by(tmp_path / f"walk{name}", effects, name, spoil=wander)
        assert left.most_predictable < numbers.SHARED_REST
        assert left.left["wheel_speed_left"] < 0.1
        assert left.unexplained == "yaw_rate"
        assert left.leaves_more_than_noise
        assert not left.is_adequate
        assert "Neither" in left.sentence


def test_folds_are_whole_runs_and_of_one_run_blocks_of_time() -> None:
    names = ["a"] * 50 + ["b"] * 30 + ["c"] * 20 + ["d"] * 10 + ["e"] * 5
    folds = adequacy.folds_of(names, np.arange(len(names)) * 0.1)
    assert all(len({fold for fold, one in zip(folds, names, strict=True) if one == name}) == 1 for name in names)
    assert len(set(folds)) == 4
    assert folds[-1] == folds[100]  # the shortest runs share a fold
    alone = adequacy.folds_of(["a"] * 800, np.arange(800) * 0.1)
    assert np.flatnonzero(np.diff(alone)).tolist() == [99, 199, 299, 399, 499, 599, 699]
    assert alone[0] == alone[400]


def test_a_black_box_that_proved_bold_is_scaled_down() -> None:
    random = np.random.default_rng(0)
    columns = random.normal(size=(400, 3))
    folds = np.repeat(np.arange(4), 100)
    told = columns[:, 0] + 0.1 * random.normal(size=400)
    seen = adequacy.out_of_fold(columns, told, folds, 0)
    assert seen.factor > 0.9
    assert np.corrcoef(seen.value, told)[0, 1] > 0.9
    noise = adequacy.out_of_fold(columns, random.normal(size=400), folds, 0)
    assert np.sum(noise.value**2) < 0.1 * 400


def test_prior_odds_are_those_of_the_effect_table() -> None:
    odds = {one.effect: np.exp(one.log_odds) for one in library_parts(Model("m", "diff_drive", "coupled", {}))}
    of_prior = {"common": 0.05, "usual": 0.05 * 0.2**0.5, "rare": 0.01}
    for effect in catalogue.effects():
        if effect.name in odds:
            assert odds[effect.name] == pytest.approx(of_prior[effect.prior])
    assert np.exp(RunPart("delay", ("a", "b", "c"), {}).log_odds) == pytest.approx(0.01**3)  # three statements


def test_a_value_that_leaves_what_was_stated_of_it_is_further_than_chance_among_so_many() -> None:
    assert not numbers.leaves_prior(1.9, 1)
    assert numbers.leaves_prior(2.0, 1)
    assert numbers.leaves_prior(-2.0, 1)
    assert not numbers.leaves_prior(2.8, 11)
    assert numbers.leaves_prior(2.9, 11)


@pytest.mark.parametrize(("seconds", "is_named"), [(0.0029, False), (0.0031, True)])
def test_a_lag_shorter_than_a_step_of_the_simulation_explains_nothing(seconds: float, is_named: bool) -> None:
    nominal = Explanation((), Plan(robot(), (), ()), np.empty(0))
    for name, size in (("imu_lag", "time_constant"), ("input_delay", "delay")):
        part = next(one for one in library_parts(nominal.model) if one.effect == name)
        assert is_possible(joined(nominal, part, {size: seconds}), Excitation({})) == is_named


def test_a_torque_that_goes_with_the_current_is_the_motor_s() -> None:
    of = {one.name: one.mechanism for one in basis()}
    with_current = {one.name for one in basis() if one.place == "wheel" and "i" in one.symbols}
    assert with_current
    assert {of[name] for name in with_current} == {"motor"}
    assert of["wheel_loss_linear"] == "bearing"
    assert of["gyro_add_current_sum"] == "sensor"
    assert {one.mechanism for one in basis() if one.place == "drive"} == {"drive"}


LITTLE, MUCH = (Adequacy({"speed": one}, {}, {}) for one in (0.1, 0.3))


@pytest.mark.parametrize(
    ("weak", "left", "kind", "best"),
    [
        ([], 0.66, "none", ()),  # three stretches speak against the friction
        ([""], 0.66, "named", ("coulomb_friction",)),
        (["", "coulomb_friction"], 0.4, "named", ("coulomb_friction", "cogging")),  # friction alone is not adequate
        (["", "coulomb_friction"], 0.66, "unknown", ("coulomb_friction",)),  # cogging may imitate another friction
        (["", "coulomb_friction", "coulomb_friction cogging"], 0.4, "unknown", ("coulomb_friction",)),
    ],
)
def test_what_leaves_too_much_is_no_answer(weak: list[str], left: float, kind: str, best: tuple[str, ...]) -> None:
    """The friction removes most of the error and the nominal model still holds weight; cogging leaves `left` of it."""
    flat, uneven = np.full(15, -40.0), np.where(np.arange(15) < 3, -18.0, 6.0)
    table = [
        made("", flat, cost=99.0),
        made("coulomb_friction", flat + uneven, cost=98.0),
        made("coulomb_friction cogging", flat + uneven + 1.0, cost=98.0 + math.log(left, 4)),
    ]
    found = verdict.adequate(found_in(table, 2.0), lambda one: MUCH if " ".join(one.names) in weak else LITTLE)
    assert (found.kind, found.best.names) == (kind, best)
    assert found.rivals == ()
    assert found.adequacy is (LITTLE if kind != "unknown" else MUCH)
    assert [one.stage for one in found.steps] == (["weigh", "adequacy"] if weak else ["weigh"])
    assert found.steps[-1].verdict == kind
    if weak:
        said = "Not the nominal model: " if kind == "named" else "30 % of the error of speed"
        assert said in found.steps[-1].why


def test_what_is_missing_beside_a_refuted_law_may_be_one_of_several() -> None:
    """Cogging leaves 40 % of what the friction leaves, a dead band 60 %: something is missing, and both may be it."""
    flat = np.full(15, -40.0)
    table = [made("", flat, cost=99.0), made("coulomb_friction", flat + 6.0, cost=98.0)]
    for name, left in (("cogging", 0.4), ("actuator_deadband", 0.6)):
        table.append(made(f"coulomb_friction {name}", flat + 6.3, cost=98.0 + math.log(left, 4)))
    weak = {(), ("coulomb_friction",)}
    found = verdict.adequate(found_in(table, 2.0), lambda one: MUCH if one.names in weak else LITTLE)
    assert found.kind == "ambiguous"
    assert {one.names[-1] for one in (found.best, *found.rivals)} == {"cogging", "actuator_deadband"}


@pytest.mark.parametrize(
    ("left", "named"),
    [
        (0.04, ("coulomb_friction",)),  # of the squares: the shape of the friction's own law may have left them
        (0.06, ("coulomb_friction",)),  # a little more than that is less than what cogging leaves
        (0.12, ("coulomb_friction", "cogging")),
    ],
)
def test_what_a_law_s_own_shape_may_have_left_names_no_other_law(left: float, named: tuple[str, ...]) -> None:
    """Friction leaves a share of the error, and with cogging 0.01 is left: cogging removes far more than half of it."""
    flat = np.full(15, -40.0)
    table = [
        made("", flat, cost=99.0),
        made("coulomb_friction", flat + 20.0, cost=99.0 + math.log(left, 4)),
        made("coulomb_friction cogging", flat + 30.0, cost=99.0 + math.log(0.01, 4)),
    ]
    assert verdict.weigh(found_in(table, 2.0)).best.names == named


def test_an_error_below_the_floor_is_named_by_the_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    """The floor is the error of every simulator: an effect below it adds no error above it, but may be certain."""
    flat = np.full(15, -40.0)
    found = found_in([made("", flat), made("cogging", flat + 6.0)], 2.0)
    monkeypatch.setattr(found.judge, "excess", lambda one: np.zeros(1), raising=False)
    assert verdict.weigh(found).best.names == ("cogging",)


def test_an_error_of_one_signal_is_no_law_s_that_acts_on_another(monkeypatch: pytest.MonkeyPatch) -> None:
    flat = np.full(15, -40.0)
    table = [made("", flat), made("coulomb_friction", flat + 20.0), made("coulomb_friction accel_bias", flat + 30.0)]
    found = found_in(table, 2.0)
    left = dict(zip(table, ([1e5, 2e3], [1e2, 2e3], [1e2, 1e2]), strict=True))
    monkeypatch.setattr(found.judge, "excess", lambda one: np.array(left[one]), raising=False)
    assert verdict.weigh(found).best.names == ("coulomb_friction", "accel_bias")


def test_a_nominal_model_that_is_refuted_stays_beside_what_stated_values_alone_speak_for() -> None:
    flat = np.full(15, -40.0)
    table = [made("", flat, surprise=20 * CHANCE), made("cogging", flat + 0.1, cost=90.0)]
    found = verdict.adequate(found_in(table, 2.0), lambda one: LITTLE if one.names else MUCH)
    assert (found.kind, found.best.names, [one.names for one in found.rivals]) == ("ambiguous", ("cogging",), [()])


def test_what_a_refuted_explanation_contains_is_refuted() -> None:
    flat = np.full(15, -40.0)
    found = found_in([made("", flat), made("cogging", flat + 9.0), made("cogging start_delay", flat + 20.0)], 2.0)
    assert verdict._among(found, {frozenset({"cogging", "start_delay"})}) is None
    both = verdict._among(found, {frozenset({"cogging"})})
    assert both is not None
    assert both.best.names == ("cogging", "start_delay")


def test_what_is_left_out_speaks_for_no_other() -> None:
    """Friction removes 40 % of the error, and cogging 40 % of the rest: together they remove more than they leave."""
    flat = np.full(15, -40.0)
    table = [
        made("", flat, cost=99.0),
        made("coulomb_friction", flat + 10.0, cost=99.0 + math.log(0.6, 4)),
        made("coulomb_friction cogging", flat + 20.0, cost=99.0 + math.log(0.36, 4)),
    ]
    assert judged(table[:2], 2.0).kind == "none"
    assert judged(table, 2.0).best.names == ("coulomb_friction", "cogging")


@pytest.mark.parametrize(("gains", "kind"), [((-18.0, 6.0), "named"), ((6.0, 6.0), "unknown")])
def test_what_is_refuted_on_the_coarse_grid_is_refuted_at_the_samples(gains: tuple[float, float], kind: str) -> None:
    """At the samples cogging removes only 40 %: the nominal model would be the answer, unless it is refuted."""
    flat, uneven = np.full(15, -40.0), np.where(np.arange(15) < 3, *gains)
    coarse = [made("", flat, cost=98.0), made("cogging", flat + uneven, cost=97.3)]
    samples = [made("", flat, cost=98.0), made("cogging", flat + 6.0, cost=98 + math.log(0.6, 4))]
    found = verdict.adequate(found_in(coarse, 2.0), lambda one: LITTLE if one.names else MUCH)
    assert found.kind == "named"
    assert bool(found.refuted) == (kind == "named")
    assert verdict.confirmed(found, found_in(samples, 2.0), 0.0).kind == kind


@pytest.mark.parametrize(("gain", "kind"), [(9.0, "named"), (5.9, "ambiguous")])
def test_several_that_lack_a_part_each_do_not_replace_all_parts(gain: float, kind: str) -> None:
    """At the samples the second part removes 40 % of what either part leaves. Only weaker evidence drops it."""
    flat = np.full(15, -40.0)
    both = made("start_delay cogging", flat + 9.0, cost=98 + math.log(0.01, 4))
    coarse = judged([made("", flat), made("start_delay", flat + 6.0, cost=98), both], 2.0)
    both = made("start_delay cogging", flat + gain, cost=98 + math.log(0.6, 4))
    alone = [made("start_delay", flat + 6.0, cost=98), made("cogging", flat + 6.0, cost=98)]
    found = verdict.confirmed(coarse, found_in([made("", flat), *alone, both], 2.0), 0.0)
    assert coarse.kind == "named"
    assert (found.kind, len(found.best.names)) == (kind, 2 if kind == "named" else 1)
