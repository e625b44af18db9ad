"""The criterion against a second implementation of its mathematics, written here from the page that defines it.

The weights are a mean over draws, in a loop. test_density.py tests the density of a residual.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.discover import evidence, numbers, verdict
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.parts import Part, RunPart
from brickpilot.discover.search import Found
from test_density import Array, given, likeliest_scale

SURE = 0.95
ODDS = {"common": 0.05, "usual": math.sqrt(0.05 * 0.01), "rare": 0.01}
CHANCE = -math.log(0.05)
OTHERS = (
    "accel_bias", "battery_sag", "caster_drag", "cogging", "dead_time", "gyro_scale", "imu_lag", "wheel_slip",
    "yaw_scrub", "input_delay",
)  # fmt: skip


def weights_of(table: Array, log_odds: Array, temperature: float, draws: int = 1000) -> Array:
    """Bayesian bootstrap: each flat Dirichlet draw weights the stretches and divides a weight of 1 among the models."""
    random = np.random.default_rng(0)
    total = np.zeros(len(table))
    for alpha in random.dirichlet(np.ones(table.shape[1]), draws):
        nats = table.shape[1] * (table @ alpha) / temperature + log_odds
        share = np.exp(nats - nats.max())
        total += share / share.sum()
    return total / draws


def made(names: str, table: Array, surprise: float = 0.0, cost: float | None = None) -> Evidence:
    """Returns the evidence of an explanation by library effects, whose values cost `surprise` nats."""
    parts = tuple(Part(name, (catalogue.effect(name).parameters[0].name,), {}) for name in names.split())
    unknown: Any = None
    away = np.array([50.0] * round(surprise / CHANCE))  # at this distance each value costs as much as a common effect
    found = Explanation(parts, unknown, np.zeros(len(away)), 100.0 - len(parts) if cost is None else cost)
    return Evidence(found, table, np.zeros(0), away, np.zeros((len(away), 0)), np.zeros((0, 0)))


def odds_of(one: Evidence) -> float:
    return sum(math.log(ODDS[catalogue.effect(name).prior]) for name in one.explanation.names)


def tables(seed: int, gains: dict[str, float], stretches: int = 15) -> list[Evidence]:
    random = np.random.default_rng(seed)
    base = random.normal(-40, 5, stretches)
    return [made(names, base + gain / stretches + random.normal(0, 0.4, stretches)) for names, gain in gains.items()]


GAINS = {
    "": 0.0,
    "coulomb_friction": 60.0,
    "stiction_stribeck": 60.5,
    "coulomb_friction gyro_bias": 64.0,
    "wheel_slip": 52.0,
    "battery_sag": 30.0,
}


@pytest.mark.parametrize("temperature", [1.0, 3.0, 20.0])
def test_weights_are_those_of_a_loop_over_the_draws(temperature: float) -> None:
    found = tables(3, GAINS)
    expected = weights_of(
        np.array([one.by_stretch for one in found]), np.array([odds_of(one) for one in found]), temperature
    )
    assert evidence.weigh(found, temperature) == pytest.approx(expected, abs=1e-9)
    assert [one.explanation.log_odds for one in found] == pytest.approx([odds_of(one) for one in found])


@dataclasses.dataclass
class Settled:
    """A judge whose temperature is given. A cost that is lower by 1 means a quarter of the squared error."""

    nats: float
    top: float = 0.0
    shape: float = numbers.LAW_SHAPE

    def temperature(self, best: Evidence, nothing: Evidence) -> float:
        return self.nats

    def correlation(self, one: Evidence) -> float:
        return 2.0

    def excess(self, one: Evidence) -> Array:
        return np.array([4.0 ** (one.explanation.cost - 90)])


def found_in(table: list[Evidence], temperature: float) -> Found:
    judge: Any = Settled(temperature)
    return Found(judge, table[0], {one.explanation.key: one for one in table})


def judged(table: list[Evidence], temperature: float) -> verdict.Verdict:
    return verdict.weigh(found_in(table, temperature))


OFFSETS = {"gyro_bias", "accel_bias"}


def own_error(small: Evidence, large: Evidence, table: list[Evidence]) -> float:
    """Returns the squared error that wrong shapes of the laws of `small` may leave, and that `large` may not claim.

    It is a twentieth of what `small` removes in addition to its offsets, which have no shape. It is 0 if `large` adds
    only offsets, which a wrong shape does not leave.
    """
    if large.explanation.key - OFFSETS <= small.explanation.key:
        return 0.0
    offsets = small.explanation.key & OFFSETS
    plain = next((one for one in table if one.explanation.key == offsets), table[0])
    return max(4.0**plain.explanation.cost - 4.0**small.explanation.cost, 0.0) / 20


def dominates(one: Evidence, other: Evidence, table: list[Evidence]) -> bool:
    """Whether `one` is simpler than `other`, and no worse by the data and by the prior.

    An `other` that contains `one` is also dominated if it removes less than half of the squared error that `one`
    leaves. Error that may come from the own shapes of the laws of `one` is not counted.
    """
    first, second = one.explanation, other.explanation
    left, then = (4.0**each.cost for each in (first, second))
    if contains(second.key, first.key) and left - then - own_error(one, other, table) <= then:
        return True
    fewer = len(first.names) < len(second.names)
    return fewer and odds_of(one) >= odds_of(other) and one.by_stretch.sum() >= other.by_stretch.sum()


def contains(larger: frozenset[str], smaller: frozenset[str]) -> bool:
    """Whether the larger set has, for each effect of the smaller set, this effect or a law that contains it."""
    said = larger | {name for one in larger for name in catalogue.effect(one).contains}
    return larger != smaller and smaller <= said and len(larger) >= len(smaller)


def reference_verdict(table: list[Evidence], temperature: float) -> tuple[str, set[frozenset[str]], set[str]]:
    """Returns the kind, the minimal sets among those that hold 95 % of the weight, and the sure names."""
    best = {one.explanation.key: one for one in table}
    for large in table:
        for small in table:
            left, then = (4.0**one.explanation.cost for one in (small, large))
            own = own_error(small, large, table)
            beyond = max(left - then - own, min(left - then, 0.0)) / 2
            if contains(large.explanation.key, small.explanation.key) and beyond < temperature * CHANCE * (own > 0):
                both = (best[small.explanation.key], large)
                best[small.explanation.key] = max(
                    both, key=lambda one: one.by_stretch.sum() / temperature + odds_of(one)
                )
    table = [one for one in table if not any(dominates(other, one, table) for other in table)]
    sets = [one.explanation.key for one in table]
    gains = {key: one.by_stretch.sum() for key, one in zip(sets, table, strict=True)}
    weight = weights_of(
        np.array([best[key].by_stretch for key in sets]), np.array([odds_of(best[key]) for key in sets]), temperature
    )
    held: list[frozenset[str]] = []
    total = 0.0
    for index in np.argsort(-weight):
        held.append(sets[index])
        total += weight[index]
        if total >= SURE:
            break
    least = {one for one in held if not any(contains(one, other) for other in held)}
    names = {name for one in sets for name in one}
    sure = {
        name
        for name in names
        if sum(w for one, w in zip(sets, weight, strict=True) if name in one or contains(one, frozenset({name})))
        >= SURE
    }
    if frozenset() in least:
        return "none", {frozenset()}, sure
    if len(least) > 1 or not next(iter(least)) <= sure:
        return "ambiguous", least, sure
    if gains[next(iter(least))] - gains[frozenset()] <= temperature * CHANCE:
        return "ambiguous", least | {frozenset()}, sure
    return "named", least, sure


CASES = [
    *itertools.product(range(4), (1.0, 3.0, 20.0, 300.0), [GAINS]),
    *itertools.product(range(4), (1.0, 4.0), [{"": 0.0, "coulomb_friction": 5.0, "gyro_bias": 4.0}]),
    *itertools.product(range(4), (2.0,), [{"": 0.0, "coulomb_friction": 40.0, "gyro_bias": 40.0, "wheel_slip": 39.0}]),
]


@pytest.mark.parametrize(("seed", "temperature", "gains"), CASES)
def test_the_verdict_is_that_of_the_reference(seed: int, temperature: float, gains: dict[str, float]) -> None:
    table = tables(seed, gains)
    found = judged(table, temperature)
    kind, least, sure = reference_verdict(table, temperature)
    assert found.kind == kind
    assert {found.best.key, *(one.key for one in found.rivals)} == least
    assert found.sure == sure
    assert sum(one.weight for one in found.held) >= SURE > sum(one.weight for one in found.held[:-1])
    assert list(found.held) == sorted(found.held, key=lambda one: -one.weight)


def test_many_parts_that_say_nothing_do_not_outweigh_a_name() -> None:
    """Ten explanations have two parts; each is as good as the explanation of one part that they all contain."""
    names = ["coulomb_friction", *(f"gyro_bias {one}" for one in OTHERS)]
    table = tables(0, {"": 0.0, "gyro_bias": 90.0} | dict.fromkeys(names[1:], 89.0))
    equal = [dataclasses.replace(one, by_stretch=table[0].by_stretch + 6.0) for one in table[1:]]
    found = judged([table[0], *equal], 2.0)
    assert (found.kind, found.best.names, len(found.held)) == ("named", ("gyro_bias",), 1)
    better = [equal[0], *(dataclasses.replace(one, by_stretch=one.by_stretch + 1e-3) for one in equal[1:])]
    assert judged([table[0], *better], 2.0).held[0].weight < SURE


@pytest.mark.parametrize(("removed", "names"), [(0.59, ("start_delay", "cogging")), (0.56, ("start_delay",))])
def test_a_part_that_leaves_more_of_the_error_than_it_removes_is_no_name(
    removed: float, names: tuple[str, ...]
) -> None:
    """A second part is refused whatever it gains in nats: no law is exact, and a second law may fit its error.

    The first part removes three quarters of the error, so 15 % of what it leaves may come from its law's shape.
    """
    flat, cost = np.full(15, -40.0), 99 + math.log(1 - removed, 4)
    base = [made("", flat), made("start_delay", flat + 6.0, cost=99)]
    assert judged([*base, made("start_delay cogging", flat + 9.0, cost=cost)], 2.0).best.names == names


@pytest.mark.parametrize(
    ("gain", "removed", "enough", "kind", "names", "stages"),
    [
        (9.0, 0.99, 0.0, "named", ("start_delay", "cogging"), ["weigh"]),
        (9.0, 0.40, 0.0, "named", ("start_delay",), ["weigh", "samples"]),
        (0.1, 0.99, 999.0, "none", (), ["weigh", "samples"]),
        (0.1, 0.99, 599.0, "unknown", ("start_delay", "cogging"), ["weigh", "samples"]),
    ],
)
def test_the_measured_samples_take_back_what_they_do_not_show(
    gain: float, removed: float, enough: float, kind: str, names: tuple[str, ...], stages: list[str]
) -> None:
    """The coarse grid names two parts; the error of the grid itself may have caused the second, or both."""

    def table(gain: float, removed: float) -> list[Evidence]:
        flat, cost = np.full(15, -40.0), 98 + math.log(1 - removed, 4)
        both = made("start_delay cogging", flat + gain, cost=cost)
        return [made("", flat), made("start_delay", flat + 2 * gain / 3, cost=98), both]

    coarse, samples = judged(table(9.0, 0.99), 2.0), found_in(table(gain, removed), 2.0)
    assert (coarse.kind, coarse.best.names) == ("named", ("start_delay", "cogging"))
    found = verdict.confirmed(coarse, samples, enough)
    assert (found.kind, found.best.names) == (kind, names)
    assert [one.stage for one in found.steps] == stages
    assert found.steps[-1].verdict == found.kind


@pytest.mark.parametrize(
    ("offset", "names"), [("gyro_bias", ("gyro_bias", "cogging")), ("start_delay", ("start_delay",))]
)
def test_what_an_offset_removes_does_not_excuse_what_is_left(offset: str, names: tuple[str, ...]) -> None:
    """The first part leaves 3 % of the error. A wrong shape of a law could leave it, but an offset has no shape."""
    flat, left = np.full(15, -40.0), 100 + math.log(0.03, 4)
    base = [made("", flat, cost=100), made(offset, flat + 6.0, cost=left)]
    assert judged([*base, made(f"{offset} cogging", flat + 9.0, cost=left - 1)], 2.0).best.names == names


def test_what_only_stated_values_speak_for_is_no_name() -> None:
    """The data cannot tell the models apart; without the effect two stated values would be far off."""
    flat = np.full(15, -40.0)
    nothing, effect = made("", flat, surprise=9.0), made("encoder_scale", flat + 0.01)
    found = judged([nothing, effect], 2.0)
    assert (found.kind, found.best.names) == ("ambiguous", ("encoder_scale",))
    assert [one.names for one in found.rivals] == [()]
    assert judged([nothing, made("encoder_scale", flat + 1.0)], 2.0).kind == "named"
    assert judged([made("", flat), effect], 2.0).kind == "none"
    either = judged([made("", flat, surprise=CHANCE), effect], 2.0)  # one value far off is as likely as the effect
    assert (either.kind, [one.names for one in (either.best, *either.rivals)]) == (
        "ambiguous",
        [("encoder_scale",), ()],
    )
    assert judged([made("", flat, CHANCE), made("encoder_scale", flat, CHANCE)], 2.0).kind == "none"  # still far off


@pytest.mark.parametrize(("gain", "names"), [(5.9, ()), (6.1, ("wheel_slip",))])
def test_the_best_so_far_is_a_part_that_surely_predicts_better(gain: float, names: tuple[str, ...]) -> None:
    """One nat counts as two here, because the residual is correlated. The error of a law's shape does not count."""
    flat = np.full(15, -40.0)
    table = [made("", flat), made("cogging", flat + 0.3), made("wheel_slip", flat + gain / 15)]
    table.append(made("wheel_slip cogging", flat + 9.0))
    judge: Any = Settled(100.0)
    found = Found(judge, table[0], {one.explanation.key: one for one in table})
    assert verdict.weigh(Found(judge, table[0], dict(list(found.table.items())[:3]))).kind == "none"
    assert verdict.best_so_far(found).names == names


