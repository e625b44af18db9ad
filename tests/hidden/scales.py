"""Robots of other scales: 0.3 to 8 kg, 6 to 24 V. Relative to sensor ranges, all robots are equally fast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hidden.manoeuvre import Manoeuvre
from hidden.recipe import BENCH, Vehicle

MOUSE = Vehicle(
    mass=0.3, yaw_inertia=0.0006, half_track=0.045, wheel_radius=0.016, wheel_inertia=6e-5, resistance=18.0,
    inductance=0.004, torque_constant=0.145, emf_constant=0.15, viscous_friction=3e-5, rolling_friction=0.02,
    battery_voltage=6.0,
)  # fmt: skip
CRAWLER = Vehicle(
    mass=2.5, yaw_inertia=0.03, half_track=0.13, wheel_radius=0.05, wheel_inertia=2.5e-3, resistance=6.0,
    inductance=0.004, torque_constant=0.31, emf_constant=0.32, viscous_friction=1e-3, rolling_friction=0.012,
    battery_voltage=12.0,
)  # fmt: skip
ROVER = Vehicle(
    mass=8.0, yaw_inertia=0.24, half_track=0.2, wheel_radius=0.075, wheel_inertia=0.02, resistance=5.0,
    inductance=0.005, torque_constant=0.62, emf_constant=0.65, viscous_friction=8e-3, rolling_friction=0.012,
    battery_voltage=24.0,
)  # fmt: skip
KINDS = (MOUSE, CRAWLER, ROVER)


def at_voltage(runs: Sequence[Manoeuvre], vehicle: Vehicle) -> tuple[Manoeuvre, ...]:
    """Returns the runs with their commands scaled from the bench vehicle's battery to this vehicle's battery."""
    share = vehicle.battery_voltage / BENCH.battery_voltage
    return tuple(
        replace(run, left=tuple(share * v for v in run.left), right=tuple(share * v for v in run.right))
        for run in runs
    )  # fmt: skip
