"""The residual as composed terms are fitted to it, and what the nominal parameters can take up of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.segment import Segment
from brickpilot.discover.terms.basis import EFFECT
from brickpilot.errors import SimulationError
from brickpilot.fit.parameters import Free
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_CHUNK = 24  # models that are simulated at once: their outputs take memory
_LONGEST_STEP = 2.0  # in coordinates: a linear step moves a nominal parameter no further
_ANCHOR_SD = 30.0  # in coordinates, for a parameter without a prior


class Problem(Protocol):
    """The data: N whitened residuals, all fit runs stacked."""

    @property
    def base(self) -> Model:
        """The model that leaves structure: calibrated, with the named effects."""

    @property
    def free(self) -> Sequence[Free]:
        """The parameters of `base` that are fitted together with the terms, with their priors."""

    @property
    def sensitivities(self) -> Array:
        """(N, parameters): change of the whitened simulated signals per coordinate of `free`, at `base`."""

    @property
    def segments(self) -> Sequence[Segment]:
        """The segments that the N rows consist of, in any order."""

    def residual(self, models: Sequence[Model]) -> Array:
        """Returns (models, N): measured less simulated, over the scale, without priors."""


def with_terms(model: Model, values: Mapping[str, float]) -> Model:
    """Returns `model` with coefficients and settings of composed terms added to those that it has."""
    table = {**model.effects.get(EFFECT, {}), **values}
    return dataclasses.replace(model, effects={**model.effects, EFFECT: table})


def residuals(problem: Problem, models: Sequence[Model]) -> Array:
    """Returns (models, N): `problem.residual`, computed in chunks; NaN where the plant diverges."""
    count = len(problem.sensitivities)
    found = np.empty((len(models), count))
    for first in range(0, len(models), _CHUNK):
        chunk = models[first : first + _CHUNK]
        try:
            found[first : first + len(chunk)] = problem.residual(chunk)
        except SimulationError:
            for k, model in enumerate(chunk):
                try:
                    found[first + k] = problem.residual([model])[0]
                except SimulationError:
                    found[first + k] = np.nan
    return found


def prior(free: Sequence[Free], point: Array, start: Array) -> Array:
    """Returns (parameters,): how far each parameter is from its stated value, in sd.

    A parameter without a prior has a loose anchor at `start`.
    """
    return np.array(
        [
            (one.to_value(float(x)) - one.known.value) / one.known.sd
            if one.known is not None and one.known.sd
            else (float(x) - float(x0)) / _ANCHOR_SD
            for one, x, x0 in zip(free, point, start, strict=True)
        ]
    )


class Projection:
    """Removes from a residual what the nominal parameters can take up, as far as their priors allow."""

    def __init__(self, problem: Problem, point: Array) -> None:
        slopes = np.diag((prior(problem.free, point + 1e-4, point) - prior(problem.free, point - 1e-4, point)) / 2e-4)
        self._span, self._triangle = np.linalg.qr(np.vstack([-problem.sensitivities, slopes]))
        self._prior = prior(problem.free, point, point)

    def of_residual(self, residual: Array) -> Array:
        """Returns (N + parameters,) from (N,)."""
        return self._without_span(np.concatenate([residual, self._prior]))

    def of_slopes(self, slopes: Array) -> Array:
        """Returns (N + parameters, columns) from (N, columns): slopes of the residual; the priors have none."""
        return self._without_span(np.vstack([slopes, np.zeros((self._span.shape[1], slopes.shape[1]))]))

    def shift(self, residual: Array) -> Array:
        """Returns (parameters,): the step of the nominal coordinates that takes up what it can of (N,)."""
        taken = self._span.T @ np.concatenate([residual, self._prior])
        step = -np.linalg.lstsq(self._triangle, taken, rcond=None)[0]
        return np.asarray(np.clip(step, -_LONGEST_STEP, _LONGEST_STEP))

    def _without_span(self, values: Array) -> Array:
        return np.asarray(values - self._span @ (self._span.T @ values))
