"""The planar engine of the blind tests agrees with closed forms, and shares no code with brickpilot."""

from __future__ import annotations

import ast
import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from brickpilot import catalogue
from closed_forms import CONDUCTANCE, RADIUS, TRACK, balance, hold
from hidden import planar_effects, planar_engine
from hidden.effects import TABLE
from hidden.manoeuvre import Manoeuvre, ramps, steps
from hidden.recipe import BENCH, HEAVY, RCX, Onset, Track, Vehicle
from scipy.integrate import solve_ivp


def drive(
    hidden,
    *runs: Manoeuvre,
    vehicle: Vehicle = BENCH,
    seed: int = 0,
    texture: float = 0.0,
) -> list[Track]:
    return planar_engine.simulate(vehicle, hidden, runs, seed, texture=texture)


def at_end(hidden, left: float, right: float, **options) -> Track:
    return drive(hidden, hold(left, right), **options)[0]


def signals(track: Track) -> dict[str, np.ndarray]:
    return {f.name: getattr(track, f.name) for f in fields(track) if f.name != "oversample_s"}


# ---- the vehicle alone


@pytest.mark.parametrize("vehicle", [BENCH, RCX, HEAVY])
def test_steady_speed_and_spin_are_those_of_the_motors_and_their_losses(vehicle):
    conductance = vehicle.torque_constant / vehicle.resistance
    speed = 4.0 * conductance / (vehicle.wheel_damping() + conductance * vehicle.emf_constant)
    straight = drive({}, hold(4.0, 4.0, 8.001), vehicle=vehicle)[0]
    spin = drive({}, hold(4.0, -4.0, 8.001), vehicle=vehicle)[0]
    assert straight.surge[-1] == pytest.approx(speed * vehicle.wheel_radius, rel=1e-6)
    assert straight.yaw_rate[-1] == pytest.approx(0.0, abs=1e-9)
    assert spin.yaw_rate[-1] == pytest.approx(speed * vehicle.wheel_radius / vehicle.half_track, rel=1e-6)
    assert spin.wheel_speed_right[-1] == pytest.approx(-speed, rel=1e-6)


@pytest.mark.parametrize("right", [4.0, -4.0])
def test_step_response_is_that_of_motor_current_and_what_a_wheel_carries(right):
    carried = BENCH.mass * RADIUS**2 / 2 if right > 0 else BENCH.yaw_inertia * RADIUS**2 / (2 * TRACK**2)
    inertia = BENCH.wheel_inertia + carried

    def slope(_t, x):
        current = (4.0 - BENCH.resistance * x[0] - BENCH.emf_constant * x[1]) / BENCH.inductance
        return [
            current,
            (BENCH.torque_constant * x[0] - BENCH.wheel_damping() * x[1]) / inertia,
        ]

    track = at_end({}, 4.0, right)
    exact = solve_ivp(
        slope,
        (0, 3),
        [0, 0],
        method="LSODA",
        t_eval=track.time[:3000],
        rtol=1e-9,
        atol=1e-12,
    ).y
    np.testing.assert_allclose(track.wheel_speed_left[:3000], exact[1], atol=1e-2)  # the tyre gives way for 1 ms
    np.testing.assert_allclose(track.current_left[:3000], exact[0], atol=3e-4)


def test_a_null_is_a_null():
    """Without an effect, wheels slip by far less than the noise of wheel speeds, 0.05 rad/s, also on a rough floor."""
    turns = drive(
        {},
        hold(9, 9),
        hold(5, -5),
        hold(8, 3),
        steps("back", 5, (0.5, 9, 9), (2.5, -9, -9)),
        texture=1.0,
    )
    for track in turns:
        slip = track.wheel_speed_left - (track.surge + TRACK * track.yaw_rate) / RADIUS
        assert math.sqrt(np.mean(slip**2)) < 0.01
        assert np.abs(track.sway).max() < 2e-3


def test_specific_force_and_path_follow_from_the_motion():
    track = drive(
        {"side_slip": {"creep": 0.3, "friction": 0.8}},
        ramps("r", 6, (0, 0, 0), (2, 8, 4), (6, 3, 6)),
    )[0]
    middle = slice(500, 5500)
    u, v, r = track.surge, track.sway, track.yaw_rate
    rate = lambda x: np.gradient(x, track.time)  # noqa: E731
    np.testing.assert_allclose(track.accel_surge[middle], (rate(u) - v * r)[middle], atol=3e-3)
    np.testing.assert_allclose(track.accel_sway[middle], (rate(v) + u * r)[middle], atol=3e-3)
    np.testing.assert_allclose(rate(track.yaw_angle)[middle], r[middle], atol=1e-3)
    speed = np.hypot(rate(track.x), rate(track.y))
    np.testing.assert_allclose(speed[middle], np.hypot(u, v)[middle], atol=1e-3)


