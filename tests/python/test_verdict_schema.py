"""verdict.json is valid for every verdict: it follows the published schema, and has neither NaN nor Infinity."""

from __future__ import annotations

import copy
import dataclasses

import pytest
from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.data.gap import Gap
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Parameter, Rank, Visible, verdict_json
from findings import DIFFERS, FRICTION, VERDICTS, all_verdicts
from jsonschema import Draft202012Validator
from synthetic import motor, write
from verdict_schema import CLOSED, SCHEMA, check

NAN, INFINITY = float("nan"), float("inf")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return all_verdicts(tmp_path_factory.mktemp("schema") / "set")


@pytest.fixture(scope="module")
def of_a_motor(tmp_path_factory):
    truth = dataclasses.replace(motor(battery_voltage=9.0), effects={"coulomb_friction": {"torque": 0.004}})
    volts = {f"v{number}": (one, 0.0) for number, one in enumerate((2.0, -3.0, 4.5, -6.0, 7.0, 8.5))}
    folder = tmp_path_factory.mktemp("motor") / "set"
    write(
        folder, truth, {"speed": 0.02}, "battery_voltage = 9.0", manoeuvres=volts, roles=["fit", "fit", "held_out"] * 2
    )
    return pipeline.discover(reading.read(folder))


def test_the_schema_is_a_schema_of_draft_2020_12():
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    Draft202012Validator.check_schema(SCHEMA)


def test_the_mechanisms_are_those_of_the_table_of_effects():
    assert {one.mechanism for one in catalogue.effects()} <= set(SCHEMA["$defs"]["mechanism"]["enum"])


@pytest.mark.parametrize("kind", VERDICTS)
def test_every_verdict_holds_to_the_schema(found, kind):
    assert check(found[kind])["verdict"] == kind


def test_the_verdict_on_a_motor_holds_to_the_schema(of_a_motor):
    figures = check(of_a_motor)
    assert figures["fit_percent"]["speed"]["free_run"]["before"] is not None


def test_what_is_no_number_is_null(found):
    """A finding lacks numbers if there is no noise, no held-out run or no limit; the file then has null."""
    torque = Parameter(0.006, "N m", (-INFINITY, INFINITY))
    made = dataclasses.replace(
        found["named"],
        effects=(dataclasses.replace(FRICTION, parameters={"torque": torque}, removed=NAN),),
        gap={"fit": Gap(INFINITY, NAN), "held_out": Gap(None, None)},
        ranking=(Rank(("gyro_bias",), {"gyro_bias.bias": NAN}, INFINITY, -INFINITY, "Not fitted."),),
        power={"gyro_bias": Visible("bias", INFINITY, "rad/s")},
    )
    figures = check(made)
    assert figures["effects"][0]["parameters"]["torque"]["ci95"] == [None, None]
    assert figures["gap"]["fit"] == {"before": None, "after": None}
    assert figures["ranking"][0]["removed"] is None


def test_a_key_that_nobody_described_is_found(of_a_motor):
    """Each new key in verdict.json has to be described in the schema."""
    figures = verdict_json(of_a_motor)
    validator = Draft202012Validator(CLOSED)
    for spoil in (
        lambda one: one.update(surprise=1),
        lambda one: one["predictable"]["free_run"].update(surprise=1),
        lambda one: one["fit_percent"]["speed"]["free_run"].pop("held_out"),
        lambda one: one["gap"]["fit"].update(before="much"),
    ):
        other = copy.deepcopy(figures)
        assert not list(validator.iter_errors(other))
        spoil(other)
        assert list(validator.iter_errors(other))


def test_an_effect_without_an_interval_holds_to_the_schema(found):
    alone = dataclasses.replace(FRICTION, name="gyro_bias", parameters={"bias": Parameter(0.02, "rad/s", None)})
    assert (
        check(dataclasses.replace(found["named"], effects=(alone,)))["effects"][0]["parameters"]["bias"]["ci95"] is None
    )


def test_values_of_the_runs_hold_to_the_schema(found):
    figures = check(dataclasses.replace(found["named"], run_values=(DIFFERS,)))
    assert figures["run_values"][0]["runs"]["spin"] == {"value": 0.022, "ci95": [0.018, 0.026]}
    unknown = dataclasses.replace(DIFFERS, runs={"spin": (0.022, (NAN, NAN)), "curve": (0.0, (-0.1, 0.1))})
    figures = check(dataclasses.replace(found["named"], run_values=(unknown,)))
    assert figures["run_values"][0]["runs"]["spin"]["ci95"] == [None, None]


def test_the_explanations_hold_to_the_schema(found):
    figures = check(found["ambiguous"])
    assert figures["explanations"][1] == {"effects": ["actuator_deadband"], "weight": 0.24, "mechanisms": ["drive"]}
    assert figures["predictable_left"] == {"yaw_rate": 0.04}
    assert check(found["none"])["explanations"][0]["effects"] == []
    assert check(dataclasses.replace(found["none"], predictable_left=None))["predictable_left"] is None