def test_a_law_that_is_made_of_others_is_no_rival_of_them() -> None:
    flat = np.full(15, -40.0)
    pair = made("coulomb_friction constant_offset", flat + 6.01)
    found = judged([made("", flat), made("direction_asymmetry", flat + 6.0), pair], 2.0)
    assert (found.kind, found.best.names) == ("named", ("direction_asymmetry",))
    assert len(judged([made("", flat), made("wheel_slip", flat + 6.0), pair], 2.0).rivals) == 1


def test_the_same_laws_in_other_words_are_one_explanation() -> None:
    flat = np.full(15, -40.0)
    names = ("coulomb_friction", "constant_offset", "direction_asymmetry")
    words = (f"{names[0]} {names[1]}", f"{names[2]} {names[1]}", f"{names[0]} {names[2]}")
    alike = [made(one, flat + 6.0 - 0.001 * k) for k, one in enumerate(words)]
    lone = [made(one, flat + 1.0) for one in names]
    found = judged([made("", flat), *lone, *alike], 2.0)
    assert (found.kind, set(found.best.names)) == ("named", {"coulomb_friction", "constant_offset"})
    assert found.sure >= {"coulomb_friction", "constant_offset"}
    assert {one.explanation.laws for one in alike} == {found.best.key}


def test_the_cases_hold_every_kind_of_verdict() -> None:
    kinds = {reference_verdict(tables(seed, gains), temperature)[0] for seed, temperature, gains in CASES}
    assert kinds == {"none", "named", "ambiguous"}


