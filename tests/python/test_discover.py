"""The stages of discovery on data of known truth; data of other engines are in test_hidden_verdicts.py."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from brickpilot import catalogue
from brickpilot.data import dataset, holdout, periods, reading
from brickpilot.data.motion import cut_into_windows, with_averaged_starts, with_rates
from brickpilot.discover import numbers, pipeline
from brickpilot.discover.experiment import next_experiment
from brickpilot.discover.parts import library_parts
from brickpilot.discover.prepare import calibrate, prepare, with_default_sds
from brickpilot.discover.settle import best_predictor, better_predictor, error_changes, whole_runs
from brickpilot.fit import parameters
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import of_bins, of_samples
from brickpilot.vehicle import plant
from brickpilot.vehicle.manoeuvres import manoeuvres
from brickpilot.vehicle.replay import Replay
from synthetic import motor, robot, write
from verdict_schema import check

SIGNALS = {
    "accel_surge": 0.025,
    "accel_sway": 0.025,
    "yaw_rate": 0.014,
    "wheel_speed_left": 0.05,
    "wheel_speed_right": 0.05,
}
MANOEUVRES = {
    "ahead": (4.0, 4.0),
    "back": (-6.0, -6.0),
    "slow": (1.5, 1.5),
    "right": (4.5, -4.5),
    "left": (-3.0, 3.0),
    "curve": (6.0, 3.0),
    "bend": (2.5, 6.0),
    "backward_bend": (-3.0, -6.0),
}
NOMINAL = (
    "mass",
    "yaw_inertia",
    "half_track",
    "wheel_radius",
    "wheel_inertia",
    "resistance",
    "torque_constant",
    "emf_constant",
    "viscous_friction",
    "rolling_friction",
    "battery_voltage",
)


def hidden(folder, effects, *, signals=None, seed=1, error=0.02, **options):
    """Writes a data set with `effects`, and nominal values with relative errors of sd `error`; returns its folder."""
    truth = dataclasses.replace(robot(), effects=effects)
    random = np.random.default_rng(seed)
    nominal = "\n".join(f"{name} = {truth.parameters[name] * (1 + error * random.normal()):.9g}" for name in NOMINAL)
    options = {"manoeuvres": MANOEUVRES, "roles": [None] * len(MANOEUVRES)} | options
    return write(folder, truth, signals or SIGNALS, nominal + "\ninductance = 0.0", seed=seed, **options)


def errors_of(folder):
    """Returns the residual of the fit runs at the measured samples and on the coarse grid, and the nominal plan."""
    data = with_default_sds(reading.read(folder))
    inputs = {run.name: dataset.motor_inputs(run, data) for run in data.runs}
    ready = with_averaged_starts(data, inputs)
    plan, fitted = parameters.plan(ready), holdout.assign(ready, inputs).fit()
    width_s = numbers.BIN_S
    full, coarse = (of_bins(ready, plan.model, fitted, width_s=width_s, coarse=one) for one in (False, True))
    return full, coarse, plan


@pytest.fixture(scope="module")
def friction(tmp_path_factory):
    return pipeline.discover(
        reading.read(hidden(tmp_path_factory.mktemp("friction") / "set", {"coulomb_friction": {"torque": 0.005}}))
    )


@pytest.fixture(scope="module")
def nothing(tmp_path_factory):
    return pipeline.discover(reading.read(hidden(tmp_path_factory.mktemp("nothing") / "set", {})))


@dataclasses.dataclass(frozen=True)
class Made:
    model: object


def test_a_predictor_that_simulates_the_fit_runs_worse_gives_way_to_the_explanation(tmp_path):
    data = with_default_sds(reading.read(hidden(tmp_path / "set", {"coulomb_friction": {"torque": 0.005}}, error=0.0)))
    prepared = SimpleNamespace(dataset=data, measured=data, jobs=1)
    right, wrong = (
        Made(dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": torque}})) for torque in (0.005, 0.02)
    )
    assert better_predictor(prepared, right, wrong) is right
    kept = better_predictor(prepared, wrong, right)
    assert kept.model.effects == right.model.effects
    assert kept.model.name == f"{right.model.name}, predictor"


def cogging(signal, noise):
    """Returns what `prepare` makes of a motor's data: one measured signal, and a torque that repeats with each turn."""
    hidden = {"torque": 0.02, "order": 2.0, "phase": 0.3, "phase_difference": 0.0}
    truth = dataclasses.replace(motor(wheel_inertia=1e-3), effects={"cogging": hidden})
    time, random = np.arange(0.0, 4.0, 0.01), np.random.default_rng(0)
    frames = {}
    for name, volts in {"up": 4.0, "down": -3.0, "slow": 2.5}.items():
        inputs = np.where(time > 0.1, volts, 0.0)[:, np.newaxis]
        (run,) = plant.simulate([(truth, plant.OpenLoopRun(time=time, inputs=inputs))])
        values = run.outputs[signal] + noise * random.normal(size=len(time))
        frames[name] = pd.DataFrame({"time": time, "voltage": inputs[:, 0], signal: values})
    known = {
        name: truth.parameters[name] for name in ("resistance", "torque_constant", "emf_constant", "wheel_inertia")
    }
    data = dataset.Dataset.from_frames(frames, vehicle="motor", nominal=known)
    return prepare(data, None, seed=0, jobs=1)[0]


