"""The C plant agrees with independent ODEs and converges; the Python that calls it refuses bad models and runs."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
import reference_ode
from brickpilot import catalogue
from brickpilot.errors import InputError, SimulationError
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model, rcx
from brickpilot.vehicle.plant import OpenLoopRun, State, simulate

ODES = {"coupled": reference_ode.coupled, "paper": reference_ode.paper}


def another_robot(profile: str) -> Model:
    """Returns a robot whose values all differ from the packaged robot's: a constant typed into the plant shows."""
    scales = np.random.default_rng(7).uniform(0.7, 1.4, len(rcx().parameters))
    values = {name: value * scale for (name, value), scale in zip(rcx().parameters.items(), scales, strict=True)}
    return Model("another", "diff_drive", profile, values)


def manoeuvre(step: float = 0.003) -> tuple[np.ndarray, np.ndarray]:
    """Returns time (n,), s, and voltages (n, 2), V, with 0.5 s for each piece.

    The pieces: forward, curve, one wheel braked, spin, one wheel floating, both floating, backward.
    """
    pieces = [(6, 6), (7, 3), (7, 0), (-5, 5), (6, math.nan), (math.nan, math.nan), (-8, -4)]
    time = np.arange(0, 0.5 * len(pieces) + step / 2, step)
    inputs = np.array([pieces[min(int((t + step / 2) / 0.5), len(pieces) - 1)] for t in time], dtype=float)
    return time, inputs


# With steps of 3 ms, the body step causes the error: in `paper` the velocity turns at 15 rad/s in the body's axes.
@pytest.mark.parametrize(("profile", "share"), [("coupled", 1e-4), ("paper", 4e-3)])
def test_plant_agrees_with_a_stiff_ode_solver(profile: str, share: float) -> None:
    model = another_robot(profile)
    time, inputs = manoeuvre()
    got = simulate([(model, OpenLoopRun(time, inputs))])[0].outputs
    expected = reference_ode.solve(ODES[profile](model.parameters), time, inputs)
    for name, truth in expected.items():
        worst = np.max(np.abs(got[name] - truth))
        assert worst <= share * np.max(np.abs(truth)), f"{name}: {worst}"


@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_error_falls_with_the_square_of_the_body_step(profile: str) -> None:
    model = another_robot(profile)
    time, inputs = manoeuvre(0.006)
    truth = reference_ode.solve(ODES[profile](model.parameters), time, inputs)
    steps = [0.006, 0.003, 0.0015, 0.00075]
    runs = simulate([(model, OpenLoopRun(time, inputs, motor_step=step / 10, body_step=step)) for step in steps])
    errors = np.array([np.sqrt(np.mean((run.outputs["x"] - truth["x"]) ** 2)) for run in runs])
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 1.7), errors


@pytest.mark.parametrize("profile", ["coupled", "paper"])
def test_accelerations_are_the_specific_force_over_the_body_step(profile: str) -> None:
    model = another_robot(profile)
    time, inputs = manoeuvre()
    got = simulate([(model, OpenLoopRun(time, inputs))])[0].outputs
    truth = reference_ode.solve(ODES[profile](model.parameters), time, inputs)
    u, v, r = truth["surge"], truth["sway"], truth["yaw_rate"]
    mean = {name: (values[1:] + values[:-1]) / 2 for name, values in (("u", u), ("v", v), ("r", r))}
    surge = np.diff(u) / np.diff(time) - mean["v"] * mean["r"]
    sway = np.diff(v) / np.diff(time) + mean["u"] * mean["r"]
    np.testing.assert_allclose(got["accel_surge"][1:], surge, atol=2e-3 * np.max(np.abs(surge)))
    np.testing.assert_allclose(got["accel_sway"][1:], sway, atol=2e-3 * np.max(np.abs(sway)))


@pytest.mark.parametrize("effects", [{}, {"imu_lever_arm": {"x": 0.1, "y": 0.05}, "imu_lag": {"time_constant": 0.01}}])
def test_a_reading_of_an_accelerometer_is_the_mean_since_the_reading_before(
    effects: dict[str, dict[str, float]],
) -> None:
    """Five body steps lie between two samples of the second run, and one between two samples of the first."""
    model = dataclasses.replace(another_robot("coupled"), effects=effects)
    time, inputs = manoeuvre()
    inputs = np.repeat(inputs[::5], 5, axis=0)[: len(time)]
    each, fifth = (
        one.outputs
        for one in simulate([(model, OpenLoopRun(time, inputs)), (model, OpenLoopRun(time[::5], inputs[::5]))])
    )
    for name in ("accel_surge", "accel_sway"):
        samples = np.asarray(fifth[name][1:])
        means = each[name][1 : 5 * len(samples) + 1].reshape(-1, 5).mean(axis=1)
        np.testing.assert_allclose(samples, means, rtol=1e-9, atol=1e-9 * np.ptp(means))
    np.testing.assert_allclose(fifth["yaw_rate"], each["yaw_rate"][::5], rtol=1e-9, atol=1e-12)