def test_a_law_that_contains_another_is_no_rival_of_it() -> None:
    table = tables(0, {"": 0.0, "coulomb_friction": 90.0, "stiction_stribeck": 91.0})
    table[2] = dataclasses.replace(table[2], explanation=dataclasses.replace(table[2].explanation, cost=98.0))
    found = judged(table, 2.0)
    assert {frozenset({"stiction_stribeck"}), frozenset({"coulomb_friction"})} == {
        one.explanation.key for one in found.held
    }
    assert (found.kind, found.best.names, found.rivals) == ("named", ("coulomb_friction",), ())


def test_a_difference_that_one_stretch_makes_is_not_sure() -> None:
    """The same total gain, from one stretch of fifteen and from all of them."""
    even, lonely = np.full(15, 20 / 15), np.zeros(15)
    lonely[6] = 20.0
    weight = [
        evidence.weigh([made("", np.zeros(15)), made("coulomb_friction", gain)], 1.0)[1] for gain in (even, lonely)
    ]
    assert weight[0] > 0.99 > weight[1]


def test_what_counts_as_one_nat_is_the_largest_of_three(monkeypatch: pytest.MonkeyPatch) -> None:
    """The residual counts by its squares: an explanation far above the noise does not exclude a law as far above it."""
    judge, places = given()
    monkeypatch.setattr(Judge, "correlation", lambda *_: 4.0)
    gain = 150.0 * 12
    for left, large in ((0.1, 4.0), (3.0, 4.0), (3.0, 1e3), (1e4, 4.0)):  # scales of "speed", in floors
        monkeypatch.setattr(Judge, "correlation", lambda *_, large=large: large)
        residual = np.zeros(len(judge.stretch))
        residual[places["speed"]] = 0.2 * left * np.random.default_rng(3).normal(size=places["speed"].stop)
        nothing = dataclasses.replace(made("", np.full(12, -100.0)), left_out=10 * residual)
        best = dataclasses.replace(made("coulomb_friction", np.full(12, 50.0)), left_out=residual)
        above_noise = 1 - 0.2**2 / likeliest_scale(residual[places["speed"]], 0.2) ** 2
        shared = -places["speed"].stop * math.log(1 - 0.2 * above_noise) / 2
        expected = max(large, 0.01 * gain / -math.log(0.05), shared / -math.log(0.05))
        assert judge.temperature(best, nothing) == pytest.approx(expected, rel=2e-3)
    assert expected < 0.11 * places["speed"].stop / 2.9  # at most the gain from a fifth fewer squares


