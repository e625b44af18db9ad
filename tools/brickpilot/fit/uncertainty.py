"""The uncertainty of a fit: intervals, unidentifiable parameters, and identifiable combinations of parameters.

The problem is linearised at the estimate. The covariance is the sandwich of M-estimators (Huber 1967) over stretches of
time, plus the covariance from the noise of each run's first sample. Parameters are scaled, so that one threshold fits
all. A parameter far above zero is scaled by its value, and so counts as a logarithm. Other parameters are scaled by
their natural size: the step of the parameter that changes the simulated signals by their rms.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from brickpilot.fit.parameters import WIDE_SD, Free, value_of, values_of
from brickpilot.fit.residual import Residual
from brickpilot.vehicle.combinations import FORMULAS, Formula, forms
from brickpilot.vehicle.model import Model, with_values
from brickpilot.vehicle.spread import Spread

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

_KNOWN_SD = 0.5  # largest sd of an identifiable direction, which is a combination of scaled parameters
_SMALL_SD = 0.05  # largest sd of an identifiable parameter near zero, as a share of its natural size
_NARROWED = 0.9  # an sd below this share of the prior's sd shows information from the data
_FAR = 0.3  # a parameter above this share of its natural size is far above zero
_MEMBER = 0.02  # a parameter with more than this share in unidentifiable directions is a member of a group
_STEP = 3e-3  # step up and down, as a share of a parameter: dry friction and backlash are not smooth on smaller steps
_SLOPE_ERROR = 1e-2  # relative error of finite differences for a plant with dry friction
_LARGEST_LOG = 700.0  # largest logarithm of a double; an interval is clipped to the parameter's range anyway
_FORMULA_STEP = 1e-4  # step of finite differences of a formula, as a share of a parameter: a formula is smooth
_LEAST_REST = 1e-3  # least share of information that counts as left when a stretch is removed: less may be rounding
_STRETCHES = 20  # least number of stretches of time whose scatter gives the intervals

CORRELATED_S = 1.0
"""Time, s, over which residuals count as correlated: about one section of a manoeuvre. This widens intervals."""


@dataclass(frozen=True)
class Combination:
    """An identifiable combination of parameters. `formula` uses the paper's symbols."""

    name: str
    formula: str
    unit: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, SI.

    Attributes:
        ci95: (low, high); None if the parameter is neither identifiable nor stated.
        basis: "data", "data and prior", "prior alone" (the data add nothing), or "not narrowed by the data".
        identified: if the data do not determine an effect's parameter, a combination that they do determine; or None.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None
    identifiable: bool
    basis: str
    identified: Combination | None = None


def estimates_frame(estimates: Mapping[str, Estimate]) -> pandas.DataFrame:
    """Returns a row for each parameter, in SI; the ends of a 95 % interval are NaN if the parameter has none."""
    import pandas

    rows = [
        (name, one.value, one.unit, *(one.ci95 or (np.nan, np.nan)), one.identifiable, one.basis)
        for name, one in estimates.items()
    ]
    columns = ["parameter", "value", "unit", "low", "high", "identifiable", "basis"]
    return pandas.DataFrame(rows, columns=columns)


@dataclass(frozen=True)
class Uncertainty:
    """The uncertainty of all parameters.

    Attributes:
        groups: groups of parameters of which only combinations are identifiable.
        traceless: parameters without any influence on the data.
    """

    estimates: Mapping[str, Estimate]
    groups: tuple[tuple[str, ...], ...]
    traceless: tuple[str, ...]
    combinations: tuple[Combination, ...]
    spread: Spread | None


NOTHING_FITTED = Uncertainty({}, (), (), (), None)