def test_texture_is_seeded_and_a_run_does_not_depend_on_those_beside_it():
    first, second = hold(6, 4, 1.5), hold(3, -3, 1.5)
    one, same, other = (drive({}, first, second, seed=seed, texture=1.0) for seed in (1, 1, 2))
    alone = drive({}, first, seed=1, texture=1.0)[0]
    for name, value in signals(one[0]).items():
        np.testing.assert_array_equal(value, getattr(same[0], name))
        np.testing.assert_allclose(value, getattr(alone, name), atol=1e-12)
    for name in ("accel_surge", "accel_sway", "yaw_rate", "wheel_speed_left"):
        assert np.abs(getattr(one[0], name) - getattr(other[0], name)).max() > 0


def test_vibration_grows_with_speed_and_stays_in_its_band():
    rough, smooth = (drive({}, hold(9, 9, 8.001), texture=texture)[0] for texture in (1.0, 0.0))
    shake = (rough.accel_surge - smooth.accel_surge)[2000:]
    power = np.abs(np.fft.rfft(shake)) ** 2
    frequency = np.fft.rfftfreq(len(shake), 1e-3)
    inside = (frequency > 20) & (frequency < 120)
    assert power[inside].sum() > 0.95 * power.sum()
    rms = planar_engine.VIBRATION * smooth.surge[-1]
    assert math.sqrt(np.mean(shake**2)) == pytest.approx(rms, rel=0.15)


MIRRORED = {
    "motor_asymmetry": {"difference": 0.1},
    "com_lateral_offset": {"right": 0.02},
    "com_forward_offset": {"forward": 0.03},
    "floor_slope": {"slope_x": 0.03, "slope_y": 0.02},
    "carpet_nap": {"force_x": 0.3, "force_y": 0.2},
    "caster_drag": {"force": 0.2, "forward": -0.08},
    "constant_offset": {"torque": 0.002, "difference": 0.001},
    "wheel_radius_mismatch": {"mismatch": 0.05},
    "cogging": {"torque": 0.01, "order": 6.0, "phase": 0.3, "phase_difference": 0.4},
    "side_slip": {"creep": 0.2, "friction": 0.5},
    "gear_backlash": {"gap": 0.1, "rotor_share": 0.5},
    "stiction_stribeck": {"coulomb": 0.002, "breakaway": 0.002, "stribeck_speed": 1.0},
}


@pytest.mark.parametrize(
    "names",
    [[name] for name in MIRRORED] + [["motor_asymmetry", "floor_slope", "caster_drag"]],
)
def test_mirrored_left_to_right_everything_is_the_same(names):
    odd = {(e.name, p.name) for e in catalogue.effects() for p in e.parameters if p.odd}
    hidden = {name: MIRRORED[name] for name in names}
    turned = {name: {k: -v if (name, k) in odd else v for k, v in values.items()} for name, values in hidden.items()}
    run = ramps("run", 1.5, (0, 0, 0), (0.4, 6, 3), (0.9, 6, 3), (0.9, -4, 2), (1.5, 0, 0))
    here = drive(hidden, run)[0]
    there = drive(turned, replace(run, left=run.right, right=run.left))[0]
    for name in ("surge", "accel_surge", "x"):
        np.testing.assert_allclose(getattr(here, name), getattr(there, name), atol=1e-7)
    for name in ("sway", "yaw_rate", "yaw_angle", "accel_sway", "y"):
        np.testing.assert_allclose(getattr(here, name), -getattr(there, name), atol=1e-7)
    np.testing.assert_allclose(here.wheel_speed_left, there.wheel_speed_right, atol=1e-7)


# ---- dry friction


@pytest.mark.parametrize(
    ("hidden", "left", "right"),
    [
        ({"coulomb_friction": {"torque": 0.02}}, 1.5, -1.2),
        (
            {
                "stiction_stribeck": {
                    "coulomb": 0.01,
                    "breakaway": 0.01,
                    "stribeck_speed": 1.0,
                }
            },
            1.5,
            1.5,
        ),
        ({"yaw_scrub": {"moment": 0.1}}, 1.5, -1.5),
        ({"caster_drag": {"force": 2.0, "forward": -0.08}}, 1.5, 1.0),
        ({"caster_drag": {"force": 2.0, "forward": 0.3}}, 1.5, -1.0),
        ({"carpet_nap": {"force_x": 3.0, "force_y": 1.0}}, -1.5, -1.5),
        ({"carpet_nap": {"force_x": 3.0, "force_y": 1.0}}, 0.0, 0.0),
        (
            {
                "coulomb_friction": {"torque": 0.02},
                "floor_slope": {"slope_x": 0.1, "slope_y": 0.05},
            },
            0.0,
            0.0,
        ),
        ({"direction_asymmetry": {"torque": 0.02, "drag": 0.0, "gain": 0.0}}, 1.5, 1.0),
    ],
)
def test_dry_friction_holds_at_rest(hidden, left, right):
    track = at_end(hidden, left, right)
    assert abs(track.wheel_speed_left[-1]) < 1e-9
    assert abs(track.wheel_speed_right[-1]) < 1e-9
    assert math.hypot(track.x[-1], track.y[-1]) < 1e-4
    assert abs(track.yaw_angle[-1]) < 1e-3


