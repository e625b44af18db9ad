"""Feedback loops, coloured noise and periods are found in logs that have them, and not found in other logs."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.data.feedback import follows_outputs
from brickpilot.data.periods import _power_at_multiples, own_period
from brickpilot.discover.numbers import STRICT
from brickpilot.discover.prepare import calibrate, in_closed_loop, prepare
from brickpilot.fit.robust import noise_model, whitening
from importing import import_wpilib
from scipy.signal import lfilter, lombscargle

DATA = Path(os.environ.get("BRICKPILOT_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))

measured = pytest.mark.skipif(not (DATA / "linear_axis").is_dir(), reason=f"no measured sets in {DATA}")

ROWS, STEP = 600, 0.01  # number of samples of a simulated run, and sampling interval, s


def motor(command, rng, *, noise=0.1, disturbance=1.0, resolution=0.0, late=False):
    """Returns voltage, V, and measured speed, rad/s, (ROWS,) each, of a first-order motor: 2 rad/s per V, 0.1 s.

    Args:
        command: function of row and latest reading that returns the voltage, V.
        noise: sd of the reading's noise, rad/s.
        disturbance: size of a random load with a time constant of 0.3 s; it acts like a voltage.
        late: whether a row has the reading after its command acted, as some loggers write it; else the one before.
    """
    speed, load, volts, readings = 0.0, 0.0, np.empty(ROWS), np.empty(ROWS)

    def read():
        reading = speed + noise * rng.standard_normal()
        return resolution * round(reading / resolution) if resolution else reading

    for row in range(ROWS):
        readings[row] = read()
        volts[row] = command(row, readings[row])
        load += -load * STEP / 0.3 + disturbance * np.sqrt(STEP) * rng.standard_normal()
        speed += (2.0 * volts[row] + load - speed) * STEP / 0.1
        if late:
            readings[row] = read()
    return volts, readings


def frames(runs):
    tables = {
        f"run_{number}": pd.DataFrame({"time": STEP * np.arange(ROWS), "voltage": volts, "speed": speed})
        for number, (volts, speed) in enumerate(runs)
    }
    return bp.Dataset.from_frames(tables, vehicle="motor")


def plan(kind, rng):
    time = STEP * np.arange(ROWS)
    if kind == "step":
        return np.where(time > 0.3, rng.uniform(2, 8), 0.0)
    if kind == "ramp":
        return np.clip(rng.uniform(1, 3) * time - 1.0, 0.0, 9.0)
    if kind == "random steps":
        return np.repeat(rng.uniform(-8, 8, ROWS), rng.integers(5, 20))[:ROWS]
    if kind == "bang-bang":
        return np.repeat(5.0 * (-1.0) ** np.arange(ROWS), 3 + rng.exponential(20, ROWS).astype(int))[:ROWS]
    waves = [np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in rng.uniform(0.2, 8, 8)]
    if kind == "multisine":
        return sum(waves)
    return 5.0 * waves[0] if kind == "sine" else np.round(100.0 * waves[0]) / 20.0


def controller(rng, *, integral=4.0, gain=0.5, every=1, delay=0, resolution=0.0, steady=False, speed=None):
    target = (
        np.full(ROWS, speed or rng.uniform(2, 8)) if steady or speed else np.repeat(rng.uniform(2, 8, 6), ROWS // 6)
    )
    read, state = [], {"sum": 0.0, "volts": 0.0}

    def command(row, reading):
        read.append(reading)
        if row % every == 0:
            error = target[row] - read[max(row - delay, 0)]
            state["sum"] += integral * error * STEP * every
            volts = np.clip(gain * error + state["sum"], -9.0, 9.0)
            state["volts"] = resolution * round(volts / resolution) if resolution else volts
        return state["volts"]

    return command


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("kind", ["step", "ramp", "random steps", "multisine", "bang-bang", "sine", "quantised sine"])
def test_no_loop_in_a_plan(kind, late):
    for seed in range(4):
        rng = np.random.default_rng([seed, late])
        plans = [plan(kind, rng) for _ in range(3)]
        runs = [motor(lambda row, _, volts=volts: volts[row], rng, late=late) for volts in plans]
        assert follows_outputs(frames(runs), STRICT) is None, seed


@pytest.mark.parametrize(
    ("law", "reading", "lag"),
    [
        ({"integral": 0.0, "gain": 1.0}, {}, 0.0),
        ({"integral": 0.0, "gain": 1.0, "steady": True}, {}, 0.0),
        ({"integral": 0.0, "gain": 1.0, "speed": 5.0}, {}, 0.0),
        ({}, {}, 0.0),
        ({"steady": True}, {}, 0.0),
        ({"speed": 5.0}, {}, 0.0),
        ({"delay": 2}, {}, None),
        ({"resolution": 0.05}, {}, 0.0),
        ({}, {"resolution": 0.3}, 0.0),
        ({"every": 5, "steady": True}, {}, None),
    ],
    ids=[
        "P",
        "P, steady",
        "P, same",
        "PI",
        "PI, steady",
        "PI, same",
        "delayed",
        "coarse volts",
        "coarse reading",
        "slow",
    ],
)
def test_loop_of_a_controller(law, reading, lag):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        loop = follows_outputs(frames([motor(controller(rng, **law), rng, **reading) for _ in range(3)]), STRICT)
        assert loop is not None, seed
        assert (loop.command, loop.output) == ("voltage", "speed")
        assert 0.05 < loop.gain <= 1.0
        assert lag is None or loop.lag == pytest.approx(lag)
        assert "follows speed" in loop.sentence


@pytest.mark.parametrize(("disturbance", "innovations"), [(0.0, False), (1.0, True)])
def test_only_noise_with_a_memory_asks_for_innovations(disturbance, innovations):
    """White sensor noise does not predict the next sample, even if a controller reacts to the noise. A load does."""
    rng = np.random.default_rng(5)
    runs = [motor(controller(rng, gain=1.5), rng, noise=0.3, disturbance=disturbance) for _ in range(3)]
    prepared, nominal = calibrate(prepare(frames(runs), None, seed=0, jobs=1)[0])
    ready, _ = in_closed_loop(prepared, nominal, nominal)
    assert ready.loop is not None
    assert ready.loop.gain > 0.2
    assert ready.innovations == innovations


def test_a_disturbance_with_a_period_asks_for_innovations_at_once():
    rng = np.random.default_rng(6)
    runs = []
    for _ in range(3):
        swing = 0.6 * np.sin(2 * np.pi * STEP * np.arange(ROWS) / 0.25 + rng.uniform(0, 6))
        law = controller(rng, gain=1.5)
        runs.append(motor(lambda row, reading, law=law, swing=swing: law(row, reading + swing[row]), rng, noise=0.1))
        runs[-1] = (runs[-1][0], runs[-1][1] + swing)
    prepared, nominal = calibrate(prepare(frames(runs), None, seed=0, jobs=1)[0])
    assert in_closed_loop(prepared, nominal, None)[0].innovations


def test_two_wheels_of_which_one_is_controlled():
    rng = np.random.default_rng(3)
    tables = {}
    for number in range(3):
        left, right = motor(controller(rng), rng), plan("random steps", rng)
        other = motor(lambda row, _, volts=right: volts[row], rng)
        values = {"voltage_left": left[0], "voltage_right": right, "wheel_speed_left": left[1]}
        tables[f"run_{number}"] = pd.DataFrame(
            {"time": STEP * np.arange(ROWS), **values, "wheel_speed_right": other[1]}
        )
    loop = follows_outputs(bp.Dataset.from_frames(tables, vehicle="diff_drive"), STRICT)
    assert loop is not None
    assert (loop.command, loop.output) == ("voltage_left", "wheel_speed_left")


def test_a_controller_that_reads_another_motor_is_no_loop():
    """No loop is found if each run has the outputs of another run with the same controller."""
    rng = np.random.default_rng(5)
    runs = [motor(controller(rng), rng) for _ in range(4)]
    assert follows_outputs(frames(runs), STRICT) is not None
    others = [runs[-1], *runs[:-1]]
    assert (
        follows_outputs(frames([(one[0], other[1]) for one, other in zip(runs, others, strict=True)]), STRICT) is None
    )


@measured
@pytest.mark.parametrize(
    ("name", "command", "output"),
    [
        ("shaft_damper_off", "duty", "speed"),
        ("shaft_damper_on", "duty", "speed"),
        ("linear_axis", "voltage", "position"),
        ("micromouse_wheels", "duty_right", "wheel_speed_right"),
    ],
)
def test_measured_loops(name, command, output):
    loop = follows_outputs(bp.read(DATA / name), STRICT)
    assert loop is not None
    assert (loop.command, loop.output) == (command, output)


OPEN = (
    "wheel_in_air", "wheel_on_ground", "geared_motor", "coupled_drives_1", "coupled_drives_2", "lego_ev3_motor",
    "micromouse", "balancer_wheel",
)  # fmt: skip


@measured
@pytest.mark.parametrize("name", OPEN)
def test_measured_plans(name):
    assert follows_outputs(bp.read(DATA / name), STRICT) is None


@measured
def test_a_battery_that_sags_is_no_loop(tmp_path, full):
    files = [DATA / "frc_drivetrain" / f"{name}-data.json" for name in (("linear", "angular") if full else ("linear",))]
    import_wpilib(files, tmp_path / "frc")
    assert follows_outputs(bp.read(tmp_path / "frc"), STRICT) is None


def test_noise_model_finds_an_ar_2_and_its_residual_is_white():
    rng = np.random.default_rng(1)
    runs = [lfilter([1.0], [1.0, -1.5, 0.8], rng.standard_normal(n + 300))[300:] for n in (300, 700, 900)]
    found = noise_model(runs, 10)
    assert found[:2] == pytest.approx([1.5, -0.8], abs=0.06)
    assert np.all(np.abs(found[2:]) < 0.1)
    assert np.all(np.abs(np.roots([1.0, *-found])) < 1.0)
    for run in runs:
        white = whitening(found, len(run)) @ (run - run.mean())
        assert np.std(white) == pytest.approx(1.0, rel=0.12)
        ahead = [float(white[lag:] @ white[:-lag] / (white @ white)) for lag in (1, 2, 3)]
        assert np.max(np.abs(ahead)) < 3.5 / len(run) ** 0.5


def test_white_noise_has_no_coefficients_and_needs_no_whitening():
    found = noise_model([np.random.default_rng(2).standard_normal(500)], 6)
    assert found.size == 0
    assert np.array_equal(whitening(found, 4).toarray(), np.eye(4))


def test_whitening_is_exact_from_the_first_sample():
    """Whitening turns the covariance of an AR(2) process into the identity matrix. The covariance comes from the
    impulse response of the process."""
    coefficients, length = np.array([1.5, -0.8]), 6
    response = lfilter([1.0], [1.0, *-coefficients], np.eye(1, 2000)[0])
    acf = np.array([response[: 2000 - lag] @ response[lag:] for lag in range(length)])
    covariance = acf[np.abs(np.subtract.outer(np.arange(length), np.arange(length)))]
    matrix = whitening(coefficients, length)
    assert (matrix @ covariance @ matrix.T) == pytest.approx(np.eye(length), abs=1e-9)
    assert whitening(coefficients, 1).toarray() == pytest.approx(np.array([[acf[0] ** -0.5]]))


def test_own_period_is_found_and_measured():
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.012, 0.018, 1500))
    left = [0.4 * np.sin(2 * np.pi * 3.67 * time + phase) + rng.standard_normal(1500) for phase in (0.0, 1.0, 2.0)]
    left[1][100:130] = np.nan
    found = own_period([(time, one) for one in left], STRICT)
    assert found is not None
    assert found.frequency == pytest.approx(3.67, abs=0.01)
    assert found.amplitude == pytest.approx(0.4, rel=0.15)
    assert found.share == pytest.approx(0.08 / 1.08, rel=0.3)
    assert "3.67 Hz" in found.sentence


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_noise_has_no_period_of_its_own(memory):
    """At most 3 of 100 noise signals have a false period. At a level of 1 %, 4 or more have a probability of 2 %."""
    found = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        runs = [(np.cumsum(rng.uniform(0.014, 0.018, 400)), lfilter([1], [1, -memory], rng.standard_normal(400)))]
        found += own_period(runs, STRICT) is not None
    assert found <= 3


@pytest.mark.parametrize("timing", ["even", "with a hole", "uneven"])
def test_the_power_is_that_of_lomb_and_scargle(timing):
    """The power equals that of scipy, which takes gigabytes for a long run. Here uneven samples are moved by at most a
    64th of a period, so there the power is an approximation."""
    rng = np.random.default_rng(4)
    time = np.linspace(0.0, 10.0, 1001) + (rng.uniform(-0.004, 0.004, 1001) if timing == "uneven" else 0.0)
    time = np.delete(time, slice(300, 350)) if timing == "with a hole" else time - time[0]
    left = rng.standard_normal(len(time))
    fast = _power_at_multiples(time, left, 10.0, 499)
    exact = lombscargle(time, left, 2 * np.pi * np.arange(1, 500) / 10.0) / np.mean(left**2)
    assert fast == pytest.approx(exact, abs=0.25 if timing == "uneven" else 1e-9)
    assert np.median(np.abs(fast - exact)) < 0.02


def test_a_long_run_takes_little_memory():
    """A search for a period in 20,000 samples takes less than 100 MB. A table of samples by frequencies takes GB."""
    time = np.arange(20_000) * 1e-3
    left = np.random.default_rng(5).standard_normal(len(time))
    tracemalloc.start()
    own_period([(time, left)], STRICT)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100e6


@measured
@pytest.mark.parametrize("name", ["shaft_damper_off", "shaft_damper_on"])
def test_the_shafts_have_a_period(name):
    found = own_period([(run.time, run.outputs["speed"]) for run in bp.read(DATA / name).runs], STRICT)
    assert found is not None
    assert found.frequency == pytest.approx(3.67, abs=0.05)