def test_whole_runs_of_a_motor_compare_the_position_that_was_measured():
    prepared = cogging("angle", 0.01)
    assert prepared.coarse.signals == ["speed"]
    assert whole_runs(prepared).signals == ["angle"]
    assert error_changes(prepared, motor(), motor()) == {"angle": 1.0}


@pytest.mark.parametrize(("signal", "noise", "is_known"), [("angle", 0.01, True), ("speed", 0.05, False)])
def test_a_predictor_has_the_phase_of_a_wheel_only_where_its_angle_is_measured(signal, noise, is_known):
    """Without a measured angle the next run starts at an unknown angle, so a phase from these runs is wrong there."""
    prepared, nominal = calibrate(cogging(signal, noise))
    grown = best_predictor(prepared, nominal, lambda text: None)
    assert grown.explanation.is_periodic == is_known


def test_the_residual_compares_the_mean_of_each_bin(tmp_path):
    full, _, plan = errors_of(hidden(tmp_path / "set", {}))
    run = full.replay.dataset.runs[2]
    block = next(one for one in full.blocks if one.run == run.name and one.signal == "yaw_rate")
    assert block.measured[5] == pytest.approx(run.outputs["yaw_rate"][15:18].mean())
    simulated = Replay(full.replay.dataset).simulate([plan.model])[0][run.name]["yaw_rate"]
    assert (block.picked @ simulated)[5] == pytest.approx(simulated[15:18].mean())


def test_samples_and_bins_have_the_same_noise_of_a_sample(tmp_path):
    full, coarse, plan = errors_of(hidden(tmp_path / "set", {}))
    samples = of_samples(Replay(full.replay.dataset), plan.model, sorted(full.runs))
    assert samples.sample_noise == full.sample_noise == coarse.sample_noise
    assert all(one.size >= one.noise == one.sample_noise for one in samples.scales.values())
    assert full.sample_noise["yaw_rate"] == pytest.approx(SIGNALS["yaw_rate"], rel=0.1)


def test_the_coarse_grid_simulates_what_the_measured_samples_do(tmp_path):
    """The rms difference is below 0.45 + 0.05 times the rms change by the effect, both in units of the signals' scales.

    Chaotic effects are left out.
    """
    full, coarse, plan = errors_of(hidden(tmp_path / "set", {}))
    effects = {one.name: {p.name: p.preset for p in one.parameters} for one in catalogue.effects()}
    chaotic = {"torque_ripple", "cogging", "gear_backlash"}
    nominal = full.predict([plan.model])[0]
    for name in ["none", *(effects.keys() - chaotic)]:
        model = dataclasses.replace(plan.model, effects={name: effects[name]} if name in effects else {})
        one = full.predict([model])[0]
        apart = np.sqrt(np.mean(((one - coarse.predict([model])[0]) * full.weight()) ** 2))
        does = np.sqrt(np.mean(((one - nominal) * full.weight()) ** 2))
        assert apart < 0.45 + 0.05 * does, name