def errors_with_motor_step(model: Model, steps: list[float], body_step: float) -> np.ndarray:
    time, inputs = manoeuvre(0.009)
    truth = reference_ode.solve(ODES[model.profile](model.parameters), time, inputs)
    runs = [(model, OpenLoopRun(time, inputs, motor_step=step, body_step=body_step)) for step in steps]
    names = ("wheel_speed_left", "wheel_speed_right", "current_left", "current_right")
    return np.array(
        [
            max(np.sqrt(np.mean((one.outputs[n] - truth[n]) ** 2)) / np.max(np.abs(truth[n])) for n in names)
            for one in simulate(runs)
        ]
    )


def test_error_falls_with_the_square_of_the_motor_step() -> None:
    model = another_robot("coupled")
    errors = errors_with_motor_step(model, [0.0009, 0.00045, 0.000225, 0.0001125], 0.0009)
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 1.7), (errors, orders)


def test_wheel_alone_converges_with_the_square_of_the_motor_step_at_the_papers_rates() -> None:
    errors = errors_with_motor_step(another_robot("paper"), [0.0009, 0.0006, 0.0003, 0.00015, 0.000075], 0.003)
    assert np.all(np.diff(errors) < 0), errors
    assert np.log2(errors[2] / errors[4]) > 2 * 1.7, errors


def test_default_rates_are_3_ms_and_0_3_ms() -> None:
    time, inputs = manoeuvre(0.009)
    default, stated = simulate(
        [(rcx(), OpenLoopRun(time, inputs)), (rcx(), OpenLoopRun(time, inputs, motor_step=0.0003, body_step=0.003))]
    )
    assert all(np.array_equal(default.outputs[name], stated.outputs[name]) for name in default.outputs)


def test_irregular_samples_give_the_same_motion() -> None:
    fine, inputs = manoeuvre(0.001)
    kept = np.sort(np.random.default_rng(3).choice(np.arange(1, 500), 120, replace=False))
    kept = np.concatenate([[0], kept, np.arange(500, len(fine))])
    whole, some = simulate([(rcx(), OpenLoopRun(fine, inputs)), (rcx(), OpenLoopRun(fine[kept], inputs[kept]))])
    for name in ("surge", "yaw_rate", "x", "y"):
        np.testing.assert_allclose(some.outputs[name], whole.outputs[name][kept], atol=5e-5)


def test_no_inductance_is_the_limit_of_a_small_one() -> None:
    time, inputs = manoeuvre(0.009)
    models = [dataclasses.replace(rcx(), parameters={**rcx().parameters, "inductance": L}) for L in (0.0, 1e-9)]
    none, small = simulate([(model, OpenLoopRun(time, inputs)) for model in models])
    for name in ("current_left", "wheel_speed_left", "yaw_rate"):
        np.testing.assert_allclose(none.outputs[name], small.outputs[name], rtol=1e-5, atol=1e-6)


def test_stiff_parameters_do_not_blow_up() -> None:
    time, inputs = manoeuvre(0.009)
    wild = {
        "resistance": 0.01,
        "inductance": 1e-7,
        "wheel_inertia": 1e-8,
        "mass": 0.01,
        "yaw_inertia": 1e-6,
        "drag_area": 50.0,
    }
    model = dataclasses.replace(rcx(), parameters={**rcx().parameters, **wild})
    result = simulate([(model, OpenLoopRun(time, inputs))])[0]
    top = 2 * np.nanmax(np.abs(inputs)) / model.parameters["emf_constant"]
    assert np.max(np.abs(result.outputs["wheel_speed_left"])) < top


def test_threads_do_not_change_a_byte() -> None:
    time, inputs = manoeuvre()
    models = [another_robot("coupled"), another_robot("paper"), rcx()]
    jobs = [(models[k % 3], OpenLoopRun(time, inputs * (0.5 + 0.05 * k))) for k in range(12)]
    one, many = simulate(jobs, threads=1), simulate(jobs, threads=4)
    for a, b in zip(one, many, strict=True):
        assert a.final == b.final
        assert all(a.outputs[name].tobytes() == b.outputs[name].tobytes() for name in a.outputs)


