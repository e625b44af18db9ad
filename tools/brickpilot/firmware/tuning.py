"""The constants of a controller for another robot, by rules that start from the packaged robot's tuned ones.

A motor drives one degree of freedom, the straight drive or the turn, as a first-order lag: dv/dt = (gain V - v) / time
(eq. 12 and 14 of the coupled vehicle, without inductance). The packaged robot's gains give its two closed loops

    straight:  s^2 + (1 + gain kp) / time s + gain ki / time
    turn:      s^3 + (1 + gain kd) / time s^2 + gain kp / time s + gain ki / time

The gains of another robot give its loops the same polynomials, with all poles multiplied by one pace:

- The root of the ratio of accelerations at full voltage, where this robot accelerates less: then the share of its
  voltage that an error of the heading asks for stays the same.
- More where the robot's own damping is beyond what that pace asks for, up to `FASTEST`.

Speeds follow the speed that the battery holds, decelerations the acceleration, lengths the robot's length. The voltage
that turns follows the battery, and is no more than the gyro can follow (`_within_gyro`). The packaged robot gets back
its own constants.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scipy.optimize import brentq

from brickpilot.vehicle.coefficients import difference_inertia, mean_inertia, wheel_speed_per_volt

FASTEST = 2.0
"""The packaged robot's poles, times this, are as fast as a control step of 9 ms follows: 0.2 of a radian a step."""

NOTHING = 0.01
"""A loop gain that changes no damping."""

FASTEST_CRUISE = 1.6
"""m/s: four fifths of what the format of a speed holds."""

LONGEST_TURN = math.pi
"""rad: no error of the heading is larger."""

GYRO_SHARE = 0.9
"""Of the gyro's range that a turn may reach: its bias and noise, and stronger motors, stay below the rest."""

Values = Mapping[str, float]


@dataclass(frozen=True)
class Motion:
    """One degree of freedom: dv/dt = (gain V - v) / time. The gain is in m/s or rad/s per V, the time in s."""

    gain: float
    time: float

    def acceleration(self, volts: float) -> float:
        """Returns the acceleration from rest, m/s^2 or rad/s^2."""
        return self.gain * volts / self.time


@dataclass(frozen=True)
class Chosen:
    """A constant that a rule gives, SI, and the rule in a few words."""

    value: float
    rule: str


def straight(values: Values) -> Motion:
    """Returns the straight drive of a robot, by its nominal parameters."""
    lag = _lag(values, mean_inertia(values))
    return Motion(lag.gain * values["wheel_radius"], lag.time)


def turn(values: Values) -> Motion:
    """Returns the turn on the spot, driven by half the difference of the voltages."""
    lag = _lag(values, difference_inertia(values))
    return Motion(lag.gain * values["wheel_radius"] / values["half_track"], lag.time)


def _lag(values: Values, inertia: float) -> Motion:
    """Returns the wheel's speed, rad/s per V, with this inertia at the wheel."""
    resistance, torque = values["resistance"], values["torque_constant"]
    held = 1 / wheel_speed_per_volt(values)
    return Motion(1 / held, inertia * resistance / (torque * held))


def _pace(own: Motion, accelerates: float, damping: float) -> float:
    """Returns the factor of the poles; `damping`: sum of the packaged loop's poles, 1/s."""
    slowed = min(1.0, math.sqrt(accelerates))
    return min(max(slowed, 1 / (own.time * damping)), FASTEST)


def _loop_gain(wanted: float) -> float:
    """Returns a loop gain without what is below `NOTHING`, or negative: there the robot's own damping is enough."""
    return wanted if wanted > NOTHING else 0.0


def _speed_gains(own: Motion, packaged: Motion, gains: Values, accelerates: float) -> dict[str, float]:
    damping = (1 + packaged.gain * gains["speed_kp"]) / packaged.time
    pace = _pace(own, accelerates, damping)
    stiffness = packaged.gain * gains["speed_ki"] / packaged.time * pace**2
    return {
        "speed_kp": _loop_gain(pace * damping * own.time - 1) / own.gain,
        "speed_ki": stiffness * own.time / own.gain,
    }