def assess(data: Residual, model: Model, fitted: tuple[Free, ...], beside: tuple[Free, ...] = ()) -> Uncertainty:
    """Returns the uncertainty of `fitted` at `model`, the fit's result. `data.matched`: the least relative sd.

    Args:
        beside: parameters with a stated sd that were not fitted. Their sd widens the intervals; they get no estimate.
    """
    free = (*fitted, *beside)
    values = np.array([value_of(model, one.name) for one in free])
    prior_sd = np.array([one.known.sd if one.known and one.known.sd is not None else np.inf for one in free])
    slopes = _slopes(data, model, free, values)
    natural = _natural_sizes(data, free, slopes)
    # A parameter that may be zero has a useful logarithm only far from zero.
    lowest = np.array([one.info.minimum for one in free])
    relative = (lowest > 0) | ((lowest == 0) & (values > _FAR * natural))
    sizes = np.where(relative, values, natural)
    pull, stiffness = data.influence(model)
    in_units = _without_errors(slopes * sizes, stiffness)
    weighted = in_units * stiffness[:, np.newaxis]
    information = np.asarray(in_units.T @ weighted)
    stated = np.diag((sizes / prior_sd) ** 2)
    prior = stated + np.diag(np.where(np.isinf(prior_sd), WIDE_SD**-2, 0.0))
    curvature = np.linalg.pinv(information + prior, hermitian=True)
    covariance, degrees = _scatter(data, in_units * pull[:, np.newaxis], in_units, weighted, curvature)
    for moved in data.start_errors(model):
        shift = data.by_run(weighted * moved[:, np.newaxis]) @ curvature
        covariance += shift.T @ shift
    covariance += curvature @ prior @ curvature
    covariance += np.diag((data.matched * np.array([one.reach for one in free]) * values / sizes) ** 2)
    units = tuple(None if log else size for size, log in zip(sizes.tolist(), relative.tolist(), strict=True))
    spread = Spread(tuple(one.name for one in free), tuple(values.tolist()), units, covariance)
    found = _assessed(model, free, spread, sizes, information + stated, degrees)
    return dataclasses.replace(found, estimates={one.name: found.estimates[one.name] for one in fitted})


def _assessed(
    model: Model, free: tuple[Free, ...], spread: Spread, sizes: Array, information: Array, degrees: int
) -> Uncertainty:
    """Returns the uncertainty of each parameter, of groups of parameters, and of combinations.

    Args:
        sizes: the unit in which each parameter is measured, SI.
        information: (parameters, parameters) information of data and stated priors, in the units of `sizes`.
        degrees: degrees of freedom of the intervals.
    """
    covariance, sd = spread.covariance, np.sqrt(np.diag(spread.covariance))
    quantile = float(student_t.ppf(0.975, degrees))
    known = values_of(model)
    estimates = {}
    for one, value, of, size, unit in zip(free, spread.values, sd.tolist(), sizes.tolist(), spread.units, strict=True):
        estimate = _estimate(one, value, of, size, quantile, relative=unit is None)
        if estimate.ci95 is None and one.effect is not None and not one.run:
            found = (_combination(form, known, free, sizes, covariance, quantile) for form in forms(one.name))
            identified = next((form for form in found if form is not None), None)
            estimate = dataclasses.replace(estimate, identified=identified)
        estimates[one.name] = estimate
    groups, traceless = _groups(information, [one.name for one in free])
    vague = any(not estimate.identifiable for estimate in estimates.values())
    formulas = FORMULAS[model.vehicle] if vague else ()
    combinations = (_combination(one, known, free, sizes, covariance, quantile) for one in formulas)
    return Uncertainty(estimates, groups, traceless, tuple(one for one in combinations if one), spread)


def _natural_sizes(data: Residual, free: tuple[Free, ...], slopes: Array) -> Array:
    """Returns (parameters,) SI: the step that changes the signals by their rms, at most the parameter's range."""
    share = np.sqrt(np.mean((slopes / data.by_signal(data.rms)[:, np.newaxis]) ** 2, axis=0))
    spans = np.array([one.info.maximum - one.info.minimum for one in free])
    return np.where(share * spans > 1, 1 / np.maximum(share, 1e-300), spans)


def _without_errors(slopes: Array, stiffness: Array) -> Array:
    """Returns `slopes` (samples, parameters) without the directions that may be mere errors of finite differences.

    If the signals depend only on a combination of parameters, the slopes of these parameters cancel along one
    direction. With dry friction, finite differences do not cancel exactly. Over many samples, the remainder looks like
    information.
    """
    information = slopes.T @ (slopes * stiffness[:, np.newaxis])
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    kept = vectors[:, values > _SLOPE_ERROR**2]
    return np.asarray((slopes / size) @ kept @ kept.T * size)


