"""Random effects: values that differ from group to group, drawn around a mean, and the sd between groups.

See Pinheiro & Bates 2000, Mixed-Effects Models in S and S-PLUS, ch. 2: the sd by restricted maximum likelihood (REML),
the values by best linear unbiased prediction, which draws an uncertain value to the mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

Array = NDArray[np.float64]

_DECADES = 4.0  # below the spread of the estimates: the smallest sd between groups that is tried


@dataclass(frozen=True)
class RandomEffects:
    """The values of n groups.

    Attributes:
        sd: between groups.
        values, value_sds: (n,) as predicted, and the sd of their errors.
        deviations, deviation_sds: (n,) the same for what lies between them and the reference.
        chance: the probability that estimates of equal values differ as much (Cochran's Q); 0..1.
    """

    sd: float
    values: Array
    value_sds: Array
    deviations: Array
    deviation_sds: Array
    chance: float


def random_effects(estimates: Array, covariance: Array, reference: Array | None = None) -> RandomEffects:
    """Returns what estimates (n,) of the groups' values with errors of `covariance` (n, n) say; n is 2 or more.

    Args:
        reference: (n,) weights of the groups, of sum 1, in what deviations count from; None: the mean of the groups.
    """
    count = len(estimates)
    widest = max(float(np.var(estimates, ddof=1)), 1e-300)
    found = minimize_scalar(
        lambda log: _likelihood(estimates, covariance, 10**log),
        bounds=(np.log10(widest) - 2 * _DECADES, np.log10(widest) + 1),
        method="bounded",
    )
    variance = 10 ** float(found.x)
    without_mean = _without_mean(covariance + variance * np.eye(count))
    values = estimates - covariance @ without_mean @ estimates
    errors = covariance - covariance @ without_mean @ covariance
    centred = np.eye(count) - (1 / count if reference is None else reference)
    return RandomEffects(
        sd=variance**0.5,
        values=values,
        value_sds=_sds(errors),
        deviations=centred @ values,
        deviation_sds=_sds(centred @ errors @ centred.T),
        chance=float(chi2.sf(estimates @ _without_mean(covariance) @ estimates, count - 1)),
    )


def _likelihood(estimates: Array, covariance: Array, variance: float) -> float:
    """Returns twice the negative restricted log likelihood of a variance between groups."""
    total = covariance + variance * np.eye(len(estimates))
    weight = np.sum(np.linalg.pinv(total, hermitian=True))
    return float(np.linalg.slogdet(total)[1] + np.log(weight) + estimates @ _without_mean(total) @ estimates)


def _without_mean(covariance: Array) -> Array:
    """Returns the inverse of a covariance (n, n) with the common mean projected out."""
    inverse = np.linalg.pinv(covariance, hermitian=True)
    summed = inverse.sum(axis=1)
    return np.asarray(inverse - np.outer(summed, summed) / summed.sum())


def _sds(covariance: Array) -> Array:
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))
