"""The stage that plans the next experiment: the manoeuvre that separates the rivals, or the signal to measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.discover.finding import NOMINAL_VALUES, Experiment, Manoeuvre
from brickpilot.discover.gates import SEPARATES_NOISE_SD, SEPARATES_SIGNAL_SHARE
from brickpilot.discover.manoeuvres import commands, manoeuvres
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.verdict import Verdict
from brickpilot.discover.written import Written
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01


def plan_experiment(prepared: Prepared, verdict: Verdict, written: Written) -> Experiment | None:
    """Returns the experiment that separates the best explanation from its rivals; None if it has none."""
    if written.composed is not None or not verdict.rivals:
        return None
    rivals = {" + ".join(one.names) or NOMINAL_VALUES: one.model for one in (verdict.best, *verdict.rivals)}
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
    if best is not None and separation >= SEPARATES_NOISE_SD:
        _, signal, manoeuvre = best
        advice = (
            f'Drive "{manoeuvre.name}", add the run to the data set and run discover again. '
            f"The explanations differ most in {signal}."
        )
        return Experiment(advice, names, separation, signal, manoeuvre)
    if unmeasured[1] is not None and unmeasured[0] > SEPARATES_SIGNAL_SHARE:
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
