"""`compare` computes how a model differs from measured data: the numbers, the roles, the windows, the page."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.data.motion import zero_phase_rate
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.comparison import compare
from brickpilot.report.fit_pages import compare_page
from brickpilot.vehicle import plant
from brickpilot.vehicle.plant import State
from brickpilot.vehicle.replay import Replay
from pages import assert_self_contained, curves, figures
from synthetic import motor, robot, write

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
    """Writes 6 s of an axis of 100 kg and 250 N s/m, from the exact first-order solution between samples."""
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
    return reading.read(folder)


def test_the_true_model_leaves_nothing(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    found = compare(data, robot())
    assert all((error.share or 0.0) < 1e-6 for run in found.runs for error in run.signals.values())


def test_a_run_starts_from_the_state_its_first_sample_measured(tmp_path):
    start = State(surge=0.3, yaw_rate=0.8, heading=0.4)
    signals = {"wheel_velocity_left": 0.0, "wheel_velocity_right": 0.0, "wheel_travel_left": 0.0, "yaw_angle": 0.0}
    found = compare(reading.read(write(tmp_path / "set", robot(), signals, "", start=start)), robot())
    # The start comes from a line through the first samples. As the speed is curved, the share is not 0, but small.
    assert all(0 < error.share < 0.005 for run in found.runs for error in run.signals.values())


def test_one_wrong_sample_at_the_start_is_no_state(tmp_path):
    """A robot starts in motion: a first sample of twice the speed does not shift the whole simulated run."""

    def jump(name, table):
        table["wheel_speed_left"][0] *= 2
        table["wheel_speed_right"][0] *= 2

    start = State(surge=0.3, wheel_speed=(7.35, 7.35))
    signals = {"wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
    known = dict(manoeuvres={"straight": (4.0, 4.0)}, roles=["fit"], start=start, spoil=jump)
    found = compare(reading.read(write(tmp_path / "set", robot(), signals, "", **known)), robot())
    (run,) = found.runs
    assert abs(run.traces["wheel_speed_left"].simulated[1] - 7.35) < 2.5
    assert found.headline.of("wheel_speed_left", "fit").fit_percent > 90


def test_a_stated_start_is_taken_before_the_measured_one(tmp_path):
    data = reading.read(
        write(tmp_path / "set", robot(), SIGNALS, "", initial="wheel_speed_left = 5.0, wheel_speed_right = 5.0")
    )
    found = compare(data, robot())
    assert all(run.signals["wheel_speed_left"].rms_error > 0.1 for run in found.runs)


@pytest.mark.parametrize("frame", ["FRD", "FLU"])
def test_a_wrong_model_is_as_far_off_in_either_frame(tmp_path, frame):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "", frame=frame))
    found = compare(data, robot(emf_constant=0.28))
    assert found.share("fit", "yaw_rate") == pytest.approx(0.0967, abs=0.001)


def test_keys_of_the_json_object(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    entry = json.loads(json.dumps(compare(data, robot()).to_json(), allow_nan=False))["runs"][0]
    assert {"name", "role", "signals"} <= set(entry)
    assert set(entry["signals"]) == set(SIGNALS)
    assert set(entry["signals"]["yaw_rate"]) == {"ils", "ils_normalised", "rms_error", "rms_signal"}


def test_without_a_model_what_is_absent_is_fitted_and_named(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "half_track = 0.07\nwheel_radius = 0.0408"))
    found = compare(data)
    assert any("does not fix mass" in note for note in found.notes)
    assert found.share("fit", "wheel_speed_left") < 0.01


def test_roles_left_open_are_chosen_the_same_way_every_time(tmp_path):
    more = {"fast": (7.0, 7.0), "slow": (3.0, 3.0), "middle": (5.0, 5.0), "spin": (4.0, -4.0)}
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "", manoeuvres=more, roles=[""] * 4))
    found = [compare(data, robot()) for _ in range(2)]
    assert (
        [run.role for run in found[0].runs] == [run.role for run in found[1].runs] == ["fit", "fit", "held_out", "fit"]
    )
    assert any("held out middle" in note for note in found[0].notes)


def test_a_repeat_is_held_out_rather_than_what_it_repeats(tmp_path):
    more = {"one": (5.0, 5.0), "again": (5.0, 5.0)}
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "", manoeuvres=more, roles=["", ""]))
    runs = (data.runs[0], dataclasses.replace(data.runs[1], replicate_of="one"))
    found = compare(dataclasses.replace(data, runs=runs), robot())
    assert [run.role for run in found.runs] == ["fit", "held_out"]


def test_windows_of_a_motor_start_from_its_measured_state(tmp_path):
    data = write_axis(tmp_path / "axis")
    found = compare(data)
    assert found.window_s == 1.0
    windowed = found.runs[0].windows["velocity"]
    assert windowed.seconds == pytest.approx(6.0, abs=0.01)
    assert 0.02 < windowed.share < 0.3
    right = dataclasses.replace(
        found.model, parameters={**found.model.parameters, "mass": 100.0, "viscous_friction": 250.0}
    )
    assert compare(data, right).runs[0].windows["velocity"].share < 0.01


def test_windows_of_a_vehicle_that_has_none_are_refused(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
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
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "", roles=["fit", "fit", "held_out", "fit"]))
    page = compare_page(compare(data, robot()))
    assert len(figures(page)) == 4 * len(SIGNALS)
    assert "held-out runs" in page
    assert_self_contained(page)


def test_a_figure_holds_measured_and_simulated_and_their_difference(tmp_path):
    found = compare(reading.read(write(tmp_path / "set", robot(), {"yaw_rate": 0.05}, "")), robot())
    run = found.runs[0]
    trace = run.traces["yaw_rate"]
    ((name, figure), *others) = figures(compare_page(found)).items()
    assert name == f"{run.name}: yaw rate, measured and simulated, and the residual below"
    assert figure["link"] == run.name
    assert {other["link"] for _, other in others} == {one.name for one in found.runs[1:]}
    drawn = curves(figure)
    assert drawn.keys() == {
        "yaw rate (rad/s): measured", "yaw rate (rad/s): simulated", "residual of yaw rate (rad/s): simulated"
    }  # fmt: skip
    at = np.abs(trace.time[:, np.newaxis] - figure["x"]["values"]).argmin(axis=0)
    residual = trace.measured - trace.simulated
    for key, expected in (
        ("yaw rate (rad/s): measured", trace.measured),
        ("residual of yaw rate (rad/s): simulated", residual),
    ):
        values = drawn[key]
        np.testing.assert_allclose(values, expected[at], atol=1e-4 * np.ptp(expected))


def torque_drive(folder, signals, nominal="torque_per_volt = { value = 0.02, sd = 0.001 }", **options):
    """Returns data of a motor whose drive controls the current: 0.02 N m/V, inertia 1e-4 kg m^2."""
    truth = motor(torque_per_volt=0.02, wheel_inertia=1e-4, viscous_friction=1e-3)
    return reading.read(write(folder, truth, signals, nominal, **options))


@pytest.mark.parametrize("given", ["torque_per_volt = { value = 0.02, sd = 0.001 }", "torque_per_volt = 0.02"])
def test_the_current_of_a_torque_drive_is_left_out_and_said(tmp_path, given):
    found = compare(torque_drive(tmp_path / "set", {"speed": 0.05, "current": 0.01}, given))
    assert all(set(run.signals) == {"speed"} for run in found.runs)
    assert any("does not give it: current" in note for note in found.notes)
    assert found.share("fit", "speed") < 0.02


@pytest.mark.parametrize("turning", ["speed", "angle"])
def test_speed_and_angle_of_a_force_drive_are_left_out_and_said(tmp_path, turning):
    truth = motor(force_per_volt=30.0, mass=90.0, wheel_inertia=0.0, viscous_friction=200.0)
    data = reading.read(write(tmp_path / "set", truth, {"position": 1e-5, turning: 0.0}, "force_per_volt = 30.0"))
    found = compare(data, window_s=0.5)
    assert all(set(run.signals) == {"position"} and set(run.windows) == {"velocity"} for run in found.runs)
    assert any(f"does not give it: {turning}" in note for note in found.notes)
    assert found.model.parameters["mass"] == pytest.approx(90.0, rel=0.05)


def test_a_motor_on_a_wheel_starts_at_its_measured_travel(tmp_path):
    truth = motor(wheel_radius=0.02, wheel_inertia=1e-3)
    start = State(wheel_speed=(8.0, 0.0), wheel_angle=(50.0, 0.0))
    data = reading.read(write(tmp_path / "set", truth, {"position": 0.0, "velocity": 0.0}, "", start=start))
    found = compare(data, truth)
    assert all(run.signals["position"].rms_error < 5e-4 for run in found.runs)
    assert all(abs(run.traces["position"].simulated[0] - 1.0) < 1e-12 for run in found.runs)


def with_values(data, signal, change):
    runs = tuple(
        dataclasses.replace(run, outputs={**run.outputs, signal: change(run.outputs[signal])}) for run in data.runs
    )
    return dataclasses.replace(data, runs=runs)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("signal", ["speed", "battery_voltage"])
@pytest.mark.parametrize("given", [None, motor()])
def test_data_without_anything_to_judge_are_refused(tmp_path, signal, given):
    data = reading.read(write(tmp_path / "set", motor(), {signal: 0.1}, ""))
    if signal == "speed":
        data = with_values(data, signal, lambda values: np.full_like(values, np.nan))
    with pytest.raises(InputError, match="nothing to compare"):
        compare(data, given)


@pytest.mark.filterwarnings("error")
def test_blanks_of_one_run_leave_the_others(tmp_path):
    def blank(run, table):
        if run == "spin":
            table["wheel_speed_left"][:] = table["wheel_travel_right"][:] = table["yaw_rate"][:] = np.nan

    found = compare(reading.read(write(tmp_path / "set", robot(), SIGNALS, "", spoil=blank)), robot())
    shares = {run.name: run.signals["yaw_rate"].share for run in found.runs}
    assert shares["spin"] is None
    assert shares["curve"] < 1e-6
    assert compare_page(found)


@pytest.mark.parametrize("given", [None, robot()])
def test_values_beyond_any_measurement_are_refused(tmp_path, given):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    data = with_values(data, "yaw_rate", lambda values: np.full_like(values, 1e200))
    with pytest.raises(InputError, match=r"yaw_rate: 1e[+]200 is too large to be a measurement"):
        compare(data, given)


@pytest.mark.parametrize("window_s", [float("nan"), float("inf"), -1.0, 1e-9, 0.019, 6.1])
def test_a_window_of_too_few_samples_or_longer_than_a_run_is_refused(tmp_path, window_s):
    with pytest.raises(InputError, match=r"--window: .* is not within 0.02 s"):
        compare(write_axis(tmp_path / "axis"), window_s=window_s)


def test_the_least_window_is_made(tmp_path):
    data = write_axis(tmp_path / "axis")
    given = motor(force_per_volt=30.0, mass=100.0, viscous_friction=250.0, wheel_inertia=0.0)
    assert compare(data, given, window_s=0.02).runs[0].windows["velocity"].seconds == pytest.approx(5.98, abs=0.02)


def test_windows_that_would_start_at_a_blank_are_left_out(tmp_path):
    def blank(values):
        return np.where((np.arange(len(values)) >= 900) & (np.arange(len(values)) < 1100), np.nan, values)

    given = motor(force_per_volt=30.0, mass=100.0, viscous_friction=250.0, wheel_inertia=0.0)
    found = compare(with_values(write_axis(tmp_path / "axis"), "position", blank), given, window_s=1.0)
    assert found.runs[0].windows["velocity"].seconds == pytest.approx(5 - 0.2, abs=0.01)
    assert found.runs[0].windows["velocity"].share < 0.02


def test_samples_that_crowd_do_not_exhaust_the_memory():
    time = np.concatenate([np.arange(100) * 1e-9, [1000.0, 2000.0]])
    assert len(zero_phase_rate(time, time)) == 102


ALL = """
mass = 0.9
yaw_inertia = 0.006
half_track = 0.07
wheel_radius = 0.0408
wheel_inertia = 1e-4
resistance = 22.0
torque_constant = 0.195
emf_constant = 0.245
viscous_friction = 1.8e-5
rolling_friction = 0.015
"""


def test_runs_all_held_out_are_compared_where_nothing_is_to_be_fitted(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ALL, roles=["held_out"] * 4))
    found = compare(data)
    assert found.share("held_out", "yaw_rate") < 1e-6
    assert "The data set holds every run out." in found.notes


def test_runs_all_held_out_are_refused_where_something_is_to_be_fitted(tmp_path):
    nominal = ALL.replace("mass = 0.9\n", "")
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, nominal, roles=["held_out"] * 4))
    with pytest.raises(InputError, match="every run is held out"):
        compare(data)


@pytest.mark.parametrize(
    ("roles", "said"),
    [
        (["fit"], "The data set holds no run out."),
        (["fit", "held_out"], "The data set states which runs are held out."),
    ],
)
def test_the_note_on_roles_is_true(tmp_path, roles, said):
    runs = {"one": (5.0, 5.0), "two": (4.0, 4.0)}
    chosen = dict(list(runs.items())[: len(roles)])
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "", manoeuvres=chosen, roles=roles))
    assert said in compare(data, robot()).notes


def test_the_age_of_a_run_counts_the_runs_and_gaps_before_it(tmp_path, monkeypatch):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    gaps = [0.0, 100.0, 7.0, 20.0]
    runs = tuple(dataclasses.replace(run, gap_s=gap) for run, gap in zip(data.runs, gaps, strict=True))
    ages, simulate = [], plant.simulate_into

    def recorded(values, starts, models, requests, *options):
        ages.extend(requests["initial"]["age"][:, 0])
        return simulate(values, starts, models, requests, *options)

    monkeypatch.setattr(plant, "simulate_into", recorded)
    Replay(dataclasses.replace(data, runs=runs)).simulate([robot()])
    lasts = 1.99
    assert ages == pytest.approx([0.0, lasts + 100.0, 2 * lasts + 107.0, 3 * lasts + 127.0])


def test_what_the_reader_found_is_in_the_report(tmp_path):
    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, "half_track = 0.07\nwheel_radius = 0.0408"))
    data = dataclasses.replace(data, notes=("run spin: 3 rows are damaged",))
    for found in (compare(data, robot()), compare(data)):
        assert found.notes.count("run spin: 3 rows are damaged") == 1
        assert "run spin: 3 rows are damaged" in compare_page(found)


def test_a_model_under_which_the_plant_diverges_is_one_failure(tmp_path, monkeypatch):
    def diverging(*_):
        raise SimulationError("the state diverged")

    data = reading.read(write(tmp_path / "set", robot(), SIGNALS, ""))
    monkeypatch.setattr(plant, "simulate_into", diverging)
    with pytest.raises(SimulationError, match="the state diverged"):
        compare(data, robot())


def test_of_many_runs_the_worst_are_drawn(tmp_path: Path) -> None:
    """Runs 3 and 7 of 30 are measured twice as fast as the others."""

    def spoil(name: str, table) -> None:
        if name in ("run_3", "run_7"):
            table["wheel_speed_left"] *= 2

    moves = {f"run_{number}": (4.0, 4.0) for number in range(30)}
    written = write(tmp_path / "many", robot(), {"wheel_speed_left": 0.05}, "", manoeuvres=moves, spoil=spoil)
    page = compare_page(compare(reading.read(written), robot()))
    headings = re.findall(r"<h2>(run_\d+)", page)
    assert len(headings) == 24
    assert {"run_3", "run_7"} <= set(headings)
    assert "6 others are in the table alone" in page
    assert all(f"<td>{name}</td>" in page for name in moves)
