"""Makes a log of the true motion, with sensor errors, noise and A/D converters; computes how visible an effect is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from hidden import regions, sensor_laws
from hidden.manoeuvre import Manoeuvre
from hidden.recipe import GRAVITY, Engine, Floats, Hidden, Onset, Recipe, Track, Vehicle

NOISE_SD = {
    "accel_surge": 0.025, "accel_sway": 0.025, "yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05,
}  # fmt: skip
"""Signal -> sd of the sensor's white noise, SI, if the recipe's `noise` is 1."""

RANGE = {
    "accel_surge": 2 * GRAVITY, "accel_sway": 2 * GRAVITY, "yaw_rate": 10.47,
    "wheel_speed_left": 51.2, "wheel_speed_right": 51.2,
}  # fmt: skip
"""Signal -> largest magnitude of the sensor's readings, SI."""

BITS = 10

SEEDED = frozenset({"planar"})
"""Engines whose physics contains random vibration and roughness, and so depends on the seed."""

SENSOR_EFFECTS = frozenset(
    {"imu_lever_arm", "accel_misalignment", "imu_lag", "accel_bias", "gyro_scale", "gyro_asymmetry", "gyro_bias",
     "gyro_drift", "gyro_saturation", "encoder_scale", "speed_lag", "unsigned_sensor", "speed_delay", "gyro_delay",
     "sensor_delay", "odd_gyro_cubic", *sensor_laws.LAWS}
)  # fmt: skip
"""The effects of sensors, which act here and not in an engine."""


def resolution(signal: str) -> float:
    """Returns the converter's step for `signal`, SI."""
    return 2 * RANGE[signal] / float(2**BITS)


def engine(name: str) -> Engine:
    """Returns the engine `name` and loads the modules of this engine alone."""
    if name == "mujoco":
        from hidden import mujoco_engine

        return mujoco_engine.simulate
    if name == "planar":
        from hidden import planar_engine

        return cast(Engine, planar_engine.simulate)
    raise ValueError(f"no engine {name!r}")


def sense(tracks: Sequence[Track], recipe: Recipe) -> list[dict[str, Floats]]:
    """Returns the noise-free logs of ideal converters: for each run, signal -> (n,), sampled every `recipe.sample_s`.

    Accelerometers give the mean over the past sampling interval, like an integrating converter. Other signals are
    instantaneous.
    """
    signals, age, begins = [], 0.0, recipe.begins
    for number, track in enumerate(tracks):
        read = _sense(track, recipe, recipe.hidden if begins is None or number >= begins.run else {}, age, number)
        if begins is not None and number == begins.run:
            first = math.ceil(begins.at_s / recipe.sample_s)
            before = _sense(track, recipe, {}, age, number)
            read = {name: np.concatenate([before[name][:first], own[first:]]) for name, own in read.items()}
        signals.append(read)
        age += float(track.time[-1])
    return signals


def _sense(track: Track, recipe: Recipe, hidden: Hidden, age: float, number: int) -> dict[str, Floats]:
    fine = track.oversample_s
    hold = round(recipe.sample_s / fine)
    ideal = sensor_laws.read(track, hidden, age, number)
    surge, sway, rate = ideal.surge, ideal.sway, ideal.rate
    arm = hidden.get("imu_lever_arm")
    if arm:
        turn = rate - 0.5 * fine * track.yaw_accel  # yaw rate at mid-interval, as the accelerations are means
        surge = surge - turn**2 * arm["x"] - track.yaw_accel * arm["y"]
        sway = sway - turn**2 * arm["y"] + track.yaw_accel * arm["x"]
    angle = hidden.get("accel_misalignment", {}).get("angle", 0.0)
    surge, sway = (
        math.cos(angle) * surge + math.sin(angle) * sway,
        math.cos(angle) * sway - math.sin(angle) * surge,
    )
    lag = hidden.get("imu_lag", {}).get("time_constant", 0.0)
    if lag > 0:
        surge, sway, rate = (_lagged(values, lag, fine) for values in (surge, sway, rate))
    bias = hidden.get("accel_bias", {})
    surge, sway = surge + bias.get("surge", 0.0), sway + bias.get("sway", 0.0)
    rate = rate * (1 + hidden.get("gyro_scale", {}).get("error", 0.0))
    rate = rate + 0.5 * hidden.get("gyro_asymmetry", {}).get("difference", 0.0) * np.abs(ideal.rate)
    rate = rate + hidden.get("odd_gyro_cubic", {}).get("cubic", 0.0) * rate**3
    rate = rate + hidden.get("gyro_bias", {}).get("bias", 0.0)
    rate = rate + hidden.get("gyro_drift", {}).get("rate", 0.0) * (age + track.time)
    limit = hidden.get("gyro_saturation", {}).get("limit", math.inf)
    rate = np.clip(rate, -limit, limit)
    scale = 1 + hidden.get("encoder_scale", {}).get("error", 0.0)
    out = {"accel_surge": _mean_before(surge, hold), "accel_sway": _mean_before(sway, hold), "yaw_rate": rate}
    if recipe.sensors == "imu+encoders":
        out["wheel_speed_left"] = ideal.left * scale
        out["wheel_speed_right"] = ideal.right * scale
    out = {name: _late(name, values, hidden, track) for name, values in out.items()}
    return {name: values[::hold].copy() for name, values in out.items()}


