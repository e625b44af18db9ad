"""What to drive next: the manoeuvre that separates the rivals, or those that tell more than the runs do.

`plan_experiment` is a stage of discovery, `advise` a part of `check`. Each manoeuvre is simulated with the calibrated
nominal model, with every parameter a little off and with every effect. What it tells is added to what the runs tell, as
information adds up (Atkinson, Donev & Tobias 2007, Optimum experimental designs, ch. 9).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.dataset import Run
from brickpilot.data.motion import cut_into_windows
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import NOMINAL_VALUES, Experiment, Visible
from brickpilot.discover.parts import Part, least_of, library_parts, limit_of, scale_of, scanned_parameter
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import Probe, probes_of, signature_strengths
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import of_bins, rms_of
from brickpilot.vehicle import plant
from brickpilot.vehicle.manoeuvres import Manoeuvre, commands, manoeuvres
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01  # between the samples of a simulated manoeuvre
_SEPARATES_NOISE_SD = 0.5  # rms, in noise sd: ten seconds of samples show it clearly
_SEPARATES_SIGNAL_SHARE = 0.02  # of a signal's rms: an ordinary sensor shows that
_NO_FLOOR = 1e-3  # of a floor
_BLACK_BOX_FINDS = 0.5  # of the squares that a law explains, about: measured near the sizes that are named
_CAN_MEASURE = frozenset(catalogue.outputs()) - {"x", "y", "surge", "sway", "force"}


def plan_experiment(prepared: Prepared, verdict: Verdict) -> Experiment | None:
    """Returns the experiment that separates the best explanation from its rivals; None if it has none."""
    if not verdict.rivals:
        return None
    rivals = {
        " + ".join(one.names) or NOMINAL_VALUES: dataclasses.replace(one.model, by_run={})
        for one in (verdict.best, *verdict.rivals)
    }
    return next_experiment(rivals, prepared.fine.sample_noise, prepared.excitation.largest["voltage"])


def next_experiment(rivals: Mapping[str, Model], noise_sd: Mapping[str, float], volts: float) -> Experiment:
    """Returns the manoeuvre that separates the fitted `rivals` best in the measured signals.

    Args:
        rivals: name -> fitted model, two or more.
        noise_sd: measured signal -> noise sd of a sample, SI.
        volts: the largest command of the measured runs.
    """
    vehicle = next(iter(rivals.values())).vehicle
    measured: list[tuple[float, str, Manoeuvre]] = []
    unmeasured = [(0.0, "")]
    for one in manoeuvres(vehicle, volts):
        run = _as_run(one, vehicle)
        simulated = plant.simulate([(model, run) for model in rivals.values()], threads=2)
        outputs = [each.outputs for each in simulated]
        measured.append((*_separation(outputs, noise_sd), one))
        others = [name for name in outputs[0] if name in _CAN_MEASURE and name not in noise_sd]
        sizes = {name: max(rms_of([each[name] for each in outputs]), 1e-9) for name in others}
        unmeasured += [_separation(outputs, sizes)] if sizes else []
    separation, signal, manoeuvre = max(measured, key=lambda one: one[0])
    share, other = max(unmeasured, key=lambda one: one[0])
    names = tuple(rivals)
    if separation >= _SEPARATES_NOISE_SD:
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


def _as_run(manoeuvre: Manoeuvre, vehicle: str) -> OpenLoopRun:
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    return OpenLoopRun(time=time, inputs=commands(manoeuvre, time)[:, : 1 if vehicle == "motor" else 2])


def _separation(outputs: Sequence[Mapping[str, Array]], sizes: Mapping[str, float]) -> tuple[float, str]:
    """Returns by how much even the nearest two rivals differ, rms over `sizes`, and in which signal that is most."""
    return max(
        (
            (min(rms_of([one[name] - other[name]]) for one, other in combinations(outputs, 2)) / size, name)
            for name, size in sizes.items()
            if name in outputs[0]
        ),
        key=lambda one: one[0],
    )


def smallest_sizes(prepared: Prepared, judge: Judge, nominal: Explanation, best: Explanation) -> dict[str, Visible]:
    """Returns effect -> the size at which it would be named beside `best`: what a verdict of `none` is worth.

    It would be named if it predicted better by what counts as sure, and its prior odds; and if it removed as much as
    would still be left, or a black box found it in a signal: see `verdict`. The size is extrapolated from the nearest
    simulated size. Effects that nothing here excites are left out.

    Args:
        judge: of the coarse residual.
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
        surely, info = _size_named(part, size, float(strength.sum()), temperature), _size_of(part)
        wanted = max(surely, size * math.sqrt(times), least_of(info))
        if wanted <= info.maximum:
            tried.append((part, size, wanted))
    nearest = sorted(_nearest(tried), key=lambda one: one[0].effect)
    return {part.effect: Visible(_size_of(part).name, size, _size_of(part).unit) for part, size in nearest}


