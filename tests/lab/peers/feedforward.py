"""The peers kS/kV/kA: WPILib's model of a drivetrain. The voltage of a side is kS sgn(v) + kV v + kA dv/dt."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.data.holdout import Roles
from brickpilot.data.signals import SUMMED
from brickpilot.errors import InputError
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares

from lab.peers.grid import on_grid, steps_for
from lab.peers.wheels import Drive, simulated_by_side
from lab.real_score import Predictions

Array = NDArray[np.float64]

_MOST_SAMPLES = 10_000  # largest number of samples of all runs in the fit with delays
_MOVING = 0.02  # samples below this share of the largest speed are left out, as in WPILib


def with_delays(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of the law with a delay of the commands and one of each channel, fitted by simulation.

    A long log is first thinned to every k-th sample, because the fit simulates the log some hundred times.
    """
    every = 1 + sum(len(run.time) for run in dataset.runs) // _MOST_SAMPLES
    thinned = dataclasses.replace(dataset, runs=tuple(_thinned(run, every) for run in dataset.runs))
    found = fit_feedforward(thinned, roles.by_run).predictions
    return {
        run.name: {name: np.interp(run.time, few.time, values) for name, values in found[run.name].items()}
        for run, few in zip(dataset.runs, thinned.runs, strict=True)
    }


def _thinned(run: Run, every: int) -> Run:
    def few(signals: Mapping[str, Array]) -> dict[str, Array]:
        return {name: values[::every] for name, values in signals.items()}

    return dataclasses.replace(
        run, time=run.time[::every], inputs=few(run.inputs), outputs=few(run.outputs), raw_outputs=few(run.raw_outputs)
    )


