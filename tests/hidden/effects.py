"""The effects that may be hidden: parameters at which each effect is clearly visible, and how parameters are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hidden.recipe import BENCH, Vehicle

Kind = Literal["plain", "torque", "force", "moment", "mass", "spin", "voltage", "resistance", "current", "grip"]


@dataclass(frozen=True)
class Effect:
    """How the parameters of one effect are drawn.

    Attributes:
        visible: parameters at size 1 on `recipe.BENCH`: the rms change of some signal is at least 5 sd of its noise.
        scaled: the parameters that grow with the size; the other parameters are constant.
        offset: parameter -> its value at size 0, for a limit that the effect lowers.
        signed: whether the scaled parameters may have either sign.
        ranges: parameters that are drawn uniformly for each data set.
        kind: a physical quantity. The scaled parameters are multiplied by the `strength` of this quantity on the
            vehicle, so that the effect is visible on each vehicle.
        grid: if above 0, scaled parameters are whole multiples of this number.
        absent: nominal values that must be 0 in the vehicle, because their law is the same as the law of the effect.
    """

    visible: Mapping[str, float]
    scaled: tuple[str, ...]
    offset: Mapping[str, float] = field(default_factory=dict)
    signed: bool = False
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    kind: Kind = "plain"
    grid: float = 0.0
    absent: tuple[str, ...] = ()


def _one(parameter: str, value: float, *, signed: bool = False, kind: Kind = "plain") -> Effect:
    return Effect({parameter: value}, (parameter,), signed=signed, kind=kind)


_PHASE = (-3.0, 3.0)

LIBRARY: dict[str, Effect] = {
    "start_delay": _one("delay", 0.1),
    "input_delay": _one("delay", 0.025),
    "battery_discharge": _one("slope", 0.15),
    "battery_sag": _one("resistance", 7.5),
    "pwm_quantisation": _one("step", 0.06),
    "actuator_lag": _one("time_constant", 0.025),
    "slew_limit": _one("time_per_volt", 0.017),
    "actuator_deadband": _one("voltage", 0.15),
    "motor_asymmetry": _one("difference", 0.04, signed=True),
    "direction_asymmetry": Effect({"torque": 0.003, "drag": 0.0, "gain": 0.0}, ("torque",), signed=True, kind="torque"),
    "supply_saturation": Effect({"voltage": -1.5}, ("voltage",), offset={"voltage": 7.5}),
    "pwm_coast": Effect({"period": 0.004, "brakes": 0.0}, ("period",), grid=0.001),
    "torque_constant_asymmetry": _one("difference", 0.05, signed=True),
    "motor_heating": Effect(
        {"thermal_resistance": 260.0, "time_constant": 25.0}, ("thermal_resistance",),
        ranges={"time_constant": (15, 40)},
    ),
    "torque_ripple": Effect(
        {"amplitude": 0.3, "order": 6.0, "phase": 0.0, "phase_difference": 0.0}, ("amplitude",),
        ranges={"order": (4, 9), "phase": _PHASE, "phase_difference": (-1, 1)},
    ),
    "cogging": Effect(
        {"torque": 0.008, "order": 6.0, "phase": 0.0, "phase_difference": 0.0}, ("torque",), kind="torque",
        ranges={"order": (4, 9), "phase": _PHASE, "phase_difference": (-1, 1)},
    ),
    "gear_backlash": Effect({"gap": 0.15, "rotor_share": 0.6}, ("gap",), ranges={"rotor_share": (0.4, 0.7)}),
    "coulomb_friction": _one("torque", 0.002, kind="torque"),
    "stiction_stribeck": Effect(
        {"coulomb": 0.0012, "breakaway": 0.0025, "stribeck_speed": 1.0}, ("coulomb", "breakaway"), kind="torque",
        ranges={"stribeck_speed": (0.7, 2.0)},
    ),
    "rolling_sqrt": _one("torque", 0.0006, kind="torque"),
    "constant_offset": Effect(
        {"torque": 0.006, "difference": 0.0}, ("torque", "difference"), signed=True, kind="torque",
        ranges={"difference": (0.001, 0.003)},
    ),
    "carpet_nap": Effect(
        {"force_x": 0.9, "force_y": 0.5}, ("force_x", "force_y"), signed=True, kind="force",
        ranges={"force_y": (-0.6, 0.6)},
    ),
    "caster_drag": Effect(
        {"force": 0.12, "forward": -0.08}, ("force",), kind="force", ranges={"forward": (-0.1, -0.06)}
    ),
    "yaw_scrub": _one("moment", 0.005, kind="moment"),
    "curve_scrub": _one("coefficient", 0.9),
    "quadratic_drag": _one("drag", 3.0, kind="force"),
    "floor_slope": Effect(
        {"slope_x": 0.02, "slope_y": 0.01}, ("slope_x", "slope_y"), signed=True, ranges={"slope_y": (-0.02, 0.02)}
    ),
    "com_forward_offset": _one("forward", 0.015, signed=True),
    "com_lateral_offset": _one("right", 0.015, signed=True),
    "payload_mass": Effect(
        {"mass": 0.2, "forward": 0.04, "right": 0.0}, ("mass",), kind="mass",
        ranges={"forward": (-0.05, 0.05), "right": (-0.03, 0.03)},
    ),
    "wheel_radius_mismatch": _one("mismatch", 0.05, signed=True),
    "wheel_slip": Effect({"creep": 0.1, "friction": 0.8}, ("creep",), ranges={"friction": (0.7, 1.0)}),
    "side_slip": Effect({"creep": 0.2, "friction": 0.8}, ("creep",), ranges={"friction": (0.7, 1.0)}),
    "imu_lever_arm": Effect(
        {"x": 0.03, "y": 0.015}, ("x", "y"), signed=True, ranges={"y": (-0.03, 0.03)}
    ),
    "accel_misalignment": _one("angle", 0.2, signed=True),
    "imu_lag": _one("time_constant", 0.02),
    "accel_bias": Effect({"surge": 0.15, "sway": 0.1}, ("surge", "sway"), signed=True, ranges={"sway": (-0.15, 0.15)}),
    "gyro_scale": _one("error", 0.035, signed=True),
    "gyro_bias": _one("bias", 0.08, signed=True),
    "gyro_drift": _one("rate", 0.0012, signed=True),
    "gyro_saturation": Effect({"limit": -0.9}, ("limit",), offset={"limit": 4.9}, kind="spin"),
    "encoder_scale": _one("error", 0.05, signed=True),
    "sensor_delay": _one("delay", 0.02),
    "battery_fade": _one("rate", 0.01),
    "voltage_compression": _one("compression", 0.15),
    "zero_coast": _one("share", 0.43),
    "dead_time": _one("voltage", 0.2),
    "current_limit": Effect({"voltage": -1.5}, ("voltage",), offset={"voltage": 6.0}, kind="voltage"),
    "load_friction": _one("share", 0.15),
    "viscous_loss": Effect(
        {"drag": 4e-4}, ("drag",), kind="torque", absent=("viscous_friction", "rolling_friction")
    ),
    "viscous_scrub": _one("drag", 0.002, kind="moment"),
    "surge_drag": _one("drag", 1.0, kind="force"),
    "tyre_grip": Effect({"creep": 0.1, "friction": 0.8}, ("creep",), ranges={"friction": (0.7, 1.0)}),
    "speed_lag": _one("time_constant", 0.03),
    "speed_delay": _one("delay", 0.03),
    "gyro_delay": _one("delay", 0.03),
    "coupled_inertia": Effect(
        {"period": 0.35, "share": 0.15, "damping": 0.1}, ("share",), ranges={"period": (0.23, 0.47)}
    ),
    "unsigned_sensor": _one("share", 0.43),
    "gravity_load": Effect(
        {"torque": 0.007, "level": 0.6}, ("torque",), kind="torque", ranges={"level": (-3.0, 3.0)}
    ),
    "gyro_asymmetry": _one("difference", 0.06, signed=True),
}  # fmt: skip
"""Every effect of the library that the engines can simulate, with the library's names, parameters and signs."""

