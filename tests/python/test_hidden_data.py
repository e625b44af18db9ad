"""The data of the blind test: physics equals closed forms, effects are visible, files are complete and repeatable."""

from __future__ import annotations

import ast
import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

from hidden import effects, folder, manoeuvre, measure, suites  # noqa: E402
from hidden.recipe import BENCH, GRAVITY, HEAVY, RCX, Recipe, Vehicle  # noqa: E402

pytest.importorskip("mujoco")
from hidden import mujoco_engine  # noqa: E402

VEHICLES = {"bench": BENCH, "rcx": RCX, "heavy": HEAVY}
LATE = {"battery_discharge", "gyro_drift"}  # effects that grow over minutes: only the long list of runs shows them


def drive(vehicle: Vehicle, *stages: tuple[float, float, float], seconds: float = 4.0, **hidden: dict[str, float]):
    return mujoco_engine.simulate(vehicle, hidden, [manoeuvre.steps("run", seconds, *stages)], seed=0)[0]


def speed_at(vehicle: Vehicle, volts: float, load: float = 0.0) -> float:
    """Returns the wheel speed, rad/s, at which the motor's torque equals losses plus `load`, N m."""
    stiffness = vehicle.torque_constant / vehicle.resistance
    return (stiffness * volts - load) / (stiffness * vehicle.emf_constant + vehicle.wheel_damping())


def lag_of(vehicle: Vehicle, inertia: float) -> float:
    """Returns the time constant, s, of a wheel with `inertia`, kg m^2. The motor's much shorter L / R is neglected."""
    return inertia / (vehicle.torque_constant * vehicle.emf_constant / vehicle.resistance + vehicle.wheel_damping())


def test_the_readme_counts_the_sets_of_each_suite() -> None:
    rows = re.findall(
        r"^\| (`\w+`(?:, `\w+`)*) \| ([\d, ]+) \|", (TESTS / "hidden/README.md").read_text(), re.MULTILINE
    )
    told = {
        name.strip(" `"): int(count)
        for names, counts in rows
        for name, count in zip(names.split(","), counts.split(","), strict=True)
    }
    assert told == {name: len(recipes()) for name, recipes in suites.SUITES.items()}