def _heading_gains(own: Motion, packaged: Motion, gains: Values, accelerates: float) -> dict[str, float]:
    damping = (1 + packaged.gain * gains["heading_kd"]) / packaged.time
    pace = _pace(own, accelerates, damping)
    factor = packaged.gain / packaged.time * own.time / own.gain
    return {
        "heading_kp": gains["heading_kp"] * factor * pace**2,
        "heading_ki": gains["heading_ki"] * factor * pace**3,
        "heading_kd": _loop_gain(pace * damping * own.time - 1) / own.gain,
    }


def _within_gyro(about: Motion, gyro_range: float) -> float:
    """Returns the voltage that turns a robot half round from rest, and at its end to the gyro's range, or nearly.

    A lag under the voltage V reaches the rate gain V (1 - e) after the angle gain V time (x - 1 + e), where x is the
    time over that of the lag and e = exp(-x). A light robot reaches all of gain V at once, a heavy one never.
    """
    rate = GYRO_SHARE * gyro_range

    def beyond(x: float) -> float:
        return rate * about.time * (x + math.expm1(-x)) + LONGEST_TURN * math.expm1(-x)

    x = float(brentq(beyond, 1e-9, 2 + LONGEST_TURN / (rate * about.time)))
    return rate / (about.gain * -math.expm1(-x))


@dataclass(frozen=True)
class Size:
    """What the rules need of a robot: nominal parameters, its length in m, and the range of its gyro in rad/s."""

    values: Values
    length: float
    gyro_range: float

    @property
    def battery(self) -> float:
        return self.values["battery_voltage"]


def controller(own: Size, packaged: Size, constants: Values) -> dict[str, Chosen]:
    """Returns the constants of `[controller.coupled]` that follow from the robot; the others are the packaged ones.

    Args:
        constants: the packaged robot's.
    """
    ahead, ahead_packaged = straight(own.values), straight(packaged.values)
    about, about_packaged = turn(own.values), turn(packaged.values)
    battery, length = own.battery / packaged.battery, own.length / packaged.length
    faster = ahead.acceleration(own.battery) / ahead_packaged.acceleration(packaged.battery)
    turns = about.acceleration(own.battery) / about_packaged.acceleration(packaged.battery)
    top = ahead.gain * battery / ahead_packaged.gain
    cruise = min(constants["cruise"] * min(top, math.sqrt(faster * length)), FASTEST_CRUISE)
    slower = cruise / constants["cruise"]
    turning = min(constants["heading_limit"] * battery, _within_gyro(about, own.gyro_range))
    poles = "the packaged robot's poles, see tuning.py"
    found = {
        **{name: (value, poles) for name, value in _speed_gains(ahead, ahead_packaged, constants, faster).items()},
        **{name: (value, poles) for name, value in _heading_gains(about, about_packaged, constants, turns).items()},
        "cruise": (
            cruise,
            "as the speed that the battery holds, and no faster than the robot brakes within its length",
        ),
        "creep": (constants["creep"] * slower, "as cruise"),
        "decel": (constants["decel"] * faster, "as the acceleration at full voltage"),
        "speed_limit": (constants["speed_limit"] * battery, "as the battery"),
        "heading_limit": (turning, "as the battery, and no faster than nine tenths of the gyro's range in half a turn"),
        "bearing_hold": (constants["bearing_hold"] * length, "as the length"),
        "overshoot": (constants["overshoot"] * length, "as the length"),
        "leg_timeout": (constants["leg_timeout"] * max(length, 1.0) / min(slower, 1.0), "as length over cruise"),
        "battery_floor": (constants["battery_floor"] * battery, "as the battery"),
    }
    return {name: Chosen(value, rule) for name, (value, rule) in found.items()}


def estimator(own: Values, packaged: Values, constants: Values) -> dict[str, Chosen]:
    """Returns the constants of `[estimator]` and `[estimator.coupled]` that follow from the sensors.

    Args:
        own, packaged: `travel_per_count` in m, `gyro_resolution` and `gyro_noise_sd` in rad/s.
        constants: the packaged robot's, of both tables.
    """
    coarser = own["travel_per_count"] / packaged["travel_per_count"]
    noisier = max(own[name] / packaged[name] for name in ("gyro_resolution", "gyro_noise_sd"))
    return {
        "gyro_quiet": Chosen(constants["gyro_quiet"] * noisier, "as the gyro's resolution or noise"),
        "observer_bandwidth": Chosen(
            constants["observer_bandwidth"] * min(1.0, 1 / coarser), "a count makes no more ripple of the speed"
        ),
    }