ODD: dict[str, Effect] = {
    "odd_periodic_force": Effect(
        {"force": 0.5, "frequency": 1.3}, ("force",), kind="force", ranges={"frequency": (0.7, 2)}
    ),
    "odd_friction_with_voltage": _one("slope", 0.0005, kind="torque"),
    "odd_drag_patch": Effect({"drag": 6.0, "from": 0.5, "to": 1.2}, ("drag",), kind="force"),
    "odd_angle_brake": _one("torque", 0.004, kind="torque"),
    "odd_cubic_drag": _one("drag", 5.0, kind="force"),
    "odd_yaw_by_speed": _one("moment", 0.02, signed=True, kind="moment"),
    "odd_turn_force": _one("share", 0.8, signed=True),
    "odd_load_ramp": _one("rate", 0.00004, kind="torque"),
    "odd_heading_spring": _one("moment", 0.01, kind="moment"),
    "odd_tether": _one("stiffness", 1.0, kind="force"),
    "odd_voltage_gain": _one("loss", 0.01),
    "odd_crosstalk": _one("share", 0.04, signed=True),
    "odd_gyro_cubic": _one("cubic", 0.003, signed=True),
}
"""Odd effects, which are in no library. README.md describes each of them."""

TABLE = LIBRARY | ODD


