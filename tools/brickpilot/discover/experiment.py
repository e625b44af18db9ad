"""The next experiment: the manoeuvre in which rival explanations differ most; and the smallest visible effects."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import NOMINAL_VALUES, Experiment, Visible
from brickpilot.discover.parts import Part, least_of, library_parts
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import signature_strengths
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import rms_of
from brickpilot.vehicle import plant
from brickpilot.vehicle.manoeuvres import Manoeuvre, commands, manoeuvres
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01  # time between the samples of a simulated manoeuvre
SEPARATES_NOISE_SD = 0.5  # least rms difference between rivals, in noise sd, that ten seconds of samples show clearly
_SEPARATES_SIGNAL_SHARE = 0.02  # a sensor is proposed if rivals differ by this share of its signal's rms, or more
_NO_FLOOR = 1e-3  # least scale of a residual, as a share of the floor: so small that the floor has no effect
_BLACK_BOX_FINDS = 0.5  # rough share of a law's squared signature that a black box predicts, if the law is just visible
_CAN_MEASURE = frozenset(catalogue.outputs()) - {"x", "y", "surge", "sway", "force"}


def plan_experiment(prepared: Prepared, verdict: Verdict) -> Experiment | None:
    """Returns the experiment that separates the best explanation from its rivals; None without rivals."""
    if not verdict.rivals:
        return None
    rivals = {
        " + ".join(explanation.names) or NOMINAL_VALUES: dataclasses.replace(explanation.model, by_run={})
        for explanation in (verdict.best, *verdict.rivals)
    }
    return next_experiment(rivals, prepared.fine.sample_noise, prepared.excitation.largest["voltage"])


def next_experiment(rivals: Mapping[str, Model], noise_sd: Mapping[str, float], volts: float) -> Experiment:
    """Returns the manoeuvre that separates the fitted `rivals` best in the measured signals.

    Args:
        rivals: name -> fitted model, two or more.
        noise_sd: measured signal -> noise sd of a sample, SI.
        volts: the largest command of the measured runs, V.
    """
    vehicle = next(iter(rivals.values())).vehicle
    measured: list[tuple[float, str, Manoeuvre]] = []
    unmeasured = [(0.0, "")]
    for one in manoeuvres(vehicle, volts):
        run = as_run(one, vehicle)
        simulated = plant.simulate([(model, run) for model in rivals.values()], threads=2)
        outputs = [each.outputs for each in simulated]
        measured.append((*rms_apart(outputs, noise_sd), one))
        others = [name for name in outputs[0] if name in _CAN_MEASURE and name not in noise_sd]
        sizes = {name: max(rms_of([each[name] for each in outputs]), 1e-9) for name in others}
        unmeasured += [rms_apart(outputs, sizes)] if sizes else []
    separation, signal, manoeuvre = max(measured, key=lambda one: one[0])
    share, other = max(unmeasured, key=lambda one: one[0])
    names = tuple(rivals)
    if separation >= SEPARATES_NOISE_SD:
        advice = (
            f'Drive "{manoeuvre.name}", add the run to the data set and run discover again. '
            f"The explanations differ most in {signal}."
        )
        return Experiment(advice, names, separation, signal, manoeuvre)
    if NOMINAL_VALUES in rivals:
        advice = "The explanations drive alike. Measure the nominal values again that the fit had to move."
    elif share > _SEPARATES_SIGNAL_SHARE:
        advice = f"No manoeuvre separates the explanations in the measured signals. Measure {other} as well."
        return Experiment(advice, names, separation, other, None)
    else:
        advice = (
            "No manoeuvre and no further signal of the vehicle separates the explanations: they have the same effect. "
            "Examine the part itself, for example time the sensor on its own."
        )
    return Experiment(advice, names, separation, None, None)


def as_run(manoeuvre: Manoeuvre, vehicle: str) -> OpenLoopRun:
    """Returns a manoeuvre as a vehicle drives it: from rest, with a sample every 10 ms."""
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    return OpenLoopRun(time=time, inputs=commands(manoeuvre, time)[:, : 1 if vehicle == "motor" else 2])


def rms_apart(outputs: Sequence[Mapping[str, Array]], sizes: Mapping[str, float]) -> tuple[float, str]:
    """Returns (rms, signal): in this signal, the two most similar rivals differ most, by this rms in `sizes`."""
    return max(
        (
            (min(rms_of([one[name] - other[name]]) for one, other in combinations(outputs, 2)) / size, name)
            for name, size in sizes.items()
            if name in outputs[0]
        ),
        key=lambda one: one[0],
    )


def smallest_sizes(prepared: Prepared, judge: Judge, nominal: Explanation, best: Explanation) -> dict[str, Visible]:
    """Returns effect -> the least size that would be named beside `best`. A verdict `none` rules out larger sizes.

    A named effect surely improves the prediction, despite its prior odds. It also removes as much error as it leaves,
    or is so large that a black box would predict it: see `verdict`. The size is extrapolated from the nearest simulated
    size. Effects that the runs do not excite are left out.

    Args:
        judge: the judge of the coarse residual.
        nominal: the calibrated nominal model.
    """
    here = Problem(prepared.coarse, best.plan).keeping(best.point, len(best.point))
    known, nothing = judge.of_explanation(best), judge.of_explanation(nominal)
    temperature, left = judge.temperature(known, nothing), judge.excess(known)
    own = judge.shape * np.maximum(judge.excess(nothing) - left, 0.0) / 2
    needed = max(float(left.sum()) / 2, temperature * numbers.CHANCE_NATS * bool(own.any()))
    hidden = own + (left - judge.excess(known, _NO_FLOOR)) / 2
    predictable = numbers.SHARED_REST * (np.array([*judge.counts.values()]) + left) / 2 / _BLACK_BOX_FINDS
    chosen, tried = library_parts(best.model, here.data.signals), []
    for part, values, strength in signature_strengths(here, best.point, chosen, excitation=prepared.excitation):
        size, strength = abs(values[part.free[0]]), np.maximum(strength, 1e-12)
        times = min(_times(strength, hidden, needed), float(np.min(predictable / strength)))
        surely, info = size_named(part, size, float(strength.sum()), temperature), size_of(part)
        wanted = max(surely, size * math.sqrt(times), least_of(info))
        if wanted <= info.maximum:
            tried.append((part, size, wanted))
    nearest = sorted(nearest_sizes(tried), key=lambda one: one[0].effect)
    return {part.effect: Visible(size_of(part).name, size, size_of(part).unit) for part, size in nearest}


def _times(strength: Array, hidden: Array, needed: float) -> float:
    """Returns the least x for which `max(x strength - hidden, 0)`, summed over the signals, is `needed` nats."""
    order = np.argsort(hidden / strength)
    return float(np.min((needed + np.cumsum(hidden[order])) / np.cumsum(strength[order])))


def size_named(part: Part, size: float, strength: float, temperature: float) -> float:
    """Returns the least size at which a part surely improves the prediction. A size `size` gains `strength` nats."""
    return size * math.sqrt(temperature * (numbers.CHANCE_NATS - part.log_odds) / max(strength, 1e-12))


def size_of(part: Part) -> ParameterInfo:
    """Returns the first free parameter of a part."""
    return next(row for row in catalogue.effect(part.effect).parameters if row.name == part.free[0])


def nearest_sizes(tried: Iterable[tuple[Part, float, float]]) -> list[tuple[Part, float]]:
    """Returns, for each effect, the part whose needed size is nearest to a simulated size, and the needed size."""
    found: dict[str, tuple[float, Part, float]] = {}
    for part, size, needed in tried:
        away = abs(math.log(needed / size)) if size > 0 and needed > 0 else math.inf
        if math.isfinite(away) and (part.effect not in found or away < found[part.effect][0]):
            found[part.effect] = (away, part, needed)
    return [(part, needed) for _, part, needed in found.values()]
