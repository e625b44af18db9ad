"""The yardstick: fit in percent of the nominal and the augmented model, and attainable fit, by horizon and role."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.data.holdout import repeats
from brickpilot.discover.prepare import Prepared, calibrate, prepare
from brickpilot.discover.seal import Proof
from brickpilot.discover.yardstick import HORIZONS, Yardstick, measure
from brickpilot.vehicle import plant
from brickpilot.vehicle.headline import simulated_at, track
from brickpilot.vehicle.plant import OpenLoopRun, State
from synthetic import motor, robot, write

NOISE = {"accel_surge": 0.02, "yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
MANOEUVRES = {
    f"{name}_{volts:g}": (left * volts, right * volts)
    for volts in (3.0, 4.5, 6.0)
    for name, left, right in (("ahead", 1, 1), ("back", -1, -1), ("spin", 1, -1), ("curve", 1, 0.4))
}
ROLES = ["fit"] * 4 + ["held_out"] * 4 + ["fit"] * 4
NOMINAL = robot()
STATED = "\n".join(f"{name} = {value}" for name, value in NOMINAL.parameters.items() if name in {
    "mass", "yaw_inertia", "wheel_radius", "half_track", "wheel_inertia", "resistance", "torque_constant",
    "emf_constant", "viscous_friction", "rolling_friction", "battery_voltage"
})  # fmt: skip
FRICTION = dataclasses.replace(NOMINAL, effects={"coulomb_friction": {"torque": 0.008}})


@dataclasses.dataclass(frozen=True)
class Ready:
    """A prepared data set, and a proof with the held-out runs."""

    prepared: Prepared
    proof: Proof

    def record(self, augmented, nominal=NOMINAL) -> Yardstick:
        return measure(self.prepared, self.proof, nominal, augmented)


def ready_of(folder, truth, noise=NOISE, *, nominal=STATED, **options) -> Ready:
    options = {"manoeuvres": MANOEUVRES, "roles": ROLES} | options
    data = reading.read(write(folder, truth, noise, nominal, **options))
    prepared, sealed = prepare(data, None, seed=0, jobs=2)
    return Ready(prepared, Proof(sealed.open(), None, {}, {}, {}))


@pytest.fixture(scope="module")
def friction(tmp_path_factory):
    return ready_of(tmp_path_factory.mktemp("yardstick") / "friction", FRICTION)


@pytest.fixture(scope="module")
def unnamed(friction):
    """Returns the yardstick of the nominal model, which lacks dry friction, with nothing added."""
    return friction.record(NOMINAL)


@pytest.fixture(scope="module")
def named(friction):
    return friction.record(FRICTION)


def test_a_free_run_is_scored_by_its_rms_error_over_the_rms_of_the_signal(friction, unnamed):
    fit, whole = unnamed.signals["yaw_rate"]["free_run"], friction.proof.opened.whole
    for role, scored in (("fit", fit.fit), ("held_out", fit.held_out)):
        runs = [run for run in whole.runs if friction.prepared.roles.by_run[run.name] == role]
        free = [
            plant.simulate([(NOMINAL, OpenLoopRun(time=run.time, inputs=whole.motor_inputs(run)))])[0] for run in runs
        ]
        measured = np.concatenate([run.outputs["yaw_rate"] for run in runs])
        simulated = np.concatenate([one.outputs["yaw_rate"] for one in free])
        rms = float(np.sqrt(np.mean((measured - simulated) ** 2)))
        # The yardstick starts each run from its first readings. `free` starts at rest, so both differ a little.
        size, spread = float(np.sqrt(np.mean(measured**2))), float(np.std(measured))
        assert scored.before == pytest.approx(100 * (1 - rms / size), abs=0.3)
        assert scored.numbers_before.r2 == pytest.approx(1 - (rms / spread) ** 2, abs=0.002)
        assert scored.numbers_before.rms_error == pytest.approx(rms, rel=0.03)


def test_the_model_that_holds_the_missing_effect_reaches_the_noise(named):
    record = named
    for signal in ("wheel_speed_left", "wheel_speed_right", "yaw_rate"):
        assert set(record.signals[signal]) == {"free_run", "1_s", "0.2_s"}
        for one in record.signals[signal].values():
            for fit in (one.fit, one.held_out):
                assert fit.before < 97 < 98.5 < fit.after <= fit.attainable <= 100
    for one in record.predictable.values():
        assert one.removed > 0.97
        assert one.removed_held_out > 0.97


def test_a_black_box_finds_that_friction_is_missing_on_runs_it_has_not_seen(unnamed):
    for signal in ("wheel_speed_left", "wheel_speed_right"):
        one = unnamed.signals[signal]["free_run"]
        assert one.fit.after == one.fit.before < one.fit.attainable
        assert 100 - one.held_out.attainable < 0.6 * (100 - one.held_out.before)
    free = unnamed.predictable["free_run"]
    assert free.share > 0.7
    assert free.held_out > 0.7
    assert free.removed == free.removed_held_out == 0


def test_a_model_that_makes_the_error_larger_removes_less_than_nothing(friction):
    wrong = dataclasses.replace(NOMINAL, effects={"gyro_bias": {"bias": 0.5}})
    record = friction.record(wrong)
    assert record.predictable["free_run"].removed < 0
    assert record.signals["yaw_rate"]["free_run"].fit.after < record.signals["yaw_rate"]["free_run"].fit.before


def test_nothing_is_predictable_where_nothing_is_missing(tmp_path):
    record = ready_of(tmp_path / "none", NOMINAL).record(NOMINAL)
    for signals in record.signals.values():
        one = signals["free_run"]
        assert one.fit.attainable - one.fit.before < 0.1
        assert one.held_out.attainable - one.held_out.before < 0.1
    free = record.predictable["free_run"]
    assert free.share < 0.02
    assert free.held_out < 0.02


def test_the_record_does_not_depend_on_the_number_of_threads(friction, named):
    alone = Ready(dataclasses.replace(friction.prepared, jobs=1), friction.proof).record(FRICTION)
    assert json.dumps([alone.fit_json(), alone.predictable_json()]) == json.dumps(
        [named.fit_json(), named.predictable_json()]
    )


def test_held_out_runs_teach_nothing(friction, unnamed):
    """With other values in the held-out runs, the fit of the fit runs changes by at most 0.02 percentage points."""

    def doubled(data):
        held_out = {name for name, role in friction.prepared.roles.by_run.items() if role == "held_out"}
        runs = [
            dataclasses.replace(run, outputs={name: 2 * values for name, values in run.outputs.items()})
            if run.name in held_out
            else run
            for run in data.runs
        ]
        return dataclasses.replace(data, runs=tuple(runs))

    opened = friction.proof.opened
    plain = dataclasses.replace(
        opened.plain, measured=doubled(opened.plain.measured), started=doubled(opened.plain.started)
    )
    other = dataclasses.replace(opened, whole=doubled(opened.whole), plain=plain)
    again = Ready(friction.prepared, dataclasses.replace(friction.proof, opened=other)).record(NOMINAL)
    for signal, one in again.signals.items():
        before = unnamed.signals[signal]["free_run"]
        for name in ("before", "after", "attainable"):
            assert getattr(one["free_run"].fit, name) == pytest.approx(getattr(before.fit, name), abs=0.02)
        assert one["free_run"].held_out != before.held_out


def test_a_window_keeps_the_commands_that_are_on_their_way(tmp_path):
    late = dataclasses.replace(NOMINAL, effects={"input_delay": {"delay": 0.08}})
    record = ready_of(tmp_path / "late", late, dict.fromkeys(NOISE, 0.0) | {"wheel_travel_left": 0.0}).record(late)
    for signal in ("wheel_speed_left", "wheel_travel_left"):
        one = record.signals[signal]["0.2_s"].fit
        assert one.before < 97
        assert one.after > 99


def test_a_window_starts_from_what_was_measured(tmp_path):
    noiseless = dict.fromkeys(NOISE, 0.0) | {"yaw_angle": 0.0}
    plain = ready_of(tmp_path / "set", FRICTION, noiseless).proof.opened.plain
    compared = track(plain, NOMINAL, HORIZONS)
    (simulated,) = simulated_at(compared, [NOMINAL], threads=1)
    for course in compared.courses[1:]:
        for signal in ("wheel_speed_left", "yaw_angle"):
            errors = {"free_run": 0.0, course.horizon: 0.0}
            for run in compared.dataset.runs:
                after_start = [mark.sample + 1 for mark in course.marks[run.name]]
                assert after_start
                for horizon in errors:
                    outputs = simulated[horizon][run.name][signal]
                    errors[horizon] += float(np.abs(run.outputs[signal] - outputs)[after_start].sum())
            assert errors[course.horizon] < 0.2 * errors["free_run"]


def test_without_wheels_windows_start_from_the_yaw_rate_and_a_note_says_so(tmp_path):
    record = ready_of(tmp_path / "imu", FRICTION, {"accel_surge": 0.02, "yaw_rate": 0.014}).record(FRICTION)
    assert set(record.signals["yaw_rate"]) == {"free_run", "1_s", "0.2_s"}
    assert any("No wheel was measured" in note for note in record.notes)


def test_without_any_speed_there_are_no_windows_and_a_note_says_so(tmp_path):
    record = ready_of(tmp_path / "accel", FRICTION, {"accel_surge": 0.02}).record(FRICTION)
    assert set(record.signals["accel_surge"]) == {"free_run"}
    assert any("no speed was measured" in note for note in record.notes)


def test_a_signal_that_does_not_move_has_no_fit(tmp_path):
    straight = {name: one for name, one in MANOEUVRES.items() if name.startswith(("ahead", "back"))}
    roles = ["fit"] * 4 + ["held_out"] * 2
    record = ready_of(tmp_path / "straight", FRICTION, manoeuvres=straight, roles=roles).record(FRICTION)
    one = record.signals["yaw_rate"]["free_run"]
    assert (one.fit.before, one.fit.after, one.fit.attainable) == (None, None, None)
    json.dumps([record.fit_json(), record.predictable_json()], allow_nan=False)


def test_one_run_alone_is_predicted_from_its_own_stretches(tmp_path):
    ready = ready_of(tmp_path / "one", FRICTION, manoeuvres={"curve": (6.0, 3.0)}, roles=["fit"])
    alone = dataclasses.replace(ready.prepared, roles=dataclasses.replace(ready.prepared.roles, stretches={}))
    record = Ready(alone, ready.proof).record(FRICTION)
    one = record.signals["wheel_speed_left"]["free_run"]
    assert one.held_out.attainable is not None or one.held_out.before is None
    assert one.fit.before < one.fit.attainable <= 100
    assert one.fit.after > 98


def test_two_repeats_tell_what_no_model_can_know(tmp_path):
    """The speeds of two repeats differ by 4 %: each has a random error with an rms of 4 % / sqrt(2), which no model can
    predict."""
    truth = motor(battery_voltage=9.0)
    volts = {"low": (3.0, 0.0), "high": (6.0, 0.0), "high_again": (6.0, 0.0)}

    def drift(name, table):
        if name == "high_again":
            table["speed"] = 1.04 * table["speed"]

    ready = ready_of(
        tmp_path / "repeats", truth, {"speed": 0.0}, manoeuvres=volts, roles=["fit", "fit", "held_out"], spoil=drift,
        nominal="",
    )  # fmt: skip
    record = ready.record(truth, calibrate(ready.prepared)[1].model)
    measured = ready.proof.opened.plain.measured
    assert [pair[:2] for pair in repeats(measured)] == [("high", "high_again")]
    expected = 100 * (1 - 0.04 / 2**0.5)  # in percent of the repeated runs' speed
    assert record.signals["speed"]["free_run"].repeatability == pytest.approx(expected, abs=0.1)


def test_samples_that_are_far_apart_leave_out_the_short_horizons(tmp_path):
    def thin(name, table):
        for key in list(table):
            table[key] = table[key][::6]

    record = ready_of(tmp_path / "thin", FRICTION, spoil=thin).record(FRICTION)
    assert "0.2_s" not in record.signals["yaw_rate"]
    assert any("0.2 s" in note for note in record.notes)


def test_a_state_that_a_run_goes_on_from_is_refused_if_it_is_infinite():
    from brickpilot.errors import SimulationError

    nan = float("nan")
    given = State(nan, nan, nan, np.inf, nan, nan, (nan, nan), (nan, nan), (nan, nan), nan, nan, (nan, nan), nan)
    run, names = OpenLoopRun(time=np.arange(5) * 0.01, inputs=np.zeros((5, 2))), plant.wanted_names(None)
    restarts = np.array([(2, dataclasses.astuple(given))], dtype=plant.layout("bp_restart"))
    requests = np.frombuffer(bytearray(run.as_c(2)), plant.layout("bp_run"))
    requests["restart"], requests["restart_count"] = restarts.ctypes.data, 1
    with pytest.raises(SimulationError):
        plant.simulate_into(np.empty(5 * len(names)), [0], [NOMINAL], requests, names)
