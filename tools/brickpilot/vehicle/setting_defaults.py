"""The initial value of each setting of the firmware: its row's default, or that of the packaged robot's file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from typing import Any

from brickpilot.constants import RCX
from brickpilot.vehicle.combinations import loss
from brickpilot.vehicle.fixed_point import QuantisationError, integer
from brickpilot.vehicle.settings import Setting, settings


def plain(table: Mapping[str, Any]) -> dict[str, float]:
    """Returns the values of a table of the vehicle file, without units and basis."""
    return {name: float(entry["value"]) for name, entry in table.items() if "value" in entry}


def holding_voltage(values: Mapping[str, float]) -> float:
    """Returns the voltage of both motors per steady speed on level ground, V s/m: coupled, without air drag."""
    per_wheel_speed = values["emf_constant"] + values["resistance"] * loss(values) / values["torque_constant"]
    return per_wheel_speed / values["wheel_radius"]


def constants(vehicle: Mapping[str, Any], profile: str) -> dict[str, float]:
    """Returns the controller's constants of a profile, SI: those of the vehicle file, and two that follow from them."""
    own = plain(vehicle["controller"][profile])
    own["acceptance"] = plain(vehicle["robot"])["length"] / 2
    own["feedforward"] = own["feedforward_share"] * holding_voltage(plain(vehicle["parameters"]))
    return own


def default(setting: Setting, own: Mapping[str, float], profile: str) -> int:
    """Returns the initial raw integer of a setting; for a compensation it is 0.

    Args:
        own: `constants` of the profile.

    Raises:
        QuantisationError: neither its row nor the vehicle file has a value, or it is outside the range.
    """
    if setting.compensation:
        return 0
    if setting.default is None and setting.name not in own:
        raise QuantisationError(
            f"hal/wire/settings.toml: {setting.name}: has no default, and [controller.{profile}] of "
            f"sim_host/models/rcx.toml has no value of that name"
        )
    value = own[setting.name] if setting.default is None else setting.default
    return integer(value * setting.format.per_unit, setting.low, setting.high, setting.name)


@cache
def defaults(profile: str) -> Mapping[str, int]:
    """Returns name -> raw integer of every setting at the beginning of a session with the packaged firmware."""
    own = constants(tomllib.loads(RCX.read_text(encoding="utf-8")), profile)
    return {name: default(setting, own, profile) for name, setting in settings().items()}
