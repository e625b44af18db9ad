"""The values that a campaign draws: their distributions, the designs, and the sensitivity indices of a design."""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from brickpilot.campaign import designs, file, inputs, runs, summary
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.inputs import Distribution, Input
from brickpilot.errors import InputError
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

HEAD = '[campaign]\nname = "drawn"\nseed = 5\nsensors = "imu+encoders"\n'
VARIED = """[vary]
parameter.mass = { distribution = "normal", mean = 0.9, sd = 0.05 }
parameter.battery_voltage = { distribution = "uniform", low = 7, high = 9 }
parameter.rolling_friction = { distribution = "normal", mean = 0.0, sd = 0.01 }
effect.coulomb_friction.torque = { distribution = "lognormal", median = 0.01, sd_of_log = 0.5, high = 0.02 }
effect.coulomb_friction.chance = 0.25
effect.yaw_scrub.moment = { distribution = "loguniform", low = 1e-3, high = 1e-1 }
sensor.gyro_noise_sd = { distribution = "choice", values = [0.01, 0.02, 0.03], weights = [1, 2, 1] }
"""
LAWS: dict[str, Callable[[Array], Array]] = {
    "parameter.mass": stats.norm(0.9, 0.05).cdf,
    "parameter.battery_voltage": stats.uniform(7, 2).cdf,
    "parameter.rolling_friction": stats.halfnorm(0, 0.01).cdf,  # values below 0 are not physical
    "effect.coulomb_friction.torque": lambda x: (
        stats.lognorm(0.5, scale=0.01).cdf(x) / stats.lognorm(0.5, scale=0.01).cdf(0.02)
    ),
    "effect.yaw_scrub.moment": stats.loguniform(1e-3, 1e-1).cdf,
}


def campaign(folder: Path, size: str = "runs = 4000", varied: str = VARIED) -> Campaign:
    (folder / "drawn.toml").write_text(HEAD + size + "\n" + varied)
    return file.load(folder / "drawn.toml")


def columns(given: Campaign, start: int = 0, stop: int | None = None) -> dict[str, list[object]]:
    shares = designs.drawn_shares(given)(start, given.runs if stop is None else stop)
    drawn = runs.drawn(given, shares)
    return {name: [one[name] for one in drawn] for name in drawn[0]}


@pytest.mark.parametrize(
    "size", ["runs = 3000", 'design = "latin_hypercube"\nruns = 3000', 'design = "sobol"\nruns = 2048']
)
def test_each_distribution_is_what_the_file_says(size: str, tmp_path: Path) -> None:
    found = columns(campaign(tmp_path, size))
    for name, law in LAWS.items():
        assert stats.kstest(found[name], law).pvalue > 1e-3, name
        assert stats.kstest(np.array(found[name]) * 1.3, law).pvalue < 1e-3, name  # shows that the test can fail
    noise = [found["sensor.gyro_noise_sd"].count(one) for one in (0.01, 0.02, 0.03)]
    assert stats.chisquare(noise, np.array([0.25, 0.5, 0.25]) * sum(noise)).pvalue > 1e-3
    on = found["effect.coulomb_friction.on"]
    assert stats.binomtest(on.count(True), len(on), 0.25).pvalue > 1e-3


def test_a_run_is_the_same_whatever_else_is_drawn(tmp_path: Path) -> None:
    few, many = campaign(tmp_path, "runs = 30"), campaign(tmp_path, "runs = 4000")
    more = campaign(tmp_path, "runs = 30", VARIED + "parameter.half_track = [0.07, 0.071]\n")
    for name, values in columns(few).items():
        assert values == columns(many, 0, 30)[name] == columns(more)[name]
        assert values[20:23] == columns(few, 20, 23)[name]
    assert [designs.noise_seed(few, k) for k in range(30)] == [designs.noise_seed(many, k) for k in range(30)]
    other = dataclasses.replace(few, seed=6)
    assert columns(other)["parameter.mass"] != columns(few)["parameter.mass"]
    assert designs.noise_seed(other, 0) != designs.noise_seed(few, 0)
    by_part = [run.plan for part in runs.parts(few) for run in runs.planned(part.argument)]
    assert runs.single_run(few, 17).plan == by_part[17]


def test_a_latin_hypercube_has_one_run_in_each_stratum(tmp_path: Path) -> None:
    given = campaign(tmp_path, 'design = "latin_hypercube"\nruns = 50')
    shares = designs.drawn_shares(given)(0, 50)
    assert (np.sort(np.floor(shares * 50), axis=0) == np.arange(50)[:, None]).all()


