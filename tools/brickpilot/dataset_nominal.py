"""`[nominal]` of a data set: what the experimenter knows. Names and ranges come from the plant's C tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot import plant
from brickpilot.signals import Vehicle
from brickpilot.tomlfile import Key, TomlFile

# fmt: off
RESERVED_EFFECTS = frozenset({
    "coulomb_friction", "stiction_stribeck", "rolling_sqrt", "quadratic_drag", "caster_drag", "yaw_scrub",
    "curve_scrub", "direction_asymmetry", "motor_asymmetry", "torque_constant_asymmetry", "wheel_radius_mismatch",
    "actuator_deadband", "supply_saturation", "pwm_quantisation", "pwm_coast", "battery_sag", "battery_discharge",
    "motor_heating", "torque_ripple", "cogging", "gear_backlash", "input_delay", "actuator_lag", "sensor_delay",
    "imu_lag", "wheel_slip", "side_slip", "com_lateral_offset", "com_forward_offset", "payload_mass", "floor_slope",
    "carpet_nap", "gyro_bias", "gyro_drift", "gyro_scale", "gyro_saturation", "accel_bias", "accel_misalignment",
    "imu_lever_arm", "encoder_scale", "constant_offset", "start_delay",
})
# fmt: on
"""Names whose meaning is fixed although the plant may not simulate them yet: a data set may state them."""

_LARGE = 1e12
_FINEST_SD = 1e-15
_FINEST_SHARE = 1e-9  # of the value: nothing on a bench is known better
_WIDEST_SD = 1e9


@dataclass(frozen=True)
class Nominal:
    """A known value in SI and how well it is known; ``sd`` None: nothing said."""

    value: float
    sd: float | None = None


def read_nominal(toml: TomlFile, table: Mapping[str, Any], vehicle: Vehicle) -> dict[str, Nominal]:
    """The nominal parameters, each known to the plant and within its physical range.

    Raises:
        InputError: naming the parameter's line.
    """
    known = {info.name: info for info in plant.parameters()}
    nominal = {}
    for name, entry in table.items():
        if name == "effects":
            continue
        key = ("nominal", name)
        if name not in known:
            toml.refuse(key, "unknown nominal parameter")
        info = known[name]
        nominal[name] = _entry(toml, key, entry, info.minimum, info.maximum, info.unit)
    _check_drive(toml, nominal, vehicle)
    return nominal


def read_nominal_effects(toml: TomlFile, table: Mapping[str, Any]) -> tuple[dict[str, dict[str, Nominal]], list[str]]:
    """The effects that the experimenter's model already contains, and the names of those the plant cannot simulate.

    Raises:
        InputError: naming the effect's line.
    """
    known = {effect.name: effect for effect in plant.effects()}
    effects: dict[str, dict[str, Nominal]] = {}
    for name, entries in table.items():
        key = ("nominal", "effects", name)
        if name not in known and name not in RESERVED_EFFECTS:
            toml.refuse(key, "unknown effect")
        if not isinstance(entries, dict) or not entries:
            toml.refuse(key, "needs a table with at least one parameter")
        effects[name] = {}
        ranges = {info.name: info for info in known[name].parameters} if name in known else None
        for parameter, entry in entries.items():
            if ranges is None:
                effects[name][parameter] = _entry(toml, (*key, parameter), entry, -_LARGE, _LARGE, "")
                continue
            if parameter not in ranges:
                toml.refuse((*key, parameter), f"unknown parameter; known: {', '.join(ranges)}")
            info = ranges[parameter]
            effects[name][parameter] = _entry(toml, (*key, parameter), entry, info.minimum, info.maximum, info.unit)
    return effects, sorted(effects.keys() - known.keys())


def _entry(toml: TomlFile, key: Key, entry: object, low: float, high: float, unit: str) -> Nominal:
    if not isinstance(entry, dict):
        return Nominal(toml.number(key, entry, low, high, unit))
    toml.known_keys(key, entry, {"value", "sd"})
    if "value" not in entry:
        toml.refuse(key, "value is missing")
    value = toml.number((*key, "value"), entry["value"], low, high, unit)
    if "sd" not in entry:
        return Nominal(value)
    sd = toml.number((*key, "sd"), entry["sd"], -_LARGE, _LARGE, unit)
    if sd <= 0.0:
        toml.refuse((*key, "sd"), f"{sd:g} is not above zero")
    if not max(_FINEST_SD, _FINEST_SHARE * abs(value)) <= sd <= min(high - low, _WIDEST_SD):
        toml.refuse((*key, "sd"), f"{sd:g} is no believable uncertainty of {value:g} {unit}".rstrip())
    return Nominal(value, sd)


def _check_drive(toml: TomlFile, nominal: Mapping[str, Nominal], vehicle: Vehicle) -> None:
    closed = [name for name in nominal if name in {"force_per_volt", "torque_per_volt"}]
    if closed and vehicle != "motor":
        toml.refuse(("nominal", closed[0]), f"belongs to a motor, not to a {vehicle}")
    for name in closed:
        if nominal[name].value == 0.0:
            toml.refuse(("nominal", name), "is 0: leave it out of a motor that is driven by voltage")
    if len(closed) > 1:
        toml.refuse(("nominal", closed[1]), f"conflicts with {closed[0]}: the drive commands one or the other")
