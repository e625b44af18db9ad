"""Laws that are not in the library. Each acts at the same place as an effect of the library, but by another equation.

A law has its own name. Its entry states its mechanism, and the names of the library's effects that count as right
answers. An odd law has no right name. The parameters are for size 1 on `recipe.BENCH`, as in `effects.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hidden import effects
from hidden.effects import Effect
from hidden.recipe import Vehicle

Relation = Literal["same", "other", "odd"]
BOTH = ("mujoco", "planar")


@dataclass(frozen=True)
class Law:
    """A law that no effect of the library has.

    Attributes:
        effect: the rule by which the law's parameters are drawn.
        mechanisms: first the mechanism in which the law acts, then mechanisms with laws that give the same signals.
        names: effects of the library that the law replaces; empty: the law is odd.
        engines: the engines that can simulate the law.
    """

    effect: Effect
    mechanisms: tuple[str, ...]
    names: tuple[str, ...] = ()
    engines: tuple[str, ...] = BOTH


def _law(
    values: Mapping[str, float], scaled: str, mechanisms: str, names: str, *, engines: tuple[str, ...] = BOTH,
    signed: bool = False, kind: effects.Kind = "plain", offset: Mapping[str, float] | None = None,
) -> Law:  # fmt: skip
    entry = Effect(values, tuple(scaled.split()), offset=offset or {}, signed=signed, kind=kind)
    return Law(entry, tuple(mechanisms.split()), tuple(names.split()), engines)


MUJOCO, PLANAR = ("mujoco",), ("planar",)

OTHER: dict[str, Law] = {
    # timing
    "start_delay_by_run": _law({"delay": 0.12, "spread": 0.8}, "delay", "timing", "start_delay"),
    "command_jitter": _law({"delay": 0.03, "jitter": 0.025}, "delay jitter", "timing sensor", "input_delay"),
    # supply
    "discharge_settling": _law(
        {"drop": 0.5, "time_constant": 12.0}, "drop", "supply", "battery_discharge battery_fade", kind="voltage"
    ),
    "sag_with_memory": _law(
        {"resistance": 3.0, "slow": 4.0, "time_constant": 1.0}, "resistance slow", "supply", "battery_sag",
        kind="resistance",
    ),
    # drive
    "slew_when_driving": _law({"time": 0.25}, "time", "drive", "slew_limit actuator_lag"),
    "current_cut_softly": _law(
        {"voltage": 1.0, "share": 0.4}, "share", "drive", "current_limit voltage_compression"
    ),
    "deadband_sloped": _law({"voltage": 1.0}, "voltage", "drive", "actuator_deadband", kind="voltage"),
    "soft_saturation": _law({"compression": 0.35}, "compression", "drive", "supply_saturation voltage_compression"),
    "switching_loss": _law(
        {"voltage": 0.2, "current": 0.02}, "voltage", "drive bearing", "dead_time actuator_deadband", kind="voltage"
    ),
    "brake_late": _law({"after": 0.1}, "after", "drive", "zero_coast pwm_coast"),
    "levels_cut_off": _law({"step": 0.05}, "step", "drive", "pwm_quantisation actuator_deadband"),
    "one_side_drop": _law(
        {"drop": 0.15}, "drop", "drive", "motor_asymmetry actuator_deadband", kind="voltage"
    ),
    # motor
    "one_motor_saturates": _law({"loss": 1.5}, "loss", "motor drive", "torque_constant_asymmetry motor_asymmetry"),
    "heating_in_two_stages": _law(
        {"winding": 120.0, "winding_time": 3.0, "case": 160.0, "case_time": 40.0}, "winding case", "motor",
        "motor_heating", engines=MUJOCO,
    ),
    "ripple_rectified": _law({"amplitude": 0.4, "order": 6.0}, "amplitude", "motor", "torque_ripple"),
    "cogging_sharp": _law({"torque": 0.008, "order": 6.0}, "torque", "motor", "cogging", kind="torque"),
    # gear
    "backlash_soft": _law(
        {"gap": 0.15, "rotor_share": 0.5, "stiffness": 1.0, "damping": 0.003}, "gap", "gear", "gear_backlash"
    ),
    "inertia_on_rubber": _law(
        {"share": 0.15, "period": 0.35, "damping": 0.1, "stretch": 0.05}, "share", "gear body motor", "coupled_inertia"
    ),
    "ballast_on_spring": _law(
        {"torque": 0.008, "give": 0.4}, "torque", "body motor", "gravity_load cogging", kind="torque"
    ),
    # bearing
    "coulomb_tanh": _law({"torque": 0.003, "speed": 1.5}, "torque", "bearing", "coulomb_friction", kind="torque"),
    "friction_dahl": _law({"torque": 0.002, "stretch": 0.05}, "torque", "bearing", "coulomb_friction", kind="torque"),
    "friction_lugre": _law(
        {"coulomb": 0.0012, "breakaway": 0.0025, "stribeck_speed": 1.5, "stretch": 0.02}, "coulomb breakaway",
        "bearing", "stiction_stribeck coulomb_friction", kind="torque",
    ),
    "friction_by_load": _law(
        {"share": 0.2, "speed": 8.0}, "share", "bearing gear", "load_friction stiction_stribeck coulomb_friction"
    ),
    "loss_that_levels_off": _law(
        {"torque": 0.004, "speed": 8.0}, "torque", "bearing", "rolling_sqrt viscous_loss coulomb_friction",
        kind="torque",
    ),
    "loss_one_way": _law({"torque": 0.004, "speed": 15.0}, "torque", "bearing", "direction_asymmetry", kind="torque"),
    "offset_by_run": _law(
        {"torque": 0.006, "spread": 1.0}, "torque", "drive bearing", "constant_offset", kind="torque"
    ),
    # tyre
    "grip_circle": _law(
        {"friction": -0.35}, "friction", "tyre", "tyre_grip wheel_slip side_slip", offset={"friction": 0.95},
        kind="grip", engines=PLANAR,
    ),
    "grip_that_fades": _law(
        {"creep": 0.08, "friction": 0.9, "fade": 0.5, "speed": 0.15}, "creep", "tyre", "wheel_slip", engines=PLANAR
    ),
    "side_skid": _law(
        {"friction": -0.06}, "friction", "tyre", "side_slip", offset={"friction": 0.18}, engines=PLANAR
    ),
    "caster_viscous": _law({"drag": 0.6, "forward": -0.08}, "drag", "tyre body", "caster_drag", kind="force"),
    "scrub_smooth": _law({"moment": 0.006, "rate": 2.0}, "moment", "tyre", "yaw_scrub viscous_scrub", kind="moment"),
    "curve_drag": _law({"share": 4.0}, "share", "tyre", "curve_scrub"),
    "tyre_deflating": _law(
        {"rate": 0.0025}, "rate", "tyre", "wheel_radius_mismatch", engines=MUJOCO, signed=True
    ),
    # body and floor
    "drag_power": _law({"drag": 1.6}, "drag", "body floor bearing", "surge_drag quadratic_drag", kind="force"),
    "payload_sprung": _law(
        {"mass": 0.15, "frequency": 2.0, "damping": 0.15, "right": 0.03}, "mass", "body",
        "payload_mass com_lateral_offset com_forward_offset", engines=MUJOCO, kind="mass",
    ),
    "nap_viscous": _law(
        {"drag": 0.6, "force_x": 0.3, "force_y": 0.2}, "drag force_x force_y", "floor", "carpet_nap floor_slope",
        kind="force",
    ),
    "floor_wavy": _law({"slope": 0.025, "wave": 0.9}, "slope", "floor", "floor_slope"),
    # sensor
    "arm_on_mast": _law(
        {"x": 0.03, "y": 0.02, "frequency": 6.0, "damping": 0.3}, "x y", "sensor", "imu_lever_arm", signed=True
    ),
    "accel_cross_axis": _law({"share": 0.2}, "share", "sensor", "accel_misalignment", signed=True),
    "imu_second_order": _law({"time": 0.02}, "time", "sensor", "imu_lag"),
    "accel_bias_fading": _law(
        {"surge": 0.3, "sway": 0.25, "time_constant": 15.0}, "surge sway", "sensor", "accel_bias", signed=True
    ),
    "gyro_scale_bent": _law(
        {"error": 0.025, "cubic": 0.003}, "error cubic", "sensor", "gyro_scale", signed=True
    ),
    "gyro_curved_one_way": _law({"cubic": 0.005}, "cubic", "sensor", "gyro_asymmetry gyro_scale", signed=True),
    "gyro_bias_by_run": _law({"bias": 0.08, "spread": 0.9}, "bias", "sensor", "gyro_bias gyro_drift", signed=True),
    "gyro_warming_up": _law(
        {"bias": 0.12, "time_constant": 12.0}, "bias", "sensor", "gyro_drift gyro_bias", signed=True
    ),
    "gyro_soft_limit": _law({"limit": -1.5}, "limit", "sensor", "gyro_saturation", offset={"limit": 6.5}, kind="spin"),
    "encoder_eccentric": _law({"share": 0.05}, "share", "sensor", "encoder_scale"),
    "encoder_one_side": _law({"error": 0.05}, "error", "sensor", "encoder_scale", signed=True),
    "speed_signed_by_command": _law({"share": 0.43}, "share", "sensor", "unsigned_sensor"),
    "wheel_speed_counted": _law({"window": 0.08}, "window", "sensor", "speed_delay speed_lag sensor_delay"),
    "wheel_speed_smoothed": _law({"time": 0.03}, "time", "sensor", "speed_lag speed_delay"),
    "gyro_smoothed": _law({"time": 0.03}, "time", "sensor", "gyro_delay imu_lag"),
}  # fmt: skip
"""Laws other than the library's, by name. README.md describes each of them."""