def test_the_coarse_grid_has_a_row_where_a_command_jumps():
    """Without this row, a drive that coasts at 0 V would get the mean of 4 V and 0 V, and would brake for a row."""
    truth = dataclasses.replace(robot(), effects={"zero_coast": {"share": 0.95}})
    time = np.arange(0.0, 4.0, 0.003)
    frames = {}
    for name, ends in {"first": 1.501, "second": 2.222}.items():
        inputs = np.where((time > 0.2)[:, np.newaxis] & (time < ends)[:, np.newaxis], [[4.0, 3.0]], 0.0)
        (run,) = plant.simulate([(truth, plant.OpenLoopRun(time=time, inputs=inputs))])
        signals = {signal: run.outputs[signal] for signal in SIGNALS}
        frames[name] = pd.DataFrame(
            {"time": time, "voltage_left": inputs[:, 0], "voltage_right": inputs[:, 1], **signals}
        )
    ready = with_default_sds(dataset.Dataset.from_frames(frames, vehicle="diff_drive", nominal={"mass": 0.5}))
    full, coarse = (of_bins(ready, truth, list(frames), width_s=numbers.BIN_S, coarse=one) for one in (False, True))
    assert full.signals == coarse.signals == list(SIGNALS)
    exact, quick = full.predict([truth])[0], coarse.predict([truth])[0]
    for signal in SIGNALS:
        largest = max(np.abs(part).max() for part in full.parts(exact, signal))
        apart = max(np.abs(part).max() for part in full.parts(quick - exact, signal))
        assert apart < 0.03 * largest, signal


def test_a_fit_moves_the_moments_of_a_load(tmp_path):
    plan = errors_of(hidden(tmp_path / "set", {}))[2]
    load = next(one for one in library_parts(plan.model) if one.effect == "payload_mass" and len(one.free) == 3)
    loaded = load.starting(plan, {"mass": 0.5, "forward": 0.04, "right": -0.02})
    point = loaded.start()
    assert loaded.at(point).effects["payload_mass"] == pytest.approx({"mass": 0.5, "forward": 0.04, "right": -0.02})
    point[-3] *= 2
    assert loaded.at(point).effects["payload_mass"] == pytest.approx({"mass": 1.0, "forward": 0.02, "right": -0.01})


def test_every_nominal_value_may_be_wrong(tmp_path):
    data = reading.read(hidden(tmp_path / "set", {}))
    known = with_default_sds(data).nominal
    assert all(known[name].sd > 0.02 * abs(known[name].value) for name in NOMINAL)
    assert data.nominal["mass"].sd is None


def test_a_run_starts_from_an_average_of_its_first_samples(tmp_path):
    data = reading.read(hidden(tmp_path / "set", {}))
    ready = with_averaged_starts(data, {run.name: dataset.motor_inputs(run, data) for run in data.runs})
    single = [run.outputs["wheel_speed_left"][0] for run in data.runs]
    together = [run.outputs["wheel_speed_left"][0] for run in ready.runs]
    assert np.std(together) < 0.6 * np.std(single)


def test_a_motor_is_compared_by_its_velocity(tmp_path):
    manoeuvres = {"step": (3.0, 0.0), "back": (-4.0, 0.0)}
    folder = write(
        tmp_path / "set",
        motor(wheel_inertia=1e-3),
        {"angle": 1e-3},
        "wheel_inertia = 1e-3",
        manoeuvres=manoeuvres,
        roles=["fit", "held_out"],
    )
    run = with_rates(reading.read(folder)).runs[0]
    assert np.isfinite(run.outputs["angle"]).sum() == 1
    assert np.isfinite(run.outputs["speed"]).all()