def _times(strength: Array, hidden: Array, needed: float) -> float:
    """Returns the least x for which x `strength` is `needed` nats above `hidden`, both (signals,), in all signals."""
    order = np.argsort(hidden / strength)
    return float(np.min((needed + np.cumsum(hidden[order])) / np.cumsum(strength[order])))


def _size_named(part: Part, size: float, strength: float, temperature: float) -> float:
    """Returns the size at which a part surely predicts better: from `size`, which shows with so many nats."""
    return size * math.sqrt(temperature * (numbers.CHANCE_NATS - part.log_odds) / max(strength, 1e-12))


def _size_of(part: Part) -> ParameterInfo:
    """Returns the first free parameter of a part."""
    return next(one for one in catalogue.effect(part.effect).parameters if one.name == part.free[0])


def _nearest(tried: Iterable[tuple[Part, float, float]]) -> list[tuple[Part, float]]:
    """Returns for each effect a part and the size that it needs: of (part, size tried, size needed) the nearest two."""
    found: dict[str, tuple[float, Part, float]] = {}
    for part, size, needed in tried:
        away = abs(math.log(needed / size)) if size > 0 and needed > 0 else math.inf
        if math.isfinite(away) and (part.effect not in found or away < found[part.effect][0]):
            found[part.effect] = (away, part, needed)
    return [(part, needed) for _, part, needed in found.values()]


_WINDOW_S = 1.0  # of a motor, as `prepare` cuts its runs
_MANOEUVRES = 3  # advised, at most
_SHARPER = 0.5  # a manoeuvre tells of a parameter if the interval becomes narrower by this factor
_UNKNOWN = 0.1  # and was wider than this, sd, in the logarithm or as a share of what is stated


@dataclass(frozen=True)
class Advice:
    """One manoeuvre that would tell more.

    Attributes:
        effects: those that it would show at a usual size, which neither the runs nor the manoeuvres before it do.
        parameters: those whose intervals it would make less than half as wide.
    """

    manoeuvre: Manoeuvre
    effects: tuple[str, ...]
    parameters: tuple[str, ...]


def advise(
    prepared: Prepared, nominal: Explanation, visible: Mapping[str, Visible], temperature: float
) -> tuple[tuple[Advice, ...], tuple[str, ...]]:
    """Returns the manoeuvres that would tell most beside the runs, and the effects that no size of shows in the runs.

    An effect that neither the runs nor any manoeuvre changes the measured signals by is left out: it is of another
    vehicle or of another sensor.

    Args:
        nominal: fitted to the fit runs.
        visible: effect -> the smallest size that the runs show.
        temperature: the nats that count as one.
    """
    problem = Problem(prepared.coarse, nominal.plan)
    asked = _Asked.of(prepared, nominal, problem.prior_slopes(nominal.point), temperature)
    now = asked.information(problem, nominal.point)
    offered = manoeuvres(nominal.model.vehicle, prepared.excitation.largest["voltage"])
    driven = ((one, _driven(prepared, nominal, one)) for one in offered)
    more = [(one, asked.information(told, nominal.point)) for one, told in driven if told is not None]
    largest = np.max([np.diag(known)[len(nominal.point) :] for known in (now, *(known for _, known in more))], axis=0)
    possible = {probe.part.effect for probe, one in zip(asked.probes, largest, strict=True) if one > 0}
    shown = {name for name, one in visible.items() if one.size <= asked.usual.get((name, one.parameter), 0.0)}
    shown |= asked.shown(now)
    found: list[Advice] = []
    while more and len(found) < _MANOEUVRES:
        offers = [
            Advice(one, tuple(sorted(asked.shown(now + known) - shown)), asked.sharper(now, now + known))
            for one, known in more
        ]
        best = max(range(len(more)), key=lambda k: len(offers[k].effects) + len(offers[k].parameters))
        if not (offers[best].effects or offers[best].parameters):
            break
        found.append(offers[best])
        now, shown = now + more.pop(best)[1], shown | set(offers[best].effects)
    return tuple(found), tuple(sorted(possible - visible.keys()))


