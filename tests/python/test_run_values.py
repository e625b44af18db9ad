"""Values that differ from run to run: planted ones are found, and what all runs share keeps its name."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot.data import dataset
from brickpilot.data.dataset import motor_inputs
from brickpilot.discover import pipeline
from brickpilot.discover.calibrate import calibrate
from brickpilot.discover.prepare import prepare
from brickpilot.discover.run_values import values_that_differ
from brickpilot.discover.verdict_json import verdict_json
from brickpilot.fit.held_inputs import held_back, later
from brickpilot.fit.random_effects import random_effects
from brickpilot.fit.replay import Replay
from brickpilot.fit.run_values import DELAY, GAIN, START, with_values
from brickpilot.vehicle import model as model_file
from synthetic import robot, write
from verdict_schema import check

SIGNALS = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "yaw_rate": 0.01}
VOLTAGES = {
    "ahead": (6.0, 6.0), "back": (-5.0, -5.0), "right": (5.0, -5.0), "left": (-4.0, 4.0), "curve": (7.0, 4.0),
    "bend": (3.0, 6.0), "slow": (3.5, 3.5), "tested": (5.5, 4.5),
}  # fmt: skip
ROLES = ["fit"] * 7 + ["held_out"]
FITTED = list(VOLTAGES)[:7]
GAINS = dict(zip(FITTED, (0.03, -0.05, 0.04, -0.02, -0.06, 0.05, 0.01), strict=True))
DELAYS = dict(zip(FITTED, (0.06, 0.01, 0.03, 0.08, 0.0, 0.02, 0.05), strict=True))
STARTS = dict(zip(FITTED, (0.15, 0.25, 0.2, 0.3, 0.12, 0.35, 0.18), strict=True))


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """Eight runs of a robot that is known to 2 %, and what was commanded."""
    known = {name: value for name, value in robot().parameters.items() if value}
    nominal = "\n".join(f"{name} = {{ value = {value}, sd = {0.02 * value} }}" for name, value in known.items())
    return dataset.read(write(tmp_path_factory.mktemp("runs") / "set", robot(), SIGNALS, nominal,
                              manoeuvres=VOLTAGES, roles=ROLES))  # fmt: skip


def measured(logged, kind=GAIN, values=None, **effects):
    """Returns the data set as a robot with these values of its runs, and these effects, would have written it."""
    truth = dataclasses.replace(robot(), effects=effects)
    simulated = Replay(with_values(logged, kind, values or {})).simulate([truth])[0]
    random, runs = np.random.default_rng(3), []
    for run in logged.runs:
        outputs = {
            name: simulated[run.name][name] + random.normal(0, sd, len(run.time)) for name, sd in SIGNALS.items()
        }
        runs.append(dataclasses.replace(run, outputs=outputs, raw_outputs=outputs))
    return dataclasses.replace(logged, runs=tuple(runs))


def estimated(data):
    prepared = prepare(data, None, seed=0, jobs=1)
    return values_that_differ(prepared, calibrate(prepared))


def test_inputs_that_act_later_are_the_same_inputs_later():
    time = np.arange(0, 1, 0.01)
    driven = np.column_stack([np.where(time > 0.095, 4.0, 0.0), np.where(time > 0.495, np.nan, 1.0)])
    moved = later(time, driven, 0.035)
    assert moved[12:15, 0] == pytest.approx([0.0, 2.0, 4.0])
    assert moved[:4, 1] == pytest.approx([0.0, 0.0, 0.0, 0.5])
    assert np.isfinite(moved[:53, 1]).all()
    assert np.isnan(moved[54:, 1]).all()
    earlier = later(time, driven, -0.05)
    assert earlier[4:6, 0] == pytest.approx([0.0, 4.0])
    assert earlier[-1, 0] == pytest.approx(4.0)
    assert later(time, driven, 0.0)[:, 0] == pytest.approx(driven[:, 0])


def test_inputs_that_are_held_back_act_in_time_after_it():
    time = np.arange(0, 0.1, 0.01)
    found = held_back(time, np.full((10, 1), 2.0), 0.025)[:, 0]
    assert found == pytest.approx([0, 0, 1, *[2.0] * 7])


def test_random_effects_draw_uncertain_values_to_the_mean():
    rng = np.random.default_rng(1)
    truth, sds = rng.normal(0.3, 0.05, 60), np.where(np.arange(60) < 40, 0.005, 0.5)
    found = random_effects(truth + rng.normal(0, sds), np.diag(sds**2))
    assert found.sd == pytest.approx(0.05, rel=0.25)
    assert found.chance < 1e-6
    assert np.mean(np.abs(found.values - truth) < 1.96 * found.value_sds) > 0.9
    assert np.abs(found.values[40:] - 0.3).max() < 0.05
    third = random_effects(truth, np.diag(sds**2), np.eye(60)[3])
    assert third.deviations[3] == third.deviation_sds[3] == 0
    equal = random_effects(0.3 + rng.normal(0, 0.01, 60), np.diag(np.full(60, 1e-4)))
    assert equal.sd < 0.006
    assert equal.chance > 0.01


@pytest.mark.parametrize(("kind", "planted"), [(GAIN, GAINS), (DELAY, DELAYS), (START, STARTS)])
def test_planted_values_are_found_within_their_intervals(logged, kind, planted):
    found = estimated(measured(logged, kind, planted))
    assert found is not None
    assert found.kind is kind
    assert found.applied is not kind.is_whole
    shared = {"mean": np.mean, "least": np.min, "nothing": lambda _: 0.0}[kind.counts_from](list(planted.values()))
    inside = [low <= planted[name] - shared <= high for name, one in found.runs.items() for low, high in [one.ci95]]
    assert set(found.runs) == set(FITTED)
    assert sum(inside) >= len(inside) - 1
    assert found.sd == pytest.approx(np.std(list(planted.values()), ddof=1), rel=0.15)


def test_runs_that_do_not_differ_have_no_values(logged):
    assert estimated(measured(logged)) is None


def test_values_that_follow_the_voltage_are_no_accident_of_the_run(logged):
    """A loss that grows with the voltage is a missing effect."""
    size = {run.name: float(np.sqrt(np.mean(motor_inputs(run, logged) ** 2))) for run in logged.runs}
    assert estimated(measured(logged, GAIN, {name: 0.1 - 0.04 * size[name] for name in FITTED})) is None


def test_the_verdict_says_what_differs_and_lacks_nothing_else(logged):
    found = pipeline.discover(measured(logged, GAIN, GAINS), jobs=1)
    figures = check(found)
    assert figures["verdict"] == "none"
    (entry,) = figures["run_values"]
    assert entry["kind"] == "supply_gain"
    assert entry["applied"]
    assert "differs from run to run" in entry["sentence"]
    assert "tested" not in entry["runs"]


def test_a_set_in_which_no_run_differs_gets_the_same_answer_without_the_stage(logged, monkeypatch):
    data = measured(logged, coulomb_friction={"torque": 0.006})
    found = [pipeline.discover(data, jobs=1)]
    monkeypatch.setattr(pipeline, "KINDS", ())
    found.append(pipeline.discover(data, jobs=1))
    written = [{**verdict_json(one), "elapsed_s": 0.0} for one in found]
    assert written[0]["run_values"] == []
    assert written[0] == written[1]
    assert model_file.render(found[0].augmented) == model_file.render(found[1].augmented)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("input_delay", {"delay": 0.06}),
        ("battery_discharge", {"slope": 0.12}),
        ("start_delay", {"delay": 0.2}),
    ],
)
def test_what_all_runs_share_keeps_its_name(logged, name, size):
    found = pipeline.discover(measured(logged, **{name: size}), jobs=1)
    assert [one.name for one in found.effects] == [name]
    assert found.run_values == ()
