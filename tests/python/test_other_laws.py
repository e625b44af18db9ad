"""Laws that the library lacks agree with closed forms in both engines; a table states their mechanisms and names."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from brickpilot import catalogue
from closed_forms import CONDUCTANCE, FREE, RADIUS, TRACK, balance, hold
from hidden import effects, measure, other_laws, planar_engine, sensor_laws
from hidden.by_run import delays, place
from hidden.manoeuvre import Manoeuvre, ramps, short, steps
from hidden.recipe import BENCH, GRAVITY, Recipe, Track
from scipy.optimize import brentq

mujoco_engine = pytest.importorskip("hidden.mujoco_engine")

ENGINES = ("mujoco", "planar")


def drive(engine: str, hidden, *runs: Manoeuvre) -> list[Track]:
    if engine == "planar":
        return planar_engine.simulate(BENCH, hidden, runs, 0, texture=0.0)
    return mujoco_engine.simulate(BENCH, hidden, runs, 0)


def current(volts: float, speed: float) -> float:
    return (volts - BENCH.emf_constant * speed) / BENCH.resistance


def by_load(volts: float, share: float, speed: float) -> float:
    """Returns the steady speed, rad/s, if friction takes a share of the motor's torque that is largest near rest."""

    def miss(w: float) -> float:
        taken = share * (0.3 + 0.7 * math.exp(-((w / speed) ** 2)))
        return (1 - taken) * BENCH.torque_constant * current(volts, w) - BENCH.wheel_damping() * w

    return brentq(miss, 0, 60)


def sagging(volts: float, resistance: float) -> float:
    duty = volts / BENCH.battery_voltage

    def miss(v: float) -> float:
        return v - duty * (BENCH.battery_voltage - resistance * 2 * current(v, FREE * v) * duty)

    return brentq(miss, 0, volts)


def saturating(volts: float, loss: float) -> float:
    def miss(w: float) -> float:
        i = current(volts, w)
        return BENCH.torque_constant * i / (1 + loss * abs(i)) - BENCH.wheel_damping() * w

    return brentq(miss, 0, 60)