@dataclass(frozen=True)
class _Asked:
    """What is asked of runs: how well they tell the nominal parameters, and which effects they show at a usual size.

    What runs tell is their information, (parameters + probes, parameters + probes): the products of how the residual
    changes with each parameter and with each probe. It adds up over runs.

    Attributes:
        probes: of every effect of one size that can be extrapolated.
        usual: effect, parameter -> a usual size on this vehicle: that of the catalogue, scaled to it.
        prior: (parameters, parameters) information of what is stated of the parameters.
        temperature: the nats that count as one.
    """

    plan: Plan
    probes: Sequence[Probe]
    usual: Mapping[tuple[str, str], float]
    prior: Array
    temperature: float

    @classmethod
    def of(cls, prepared: Prepared, nominal: Explanation, prior_slopes: Array, temperature: float) -> _Asked:
        base = nominal.model
        few = [
            one
            for one in library_parts(base, prepared.coarse.signals)
            if len(one.free) == 1 and scanned_parameter(one) is None and limit_of(one) is None
        ]
        probes = [probe for one in few for probe in probes_of(one, base, prepared.excitation)]
        infos = {(one.effect, one.free[0]): _size_of(one) for one in few}
        usual = {key: (info.preset or info.trial) * scale_of(info.unit, base) for key, info in infos.items()}
        plan = dataclasses.replace(nominal.plan, model=base)
        return cls(plan, probes, usual, prior_slopes.T @ prior_slopes, temperature)

    def information(self, problem: Problem, point: Array) -> Array:
        """Returns what the runs of `problem` tell, at the coordinates `point` of the nominal parameters."""
        data = problem.data
        plain = data.predict([self.plan.model])[0]
        models = [probe.part.starting(self.plan, probe.values[0]).model for probe in self.probes]
        changes = data.predict(models) - plain if models else np.empty((0, len(plain)))
        changes = np.where(np.isfinite(changes).all(axis=1, keepdims=True), changes, 0.0)
        weight = data.weight()[:, np.newaxis]
        moved = np.hstack([problem.sensitivity(point) * weight, changes.T * weight])
        return np.asarray(moved.T @ moved)

    def shown(self, known: Array) -> set[str]:
        """Returns the effects of which what the parameters cannot take up is large enough at a usual size."""
        count = len(self.prior)
        cross = known[:count, count:]
        taken = np.linalg.solve(known[:count, :count] + self.prior, cross)
        strength = (np.diag(known)[count:] - np.sum(cross * taken, axis=0)) / 2
        sizes = [abs(probe.values[0][probe.part.free[0]]) for probe in self.probes]
        tried = [
            (probe.part, size, _size_named(probe.part, size, one, self.temperature))
            for probe, size, one in zip(self.probes, sizes, strength.tolist(), strict=True)
        ]
        return {part.effect for part, size in _nearest(tried) if size <= self.usual[part.effect, part.free[0]]}

    def sharper(self, before: Array, after: Array) -> tuple[str, ...]:
        """Returns the parameters that are badly known by some information, and much better by more of it."""
        count = len(self.prior)
        wide, narrow = (np.sqrt(np.diag(np.linalg.inv(one[:count, :count] + self.prior))) for one in (before, after))
        better = (narrow < _SHARPER * wide) & (wide > _UNKNOWN)
        return tuple(free.name for free, is_so in zip(self.plan.free, better, strict=True) if is_so)


def _driven(prepared: Prepared, nominal: Explanation, manoeuvre: Manoeuvre) -> Problem | None:
    """Returns the nominal parameters beside a manoeuvre that is driven; None where no signal tells of them."""
    dataset = prepared.dataset
    driven = _as_run(manoeuvre, dataset.vehicle)
    sides = ("voltage",) if dataset.vehicle == "motor" else ("voltage_left", "voltage_right")
    outputs = plant.simulate([(nominal.model, driven)])[0].outputs
    measured = [name for name in dict.fromkeys(name for run in dataset.runs for name in run.outputs) if name in outputs]
    inputs, wanted = dict(zip(sides, driven.inputs.T, strict=True)), {name: outputs[name] for name in measured}
    run = Run(manoeuvre.name, dataset.path, "fit", driven.time, inputs, wanted, {}, 0.0, None, {})
    alone = dataclasses.replace(dataset, runs=(run,), faults=(), notes=())
    if dataset.vehicle == "motor":
        alone = cut_into_windows(alone, {run.name: driven.inputs}, _WINDOW_S) or alone
    if not alone.runs:
        return None
    names = [one.name for one in alone.runs]
    data = of_bins(alone, nominal.plan.model, names, width_s=numbers.BIN_S, coarse=True, threads=prepared.jobs)
    return Problem(data.weighed_like(prepared.coarse), nominal.plan)
