"""How well a fit is known: intervals, parameters the data cannot tell apart, and combinations they can.

Linearised at the estimate, with the sandwich covariance of M-estimators (Huber 1967) over stretches of time, and the
noise of the sample each run starts from. Each parameter is measured in a size of its own, so that one threshold serves
all: in its logarithm where it is far above zero, else in what changes the simulated signals by all of their rms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from brickpilot.fit.combinations import FORMULAS, Formula
from brickpilot.fit.output_error import OutputError, finite
from brickpilot.fit.parameters import WIDE_SD, Free, value_of, with_values
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_KNOWN_SD = 0.5  # a direction known worse than this, in sizes, is one the data do not narrow
_SMALL_SD = 0.05  # of its natural size: one that may be zero is known to be small
_NARROWED = 0.9  # of its prior's sd: below it the data have added something
_FAR = 0.3  # of its natural size
_MEMBER = 0.02  # share of a parameter that lies in directions the data do not narrow
_STEP = 3e-3  # either way, of a parameter: no less, as dry contacts and plays are smooth on no smaller scale
_FORMULA_STEP = 1e-4  # of a formula, which is smooth
_STRETCHES = 20  # of time, at least, from whose spread the intervals come


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, SI. `ci95`: (low, high), None where the data do not narrow it.

    `basis`: "data", "data and prior", "prior alone" (the data add nothing to it), or "not narrowed by the data".
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None
    identifiable: bool
    basis: str


@dataclass(frozen=True)
class Combination:
    """What the data do say of parameters they cannot tell apart. `formula` in the names of the parameters."""

    name: str
    formula: str
    unit: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Uncertainty:
    """`groups`: parameters of which only combinations are known. `traceless`: those that leave no trace at all."""

    estimates: Mapping[str, Estimate]
    groups: tuple[tuple[str, ...], ...]
    traceless: tuple[str, ...]
    combinations: tuple[Combination, ...]


def assess(problem: OutputError, model: Model, free: tuple[Free, ...]) -> Uncertainty:
    """Intervals at `model`, the fit's result. None is narrower than the share that a model is trusted to match."""
    values = np.array([value_of(model, one.name) for one in free])
    reach = np.array([one.reach for one in free])
    steps = np.maximum(np.abs(values), 1e-3 * np.array([one.size for one in free])) * reach * _STEP
    slopes = _slopes(problem, model, free, steps)
    share = np.sqrt(np.mean((slopes / problem.signal_size()[:, np.newaxis]) ** 2, axis=0))
    spans = np.array([one.info.maximum - one.info.minimum for one in free])
    natural = np.where(share * spans > 1, 1 / np.maximum(share, 1e-300), spans)
    pull, stiffness = problem.influence(model)
    raw = slopes.T @ (slopes * stiffness[:, np.newaxis])
    # One that may be zero is a matter of proportion only where it is far from it.
    lowest = np.array([one.info.minimum for one in free])
    relative = (lowest > 0) | ((lowest == 0) & (values > _FAR * natural))
    sizes = np.where(relative, values, natural)
    prior_sd = np.array(
        [one.known.sd if one.known is not None and one.known.sd is not None else np.inf for one in free]
    )
    information = raw * np.outer(sizes, sizes) + np.diag((sizes / prior_sd) ** 2)
    wide = np.where(np.isinf(prior_sd), WIDE_SD**-2, 0.0)
    prior = (sizes / prior_sd) ** 2 + wide
    spread, degrees = _score_spread(problem, slopes * sizes * pull[:, np.newaxis])
    weighted = slopes * sizes * stiffness[:, np.newaxis]
    for moved in problem.start_errors(model):
        shift = problem.by_run(weighted * moved[:, np.newaxis])
        spread += shift.T @ shift
    curvature = np.linalg.pinv(raw * np.outer(sizes, sizes) + np.diag(prior), hermitian=True)
    covariance = curvature @ (spread + np.diag(prior)) @ curvature
    covariance += np.diag((problem.matched * reach * values / sizes) ** 2)
    sd = np.sqrt(np.diag(covariance))
    quantile = float(student_t.ppf(0.975, degrees))
    estimates = {
        one.name: _estimate(one, float(v), float(s), float(size), quantile, relative=bool(log))
        for one, v, s, size, log in zip(free, values, sd, sizes, relative, strict=True)
    }
    groups, traceless = _groups(information, [one.name for one in free])
    vague = {name for name, estimate in estimates.items() if not estimate.identifiable}
    combinations = _combinations(model, free, sizes, covariance, quantile) if vague else ()
    return Uncertainty(estimates, groups, traceless, combinations)