def _late(name: str, values: Floats, hidden: Mapping[str, Mapping[str, float]], track: Track) -> Floats:
    """Returns a signal after its own lag, its own delay, and the common delay of all sensors."""
    effects, own = ["sensor_delay"], "speed_delay" if "speed" in name else "gyro_delay"
    lag = hidden.get("speed_lag", {}).get("time_constant", 0.0) if "speed" in name else 0.0
    if lag > 0:
        values = _lagged(values, lag, track.oversample_s)
    if "speed" in name:
        values = values + hidden.get("unsigned_sensor", {}).get("share", 0.0) * (np.abs(values) - values)
    if name.startswith(("wheel_speed", "yaw")):
        effects.append(own)
    for effect in effects:
        delay = hidden.get(effect, {}).get("delay", 0.0)
        if delay > 0:
            values = np.interp(track.time - delay, track.time, values)
    return values


def _lagged(values: Floats, lag: float, step: float) -> Floats:
    """Returns the values after a first-order low-pass that starts settled; exact for values linear in each step."""
    numerator, denominator, _ = cont2discrete((np.array([1.0]), np.array([lag, 1.0])), step, method="foh")
    first = values[0]
    return np.asarray(lfilter(np.ravel(numerator), denominator, values - first) + first, dtype=float)


def _mean_before(values: Floats, count: int) -> Floats:
    """Returns the mean over each value and the `count` - 1 values before it. The first `count` values are unchanged."""
    sums = np.cumsum(np.concatenate([[0.0], values]))
    out = values.copy()
    out[count:] = (sums[count + 1 :] - sums[1:-count]) / count
    return out


def log(signals: Sequence[Mapping[str, Floats]], recipe: Recipe) -> list[dict[str, Floats]]:
    """Applies noise, range and, if the recipe states it, quantisation. The noise depends on seed, run and signal."""
    out = []
    for number, run in enumerate(signals):
        logged = {}
        for index, (name, values) in enumerate(run.items()):
            random = np.random.default_rng([recipe.seed, number, index])
            noisy = values + random.normal(0.0, NOISE_SD[name] * recipe.noise, len(values))
            if recipe.quantised:
                noisy = resolution(name) * np.round(noisy / resolution(name))
            logged[name] = np.clip(noisy, -RANGE[name], RANGE[name])
        out.append(logged)
    return out


def tracks(recipe: Recipe) -> list[Track]:
    """Returns the true motion in the runs. Results are cached, because recipes often differ only in sensors."""
    physics = tuple(
        (name, tuple(sorted(values.items()))) for name, values in recipe.hidden.items() if name not in SENSOR_EFFECTS
    )
    seed = recipe.seed if recipe.engine in SEEDED else 0
    return _driven(recipe.engine, recipe.vehicle, physics, recipe.runs, seed, recipe.sample_s, recipe.begins)


@lru_cache(maxsize=4)
def _driven(
    name: str,
    vehicle: Vehicle,
    physics: tuple[tuple[str, tuple[tuple[str, float], ...]], ...],
    runs: tuple[Manoeuvre, ...],
    seed: int,
    sample_s: float,
    begins: Onset | None,
) -> list[Track]:
    hidden = {effect: dict(values) for effect, values in physics}
    if begins is None:
        return engine(name)(vehicle, hidden, runs, seed, sample_s)
    if name != "planar":
        raise ValueError(f"the engine {name!r} has no effect that begins within a run")
    from hidden import planar_engine

    return planar_engine.simulate_from(begins, vehicle, hidden, runs, seed, sample_s)


@dataclass(frozen=True)
class Shown:
    """How the hidden effects change the signals, compared with the vehicle without effects. Nothing is refitted.

    Attributes:
        visibility: signal -> rms change over all runs, in noise sd.
        regions: the spans in which a signal changes by more than the noise: see `regions`.
    """

    visibility: dict[str, float]
    regions: list[dict[str, object]]


def visibility(recipe: Recipe) -> dict[str, float]:
    """Returns signal -> rms over all runs of the change by the hidden effects, in noise sd. Nothing is refitted."""
    return shown(recipe).visibility


def shown(recipe: Recipe) -> Shown:
    """Returns the change of the signals by the hidden effects."""
    driven = tracks(recipe)
    bare = replace(recipe, hidden={}, begins=None)
    with_it, without = sense(driven, recipe), sense(tracks(bare), bare)
    moved, sds = {}, {}
    for name in with_it[0]:
        sds[name] = NOISE_SD[name] * recipe.noise
        square = np.concatenate([(a[name] - b[name]) ** 2 for a, b in zip(with_it, without, strict=True)])
        moved[name] = float(np.sqrt(square.mean())) / sds[name]
    names = [run.name for run in recipe.runs]
    return Shown(moved, regions.of(names, with_it, without, driven, sds, recipe.sample_s))