@pytest.mark.parametrize("name", VEHICLES)
def test_steady_speed_and_spin_rate_are_those_of_the_motors(name: str) -> None:
    vehicle = VEHICLES[name]
    straight, spin = drive(vehicle, (0, 6, 6), seconds=8.0), drive(vehicle, (0, 3, -3), seconds=8.0)
    assert straight.wheel_speed_left[-1] == pytest.approx(speed_at(vehicle, 6), rel=1e-4)
    assert straight.surge[-1] == pytest.approx(vehicle.wheel_radius * speed_at(vehicle, 6), rel=1e-4)
    turning = vehicle.wheel_radius * speed_at(vehicle, 3) / vehicle.half_track
    assert spin.yaw_rate[-1] == pytest.approx(turning, rel=1e-4)  # the left wheel drives forward: clockwise is positive
    assert spin.surge[-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", VEHICLES)
def test_time_constants_are_those_of_mass_and_yaw_inertia(name: str) -> None:
    vehicle = VEHICLES[name]
    ahead = vehicle.wheel_inertia + 0.5 * vehicle.mass * vehicle.wheel_radius**2
    around = vehicle.wheel_inertia + 0.5 * vehicle.yaw_inertia * (vehicle.wheel_radius / vehicle.half_track) ** 2
    for volts, inertia in (((5, 5), ahead), ((3, -3), around)):
        speed = drive(vehicle, (0, *volts)).wheel_speed_left
        late = np.flatnonzero(speed > (1 - math.exp(-1)) * speed[-1])[0] * 0.001
        electric = vehicle.inductance / vehicle.resistance
        assert late == pytest.approx(lag_of(vehicle, inertia) + electric, rel=0.01, abs=0.001)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_null_does_not_slip(name: str) -> None:
    """Without a hidden effect, the wheels slip by less than 1/50 of the noise of wheel speeds and gyro (rms)."""
    vehicle = VEHICLES[name]
    for track in mujoco_engine.simulate(vehicle, {}, manoeuvre.short(), seed=0):
        left, right = track.wheel_speed_left, track.wheel_speed_right
        rolled = track.surge / vehicle.wheel_radius - 0.5 * (left + right)
        turned = track.yaw_rate - vehicle.wheel_radius * (left - right) / (2 * vehicle.half_track)
        assert np.sqrt(np.mean(rolled**2)) < measure.NOISE_SD["wheel_speed_left"] / 50
        assert np.sqrt(np.mean(turned**2)) < measure.NOISE_SD["yaw_rate"] / 50
        assert np.abs(track.sway).max() < 1e-4


def test_accelerometers_feel_the_turn_and_the_pull() -> None:
    track = drive(BENCH, (0, 6, 3))
    surge, rate = track.surge[-1], track.yaw_rate[-1]
    assert track.accel_sway[-1] == pytest.approx(surge * rate, rel=2e-3)
    pulled = np.gradient(track.surge, 0.001)
    assert np.sqrt(np.mean((track.accel_surge - pulled)[20:] ** 2)) < measure.NOISE_SD["accel_surge"] / 5


def test_shorted_motors_brake_with_their_time_constant() -> None:
    track = drive(BENCH, (0, 6, 6), (2.5, 0, 0), seconds=5.0)
    inertia = BENCH.wheel_inertia + 0.5 * BENCH.mass * BENCH.wheel_radius**2
    fallen = track.wheel_speed_left[3000] / track.wheel_speed_left[2510]
    assert fallen == pytest.approx(math.exp(-0.49 / lag_of(BENCH, inertia)), rel=0.01)


def test_friction_slope_payload_and_radius_have_their_closed_forms() -> None:
    rubbed = drive(BENCH, (0, 6, 6), coulomb_friction={"torque": 0.01})
    assert rubbed.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 6, 0.01), rel=1e-3)
    down = drive(BENCH, (0, 6, 6), floor_slope={"slope_x": 0.03, "slope_y": 0.0})
    pull = 0.5 * BENCH.mass * GRAVITY * 0.03 * BENCH.wheel_radius
    assert down.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 6, -pull), rel=1e-3)
    assert down.accel_surge[-1] == pytest.approx(-GRAVITY * 0.03, rel=0.01)  # the floor carries the vehicle
    loaded = drive(BENCH, (0, 6, 6), seconds=6.0, payload_mass={"mass": 0.3, "forward": 0.0, "right": 0.0})
    heavier = replace(BENCH, mass=0.9)
    assert loaded.wheel_speed_left[-1] == pytest.approx(speed_at(heavier, 6), rel=1e-4)
    uneven = drive(BENCH, (0, 6, 6), wheel_radius_mismatch={"mismatch": 0.05})
    left, right = uneven.wheel_speed_left[-1], uneven.wheel_speed_right[-1]
    arc = BENCH.wheel_radius * (1.025 * left - 0.975 * right) / (2 * BENCH.half_track)
    assert uneven.yaw_rate[-1] == pytest.approx(arc, rel=1e-3)
    assert arc > 0


def test_a_ball_that_drags_and_a_tyre_that_slips_have_their_closed_forms() -> None:
    ball = drive(BENCH, (0, 6, 6), caster_drag={"force": 0.3, "forward": -0.08})
    assert ball.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 6, 0.15 * BENCH.wheel_radius), rel=2e-3)
    slope = {"slope_x": -0.1, "slope_y": 0.0}
    slipping = drive(BENCH, (0, 6, 6), floor_slope=slope, wheel_slip={"creep": 0.05, "friction": 0.9})
    push = 0.5 * BENCH.mass * GRAVITY * 0.1  # N of each tyre, uphill
    slip = BENCH.wheel_radius * slipping.wheel_speed_left[-1] - slipping.surge[-1]
    assert slip == pytest.approx(0.05 * push, rel=0.03)
    curve = drive(BENCH, (0, 6, 3), side_slip={"creep": 0.1, "friction": 0.9})
    side = -0.1 * BENCH.mass * curve.surge[-1] * curve.yaw_rate[-1]
    assert curve.sway[-1] == pytest.approx(side, rel=0.05)


def test_a_tyre_of_one_circle_slips_alike_in_both_directions() -> None:
    grip = {"creep": 0.05, "friction": 0.9}
    slope = {"slope_x": -0.1, "slope_y": 0.0}
    uphill = drive(BENCH, (0, 6, 6), floor_slope=slope, tyre_grip=grip)
    push = 0.5 * BENCH.mass * GRAVITY * 0.1  # N of each tyre, uphill
    slip = BENCH.wheel_radius * uphill.wheel_speed_left[-1] - uphill.surge[-1]
    assert slip == pytest.approx(0.05 * push, rel=0.03)
    curve = drive(BENCH, (0, 6, 3), tyre_grip=grip)
    side = -0.05 * 0.5 * BENCH.mass * curve.surge[-1] * curve.yaw_rate[-1]
    assert curve.sway[-1] == pytest.approx(side, rel=0.05)


