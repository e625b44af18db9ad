"""The planar engine of the blind tests against closed forms. It must not know brickpilot's plant; this test may."""

from __future__ import annotations

import ast
import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from brickpilot import catalogue
from hidden import planar_effects, planar_engine
from hidden.effects import TABLE
from hidden.manoeuvre import Manoeuvre, ramps, steps
from hidden.recipe import BENCH, GRAVITY, HEAVY, RCX, Track, Vehicle
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

CONDUCTANCE = BENCH.torque_constant / BENCH.resistance  # N m/V
DAMPING = BENCH.wheel_damping() + CONDUCTANCE * BENCH.emf_constant  # N m s/rad, back EMF and losses
FREE = CONDUCTANCE / DAMPING  # rad/s per V, without a load
RADIUS, TRACK = BENCH.wheel_radius, BENCH.half_track


def drive(
    hidden,
    *runs: Manoeuvre,
    vehicle: Vehicle = BENCH,
    seed: int = 0,
    texture: float = 0.0,
) -> list[Track]:
    return planar_engine.simulate(vehicle, hidden, runs, seed, texture=texture)


def hold(left: float, right: float, seconds: float = 3.0) -> Manoeuvre:
    return steps("hold", seconds, (0.0, left, right))


def at_end(hidden, left: float, right: float, **options) -> Track:
    return drive(hidden, hold(left, right), **options)[0]


def signals(track: Track) -> dict[str, np.ndarray]:
    return {f.name: getattr(track, f.name) for f in fields(track) if f.name != "oversample_s"}


def balance(volts: float, load) -> float:
    """rad/s at which a wheel's motor is in balance with load(w), N m, beside its own losses."""
    return brentq(lambda w: CONDUCTANCE * volts - DAMPING * w - load(w), -60, 60, xtol=1e-12)


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
    """Wheels creep by far less than the 0.05 rad/s that wheel speeds are known to, also on a rough floor."""
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


# ---- effects in a steady state: hidden, volts left and right, expected speeds


def _straight(load, volts=4.5):
    return (volts, volts), (balance(volts, load),) * 2


def _spin(load, volts=4.5):
    speed = balance(volts, load)
    return (volts, -volts), (speed, -speed)


def _sagging(volts):
    """V of each motor: the supply falls by 5 ohm times the duty-weighted current of both."""
    duty = volts / BENCH.battery_voltage

    def miss(v):
        current = (v - BENCH.emf_constant * CONDUCTANCE * v / DAMPING) / BENCH.resistance
        return v - duty * (BENCH.battery_voltage - 5.0 * 2 * current * duty)

    return brentq(miss, 0, volts)