def strength(kind: Kind, vehicle: Vehicle) -> float:
    """Returns the ratio of the quantity `kind` on this vehicle to the same quantity on the bench vehicle."""

    def torque(v: Vehicle) -> float:
        return v.torque_constant * v.battery_voltage / v.resistance

    def spin(v: Vehicle) -> float:
        return v.wheel_radius / (v.half_track * v.emf_constant)

    ratio = torque(vehicle) / torque(BENCH)
    force = ratio * BENCH.wheel_radius / vehicle.wheel_radius
    voltage, resistance = vehicle.battery_voltage / BENCH.battery_voltage, vehicle.resistance / BENCH.resistance
    return {
        "plain": 1.0, "torque": ratio, "force": force, "moment": force * vehicle.half_track / BENCH.half_track,
        "mass": vehicle.mass / BENCH.mass, "spin": spin(vehicle) / spin(BENCH),
        "voltage": voltage, "resistance": resistance, "current": voltage / resistance,
        "grip": force * BENCH.mass / vehicle.mass,
    }[kind]  # fmt: skip


def draw(name: str, size: float, vehicle: Vehicle, random: np.random.Generator) -> dict[str, float]:
    """Returns parameters of effect `name`: about `size` times its `visible` parameters, with random sign and spread."""
    return drawn(TABLE[name], size, vehicle, random)


def drawn(effect: Effect, size: float, vehicle: Vehicle, random: np.random.Generator) -> dict[str, float]:
    """Returns the parameters of `effect`, as `draw` does."""
    spread, sign = random.uniform(1.0, 1.15), random.choice((-1.0, 1.0))
    places = random.uniform(size=len(effect.ranges))
    values = {parameter: float(value) for parameter, value in effect.visible.items()}
    for (parameter, (low, high)), place in zip(effect.ranges.items(), places, strict=True):
        values[parameter] = float(low + place * (high - low))
    for parameter in effect.scaled:
        grown = values[parameter] * size * (sign if effect.signed else 1.0) * (spread if not effect.offset else 1.0)
        grown = (effect.offset.get(parameter, 0.0) + grown) * strength(effect.kind, vehicle)
        values[parameter] = effect.grid * max(1, round(grown / effect.grid)) if effect.grid else grown
    return values
