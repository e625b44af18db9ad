"""The recipe of a data set (vehicle, hidden effects, sensors), and the track that an engine returns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from hidden.manoeuvre import Manoeuvre, twelve

Floats = NDArray[np.float64]

Hidden = Mapping[str, Mapping[str, float]]
"""Effect -> its true parameters, SI, in the paper's frame (x forward, y right, yaw clockwise from above).

Names, parameters and signs are those of ``brickpilot effects``. Effects outside the library start with ``odd_``.
"""

GRAVITY = 9.81
OVERSAMPLE_S = 0.001


@dataclass(frozen=True)
class Vehicle:
    """True values, by the names of a data set's ``[nominal]`` table.

    ``rolling_friction`` is the paper's sigma (eq. 13 in eq. 14). It gives a torque m g sigma r_w^2 w at each wheel, as
    if each wheel had the whole weight. So the losses of a wheel are linear in its speed (`wheel_damping`).
    """

    mass: float = 0.6  # kg, of the whole vehicle
    yaw_inertia: float = 0.002  # kg m^2, of the whole vehicle about its centre of mass
    half_track: float = 0.07  # m
    wheel_radius: float = 0.028  # m
    wheel_inertia: float = 5e-4  # kg m^2 per side, rotor included, at the wheel
    resistance: float = 22.0  # ohm
    inductance: float = 0.01  # H
    torque_constant: float = 0.25  # N m/A at the wheel
    emf_constant: float = 0.25  # V s/rad at the wheel
    viscous_friction: float = 1e-4  # N m s/rad per side
    rolling_friction: float = 0.015  # s/m
    battery_voltage: float = 9.0  # V; a command of this voltage is full duty

    def wheel_damping(self, mass: float | None = None, radius: float | None = None) -> float:
        """Returns the viscous and rolling losses of a wheel, N m s/rad.

        Args:
            mass: kg; None: the vehicle's mass.
            radius: m; None: the vehicle's wheel radius.
        """
        load = (self.mass if mass is None else mass) * GRAVITY
        return self.viscous_friction + load * self.rolling_friction * (radius or self.wheel_radius) ** 2


@dataclass(frozen=True)
class SecondInertia:
    """A second inertia, kg m^2, coupled to a wheel by a spring, N m/rad, and a damper, N m s/rad."""

    inertia: float
    stiffness: float
    damping: float


def second_inertia(vehicle: Vehicle, share: float, period: float, damping: float) -> SecondInertia:
    """Returns a second inertia on a spring and a damper.

    Args:
        share: ratio of the second to the first inertia. The first inertia is a wheel's own inertia plus that of half
            the vehicle's mass at the wheel's radius.
        period: s, period of the free oscillation of both inertias against each other.
        damping: damping ratio of this oscillation.
    """
    first = vehicle.wheel_inertia + vehicle.mass * vehicle.wheel_radius**2 / 2
    rate, reduced = 2 * math.pi / period, share / (1 + share) * first
    return SecondInertia(share * first, reduced * rate**2, 2 * damping * rate * reduced)


BENCH = Vehicle()
RCX = Vehicle(
    mass=0.9, yaw_inertia=0.006, wheel_radius=0.0408, wheel_inertia=1e-4, torque_constant=0.195, emf_constant=0.245,
    viscous_friction=1.8e-5,
)  # fmt: skip
HEAVY = Vehicle(
    mass=1.8, yaw_inertia=0.014, half_track=0.09, wheel_radius=0.035, wheel_inertia=1.2e-3, resistance=9.0,
    inductance=0.004, torque_constant=0.3, emf_constant=0.31, viscous_friction=4e-4, rolling_friction=0.012,
)  # fmt: skip
VEHICLES = {"bench": BENCH, "rcx": RCX, "heavy": HEAVY}


def specimen(vehicle: Vehicle, random: np.random.Generator, spread: float = 0.08) -> Vehicle:
    """Returns a vehicle of this kind whose values differ by up to +-`spread`; the battery voltage is the same."""
    values = {f.name: getattr(vehicle, f.name) for f in fields(vehicle)}
    off = {name: float(value * (1 + random.uniform(-spread, spread))) for name, value in values.items()}
    return Vehicle(**{**off, "battery_voltage": vehicle.battery_voltage})


@dataclass(frozen=True)
class Track:
    """The true motion in one run: arrays (n,) at every `OVERSAMPLE_S` from 0 on; SI, the paper's frame.

    Speeds and accelerations are those of the axle's middle. ``accel_surge`` and ``accel_sway`` are the specific force
    there, as an ideal accelerometer reads it. Both and ``yaw_accel`` are means over the past millisecond.
    """

    time: Floats
    command_left: Floats  # V, commanded, held from one sample to the next
    command_right: Floats
    surge: Floats
    sway: Floats
    yaw_rate: Floats
    yaw_angle: Floats
    accel_surge: Floats
    accel_sway: Floats
    yaw_accel: Floats
    wheel_speed_left: Floats
    wheel_speed_right: Floats
    current_left: Floats
    current_right: Floats
    battery: Floats  # V at the drive
    x: Floats
    y: Floats
    oversample_s: float = OVERSAMPLE_S

    def __post_init__(self) -> None:
        lengths = {len(value) for f in fields(self) if isinstance(value := getattr(self, f.name), np.ndarray)}
        if len(lengths) != 1:
            raise ValueError(f"a track's signals have different lengths: {sorted(lengths)}")


class Engine(Protocol):
    """Drives the runs one after the other, without a pause. Each run starts at rest at the origin, with heading 0,
    wheel angles 0 and no current; heat, charge and the time since power-on carry over. Equal arguments give equal
    numbers."""

    def __call__(
        self, vehicle: Vehicle, hidden: Hidden, runs: Sequence[Manoeuvre], seed: int, sample_s: float = 0.003
    ) -> list[Track]: ...


@dataclass(frozen=True)
class Onset:
    """The moment from which the hidden effects act: `at_s` s after the start of run number `run`, and in later runs."""

    run: int
    at_s: float


@dataclass(frozen=True)
class Recipe:
    """The recipe of one data set.

    Attributes:
        name: name of its folder.
        engine: the physics, "mujoco" or "planar".
        hidden: the effects that the nominal model lacks.
        noise: ratio of the sensors' noise to their usual noise.
        nominal_error: relative sd of each nominal value about the true value.
        frame: frame of the written signals.
        quantised: whether readings are quantised to 10 bits over the range of each sensor.
        noise_sd_stated: whether dataset.toml states the noise.
        sds: the share of the nominal values that have a stated sd.
        wrong: nominal value -> its relative error. The stated sd of this value is `nominal_error`, so that discovery
            should find the error.
        called: effects of the library that cause the same difference as `wrong`.
        suite: the suite of `quick_suites` that the set belongs to; empty: none.
        begins: the moment from which the hidden effects act; None: always. Only the engine "planar" has such moments.
    """

    name: str
    hidden: Hidden = field(default_factory=dict)
    vehicle: Vehicle = BENCH
    engine: Literal["mujoco", "planar"] = "mujoco"
    sensors: Literal["imu", "imu+encoders"] = "imu+encoders"
    noise: float = 1.0
    nominal_error: float = 0.02
    frame: Literal["FLU", "FRD"] = "FRD"
    runs: tuple[Manoeuvre, ...] = field(default_factory=twelve)
    seed: int = 0
    quantised: bool = True
    noise_sd_stated: bool = True
    sample_s: float = 0.003
    sds: Literal["none", "half", "all"] = "half"
    wrong: Mapping[str, float] = field(default_factory=dict)
    called: tuple[str, ...] = ()
    suite: str = ""
    begins: Onset | None = None