def _scatter(
    data: Residual, scores: Array, slopes: Array, weighted: Array, curvature: NDArray[np.floating]
) -> tuple[Array, int]:
    """Returns the covariance of the estimate's scatter, in scaled parameters, and its degrees of freedom.

    The scatter comes from sums over stretches of time, so the residual may be correlated in time and between signals.
    A stretch counts by how far the estimate shifts without the stretch (the jackknife CV3 of MacKinnon, Nielsen & Webb
    2023, J. Econometrics 232(2)). The stretch's residual would count too little: if one stretch alone determines a
    parameter, the fit follows this stretch, and the residual is small.
    """
    parameters = scores.shape[1]
    numbers, count = data.stretches(CORRELATED_S, _STRETCHES + 2 * parameters)
    share, axes = np.linalg.eigh(curvature)
    root = (axes * np.sqrt(np.maximum(share, 0.0))) @ axes.T  # symmetric
    sums = np.array([np.bincount(numbers, column, count) for column in scores.T]).T
    order = np.argsort(numbers, kind="stable")
    ends = np.searchsorted(numbers[order], np.arange(count + 1))
    shifts = np.empty_like(sums)
    for number in range(count):
        rows = order[ends[number] : ends[number + 1]]
        share, axes = np.linalg.eigh(root @ (slopes[rows].T @ weighted[rows]) @ root)
        kept = np.maximum(1 - share, _LEAST_REST)
        shifts[number] = root @ (axes @ ((axes.T @ (root @ sums[number])) / kept))
    return shifts.T @ shifts * (count - 1) / count, max(count - parameters, 1)


def _slopes(data: Residual, model: Model, free: tuple[Free, ...], values: Array) -> Array:
    """Returns (samples, parameters): the change of the simulated signals per unit of each parameter at `values`, SI."""
    reach, least = np.array([one.reach for one in free]), 1e-3 * np.array([one.size for one in free])
    steps = np.maximum(np.abs(values), least) * reach * _STEP
    low = np.maximum(values - steps, [one.info.minimum for one in free])
    high = np.minimum(values + steps, [one.info.maximum for one in free])
    moved = [
        with_values(model, {one.name: value})
        for ends in (low, high)
        for one, value in zip(free, ends.tolist(), strict=True)
    ]
    below, above = np.split(data.predict(moved), 2)
    return np.asarray(np.nan_to_num(((above - below) / (high - low)[:, np.newaxis]).T, posinf=0.0, neginf=0.0))


def _estimate(free: Free, value: float, sd: float, size: float, quantile: float, *, relative: bool) -> Estimate:
    low, high = (
        (value * math.exp(-min(quantile * sd, _LARGEST_LOG)), value * math.exp(min(quantile * sd, _LARGEST_LOG)))
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


def _combination(
    formula: Formula,
    known: Mapping[str, float],
    free: tuple[Free, ...],
    sizes: Array,
    covariance: Array,
    quantile: float,
) -> Combination | None:
    """Returns the value of a formula with its interval; None if the data do not determine this value."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            value = formula.value_at(known)
    except ZeroDivisionError:
        return None
    if not np.isfinite(value) or value <= 0:
        return None
    gradient = np.array([_log_slope(formula, known, one, float(s)) for one, s in zip(free, sizes, strict=True)])
    sd = float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))  # rounding may make the variance negative
    if np.count_nonzero(gradient) <= 1 or sd > _KNOWN_SD:
        return None
    factor = float(np.exp(quantile * sd))
    return Combination(formula.name, formula.text, formula.unit, value, (value / factor, value * factor))


def _log_slope(formula: Formula, known: Mapping[str, float], free: Free, size: float) -> float:
    value = known[free.name]
    step = _FORMULA_STEP * max(abs(value), 1e-3 * free.size)
    moved = formula.value_at(dict(known) | {free.name: value + step})
    return float(np.log(moved / formula.value_at(known)) / step * size)