def test_a_wheel_that_rolls_out_stops_and_stays():
    track = drive({"coulomb_friction": {"torque": 0.01}}, steps("out", 4, (0, 6, 6), (1, 0, 0)))[0]
    assert track.wheel_speed_left[1000] > 10
    assert np.abs(track.wheel_speed_left[-1000:]).max() < 1e-9


def test_breakaway_needs_more_than_keeps_it_turning():
    hidden = {
        "stiction_stribeck": {
            "coulomb": 0.005,
            "breakaway": 0.01,
            "stribeck_speed": 0.5,
        }
    }
    below = 0.012 / CONDUCTANCE
    assert abs(at_end(hidden, below, below).surge[-1]) < 1e-9
    kicked = drive(hidden, steps("kick", 6, (0, 6, 6), (1, below, below)))[0]
    assert kicked.wheel_speed_left[-1] == pytest.approx(balance(below, lambda w: 0.005), rel=1e-3)


# ---- the table


def test_every_effect_of_the_library_is_known():
    # A composed term has no law of its own to hide, and a controller is stated with its set points.
    names = {effect.name for effect in catalogue.effects() if effect.is_searched}
    assert names <= set(planar_effects.EFFECTS) | set(planar_effects.ELSEWHERE)
    assert set(TABLE) <= set(planar_effects.EFFECTS) | set(planar_effects.ELSEWHERE)


@pytest.mark.parametrize("name", [name for name in planar_effects.EFFECTS if name in TABLE])
def test_every_effect_changes_the_motion(name):
    entry = TABLE[name]
    hidden = {name: {k: v + entry.offset.get(k, 0.0) for k, v in entry.visible.items()}}
    runs = [steps("a", 1.8, (0.03, 9, 6), (0.9, -6, -2), (1.5, 0, 0)), hold(4, 4, 1.8)]
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        changed, plain = drive(hidden, *runs), drive({}, *runs)
    gap = [np.abs(a.wheel_speed_left - b.wheel_speed_left).max() for a, b in zip(changed, plain, strict=True)]
    assert max(gap) > 0.02
    assert all(np.isfinite(value).all() for track in changed for value in signals(track).values())


def test_what_sensors_get_wrong_changes_nothing_here():
    run = hold(5, 2, 0.3)
    hidden = {name: {} for name in planar_effects.ELSEWHERE}
    np.testing.assert_array_equal(drive(hidden, run)[0].yaw_rate, drive({}, run)[0].yaw_rate)


def test_an_unknown_effect_is_refused():
    with pytest.raises(ValueError, match="no_such_effect"):
        drive({"no_such_effect": {}}, hold(1, 1, 0.1))


def test_the_engine_shares_no_code_with_brickpilot():
    for file in Path(planar_engine.__file__).parent.glob("planar_*.py"):
        imported = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add(node.module or "")
        assert not [name for name in imported if name.startswith(("brickpilot", "cffi"))], file
        assert {name for name in imported if name.startswith("hidden")} <= {
            "hidden", "hidden.by_run", "hidden.manoeuvre", "hidden.recipe", "hidden.planar_plant",
            "hidden.planar_effects", "hidden.planar_electrics",
        }  # fmt: skip


# ---- effects that begin within a run


def test_an_effect_that_begins_changes_nothing_before_and_all_runs_after() -> None:
    """Before the moment the vehicle is the one without the effect; the next run is as if the effect always acted."""
    runs = [replace(hold(4.0, 3.0, 2.001), name=f"run_{number}") for number in range(3)]
    hidden = {"coulomb_friction": {"torque": 0.01}, "floor_slope": {"slope_x": 0.02, "slope_y": 0.0}}
    found = planar_engine.simulate_from(Onset(1, 0.9), BENCH, hidden, runs, 3)
    without, always = (planar_engine.simulate(BENCH, acting, runs, 3) for acting in ({}, hidden))
    for name, values in signals(found[1]).items():
        np.testing.assert_array_equal(values[:900], signals(without[1])[name][:900])
    assert found[1].wheel_speed_left[899] - found[1].wheel_speed_left[901] < 0.02
    assert found[1].wheel_speed_left[-1] == pytest.approx(always[1].wheel_speed_left[-1], rel=0.01)
    assert found[1].wheel_speed_left[-1] < 0.9 * without[1].wheel_speed_left[-1]
    for run, expected in ((0, without), (2, always)):
        for name, values in signals(found[run]).items():
            np.testing.assert_array_equal(values, signals(expected[run])[name])


def test_the_teeth_are_apart_by_nothing_when_a_play_begins() -> None:
    runs = [hold(4.0, 4.0, 2.001)]
    track = planar_engine.simulate_from(
        Onset(0, 1.0), BENCH, {"gear_backlash": {"gap": 0.15, "rotor_share": 0.5}}, runs, 3
    )[0]
    assert np.abs(np.diff(track.wheel_speed_left[990:1010])).max() < 0.02


def test_charge_that_carries_over_cannot_begin_within_a_run() -> None:
    with pytest.raises(ValueError, match="battery_discharge: cannot begin within a run"):
        planar_engine.simulate_from(Onset(0, 1.0), BENCH, {"battery_discharge": {"slope": 1e-3}}, [hold(4.0, 4.0)], 3)