def _score_spread(problem: OutputError, scores: Array) -> tuple[Array, int]:
    """Covariance of the summed score from its sums over stretches of time, and its degrees of freedom (White 1984).

    So the residual may be correlated in time and between signals, and may be anything but white.
    """
    parameters = scores.shape[1]
    numbers, count = problem.stretches(_STRETCHES + 2 * parameters)
    sums = np.array([np.bincount(numbers, column, count) for column in scores.T]).T
    degrees = max(count - parameters, 1)
    return sums.T @ sums * count / degrees, degrees


def _slopes(problem: OutputError, model: Model, free: tuple[Free, ...], steps: Array) -> Array:
    """(samples, parameters): change of the simulated signals per unit of each parameter."""
    values = np.array([value_of(model, one.name) for one in free])
    low = np.maximum(values - steps, [one.info.minimum for one in free])
    high = np.minimum(values + steps, [one.info.maximum for one in free])
    names = [one.name for one in free]
    moved = [
        with_values(model, {name: float(value)})
        for ends in (low, high)
        for name, value in zip(names, ends, strict=True)
    ]
    below, above = np.split(problem.predict(moved), 2)
    return finite(((above - below) / (high - low)[:, np.newaxis]).T)


def _estimate(free: Free, value: float, sd: float, size: float, quantile: float, *, relative: bool) -> Estimate:
    low, high = (
        (value * np.exp(-quantile * sd), value * np.exp(quantile * sd))
        if relative
        else (value - quantile * sd * size, value + quantile * sd * size)
    )
    ci95 = (float(max(low, free.info.minimum)), float(min(high, free.info.maximum)))
    if free.known is not None and free.known.sd is not None:
        narrowed = sd * size < _NARROWED * free.known.sd
        return Estimate(value, free.info.unit, ci95, bool(narrowed), "data and prior" if narrowed else "prior alone")
    known = sd <= (_KNOWN_SD if relative else _SMALL_SD) or sd * size <= _KNOWN_SD * abs(value)
    if known:
        return Estimate(value, free.info.unit, ci95, True, "data")
    return Estimate(value, free.info.unit, None, False, "not narrowed by the data")


def _groups(information: Array, names: list[str]) -> tuple[tuple[tuple[str, ...], ...], tuple[str, ...]]:
    values, vectors = np.linalg.eigh(information)
    vague = vectors[:, values < _KNOWN_SD**-2]
    overlap = vague @ vague.T
    members = [i for i in range(len(names)) if overlap[i, i] > _MEMBER]
    groups: list[list[int]] = []
    for i in members:
        near = [g for g in groups if any(overlap[i, j] ** 2 > _MEMBER * overlap[i, i] * overlap[j, j] for j in g)]
        groups = [g for g in groups if g not in near] + [sorted([i, *(j for g in near for j in g)])]
    together = tuple(tuple(names[i] for i in g) for g in sorted(groups) if len(g) > 1)
    return together, tuple(names[g[0]] for g in sorted(groups) if len(g) == 1)


def _combinations(
    model: Model, free: tuple[Free, ...], sizes: Array, covariance: Array, quantile: float
) -> tuple[Combination, ...]:
    found = []
    known = dict(model.parameters)
    known |= {f"{effect}.{name}": value for effect, table in model.effects.items() for name, value in table.items()}
    for formula in FORMULAS[model.vehicle]:
        value = formula.value_at(known)
        if not np.isfinite(value) or value <= 0:
            continue
        gradient = np.array([_log_slope(formula, known, one, float(s)) for one, s in zip(free, sizes, strict=True)])
        sd = float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))  # may be below 0 by rounding
        if np.count_nonzero(gradient) > 1 and sd <= _KNOWN_SD:
            factor = float(np.exp(quantile * sd))
            found.append(Combination(formula.name, formula.text, formula.unit, value, (value / factor, value * factor)))
    return tuple(found)


def _log_slope(formula: Formula, known: Mapping[str, float], free: Free, size: float) -> float:
    value = known[free.name]
    step = _FORMULA_STEP * max(abs(value), 1e-3 * free.size)
    moved = formula.value_at(dict(known) | {free.name: value + step})
    return float(np.log(moved / formula.value_at(known)) / step * size)
