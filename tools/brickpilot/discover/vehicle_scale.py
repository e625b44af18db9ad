"""How large quantities are on a vehicle, so that effects are tried at sizes that suit it."""

from __future__ import annotations

from brickpilot import catalogue
from brickpilot.vehicle.model import Model, rcx


def scale_of(unit: str, model: Model) -> float:
    """Returns how many times larger a quantity of a unit is on this vehicle than on the packaged robot.

    The presets of the catalogue are sizes for the packaged robot.
    """
    own, packaged = _sizes(model), _sizes(rcx())
    return own[unit] / packaged[unit] if unit in own else 1.0


def _sizes(model: Model) -> dict[str, float]:
    """Returns what is large for a vehicle, by unit: at stall, or at the speed that it reaches without a load."""
    known, robot = {**catalogue.presets(model.vehicle), **model.parameters}, rcx().parameters
    volts = known["battery_voltage"] or robot["battery_voltage"]
    direct = known["force_per_volt"] or known["torque_per_volt"]
    torque = direct * volts if direct else known["torque_constant"] * volts / known["resistance"]
    radius = 1.0 if known["force_per_volt"] else known["wheel_radius"] or 0.04
    if direct:
        speed = torque / known["viscous_friction"] if known["viscous_friction"] else 1.0
    else:
        speed = volts / known["emf_constant"]
    return {
        "V": volts,
        "N m": torque,
        "N": torque / radius,
        "N m s/rad": torque / speed,
        "N s^2/m^2": torque / radius / (speed * radius) ** 2,
        "rad/s": speed,
        "kg": known["mass"] or 1.0,
        "m": known["half_track"] or robot["half_track"],
        "ohm": known["resistance"] or 1.0,
        "m/(N s)": speed * radius**2 / torque,
    }
