"""Screens candidates: how well each could explain the residual, from few simulations and without a fit.

A simulation shows the signature of a candidate: how it changes the residual. From both, everything is projected out
that the parameters of the model could still take up (a score test, Rao 1948).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, scanned_parameter
from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.probes import Probe, fit_amplitudes, probes_of, values_at
from brickpilot.discover.projection import Projection

Array = NDArray[np.float64]

_INVISIBLE = 1e-3  # scales: a signature that is smaller everywhere shows nothing


@dataclass(frozen=True)
class Trial:
    """One candidate from one size.

    Attributes:
        values: where a fit of it starts.
        before: half the squared residual that the model can come down to without the candidate, priors included.
        after: the same with the candidate.
    """

    candidate: Candidate
    values: Mapping[str, float]
    before: float
    after: float


def screen(
    error: BinnedOutputError,
    point: Array,
    chosen: Sequence[Candidate],
    *,
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> list[Trial]:
    """Returns every candidate from each of its sizes, the best first, without those that change nothing.

    Args:
        error: with the plan of the model, and its sensitivities kept at `point`.
        point: where the fit of that plan ended.
        excitation: how far the vehicle was driven.
        deadline: the candidates behind it are left out.
    """
    residual, probed = _probed(error, point, chosen, excitation, deadline)
    before, trials = float(np.sum(residual**2)) / 2, []
    for probe, signatures in probed:
        amplitudes = fit_amplitudes(probe, signatures, residual)
        after = float(np.sum((residual - signatures @ amplitudes) ** 2)) / 2
        trials.append(Trial(probe.candidate, values_at(probe, amplitudes), before, after))
    return sorted(trials, key=lambda one: one.after)


def signature_strengths(
    error: BinnedOutputError, point: Array, chosen: Sequence[Candidate], *, excitation: Excitation
) -> list[tuple[Candidate, Mapping[str, float], float]]:
    """Returns candidates with one free size, its values, and half the squares of their signature there.

    The arguments are those of `screen`. Candidates that come and go with their size are left out: one size says
    nothing of another there.
    """
    few = [one for one in chosen if len(one.free) == 1 and scanned_parameter(one) is None]
    probed = _probed(error, point, few, excitation)[1]
    return [(probe.candidate, probe.values[0], float(np.sum(one**2)) / 2) for probe, one in probed]


def _probed(
    error: BinnedOutputError,
    point: Array,
    chosen: Sequence[Candidate],
    excitation: Excitation,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Array, list[tuple[Probe, Array]]]:
    """Returns the residual (rows,), and each visible probe with its signatures (rows, simulations), projected."""
    base = error.plan.at(point)
    plan = dataclasses.replace(error.plan, model=base)
    residual = error.residual_of(base)
    projection = Projection(error, point)
    probes = [probe for candidate in chosen for probe in probes_of(candidate, base, excitation)]
    models = [probe.candidate.starting(plan, values).model for probe in probes for values in probe.values]
    simulated = error.residuals_of(models)
    found: list[tuple[Probe, Array]] = []
    for probe in probes:
        if found and deadline.passed:
            break
        changes = np.array([residual - next(simulated) for _ in probe.values])
        if not np.isfinite(changes).all() or np.abs(changes).max() < _INVISIBLE:
            continue
        found.append((probe, projection.signatures(changes)))
    return projection.remainder(residual), found
