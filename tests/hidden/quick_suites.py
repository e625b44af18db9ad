"""Quick suites, each reported separately: same, other, outside, nulls, nominal and scales. A set has 8 runs of 5 s."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from hidden import effects, other_laws, scales
from hidden.manoeuvre import short, varied
from hidden.recipe import VEHICLES, Hidden, Recipe, Vehicle, specimen

Engine = Literal["mujoco", "planar"]

SIZE = 2.0
"""Size of every hidden effect. It is clearly visible, so that a missed effect is not due to a lack of data."""

PAYLOAD = 0.25
"""Payload as a share of the vehicle's mass; no nominal value includes it."""

_STREAMS = {"same": 11, "other": 12, "outside": 13, "nulls": 14, "nominal": 15, "scales": 16}
_KINDS = tuple(VEHICLES.values())
_SDS: tuple[Literal["half", "all", "none"], ...] = ("half", "all", "none")


def _set(
    suite: str, name: str, index: int, seed_offset: int, engine: Engine, kind: Vehicle, hidden: str | None = None,
    **options: object,
) -> Recipe:  # fmt: skip
    """Returns one set; suite, index and seed offset give its vehicle, voltages, noise and nominal values."""
    random = np.random.default_rng((_STREAMS[suite], seed_offset, index))
    vehicle = specimen(kind, random)
    absent = effects.TABLE[hidden].absent if hidden in effects.TABLE else ()
    vehicle = replace(vehicle, **dict.fromkeys(absent, 0.0))
    runs = scales.at_voltage(varied(short(), random), vehicle)
    drawn: Hidden = {hidden: other_laws.draw(hidden, SIZE, vehicle, random)} if hidden else {}
    plain = {"frame": "FLU" if index % 2 else "FRD", "noise_sd_stated": index % 3 != 2}
    seed = seed_offset + 1000 * _STREAMS[suite] + index
    return Recipe(
        name=f"{suite}-{name}", hidden=drawn, vehicle=vehicle, engine=engine, runs=runs, seed=seed, suite=suite,
        **{**plain, **options},  # type: ignore[arg-type]
    )  # fmt: skip


def _each(suite: str, names: Mapping[str, object], seed_offset: int, engine: Engine) -> list[Recipe]:
    return [
        _set(suite, name, index, seed_offset, engine, _KINDS[index % len(_KINDS)], name, sds=_SDS[index % 3])
        for index, name in enumerate(names)
    ]  # fmt: skip


def same(seed_offset: int = 0, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets with one effect of the library each, with wheel speeds."""
    return _each("same", effects.LIBRARY, seed_offset, engine)


def other(seed_offset: int = 0, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets with one law of `other_laws` each, if this engine can simulate the law, with wheel speeds."""
    made = _each("other", other_laws.OTHER, seed_offset, engine)
    return [recipe for recipe in made if engine in other_laws.OTHER[next(iter(recipe.hidden))].engines]


def outside(seed_offset: int = 0, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets with one effect each that no law of the library describes, with wheel speeds."""
    return _each("outside", effects.ODD, seed_offset, engine)


def nulls(seed_offset: int = 0, engine: Engine = "mujoco", count: int = 200) -> list[Recipe]:
    """Returns sets with nothing hidden: six kinds of robots and three noise levels.

    An sd is stated for half of the nominal values, for all or for none.
    """
    kinds = _KINDS + scales.KINDS
    return [
        _set(
            "nulls", f"{i:03d}", i, seed_offset, engine, kinds[i % len(kinds)],
            sensors="imu" if i % 4 == 3 else "imu+encoders", noise=(1.0, 1.0, 0.5, 2.0)[i // 6 % 4],
            quantised=i % 5 != 4, sds=_SDS[i // 2 % 3],
        )
        for i in range(count)
    ]  # fmt: skip


def nominal(seed_offset: int = 0, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets without a hidden effect but with wrong nominal values; an sd of 2 % is stated for every value."""
    without = 1 / (1 + PAYLOAD) - 1
    wrong: dict[str, dict[str, float]] = {
        "payload": {"mass": without, "yaw_inertia": 0.5 * without},
        "payload_alone": {"mass": without},
        "yaw_inertia": {"yaw_inertia": -0.25},
        "wheel_radius": {"wheel_radius": 0.1},
        "half_track": {"half_track": -0.1},
        "geometry": {"wheel_radius": -0.08, "half_track": 0.1},
        "resistance": {"resistance": -0.2},
        "motor": {"torque_constant": 0.15, "emf_constant": 0.15},
        "emf_constant": {"emf_constant": -0.15},
        "rolling_friction": {"rolling_friction": -0.5},
    }
    return [
        _set(
            "nominal",
            name,
            i,
            seed_offset,
            engine,
            _KINDS[i % len(_KINDS)],
            sds="all",
            wrong=values,
            called=("payload_mass",) if "mass" in values else (),
        )
        for i, (name, values) in enumerate(wrong.items())
    ]


def scaled(seed_offset: int = 0, engine: Engine = "mujoco") -> list[Recipe]:
    """Returns sets of robots of 0.3, 2.5 and 8 kg (6, 12, 24 V): nothing hidden, library laws, and other laws."""
    hidden: dict[str, str | None] = {
        "none": None, "coulomb_friction": "coulomb_friction", "yaw_scrub": "yaw_scrub",
        "friction_lugre": "friction_lugre", "discharge_settling": "discharge_settling", "gyro_scale": "gyro_scale",
    }  # fmt: skip
    names = ("mouse", "crawler", "rover")
    return [
        _set("scales", f"{name}-{label}", 6 * k + i, seed_offset, engine, kind, effect, sds=_SDS[i % 3])
        for k, (name, kind) in enumerate(zip(names, scales.KINDS, strict=True))
        for i, (label, effect) in enumerate(hidden.items())
    ]


SUITES = {
    "same": same, "other": other, "outside": outside, "nulls": nulls, "nominal": nominal, "scales": scaled,
}  # fmt: skip
