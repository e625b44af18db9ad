"""Screens parts: how well each could explain the residual, from few simulations and without a fit.

A simulation shows the signature of a part: how it changes the residual. From both, everything is projected out that the
parameters of the model could still take up (a score test, Rao 1948).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.parts import Excitation, Part, RunPart, scanned_parameter
from brickpilot.discover.probes import Probe, fit_amplitudes, probes_of, values_at
from brickpilot.fit.residual import Problem, Projection

Array = NDArray[np.float64]

_INVISIBLE = 1e-3  # scales: a signature that is smaller everywhere shows nothing


@dataclass(frozen=True)
class Trial:
    """One part from one size.

    Attributes:
        values: where a fit of it starts.
        left: half the squared residual that the model can come down to with the part, priors included.
        gain: by how much half the squared residual of the data comes down.
        prior_gain: by how much half the squares of what was known before come down.
    """

    part: Part
    values: Mapping[str, float]
    left: float
    gain: float = 0.0
    prior_gain: float = 0.0

    @classmethod
    def of(cls, part: Part, values: Mapping[str, float], before: Array, after: Array, count: int) -> Trial:
        """Returns a trial from what is left without and with the part, (values + parameters,) with `count` values."""
        gains = (before**2 - after**2) / 2
        return cls(part, values, float(np.sum(after**2)) / 2, float(gains[:count].sum()), float(gains[count:].sum()))


def screen(
    problem: Problem,
    point: Array,
    chosen: Sequence[Part],
    *,
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> list[Trial]:
    """Returns every part from each of its sizes, the best first, without those that change nothing.

    Args:
        problem: with the plan of the model, and its sensitivities kept at `point`.
        point: where the fit of that plan ended.
        excitation: how far the vehicle was driven.
        deadline: the parts behind it are left out.
    """
    residual, probed = _probed(problem, point, chosen, excitation, deadline)
    trials = []
    for probe, signatures in _of_runs_joined(probed, residual):
        amplitudes = fit_amplitudes(probe, signatures, residual)
        after = residual - signatures @ amplitudes
        values = values_at(probe, amplitudes)
        trials.append(Trial.of(probe.part, values, residual, after, len(problem.data.measured)))
    return sorted(trials, key=lambda one: one.left)


def _of_runs_joined(probed: list[tuple[Probe, Array]], residual: Array) -> list[tuple[Probe, Array]]:
    """Returns the probes, those of one kind of values of runs as one: each run at the value that explains it best.

    At a small value a late start shows nothing, and a fit from there would lead nowhere.
    """
    kinds: dict[str, list[tuple[Probe, Array]]] = {}
    others = []
    for probe, signatures in probed:
        if isinstance(probe.part, RunPart):
            kinds.setdefault(probe.part.name, []).append((probe, signatures))
        else:
            others.append((probe, signatures))
    for tried in kinds.values():
        gains = np.array([_gains(signatures, residual) for _, signatures in tried])
        best = np.argmax(gains, axis=0)
        part = tried[0][0].part
        values = {run: tried[k][0].values[0][run] for run, k in zip(part.free, best.tolist(), strict=True)}
        columns = np.column_stack([tried[k][1][:, index] for index, k in enumerate(best.tolist())])
        others.append((Probe(part, (values,), True), columns))
    return others


def _gains(signatures: Array, residual: Array) -> Array:
    """Returns (columns,): by how much each signature alone, in its own direction, lowers the squared residual."""
    along = np.maximum(signatures.T @ residual, 0.0)
    return np.asarray(along**2 / np.maximum(np.sum(signatures**2, axis=0), 1e-300))


def signature_strengths(
    problem: Problem, point: Array, chosen: Sequence[Part], *, excitation: Excitation
) -> list[tuple[Part, Mapping[str, float], float]]:
    """Returns parts with one free size, its values, and half the squares of their signature there.

    The arguments are those of `screen`. Parts that come and go with their size are left out: one size says nothing of
    another there.
    """
    few = [one for one in chosen if len(one.free) == 1 and scanned_parameter(one) is None]
    probed = _probed(problem, point, few, excitation)[1]
    return [(probe.part, probe.values[0], float(np.sum(one**2)) / 2) for probe, one in probed]


def _probed(
    problem: Problem,
    point: Array,
    chosen: Sequence[Part],
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Array, list[tuple[Probe, Array]]]:
    """Returns the residual (rows,), and each visible probe with its signatures (rows, simulations), projected."""
    base = problem.plan.at(point)
    plan = dataclasses.replace(problem.plan, model=base)
    residual = problem.data.scaled(base)
    projection = Projection(problem, point)
    probes = [probe for part in chosen for probe in probes_of(part, base, excitation)]
    models = [probe.part.starting(plan, values).model for probe in probes for values in probe.values]
    simulated = problem.data.scaled_by(models)
    found: list[tuple[Probe, Array]] = []
    for probe in probes:
        if found and deadline.passed:
            break
        changes = np.array([residual - next(simulated) for _ in probe.values])
        if not np.isfinite(changes).all() or np.abs(changes).max() < _INVISIBLE:
            continue
        if isinstance(probe.part, RunPart):  # one simulation with the values of all runs shows what each run's does
            changes = np.array([np.where(problem.data.rows_of(run), changes[0], 0.0) for run in probe.part.free])
            if np.abs(changes).max(axis=1).min() < _INVISIBLE:
                continue
        found.append((probe, projection.signatures(changes)))
    return projection.remainder(residual), found