def test_a_copy_of_a_run_that_was_simulated_reads_its_own_arrays() -> None:
    run = OpenLoopRun(np.arange(0.0, 2.0, 0.01), np.full((200, 2), 5.0))
    (first,) = simulate([(rcx(), run)])
    for make in (copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))):
        other = make(run)
        other.inputs[:] = 0.0
        (still,) = simulate([(rcx(), other)])
        assert not still.outputs["surge"].any()
        (again,) = simulate([(rcx(), run)])
        assert np.array_equal(first.columns, again.columns, equal_nan=True)


def test_two_halves_make_the_whole_run() -> None:
    time, inputs = manoeuvre()
    whole = simulate([(rcx(), OpenLoopRun(time, inputs))])[0]
    half = len(time) // 2
    first = simulate([(rcx(), OpenLoopRun(time[: half + 1], inputs[: half + 1]))])[0]
    second = simulate([(rcx(), OpenLoopRun(time[half:], inputs[half:], initial=first.final))])[0]
    assert second.final.x == pytest.approx(whole.final.x, abs=1e-6)
    assert second.final.charge == pytest.approx(whole.final.charge, rel=1e-5)
    assert second.final.age == pytest.approx(time[-1])


def test_a_run_of_one_sample_is_its_initial_state() -> None:
    start = State(x=1.0, heading=0.3, surge=0.5, yaw_rate=1.0)
    result = simulate([(rcx(), OpenLoopRun(np.array([0.0]), np.zeros((1, 2)), initial=start))])[0]
    assert result.outputs["surge"][0] == pytest.approx(0.5)
    assert result.outputs["accel_sway"][0] == pytest.approx(0.5)
    assert result.final.wheel_speed[0] == pytest.approx((0.5 + 0.07) / 0.0408)


def motor(**values: float) -> Model:
    return Model("axis", "motor", "coupled", {**catalogue.presets("motor"), **values})


def test_motor_with_a_load_rises_with_its_mechanical_time_constant() -> None:
    values = {"mass": 0.5, "wheel_radius": 0.03, "inductance": 0.0, "viscous_friction": 2e-3}
    model = motor(**values)
    p = model.parameters
    time = np.linspace(0, 2, 401)
    result = simulate([(model, OpenLoopRun(time, np.full((401, 1), 6.0)))])[0].outputs
    inertia = p["wheel_inertia"] + 0.5 * 0.03**2
    loss = p["viscous_friction"] + p["torque_constant"] * p["emf_constant"] / p["resistance"]
    speed = 6.0 * p["torque_constant"] / p["resistance"] / loss * (1 - np.exp(-loss / inertia * time))
    np.testing.assert_allclose(result["speed"], speed, atol=1e-6 * speed[-1])
    np.testing.assert_allclose(result["velocity"], 0.03 * result["speed"])
    np.testing.assert_allclose(result["position"], 0.03 * result["angle"])
    np.testing.assert_allclose(result["force"], p["torque_constant"] * result["current"] / 0.03)


def test_force_command_drives_a_mass() -> None:
    model = motor(force_per_volt=35.0, mass=95.0, viscous_friction=200.0)
    time = np.linspace(0, 3, 301)
    result = simulate([(model, OpenLoopRun(time, np.full((301, 1), 2.0)))])[0].outputs
    velocity = 70.0 / 200.0 * (1 - np.exp(-200.0 / 95.0 * time))
    np.testing.assert_allclose(result["velocity"], velocity, atol=1e-7)
    assert result["force"][-1] == pytest.approx(70.0)
    assert "speed" not in result
    assert "current" not in result


def test_torque_command_drives_an_inertia() -> None:
    model = motor(torque_per_volt=0.5, wheel_inertia=0.02, viscous_friction=0.0)
    time = np.linspace(0, 1, 101)
    result = simulate([(model, OpenLoopRun(time, np.full((101, 1), 2.0)))])[0].outputs
    np.testing.assert_allclose(result["speed"], 50.0 * time, atol=1e-9)
    assert "position" not in result


def test_a_motor_without_inertia_is_refused() -> None:
    with pytest.raises(SimulationError, match="inertia"):
        simulate([(motor(wheel_inertia=0.0), OpenLoopRun(np.array([0.0, 1.0]), np.zeros((2, 1))))])


def test_time_that_does_not_increase_is_refused() -> None:
    good = OpenLoopRun(np.array([0.0, 1.0]), np.zeros((2, 2)))
    bad = OpenLoopRun(np.array([0.0, 1.0, 1.0]), np.zeros((3, 2)))
    with pytest.raises(SimulationError, match="run 1: the time"):
        simulate([(rcx(), good), (rcx(), bad)])


def test_a_diverging_run_is_an_error() -> None:
    run = OpenLoopRun(np.array([0.0, 1.0]), np.full((2, 2), 1e308))
    with pytest.raises(SimulationError, match="the state diverged") as caught:
        simulate([(rcx(), run)])
    assert caught.value.job == 0