FLUX = [
    CONDUCTANCE * k * 4.5 / (BENCH.wheel_damping() + CONDUCTANCE * k * k * BENCH.emf_constant) for k in (1.05, 0.95)
]
GEARED = BENCH.wheel_damping() + 0.8 * CONDUCTANCE * BENCH.emf_constant
LOADED = BENCH.wheel_damping(0.9) + CONDUCTANCE * BENCH.emf_constant
STEADY = {
    "coulomb": ({"coulomb_friction": {"torque": 0.006}}, *_straight(lambda w: 0.006)),
    "sqrt": ({"rolling_sqrt": {"torque": 0.002}}, *_straight(lambda w: 0.002 * math.sqrt(abs(w)))),
    "offset": (
        {"constant_offset": {"torque": 0.006, "difference": 0.002}}, (4.5, 4.5),
        (balance(4.5, lambda w: 0.008), balance(4.5, lambda w: 0.004)),
    ),
    "deadband": ({"actuator_deadband": {"voltage": 0.5}}, (4.5, -4.5), (4 * FREE, -4 * FREE)),
    "saturation": ({"supply_saturation": {"voltage": 5.0}}, (7, 3), (5 * FREE, 3 * FREE)),
    "quantised": ({"pwm_quantisation": {"step": 0.125}}, (4.0, 4.0), (4.5 * FREE,) * 2),
    "gains": ({"motor_asymmetry": {"difference": 0.1}}, (4.0, 4.0), (4.2 * FREE, 3.8 * FREE)),
    "flux": ({"torque_constant_asymmetry": {"difference": 0.1}}, (4.5, 4.5), FLUX),
    "forward": (
        {"direction_asymmetry": {"torque": 0.006, "drag": 2e-4, "gain": 0.1}}, (4.0, -4.0),
        (balance(4.2, lambda w: 0.006 + 1e-4 * w), -balance(3.8, lambda w: -1e-4 * w)),
    ),
    "sag": ({"battery_sag": {"resistance": 5.0}}, (6, 6), (_sagging(6) * FREE,) * 2),
    "crosstalk": ({"odd_crosstalk": {"share": 0.1}}, (6, 4), (5.6 * FREE, 3.4 * FREE)),
    "fading": ({"odd_voltage_gain": {"loss": 0.02}}, (5, 5), (4.5 * FREE,) * 2),
    "by voltage": ({"odd_friction_with_voltage": {"slope": 0.001}}, *_straight(lambda w: 0.0045)),
    "air": ({"quadratic_drag": {"drag": 0.5}}, *_straight(lambda w: 0.5 * (RADIUS * w) ** 2 * RADIUS / 2)),
    "cube": ({"odd_cubic_drag": {"drag": 3.0}}, *_straight(lambda w: 3.0 * (RADIUS * w) ** 3 * RADIUS / 2)),
    "slope": (
        {"floor_slope": {"slope_x": 0.03, "slope_y": 0.0}},
        *_straight(lambda w: -0.03 * BENCH.mass * GRAVITY * RADIUS / 2),
    ),
    "ball ahead": ({"caster_drag": {"force": 0.25, "forward": -0.08}}, *_straight(lambda w: 0.25 * RADIUS / 2)),
    "ball around": (
        {"caster_drag": {"force": 0.25, "forward": -0.08}}, *_spin(lambda w: 0.25 * 0.08 * RADIUS / (2 * TRACK))
    ),
    "scrub": ({"yaw_scrub": {"moment": 0.012}}, *_spin(lambda w: 0.012 * RADIUS / (2 * TRACK))),
    "along the pile": ({"carpet_nap": {"force_x": 0.5, "force_y": 0.0}}, *_straight(lambda w: 0.0)),
    "against the pile": ({"carpet_nap": {"force_x": -0.5, "force_y": 0.0}}, *_straight(lambda w: 0.5 * RADIUS / 2)),
    "compressed": (
        {"voltage_compression": {"compression": 0.5}}, (6, -3), (6 / (1 + 3 / 9) * FREE, -3 / (1 + 1.5 / 9) * FREE)
    ),
    "dead time": ({"dead_time": {"voltage": 0.5}}, (4.5, -4.5), (4 * FREE, -4 * FREE)),
    "load": ({"load_friction": {"share": 0.2}}, (4.5, 4.5), (4.5 * 0.8 * CONDUCTANCE / GEARED,) * 2),
    "viscous": ({"viscous_loss": {"drag": 3e-4}}, *_straight(lambda w: 3e-4 * w)),
    "linear drag": ({"surge_drag": {"drag": 1.0}}, *_straight(lambda w: RADIUS * w * RADIUS / 2)),
    "viscous scrub": (
        {"viscous_scrub": {"drag": 0.002}}, *_spin(lambda w: 0.002 * RADIUS * w / TRACK * RADIUS / (2 * TRACK))
    ),
    "payload": (
        {"payload_mass": {"mass": 0.3, "forward": 0.0, "right": 0.0}}, (4.5, 4.5), (4.5 * CONDUCTANCE / LOADED,) * 2
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", STEADY)
def test_steady_state_is_what_the_effect_says(case):
    hidden, (left, right), (speed_left, speed_right) = STEADY[case]
    track = at_end(hidden, left, right)
    assert track.wheel_speed_left[-1] == pytest.approx(speed_left, rel=1e-4)
    assert track.wheel_speed_right[-1] == pytest.approx(speed_right, rel=1e-4)


def _tyre_forces(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """N that each wheel pushes with, from its motor and its own motion."""

    def force(current, speed):
        lost = BENCH.wheel_damping() * speed + BENCH.wheel_inertia * np.gradient(speed, track.time)
        return (BENCH.torque_constant * current - lost) / RADIUS

    return force(track.current_left, track.wheel_speed_left), force(track.current_right, track.wheel_speed_right)


@pytest.mark.parametrize(("forward", "right"), [(0.03, 0.0), (0.0, 0.02), (-0.02, 0.03)])
def test_tyres_push_the_centre_of_mass_where_it_is(forward, right):
    hidden = {
        "com_forward_offset": {"forward": forward},
        "com_lateral_offset": {"right": right},
    }
    track = drive(hidden, ramps("run", 6, (0, 0, 0), (2, 8, 3), (4, 2, 8), (6, 0, 0)))[0]
    left, right_push = _tyre_forces(track)
    u, v, r = track.surge, track.sway, track.yaw_rate
    du, dv, dr = (np.gradient(x, track.time) for x in (u, v, r))
    ahead = du - v * r - right * dr - forward * r**2
    aside = dv + u * r + forward * dr - right * r**2
    turning = BENCH.yaw_inertia * dr + BENCH.mass * (forward * aside - right * ahead)
    middle = slice(100, 5900)
    np.testing.assert_allclose((left + right_push)[middle], BENCH.mass * ahead[middle], atol=4e-3)
    np.testing.assert_allclose(TRACK * (left - right_push)[middle], turning[middle], atol=2e-4)


def test_payload_is_the_same_as_the_vehicle_that_it_makes():
    hidden = {"payload_mass": {"mass": 0.3, "forward": 0.06, "right": -0.03}}
    run = ramps("run", 3, (0, 0, 0), (1, 8, 3), (3, 2, 8))
    reduced = 0.6 * 0.3 / 0.9
    heavier = replace(BENCH, mass=0.9, yaw_inertia=0.002 + reduced * (0.06**2 + 0.03**2))
    moved = {
        "com_forward_offset": {"forward": 0.02},
        "com_lateral_offset": {"right": -0.01},
    }
    one, two = drive(hidden, run)[0], drive(moved, run, vehicle=heavier)[0]
    np.testing.assert_allclose(one.yaw_rate, two.yaw_rate, atol=1e-9)
    np.testing.assert_allclose(one.surge, two.surge, atol=1e-9)


def test_unequal_wheels_turn_the_vehicle():
    track = at_end({"wheel_radius_mismatch": {"mismatch": 0.05}}, 4.5, 4.5)
    rims = (
        RADIUS * 1.025 * track.wheel_speed_left[-1],
        RADIUS * 0.975 * track.wheel_speed_right[-1],
    )
    assert track.yaw_rate[-1] == pytest.approx((rims[0] - rims[1]) / (2 * TRACK), rel=1e-3)
    assert track.surge[-1] == pytest.approx(sum(rims) / 2, rel=1e-4)


def test_tyres_slip_as_their_law_says():
    creep, friction, drag = 0.1, 0.1, 0.5
    track = at_end(
        {
            "wheel_slip": {"creep": creep, "friction": friction},
            "quadratic_drag": {"drag": drag},
        },
        9,
        9,
    )
    force, most = drag * track.surge[-1] ** 2 / 2, friction * BENCH.mass * GRAVITY / 2
    assert 0.5 < force / most < 0.99
    slip = RADIUS * track.wheel_speed_left[-1] - track.surge[-1]
    assert slip == pytest.approx(creep * force / math.sqrt(1 - (force / most) ** 2), rel=1e-3)


def test_the_vehicle_drifts_as_its_side_law_says():
    creep, friction = 0.1, 0.3
    track = at_end({"side_slip": {"creep": creep, "friction": friction}}, 7, 3)
    force, most = (
        BENCH.mass * track.surge[-1] * track.yaw_rate[-1],
        friction * BENCH.mass * GRAVITY,
    )
    assert 0.3 < force / most < 0.99
    assert track.sway[-1] == pytest.approx(-creep * force / math.sqrt(1 - (force / most) ** 2), rel=1e-3)


def test_tyres_of_one_circle_hold_less_sideways_where_they_push():
    creep, friction, drag = 0.1, 0.12, 0.5
    hidden = {
        "tyre_grip": {"creep": creep, "friction": friction},
        "quadratic_drag": {"drag": drag},
    }
    track = drive(hidden, hold(9, 6, 12.0))[0]
    most = friction * BENCH.mass * GRAVITY / 2
    u, v, r = track.surge[-1], track.sway[-1], track.yaw_rate[-1]
    wheels = np.array([track.wheel_speed_left[-1], track.wheel_speed_right[-1]])
    along = RADIUS * wheels - (u + TRACK * r * np.array([1, -1]))
    held = 1 / np.sqrt(creep**2 + (np.hypot(along, v) / most) ** 2)
    assert 0.5 < np.max(held * np.hypot(along, v)) / most < 0.999
    assert np.sum(held * along) == pytest.approx(drag * u**2 - BENCH.mass * v * r, rel=2e-3)
    assert np.sum(-held * v) == pytest.approx(drag * v * abs(v) + BENCH.mass * u * r, rel=2e-3)


def test_a_share_of_the_braking_is_missing_at_zero_command():
    def stops(share):
        run = steps("run", 4.0, (0, 6, 6), (3, 0, 0))
        track = drive({"zero_coast": {"share": share}}, run)[0]
        return -math.log(track.wheel_speed_left[3200] / track.wheel_speed_left[3010]) / 0.19

    inertia = BENCH.wheel_inertia + 0.5 * BENCH.mass * RADIUS**2
    for share in (0.0, 0.4, 1.0):
        loss = BENCH.wheel_damping() + (1 - share) * CONDUCTANCE * BENCH.emf_constant
        assert stops(share) == pytest.approx(loss / inertia, rel=0.01)


def test_a_battery_fades_with_the_time_since_power_on():
    tracks = drive(
        {"battery_fade": {"rate": 0.1}},
        *(steps(name, 2.0, (0, 0, 0)) for name in ("a", "b")),
    )
    assert tracks[0].battery[-1] == pytest.approx(9 - 0.2, abs=1e-3)
    assert tracks[1].battery[-1] == pytest.approx(9 - 0.4, abs=1e-3)


def test_curve_scrub_brakes_by_a_share_of_the_side_force():
    track = at_end({"curve_scrub": {"coefficient": 0.4}}, 7, 3)
    left, right = _tyre_forces(track)
    side = BENCH.mass * track.surge[-1] * track.yaw_rate[-1]
    assert (left + right)[-1] == pytest.approx(0.4 * side, rel=1e-3)


# ---- effects with a memory


def test_delays_shift_what_happens():
    run = steps("run", 2, (0.3, 5, 3), (1.2, -2, 4))
    prompt, late = drive({}, run)[0], drive({"input_delay": {"delay": 0.04}}, run)[0]
    np.testing.assert_allclose(late.wheel_speed_left[40:], prompt.wheel_speed_left[:-40], atol=1e-9)
    np.testing.assert_array_equal(late.command_left, prompt.command_left)
    held = drive({"start_delay": {"delay": 0.5}}, run)[0]
    again = drive({}, steps("run", 2, (0.5, 5, 3), (1.2, -2, 4)), seed=0)[0]
    np.testing.assert_allclose(held.yaw_rate[520:], again.yaw_rate[520:], atol=0.1)
    assert np.all(held.wheel_speed_left[:500] == 0)


def test_lag_costs_its_time_constant_of_travel():
    prompt, slow = (drive(h, hold(4, 4))[0] for h in ({}, {"actuator_lag": {"time_constant": 0.08}}))
    assert prompt.x[-1] - slow.x[-1] == pytest.approx(0.08 * prompt.surge[-1], rel=1e-3)


def test_pulses_that_brake_are_a_mean_voltage_and_pulses_that_float_drive_faster():
    plain = at_end({}, 4.5, 4.5).surge[-1]
    braking, floating = (at_end({"pwm_coast": {"period": 0.001, "brakes": b}}, 4.5, 4.5) for b in (1.0, 0.0))
    assert np.mean(braking.surge[-100:]) == pytest.approx(plain, rel=2e-3)
    assert np.mean(floating.surge[-100:]) > 1.2 * plain
    flux = {"torque_constant_asymmetry": {"difference": 0.1}}
    slow = at_end({"pwm_coast": {"period": 0.004, "brakes": 0.0}} | flux, 4.5, 4.5)
    assert np.mean(np.abs(slow.current_left) < 1e-4) > 0.3  # no current in a pause, whatever the back EMF
    full = at_end({"pwm_coast": {"period": 0.001, "brakes": 0.0}}, 9, 9)
    np.testing.assert_allclose(full.surge, at_end({}, 9, 9).surge, atol=1e-9)


def test_charge_carries_over_from_run_to_run():
    runs = [hold(9, 9, 2.001), hold(6, -6, 3.0), steps("rest", 1.2), hold(5, 5, 1.5)]
    tracks = drive({"battery_discharge": {"slope": 0.3}}, *runs)
    drawn = 0.0
    for track in tracks:
        assert track.battery[0] == pytest.approx(BENCH.battery_voltage - 0.3 * drawn, abs=2e-4)
        duty = (track.command_left, track.command_right)
        current = (duty[0] * track.current_left + duty[1] * track.current_right) / BENCH.battery_voltage
        drawn += np.trapezoid(current, track.time)
    assert tracks[-1].battery[-1] == pytest.approx(BENCH.battery_voltage - 0.3 * drawn, abs=2e-3)
    assert tracks[-1].battery[-1] < 8.9


def test_windings_warm_up_to_a_balance_and_stay_warm():
    hidden = {
        "motor_heating": {"thermal_resistance": 200.0, "time_constant": 1.0},
        "coulomb_friction": {"torque": 1.0},
    }
    first, second = drive(hidden, hold(9, 9, 10.0), hold(9, 9, 0.5))

    def miss(resistance):
        return BENCH.resistance * (1 + 0.00393 * 200.0 * 81 / resistance) - resistance

    hot = brentq(miss, 20, 100)
    assert first.current_left[-1] == pytest.approx(9 / hot, rel=1e-3)
    assert second.current_left[20] == pytest.approx(9 / hot, rel=2e-3)


def test_cogging_holds_where_torques_balance():
    volts, torque, order = 1.0, 0.03, 6.0
    hidden = {
        "cogging": {
            "torque": torque,
            "order": order,
            "phase": 0.3,
            "phase_difference": 0.0,
        }
    }
    track = drive(hidden, ramps("hold", 6, (0, 0, 0), (3, volts, volts)))[0]
    angle = (math.asin(CONDUCTANCE * volts / torque) - 0.3) / order
    assert track.x[-1] / RADIUS == pytest.approx(angle, abs=2e-3)


def test_ripple_has_its_order():
    hidden = {
        "torque_ripple": {
            "amplitude": 0.3,
            "order": 6.0,
            "phase": 0.0,
            "phase_difference": 0.5,
        }
    }
    track = drive(hidden, hold(2, 2, 12.0))[0]
    wave = track.wheel_speed_left[4000:] - np.mean(track.wheel_speed_left[4000:])
    peak = np.fft.rfftfreq(len(wave), 1e-3)[np.argmax(np.abs(np.fft.rfft(wave)))]
    assert peak == pytest.approx(6.0 * np.mean(track.wheel_speed_left[4000:]) / (2 * math.pi), abs=0.15)


def test_a_rotor_crosses_its_play_alone():
    gap, share = 0.4, 0.6

    def slope(_t, x):
        current = (6 - BENCH.resistance * x[0] - BENCH.emf_constant * x[1]) / BENCH.inductance
        return [
            current,
            BENCH.torque_constant * x[0] / (share * BENCH.wheel_inertia),
            x[1],
        ]

    def meets(_t, x):
        return x[2] - gap / 2

    meets.terminal = True
    reached = solve_ivp(slope, (0, 1), [0, 0, 0], method="LSODA", events=meets, rtol=1e-9, atol=1e-12).t_events[0][0]
    track = at_end({"gear_backlash": {"gap": gap, "rotor_share": share}}, 6, 6)
    moves = track.time[np.flatnonzero(track.wheel_speed_left > 0.1)[0]]
    assert moves == pytest.approx(reached, abs=2e-3)
    assert track.wheel_speed_left[-1] == pytest.approx(6 * CONDUCTANCE / DAMPING, rel=1e-3)


# ---- the table


def test_every_effect_of_the_library_is_known():
    # A composed term has no law of its own to hide.
    names = {effect.name for effect in catalogue.effects()} - {"composed_term"}
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
            "hidden.planar_effects",
        }  # fmt: skip