def by_regression(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs of WPILib's own fit: one least-squares regression of the acceleration, without delays.

    As in SysId, (next v - v) / dt is regressed on v, volts and sgn(v), over the samples in motion.
    """
    return simulated_by_side(on_grid(dataset, steps_for(dataset)[0]), roles.fit(), _regressed)


def _regressed(drives: Sequence[Drive]) -> Callable[[Drive], Array]:
    speed = np.concatenate([drive.speed[:-1] for drive in drives])
    gained = np.concatenate([np.diff(drive.speed) / drive.step for drive in drives])
    volts = np.concatenate([drive.volts[:-1] for drive in drives])
    moving = np.abs(speed) > _MOVING * np.abs(speed).max(initial=0.0)
    columns = np.column_stack([speed, volts, np.sign(speed)])[moving]
    decay, drive_gain, friction = (float(one) for one in np.linalg.lstsq(columns, gained[moving], rcond=1e-10)[0])

    def simulate(drive: Drive) -> Array:
        return _free_run(drive, decay, drive_gain, max(-friction, 0.0))

    return simulate


def _free_run(drive: Drive, decay: float, drive_gain: float, friction: float) -> Array:
    """Returns the speed (n,), exact between changes of direction; friction can hold a side at rest."""
    decay = min(decay, -1e-9)
    kept = np.exp(decay * drive.step)
    gain = (kept - 1.0) / decay
    found = np.empty(len(drive.volts))
    speed = float(drive.speed[0])
    for row, volts in enumerate(drive.volts):
        found[row] = speed
        push = drive_gain * float(volts)
        way = np.sign(speed) if speed != 0.0 else np.sign(push) * float(abs(push) > friction)
        after = kept * speed + gain * (push - friction * way)
        speed = 0.0 if way == 0.0 or (after * way < 0.0 and abs(push) <= friction) else after
    return found


_RATES = ("wheel_velocity", "wheel_speed", "velocity", "speed")
_TRAVELS = ("wheel_travel", "wheel_angle", "position", "angle")
_FIRST_DELAYS = (0.0, 0.03, 0.1)  # start values of all delays, s; one fit starts from each value
_LONGEST_DELAY = 0.5  # s
_MOVING_SAMPLES = 12  # number of samples through which a line is fitted for the first speed of a run
_SMOOTH_S = 0.1  # span, s, of the line whose slope is an acceleration in the first guess
_EVALUATIONS = 40  # largest number of evaluations of the residual from one start
_STEP = 1e-4  # relative step of finite differences


@dataclass(frozen=True)
class FeedforwardFit:
    """The fit of the feed-forward law to a data set.

    Attributes:
        parameters: name -> value; kS in V, kV in V per unit of speed, kA in V per unit of speed and second, delays in
            s, `yaw` in rad/s per unit of the wheels' difference in speed.
        predictions: run -> signal -> (n,), SI, at the run's samples, for fit runs and held-out runs.
    """

    parameters: Mapping[str, float]
    predictions: Mapping[str, Mapping[str, Array]]


def fit_percent(measured: Array, predicted: Array) -> float:
    """Returns 100 (1 - rms(error) / rms(measured - mean)) over the known samples; NaN if the signal is constant.

    100 is a perfect prediction, 0 is as good as the mean of the run, and worse predictions are below 0.
    """
    known = np.isfinite(measured)
    if known.sum() < 2 or np.ptp(measured[known]) == 0:
        return float("nan")
    error = measured[known] - predicted[known]
    return float(100 * (1 - np.sqrt(np.mean(error**2)) / np.std(measured[known])))


def fit_feedforward(dataset: Dataset, roles: Mapping[str, str]) -> FeedforwardFit:
    """Fits the law to the runs whose role is "fit", and predicts every run from its inputs alone.

    Args:
        roles: run name -> "fit" or "held_out", from `holdout.assign`.

    Raises:
        InputError: no run is fitted, or no speed, travel or angle is measured.
    """
    sides = ("_left", "_right") if dataset.vehicle == "diff_drive" else ("",)
    wheels = tuple(_wheel(dataset, side) for side in sides)
    records = [_record(run, dataset, wheels) for run in dataset.runs]
    fitted = [one for one in records if roles[one.run.name] == "fit"]
    if not fitted:
        raise InputError("every run is held out: there is none to fit", file=dataset.path, field="runs.role")
    law = _Law(dataset, wheels, fitted)
    best = min((law.descend(fitted, delay) for delay in _FIRST_DELAYS), key=lambda end: end[0])[1]
    predictions = {one.run.name: law.predict(best, one) for one in records}
    return FeedforwardFit(dict(zip(law.names, best.tolist(), strict=True)), predictions)


@dataclass(frozen=True)
class _Wheel:
    """The measured channels of one wheel, or of the motor if `side` is empty; None: not measured."""

    side: str
    rate: str | None
    travel: str | None


@dataclass(frozen=True)
class _Record:
    """One run for the fit: `inputs` (n, wheels), V; `charge`, their integrals over time; `first`, the start speeds."""

    run: Run
    clock: Array
    inputs: Array
    charge: Array
    first: tuple[float, ...]


class _Law:
    """The law for one data set: the names of its parameters, a first guess, and predictions of measured channels."""

    def __init__(self, dataset: Dataset, wheels: Sequence[_Wheel], fitted: Sequence[_Record]) -> None:
        self._wheels = wheels
        measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
        channels = [name for one in wheels for name in (one.rate, one.travel) if name is not None]
        self._body = [name for name in ("yaw_rate", "yaw_angle", "accel_surge") if name in measured and wheels[1:]]
        self._channels = [*channels, *self._body]
        self.names = [f"{number}{one.side}" for one in wheels for number in ("kS", "kV", "kA")]
        self.names += ["turn"] if len(wheels) > 1 else []
        self.names += ["yaw"] if self._body else []
        self.names += ["command_delay", *(f"delay of {name}" for name in self._channels)]
        self._summed = SUMMED.intersection(self._channels)
        self._spread = {name: _spread(fitted, name, summed=name in self._summed) for name in self._channels}
        self._metres = _metres_per_unit(dataset, wheels)
        self._speeds: dict[tuple[bytes, str], Array] = {}

    def descend(self, fitted: Sequence[_Record], delay: float) -> tuple[float, Array]:
        """Returns the cost and the parameters after a descent from a first guess with this delay.

        Travels are first compared by their slopes: a travel sums up errors, so the cost of a travel has many minima.
        """
        numbers = self._guess(fitted, delay)
        for by_slope in (True, False):
            cost, numbers = self._descend(fitted, numbers, by_slope=by_slope)
        return cost, numbers

    def _descend(self, fitted: Sequence[_Record], start: Array, *, by_slope: bool) -> tuple[float, Array]:
        free = np.array([name.partition("_")[0] in ("kV", "kA", "turn") for name in self.names])
        late = np.array(["delay" in name for name in self.names])
        low = np.where(free, 1e-6 * np.abs(start), np.where(late, 0.0, -np.inf))
        low = np.where([name.startswith("kS") for name in self.names], 0.0, low)
        high = np.where(late, _LONGEST_DELAY, np.inf)
        scale = np.where(late, 0.05, np.maximum(np.abs(start), 1e-6))

        def residual(point: Array) -> Array:
            return self._residual(point * scale, fitted, by_slope=by_slope)

        found = least_squares(
            residual,
            np.clip(start, low, high) / scale,
            bounds=(low / scale, high / scale),
            diff_step=np.full(len(start), _STEP),
            max_nfev=_EVALUATIONS,
        )
        self._speeds.clear()
        return float(found.cost), np.asarray(found.x * scale)

    def predict(self, numbers: Array, one: _Record) -> dict[str, Array]:
        """Returns the channels of a run, predicted from its inputs and its first samples only."""
        value = dict(zip(self.names, numbers.tolist(), strict=True))
        speeds = self._simulate(value, one)
        travels = cumulative_trapezoid(speeds, one.clock, axis=0, initial=0)
        found: dict[str, Array] = {}
        for column, wheel in enumerate(self._wheels):
            found |= {wheel.rate: speeds[:, column]} if wheel.rate else {}
            found |= {wheel.travel: travels[:, column] + _origin(one.run, wheel.travel)} if wheel.travel else {}
        if self._body:
            turning = value["yaw"] * np.array([speeds[:, 0] - speeds[:, 1], travels[:, 0] - travels[:, 1]])
            surge = self._metres * np.gradient(speeds.mean(axis=1), one.clock)
            every = {"yaw_rate": turning[0], "yaw_angle": turning[1], "accel_surge": surge}
            found |= {name: every[name] + (_origin(one.run, name) if name == "yaw_angle" else 0) for name in self._body}
        later = {name: value.get(f"delay of {name}", 0.0) for name in found}
        return {name: np.interp(one.clock - later[name], one.clock, values) for name, values in found.items()}

    def _residual(self, numbers: Array, fitted: Sequence[_Record], *, by_slope: bool) -> Array:
        parts = []
        for one in fitted:
            for name, values in self.predict(numbers, one).items():
                spread = self._spread[name]
                if name not in one.run.outputs or spread[by_slope] == 0:
                    continue
                error = one.run.outputs[name] - values
                if by_slope and name in self._summed:
                    error = _slope(one.clock, _filled(one.clock, error))
                parts.append(error[np.isfinite(error)] / spread[by_slope])
        return np.concatenate(parts)

    def _simulate(self, value: Mapping[str, float], one: _Record) -> Array:
        """Returns (n, wheels): the speeds. They are cached, because a descent often changes only a channel's delay."""
        law = [v for name, v in value.items() if not name.startswith("delay of") and name != "yaw"]
        key = (np.array(law).tobytes(), one.run.name)
        if key not in self._speeds:
            if len(self._speeds) > 100:
                self._speeds.clear()
            sides = [wheel.side for wheel in self._wheels]
            numbers = [tuple(value[f"{name}{side}"] for name in ("kS", "kV", "kA")) for side in sides]
            driven = _delayed(one, value["command_delay"])
            self._speeds[key] = _speeds(numbers, value.get("turn", 1.0), driven, np.diff(one.clock), one.first)
        return self._speeds[key]

    def _guess(self, fitted: Sequence[_Record], delay: float) -> Array:
        """Returns first values by linear regression of the voltage on sign, speed and acceleration."""
        value = dict.fromkeys(self.names, 0.0) | {"turn": 1.0}
        value |= {name: delay for name in self.names if "delay" in name}
        for column, wheel in enumerate(self._wheels):
            rows, volts = [], []
            for one in fitted:
                speed = _measured_speed(one.run, wheel, one.clock)
                slope = _slope(one.clock, speed)
                moving = np.abs(speed) > 0.02 * np.max(np.abs(speed), initial=0.0)
                rows.append(np.column_stack([np.sign(speed), speed, slope])[moving])
                volts.append(_delayed(one, delay)[:, column][moving])
            found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(volts), rcond=None)[0]
            per_speed = abs(float(found[1])) or 1.0
            value[f"kS{wheel.side}"] = max(float(found[0]), 0.02 * float(np.max(np.abs(np.concatenate(volts)))))
            value[f"kV{wheel.side}"] = per_speed
            value[f"kA{wheel.side}"] = max(float(found[2]), 0.02 * per_speed)
        if "yaw" in value:
            value["yaw"] = self._yaw_guess(fitted)
        return np.array([value[name] for name in self.names])

    def _yaw_guess(self, fitted: Sequence[_Record]) -> float:
        wheels, rates = [], []
        for one in fitted:
            left, right = (_measured_speed(one.run, wheel, one.clock) for wheel in self._wheels)
            if "yaw_rate" in one.run.outputs:
                rate = one.run.outputs["yaw_rate"]
            elif "yaw_angle" in one.run.outputs:
                rate = _slope(one.clock, _filled(one.clock, one.run.outputs["yaw_angle"]))
            else:
                continue
            known = np.isfinite(rate)
            wheels.append((left - right)[known])
            rates.append(rate[known])
        if not wheels:
            return 0.0
        difference = np.concatenate(wheels)
        return float(difference @ np.concatenate(rates) / max(float(difference @ difference), 1e-300))


