"""How much of each measured signal a model explains: over whole runs and a short time ahead, on each kind of run.

`compare`, `calibrate` and `discover` get their numbers here, so that they agree for the same model and the same runs.
What a number is says `data.agreement`; where runs start says `Comparable`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.agreement import Agreement, agreement, mean_fit, together
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.holdout import Roles
from brickpilot.data.noise import noise_of
from brickpilot.data.signals import SIGNALS
from brickpilot.errors import SimulationError
from brickpilot.fit.comparable import Comparable
from brickpilot.fit.horizons import Course, Track, deviation, track
from brickpilot.fit.replay import Outputs, Replay
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

ROLES = ("held_out", "fit")
FREE_RUN = "free_run"
AHEAD: Mapping[str, float] = {"1_s": 1.0}
"""The horizons beside the free run, name -> s, that every number is given at."""


@dataclass(frozen=True)
class Headline:
    """The numbers of one model on one data set.

    Attributes:
        by_run: run -> horizon -> signal -> role -> agreement. A run has one role, or two if a stretch is held out.
    """

    by_run: Mapping[str, Mapping[str, Mapping[str, Mapping[str, Agreement]]]] = field(default_factory=dict)

    @property
    def horizons(self) -> list[str]:
        return list(dict.fromkeys(name for run in self.by_run.values() for name in run))

    @property
    def signals(self) -> list[str]:
        return list(dict.fromkeys(name for run in self.by_run.values() for one in run.values() for name in one))

    @property
    def role(self) -> str:
        """The role of the runs that judge: "held_out", or "fit" where nothing is held out."""
        return next((one for one in ROLES if self.mean(one) is not None), "fit")

    def of(self, signal: str, role: str, horizon: str = FREE_RUN) -> Agreement:
        """Returns the agreement of a signal over all runs, and stretches of runs, of a role."""
        parts = [run.get(horizon, {}).get(signal, {}).get(role) for run in self.by_run.values()]
        return together(one for one in parts if one is not None)

    def of_run(self, run: str, signal: str, horizon: str = FREE_RUN) -> Agreement:
        """Returns the agreement of a signal over a whole run."""
        return together(self.by_run.get(run, {}).get(horizon, {}).get(signal, {}).values())

    def mean(self, role: str, horizon: str = FREE_RUN) -> float | None:
        """Returns the mean fit in percent over the signals; None: there is no such run or horizon."""
        return mean_fit({signal: self.of(signal, role, horizon).fit_percent for signal in self.signals})

    def to_json(self) -> dict[str, Any]:
        """Returns role -> horizon -> the mean fit in percent, and the numbers of each signal."""
        return {
            role: {
                horizon: {
                    "fit_percent": self.mean(role, horizon),
                    "signals": {
                        signal: {**one.to_json(), "unit": SIGNALS[signal].unit}
                        for signal in self.signals
                        if (one := self.of(signal, role, horizon)).samples
                    },
                }
                for horizon in self.horizons
            }
            for role in ROLES
        }


def headline(ready: Comparable, model: Model, *, threads: int = 2) -> Headline:
    """Returns how well a model explains each signal over whole runs and 1 s ahead.

    Raises:
        SimulationError: the plant diverges with this model.
    """
    compared = track(ready.measured, ready.started, model, AHEAD)
    return headline_of(compared, simulated_at(compared, model, threads=threads), ready.roles)


def simulated_at(compared: Track, model: Model, *, threads: int = 2) -> dict[str, Mapping[str, Outputs]]:
    """Returns horizon -> run -> outputs of a model, those that were measured.

    A short horizon at which the plant diverges is absent.

    Raises:
        SimulationError: the plant diverges in a free run.
    """
    replay, found = Replay(compared.dataset), dict[str, Mapping[str, Outputs]]()
    names = {*compared.signals, *(name for run in compared.dataset.runs for name in run.outputs)}
    for course in compared.courses:
        try:
            (found[course.horizon],) = replay.simulate([model], threads=threads, signals=names, marks=course.marks)
        except SimulationError:
            if course.horizon == FREE_RUN:
                raise
    return found


def headline_of(compared: Track, simulated: Mapping[str, Mapping[str, Outputs]], roles: Roles) -> Headline:
    """Returns the headline of what was simulated: horizon -> run -> outputs."""
    noise = noise_sds(compared)
    by_run: dict[str, dict[str, dict[str, dict[str, Agreement]]]] = {}
    for course in compared.courses:
        for name, one in _by_run(compared, course, simulated.get(course.horizon, {}), roles, noise).items():
            by_run.setdefault(name, {})[course.horizon] = one
    return Headline(by_run)


def noise_sds(compared: Track) -> dict[str, float]:
    """Returns signal -> sd of its noise, SI."""
    by_run = compared.measured.values()
    parts = {signal: [one[signal] for one in by_run if signal in one] for signal in compared.signals}
    return {signal: noise_sd(compared.dataset, signal, values) for signal, values in parts.items()}


def noise_sd(dataset: Dataset, signal: str, parts: Sequence[Array]) -> float:
    """Returns the sd of a signal's noise, SI: as stated, or as estimated if that is more. `parts`: of all runs."""
    described = dataset.signals.get(signal)
    stated = (described.noise_sd if described is not None else None) or 0.0
    step = (described.resolution if described is not None else None) or 0.0
    return max(float(np.hypot(stated, step / 12**0.5)), noise_of(parts, step).sd)


def _by_run(
    compared: Track, course: Course, simulated: Mapping[str, Outputs], roles: Roles, noise: Mapping[str, float]
) -> dict[str, dict[str, dict[str, Agreement]]]:
    """Returns run -> signal -> role -> agreement, at one horizon."""
    found: dict[str, dict[str, dict[str, Agreement]]] = {}
    for stretch in course.stretches:
        run = stretch.run
        held_out = _held_out(run, roles)
        for signal in compared.measured[run.name] if run.name in simulated else ():
            error, value = deviation(compared, stretch, signal, simulated[run.name][signal])
            by_role = {
                role: agreement(error[here], value[here], noise_sd=noise[signal])
                for role, here in (("held_out", held_out), ("fit", ~held_out))
                if here.any()
            }
            found.setdefault(run.name, {}).setdefault(signal, by_role)
    return found


def _held_out(run: Run, roles: Roles) -> NDArray[np.bool_]:
    """Returns (n,) whether each sample of a run is held out."""
    stretch = roles.stretches.get(run.name)
    if stretch is None:
        return np.full(len(run.time), roles.by_run[run.name] == "held_out")
    return np.asarray((run.time >= stretch[0]) & (run.time <= stretch[1]))