@pytest.mark.parametrize(
    ("size", "block"), [('design = "saltelli"\nsamples = 8', 9), ('design = "morris"\ntrajectories = 5', 8)]
)
def test_the_runs_of_a_block_differ_in_inputs_alone(size: str, block: int, tmp_path: Path) -> None:
    given = campaign(tmp_path, size)
    assert given.runs == given.count * block
    seeds = [designs.noise_seed(given, k) for k in range(given.runs)]
    assert seeds == [seeds[block * (k // block)] for k in range(len(seeds))]
    assert len(set(seeds)) == given.count


def cube(design: str, size: int) -> Campaign:
    """Returns a campaign of three inputs, uniform in -pi..pi, for a figure that is computed without flights."""
    law = Distribution("uniform", -np.pi, np.pi, -np.pi, np.pi)
    inputs = tuple(Input(name, "", law) for name in ("one", "two", "three"))
    plain = file.load(Path(__file__).parents[2] / "tools" / "examples" / "tolerances.toml")
    return dataclasses.replace(plain, design=design, count=size, inputs=inputs)


def ishigami(given: Campaign) -> tuple[dict[str, Array], Array]:
    """Returns the drawn inputs and the values of Ishigami and Homma's function (1990), whose indices are known."""
    x = {name: np.array(values, dtype=float) for name, values in columns(given).items()}
    return x, np.sin(x["one"]) + 7 * np.sin(x["two"]) ** 2 + 0.1 * x["three"] ** 4 * np.sin(x["one"])


FIRST, TOTAL = {"one": 0.3139, "two": 0.4424, "three": 0.0}, {"one": 0.5576, "two": 0.4424, "three": 0.2437}


def test_saltelli_gives_the_indices_of_a_known_function() -> None:
    given = cube("saltelli", 1024)
    x, figure = ishigami(given)
    for values in (figure, np.where(np.arange(len(figure)) == 77, np.nan, figure)):  # also if a run lacks the figure
        found = summary.sensitivity_indices(given, x, values)
        assert [one.input for one in found] == ["one", "two", "three"]
        for one in found:
            assert one.total is not None
            assert one.total_half is not None
            assert abs(one.value - FIRST[one.input]) < max(one.half, 0.02)
            assert abs(one.total - TOTAL[one.input]) < max(one.total_half, 0.02)
            assert one.half < 0.15


def test_independent_draws_give_the_first_order_alone() -> None:
    given = cube("monte_carlo", 4000)
    for one in summary.sensitivity_indices(given, *ishigami(given)):
        assert one.value == pytest.approx(FIRST[one.input], abs=0.04)
    assert summary.sensitivity_indices(given, {}, np.ones(4000)) == []
    assert summary.sensitivity_indices(given, {}, np.where(np.arange(4000) < 90, np.arange(4000.0), np.nan)) == []


def test_morris_orders_a_linear_function_by_its_slopes() -> None:
    given = cube("morris", 20)
    x = {name: np.array(values, dtype=float) for name, values in columns(given).items()}
    found = summary.sensitivity_indices(given, x, 3 * x["two"] - x["three"])
    assert [one.input for one in found] == ["two", "three", "one"]
    assert found[0].value / found[1].value == pytest.approx(3.0)
    assert found[2].value == pytest.approx(0.0, abs=1e-12)


def test_a_number_of_an_effect_that_is_off_has_not_the_index_of_its_switch(tmp_path: Path) -> None:
    given = campaign(tmp_path, "runs = 1000")
    x = {name: np.array(values, dtype=float) for name, values in columns(given).items()}
    on = x["effect.coulomb_friction.on"] > 0
    torque = np.where(on, x["effect.coulomb_friction.torque"], np.nan)
    found = summary.sensitivity_indices(given, x | {"effect.coulomb_friction.torque": torque}, on.astype(float))
    indices = {one.input: one.value for one in found}
    assert indices["effect.coulomb_friction.on"] > 0.8
    assert abs(indices["effect.coulomb_friction.torque"]) < 0.1


def test_morris_refuses_a_list_that_it_would_not_fly_whole(tmp_path: Path) -> None:
    for entry, said in (
        ("gain.heading_kp = [8, 10, 12, 14, 16]", "vary.gain.heading_kp: morris flies only 4 of its 5 values"),
        ("effect.yaw_scrub.chance = 0.01", "vary.effect.yaw_scrub.on: morris flies only 1 of its 2 values"),
    ):
        given = campaign(tmp_path, 'design = "morris"\ntrajectories = 5', f"[vary]\n{entry}\n")
        with pytest.raises(InputError, match=said):
            designs.drawn_shares(given)
    designs.drawn_shares(
        campaign(tmp_path, 'design = "morris"\ntrajectories = 5', "[vary]\ngain.heading_kp = [8, 9]\n")
    )


def test_no_two_names_of_inputs_share_their_random_numbers() -> None:
    names = [f"{kind}.{name}" for kind, known in inputs.ranges().items() for name in known]
    names += [f"effect.{effect}.{name}" for effect, known in inputs.effects().items() for name in (*known, inputs.ON)]
    names += ["scenario", "sensors", "route", "design", "robots"]
    keys = {zlib.crc32(name.encode()) for name in names}
    assert len(keys) == len(names) > 300
    # Keys of robots and designs begin with such a hash, and other keys with the number of a run: they must differ.
    assert min(keys) > file.MOST_RUNS


@pytest.mark.parametrize(("alike", "size"), [(False, 1), (True, 1), (False, 8), (True, 8)])
def test_the_interval_of_a_rate_holds_for_runs_that_are_alike(alike: bool, size: int) -> None:
    """In 300 campaigns of 60 blocks, 95 % of the intervals contain the true rate, 0.7.

    Args:
        alike: whether all runs of a block have the same result.
        size: number of runs in a block.
    """
    draws = np.random.default_rng(0)
    blocks = np.repeat(np.arange(60), size)
    held = 0
    for _ in range(300):
        ends = np.repeat(draws.random(60) < 0.7, size) if alike else draws.random(60 * size) < 0.7
        low, high = summary.rate(ends, blocks)["ci95"]
        held += low <= 0.7 <= high
    assert stats.binomtest(held, 300, 0.95).pvalue > 1e-3


def test_the_interval_of_independent_runs_is_wilsons() -> None:
    wilson = stats.binomtest(9, 10).proportion_ci(method="wilson")
    assert summary.rate(np.arange(10) > 0, np.arange(10))["ci95"] == pytest.approx([wilson.low, wilson.high])
    none = stats.binomtest(0, 4).proportion_ci(method="wilson")
    assert summary.rate(np.zeros(12, bool), np.arange(12) // 3)["ci95"] == pytest.approx([none.low, none.high])