def _wheel(dataset: Dataset, side: str) -> _Wheel:
    measured = {name for run in dataset.runs for name in run.outputs if np.isfinite(run.outputs[name]).any()}
    rate = next((f"{name}{side}" for name in _RATES if f"{name}{side}" in measured), None)
    # A travel and a rate belong together if their units do: rad and rad/s, m and m/s.
    order = {"wheel_velocity": "wheel_travel", "velocity": "position", "wheel_speed": "wheel_angle", "speed": "angle"}
    wanted = (order[rate.removesuffix(side)],) if rate else _TRAVELS
    travel = next((f"{name}{side}" for name in wanted if f"{name}{side}" in measured), None)
    if rate is None and travel is None:
        raise InputError("no speed, travel or angle is measured", file=dataset.path, field="signals")
    return _Wheel(side, rate, travel)


def _record(run: Run, dataset: Dataset, wheels: Sequence[_Wheel]) -> _Record:
    clock = run.time - run.time[0]
    inputs = np.nan_to_num(motor_inputs(run, dataset))
    lasting = np.vstack([np.zeros(inputs.shape[1]), np.cumsum(inputs[:-1] * np.diff(clock)[:, np.newaxis], axis=0)])
    return _Record(run, clock, inputs, lasting, tuple(_first_speed(run, wheel, clock) for wheel in wheels))


