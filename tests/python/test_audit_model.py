"""The audit finds wrong channels that contradict the nominal model, but no other channel."""

from __future__ import annotations

import re
import shutil
from math import pi
from pathlib import Path

import numpy as np
import planted
import pytest
import synthetic
from brickpilot import catalogue
from brickpilot.data.audit import against_model
from brickpilot.data.audit.fault import Fault, usual_factors
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from brickpilot.fit import parameters
from brickpilot.vehicle.replay import Replay
from test_dataset import measured

DEGREES, RPM = 180 / pi, 30 / pi
NOMINAL = {
    "lego_ev3_motor": "emf_constant = 0.468\nresistance = 6.69",  # published for this motor, at its shaft
    "linear_axis": "mass = 95\nviscous_friction = 200",
}
STATED = """\
wheel_radius = 0.041
half_track = 0.069
resistance = 22.5
emf_constant = 0.24"""
EVERY = "every run"


def contradictions(dataset: Dataset) -> tuple[Fault, ...]:
    plan = parameters.plan(dataset)
    return against_model.contradictions(dataset, Replay(dataset).simulate([plan.at(plan.start())])[0])


def lone(source: Path, folder: Path, signal: str, nominal: str) -> Path:
    """Returns a copy of a motor's set with nominal values, in which `signal` is the only output."""
    shutil.copytree(source, folder)
    toml = folder / "dataset.toml"
    others = "|".join(sorted({"angle", "speed", "position"} - {signal}))
    text = re.sub(rf"^({others}) *=.*\n", "", toml.read_text(encoding="utf-8"), flags=re.MULTILINE)
    toml.chmod(0o644)
    toml.write_text(text.replace("[nominal]\n", f"[nominal]\n{nominal}\n"), encoding="utf-8")
    return folder


OWN = None
LONE = [
    (name, column, signal, factor, where)
    for name, column, signal, run in (
        ("lego_ev3_motor", "speed_degps", "speed", "duty_60"),
        ("lego_ev3_motor", "angle_deg", "angle", "duty_m80"),
        ("linear_axis", "position_m", "position", "trajectory"),
    )
    for factor in (-1.0, DEGREES, 1 / DEGREES, RPM, 1 / RPM)
    for where in (EVERY, run)
]


@pytest.mark.parametrize(("name", "column", "signal", "factor", "where"), LONE)
def test_a_lone_wrong_channel_is_found_by_the_other_runs_or_the_model(
    name: str, column: str, signal: str, factor: float, where: str, tmp_path: Path
) -> None:
    base = lone(measured(name), tmp_path / "sound", signal, NOMINAL[name])
    runs = [] if where == EVERY else [where]
    dataset = planted.plant(base, tmp_path / "s", [column], lambda values: values * factor, *runs)
    found = [fault for fault in (*dataset.faults, *contradictions(dataset)) if fault.kind != "frozen"]
    assert {(fault.run, fault.signal, fault.kind) for fault in found} == {
        (run.name, signal, "sign" if factor < 0 else "unit") for run in dataset.runs if not runs or run.name in runs
    }
    # Friction halves the motion. So if the true factor is unusual for the signal, the factor of inches fits, too.
    if runs or factor < 0 or max(factor, 1 / factor) in usual_factors(signal):
        np.testing.assert_allclose([fault.factor for fault in found], factor, rtol=0.03)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize(
    ("name", "signal"), [("lego_ev3_motor", "speed"), ("lego_ev3_motor", "angle"), ("linear_axis", "position")]
)
def test_sound_measured_channels_do_not_contradict_the_model(
    name: str, signal: str, stated: bool, tmp_path: Path
) -> None:
    nominal = NOMINAL[name] if stated else ""
    assert contradictions(read(lone(measured(name), tmp_path / "s", signal, nominal))) == ()


@pytest.mark.parametrize("name", ["lego_ev3_motor", "linear_axis", "micromouse"])
def test_sound_measured_sets_do_not_contradict_the_model(name: str) -> None:
    assert contradictions(read(measured(name))) == ()


def lone_gyro(folder: Path, factor: float, nominal: str = STATED, truth: object = None) -> Dataset:
    def spoil(_: str, table: dict[str, np.ndarray]) -> None:
        table["yaw_rate"] = table["yaw_rate"] * factor

    noise = {"yaw_rate": 0.014, "accel_surge": 0.025}
    return read(synthetic.write(folder, truth or synthetic.robot(), noise, nominal, spoil=spoil))


@pytest.mark.parametrize("factor", [DEGREES, 1 / DEGREES, RPM])
def test_a_lone_gyro_in_another_unit_is_found_where_the_geometry_is_stated(factor: float, tmp_path: Path) -> None:
    dataset = lone_gyro(tmp_path / "s", factor)
    found = (*dataset.faults, *contradictions(dataset))
    assert {(fault.run, fault.signal) for fault in found} == {(run.name, "yaw_rate") for run in dataset.runs}
    np.testing.assert_allclose([fault.factor for fault in found], factor)


def test_a_unit_is_not_judged_by_what_is_only_preset(tmp_path: Path) -> None:
    assert contradictions(lone_gyro(tmp_path / "s", DEGREES, "mass = 0.6")) == ()


@pytest.mark.parametrize("effect", [effect.name for effect in catalogue.effects()])
def test_no_effect_contradicts_the_nominal_model(effect: str, tmp_path: Path) -> None:
    info = next(one for one in catalogue.effects() if one.name == effect)
    truth = synthetic.robot()
    values = {one.name: float(np.clip(2 * one.preset, one.minimum, one.maximum)) for one in info.parameters}
    truth = type(truth)(truth.name, truth.vehicle, truth.profile, truth.parameters, {effect: values})
    assert contradictions(lone_gyro(tmp_path / "s", 1.0, truth=truth)) == ()


def test_what_contradicts_is_left_out_and_said(tmp_path: Path) -> None:
    dataset = lone_gyro(tmp_path / "s", DEGREES)
    found = contradictions(dataset)
    left = against_model.leave_out(dataset, found)
    assert left.faults == (*dataset.faults, *found)
    for run, before in zip(left.runs, dataset.runs, strict=True):
        wrong = (run.name, "yaw_rate") in {(fault.run, fault.signal) for fault in found}
        assert np.isnan(run.outputs["yaw_rate"]).all() == wrong
        assert not run.outputs["yaw_rate"].flags.writeable
        np.testing.assert_array_equal(run.outputs["accel_surge"], before.outputs["accel_surge"])
        np.testing.assert_array_equal(run.raw_outputs["yaw_rate"], before.raw_outputs["yaw_rate"])
    note = left.notes[-1]
    assert "yaw_rate seems to be in degrees per second: 57.3 times the value expected from the nominal model" in note
    assert note.endswith("left out")


def test_nothing_found_leaves_the_data_set_as_it_is(tmp_path: Path) -> None:
    dataset = lone_gyro(tmp_path / "s", 1.0)
    left = against_model.leave_out(dataset, ())
    assert (left.faults, left.notes) == (dataset.faults, dataset.notes)
    np.testing.assert_array_equal(left.runs[0].outputs["yaw_rate"], dataset.runs[0].outputs["yaw_rate"])
