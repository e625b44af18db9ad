"""The supply, drive and motors of a vehicle, in plain Python numbers. Physics engines lack these parts.

The equations are those of a brushed motor (eq. 12 of Worrall & McGookin 2006, referred to the wheel) and of the effects
named in `Hidden`. `Electrics.step` is called once per step; the current is exact for a speed that keeps its mid-step
value during the step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hidden import electrics_laws
from hidden.by_run import delays, place
from hidden.electrics_laws import Circuit
from hidden.recipe import Hidden, Vehicle

COPPER = 0.00393  # 1/K, temperature coefficient of copper's resistance (IEC 60028)
FLOOR = 0.01  # least ratio of battery voltage to nominal voltage
ZERO = 0.01  # a coasting drive treats a command below this share of the battery's voltage as 0

EFFECTS = frozenset(
    {"start_delay", "input_delay", "battery_discharge", "battery_fade", "battery_sag", "odd_crosstalk",
     "pwm_quantisation", "actuator_lag", "slew_limit", "actuator_deadband", "current_limit", "voltage_compression",
     "motor_asymmetry", "odd_voltage_gain", "supply_saturation", "pwm_coast", "zero_coast", "dead_time",
     "torque_constant_asymmetry", "motor_heating", *electrics_laws.LAWS}
)  # fmt: skip
"""The effects that act only here, in the order in which they act. The gain of direction_asymmetry acts here, too."""


def arriving(commands: NDArray[np.float64], hidden: Hidden, step_s: float, number: int = 0) -> NDArray[np.float64]:
    """Returns the voltages (n,) at the drive in each step: the delayed `commands` (n,), and 0 before the first arrives.

    Args:
        number: the run's number.
    """
    out = commands
    frames = hidden.get("command_jitter")
    if frames:
        time = np.asarray((np.arange(len(out)) + 0.5) * step_s, dtype=np.float64)
        sent = np.arange(len(out)) - delays(time, number, frames["delay"], frames["jitter"]) / step_s
        out = np.where(sent >= 0, out[np.clip(np.floor(sent), 0, None).astype(np.int64)], 0.0)
    delay = hidden.get("input_delay", {}).get("delay", 0.0)
    if delay > 0:
        grid = np.arange(len(out)) * step_s
        whole = math.floor(delay / step_s)
        part = delay / step_s - whole
        padded = np.concatenate([np.zeros(whole + 1), out])
        out = (1 - part) * padded[1 : len(grid) + 1] + part * padded[: len(grid)]
    held = hidden.get("start_delay", {}).get("delay", 0.0)
    by_run = hidden.get("start_delay_by_run")
    if by_run:
        held = by_run["delay"] * (1 + by_run["spread"] * place(number))
    if held > 0:
        missing = np.clip(held / step_s - np.arange(len(out)), 0.0, 1.0)
        out = out * (1 - missing)
    return out


class Electrics:
    """State of the battery, the drive and both motors. `step` is called once for each interval of `step_s` seconds."""

    def __init__(self, vehicle: Vehicle, hidden: Hidden, step_s: float) -> None:
        self._vehicle, self._step = vehicle, step_s

        def p(effect: str, parameter: str, absent: float = 0.0) -> float:
            return hidden.get(effect, {}).get(parameter, absent)

        flux, gain = 0.5 * p("torque_constant_asymmetry", "difference"), 0.5 * p("motor_asymmetry", "difference")
        self._torque_constant = (vehicle.torque_constant * (1 + flux), vehicle.torque_constant * (1 - flux))
        self._emf_constant = (vehicle.emf_constant * (1 + flux), vehicle.emf_constant * (1 - flux))
        self._gain = (1 + gain, 1 - gain)
        self._slope, self._sag = p("battery_discharge", "slope"), p("battery_sag", "resistance")
        self._crosstalk, self._quantum = p("odd_crosstalk", "share"), p("pwm_quantisation", "step")
        lag = p("actuator_lag", "time_constant")
        # shares of the difference to the new voltage that the lag removes: at the end of a step, and on average in it
        self._closed = -math.expm1(-step_s / lag) if lag > 0 else 1.0
        self._midway = 1 - self._closed * lag / step_s if lag > 0 else 1.0
        slew = p("slew_limit", "time_per_volt")
        self._climb = step_s / slew if slew > 0 else math.inf  # largest change of the voltage in a step, V
        self._across = p("current_limit", "voltage", math.inf)
        self._deadband, self._by_direction = p("actuator_deadband", "voltage"), 0.5 * p("direction_asymmetry", "gain")
        self._fade, self._limit = p("odd_voltage_gain", "loss"), p("supply_saturation", "voltage", math.inf)
        self._pulses, self._brakes = "pwm_coast" in hidden, p("pwm_coast", "brakes") > 0.5
        self._tick = max(1, round(p("pwm_coast", "period") / step_s))
        self._fading, self._compression = p("battery_fade", "rate"), p("voltage_compression", "compression")
        self._coasting, self._dead = p("zero_coast", "share"), p("dead_time", "voltage")
        self._stages = electrics_laws.heat_stages(hidden)
        self.heat = [[0.0] * len(self._stages), [0.0] * len(self._stages)]  # K, by side and stage; kept between runs
        self._saturation = (p("one_motor_saturates", "loss"), 0.0)
        self._circuit = Circuit(vehicle, step_s)
        self._falls = [(act, hidden[name]) for name, act in electrics_laws.SUPPLY.items() if name in hidden]
        self._drives = [(act, hidden[name]) for name, act in electrics_laws.DRIVE.items() if name in hidden]
        self.charge = 0.0  # C drawn since power-on
        self.age = 0.0  # s since power-on
        self.battery = vehicle.battery_voltage
        self._drawn = 0.0
        self._decay = self._decays(vehicle.resistance)
        self._plain = not hidden.keys() & (EFFECTS | {"direction_asymmetry"})
        self.start_run()

    def start_run(self) -> None:
        """Sets all states to rest, without current. `heat`, `charge` and `age` are kept."""
        self.current = [0.0, 0.0]
        self._lagged, self._held = [0.0, 0.0], [0.0, 0.0]
        self._sum = [0.0, 0.0]
        self._on = [True, True]
        self._count = 0
        self._drawn = 0.0
        self._circuit.start_run()

    def _decays(self, resistance: float) -> tuple[float, float]:
        """Returns two shares of a current's distance to its steady value that remain.

        The first share remains at the end of a step, the second on average over the step.
        """
        if self._vehicle.inductance <= 0:
            return 0.0, 0.0
        x = self._step * resistance / self._vehicle.inductance
        return math.exp(-x), -math.expm1(-x) / x

    def step(self, command_left: float, command_right: float, speed_left: float, speed_right: float) -> list[float]:
        """Returns the mean torques (left, right) in one step, N m at the wheel. Commands: V; mid-step speeds: rad/s."""
        if self._plain:
            volts: list[float | None] = [command_left, command_right]
        else:
            self._circuit.emf = [self._emf_constant[0] * speed_left, self._emf_constant[1] * speed_right]
            volts = self._drive(command_left, command_right)
            for side, speed in ((0, speed_left), (1, speed_right)):
                volts[side] = self._switched(volts[side], self._emf_constant[side] * speed)
        resistance = self._vehicle.resistance
        torque, drawn = [0.0, 0.0], 0.0
        for side, speed in ((0, speed_left), (1, speed_right)):
            applied = volts[side]
            if applied is None:  # the motor floats
                self.current[side] = 0.0
                mean = 0.0
            else:
                if self._stages:
                    hot = resistance * (1 + COPPER * sum(self.heat[side]))
                    left, average = self._decays(hot)
                else:
                    hot = resistance
                    left, average = self._decay
                goal = (applied - self._emf_constant[side] * speed) / hot
                apart = self.current[side] - goal
                self.current[side] = goal + apart * left
                mean = goal + apart * average
                drawn += applied * mean
                for k, (thermal, lasting) in enumerate(self._stages):
                    warmth = thermal * hot * mean * mean - self.heat[side][k]
                    self.heat[side][k] += self._step * warmth / lasting
            torque[side] = self._torque_constant[side] * mean / (1 + self._saturation[side] * abs(mean))
        self._drawn = drawn / self.battery
        self.age += self._step
        self.charge += self._drawn * self._step
        return torque

    def _drive(self, command_left: float, command_right: float) -> list[float | None]:
        """Returns the voltages at the motors (left, right); None: the motor floats."""
        full = self._vehicle.battery_voltage
        open_voltage = full - self._slope * self.charge - self._fading * self.age
        c = self._circuit
        c.drawn, c.commands, c.current, c.age = self._drawn, (command_left, command_right), self.current, self.age
        open_voltage -= sum(act(c, p) for act, p in self._falls)
        self.battery = max(open_voltage - self._sag * self._drawn, FLOOR * full)
        c.battery = self.battery
        share = self.battery / full
        commands = (command_left * share, command_right * share)
        volts: list[float | None] = [0.0, 0.0]
        fresh = self._count % self._tick == 0
        self._count += 1
        for side in (0, 1):
            value = commands[side] - self._crosstalk * commands[1 - side]
            if self._quantum:
                value = self._quantised(value)
            if self._closed < 1.0:
                missing = value - self._lagged[side]
                value = self._lagged[side] + missing * self._midway
                self._lagged[side] += missing * self._closed
            if self._climb < math.inf:
                change = max(-self._climb, min(self._climb, value - self._held[side]))
                value = self._held[side] + 0.5 * change
                self._held[side] += change
            size = abs(value)
            if self._deadband:
                size = max(size - self._deadband, 0.0)
            size /= 1 + self._compression * size / full
            size *= self._gain[side] * (1 + self._by_direction if value > 0 else 1 - self._by_direction)
            size *= 1 - self._fade * size
            value = math.copysign(min(size, self._limit), value)
            volts[side] = self._pulse(side, value, fresh) if self._pulses else self._by_other_laws(side, value)
        return volts

    def _by_other_laws(self, side: int, volts: float) -> float | None:
        value: float | None = volts
        for act, p in self._drives:
            if value is not None:
                value = act(self._circuit, p, side, value)
        return value

    def _switched(self, volts: float | None, emf: float) -> float | None:
        """Returns the voltage at a motor with back EMF `emf`, after the effects of the drive's switches."""
        if volts is None:
            return None
        if self._coasting and abs(volts) <= ZERO * self._vehicle.battery_voltage:
            volts += self._coasting * (emf - volts)
        left = min(abs(volts - emf) - self._dead, self._across)
        return emf + math.copysign(left, volts - emf) if left > 0 else emf

    def _quantised(self, volts: float) -> float:
        quantum = self._quantum * self.battery
        level = math.copysign(math.floor(abs(volts) / quantum + 0.5) * quantum, volts)
        return max(-self.battery, min(self.battery, level))

    def _pulse(self, side: int, volts: float, fresh: bool) -> float | None:
        """Returns a pulse's or a pause's voltage (first-order pulse density, as in brickOS); None: the motor floats."""
        if fresh:
            self._sum[side] += abs(volts) / self.battery
            self._on[side] = self._sum[side] >= 1 - 1e-9
            if self._on[side]:
                self._sum[side] -= 1
        if volts == 0:
            return 0.0
        if self._on[side]:
            return math.copysign(self.battery, volts)
        return 0.0 if self._brakes else None