def _delayed(one: _Record, delay: float) -> Array:
    """Returns (n, wheels): the mean of the delayed voltage over each step.

    Before a run that starts at rest the voltage is 0; before a run that starts in motion it is the first voltage.
    """
    before = one.inputs[0] if any(one.first) else np.zeros_like(one.inputs[0])
    times = one.clock - delay
    columns = [np.interp(times, one.clock, column) for column in one.charge.T]
    lasting = np.column_stack(columns) + np.minimum(times, 0.0)[:, np.newaxis] * before
    steps = np.diff(one.clock)[:, np.newaxis]
    return np.vstack([np.diff(lasting, axis=0) / steps, np.zeros(lasting.shape[1])])


def _speeds(
    numbers: Sequence[Sequence[float]],
    turn: float,
    driven: Array,
    steps: Array,
    first: Sequence[float],
) -> Array:
    """Returns (n, wheels): the speeds. Each wheel stands still while its voltage is below kS.

    A step is exact for one wheel. With two wheels, the mean acceleration of the turn over the step is added.
    """
    speed, rows = list(first), [tuple(first)]
    volts = driven.tolist()
    for k, step in enumerate(steps.tolist()):
        change = [_change(v, u, step, own) for v, u, own in zip(speed, volts[k], numbers, strict=True)]
        if len(speed) > 1:
            mean, half = (change[0] + change[1]) / 2, (change[0] - change[1]) / 2 * turn
            change = [mean + half, mean - half]
        for wheel, more in enumerate(change):
            static = numbers[wheel][0]
            old, new = speed[wheel], speed[wheel] + more
            stops = old * new < 0 and abs(volts[k][wheel]) <= static
            speed[wheel] = 0.0 if stops else new
        rows.append(tuple(speed))
    return np.array(rows)


