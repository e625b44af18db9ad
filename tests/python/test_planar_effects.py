"""Effects of the planar engine of the blind tests equal closed forms, in steady states and in effects with memory."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import CONDUCTANCE, DAMPING, FREE, RADIUS, TRACK, balance, hold
from hidden.manoeuvre import ramps, steps
from hidden.recipe import BENCH, GRAVITY, Track
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_planar_engine import at_end, drive


def _straight(load, volts=4.5):
    return (volts, volts), (balance(volts, load),) * 2


def _spin(load, volts=4.5):
    speed = balance(volts, load)
    return (volts, -volts), (speed, -speed)


def _sagging(volts):
    """Returns the voltage, V, at each motor if both get `volts`: the supply voltage falls by 5 ohm times its current.

    The supply's current is the sum over both motors of duty times motor current.
    """
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
    """Returns the forces of the left and the right tyre, N, (n,) each, from motor torque and wheel motion."""

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
    assert np.mean(np.abs(slow.current_left) < 1e-4) > 0.3  # no current between pulses, despite the back EMF
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
