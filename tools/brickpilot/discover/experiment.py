"""What to drive next: the manoeuvre that separates the rivals, or those that tell more than the runs do.

`plan_experiment` is a stage of discovery, `advise` a part of `check`. Each manoeuvre is simulated with the calibrated
nominal model, with every parameter a little off and with every effect. What it tells is added to what the runs tell, as
information adds up (Atkinson, Donev & Tobias 2007, Optimum experimental designs, ch. 9).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Run
from brickpilot.discover import numbers
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import NOMINAL_VALUES, Experiment, Manoeuvre, Visible
from brickpilot.discover.parts import library_parts, limit_of, scale_of, scanned_parameter
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import Probe, probes_of
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.residual import Problem, of_bins
from brickpilot.fit.start_state import cut_into_windows
from brickpilot.fit.uncertainty import Uncertainty
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01  # between the samples of a simulated manoeuvre
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
    return next_experiment(rivals, noise_sd, prepared.excitation.largest["voltage"])


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
    for manoeuvre in manoeuvres(vehicle, volts):
        outputs = _drive(rivals, manoeuvre)
        signal, separation = _separation(outputs, noise_sd)
        measured.append((separation, signal, manoeuvre))
        others = {
            name: max(float(np.sqrt(np.mean([one[name] ** 2 for one in outputs]))), 1e-9)
            for name in outputs[0]
            if name not in noise_sd and name in _CAN_MEASURE
        }
        if others:
            unmeasured.append(_separation(outputs, others)[::-1])
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


_CAN_MEASURE = frozenset(catalogue.outputs()) - {"x", "y", "surge", "sway", "force"}


def _drive(rivals: Mapping[str, Model], manoeuvre: Manoeuvre) -> list[dict[str, Array]]:
    run = _as_run(manoeuvre, next(iter(rivals.values())).vehicle)
    return [simulated.outputs for simulated in plant.simulate([(model, run) for model in rivals.values()], threads=2)]


def _as_run(manoeuvre: Manoeuvre, vehicle: str) -> OpenLoopRun:
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    return OpenLoopRun(time=time, inputs=commands(manoeuvre, time)[:, : 1 if vehicle == "motor" else 2])


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


@dataclass(frozen=True)
class _Information:
    """What some runs tell, in scales of the residual. It adds up over runs.

    Attributes:
        parameters: (p, p) of the nominal parameters.
        cross: (probes, p) between each probe and the parameters.
        own: (probes,) of each probe.
    """

    parameters: Array
    cross: Array
    own: Array

    def __add__(self, other: _Information) -> _Information:
        return _Information(self.parameters + other.parameters, self.cross + other.cross, self.own + other.own)


def advise(
    prepared: Prepared, nominal: Explanation, told: Uncertainty, visible: Mapping[str, Visible], gate: float
) -> tuple[tuple[Advice, ...], tuple[str, ...]]:
    """Returns the manoeuvres that would tell most beside the runs, and the effects that no size of shows in the runs.

    An effect that neither the runs nor any manoeuvre changes the measured signals by is left out: it is of another
    vehicle or of another sensor.

    Args:
        nominal: fitted to the fit runs.
        told: of its parameters.
        visible: effect -> the smallest size that the runs show.
        gate: nats by which an effect has to predict better to be named.
    """
    base, problem = nominal.model, Problem(prepared.coarse, nominal.plan)
    probes = _probes(prepared, nominal)
    prior = problem.prior_slopes(nominal.point)
    seen = _Seen(probes, _usual_sizes(probes, base), prior.T @ prior, gate)
    now = _information(problem, nominal, probes)
    offered = manoeuvres(base.vehicle, prepared.excitation.largest["voltage"])
    more = [(one, told_by) for one in offered if (told_by := _driven(prepared, nominal, one, probes)) is not None]
    possible = {
        probe.part.effect
        for index, probe in enumerate(probes)
        if any(one.own[index] > 0 for one in (now, *(known for _, known in more)))
    }
    shown = seen.shown(now) | {name for name, one in visible.items() if one.size <= seen.usual.get(name, 0.0)}
    found: list[Advice] = []
    while more and len(found) < _MANOEUVRES:
        offers = [
            Advice(
                drive,
                tuple(sorted(seen.shown(now + known) - shown)),
                _sharper(nominal, told, seen.sd(now), seen.sd(now + known)),
            )
            for drive, known in more
        ]
        best = max(range(len(more)), key=lambda k: len(offers[k].effects) + len(offers[k].parameters))
        if not (offers[best].effects or offers[best].parameters):
            break
        found.append(offers[best])
        now, shown = now + more.pop(best)[1], shown | set(offers[best].effects)
    return tuple(found), tuple(sorted(possible - visible.keys()))


def _probes(prepared: Prepared, nominal: Explanation) -> list[Probe]:
    """Returns the probes of every effect of one size that can be extrapolated."""
    base = nominal.model
    few = [
        one
        for one in library_parts(base, prepared.coarse.signals)
        if len(one.free) == 1 and scanned_parameter(one) is None and limit_of(one) is None
    ]
    return [probe for one in few for probe in probes_of(one, base, prepared.excitation)]


def _usual_sizes(probes: Sequence[Probe], base: Model) -> dict[str, float]:
    """Returns effect -> a usual size on this vehicle: that of the catalogue, scaled to it."""
    found = {}
    for part in {probe.part.effect: probe.part for probe in probes}.values():
        infos = catalogue.effect(part.effect).parameters
        info = next(one for one in infos if one.name == part.free[0])
        found[part.effect] = (info.preset or info.trial) * scale_of(info.unit, base)
    return found


@dataclass(frozen=True)
class _Seen:
    """What information shows: which effects at a usual size, and how well the parameters are known.

    Attributes:
        usual: effect -> its usual size.
        prior: (p, p) information of what is stated of the parameters.
        gate: what an effect has to gain to be named.
    """

    probes: Sequence[Probe]
    usual: Mapping[str, float]
    prior: Array
    gate: float

    def shown(self, known: _Information) -> set[str]:
        """Returns the effects of which what the parameters cannot take up is large enough at a usual size.

        It is extrapolated from the probe that needs least of it, as `conclude.smallest_sizes` does.
        """
        taken = np.linalg.solve(known.parameters + self.prior, known.cross.T)
        strength = np.maximum((known.own - np.sum(known.cross.T * taken, axis=0)) / 2, 1e-12)
        nearest: dict[str, tuple[float, float]] = {}
        for probe, one in zip(self.probes, strength, strict=True):
            effect, factor = probe.part.effect, math.sqrt(self.gate / one)
            size = abs(probe.values[0][probe.part.free[0]])
            if size > 0 and (effect not in nearest or abs(math.log(factor)) < nearest[effect][0]):
                nearest[effect] = (abs(math.log(factor)), size * factor)
        return {effect for effect, (_, size) in nearest.items() if size <= self.usual[effect]}

    def sd(self, known: _Information) -> Array:
        """Returns (p,): the sd of the parameters' coordinates."""
        return np.sqrt(np.diag(np.linalg.inv(known.parameters + self.prior)))