def _change(v: float, u: float, step: float, numbers: Sequence[float]) -> float:
    """Returns the change of one wheel's speed in a step with constant voltage."""
    static, per_speed, inertia = numbers
    if v != 0:
        friction = static if v > 0 else -static
    elif abs(u) <= static:
        return 0.0
    else:
        friction = static if u > 0 else -static
    return -math.expm1(-step * per_speed / inertia) * ((u - friction) / per_speed - v)


def _first_speed(run: Run, wheel: _Wheel, clock: Array) -> float:
    """Returns the speed at a run's start: 0 unless the first samples all move in one direction."""
    early = slice(0, _MOVING_SAMPLES)
    if wheel.rate is not None and wheel.rate in run.outputs:
        values = run.outputs[wheel.rate][early]
        known = np.isfinite(values)
        if known.sum() < 4 or not (np.all(values[known] > 0) or np.all(values[known] < 0)):
            return 0.0
        return float(np.polyfit(clock[early][known], values[known], 1)[1])
    if wheel.travel is not None and wheel.travel in run.outputs:
        change = np.diff(run.outputs[wheel.travel][early])
        if len(change) and (np.all(change > 0) or np.all(change < 0)):
            return float(np.polyfit(clock[early], run.outputs[wheel.travel][early], 1)[0])
    return 0.0


def _measured_speed(run: Run, wheel: _Wheel, clock: Array) -> Array:
    if wheel.rate is not None and wheel.rate in run.outputs:
        return _filled(clock, run.outputs[wheel.rate])
    if wheel.travel is not None and wheel.travel in run.outputs:
        return _slope(clock, _filled(clock, run.outputs[wheel.travel]))
    return np.zeros_like(clock)


def _slope(clock: Array, values: Array) -> Array:
    """Returns, for each sample, the slope of a line through the samples in a span of `_SMOOTH_S` around it."""
    span = min(max(3, int(_SMOOTH_S / float(np.median(np.diff(clock))))), len(clock))
    samples = np.convolve(np.ones(len(clock)), np.ones(span), "same")

    def mean(numbers: Array) -> Array:
        return np.convolve(numbers, np.ones(span), "same") / samples

    centred, offset = clock - clock.mean(), values - values.mean()
    variance = np.maximum(mean(centred**2) - mean(centred) ** 2, 1e-12)
    return np.asarray((mean(centred * offset) - mean(centred) * mean(offset)) / variance)


def _filled(clock: Array, values: Array) -> Array:
    known = np.isfinite(values)
    return np.interp(clock, clock[known], values[known]) if known.any() else np.zeros_like(clock)


def _origin(run: Run, name: str) -> float:
    values = run.outputs.get(name)
    known = values[np.isfinite(values)] if values is not None else np.empty(0)
    return float(known[0]) if len(known) else 0.0


def _spread(fitted: Sequence[_Record], name: str, *, summed: bool) -> tuple[float, float]:
    """Returns two rms values over the fit runs: of a signal about each run's mean; of its slope if `summed`."""
    values, slopes = [np.zeros(1)], [np.zeros(1)]
    for one in fitted:
        measured = one.run.outputs.get(name, np.empty(0))
        known = np.isfinite(measured)
        if known.any():
            values.append(measured[known] - measured[known].mean())
            slopes.append(_slope(one.clock, _filled(one.clock, measured)) if summed else values[-1])
    return _rms(values), _rms(slopes)


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _metres_per_unit(dataset: Dataset, wheels: Sequence[_Wheel]) -> float:
    """Returns metres per unit of the wheels' speed: 1 for a speed in m/s or a travel in m, otherwise the radius."""
    name = wheels[0].rate or wheels[0].travel or ""
    if "velocity" in name or "travel" in name or name == "position":
        return 1.0
    radius = dataset.nominal.get("wheel_radius")
    return radius.value if radius is not None else 1.0