def test_drives_that_coast_lose_or_compress_have_their_closed_forms() -> None:
    dead = drive(BENCH, (0, 6, -6), dead_time={"voltage": 0.5})
    assert dead.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 5.5), rel=1e-3)
    bent = drive(BENCH, (0, 6, 6), voltage_compression={"compression": 0.5})
    assert bent.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 4.5), rel=1e-3)
    coasting = drive(BENCH, (0, 6, 6), (2.5, 0, 0), zero_coast={"share": 0.6}, seconds=5.0)
    inertia = BENCH.wheel_inertia + 0.5 * BENCH.mass * BENCH.wheel_radius**2
    loss = BENCH.wheel_damping() + 0.4 * BENCH.torque_constant * BENCH.emf_constant / BENCH.resistance
    fallen = coasting.wheel_speed_left[3000] / coasting.wheel_speed_left[2510]
    assert fallen == pytest.approx(math.exp(-0.49 * loss / inertia), rel=0.01)
    faded = drive(BENCH, (0, 0, 0), seconds=5.0, battery_fade={"rate": 0.1})
    assert faded.battery[-1] == pytest.approx(BENCH.battery_voltage - 0.5, abs=1e-3)


def test_losses_in_proportion_have_their_closed_forms() -> None:
    conductance = BENCH.torque_constant / BENCH.resistance
    geared = drive(BENCH, (0, 6, 6), load_friction={"share": 0.2})
    expected = 0.8 * conductance * 6 / (BENCH.wheel_damping() + 0.8 * conductance * BENCH.emf_constant)
    assert geared.wheel_speed_left[-1] == pytest.approx(expected, rel=2e-3)
    dragged = drive(BENCH, (0, 6, 6), surge_drag={"drag": 1.0})
    viscous = replace(BENCH, viscous_friction=BENCH.viscous_friction + 0.5 * BENCH.wheel_radius**2)
    assert dragged.wheel_speed_left[-1] == pytest.approx(speed_at(viscous, 6), rel=1e-3)
    oiled = drive(BENCH, (0, 6, -6), viscous_loss={"drag": 3e-4})
    viscous = replace(BENCH, viscous_friction=BENCH.viscous_friction + 3e-4)
    assert oiled.wheel_speed_left[-1] == pytest.approx(speed_at(viscous, 6), rel=1e-3)
    scrubbed = drive(BENCH, (0, 6, -6), viscous_scrub={"drag": 0.002})
    added = 0.002 * (BENCH.wheel_radius / BENCH.half_track) ** 2 / 2
    viscous = replace(BENCH, viscous_friction=BENCH.viscous_friction + added)
    assert scrubbed.wheel_speed_left[-1] == pytest.approx(speed_at(viscous, 6), rel=1e-3)


def test_backlash_carries_momentum_and_settles_on_the_same_speed() -> None:
    track = drive(BENCH, (0, 6, 6), gear_backlash={"gap": 0.2, "rotor_share": 0.6})
    assert track.wheel_speed_left[-1] == pytest.approx(speed_at(BENCH, 6), rel=1e-3)
    assert np.all(track.wheel_speed_left[:20] == pytest.approx(0.0, abs=1e-6))  # the rotor first crosses the backlash


@pytest.mark.parametrize("name", effects.TABLE)
def test_every_effect_shows_at_size_one(name: str) -> None:
    drawn = effects.draw(name, 1.0, BENCH, np.random.default_rng([5, 5]))
    runs = manoeuvre.twelve() if name in LATE else manoeuvre.short()
    seen = measure.visibility(Recipe("set", {name: drawn}, runs=runs))
    assert max(seen.values()) >= 5.0, seen


def test_nothing_that_is_misspelt_is_hidden() -> None:
    with pytest.raises(ValueError, match="coulomb"):
        drive(BENCH, (0, 6, 6), coulomb={"torque": 0.01})
    slip = {"creep": 0.1, "friction": 0.8}
    with pytest.raises(ValueError, match="one law"):
        drive(BENCH, (0, 6, 6), wheel_slip=slip, side_slip=slip)


