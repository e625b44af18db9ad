"""The stochastic grey-box fit: parameters and noise sizes of largest posterior, by prediction with process noise.

It alternates. For fixed parameters the sizes of the noises maximise the likelihood of the innovations (`noise_sizes`).
For fixed sizes the parameters minimise the squared innovations over their sd, together with the priors. A prediction
forgets what went wrong before, so slip, a collision or play in a gear pull the parameters less than in a free run.
Kristensen, Madsen & Jorgensen 2004, Automatica 40.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brickpilot.data.agreement import Agreement, agreement, together
from brickpilot.errors import SimulationError
from brickpilot.fit.innovations import Innovations
from brickpilot.fit.noise_sizes import FittedNoise, fit_noise, fit_noise_and_decay
from brickpilot.fit.parameters import Plan
from brickpilot.fit.robust import pseudo_huber
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_ROUNDS = 4  # of noise and parameters, at most
_LEAST_GAIN = 1.0  # of log likelihood, below which a round is the last
_STEP = 1e-3  # of a coordinate, for differences
_EVALUATIONS = 12  # of the innovations in one round's descent
_WIDE_SD = 10.0  # in coordinates: holds what neither data nor prior tell


@dataclass(frozen=True)
class GreyBox:
    """The result of `fit_grey_box`.

    Attributes:
        point: coordinates of `plan.free`.
        noise: the sizes of all noises.
        sd: (coordinates,) sd of each, from the innovations and the priors; the noises count as known.
    """

    plan: Plan
    point: Array
    noise: FittedNoise
    sd: Array

    @property
    def model(self) -> Model:
        return self.plan.at(self.point)


def fit_grey_box(problem: Innovations, plan: Plan, start: Array | None = None) -> GreyBox:
    """Fits the free parameters of `plan` and the sizes of all noises.

    Args:
        start: coordinates; None: those of the plan.

    Raises:
        SimulationError: the plant diverges at the start.
    """
    point = plan.start() if start is None else start
    noise = fit_noise_and_decay(problem, plan.at(point))
    spread = np.full(len(point), np.nan)
    for _ in range(_ROUNDS if len(point) else 0):
        moved, spread = _fit_parameters(problem, plan, point, noise)
        again = fit_noise(problem, plan.at(moved), noise)
        gain = again.log_likelihood - noise.log_likelihood + _log_prior(plan, moved) - _log_prior(plan, point)
        if gain <= 0:
            break
        point, noise = moved, again
        if gain < _LEAST_GAIN:
            break
    return GreyBox(plan, point, noise, spread)


def _fit_parameters(problem: Innovations, plan: Plan, start: Array, noise: FittedNoise) -> tuple[Array, Array]:
    """Returns the best coordinates for these noises, and the sd of each."""
    first = problem.predict(plan.at(start), noise.noise)
    sds = [one.innovation_sd for one in first]
    low, high = np.array([free.bounds() for free in plan.free]).T

    def scaled(at: Array) -> Array:
        try:
            found = problem.predict(plan.at(at), noise.noise)
        except SimulationError:
            return np.full(sum(len(one) for sd in sds for one in sd.values()), np.nan)
        parts = [
            np.nan_to_num(one.innovation[name] / sd[name])
            for one, sd in zip(found, sds, strict=True)
            for name in one.innovation
        ]
        return np.concatenate(parts)

    def residual(at: Array) -> Array:
        return np.concatenate([pseudo_huber(scaled(at)).value, _prior(plan, at)])

    def jacobian(at: Array) -> Array:
        base = residual(at)
        steps = np.where(at + _STEP <= high, _STEP, -_STEP) * [free.reach for free in plan.free]
        columns = [(residual(at + step) - base) / step[k] for k, step in enumerate(np.diag(steps))]
        return np.asarray(np.nan_to_num(np.array(columns).T))

    margin = 1e-9 * (high - low)
    reach = np.array([free.reach for free in plan.free])
    inside = np.clip(start, low + margin, high - margin)
    end = least_squares(
        residual, inside, jac=jacobian, bounds=(low, high), x_scale=reach, max_nfev=_EVALUATIONS, ftol=1e-6
    )
    slopes = np.asarray(end.jac)
    information = slopes.T @ slopes
    return np.asarray(end.x), np.sqrt(np.diag(np.linalg.pinv(information)))


def _prior(plan: Plan, point: Array) -> Array:
    """Returns how far each parameter is from what is known of it, in sd."""
    terms = []
    for free, x, x0 in zip(plan.free, point, plan.start(), strict=True):
        if free.known is not None and free.known.sd:
            terms.append((free.to_value(float(x)) - free.known.value) / free.known.sd)
        else:
            terms.append((float(x) - float(x0)) / _WIDE_SD)
    return np.array(terms)


def _log_prior(plan: Plan, point: Array) -> float:
    return -0.5 * float(np.sum(_prior(plan, point) ** 2))


def fit_percent(problem: Innovations, model: Model, noise: FittedNoise, horizon_s: float) -> Mapping[str, float]:
    """Returns signal -> fit in percent of predictions up to `horizon_s` s ahead, without loads; 0: a free run.

    See `data.agreement`. A signal without a fit is absent.
    """
    found = problem.predict(model, noise.noise, horizon_s=horizon_s)
    parts: dict[str, list[Agreement]] = {name: [] for name in problem.signals}
    for one, measured in zip(found, problem.measured(), strict=True):
        for name, values in measured.items():
            parts[name].append(agreement(values - one.ahead[name], values))
    fits = {name: together(listed).fit_percent for name, listed in parts.items()}
    return {name: fit for name, fit in fits.items() if fit is not None}