def test_the_correlation_time_of_a_residual_is_that_of_its_autocorrelation() -> None:
    """An AR(1) residual with the coefficient k has the correlation time (1 + k) / (1 - k)."""
    judge, places = given(stretches=40, each=200)
    random, kept = np.random.default_rng(5), {"speed": 0.8, "yaw_rate": 0.5}
    left = np.empty(len(judge.stretch))
    for name, place in places.items():
        x = 0.0
        for index in range(place.start, place.stop):
            x = kept[name] * x + random.normal() * judge.data.scales[name].noise
            left[index] = x
    found = judge.correlation(dataclasses.replace(made("", np.zeros(40)), left_out=left))
    assert found == pytest.approx((2 * 9.0 + 3.0) / 3, rel=0.1)


@pytest.mark.parametrize(
    ("first", "second", "named"),
    [
        (Part("coulomb_friction", ("torque",), {}), "dead_time", "coulomb_friction"),
        (Part("coulomb_friction", ("torque",), {}), "gyro_bias", "coulomb_friction gyro_bias"),
        (RunPart("supply_gain", ("a", "b", "c"), {}), "dead_time", "supply_gain dead_time"),
    ],
    ids=["two laws", "a law and an offset", "values of runs and a law"],
)
def test_only_a_law_is_weighed_by_what_its_own_shape_may_have_left(first: Part, second: str, named: str) -> None:
    """The second part removes less than the error that a law's shape may leave. So a second law is not needed beside a
    law, which then wins. A wrong shape leaves no offset: an offset is needed. Values of runs have no shape: beside them
    a law is needed."""
    gains = {"": 0.0, "coulomb_friction": 60.0, f"coulomb_friction {second}": 120.0, "wheel_slip": 80.0}
    costs, table = (100.0, 92.0, 90.0, 91.0), []
    for one, cost in zip(tables(0, gains), costs, strict=True):
        parts = tuple(first if part.name == "coulomb_friction" else part for part in one.explanation.parts)
        table.append(dataclasses.replace(one, explanation=Explanation(parts, one.explanation.plan, np.zeros(0), cost)))
    found = judged(table, 2.0)
    assert (found.kind, " ".join(found.best.names)) == ("named", named)