def test_a_window_starts_from_the_measured_state(tmp_path):
    data = reading.read(hidden(tmp_path / "set", {}))
    cut = cut_into_windows(data, {run.name: dataset.motor_inputs(run, data) for run in data.runs}, 0.5)
    ahead = [run for run in cut.runs if run.name.startswith("ahead, window")]
    assert len(ahead) == 4
    travelled = data.runs[0].outputs["wheel_speed_left"][: len(data.runs[0].time) // 2].sum() * 0.01
    assert ahead[2].outputs["wheel_angle_left"][0] == pytest.approx(travelled, rel=0.05)


def test_the_order_of_a_periodic_effect_is_read_off_the_wheel_speeds(tmp_path):
    ripple = {"cogging": {"torque": 0.01, "order": 7.0, "phase": 0.3, "phase_difference": 0.5}}
    long = {name: (left / 2, right / 2) for name, (left, right) in MANOEUVRES.items()}
    data = reading.read(hidden(tmp_path / "set", ripple, manoeuvres=long))
    assert any(abs(order - 7.0) < 0.1 for order in periods.orders(data))
    assert periods.orders(reading.read(hidden(tmp_path / "clean", {}))) == ()


def test_the_difference_step_of_an_order_turns_its_phase_only_a_little(tmp_path):
    """A hundredth more of the order is another phase at the end of a run, so such a step gives no derivative."""
    plan = errors_of(hidden(tmp_path / "set", {}))[2]
    ripple = next(one for one in library_parts(plan.model) if one.effect == "torque_ripple" and len(one.free) == 4)
    plan = ripple.starting(plan, {"amplitude": 0.3, "order": 8.0, "phase": 1.0, "phase_difference": 0.4})
    error, point = errors_of(tmp_path / "set")[1], plan.start()
    index = [one.name for one in plan.free].index("torque_ripple.order")
    slope = Problem(error, plan).sensitivity(point)[:, index]
    moved = point + 2e-4 * np.eye(len(point))[index]
    change = error.predict([plan.at(moved)])[0] - error.predict([plan.at(point)])[0]
    assert np.linalg.norm(change - 2e-4 * slope) < 0.1 * np.linalg.norm(change)


@pytest.mark.parametrize("effect", [{"cogging": {"torque": 0.02}}, {"torque_ripple": {"amplitude": 0.4}}])
def test_a_periodic_effect_with_a_phase_for_each_wheel_is_named(tmp_path, effect):
    (name, size), shape = *effect.items(), {"order": 6.3, "phase": 1.0, "phase_difference": 2.0}
    found = pipeline.discover(reading.read(hidden(tmp_path / "set", {name: size | shape})))
    assert found.verdict in ("named", "ambiguous")
    periodic = next(one for one in found.effects if one.name == name)
    assert periodic.confidence > 0.9
    values = {key: one.value for key, one in periodic.parameters.items()}
    assert values["order"] == pytest.approx(6.3, rel=2e-3)
    assert values["phase"] == pytest.approx(1.0, abs=0.1)
    assert values["phase_difference"] == pytest.approx(2.0, abs=0.2)


def test_chosen_runs_are_simulated_as_they_are_among_all_runs(tmp_path):
    """The motors of a chosen run contain the heat that earlier runs left, although these runs are not chosen."""
    folder = hidden(tmp_path / "set", {})
    replay, plan = Replay(reading.read(folder)), errors_of(folder)[2]
    hot = dataclasses.replace(plan.model, effects={"motor_heating": {}})
    wanted = [replay.dataset.runs[1].name, replay.dataset.runs[4].name]
    whole, some = replay.simulate([plan.model, hot]), replay.simulate([plan.model, hot], only=wanted)
    for one, other in zip(whole, some, strict=True):
        assert set(wanted) <= other.keys() < one.keys()
        assert all(np.array_equal(one[run]["yaw_rate"], other[run]["yaw_rate"]) for run in wanted)
    assert some[0].keys() == set(wanted)


def test_the_parts_of_the_library_are_all_effects_that_the_model_lacks():
    base = dataclasses.replace(robot(), effects={"gyro_bias": {"bias": 0.1}})
    names = {one.effect for one in library_parts(base)}
    assert names == {one.name for one in catalogue.effects() if one.is_searched} - {"gyro_bias", "viscous_loss"}


def test_an_effect_that_repeats_a_nominal_value_is_missing_where_that_is_zero():
    dry = dataclasses.replace(robot(), parameters={**robot().parameters, "viscous_friction": 0.0})
    assert "viscous_loss" in {one.effect for one in library_parts(dry)}
    assert "viscous_loss" not in {one.effect for one in library_parts(robot())}


@pytest.mark.parametrize(
    ("measured", "absent", "present"),
    [
        ({"wheel_speed_left", "wheel_speed_right"}, {"gyro", "imu", "accel"}, {"encoder"}),
        ({"yaw_angle"}, {"accel", "encoder"}, {"gyro", "imu"}),
        ({"accel_surge"}, {"gyro", "encoder"}, {"accel", "imu"}),
    ],
)
def test_an_effect_on_a_sensor_that_was_not_measured_is_no_part(measured, absent, present):
    kinds = {one.name.split("_")[0] for one in catalogue.effects() if one.acts_on == "sensor"}
    assert absent | present < kinds
    found = {one.effect for one in library_parts(robot(), measured)}
    assert not any(name.startswith(tuple(absent - {"imu"})) for name in found)
    assert all(any(name.startswith(kind) for name in found) for kind in present)
    assert ("imu_lag" in found) == ("imu" in present)
    assert {one.effect for one in library_parts(robot())} - found <= {
        one.name for one in catalogue.effects() if one.acts_on == "sensor"
    }


@pytest.mark.parametrize(
    ("measured", "parts"),
    [
        ({"wheel_speed_left", "wheel_speed_right"}, {"sensor_delay"}),
        ({"yaw_rate"}, {"sensor_delay"}),
        ({"yaw_rate", "wheel_speed_left"}, {"sensor_delay", "speed_delay", "gyro_delay"}),
        ({"yaw_rate", "accel_surge"}, {"sensor_delay", "gyro_delay"}),
    ],
)
def test_effects_that_change_the_measured_signals_alike_are_one_part(measured, parts):
    """If only wheels are measured, a delay of the wheel sensors equals a delay of all sensors.

    Then only one of these delays is a part, and none of them is a part if the model has one.
    """
    delays = {"sensor_delay", "speed_delay", "gyro_delay"}
    assert {one.effect for one in library_parts(robot(), measured)} & delays == parts
    late = dataclasses.replace(robot(), effects={"sensor_delay": {"delay": 0.03}})
    assert {one.effect for one in library_parts(late, measured)} & delays == parts - {"sensor_delay"}


def test_a_position_is_delayed_by_its_sensor():
    axis = motor(mass=95.0, viscous_friction=200.0, force_per_volt=35.0)
    for measured in ({"position"}, {"velocity"}, {"angle"}):
        found = {one.effect for one in library_parts(axis, measured)}
        assert "sensor_delay" in found
        assert not any(name.startswith("gyro") for name in found)


def test_optional_parameters_are_freed_one_at_a_time():
    free = [one.free for one in library_parts(robot()) if one.effect == "direction_asymmetry"]
    assert ("torque",) in free
    assert ("drag",) in free
    assert ("gain",) in free
    assert max(map(len, free)) == 1
    assert len(catalogue.effect("direction_asymmetry").parameters) == 3


def test_a_parameter_that_may_not_be_zero_is_no_size():
    """No model sets such a parameter to zero: the plant refuses heating without a time constant."""
    heating = next(
        one for one in library_parts(dataclasses.replace(robot(), effects={})) if one.effect == "motor_heating"
    )
    assert heating.free == ("thermal_resistance", "time_constant")


def test_nothing_is_named_where_nothing_is_hidden(nothing):
    assert nothing.verdict == "none"
    assert nothing.effects == ()
    assert nothing.gap["held_out"].after == pytest.approx(1.0, abs=0.1)


def test_friction_is_named_with_its_size(friction):
    assert friction.verdict == "named"
    assert [effect.name for effect in friction.effects] == ["coulomb_friction"]
    torque = friction.effects[0].parameters["torque"]
    assert torque.value == pytest.approx(0.005, rel=0.08)
    assert torque.ci95[0] < 0.005 < torque.ci95[1]
    assert friction.effects[0].confidence > 0.95


def test_the_gap_closes_on_runs_that_were_not_fitted(friction):
    assert set(friction.roles.values()) == {"fit"}  # each manoeuvre occurs once: the end of its drive is held out
    assert any("held out the last part of the drive in ahead" in note for note in friction.notes)
    assert friction.gap["held_out"].before > 1.5
    assert friction.gap["held_out"].after == pytest.approx(1.0, abs=0.1)
    assert all(white.white for white in friction.whiteness.values())


def test_the_ranking_says_why_the_others_lost(friction):
    assert friction.ranking[0].names == ("coulomb_friction",)
    assert friction.ranking[0].removed > 0.95
    assert all(rank.why for rank in friction.ranking)


def test_the_augmented_model_simulates_the_outputs_that_are_shown(friction):
    again = Replay(friction.dataset).simulate([friction.augmented])[0]
    for run, outputs in friction.simulated["augmented"].items():
        assert np.array_equal(outputs["yaw_rate"], again[run]["yaw_rate"])


def test_the_verdict_is_plain_json_with_the_promised_keys(friction):
    figures = check(friction)
    keys = {"verdict", "effects", "where", "gap", "nominal", "data_faults", "next_experiment", "elapsed_s", "seed"}
    assert keys | {"version"} <= figures.keys()
    effect = figures["effects"][0]
    assert {"name", "acts_on", "confidence", "parameters", "equivalents"} <= effect.keys()
    assert {"run", "signal", "from_s", "to_s", "share_of_gap", "when"} <= figures["where"][0].keys()
    assert figures["gap"]["unit"] == "residual rms / noise sd"
    assert figures["gap"]["by_signal"]["yaw_rate"]["after"] == pytest.approx(1.0, abs=0.15)


def test_the_place_of_a_gap_is_where_the_effect_acts(tmp_path):
    found = pipeline.discover(reading.read(hidden(tmp_path / "set", {"gyro_saturation": {"limit": 3.5}})))
    assert [effect.name for effect in found.effects] == ["gyro_saturation"]
    first = found.where[0]
    assert first.signal == "yaw_rate"
    assert first.run in {"right", "left"}


def test_data_of_low_noise_show_smaller_effects(tmp_path, nothing):
    quiet = {name: sd / 4 for name, sd in SIGNALS.items()}
    loud = nothing.power
    still = pipeline.discover(reading.read(hidden(tmp_path / "quiet", {}, signals=quiet))).power
    assert 0 < still["coulomb_friction"].size < loud["coulomb_friction"].size < 0.005
    assert 0 < still["gyro_bias"].size < loud["gyro_bias"].size


def test_the_next_experiment_is_the_manoeuvre_that_separates_most():
    near = {
        "coulomb_friction": dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": 0.005}}),
        "actuator_deadband": dataclasses.replace(robot(), effects={"actuator_deadband": {"voltage": 0.5}}),
    }
    noise = {"wheel_speed_left": 0.05, "yaw_rate": 0.014}
    found = next_experiment(near, noise, 9.0)
    assert found.manoeuvre in manoeuvres("diff_drive", 9.0)
    assert found.separation > 1
    assert found.signal in noise
    for points in (found.manoeuvre.voltage_left, found.manoeuvre.voltage_right):
        times = [moment for moment, _ in points]
        assert times == sorted(times)
        assert times[-1] == pytest.approx(found.manoeuvre.duration_s)
        assert all(abs(volts) <= 9.0 for _, volts in points)


def test_another_signal_is_asked_for_where_no_manoeuvre_helps():
    heavy = dataclasses.replace(robot(), effects={"gyro_scale": {"error": 0.05}})
    alike = {"gyro_scale": heavy, "nothing": robot()}
    found = next_experiment(alike, {"accel_surge": 0.025}, 9.0)
    assert found.manoeuvre is None
    assert found.signal in {"yaw_rate", "yaw_angle"}


def test_manoeuvres_end_at_rest_and_stay_within_the_supply():
    for vehicle in ("diff_drive", "motor"):
        for manoeuvre in manoeuvres(vehicle, 7.2):
            assert manoeuvre.voltage_left[-1][1] == 0
            assert max(abs(volts) for _, volts in manoeuvre.voltage_left + manoeuvre.voltage_right) <= 7.2 + 1e-12
            assert math.isfinite(manoeuvre.duration_s)


def test_a_set_of_which_all_runs_are_held_out_is_refused(tmp_path):
    folder = hidden(tmp_path / "set", {}, roles=["held_out"] * len(MANOEUVRES))
    with pytest.raises(Exception, match="every run is held out"):
        pipeline.discover(reading.read(folder))