@pytest.mark.parametrize(
    ("model", "place"),
    [
        (Model("m", "diff_drive", "coupled", {"mas": 1.0}), "m: mas:"),
        (Model("m", "diff_drive", "coupled", {"mass": -1.0}), "m: mass:"),
        (Model("m", "diff_drive", "coupled", {"mass": math.nan}), "m: mass:"),
        (Model("m", "diff_drive", "coupled", {"mass": 0.0}), "m: mass:"),
        (Model("m", "diff_drive", "coupled", {}, {"glue": {}}), "m: effects.glue:"),
        (
            Model("m", "diff_drive", "coupled", {}, {"coulomb_friction": {"torqe": 1.0}}),
            "effects.coulomb_friction.torqe:",
        ),
        (Model("m", "diff_drive", "coupled", {}, {"coulomb_friction": {"torque": -1.0}}), "effects.coulomb_friction:"),
    ],
)
def test_a_bad_model_is_refused_with_its_place(model: Model, place: str) -> None:
    with pytest.raises(InputError, match=place):
        plant.build(model)


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        simulate([(rcx(), OpenLoopRun(np.array([0.0, 1.0, 2.0]), np.zeros((3, 1))))])


def test_tables_are_complete() -> None:
    for effect in catalogue.effects():
        assert effect.acts_on in {"supply", "drive", "motor", "gear", "wheel", "body", "sensor", "timing"}
        assert effect.equation
        assert effect.source
        assert all(info.minimum <= info.preset <= info.maximum and info.unit for info in effect.parameters)
    assert catalogue.outputs()["accel_surge"] == "m/s^2"


def test_the_attributes_of_an_effect_s_row_reach_python() -> None:
    backlash = catalogue.effect("gear_backlash")
    gap, share = backlash.parameters
    assert (backlash.mechanism, backlash.acts_on, backlash.motor_step) == ("gear", "gear", 0.001)
    assert (gap.role, gap.linear_unit, share.role, share.linear_unit) == ("size", "m", "shape", "1")
    assert (len(gap.scan), share.scan) == (16, ())
    assert (gap.scan[0], gap.scan[-1]) == pytest.approx((0.01, 0.5))
    assert [one.role for one in catalogue.effect("pwm_coast").parameters] == ["size", "switch"]
    assert [one.limits for one in catalogue.effect("gyro_saturation").parameters] == ["yaw_rate"]
    assert [one.only_with for one in catalogue.effect("stiction_stribeck").parameters] == ["", "coulomb", ""]
    assert [one.name for one in catalogue.effects() if one.carries_over] == ["battery_discharge", "motor_heating"]
    assert [one.name for one in catalogue.effects() if one.composed] == ["composed_term"]
    assert catalogue.loads() == {"payload_mass.mass"}
    with pytest.raises(KeyError, match="no_such_effect"):
        catalogue.effect("no_such_effect")


def test_the_longest_step_of_friction_by_load_resolves_it() -> None:
    """The friction depends on the previous step's current: with steps of 10 ms, wheel speeds are wrong by 0.2 %."""
    info = catalogue.effect("load_friction")
    assert info.motor_step > 0
    model = dataclasses.replace(rcx(), effects={info.name: {one.name: one.preset for one in info.parameters}})
    time, inputs = manoeuvre(0.01)
    runs = [(model, OpenLoopRun(time, inputs, motor_step=step, body_step=0.01)) for step in (info.motor_step, 0.0003)]
    longest, fine = (one.outputs["wheel_speed_left"] for one in simulate(runs))
    assert np.sqrt(np.mean((longest - fine) ** 2)) < 1e-3 * np.abs(fine).max()


def test_nominal_parameters_say_which_are_never_fitted_and_which_may_be_absent() -> None:
    fixed = {"air_density", "gravity", "stall_torque", "no_load_speed", "force_per_volt", "torque_per_volt"}
    assert {one.name for one in catalogue.parameters() if one.role == "fixed"} == fixed
    assert {one.name for one in catalogue.parameters() if one.zero_if_unstated} == {"drag_area", "inductance"}


def test_what_can_be_undone_is_added_up_by_the_plant() -> None:
    friction = {"coulomb_friction": {"torque": 0.004}, "stiction_stribeck": {"coulomb": 0.003}}
    found = plant.undoable(dataclasses.replace(rcx(), effects={**friction, "gyro_scale": {"error": -0.1}}))
    assert found.dry_torque == pytest.approx((0.007, 0.007))
    assert (found.gyro_gain, found.flux, found.load, found.lost_voltage) == (0.9, (1.0, 1.0), (0.0, 0.0), 0.0)
