"""The stage that plans the next experiment: the manoeuvre that separates the rivals, or the signal to measure."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.finding import NOMINAL_VALUES, Experiment, Manoeuvre
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.verdict import Verdict
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01
_SEPARATES_NOISE_SD = 0.5  # rms, in noise sd: ten seconds of samples show it clearly
_SEPARATES_SIGNAL_SHARE = 0.02  # of a signal's rms: an ordinary sensor shows that
_REST_S = 0.5  # before a manoeuvre
_REVERSALS = (1.6, 1.6, 0.8, 0.8, 0.4, 0.4, 0.2, 0.2, 0.2, 0.2)  # s between them


def plan_experiment(prepared: Prepared, verdict: Verdict) -> Experiment | None:
    """Returns the experiment that separates the best explanation from its rivals; None if it has none."""
    if not verdict.rivals:
        return None
    rivals = {
        " + ".join(one.names) or NOMINAL_VALUES: dataclasses.replace(one.model, by_run={})
        for one in (verdict.best, *verdict.rivals)
    }
    noise_sd = prepared.fine.sample_noise
    return next_experiment(rivals, list(noise_sd), noise_sd, prepared.excitation.largest["voltage"])


def next_experiment(
    rivals: Mapping[str, Model], measured: Sequence[str], noise_sd: Mapping[str, float], volts: float
) -> Experiment:
    """Returns the manoeuvre that separates the fitted `rivals` best in the measured signals.

    Args:
        rivals: name -> fitted model, two or more.
        noise_sd: signal -> noise sd of a sample, SI.
        volts: the largest command of the measured runs.
    """
    vehicle = next(iter(rivals.values())).vehicle
    best: tuple[float, str, Manoeuvre] | None = None
    unmeasured: tuple[float, str | None] = (0.0, None)
    for manoeuvre in manoeuvres(vehicle, volts):
        outputs = _drive(rivals, manoeuvre)
        where, apart = _separation(outputs, {name: noise_sd[name] for name in measured})
        if best is None or apart > best[0]:
            best = (apart, where, manoeuvre)
        others = {
            name: max(float(np.sqrt(np.mean([one[name] ** 2 for one in outputs]))), 1e-9)
            for name in outputs[0]
            if name not in measured and name in _CAN_MEASURE
        }
        if others:
            name, share = _separation(outputs, others)
            if share > unmeasured[0]:
                unmeasured = (share, name)
    names = tuple(rivals)
    separation = best[0] if best else 0.0
    if best is not None and separation >= _SEPARATES_NOISE_SD:
        _, signal, manoeuvre = best
        advice = (
            f'Drive "{manoeuvre.name}", add the run to the data set and run discover again. '
            f"The explanations differ most in {signal}."
        )
        return Experiment(advice, names, separation, signal, manoeuvre)
    if unmeasured[1] is not None and unmeasured[0] > _SEPARATES_SIGNAL_SHARE:
        advice = f"No manoeuvre separates the explanations in the measured signals. Measure {unmeasured[1]} as well."
        return Experiment(advice, names, separation, unmeasured[1], None)
    if NOMINAL_VALUES in rivals:
        advice = "The explanations drive alike. Measure the nominal values again that the fit had to move."
        return Experiment(advice, names, separation, None, None)
    advice = (
        "No manoeuvre and no further signal of the vehicle separates the explanations: they have the same effect. "
        "Examine the part itself, for example time the sensor on its own."
    )
    return Experiment(advice, names, separation, None, None)


_CAN_MEASURE = frozenset(catalogue.outputs()) - {"x", "y", "surge", "sway", "force"}


def _drive(rivals: Mapping[str, Model], manoeuvre: Manoeuvre) -> list[dict[str, Array]]:
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    one = next(iter(rivals.values()))
    inputs = commands(manoeuvre, time)[:, : 1 if one.vehicle == "motor" else 2]
    run = OpenLoopRun(time=time, inputs=inputs)
    return [simulated.outputs for simulated in plant.simulate([(model, run) for model in rivals.values()], threads=2)]


def _separation(outputs: Sequence[Mapping[str, Array]], sizes: Mapping[str, float]) -> tuple[str, float]:
    """Returns the signal in which even the nearest two rivals differ most, and by how much: rms over `sizes`."""
    found = {
        name: min(
            float(np.sqrt(np.mean((one[name] - other[name]) ** 2))) / size for one, other in combinations(outputs, 2)
        )
        for name, size in sizes.items()
        if name in outputs[0]
    }
    best = max(found, key=lambda name: found[name])
    return best, found[best]


def manoeuvres(vehicle: str, volts: float) -> tuple[Manoeuvre, ...]:
    """Returns manoeuvres up to `volts` that each excite one thing. A `motor` uses the left voltage alone."""
    drive = _Drive(volts)
    return drive.straight() if vehicle == "motor" else (*drive.straight(), *drive.turning())


def commands(manoeuvre: Manoeuvre, time: Array) -> Array:
    """Returns (n, 2): the commanded voltage of the left and the right motor at `time` (n,), s."""
    return np.column_stack([_at(points, time) for points in (manoeuvre.voltage_left, manoeuvre.voltage_right)])


def _at(points: Sequence[tuple[float, float]], time: Array) -> Array:
    """Returns (n,): linear between the break points; at a step, the value after it."""
    at, value = np.array(points).T
    index = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
    span = np.where(at[index + 1] > at[index], at[index + 1] - at[index], 1.0)
    return np.asarray(value[index] + (value[index + 1] - value[index]) * np.clip((time - at[index]) / span, 0.0, 1.0))


@dataclass(frozen=True)
class _Drive:
    """Makes manoeuvres from levels in shares of `volts`."""

    volts: float

    def straight(self) -> tuple[Manoeuvre, ...]:
        reversals = [(seconds, 0.5 * (-1) ** k, 0.5 * (-1) ** k) for k, seconds in enumerate(_REVERSALS)]
        return (
            self._steps("forward and back at full power", (3.0, 1.0, 1.0), (3.0, -1.0, -1.0)),
            self._steps("forward and back at a third of the power", (4.0, 0.35, 0.35), (4.0, -0.35, -0.35)),
            self._steps("a staircase of speeds", *((2.0, level, level) for level in (0.2, 0.4, 0.6, 0.8, 1.0))),
            self._ramp("a slow ramp through zero", 0.4, 1.0),
            self._steps("reversals, faster and faster", *reversals),
            self._steps("half a minute at full power", (30.0, 1.0, 1.0)),
            self._steps("creeping", (5.0, 0.12, 0.12), (5.0, -0.12, -0.12)),
        )

    def turning(self) -> tuple[Manoeuvre, ...]:
        one_wheel = ((3.0, 0.6, 0.0), (3.0, 0.0, 0.6), (3.0, -0.6, 0.0), (3.0, 0.0, -0.6))
        return (
            self._steps("spinning right, then left", (4.0, 0.5, -0.5), (4.0, -0.5, 0.5)),
            self._steps("spinning at full power", (4.0, 1.0, -1.0), (4.0, -1.0, 1.0)),
            self._ramp("a slow spin through zero", 0.4, -1.0),
            self._steps("curves to the right and to the left", (4.0, 0.8, 0.4), (4.0, 0.4, 0.8)),
            self._steps("curves backward", (4.0, -0.8, -0.4), (4.0, -0.4, -0.8)),
            self._steps("fast tight curves", (4.0, 1.0, 0.2), (4.0, 0.2, 1.0)),
            self._steps("one wheel at a time", *one_wheel),
        )

    def _steps(self, name: str, *levels: tuple[float, float, float]) -> Manoeuvre:
        """Returns rest, then each level (s, left, right), then rest again."""
        left, right, now = [(0.0, 0.0)], [(0.0, 0.0)], _REST_S
        for seconds, one, other in (*levels, (1.0, 0.0, 0.0)):
            left += [(now, left[-1][1]), (now, one * self.volts)]
            right += [(now, right[-1][1]), (now, other * self.volts)]
            now += seconds
        return Manoeuvre(name, now, (*left, (now, 0.0)), (*right, (now, 0.0)))

    def _ramp(self, name: str, top: float, ratio: float) -> Manoeuvre:
        """Returns a ramp to `top`, down through zero to minus `top`, and back; the right motor gets `ratio` of it."""
        points = ((0.0, 0.0), (4.0, top), (12.0, -top), (16.0, 0.0))
        left = tuple((t, v * self.volts) for t, v in points)
        return Manoeuvre(name, 16.0, left, tuple((t, v * ratio) for t, v in left))
