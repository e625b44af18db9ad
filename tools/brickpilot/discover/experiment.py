"""What to do next: the manoeuvre in which explanations that fit the same data differ most, or the signal to measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.compose import Composed
from brickpilot.discover.finding import Experiment, Manoeuvre
from brickpilot.discover.gates import SEPARATES_NOISE_SD, SEPARATES_SIGNAL_SHARE
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.verdict import Verdict
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01


def manoeuvres(vehicle: str, volts: float) -> tuple[Manoeuvre, ...]:
    """Ways of driving that excite one thing at a time, up to `volts`. A `motor` is driven by its left voltage alone."""

    def made(name: str, *levels: tuple[float, float, float]) -> Manoeuvre:
        """Rest, then each level, (s, left, right) in shares of `volts`, then rest again."""
        left, right, now = [(0.0, 0.0)], [(0.0, 0.0)], 0.5
        for seconds, one, other in (*levels, (1.0, 0.0, 0.0)):
            left += [(now, left[-1][1]), (now, one * volts)]
            right += [(now, right[-1][1]), (now, other * volts)]
            now += seconds
        return Manoeuvre(name, now, (*left, (now, 0.0)), (*right, (now, 0.0)))

    def ramped(name: str, top: float, ratio: float) -> Manoeuvre:
        points = ((0.0, 0.0), (4.0, top), (12.0, -top), (16.0, 0.0))
        left = tuple((t, v * volts) for t, v in points)
        return Manoeuvre(name, 16.0, left, tuple((t, v * ratio) for t, v in left))

    straight = (
        made("forward and back at full power", (3.0, 1.0, 1.0), (3.0, -1.0, -1.0)),
        made("forward and back at a third of the power", (4.0, 0.35, 0.35), (4.0, -0.35, -0.35)),
        made("a staircase of speeds", *((2.0, level, level) for level in (0.2, 0.4, 0.6, 0.8, 1.0))),
        ramped("a slow ramp through zero", 0.4, 1.0),
        made(
            "reversals, faster and faster",
            *(
                (s, a, a)
                for s, a in (
                    (1.6, 0.5),
                    (1.6, -0.5),
                    (0.8, 0.5),
                    (0.8, -0.5),
                    (0.4, 0.5),
                    (0.4, -0.5),
                    (0.2, 0.5),
                    (0.2, -0.5),
                    (0.2, 0.5),
                    (0.2, -0.5),
                )
            ),
        ),
        made("half a minute at full power", (30.0, 1.0, 1.0)),
        made("creeping", (5.0, 0.12, 0.12), (5.0, -0.12, -0.12)),
    )
    if vehicle == "motor":
        return straight
    return (
        *straight,
        made("spinning right, then left", (4.0, 0.5, -0.5), (4.0, -0.5, 0.5)),
        made("spinning at full power", (4.0, 1.0, -1.0), (4.0, -1.0, 1.0)),
        ramped("a slow spin through zero", 0.4, -1.0),
        made("curves to the right and to the left", (4.0, 0.8, 0.4), (4.0, 0.4, 0.8)),
        made("curves backward", (4.0, -0.8, -0.4), (4.0, -0.4, -0.8)),
        made("fast tight curves", (4.0, 1.0, 0.2), (4.0, 0.2, 1.0)),
        made("one wheel at a time", (3.0, 0.6, 0.0), (3.0, 0.0, 0.6), (3.0, -0.6, 0.0), (3.0, 0.0, -0.6)),
    )


def plan_experiment(prepared: Prepared, verdict: Verdict, composed: Composed | None) -> Experiment | None:
    """Returns the experiment that separates the rivals of an ambiguous verdict; None for other verdicts."""
    if composed is not None or verdict.kind != "ambiguous":
        return None
    rivals = {" + ".join(one.names): one.model for one in (verdict.best, *verdict.rivals)}
    noise_sd = prepared.fine.sample_noise
    return next_experiment(rivals, list(noise_sd), noise_sd, prepared.excitation.largest["voltage"])


def next_experiment(
    rivals: Mapping[str, Model], measured: Sequence[str], noise_sd: Mapping[str, float], volts: float
) -> Experiment:
    """The manoeuvre that tells `rivals`, as they are fitted, apart best in what is measured.

    Args:
        rivals: name -> fitted model, two or more.
        noise_sd: signal -> of a sample, SI.
        volts: the largest command that was given.
    """
    vehicle = next(iter(rivals.values())).vehicle
    best: tuple[float, str, Manoeuvre] | None = None
    unmeasured: tuple[float, str | None] = (0.0, None)
    for manoeuvre in manoeuvres(vehicle, volts):
        outputs = _drive(rivals, manoeuvre)
        where, apart = _apart(outputs, {name: noise_sd[name] for name in measured})
        if best is None or apart > best[0]:
            best = (apart, where, manoeuvre)
        others = {
            name: max(float(np.sqrt(np.mean([one[name] ** 2 for one in outputs]))), 1e-9)
            for name in outputs[0]
            if name not in measured and name in _CAN_MEASURE
        }
        if others:
            name, share = _apart(outputs, others)
            if share > unmeasured[0]:
                unmeasured = (share, name)
    names = tuple(rivals)
    separation = best[0] if best else 0.0
    if best is not None and separation >= SEPARATES_NOISE_SD:
        _, signal, manoeuvre = best
        advice = (
            f'Drive "{manoeuvre.name}", add the run to the data set and run discover again: {signal} tells them apart.'
        )
        return Experiment(advice, names, separation, signal, manoeuvre)
    if unmeasured[1] is not None and unmeasured[0] > SEPARATES_SIGNAL_SHARE:
        advice = f"No way of driving tells them apart in what is measured. Measure {unmeasured[1]} as well."
        return Experiment(advice, names, separation, unmeasured[1], None)
    advice = (
        "Neither another way of driving nor another signal of the vehicle tells them apart: both say the same of it. "
        "Only a look at the part itself does, such as timing the sensor on its own."
    )
    return Experiment(advice, names, separation, None, None)


_CAN_MEASURE = frozenset(catalogue.outputs()) - {"x", "y", "surge", "sway", "force"}


def _drive(rivals: Mapping[str, Model], manoeuvre: Manoeuvre) -> list[dict[str, Array]]:
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    sides = [_held(time, points) for points in (manoeuvre.voltage_left, manoeuvre.voltage_right)]
    one = next(iter(rivals.values()))
    inputs = np.column_stack(sides[:1] if one.vehicle == "motor" else sides)
    run = OpenLoopRun(time=time, inputs=inputs)
    return [simulated.outputs for simulated in plant.simulate([(model, run) for model in rivals.values()], threads=2)]


def _held(time: Array, points: Sequence[tuple[float, float]]) -> Array:
    """Linear between the break points; at a step, the value after it."""
    at, value = np.array(points).T
    index = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
    span = np.where(at[index + 1] > at[index], at[index + 1] - at[index], 1.0)
    return np.asarray(value[index] + (value[index + 1] - value[index]) * np.clip((time - at[index]) / span, 0.0, 1.0))


def _apart(outputs: Sequence[Mapping[str, Array]], sizes: Mapping[str, float]) -> tuple[str, float]:
    """The signal in which even the nearest two differ most, and by how much, in `sizes`, rms."""
    found = {
        name: min(
            float(np.sqrt(np.mean((one[name] - other[name]) ** 2))) / size for one, other in combinations(outputs, 2)
        )
        for name, size in sizes.items()
        if name in outputs[0]
    }
    best = max(found, key=lambda name: found[name])
    return best, found[best]