LIMIT = BENCH.battery_voltage / 0.6
STEADY = {
    "tanh": (
        {"coulomb_tanh": {"torque": 0.006, "speed": 20.0}}, (4.5, 4.5),
        (balance(4.5, lambda w: 0.006 * math.tanh(w / 20)),) * 2,
    ),
    "dahl": (
        {"friction_dahl": {"torque": 0.004, "stretch": 0.05}}, (4.5, -4.5),
        (balance(4.5, lambda _: 0.004), -balance(4.5, lambda _: 0.004)),
    ),
    "lugre": (
        {"friction_lugre": {"coulomb": 0.003, "breakaway": 0.005, "stribeck_speed": 10.0, "stretch": 0.02}}, (4.5, 4.5),
        (balance(4.5, lambda w: 0.003 + 0.005 * math.exp(-(w / 10) ** 2)),) * 2,
    ),
    "by load": ({"friction_by_load": {"share": 0.4, "speed": 20.0}}, (4.5, 4.5), (by_load(4.5, 0.4, 20.0),) * 2),
    "levels off": (
        {"loss_that_levels_off": {"torque": 0.006, "speed": 15.0}}, (4.5, 4.5),
        (balance(4.5, lambda w: 0.006 * (1 - math.exp(-w / 15))),) * 2,
    ),
    "one way": (
        {"loss_one_way": {"torque": 0.004, "speed": 10.0}}, (4.0, -4.0),
        (balance(4.0, lambda w: 0.004 * (w / 10) ** 2), -4 * FREE),
    ),
    "offset": (
        {"offset_by_run": {"torque": 0.004, "spread": 0.5}}, (4.5, 4.5),
        (balance(4.5, lambda _: 0.004 * (1 + 0.5 * place(0))),) * 2,
    ),
    "dead band": ({"deadband_sloped": {"voltage": 1.0}}, (1.5, 3.0), (1.0 * FREE, 3.0 * FREE)),
    "soft limit": (
        {"soft_saturation": {"compression": 0.6}}, (7.0, 2.0),
        (LIMIT * math.tanh(7 / LIMIT) * FREE, LIMIT * math.tanh(2 / LIMIT) * FREE),
    ),
    "cut off": ({"levels_cut_off": {"step": 0.125}}, (4.4, 4.6), (3.375 * FREE, 4.5 * FREE)),
    "one side": ({"one_side_drop": {"drop": 0.5}}, (4.0, -4.0), (4 * FREE, -3.5 * FREE)),
    "dead time": ({"switching_loss": {"voltage": 0.4, "current": 0.002}}, (5.0, 5.0), (4.6 * FREE,) * 2),
    "saturating": ({"one_motor_saturates": {"loss": 3.0}}, (6.0, 6.0), (saturating(6.0, 3.0), 6 * FREE)),
    "sag": (
        {"sag_with_memory": {"resistance": 2.0, "slow": 3.0, "time_constant": 0.3}}, (6.0, 6.0),
        (sagging(6.0, 5.0) * FREE,) * 2,
    ),
    "settling": (
        {"discharge_settling": {"drop": 0.9, "time_constant": 0.5}}, (4.5, 4.5),
        (4.5 * (1 - 0.9 * (1 - math.exp(-2.85 / 0.5)) / 9) * FREE,) * 2,
    ),
    "drag": (
        {"drag_power": {"drag": 0.5}}, (4.5, 4.5),
        (balance(4.5, lambda w: 0.5 * RADIUS * abs(RADIUS * w) ** 1.5 / 2),) * 2,
    ),
    "caster": (
        {"caster_viscous": {"drag": 0.5, "forward": -0.08}}, (4.5, -4.5),
        [s * balance(4.5, lambda w: 0.5 * 0.08**2 * (RADIUS / TRACK) ** 2 * w / 2) for s in (1, -1)],
    ),
    "scrub": (
        {"scrub_smooth": {"moment": 0.02, "rate": 5.0}}, (4.5, -4.5),
        [s * balance(4.5, lambda w: 0.02 * math.tanh(w * RADIUS / TRACK / 5) * RADIUS / TRACK / 2) for s in (1, -1)],
    ),
    "no gear": (
        {"backlash_soft": {"gap": 0.2, "rotor_share": 0.5, "stiffness": 1.0, "damping": 0.003}}, (4.5, 4.5),
        (4.5 * FREE,) * 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", STEADY)
def test_steady_state_is_what_the_law_says(case, engine) -> None:
    hidden, (left, right), (speed_left, speed_right) = STEADY[case]
    track = drive(engine, hidden, hold(left, right))[0]
    bound = 2e-3 if case in ("settling", "sag") else 4e-4
    assert track.wheel_speed_left[-1] == pytest.approx(speed_left, rel=bound)
    assert track.wheel_speed_right[-1] == pytest.approx(speed_right, rel=bound)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("hidden", [{"slew_limit": {"time_per_volt": 0.1}}, {"slew_when_driving": {"time": 0.9}}])
def test_a_limited_slew_makes_a_step_a_ramp(engine, hidden) -> None:
    limited = drive(engine, hidden, hold(6, 3, 1.5))[0]
    ramp = drive(engine, {}, ramps("ramp", 1.5, (0, 0, 0), (0.3, 3, 3), (0.6, 6, 3)))[0]
    np.testing.assert_allclose(limited.wheel_speed_left, ramp.wheel_speed_left, atol=0.12)
    np.testing.assert_allclose(limited.wheel_speed_right, ramp.wheel_speed_right, atol=0.12)


@pytest.mark.parametrize("engine", ENGINES)
def test_delays_without_jitter_or_spread_are_plain_delays(engine) -> None:
    run = steps("run", 1.5, (0.2, 6, 3), (0.9, -3, 4))
    jitter = drive(engine, {"command_jitter": {"delay": 0.04, "jitter": 0.0}}, run)[0]
    late = drive(engine, {"input_delay": {"delay": 0.04}}, run)[0]
    np.testing.assert_allclose(jitter.wheel_speed_left, late.wheel_speed_left, atol=0.25)
    by_run = drive(engine, {"start_delay_by_run": {"delay": 0.4, "spread": 0.0}}, run)[0]
    held = drive(engine, {"start_delay": {"delay": 0.4}}, run)[0]
    np.testing.assert_allclose(by_run.wheel_speed_left, held.wheel_speed_left, atol=1e-9)


def test_frames_and_runs_differ_and_stay_within_their_bounds() -> None:
    late = delays(np.arange(0, 5, 0.001), 3, 0.04, 0.03)
    assert late.min() >= 0.01
    assert late.max() <= 0.07
    assert len(np.unique(late)) == 100
    assert np.array_equal(late[:2500], delays(np.arange(0, 2.5, 0.001), 3, 0.04, 0.03))
    places = [place(k) for k in range(50)]
    assert max(map(abs, places)) < 1
    assert abs(float(np.mean(places))) < 0.05


@pytest.mark.parametrize("engine", ENGINES)
def test_a_motor_that_floats_coasts_on_its_losses_alone(engine) -> None:
    track = drive(engine, {"brake_late": {"after": 2.5}}, steps("out", 4, (0, 6, 6), (1, 0, 0)))[0]
    inertia = BENCH.wheel_inertia + 0.5 * BENCH.mass * RADIUS**2
    kept = math.exp(-1.9 * BENCH.wheel_damping() / inertia)
    assert track.wheel_speed_left[2950] == pytest.approx(kept * track.wheel_speed_left[1050], rel=1e-3)
    assert np.abs(track.current_left[1010:3490]).max() < 1e-4
    assert abs(track.wheel_speed_left[-1]) < 0.2 * track.wheel_speed_left[3490]  # then the motor brakes


@pytest.mark.parametrize("engine", ENGINES)
def test_bristles_bend_and_hold(engine) -> None:
    """Below its bound, Dahl's friction bends until its torque equals the motor's: the wheel does not creep."""
    volts, torque, stretch = 1.0, 0.03, 0.05
    hidden = {"friction_dahl": {"torque": torque, "stretch": stretch}}
    track = drive(engine, hidden, ramps("pull", 4.0, (0, 0, 0), (2.5, volts, volts)))[0]
    bent = -stretch * math.log(1 - CONDUCTANCE * volts / torque)  # dT/dx = (1 - T / bound) bound / stretch
    assert track.x[-1] / RADIUS == pytest.approx(bent, rel=0.08)  # the wheel swings a little on the bristles
    assert abs(track.wheel_speed_left[-1]) < 1e-3


def test_grip_is_one_circle() -> None:
    """The total force never exceeds friction times weight, and reaches it on a straight run and in a curve."""
    friction = 0.25
    runs = hold(9, 9, 0.5), steps("curve", 3.0, (0, 9, 4))
    straight, curve = drive("planar", {"grip_circle": {"friction": friction}}, *runs)
    most = friction * GRAVITY
    assert straight.accel_surge[100:200] == pytest.approx(most, rel=0.01)
    felt = np.hypot(curve.accel_surge, curve.accel_sway)
    assert felt[20:].max() < 1.02 * most
    assert np.mean(np.abs(curve.accel_sway[200:]) > 0.2) > 0.9
    assert felt[200:].max() > 0.97 * most
    firm = drive("planar", {"grip_circle": {"friction": 4.0}}, *runs)[1]
    plain = drive("planar", {}, *runs)[1]
    np.testing.assert_allclose(firm.yaw_rate, plain.yaw_rate, atol=0.05)


def test_a_skid_has_a_constant_side_force_and_leaves_the_wheels_firm() -> None:
    track = drive("planar", {"side_skid": {"friction": 0.05}}, hold(9, 3, 3.0))[0]
    assert np.abs(track.accel_sway).max() == pytest.approx(0.05 * GRAVITY, rel=0.03)
    slip = RADIUS * track.wheel_speed_left - (track.surge + TRACK * track.yaw_rate)
    assert np.sqrt(np.mean(slip**2)) < 2e-3


def test_friction_that_fades_is_that_of_its_slip() -> None:
    law = {"creep": 0.05, "friction": 0.3, "fade": 0.6, "speed": 0.1}
    track = drive("planar", {"grip_that_fades": law}, hold(9, 9, 0.4))[0]
    slip = RADIUS * track.wheel_speed_left - track.surge
    most = 0.5 * law["friction"] * (1 - law["fade"] * (1 - np.exp(-slip / law["speed"]))) * BENCH.mass * GRAVITY
    force = slip / np.sqrt(law["creep"] ** 2 + (slip / most) ** 2)
    np.testing.assert_allclose(track.accel_surge[50:], 2 * force[50:] / BENCH.mass, rtol=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_second_inertia_adds_to_the_first_and_swings(engine) -> None:
    run = steps("run", 6.0, (0.2, 6, 6))
    alone, coupled = (
        drive(engine, hidden, run)[0].wheel_speed_left
        for hidden in ({}, {"coupled_inertia": {"share": 0.5, "period": 0.2, "damping": 0.05}})
    )
    settled = alone[-1]
    assert coupled[-1] == pytest.approx(settled, rel=0.01)
    # The sum of the differences to the settled speed grows with the moved inertia, here by half.
    missing = [float(np.sum(settled - one[200:])) for one in (alone, coupled)]
    assert missing[1] / missing[0] == pytest.approx(1.5, rel=0.02)
    swing = coupled[250:1250] - alone[250:1250]
    spectrum = np.abs(np.fft.rfft(np.diff(swing, 2) * np.hanning(998), 20000))
    assert np.fft.rfftfreq(20000, 0.001)[np.argmax(spectrum)] == pytest.approx(1 / 0.2, rel=0.1)


@pytest.mark.parametrize("engine", ENGINES)
def test_rubber_swings_faster_the_further_it_is_stretched(engine) -> None:
    spring = {"share": 0.5, "period": 0.3, "damping": 0.05}
    run = steps("run", 3.0, (0.2, 6, 6))

    def swing(hidden: dict[str, dict[str, float]]) -> float:
        moved = drive(engine, hidden, run)[0].wheel_speed_left - drive(engine, {}, run)[0].wheel_speed_left
        spectrum = np.abs(np.fft.rfft(np.diff(moved[250:850], 2) * np.hanning(598), 20000))
        return float(np.fft.rfftfreq(20000, 0.001)[np.argmax(spectrum)])

    soft = swing({"inertia_on_rubber": spring | {"stretch": 1e3}})
    assert soft == pytest.approx(swing({"coupled_inertia": spring}), rel=1e-3)
    assert swing({"inertia_on_rubber": spring | {"stretch": 0.02}}) > 1.2 * soft


@pytest.mark.parametrize("engine", ENGINES)
def test_drag_in_curves_grows_with_the_square_of_the_side_force(engine) -> None:
    track = drive(engine, {"curve_drag": {"share": 2.0}}, hold(8, 3, 4.0))[0]
    pushed = sum(
        (BENCH.torque_constant * i[-1] - BENCH.wheel_damping() * w[-1]) / RADIUS
        for i, w in (
            (track.current_left, track.wheel_speed_left),
            (track.current_right, track.wheel_speed_right),
        )
    )
    side = BENCH.mass * track.surge[-1] * track.yaw_rate[-1]
    assert pushed == pytest.approx(2.0 * side**2 / (BENCH.mass * GRAVITY), rel=0.03)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_wavy_floor_gives_back_what_it_takes(engine) -> None:
    """The floor takes and returns energy: the speed varies with the height, and its mean is that on a smooth floor."""
    wave = {"slope": 0.05, "wave": 0.4}
    rough, smooth = (drive(engine, h, hold(9, 9, 3.0))[0] for h in ({"floor_wavy": wave}, {}))
    last = rough.time > 1.5
    assert np.ptp(rough.surge[last]) > 0.02
    assert np.mean(rough.surge[last]) == pytest.approx(np.mean(smooth.surge[last]), rel=0.01)
    # on a slope, an accelerometer measures the push of the tyres alone, here from the torque of the motors
    push = (2 * (BENCH.torque_constant * rough.current_left - BENCH.wheel_damping() * rough.wheel_speed_left)) / RADIUS
    spin = 2 * BENCH.wheel_inertia / RADIUS * np.gradient(rough.wheel_speed_left, 0.001)
    np.testing.assert_allclose(rough.accel_surge[1000:], ((push - spin) / BENCH.mass)[1000:], atol=0.06)


def test_two_stages_of_heat_add_up() -> None:
    heat = {"winding": 120.0, "winding_time": 0.4, "case": 160.0, "case_time": 0.8}
    hidden = {"heating_in_two_stages": heat, "coulomb_friction": {"torque": 1.0}}
    track = mujoco_engine.simulate(BENCH, hidden, [hold(9, 9, 8.0)], 0)[0]
    hot = brentq(lambda r: BENCH.resistance * (1 + 0.00393 * 280.0 * 81 / r) - r, 20, 100)
    assert track.current_left[-1] == pytest.approx(9 / hot, rel=1e-3)


def test_a_sprung_load_swings_at_its_frequency_and_weighs_what_it_does() -> None:
    load = {"mass": 0.15, "frequency": 3.0, "damping": 0.02, "right": 0.0}
    track = mujoco_engine.simulate(BENCH, {"payload_sprung": load}, [hold(6, 6, 6.0)], 0)[0]
    heavier = CONDUCTANCE / (BENCH.wheel_damping(BENCH.mass + 0.15) + CONDUCTANCE * BENCH.emf_constant)
    assert track.wheel_speed_left[-1] == pytest.approx(6 * heavier, rel=2e-3)
    swing = track.surge[300:3000] - np.convolve(track.surge, np.ones(333) / 333, "same")[300:3000]
    crossings = np.flatnonzero(np.diff(np.sign(swing)))
    period = 2 * 0.001 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    rolling = BENCH.mass + 2 * BENCH.wheel_inertia / RADIUS**2
    assert 1 / period == pytest.approx(3.0 * math.sqrt(1 + 0.15 / rolling), rel=0.05)


def test_a_tyre_that_loses_air_turns_the_vehicle_more_in_later_runs() -> None:
    runs = [hold(6, 6, 2.0) for _ in range(3)]
    tracks = mujoco_engine.simulate(BENCH, {"tyre_deflating": {"rate": 0.01}}, runs, 0)
    for number, track in enumerate(tracks):
        uneven = 0.01 * 2.0 * number
        rims = [
            RADIUS * (1 + s * uneven / 2) * w[-1]
            for s, w in ((1, track.wheel_speed_left), (-1, track.wheel_speed_right))
        ]
        assert track.yaw_rate[-1] == pytest.approx((rims[0] - rims[1]) / (2 * TRACK), rel=2e-3, abs=2e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_ripple_and_cogging_have_their_wave_and_no_mean(engine) -> None:
    for hidden, cycles in (
        ({"ripple_rectified": {"amplitude": 0.4, "order": 6.0}}, 6.0),
        ({"cogging_sharp": {"torque": 0.006, "order": 6.0}}, 6.0),
    ):
        track = drive(engine, hidden, hold(3, 3, 5.0))[0]
        speed = track.wheel_speed_left[2000:]
        assert np.mean(speed) == pytest.approx(3 * FREE, rel=0.01)
        wave = speed - np.mean(speed)
        peak = np.fft.rfftfreq(len(wave), 1e-3)[np.argmax(np.abs(np.fft.rfft(wave)))]
        assert peak == pytest.approx(cycles * np.mean(speed) / (2 * math.pi), abs=0.35)


SHARED = [name for name, law in other_laws.OTHER.items() if set(law.engines) == {"mujoco", "planar"}]


@pytest.mark.parametrize("name", [name for name in SHARED if name not in sensor_laws.LAWS])
def test_both_engines_agree_on_what_a_law_changes(name) -> None:
    """The engines share no physics; the change that a law makes differs between them by less than a tenth."""
    hidden = {name: dict(other_laws.OTHER[name].effect.visible)}
    runs = [
        steps("a", 2.0, (0.03, 8, 5), (1.2, -5, -3), (1.7, 0, 0)),
        hold(1.6, -1.3, 1.5),
    ]
    if name == "floor_wavy":
        runs = runs[:1]
    moved = {}
    for engine in ENGINES:
        pairs = zip(drive(engine, hidden, *runs), drive(engine, {}, *runs), strict=True)
        moved[engine] = np.concatenate([with_it.wheel_speed_left - plain.wheel_speed_left for with_it, plain in pairs])
    size = np.sqrt(np.mean(moved["planar"] ** 2))
    assert size > 0.005
    assert np.sqrt(np.mean((moved["planar"] - moved["mujoco"]) ** 2)) < 0.1 * size + 0.002


# ---- the table

MECHANISMS = {
    "supply",
    "drive",
    "timing",
    "motor",
    "gear",
    "bearing",
    "tyre",
    "body",
    "floor",
    "sensor",
}


def test_every_effect_of_the_library_has_a_law_that_is_not_its_own() -> None:
    stands_for = {name for law in other_laws.OTHER.values() for name in law.names}
    assert stands_for == set(effects.LIBRARY)
    assert not set(other_laws.OTHER) & set(effects.TABLE)


def test_mechanisms_are_those_that_the_library_knows() -> None:
    rows = {effect.name: effect.mechanism for effect in catalogue.effects()}
    for name, law in other_laws.OTHER.items():
        assert set(law.mechanisms) <= MECHANISMS, name
        assert law.mechanisms[0] in {rows[one] for one in law.names}, name
    assert set(other_laws.ODD_MECHANISMS) == set(effects.ODD)
    assert all(set(places) <= MECHANISMS for places in other_laws.ODD_MECHANISMS.values())


def test_the_truth_says_which_law_is_whose() -> None:
    assert other_laws.told("coulomb_friction") == {
        "law": "same", "mechanisms": None, "names": ["coulomb_friction"],
    }  # fmt: skip
    assert other_laws.told("discharge_settling") == {
        "law": "other", "mechanisms": ["supply"], "names": ["battery_discharge", "battery_fade"],
    }  # fmt: skip
    assert other_laws.told("odd_tether") == {
        "law": "odd",
        "mechanisms": ["floor", "body"],
        "names": [],
    }


@pytest.mark.parametrize("name", other_laws.OTHER)
def test_every_law_shows_at_size_one(name) -> None:
    law = other_laws.OTHER[name]
    drawn = other_laws.draw(name, 1.0, BENCH, np.random.default_rng([5, 5]))
    seen = measure.visibility(Recipe("set", {name: drawn}, engine=law.engines[-1], runs=short()))
    assert max(seen.values()) >= 2.5, seen


def test_laws_of_one_engine_alone_are_refused_by_the_other() -> None:
    with pytest.raises(ValueError, match="grip_circle"):
        drive("mujoco", {"grip_circle": {"friction": 0.3}}, hold(1, 1, 0.1))
    with pytest.raises(ValueError, match="payload_sprung"):
        drive("planar", {"payload_sprung": {"mass": 0.1}}, hold(1, 1, 0.1))


def test_tracks_stay_finite() -> None:
    for name in SHARED:
        track = drive(
            "planar",
            {name: dict(other_laws.OTHER[name].effect.visible)},
            hold(9, -3, 0.3),
        )[0]
        assert all(np.isfinite(getattr(track, f.name)).all() for f in fields(track)), name


@pytest.mark.parametrize("engine", ENGINES)
def test_a_limited_current_is_met_at_a_start_and_a_reversal_alone(engine) -> None:
    limit = 2.0
    run = steps("run", 3.0, (0.2, 6, 6), (1.8, -6, 6))
    plain, limited = (drive(engine, hidden, run)[0] for hidden in ({}, {"current_limit": {"voltage": limit}}))
    most = limit / BENCH.resistance
    for track, bound in ((plain, 1.5 * most), (limited, 1.01 * most)):
        largest = max(np.abs(track.current_left).max(), np.abs(track.current_right).max())
        assert (largest <= bound) == (track is limited)
    assert limited.wheel_speed_left[170] == pytest.approx(plain.wheel_speed_left[170], rel=0.05)
