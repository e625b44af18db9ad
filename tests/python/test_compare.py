"""Comparison of measured data with a model: the numbers, the roles, the windows, the page."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from brickpilot import dataset
from brickpilot.compare import compare
from brickpilot.errors import InputError
from brickpilot.ils import pooled, signal_error
from brickpilot.plant import State
from brickpilot.plot_compare import compare_page
from brickpilot.replay import zero_phase_rate
from synthetic import robot, write

SIGNALS = {"wheel_speed_left": 0.0, "wheel_travel_right": 0.0, "yaw_rate": 0.0}
AXIS = """
name = "axis"
vehicle = "motor"
[signals]
time = { column = "t", unit = "s" }
voltage = { column = "u", unit = "V" }
position = { column = "x", unit = "m" }
[nominal]
force_per_volt = 30.0
mass = 90.0
viscous_friction = 200.0
[[runs]]
name = "sweep"
file = "sweep.csv"
"""


def write_axis(folder):
    """An axis of 100 kg and 250 N s/m, logged for 6 s; solved by hand: first order in the velocity between samples."""
    time = np.arange(0.0, 6.0, 0.002)
    volts = 2.0 * np.sign(np.sin(2.0 * time))
    position, velocity, rows = 0.5, 0.0, []
    decay = np.exp(-250.0 / 100.0 * 0.002)
    for t, u in zip(time, volts, strict=True):
        rows.append(f"{t:.6f},{u:.3f},{position:.12g}")
        final = 30.0 * u / 250.0
        position += final * 0.002 + (velocity - final) * (1 - decay) * 100.0 / 250.0
        velocity = final + (velocity - final) * decay
    folder.mkdir()
    (folder / "dataset.toml").write_text(AXIS, encoding="utf-8")
    (folder / "sweep.csv").write_text("\n".join(["t,u,x", *rows]) + "\n", encoding="utf-8")
    return dataset.read(folder)


def test_ils_is_the_trapezoidal_integral_on_irregular_times():
    time = np.array([0.0, 0.1, 0.4, 1.0])
    error = signal_error(time, np.array([1.0, 3.0, 2.0, 2.0]), np.array([1.0, 1.0, 1.0, 1.0]))
    assert error.ils == pytest.approx(0.1 * (0 + 4) / 2 + 0.3 * (4 + 1) / 2 + 0.6 * (1 + 1) / 2)
    assert error.energy == pytest.approx(1.0)
    assert error.rms_signal == pytest.approx(1.0)
    assert error.ils_normalised == pytest.approx(error.ils)


def test_blank_measurements_leave_their_intervals_out():
    time = np.arange(5.0)
    measured = np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    error = signal_error(time, np.array([1.0, 1.0, 50.0, 2.0, 2.0]), measured)
    assert error.seconds == 2.0
    assert error.ils == pytest.approx(1.0)


def test_a_signal_without_energy_has_no_share():
    assert signal_error(np.arange(3.0), np.ones(3), np.zeros(3)).share is None


def test_pooled_runs_weigh_by_their_time():
    short = signal_error(np.array([0.0, 1.0]), np.full(2, 2.0), np.ones(2))
    long = signal_error(np.array([0.0, 9.0]), np.ones(2), np.ones(2))
    assert pooled([short, long]).rms_error == pytest.approx(0.1**0.5)


def test_the_true_model_leaves_nothing(tmp_path):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    found = compare(data, robot())
    assert all((error.share or 0.0) < 1e-6 for run in found.runs for error in run.signals.values())


def test_a_run_starts_from_the_state_its_first_sample_measured(tmp_path):
    start = State(surge=0.3, yaw_rate=0.8, heading=0.4)
    signals = {"wheel_velocity_left": 0.0, "wheel_velocity_right": 0.0, "wheel_travel_left": 0.0, "yaw_angle": 0.0}
    found = compare(dataset.read(write(tmp_path / "set", robot(), signals, "", start=start)), robot())
    assert all(error.share < 1e-6 for run in found.runs for error in run.signals.values())


def test_a_stated_start_is_taken_before_the_measured_one(tmp_path):
    data = dataset.read(
        write(tmp_path / "set", robot(), SIGNALS, "", initial="wheel_speed_left = 5.0, wheel_speed_right = 5.0")
    )
    found = compare(data, robot())
    assert all(run.signals["wheel_speed_left"].rms_error > 0.1 for run in found.runs)


@pytest.mark.parametrize("frame", ["FRD", "FLU"])
def test_a_wrong_model_is_as_far_off_in_either_frame(tmp_path, frame):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, "", frame=frame))
    found = compare(data, robot(emf_constant=0.28))
    assert found.share("fit", "yaw_rate") == pytest.approx(0.0967, abs=0.001)


def test_keys_of_the_json_object(tmp_path):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    entry = json.loads(json.dumps(compare(data, robot()).to_json(), allow_nan=False))["runs"][0]
    assert {"name", "role", "signals"} <= set(entry)
    assert set(entry["signals"]) == set(SIGNALS)
    assert set(entry["signals"]["yaw_rate"]) == {"ils", "ils_normalised", "rms_error", "rms_signal"}


def test_without_a_model_what_is_absent_is_fitted_and_named(tmp_path):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, "half_track = 0.07\nwheel_radius = 0.0408"))
    found = compare(data)
    assert any("does not give mass" in note for note in found.notes)
    assert found.share("fit", "wheel_speed_left") < 0.01


def test_roles_left_open_are_chosen_the_same_way_every_time(tmp_path):
    more = {"fast": (7.0, 7.0), "slow": (3.0, 3.0), "middle": (5.0, 5.0), "spin": (4.0, -4.0)}
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, "", manoeuvres=more, roles=[""] * 4))
    found = [compare(data, robot()) for _ in range(2)]
    assert (
        [run.role for run in found[0].runs] == [run.role for run in found[1].runs] == ["fit", "fit", "held_out", "fit"]
    )
    assert any("held out middle" in note for note in found[0].notes)


def test_a_repeat_is_held_out_rather_than_what_it_repeats(tmp_path):
    more = {"one": (5.0, 5.0), "again": (5.0, 5.0)}
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, "", manoeuvres=more, roles=["", ""]))
    runs = (data.runs[0], dataclasses.replace(data.runs[1], replicate_of="one"))
    found = compare(dataclasses.replace(data, runs=runs), robot())
    assert [run.role for run in found.runs] == ["fit", "held_out"]


def test_windows_of_a_motor_start_from_its_measured_state(tmp_path):
    data = write_axis(tmp_path / "axis")
    found = compare(data)
    assert found.window_s == 1.0
    windowed = found.runs[0].windows["velocity"]
    assert windowed.seconds == pytest.approx(5.0, abs=0.01)
    assert 0.02 < windowed.share < 0.3
    right = dataclasses.replace(
        found.model, parameters={**found.model.parameters, "mass": 100.0, "viscous_friction": 250.0}
    )
    assert compare(data, right).runs[0].windows["velocity"].share < 0.01


def test_windows_of_a_vehicle_that_has_none_are_refused(tmp_path):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    with pytest.raises(InputError, match="windows"):
        compare(data, robot(), window_s=1.0)


def test_a_model_of_another_vehicle_is_refused(tmp_path):
    with pytest.raises(InputError, match="diff_drive"):
        compare(write_axis(tmp_path / "axis"), robot())


def test_the_zero_phase_rate_has_no_delay():
    time = np.cumsum(np.random.default_rng(0).uniform(0.8e-3, 1.2e-3, 4000))
    rate = zero_phase_rate(time, np.sin(3 * time))
    assert np.max(np.abs(rate - 3 * np.cos(3 * time))[20:-20]) < 0.01


def test_the_page_stands_alone_with_fit_and_held_out_apart(tmp_path):
    data = dataset.read(write(tmp_path / "set", robot(), SIGNALS, "", roles=["fit", "fit", "held_out", "fit"]))
    page = compare_page(compare(data, robot()))
    assert page.count("<svg") == 4 * len(SIGNALS)
    assert "held-out runs" in page
    assert "<script" not in page