def test_sensors_err_as_stated() -> None:
    track = drive(BENCH, (0, 6, 3))
    plain = Recipe("set", runs=(manoeuvre.steps("run", 4.0, (0, 6, 3)),))
    truth = measure.sense([track], plain)[0]

    def sensed(**hidden: dict[str, float]):
        return measure.sense([track], replace(plain, hidden=hidden))[0]

    assert sensed(gyro_bias={"bias": 0.1})["yaw_rate"] == pytest.approx(truth["yaw_rate"] + 0.1)
    assert sensed(gyro_scale={"error": 0.1})["yaw_rate"] == pytest.approx(truth["yaw_rate"] * 1.1)
    apart = sensed(gyro_asymmetry={"difference": -0.1})["yaw_rate"]
    assert apart == pytest.approx(truth["yaw_rate"] - 0.05 * np.abs(truth["yaw_rate"]))
    drifted = truth["yaw_rate"] + 0.01 * 0.003 * np.arange(len(truth["yaw_rate"]))
    assert sensed(gyro_drift={"rate": 0.01})["yaw_rate"] == pytest.approx(drifted)
    assert sensed(gyro_saturation={"limit": 1.0})["yaw_rate"].max() == 1.0
    assert sensed(encoder_scale={"error": -0.1})["wheel_speed_left"] == pytest.approx(truth["wheel_speed_left"] * 0.9)
    backward = measure.sense([replace(track, wheel_speed_left=-track.wheel_speed_left)], plain)[0]["wheel_speed_left"]
    turned = replace(plain, hidden={"unsigned_sensor": {"share": 1.0}})
    unsigned = measure.sense([replace(track, wheel_speed_left=-track.wheel_speed_left)], turned)[0]["wheel_speed_left"]
    assert backward.min() < -1
    assert unsigned == pytest.approx(np.abs(backward))
    arm = sensed(imu_lever_arm={"x": 0.03, "y": 0.02})
    rate = truth["yaw_rate"][-1]
    assert arm["accel_surge"][-1] - truth["accel_surge"][-1] == pytest.approx(-(rate**2) * 0.03, rel=1e-3)
    assert arm["accel_sway"][-1] - truth["accel_sway"][-1] == pytest.approx(-(rate**2) * 0.02, rel=1e-3)
    late = sensed(sensor_delay={"delay": 0.03})
    assert late["yaw_rate"][10:] == pytest.approx(truth["yaw_rate"][:-10], abs=1e-9)


def test_commands_hold_from_sample_to_sample() -> None:
    run = manoeuvre.steps("run", 0.03, (0.009, 5, -5))
    time, left, right = run.held(0.003)
    assert len(time) == 11
    assert left.tolist() == [0.0] * 3 + [5.0] * 8
    assert right.tolist() == [0.0] * 3 + [-5.0] * 8


def test_a_suggested_experiment_is_driven_as_written() -> None:
    table = {
        "name": "next",
        "duration_s": 2.0,
        "voltage_left": [[0, 0], [1, 4]],
        "voltage_right": [[0.5, 0], [0.5, -3]],
    }
    run = manoeuvre.from_table(table)
    _, left, right = run.held(0.25)
    assert left == pytest.approx([0, 1, 2, 3, 4, 4, 4, 4, 4])
    assert right == pytest.approx([0, 0, -3, -3, -3, -3, -3, -3, -3])
    assert mujoco_engine.simulate(BENCH, {}, [run], seed=0)[0].time[-1] == pytest.approx(2.0, abs=0.0015)


def small(**changes) -> Recipe:
    runs = (manoeuvre.steps("ahead", 1.0, (0, 6, 5)), manoeuvre.steps("spin", 1.0, (0, -3, 3)))
    return replace(Recipe("set", {"coulomb_friction": {"torque": 0.005}}, runs=runs, seed=3), **changes)


def contents(parent: Path) -> dict[str, bytes]:
    return {str(path.relative_to(parent)): path.read_bytes() for path in sorted(parent.rglob("*")) if path.is_file()}


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    for name in ("a", "b"):
        measure._driven.cache_clear()
        folder.write(small(), tmp_path / name)
    folder.write(small(seed=4), tmp_path / "c")
    a, b, c = (contents(tmp_path / name) for name in "abc")
    assert a == b
    assert a.keys() == c.keys()
    assert a["set/ahead.csv"] != c["set/ahead.csv"]
    assert a["set/dataset.toml"] != c["set/dataset.toml"]  # the nominal values differ