@pytest.mark.parametrize(
    ("alone", "named"), [(True, "supply_gain wheel_slip dead_time"), (False, "supply_gain wheel_slip")]
)
def test_what_values_of_runs_removed_is_no_shape_of_the_law_beside_them(alone: bool, named: str) -> None:
    """The values of runs alone leave 64 of 4096 squares, with slip 32, with slip and a dead time 8. The dead time
    removes 24: more than 5 % of what slip removed. If the values were not fitted alone, slip may have removed all
    4064."""
    runs = RunPart("supply_gain", ("a", "b", "c"), {})
    gains = {"": 0.0, "coulomb_friction": 60.0, "coulomb_friction wheel_slip": 100.0}
    gains["coulomb_friction wheel_slip dead_time"] = 130.0
    costs, table = (96, 93, 92.5, 91.5), []
    for one, cost in zip(tables(0, gains), costs, strict=True):
        parts = tuple(runs if part.name == "coulomb_friction" else part for part in one.explanation.parts)
        found = Explanation(parts, one.explanation.plan, np.zeros(0), cost)
        if alone or parts != (runs,):
            table.append(dataclasses.replace(one, explanation=found))
    judge: Any = Settled(2.0)
    nothing = dataclasses.replace(table[0])  # a copy that is not in the table, as at the measured samples
    weighed = verdict.weigh(Found(judge, nothing, {one.explanation.key: one for one in table}))
    assert " ".join(weighed.best.names) == named