def _information(problem: Problem, nominal: Explanation, probes: Sequence[Probe]) -> _Information:
    """Returns what the runs of `problem` tell about the parameters of `nominal` and about each probe beside them."""
    base = nominal.model
    plan = dataclasses.replace(nominal.plan, model=base)
    data = problem.data
    slopes = problem.sensitivity(nominal.point) * data.weight()[:, np.newaxis]
    plain = data.predict([base])[0]
    models = [probe.part.starting(plan, probe.values[0]).model for probe in probes]
    changes = (data.predict(models) - plain) * data.weight() if models else np.empty((0, len(plain)))
    changes = np.where(np.isfinite(changes).all(axis=1, keepdims=True), changes, 0.0)
    return _Information(slopes.T @ slopes, changes @ slopes, np.sum(changes**2, axis=1))


def _sharper(nominal: Explanation, told: Uncertainty, wide: Array, narrow: Array) -> tuple[str, ...]:
    """Returns the parameters that were badly known and become much better known; sds before and after, (p,)."""
    better = (narrow < _SHARPER * wide) & (wide > _UNKNOWN)
    return tuple(
        one.name for one, is_so in zip(nominal.plan.free, better, strict=True) if is_so and one.name in told.estimates
    )


def _driven(
    prepared: Prepared, nominal: Explanation, manoeuvre: Manoeuvre, probes: Sequence[Probe]
) -> _Information | None:
    """Returns what a manoeuvre would tell in the measured signals; None where it tells nothing."""
    dataset = prepared.dataset
    driven = _as_run(manoeuvre, dataset.vehicle)
    sides = ("voltage",) if dataset.vehicle == "motor" else ("voltage_left", "voltage_right")
    outputs = plant.simulate([(nominal.model, driven)])[0].outputs
    measured = [name for name in dict.fromkeys(name for run in dataset.runs for name in run.outputs) if name in outputs]
    run = Run(
        name=manoeuvre.name,
        file=dataset.path,
        role="fit",
        time=driven.time,
        inputs=dict(zip(sides, driven.inputs.T, strict=True)),
        outputs={name: outputs[name] for name in measured},
        raw_outputs={},
        gap_s=0.0,
        replicate_of=None,
        initial={},
    )
    alone = dataclasses.replace(dataset, runs=(run,), faults=(), notes=())
    if dataset.vehicle == "motor":
        windows = cut_into_windows(alone, {run.name: driven.inputs}, _WINDOW_S)
        alone = windows if windows is not None else alone
    if not alone.runs:
        return None
    names = [one.name for one in alone.runs]
    data = of_bins(alone, nominal.plan.model, names, width_s=numbers.BIN_S, coarse=True, threads=prepared.jobs)
    problem = Problem(data.weighed_like(prepared.coarse), nominal.plan)
    return _information(problem, nominal, probes)
