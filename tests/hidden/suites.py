"""Lists of recipes. Thresholds are set with other seeds than those of reported results: see `CALIBRATION`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from hidden import effects, quick_suites
from hidden.manoeuvre import short, twelve, varied
from hidden.recipe import BENCH, VEHICLES, Recipe, specimen

CALIBRATION, REPORT = 0, 1_000_000
"""Seed offsets: one for setting thresholds, one for reported results. All other offsets are free to use."""

SIZES = (0.25, 0.5, 1.0, 2.0)
Engine = Literal["mujoco", "planar"]
Sensors = Literal["imu", "imu+encoders"]
_SENSORS: dict[str, Sensors] = {"enc": "imu+encoders", "imu": "imu"}
_KINDS = tuple(VEHICLES.values())
_STREAMS = {"single": 1, "pairs": 2, "triples": 3, "none": 4, "odd": 5}

PAIR_GROUPS: tuple[tuple[str, ...], ...] = (
    ("coulomb_friction", "rolling_sqrt", "stiction_stribeck", "caster_drag", "direction_asymmetry"),
    ("motor_asymmetry", "wheel_radius_mismatch", "com_lateral_offset"),
    ("battery_sag", "supply_saturation", "actuator_deadband", "pwm_quantisation"),
    ("battery_discharge", "motor_heating", "gyro_drift"),
    ("input_delay", "actuator_lag"),
    ("quadratic_drag", "curve_scrub", "side_slip"),
    ("yaw_scrub", "com_forward_offset", "payload_mass"),
    ("floor_slope", "carpet_nap"),
    ("imu_lever_arm", "accel_misalignment"),
    ("gyro_bias", "gyro_saturation", "accel_bias"),
    ("cogging", "torque_ripple"),
)
"""Each group holds effects that mask each other. Effects that are hidden together come from different groups."""

_NEVER = {frozenset(pair) for pair in (("side_slip", "caster_drag"), ("side_slip", "carpet_nap"))}


def _recipe(
    name: str, hidden: list[tuple[str, float]], stream: tuple[int, ...], noise_seed: int, engine: Engine,
    sensors: Sensors, kind: int = 0, **options: float | bool | str,
) -> Recipe:  # fmt: skip
    """Returns a recipe. `stream` seeds vehicle, runs and effects; `noise_seed` seeds noise and nominal errors."""
    random = np.random.default_rng(stream)
    vehicle = specimen(_KINDS[kind % len(_KINDS)], random)
    vehicle = replace(vehicle, **{value: 0.0 for effect, _ in hidden for value in effects.TABLE[effect].absent})
    runs = varied(twelve(), random)
    drawn = {effect: effects.draw(effect, size, vehicle, random) for effect, size in hidden}
    return Recipe(
        name=name, hidden=drawn, vehicle=vehicle, engine=engine, sensors=sensors, runs=runs, seed=noise_seed, **options  # type: ignore[arg-type]
    )  # fmt: skip


def _graded(
    table: tuple[str, ...], sizes: tuple[float, ...], suite: str, seed_offset: int, engine: Engine
) -> list[Recipe]:
    """Returns a recipe for each effect, size and sensor set. An effect has the same vehicle and sign at all sizes."""
    out = []
    for index, effect in enumerate(table):
        for size in sizes:
            seed = seed_offset + 100 * index + round(10 * size)
            frame = "FLU" if index % 2 else "FRD"
            for label, sensors in _SENSORS.items():
                out.append(
                    _recipe(
                        f"{effect}-x{size:g}-{label}",
                        [(effect, size)],
                        (_STREAMS[suite], seed_offset, index),
                        seed,
                        engine,
                        sensors,
                        kind=index,
                        frame=frame,
                        noise_sd_stated=index % 3 != 2,
                    )
                )
    return out


def single(seed_offset: int = CALIBRATION, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets with one effect of the library each, at sizes `SIZES`, with and without wheel speeds."""
    return _graded(tuple(effects.LIBRARY), SIZES, "single", seed_offset, engine)


