"""Data sets of real machines, whose true values are unknown: compare and calibrate stay within stated bounds."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import planted
import pytest
from brickpilot.data import reading
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.comparison import compare
from importing import import_wpilib

DATA = Path(os.environ.get("BRICKPILOT_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))

pytestmark = pytest.mark.skipif(
    not (DATA / "linear_axis").is_dir(), reason=f"no measured sets in {DATA}; BRICKPILOT_DATA says where they are"
)


def fitted(folder, *effects):
    data = reading.read(folder)
    found = calibrate(data, effects=effects)
    return found, compare(data, found.model)


def test_linear_axis_without_dry_friction_leaves_a_sixth_of_the_velocity():
    found, compared = fitted(DATA / "linear_axis")
    assert set(found.parameters) == {"mass", "viscous_friction"}
    assert all(one.identifiable for one in found.parameters.values())
    for role in ("fit", "held_out"):
        assert compared.share(role, "velocity", windows=True) == pytest.approx(0.16, abs=0.015)


def test_linear_axis_with_coulomb_friction_comes_near_the_published_values():
    """Published values, fitted with an offset: 95.11 kg, 203.5 N s/m, 20.39 N (Janot, Gautier & Brunot 2019)."""
    found, compared = fitted(DATA / "linear_axis", "coulomb_friction")
    assert found.parameters["mass"].value == pytest.approx(95.1, rel=0.08)
    assert found.parameters["coulomb_friction.torque"].value == pytest.approx(20.4, rel=0.3)
    assert found.parameters["viscous_friction"].value == pytest.approx(203.5, rel=0.4)
    assert compared.share("held_out", "velocity", windows=True) < 0.125


def test_lego_motor_needs_a_dead_band_at_low_duty():
    plain, before = fitted(DATA / "lego_ev3_motor")
    dead, after = fitted(DATA / "lego_ev3_motor", "actuator_deadband")
    assert "angle is frozen" in " ".join(plain.notes)
    assert not plain.parameters["resistance"].identifiable
    assert dead.parameters["actuator_deadband.voltage"].value / 9.0 == pytest.approx(0.071, abs=0.015)
    assert after.share("held_out", "speed") < 0.6 * before.share("held_out", "speed")
    assert before.share("held_out", "speed") < 0.13  # held-out runs: duty 40 % both ways, where the dead band matters


def test_micromouse_straight_runs_are_fitted_up_to_their_collisions():
    """The spins are held out: they slip, and no model without slip fits both spins and straight runs."""
    data = reading.read(DATA / "micromouse")
    roles = {run.name: "fit" if run.name in ("t0_2", "t0_3", "t0_4") else "held_out" for run in data.runs}
    data = dataclasses.replace(data, runs=tuple(dataclasses.replace(run, role=roles[run.name]) for run in data.runs))
    found = calibrate(data)
    compared = compare(data, found.model)
    told = {one.name: one.value for one in found.combinations}
    assert told["speed per volt"] == pytest.approx(1.45, rel=0.1)
    off = {run.name: run.signals["wheel_travel_left"].share for run in compared.runs}
    assert off["t0_2"] < 0.22
    assert off["t0_3"] < 0.07
    assert max(off["t0_4"], off["t0_4_2"]) < 0.15  # two replicates; one of them was fitted


def test_frc_drivetrain_needs_dry_friction(tmp_path, full):
    files = [DATA / "frc_drivetrain" / f"{name}-data.json" for name in ("linear", "angular")]
    import_wpilib(files, tmp_path / "frc")
    if not full:
        planted.thin(tmp_path / "frc", 4)
    plain, before = fitted(tmp_path / "frc")
    dry, after = fitted(tmp_path / "frc", "coulomb_friction")
    told = {one.name: one.value for one in dry.combinations}
    assert 0.7 < told["dry friction in volts"] < 1.2
    assert told["speed per volt"] == pytest.approx(0.417, rel=0.1)
    # The held-out run is a slow turn, at voltages near the friction: only on the fit runs does the error fall by half.
    assert after.share("held_out", "wheel_velocity_left") < 0.7 * before.share("held_out", "wheel_velocity_left")
    assert plain.roles == dry.roles
