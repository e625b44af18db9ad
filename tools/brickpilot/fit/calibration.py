"""Fits the free nominal parameters of a model to measured runs by output error, with their uncertainties."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, Nominal, OwnUnit, frame_text, own_units
from brickpilot.data.shown import Result
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit import descent
from brickpilot.fit.descent import Count, Progress, Start
from brickpilot.fit.parameters import Plan, plan, settings, stated_beside, value_of
from brickpilot.fit.problem import Problem
from brickpilot.fit.residual import Residual, Scale, of_samples
from brickpilot.fit.uncertainty import (
    NOTHING_FITTED,
    Combination,
    Estimate,
    Uncertainty,
    assess,
    estimates_frame,
)
from brickpilot.vehicle.compared_runs import Comparable, comparable, compared_signals
from brickpilot.vehicle.headline import FREE_RUN, Headline, headline_of, simulated_at, track
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay
from brickpilot.vehicle.spread import Spread

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]
_COARSE_STEP = 0.003  # motor step, s, of all descents except the last, which uses the plant's own step
_ROUNDS = 3  # rounds of weighing the signals by their residuals and fitting again


@dataclass(frozen=True)
class Gap:
    """One signal of one run, before and after the fit.

    Attributes:
        before, after: ratio of the error's norm to the signal's norm: 1 - `fit_percent` / 100 (see `data.agreement`).
            None if `fit_percent` has no value; `before` is also None if the plant diverges at the start values.
        time: (n,) s.
        measured, simulated, unfitted: (n,) SI, for a plot. `unfitted`: before the fit; None if the plant diverges.
    """

    run: str
    role: str
    signal: str
    before: float | None
    after: float | None
    time: Array
    measured: Array
    unfitted: Array | None
    simulated: Array

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("run", "role", "signal", "before", "after")}


@dataclass(frozen=True)
class Calibration(Result):
    """The result of `calibrate`.

    Attributes:
        model: the model with the fitted values, as written to model.toml.
        parameters: name, such as "mass" or "effect.parameter" -> estimate.
        cannot_tell_apart: groups of parameters of which only combinations are identifiable.
        combinations: identifiable combinations that have a physical meaning.
        scales: signal -> its weights in the fit.
        before, after: how much of each signal the model explains with the start values, and with the fitted values;
            `before` is empty if the plant diverges with the start values.
        units: signal -> the unit in which the data set states it.
        frame: the coordinate frame of the data set, in words; empty for a motor.
        notes: sentences on what was assumed, what was left out, and what is not identifiable.
        stated: fitted parameter that the data set states -> the stated value and its sd.
        spread: the joint uncertainty of the fitted parameters; None if nothing was fitted.
    """

    dataset: str
    model: Model
    parameters: Mapping[str, Estimate]
    cannot_tell_apart: tuple[tuple[str, ...], ...]
    combinations: tuple[Combination, ...]
    gaps: tuple[Gap, ...]
    starts: tuple[Start, ...]
    scales: Mapping[str, Scale]
    roles: Mapping[str, str]
    notes: tuple[str, ...]
    before: Headline
    after: Headline
    units: Mapping[str, OwnUnit]
    frame: str
    stated: Mapping[str, Nominal]
    spread: Spread | None

    @property
    def correlation(self) -> tuple[tuple[float, ...], ...]:
        """(parameters, parameters): correlation of the fitted parameters, in their order; empty: nothing was fitted."""
        return () if self.spread is None else tuple(tuple(row) for row in self.spread.correlation.tolist())

    def to_frame(self) -> pandas.DataFrame:
        """Returns a row for each fitted parameter, in SI: value, ends of its 95 % interval, and what determines it.

        `low` and `high` are NaN if the data do not identify the parameter and no value is stated.
        """
        return estimates_frame(self.parameters)

    def to_json(self) -> dict[str, Any]:
        parameters = {}
        for name, estimate in self.parameters.items():
            entry = dataclasses.asdict(estimate)
            entry["ci95"] = list(estimate.ci95) if estimate.ci95 is not None else [None, None]
            parameters[name] = entry
        return {
            "dataset": self.dataset,
            "parameters": parameters,
            "cannot_tell_apart": [list(group) for group in self.cannot_tell_apart],
            "combinations": [dataclasses.asdict(one) | {"ci95": list(one.ci95)} for one in self.combinations],
            "headline": {"before": self.before.to_json(), "after": self.after.to_json()},
            "gap": [gap.to_json() for gap in self.gaps],
            "correlation": [list(row) for row in self.correlation],
            "spread": None if self.spread is None else self.spread.to_json(),
            "signals": {
                name: {"scale": s.size, "noise_sd": s.noise, "correlation_samples": s.tau}
                for name, s in self.scales.items()
            },
            "starts": [dataclasses.asdict(start) for start in self.starts],
            "roles": dict(self.roles),
            "notes": list(self.notes),
        }


NOTHING_FREE = "Nothing to fit: the data set states every parameter as a plain value."


def calibrate(
    dataset: Dataset,
    *,
    effects: Sequence[str] = (),
    free: Sequence[str] = (),
    seed: int = 0,
    threads: int = 2,
    progress: Progress | None = None,
) -> Calibration:
    """Fits the free parameters by simulation from the inputs alone, all fit runs together.

    A plain value of [nominal] stays fixed. A {value, sd} is fitted with this prior, and an absent parameter with a wide
    one. The same data set, options and seed give the same result.

    Args:
        effects: names of effects to switch on, with all their parameters free.
        free: nominal parameters to fit although the data set gives them as plain values.
        seed: the seed of the random starts.
        progress: called with (done, total, text).

    Raises:
        InputError: an effect or parameter is unknown, the model gives none of the measured signals, or no run is left
            to fit although something is free.
        SimulationError: the plant diverges with the stated values, or with the best values.

    Example: a motor of 20 ohm and 0.3 N m/A reaches 3 rad/s per V, with a time constant of 0.15 s:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> def step(volts):
    ...     speed = 3 * volts * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15))
    ...     return pd.DataFrame({"time": time, "voltage": np.where(time >= 0.195, volts, 0.0), "speed": speed})
    >>> known = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "inductance": 0.0}
    >>> dataset = bp.Dataset.from_frames({"low": step(3.0), "back": step(-5.0)}, vehicle="motor", nominal=known)
    >>> fitted = bp.calibrate(dataset)
    >>> fitted.to_frame()[["parameter", "value", "unit", "identifiable"]].round(5)
              parameter    value       unit  identifiable
    0     wheel_inertia  0.00075     kg m^2          True
    1  viscous_friction  0.00050  N m s/rad          True
    >>> fitted.model.parameters["resistance"]               # stated as a plain value, so it stays
    20.0
    """
    nominal, chosen = plan(dataset, free=free), plan(dataset, effects=effects, free=free)
    compared_signals(dataset, chosen.model)  # refuses a signal that is no measurement, before further work
    ready = comparable(dataset)
    notes = [ready.roles.note, *chosen.notes, *ready.measured.notes]
    notes += compared_signals(ready.measured, chosen.model).notes
    if not chosen.free:
        notes.append(NOTHING_FREE)
        return _result(ready, chosen, chosen.model, notes)
    if not ready.roles.fit():
        raise InputError("every run is held out: there is none to fit", file=dataset.path, field="runs.role")
    data = _residual(ready, chosen, threads)
    notes.extend(data.notes)
    tried = settings(chosen, dataset)
    count = descent.counted(progress, descent.most_starts(len(tried) if effects else 0) + _ROUNDS + 1)
    chosen, best, starts = _coarse_fit(ready, nominal, tried, np.random.default_rng(seed), threads, count)
    count("refining")
    data = data.weighed_by_size(chosen.at(best), correlated=True)
    best = descent.descend(Problem(data, chosen), best, descent.FINE)
    model = chosen.at(best)
    known = assess(data, model, chosen.uncertain, stated_beside(chosen, model, dataset))
    basis = {name: f"fitted to {dataset.name}: {estimate.basis}" for name, estimate in known.estimates.items()}
    model = dataclasses.replace(model, basis=basis)
    notes.extend(_remarks(chosen, model, known.traceless))
    return _result(ready, chosen, model, notes, known, data.scales, starts)


def _residual(ready: Comparable, fitted: Plan, threads: int, motor_step: float = 0.0) -> Residual:
    """Returns the residual of the fit: measured samples minus runs simulated from their estimated start states."""
    replay = Replay(ready.started, motor_step=motor_step)
    return of_samples(replay, fitted.model, ready.roles.fit(), measured=ready.part("fit"), threads=threads)


def _coarse_fit(
    ready: Comparable, nominal: Plan, tried: Sequence[Plan], random: np.random.Generator, threads: int, count: Count
) -> tuple[Plan, Array, tuple[Start, ...]]:
    """Fits with a coarse motor step: first the plan `nominal`, then the plans `tried` if they have more parameters.

    Returns the best plan, its best point, and the starts of its descents.
    """
    rough = _residual(ready, nominal, threads, _COARSE_STEP)
    best, starts, chosen = np.empty(0), tuple[Start, ...](), tried[0]
    if nominal.free:
        best, starts = descent.search(Problem(rough, nominal, holds_priors=False), random, count)
    if len(chosen.free) > len(nominal.free):
        ends = []
        for one in tried:
            problem = Problem(_residual(ready, one, threads, _COARSE_STEP), one, holds_priors=False)
            ends.append((problem, *descent.search_sizes(problem, best, count)))
        problem, best, starts = min(ends, key=lambda end: end[0].cost(end[1]))
        rough, chosen = problem.data, problem.plan
    for number in range(_ROUNDS):
        count(f"weighing the signals and fitting again, round {number + 1} of {_ROUNDS}")
        rough = rough.weighed_by_size(chosen.at(best), correlated=True)
        best = descent.descend(Problem(rough, chosen, holds_priors=number == _ROUNDS - 1), best, descent.ROUGH)
    return chosen, best, starts


def _remarks(chosen: Plan, model: Model, traceless: tuple[str, ...]) -> list[str]:
    remarks = []
    if traceless:
        remarks.append(f"No effect on these runs: {', '.join(traceless)}. Any value fits as well.")
    wide = [free.name for free in chosen.uncertain if free.known is None]
    if wide:
        remarks.append(f"Not stated: {', '.join(wide)}. Their intervals assume a prior of a factor of 20 each way.")
    for free in chosen.free:
        value = value_of(model, free.name)
        away = abs(value - free.known.value) / free.known.sd if free.known and free.known.sd else 0.0
        if away > 2:
            remarks.append(f"{free.name} is {away:.1f} sd away from its prior: check the stated value.")
        if not free.signed and abs(value - free.info.maximum) < 1e-6 * free.info.maximum:
            remarks.append(f"{free.name} ended at the upper bound of what is physical.")
    return remarks


def _result(
    ready: Comparable,
    chosen: Plan,
    after: Model,
    notes: list[str],
    known: Uncertainty = NOTHING_FITTED,
    scales: Mapping[str, Scale] = MappingProxyType({}),
    starts: tuple[Start, ...] = (),
) -> Calibration:
    """Returns the result; `known` is the uncertainty of the fit."""
    compared = track(ready, after)
    (fitted,) = simulated_at(compared, [after])
    try:
        unfitted = fitted if chosen.model is after else simulated_at(compared, [chosen.model])[0]
    except SimulationError:
        unfitted = {}
    first, last = (headline_of(compared, one) for one in (unfitted, fitted))
    roles = ready.roles.by_run
    gaps = []
    for run in ready.measured.runs:
        begun, ended = unfitted.get(FREE_RUN, {}).get(run.name), fitted[FREE_RUN][run.name]
        for signal, measured in compared.measured[run.name].items():
            was, share = (one.of_run(run.name, signal).share for one in (first, last))
            before = None if begun is None else begun[signal]
            gaps.append(Gap(run.name, roles[run.name], signal, was, share, run.time, measured, before, ended[signal]))
    return Calibration(
        dataset=ready.measured.name,
        model=after,
        parameters=known.estimates,
        cannot_tell_apart=known.groups,
        combinations=known.combinations,
        gaps=tuple(gaps),
        starts=starts,
        scales=scales,
        roles=dict(roles),
        notes=tuple(notes),
        before=first,
        after=last,
        units=own_units(ready.measured, compared.signals),
        frame=frame_text(ready.measured),
        stated={one.name: one.known for one in chosen.free if one.known is not None},
        spread=known.spread,
    )
