"""Planted values that differ from run to run are found; what all runs share is named as an effect of the library."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.data.input_timing import held_back, later
from brickpilot.discover import pipeline
from brickpilot.discover.finding import verdict_json
from brickpilot.discover.parts import RunPart, run_parts
from brickpilot.fit.parameters import Plan
from brickpilot.vehicle.replay import RUN_KINDS, Replay
from synthetic import robot, write

SIGNALS = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05, "yaw_rate": 0.01}
VOLTAGES = {
    "ahead": (6.0, 6.0), "back": (-5.0, -5.0), "right": (5.0, -5.0), "left": (-4.0, 4.0), "curve": (7.0, 4.0),
    "bend": (3.0, 6.0), "slow": (3.5, 3.5), "tested": (5.5, 4.5),
}  # fmt: skip
ROLES = ["fit"] * 7 + ["held_out"]
FITTED = list(VOLTAGES)[:7]
GAINS = dict(zip(FITTED, (0.03, -0.05, 0.04, -0.02, -0.06, 0.05, 0.01), strict=True))
DELAYS = dict(zip(FITTED, (0.06, 0.01, 0.03, 0.08, 0.0, 0.02, 0.05), strict=True))
STARTS = dict(zip(VOLTAGES, (0.15, 0.25, 0.2, 0.3, 0.12, 0.35, 0.18, 0.22), strict=True))


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """Returns a data set of eight runs of a robot whose values are known to 2 % (sd)."""
    known = {name: value for name, value in robot().parameters.items() if value}
    nominal = "\n".join(f"{name} = {{ value = {value}, sd = {0.02 * value} }}" for name, value in known.items())
    return reading.read(write(tmp_path_factory.mktemp("runs") / "set", robot(), SIGNALS, nominal,
                              manoeuvres=VOLTAGES, roles=ROLES))  # fmt: skip


def measured(logged, kind="supply_gain", values=None, **effects):
    """Returns `logged` with the outputs of a robot that has these values of its runs and these effects."""
    truth = dataclasses.replace(robot(), effects=effects, by_run={kind: values or {}})
    simulated = Replay(logged).simulate([truth])[0]
    random, runs = np.random.default_rng(3), []
    for run in logged.runs:
        outputs = {
            name: simulated[run.name][name] + random.normal(0, sd, len(run.time)) for name, sd in SIGNALS.items()
        }
        runs.append(dataclasses.replace(run, outputs=outputs, raw_outputs=outputs))
    return dataclasses.replace(logged, runs=tuple(runs))


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


def test_a_value_of_a_run_changes_the_inputs_of_that_run_alone(logged):
    one = dataclasses.replace(robot(), by_run={"supply_gain": {"back": 0.1}})
    plain, changed = Replay(logged).simulate([robot(), one])
    for run in logged.runs:
        same = np.array_equal(plain[run.name]["yaw_rate"], changed[run.name]["yaw_rate"]) and np.array_equal(
            plain[run.name]["wheel_speed_left"], changed[run.name]["wheel_speed_left"]
        )
        assert same == (run.name != "back")
    runs = tuple(
        dataclasses.replace(run, inputs={name: 1.1 * volts for name, volts in run.inputs.items()})
        for run in logged.runs
    )
    scaled = Replay(dataclasses.replace(logged, runs=runs)).simulate([robot()])[0]
    assert changed["back"]["wheel_speed_left"] == pytest.approx(scaled["back"]["wheel_speed_left"], abs=1e-9)


def test_a_part_of_values_has_one_for_each_fit_run():
    assert run_parts(["one", "two"]) == []
    parts = run_parts(FITTED)
    assert [one.name for one in parts] == list(RUN_KINDS)
    for one in parts:
        assert isinstance(one, RunPart)
        plan = one.starting(Plan(robot(), (), ()), dict.fromkeys(FITTED, 0.1))
        assert [free.name for free in plan.free] == [f"{one.effect}@{run}" for run in FITTED]
        assert plan.at(plan.start()).by_run == {one.effect: pytest.approx(dict.fromkeys(FITTED, 0.1))}
        assert one.removed_from(plan.model).by_run == {}
        low, high = plan.free[0].bounds()
        kind = RUN_KINDS[one.effect]
        assert plan.free[0].to_value(low) == pytest.approx(kind.low, abs=1e-9)
        assert plan.free[0].to_value(high) == pytest.approx(kind.high)


@pytest.mark.parametrize(
    ("kind", "planted"), [("supply_gain", GAINS), ("delay", DELAYS)], ids=lambda one: str(one)[:11]
)
def test_planted_values_are_named_within_their_intervals(logged, kind, planted):
    found = pipeline.discover(measured(logged, kind, planted), jobs=1)
    assert [one.kind for one in found.run_values] == [kind]
    shared_by_all = {"input_delay"}  # the common part of all runs is an effect of the library
    assert kind in found.explanations[0].effects
    assert {*found.explanations[0].effects} - {kind} <= shared_by_all
    assert {one.name for one in found.effects} <= shared_by_all
    if not found.effects:
        assert found.verdict == "none"  # no effect of the library is missing
    (values,) = found.run_values
    assert set(values.runs) == set(FITTED)
    told = {name: one for name, (one, _) in values.runs.items()}
    known = [planted[name] for name in told]
    shared = np.mean(known) - np.mean(list(told.values()))  # the model may take over the common part
    inside = [low <= planted[name] - shared <= high for name, (_, (low, high)) in values.runs.items()]
    assert sum(inside) >= len(inside) - 1
    assert np.std(list(told.values())) == pytest.approx(np.std(known), rel=0.15)
    (entry,) = verdict_json(found)["run_values"]
    assert entry["kind"] == kind
    assert "differs from run to run" in entry["sentence"]
    assert "tested" not in entry["runs"]
    assert found.augmented.by_run == {}


def test_late_starts_are_a_start_delay_from_which_runs_differ(logged):
    found = pipeline.discover(measured(logged, "start", STARTS), jobs=1)
    assert (found.verdict, [one.name for one in found.effects]) == ("named", ["start_delay"])
    low, high = found.effects[0].parameters["delay"].ci95
    assert low <= np.mean([STARTS[name] for name in FITTED]) <= high
    ((values,), delay) = found.run_values, found.effects[0].parameters["delay"].value
    assert values.kind == "start"
    assert all(delay + value == pytest.approx(STARTS[name], abs=0.01) for name, (value, _) in values.runs.items())


def test_a_start_of_a_run_adds_to_the_start_delay_and_their_sum_is_never_negative(logged):
    starts = {"ahead": 0.1, "back": -0.1, "right": -0.5}
    truth = dataclasses.replace(robot(), effects={"start_delay": {"delay": 0.2}}, by_run={"start": starts})
    found = Replay(logged).simulate([truth])[0]
    for name, delay in {"ahead": 0.3, "back": 0.1, "right": 0.0, "left": 0.2}.items():
        same = dataclasses.replace(robot(), by_run={"start": {name: delay}})
        expected = Replay(logged).simulate([same])[0]
        assert found[name]["wheel_speed_left"] == pytest.approx(expected[name]["wheel_speed_left"], abs=1e-9)


def test_the_effect_table_names_values_of_runs_that_exist():
    named = {info.run_value for effect in catalogue.effects() for info in effect.parameters} - {""}
    assert named == {"start"}
    assert named <= set(RUN_KINDS)


def test_runs_that_do_not_differ_have_no_values(logged):
    found = pipeline.discover(measured(logged), jobs=1)
    assert found.verdict == "none"
    assert found.run_values == ()


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("input_delay", {"delay": 0.06}),
        ("battery_discharge", {"slope": 0.12}),
        ("start_delay", {"delay": 0.2}),
        ("coulomb_friction", {"torque": 0.006}),
    ],
)
def test_what_all_runs_share_keeps_its_name(logged, name, size):
    found = pipeline.discover(measured(logged, **{name: size}), jobs=1)
    assert [one.name for one in found.effects] == [name]
    assert found.run_values == ()
