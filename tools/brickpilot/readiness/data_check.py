"""`brickpilot check`: what a data set is worth before a discovery, and which manoeuvre to drive next.

The check needs one fit of the nominal model; if there are many runs, the fit uses some of them. For each parameter, the
check gives the interval of this fit. For each effect, it gives the smallest size that discovery would name.

To advise the next manoeuvre, the check simulates each manoeuvre with the fitted nominal model, then with each parameter
slightly changed, and then with each effect. The manoeuvre's Fisher information on parameters and effects is added to
that of the runs (Atkinson, Donev & Tobias 2007, Optimum experimental designs, ch. 9).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from brickpilot.data import facts
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, OwnUnit, Run, motor_inputs, own_units
from brickpilot.data.holdout import enough_to_fit
from brickpilot.data.motion import cut_into_windows
from brickpilot.data.shown import Result, valid
from brickpilot.discover import numbers
from brickpilot.discover.deadline import estimate
from brickpilot.discover.evidence import Judge
from brickpilot.discover.experiment import as_run, nearest_sizes, size_named, size_of, smallest_sizes
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.finding import Visible
from brickpilot.discover.parts import library_parts, limit_of, scale_of, scanned_parameter
from brickpilot.discover.prepare import Prepared, calibrate, in_closed_loop, prepare
from brickpilot.discover.row_meaning import with_known_timing
from brickpilot.discover.screen import Probe, probes_of
from brickpilot.fit.parameters import Plan
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import of_bins
from brickpilot.fit.uncertainty import Combination, Estimate, assess, estimates_frame
from brickpilot.vehicle import plant
from brickpilot.vehicle.compared_runs import comparable
from brickpilot.vehicle.headline import Headline, headline
from brickpilot.vehicle.manoeuvres import Manoeuvre, manoeuvres

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

_WINDOW_S = 1.0  # s: length of the windows into which runs of a motor are cut, as in `prepare`
_MANOEUVRES = 3  # largest number of advised manoeuvres
_UNKNOWN = 0.1  # limit on a parameter's sd, relative or of the logarithm: with a larger sd it counts as unknown
_SHARPER = 0.5  # a manoeuvre is advised for an unknown parameter if (sd with it) / (sd without it) is below this
_OF_SOME = "Intervals, the sizes of effects that show and the advice are those of these runs."


@dataclass(frozen=True)
class Advice:
    """One manoeuvre that would give more information.

    Attributes:
        effects: effects that this manoeuvre would show at their usual size, and that neither the runs nor the earlier
            advised manoeuvres show.
        parameters: parameters whose intervals the manoeuvre would narrow to less than half.
    """

    manoeuvre: Manoeuvre
    effects: tuple[str, ...]
    parameters: tuple[str, ...]


@dataclass(frozen=True)
class Check(Result):
    """What a data set can show and cannot show, and which manoeuvres would show more.

    Attributes:
        faults: the damaged samples, which every fit leaves out.
        explained: the share of each signal that the model with the fitted `parameters` explains.
        units: signal -> its unit in the data set.
        parameters: the fitted nominal parameters, with 95 % intervals.
        cannot_tell_apart: groups of parameters that the data determine only in combination; `combinations` has the
            combinations with a physical meaning.
        visible: effect -> the smallest size of the effect that discovery would name.
        invisible: effects that the data would not show at any size within the effect's range.
        advice: manoeuvres that would give more information, the best one first.
        discover_s: estimate of the time that `discover` will take, s: the geometric mean of `discover_range_s`.
        discover_range_s: the shortest and the longest time that `discover` may take, s; the time depends on the nominal
            model's error.
        notes: sentences on what was assumed or left out.
    """

    dataset: str
    vehicle: str
    frame: str
    runs: tuple[facts.RunFacts, ...]
    signals: tuple[facts.SignalFacts, ...]
    faults: tuple[Fault, ...]
    explained: Headline
    units: Mapping[str, OwnUnit]
    parameters: Mapping[str, Estimate]
    cannot_tell_apart: tuple[tuple[str, ...], ...]
    combinations: tuple[Combination, ...]
    visible: Mapping[str, Visible]
    invisible: tuple[str, ...]
    advice: tuple[Advice, ...]
    discover_s: float
    discover_range_s: tuple[float, float]
    notes: tuple[str, ...]

    def to_frame(self, table: Literal["parameters", "signals", "effects"] = "parameters") -> pandas.DataFrame:
        """Returns a table, in SI.

        Args:
            table: "parameters": the fitted nominal values with the ends of their 95 % intervals, NaN if there is no
                interval. "signals": the properties of each signal. "effects": for each effect, the smallest size that
                would be named.
        """
        import pandas

        if table == "signals":
            return pandas.DataFrame([vars(signal) for signal in self.signals])
        if table == "effects":
            sizes = [(name, effect.parameter, effect.size, effect.unit) for name, effect in self.visible.items()]
            return pandas.DataFrame(sizes, columns=["effect", "parameter", "size", "unit"])
        return estimates_frame(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """Returns the object that `check --json` prints. A number that is not finite becomes None."""
        kept = {name: value for name, value in vars(self).items() if name not in ("explained", "units")}
        made: dict[str, Any] = valid(kept | {"headline": self.explained})
        return made


def check(dataset: Dataset, *, seed: int = 0, jobs: int = 2) -> Check:
    """Returns what `dataset` can show, and which manoeuvres would show more.

    Args:
        seed: the seed of the nominal fit's random starts, which are used if nominal values are not given.
        jobs: number of simulations at the same time.

    Raises:
        InputError: the model computes no measured signal, every run is held out, or the plant diverges with the nominal
            values.

    A motor that was only driven forward:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> speed = 15 * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15)) + np.random.default_rng(1).normal(0, 0.1, 200)
    >>> forward = pd.DataFrame({"time": time, "voltage": np.where(time >= 0.195, 5.0, 0.0), "speed": speed})
    >>> dataset = bp.Dataset.from_frames({"forward": forward}, vehicle="motor", nominal={"resistance": 20.0})
    >>> worth = bp.check(dataset)
    >>> worth.to_frame("signals")[["name", "unit", "noise_sd", "colour"]].round(1)
        name   unit  noise_sd colour
    0  speed  rad/s       0.1  white
    >>> bool(worth.to_frame()["identifiable"].any())        # one step does not tell two parameters apart
    False
    >>> worth.advice[0].manoeuvre.name                      # this one would
    'forward and back at a third of the power'
    """
    with threadpool_limits(1, "blas"):  # as in `pipeline.discover`
        known = with_known_timing(dataset, None, seed=seed, jobs=jobs)
        some, note = enough_to_fit(known)
        whole = comparable(known)
        prepared, nominal = calibrate(prepare(some, None, seed=seed, jobs=jobs)[0])
        prepared, nominal = in_closed_loop(prepared, nominal, nominal)
        samples, all_samples = (sum(len(run.time) for run in dataset_.runs) for dataset_ in (some, known))
        seconds = estimate(prepared, nominal, times=all_samples / samples)
        judge = Judge.of(prepared.coarse, seed)
        nothing = judge.of_explanation(nominal)
        temperature = judge.temperature(nothing, nothing)
        visible = smallest_sizes(prepared, judge, nominal, nominal)
        fitted = assess(prepared.fine, nominal.model, nominal.plan.uncertain)
        advice, invisible = _advise(prepared, nominal, visible, temperature)
        explained = headline(whole, nominal.model, threads=jobs)
    return Check(
        dataset=dataset.name,
        vehicle=dataset.vehicle,
        frame=dataset.frame,
        runs=tuple(
            facts.of_run(run, whole.roles.by_run[run.name], motor_inputs(run, whole.measured)) for run in dataset.runs
        ),
        signals=facts.of_signals(dataset),
        faults=whole.measured.faults,
        explained=explained,
        units=own_units(dataset, explained.signals),
        parameters=fitted.estimates,
        cannot_tell_apart=fitted.groups,
        combinations=fitted.combinations,
        visible=visible,
        invisible=invisible,
        advice=advice,
        discover_s=seconds.middle,
        discover_range_s=(seconds.low, seconds.high),
        notes=(
            whole.roles.note,
            *([] if prepared.loop is None else [f"{prepared.loop.sentence}."]),
            *([] if note is None else [f"{note} {_OF_SOME}"]),
            *prepared.plan.notes,
            *whole.measured.notes,
            *prepared.fine.notes,
        ),
    )


def _advise(
    prepared: Prepared, nominal: Explanation, visible: Mapping[str, Visible], temperature: float
) -> tuple[tuple[Advice, ...], tuple[str, ...]]:
    """Returns the manoeuvres that add most information, and the effects that the runs would not show at any size.

    The second list has only effects that change a measured signal in some run or some manoeuvre. All other effects
    belong to another vehicle or another sensor.

    Args:
        nominal: the nominal model, fitted to the fit runs.
        visible: effect -> the smallest size that the runs show.
        temperature: number of nats of evidence that count as one nat; see `Judge.temperature`.
    """
    problem = Problem(prepared.coarse, nominal.plan)
    asked = _Asked.of(prepared, nominal, problem.prior_slopes(nominal.point), temperature)
    now = asked.information(problem, nominal.point)
    offered = manoeuvres(nominal.model.vehicle, prepared.excitation.largest["voltage"])
    driven = ((manoeuvre, _driven(prepared, nominal, manoeuvre)) for manoeuvre in offered)
    more = [
        (manoeuvre, asked.information(problem_, nominal.point))
        for manoeuvre, problem_ in driven
        if problem_ is not None
    ]
    largest = np.max([np.diag(known)[len(nominal.point) :] for known in (now, *(known for _, known in more))], axis=0)
    possible = {probe.part.effect for probe, strength in zip(asked.probes, largest, strict=True) if strength > 0}
    shown = {name for name, seen in visible.items() if seen.size <= asked.usual.get((name, seen.parameter), 0.0)}
    shown |= asked.shown(now)
    advised: list[Advice] = []
    while more and len(advised) < _MANOEUVRES:
        offers = [
            Advice(manoeuvre, tuple(sorted(asked.shown(now + known) - shown)), asked.sharper(now, now + known))
            for manoeuvre, known in more
        ]
        best = max(range(len(more)), key=lambda k: len(offers[k].effects) + len(offers[k].parameters))
        if not (offers[best].effects or offers[best].parameters):
            break
        advised.append(offers[best])
        now, shown = now + more.pop(best)[1], shown | set(offers[best].effects)
    return tuple(advised), tuple(sorted(possible - visible.keys()))


@dataclass(frozen=True)
class _Asked:
    """Computes how well runs determine the nominal parameters, and which effects of a usual size the runs show.

    The information of runs is the matrix J' J, (parameters + probes, parameters + probes). Each column of J is the
    change of the residual due to one parameter or one probe. The information of several runs is the sum over the runs.

    Attributes:
        probes: the simulations of each effect whose only free parameter is a size that can be extrapolated.
        usual: (effect, parameter) -> the usual size in the catalogue, scaled to this vehicle.
        prior: (parameters, parameters) information of the parameters' priors.
        temperature: number of nats of evidence that count as one nat; see `Judge.temperature`.
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
            part
            for part in library_parts(base, prepared.coarse.signals)
            if len(part.free) == 1 and scanned_parameter(part) is None and limit_of(part) is None
        ]
        probes = [probe for part in few for probe in probes_of(part, base, prepared.excitation)]
        infos = {(part.effect, part.free[0]): size_of(part) for part in few}
        usual = {key: (info.preset or info.trial) * scale_of(info.unit, base) for key, info in infos.items()}
        plan = dataclasses.replace(nominal.plan, model=base)
        return cls(plan, probes, usual, prior_slopes.T @ prior_slopes, temperature)

    def information(self, problem: Problem, point: Array) -> Array:
        """Returns the information of the runs of `problem`, at the coordinates `point` of the nominal parameters."""
        data = problem.data
        plain = data.predict([self.plan.model])[0]
        models = [probe.part.starting(self.plan, probe.values[0]).model for probe in self.probes]
        changes = data.predict(models) - plain if models else np.empty((0, len(plain)))
        changes = np.where(np.isfinite(changes).all(axis=1, keepdims=True), changes, 0.0)
        weight = data.weight()[:, np.newaxis]
        moved = np.hstack([problem.sensitivity(point) * weight, changes.T * weight])
        return np.asarray(moved.T @ moved)

    def shown(self, known: Array) -> set[str]:
        """Returns the effects that discovery would name at their usual size, from data with the information `known`."""
        count = len(self.prior)
        cross = known[:count, count:]
        taken = np.linalg.solve(known[:count, :count] + self.prior, cross)
        strength = (np.diag(known)[count:] - np.sum(cross * taken, axis=0)) / 2
        sizes = [abs(probe.values[0][probe.part.free[0]]) for probe in self.probes]
        tried = [
            (probe.part, size, size_named(probe.part, size, nats, self.temperature))
            for probe, size, nats in zip(self.probes, sizes, strength.tolist(), strict=True)
        ]
        return {part.effect for part, size in nearest_sizes(tried) if size <= self.usual[part.effect, part.free[0]]}

    def sharper(self, before: Array, after: Array) -> tuple[str, ...]:
        """Returns the parameters that are unknown by the information `before`, and much better known by `after`."""
        count = len(self.prior)
        wide, narrow = (
            np.sqrt(np.diag(np.linalg.inv(known[:count, :count] + self.prior))) for known in (before, after)
        )
        better = (narrow < _SHARPER * wide) & (wide > _UNKNOWN)
        return tuple(free.name for free, is_so in zip(self.plan.free, better, strict=True) if is_so)


def _driven(prepared: Prepared, nominal: Explanation, manoeuvre: Manoeuvre) -> Problem | None:
    """Returns the fit problem of the nominal parameters on a simulated manoeuvre; None: the manoeuvre gives no runs."""
    dataset = prepared.dataset
    driven = as_run(manoeuvre, dataset.vehicle)
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
    names = [run.name for run in alone.runs]
    data = of_bins(alone, nominal.plan.model, names, width_s=numbers.BIN_S, coarse=True, threads=prepared.jobs)
    return Problem(data.weighed_like(prepared.coarse), nominal.plan)