def odd(seed_offset: int = CALIBRATION, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets with one odd effect each, at half to twice the visible size, with and without wheel speeds."""
    return _graded(tuple(effects.ODD), SIZES[1:], "odd", seed_offset, engine)


def none(seed_offset: int = CALIBRATION, engine: Engine = "mujoco", count: int = 200) -> list[Recipe]:
    """Returns sets with nothing hidden: `count` with nominal errors of 2 %, `count` / 10 each with 0 % and with 5 %."""
    plan = [(2, i) for i in range(count)] + [(percent, i) for percent in (0, 5) for i in range(count // 10)]
    out = []
    for percent, i in plan:
        seed = seed_offset + 10_000 * percent + i
        out.append(
            _recipe(
                f"none-{percent}pc-{i:03d}",
                [],
                (_STREAMS["none"], seed),
                seed,
                engine,
                "imu+encoders" if i % 2 else "imu",
                kind=i // 2,
                nominal_error=percent / 100,
                noise=(1.0, 1.0, 0.5, 2.0)[i // 6 % 4],
                frame="FLU" if i // 3 % 2 else "FRD",
                quantised=i % 5 != 4,
                noise_sd_stated=i % 4 != 3,
            )
        )
    return out


def _several(suite: str, at_once: int, count: int, seed_offset: int, engine: Engine) -> list[Recipe]:
    out = []
    for i in range(count):
        seed = seed_offset + i
        random = np.random.default_rng([_STREAMS[suite], seed, 7])
        chosen: list[str] = []
        while not chosen or any(never <= set(chosen) for never in _NEVER):
            groups = random.choice(len(PAIR_GROUPS), at_once, replace=False).tolist()
            chosen = [str(random.choice(PAIR_GROUPS[group])) for group in groups]
        for label, sensors in _SENSORS.items():
            out.append(
                _recipe(
                    f"{suite}-{i:02d}-{'+'.join(sorted(chosen))}-{label}",
                    [(effect, 1.0) for effect in chosen],
                    (_STREAMS[suite], seed),
                    seed,
                    engine,
                    sensors,
                    kind=i,
                )
            )
    return out


def pairs(seed_offset: int = CALIBRATION, engine: Engine = "mujoco", count: int = 60) -> list[Recipe]:
    """Returns sets with two effects, both clearly visible, with and without wheel speeds."""
    return _several("pairs", 2, count, seed_offset, engine)


def triples(seed_offset: int = CALIBRATION, engine: Engine = "mujoco", count: int = 12) -> list[Recipe]:
    """Returns sets with three effects."""
    return _several("triples", 3, count, seed_offset, engine)


def ci(seed_offset: int = CALIBRATION, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns eight small fixed sets for continuous integration: eight runs of 5 s with the bench vehicle."""

    def small(name: str, sensors: Sensors, seed: int, hidden: dict[str, dict[str, float]]) -> Recipe:
        return Recipe(name, hidden, BENCH, engine, sensors, runs=short(), seed=seed_offset + seed)

    return [
        small("ci-none-enc", "imu+encoders", 1, {}),
        small("ci-none-imu", "imu", 2, {}),
        small("ci-coulomb_friction-enc", "imu+encoders", 3, {"coulomb_friction": {"torque": 0.005}}),
        small("ci-motor_asymmetry-enc", "imu+encoders", 4, {"motor_asymmetry": {"difference": -0.07}}),
        small("ci-gyro_bias-imu", "imu", 5, {"gyro_bias": {"bias": 0.12}}),
        small("ci-input_delay-enc", "imu+encoders", 6, {"input_delay": {"delay": 0.04}}),
        small(
            "ci-coulomb_friction+gyro_scale-enc", "imu+encoders", 7,
            {"coulomb_friction": {"torque": 0.005}, "gyro_scale": {"error": -0.06}},
        ),
        small("ci-odd_yaw_by_speed-enc", "imu+encoders", 8, {"odd_yaw_by_speed": {"moment": 0.05}}),
    ]  # fmt: skip


SUITES: dict[str, Callable[..., list[Recipe]]] = {
    "single": single, "pairs": pairs, "triples": triples, "none": none, "odd": odd, "ci": ci, **quick_suites.SUITES,
}  # fmt: skip