ODD_MECHANISMS: dict[str, tuple[str, ...]] = {
    "odd_periodic_force": ("body", "floor"),
    "odd_friction_with_voltage": ("bearing", "drive", "gear"),
    "odd_drag_patch": ("floor", "body"),
    "odd_angle_brake": ("bearing", "gear", "motor"),
    "odd_cubic_drag": ("body", "floor", "bearing"),
    "odd_yaw_by_speed": ("body", "tyre", "floor"),
    "odd_turn_force": ("tyre", "body", "floor"),
    "odd_load_ramp": ("bearing", "gear"),
    "odd_heading_spring": ("floor", "body"),
    "odd_tether": ("floor", "body"),
    "odd_voltage_gain": ("drive", "supply"),
    "odd_crosstalk": ("drive", "supply"),
    "odd_gyro_cubic": ("sensor",),
}
"""Odd effect -> first the mechanism in which it acts, then mechanisms that give the same signals."""


def relation(name: str) -> Relation:
    """Returns "same" for a law of the library, "other" for another law of a known mechanism, or "odd"."""
    if name in OTHER:
        return "other"
    return "odd" if name in effects.ODD else "same"


def told(name: str) -> dict[str, object]:
    """Returns the entry of one hidden effect in the truth. For a law of the library, `mechanisms` is None."""
    law = relation(name)
    if law == "other":
        return {"law": law, "mechanisms": list(OTHER[name].mechanisms), "names": list(OTHER[name].names)}
    if law == "odd":
        return {"law": law, "mechanisms": list(ODD_MECHANISMS[name]), "names": []}
    return {"law": law, "mechanisms": None, "names": [name]}


def draw(name: str, size: float, vehicle: Vehicle, random: np.random.Generator) -> dict[str, float]:
    """Returns parameters of an effect or law, about `size` times the parameters in `visible`: see `effects.draw`."""
    if name in OTHER:
        return effects.drawn(OTHER[name].effect, size, vehicle, random)
    return effects.draw(name, size, vehicle, random)
