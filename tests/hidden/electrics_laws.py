"""Laws of `other_laws` in supply, drive and motors of the engine "mujoco", computed for one robot: see `electrics`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from hidden.recipe import Hidden, Vehicle

Parameters = Mapping[str, float]


@dataclass
class Circuit:
    """The variables of one vehicle that the laws read and change. Pairs are [left, right].

    Attributes:
        age: time since power-on, s.
        drawn: current from the supply, A.
        commands: the arriving commands before the effects of supply and drive, V.
        current: the motors' currents at the start of a step, A.
        slow: the voltage of the capacitor in Thevenin's battery model, V.
        held: the output of a drive whose voltage rises at a limited rate, V.
        emf: the motors' back EMF, V.
        at_zero: time for which the command has been zero, s.
    """

    vehicle: Vehicle
    step: float
    age: float = 0.0
    drawn: float = 0.0
    battery: float = 0.0
    commands: tuple[float, float] = (0.0, 0.0)
    current: list[float] = field(default_factory=lambda: [0.0, 0.0])
    slow: float = 0.0
    held: list[float] = field(default_factory=lambda: [0.0, 0.0])
    emf: list[float] = field(default_factory=lambda: [0.0, 0.0])
    at_zero: list[float] = field(default_factory=lambda: [0.0, 0.0])

    def start_run(self) -> None:
        self.held, self.at_zero, self.slow, self.drawn = [0.0, 0.0], [0.0, 0.0], 0.0, 0.0


def _discharge_settling(c: Circuit, p: Parameters) -> float:
    return -p["drop"] * math.expm1(-c.age / p["time_constant"])


def _sag_with_memory(c: Circuit, p: Parameters) -> float:
    c.slow += c.step / p["time_constant"] * (p["slow"] * c.drawn - c.slow)
    return p["resistance"] * c.drawn + c.slow


def _slew_when_driving(c: Circuit, p: Parameters, side: int, volts: float) -> float:
    """The magnitude of the voltage rises at a limited rate and falls at once."""
    held = abs(c.held[side]) if volts * c.held[side] > 0 else 0.0
    size = min(abs(volts), held + c.vehicle.battery_voltage / p["time"] * c.step)
    c.held[side] = math.copysign(size, volts)
    return c.held[side]


def _current_cut_softly(c: Circuit, p: Parameters, side: int, volts: float) -> float:
    """Removes a share of that part of the winding's voltage which exceeds the limit."""
    across = volts - c.emf[side]
    return volts - p["share"] * (across - max(-p["voltage"], min(p["voltage"], across)))


def _deadband_sloped(_: Circuit, p: Parameters, __: int, volts: float) -> float:
    size = abs(volts)
    return math.copysign(min(max(2 * (size - p["voltage"]), 0.0), size), volts)


def _soft_saturation(c: Circuit, p: Parameters, _: int, volts: float) -> float:
    limit = c.vehicle.battery_voltage / p["compression"]
    return limit * math.tanh(volts / limit)


def _switching_loss(c: Circuit, p: Parameters, side: int, volts: float) -> float:
    if volts == 0:
        return volts
    return volts - p["voltage"] * max(-1.0, min(1.0, c.current[side] / p["current"]))


def _levels_cut_off(c: Circuit, p: Parameters, _: int, volts: float) -> float:
    unit = p["step"] * c.battery
    return math.copysign(math.floor(abs(volts) / unit + 1e-9) * unit, volts)


def _one_side_drop(_: Circuit, p: Parameters, side: int, volts: float) -> float:
    return volts - max(-p["drop"], min(p["drop"], volts)) if side == 1 else volts


def _brake_late(c: Circuit, p: Parameters, side: int, volts: float) -> float | None:
    """At a command of zero the motor first floats; after the time `after` the drive short-circuits the motor."""
    c.at_zero[side] = c.at_zero[side] + c.step if c.commands[side] == 0 else 0.0
    return None if 0 < c.at_zero[side] <= p["after"] else volts


SUPPLY: dict[str, Callable[[Circuit, Parameters], float]] = {
    act.__name__[1:]: act for act in (_discharge_settling, _sag_with_memory)
}
"""Effect -> function that returns the voltage loss of the supply, V."""

DRIVE: dict[str, Callable[[Circuit, Parameters, int, float], float | None]] = {
    act.__name__[1:]: act
    for act in (
        _levels_cut_off, _slew_when_driving, _deadband_sloped, _one_side_drop, _soft_saturation, _switching_loss,
        _current_cut_softly, _brake_late,
    )
}  # fmt: skip
"""Effect -> function that returns the changed voltage of one side (0: left), V, or None if the motor floats. The
effects act in this order."""

TIMING = ("start_delay_by_run", "command_jitter")
MOTOR = ("one_motor_saturates", "heating_in_two_stages")
LAWS = frozenset({*SUPPLY, *DRIVE, *TIMING, *MOTOR})


def heat_stages(hidden: Hidden) -> list[tuple[float, float]]:
    """Returns thermal resistance, K/W, and time constant, s, of each stage of a motor's heat (Foster's network)."""
    two = hidden.get("heating_in_two_stages")
    if two:
        return [(two["winding"], two["winding_time"]), (two["case"], two["case_time"])]
    one = hidden.get("motor_heating")
    return [(one["thermal_resistance"], one["time_constant"])] if one else []