def test_the_truth_stands_beside_the_folder_and_never_inside(tmp_path: Path) -> None:
    made = folder.write(small(), tmp_path)
    assert sorted(path.name for path in made.iterdir()) == ["ahead.csv", "dataset.toml", "spin.csv"]
    truth = json.loads((tmp_path / "set.truth.json").read_text(encoding="ascii"))
    assert truth["recipe"]["hidden"] == {"coulomb_friction": {"torque": 0.005}}
    assert max(truth["visibility"].values()) > 5
    assert not any(
        word in path.read_text(encoding="ascii") for path in made.iterdir() for word in ("coulomb", "hidden")
    )
    with pytest.raises(FileExistsError):
        folder.write(small(), tmp_path)


def test_a_failure_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such effect"):
        folder.write(small(hidden={"nonsense": {}}), tmp_path)
    assert not list(tmp_path.iterdir())


def test_frame_noise_and_converters_are_as_asked(tmp_path: Path) -> None:
    frd = folder.write(small(name="frd"), tmp_path)
    flu = folder.write(small(name="flu", frame="FLU", quantised=False, noise_sd_stated=False, sensors="imu"), tmp_path)
    rows = {path.name: np.genfromtxt(path / "spin.csv", delimiter=",", names=True) for path in (frd, flu)}
    assert rows["frd"]["yaw_rate"][-1] < -1.0
    assert rows["flu"]["yaw_rate"][-1] > 1.0
    counts = rows["frd"]["yaw_rate"] / measure.resolution("yaw_rate")
    assert counts == pytest.approx(np.round(counts), abs=1e-3)
    assert "wheel_speed_left" not in rows["flu"].dtype.names
    assert "noise_sd" not in (flu / "dataset.toml").read_text(encoding="ascii")
    still = measure.log([{"yaw_rate": np.zeros(20000)}], small(quantised=False, noise=2.0))[0]["yaw_rate"]
    assert np.std(still) == pytest.approx(2 * measure.NOISE_SD["yaw_rate"], rel=0.02)


def test_nominal_values_are_off_by_what_the_recipe_says() -> None:
    exact = folder.nominal(small(nominal_error=0.0))
    assert {name: value["value"] for name, value in exact.items()} == pytest.approx(vars(BENCH))
    off = [
        folder.nominal(small(nominal_error=0.02, seed=seed))[name]["value"] / getattr(BENCH, name) - 1
        for seed in range(40) for name in ("mass", "resistance", "half_track")
    ]  # fmt: skip
    assert np.std(off) == pytest.approx(0.02, rel=0.2)


def test_suites_name_each_set_once_and_keep_seeds_apart() -> None:
    for suite in suites.SUITES.values():
        ours, theirs = suite(suites.CALIBRATION), suite(suites.REPORT)
        assert len({recipe.name for recipe in ours}) == len(ours)
        assert not {recipe.seed for recipe in ours} & {recipe.seed for recipe in theirs}
    assert len(suites.none()) >= 200
    assert {next(iter(recipe.hidden)) for recipe in suites.single()} == set(effects.LIBRARY)
    assert len({next(iter(recipe.hidden)) for recipe in suites.odd()}) >= 10


def test_no_spin_of_a_null_leaves_the_gyros_range() -> None:
    """Without a hidden effect no gyro saturates, even with the fastest vehicle of each kind that a suite may draw."""
    for vehicle in VEHICLES.values():
        fast = replace(
            vehicle, wheel_radius=1.08 * vehicle.wheel_radius, half_track=0.92 * vehicle.half_track,
            emf_constant=0.92 * vehicle.emf_constant,
        )  # fmt: skip
        for track in mujoco_engine.simulate(fast, {}, manoeuvre.short(), seed=0):
            assert np.abs(track.yaw_rate).max() < measure.RANGE["yaw_rate"] - 5 * measure.NOISE_SD["yaw_rate"]


def test_the_command_writes_a_suite(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hidden", "ci", str(tmp_path / "out"), "--only", "ci-gyro*", "--seed-offset", "5"]
    subprocess.run(command, cwd=TESTS, check=True, capture_output=True)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "ci-gyro_bias-imu",
        "ci-gyro_bias-imu.truth.json",
    ]


def test_no_file_of_the_hidden_data_knows_the_program_under_test() -> None:
    for path in sorted((TESTS / "hidden").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.split(".")[0] == "brickpilot"], path.name
