"""The filter over the compiled plant, on data with process noise that an integration written apart from it has made."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brickpilot import catalogue
from brickpilot.errors import SimulationError
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, simulate
from brickpilot.vehicle.predictor import ProcessNoise, Readings, predict
from numpy.typing import NDArray

Array = NDArray[np.float64]

R, KT, J, B = 22.0, 0.25, 5e-4, 1e-4  # ohm, N m/A, kg m^2, N m s/rad
MASS, YAW_INERTIA, TRACK, RADIUS = 0.6, 0.002, 0.07, 0.028
FINE = 50  # steps of the integration for each sample
NOISE = 0.05  # rad/s
WHITE = 3e-4  # N m root(s)
DECAY, MOMENT = 0.4, 0.004  # s, N m


def motor(**changed: float) -> Model:
    values = {
        "resistance": R,
        "torque_constant": KT,
        "emf_constant": KT,
        "wheel_inertia": J,
        "viscous_friction": B,
    }
    return Model(
        "bench",
        "motor",
        "coupled",
        catalogue.presets("motor") | values | {"inductance": 0.0} | changed,
    )


def drive() -> Model:
    values = {
        "mass": MASS,
        "yaw_inertia": YAW_INERTIA,
        "half_track": TRACK,
        "wheel_radius": RADIUS,
    }
    values |= {
        "resistance": R,
        "torque_constant": KT,
        "emf_constant": KT,
        "wheel_inertia": J,
        "viscous_friction": B,
    }
    values |= {"inductance": 0.0, "rolling_friction": 0.0, "drag_area": 0.0}
    return Model("drive", "diff_drive", "coupled", catalogue.presets("diff_drive") | values)


def motor_run(seed: int, samples: int = 2000) -> Readings:
    """Euler and Maruyama with small steps: J w' = K_t / R (V - K_t w) - B w + white torque."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.006, 0.014, samples))
    volts = np.repeat(random.uniform(-8, 8, samples // 40), 40)[:, np.newaxis]
    speed, speeds = 0.0, np.zeros(samples)
    for k in range(samples - 1):
        h = (time[k + 1] - time[k]) / FINE
        for kick in random.normal(size=FINE) * WHITE * h**0.5:
            speed += (h * (KT / R * (volts[k, 0] - KT * speed) - B * speed) + kick) / J
        speeds[k + 1] = speed
    run = OpenLoopRun(time, volts)
    return Readings(run, {"speed": speeds + NOISE * random.normal(size=samples)})


def drive_run(seed: int, samples: int = 1500) -> tuple[Readings, Array]:
    """Sum and difference of the wheels, with a moment on the yaw that comes and goes. Returns the moment, too."""
    random = np.random.default_rng(seed)
    time, dt = 0.01 * np.arange(samples), 0.01
    volts = np.repeat(random.uniform(-7, 7, (samples // 50, 2)), 50, axis=0)
    inertia = np.array([J + MASS * RADIUS**2 / 2, J + YAW_INERTIA * RADIUS**2 / (2 * TRACK**2)])  # of sum, difference
    moment, moments = MOMENT * random.normal(), np.zeros(samples)
    state, speeds = np.zeros(2), np.zeros((samples, 2))
    for k in range(samples):
        speeds[k], moments[k] = [state[0] + state[1], state[0] - state[1]], moment
        both = np.array([volts[k].mean(), (volts[k, 0] - volts[k, 1]) / 2])
        push = np.array([0.0, RADIUS / (2 * TRACK) * moment])
        for _ in range(FINE):
            state = state + dt / FINE * (KT / R * (both - KT * state) - B * state + push) / inertia
        keep = np.exp(-dt / DECAY)
        moment = keep * moment + MOMENT * (1 - keep**2) ** 0.5 * random.normal()
    noisy = speeds + NOISE * random.normal(size=speeds.shape)
    run = OpenLoopRun(time, volts)
    return Readings(run, {"wheel_speed_left": noisy[:, 0], "wheel_speed_right": noisy[:, 1]}), moments


MOTOR_NOISE = ProcessNoise(noise={"speed": NOISE}, white={"torque_left": WHITE})


def log_likelihood(readings: list[Readings], model: Model, noise: ProcessNoise) -> float:
    return sum(one.log_likelihood for one in predict(model, readings, noise))


def test_innovations_are_white_and_as_large_as_the_filter_says() -> None:
    (found,) = predict(motor(), [motor_run(1)], MOTOR_NOISE)
    scaled = (found.innovation["speed"] / found.innovation_sd["speed"])[1:]
    assert found.count == len(scaled) == 1999
    assert np.mean(scaled**2) == pytest.approx(1, abs=0.1)
    correlation = [np.mean(scaled[lag:] * scaled[:-lag]) for lag in range(1, 21)]
    assert np.max(np.abs(correlation)) < 3.5 / len(scaled) ** 0.5
    free = predict(motor(), [motor_run(1)], ProcessNoise(noise={"speed": NOISE}))[0]
    coloured = (free.innovation["speed"] / NOISE)[1:]
    assert np.mean(coloured[1:] * coloured[:-1]) > 0.5 * np.mean(coloured**2)
    assert np.mean(coloured**2) > 5


@pytest.mark.parametrize("name", ["resistance", "wheel_inertia", "torque_constant"])
def test_likelihood_is_largest_near_the_true_parameter(name: str) -> None:
    runs = [motor_run(seed) for seed in (2, 3)]
    factors = np.array([0.9, 0.97, 1.0, 1.03, 1.1])
    truth = motor().parameters[name]
    values = [log_likelihood(runs, motor(**{name: truth * factor}), MOTOR_NOISE) for factor in factors]
    peak = np.polyfit(factors, values, 2)
    assert peak[0] < 0
    assert -peak[1] / (2 * peak[0]) == pytest.approx(1, abs=0.03)


def test_likelihood_is_largest_near_the_true_noises() -> None:
    runs = [motor_run(seed) for seed in (4, 5)]

    def at(white: float, noise: float) -> float:
        return log_likelihood(
            runs,
            motor(),
            ProcessNoise(noise={"speed": noise * NOISE}, white={"torque_left": white * WHITE}),
        )

    best = at(1, 1)
    assert min(best - at(1.3, 1), best - at(0.7, 1), best - at(1, 1.2), best - at(1, 0.8)) > 5


def test_the_moment_that_acted_is_found_again_within_its_sd() -> None:
    readings, moments = drive_run(6)
    noise = ProcessNoise(
        noise=dict.fromkeys(readings.measured, NOISE),
        lasting={"moment_yaw": MOMENT, "force_surge": 0.01},
        decay_s=DECAY,
    )
    (found,) = predict(drive(), [readings], noise, smooth=True)
    error = found.smoothed["moment_yaw"] - moments
    assert np.corrcoef(found.smoothed["moment_yaw"], moments)[0, 1] > 0.9
    assert np.mean(np.abs(error) < 2 * found.smoothed_sd["moment_yaw"]) == pytest.approx(0.95, abs=0.03)
    assert found.slopes is not None
    assert abs(found.slopes.lasting["moment_yaw"] * MOMENT**2) < 30  # near the top; 700 at half the sd
    surge = dataclasses.replace(noise, lasting={"force_surge": 0.05})
    assert predict(drive(), [readings], surge)[0].log_likelihood < found.log_likelihood - 1000


def test_predictions_ahead_without_a_horizon_are_a_free_run() -> None:
    readings, _ = drive_run(7, 300)
    noise = ProcessNoise(noise=dict.fromkeys(readings.measured, NOISE), lasting={"moment_yaw": MOMENT})
    (ahead,) = predict(drive(), [readings], noise, horizon_s=0.0)
    free = simulate([(drive(), readings.run)])[0].outputs
    for name in readings.measured:
        np.testing.assert_array_equal(ahead.ahead[name], free[name])
    (short,) = predict(drive(), [readings], noise, horizon_s=0.1)
    name = "wheel_speed_left"
    measured = readings.measured[name]
    assert np.std(measured - short.ahead[name]) < 0.75 * np.std(measured - ahead.ahead[name])


def test_a_signal_that_the_vehicle_lacks_is_an_error() -> None:
    readings = dataclasses.replace(motor_run(8, 120), measured={"yaw_rate": np.zeros(120)})
    with pytest.raises(SimulationError):
        predict(motor(), [readings], ProcessNoise(noise={"yaw_rate": 1.0}))
