"""Which manoeuvre would tell more than the runs of a data set do, of parameters and of effects.

Each manoeuvre is simulated with the calibrated nominal model, with every parameter a little off and with every effect.
What it tells is added to what the runs tell, as information adds up (Atkinson, Donev & Tobias 2007, Optimum
experimental designs, ch. 9).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Run
from brickpilot.discover import numbers
from brickpilot.discover.experiment import commands, manoeuvres
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import Manoeuvre, Visible
from brickpilot.discover.parts import library_parts, limit_of, scale_of, scanned_parameter
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.probes import Probe, probes_of
from brickpilot.fit.residual import Problem, of_bins
from brickpilot.fit.uncertainty import Uncertainty
from brickpilot.fit.windows import cut_into_windows
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun

Array = NDArray[np.float64]

_STEP_S = 0.01  # between the samples of a simulated manoeuvre
_WINDOW_S = 1.0  # of a motor, as `prepare` cuts its runs
_MANOEUVRES = 3  # advised, at most
_SHARPER = 0.5  # a manoeuvre tells of a parameter if the interval becomes narrower by this factor
_UNKNOWN = 0.1  # and was wider than this, sd, in the logarithm or as a share of what is stated
_USUAL = (
    1.0  # times the catalogue's size, scaled to the vehicle: an effect that shows only above it is as good as hidden
)


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
    seen = _Seen(
        probes,
        _usual_sizes(probes, base),
        _prior(problem, nominal.point),
        gate,
    )
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


def _prior(problem: Problem, point: Array) -> Array:
    slopes = problem.prior_slopes(point)
    return np.asarray(slopes.T @ slopes)


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
    time = np.arange(0.0, manoeuvre.duration_s, _STEP_S)
    sides = ("voltage",) if dataset.vehicle == "motor" else ("voltage_left", "voltage_right")
    inputs = commands(manoeuvre, time)[:, : len(sides)]
    outputs = plant.simulate([(nominal.model, OpenLoopRun(time=time, inputs=inputs))])[0].outputs
    measured = [name for name in dict.fromkeys(name for run in dataset.runs for name in run.outputs) if name in outputs]
    run = Run(
        name=manoeuvre.name,
        file=dataset.path,
        role="fit",
        time=time,
        inputs=dict(zip(sides, inputs.T, strict=True)),
        outputs={name: outputs[name] for name in measured},
        raw_outputs={},
        gap_s=0.0,
        replicate_of=None,
        initial={},
    )
    alone = dataclasses.replace(dataset, runs=(run,), faults=(), notes=())
    if dataset.vehicle == "motor":
        windows = cut_into_windows(alone, {run.name: inputs}, _WINDOW_S)
        alone = windows if windows is not None else alone
    if not alone.runs:
        return None
    names = [one.name for one in alone.runs]
    data = of_bins(alone, nominal.plan.model, names, width_s=numbers.BIN_S, coarse=True, threads=prepared.jobs)
    problem = Problem(data.weighed_like(prepared.coarse), nominal.plan)
    return _information(problem, nominal, probes)
