"""Fits composed terms by simulation, together with the nominal parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brickpilot.discover.gates import (
    PARAMETER_COST,
    TERM_PLACE_COST,
    TERM_SECOND_PLACE_COST,
    TERM_SENSOR_COST,
    strip_cost,
)
from brickpilot.discover.terms.atoms import Atom
from brickpilot.discover.terms.basis import EFFECT
from brickpilot.discover.terms.coordinates import Coordinates, nominal_point
from brickpilot.discover.terms.problem import Problem, prior, residuals
from brickpilot.fit.robust import HUBER_THRESHOLD
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_ROUGH_THRESHOLD_RMS = 3.0  # Huber threshold of a rough fit, in rms: with a lower one a large residual shrinks slowly
_INSIDE = 1e-9  # of the bounds, in coordinates
_STEP = 1e-5  # of finite differences, in coordinates: short, because some directions hardly change the residual


@dataclass(frozen=True)
class Effort:
    """How far a descent goes.

    Attributes:
        tolerance: relative change of the cost at its end.
        evaluations: of the residual, at most.
        kept: nominal sensitivities are those of the start ("start") or of the base model ("base") throughout. They
            cost most of a descent and change little. "" computes them anew in each step.
    """

    tolerance: float
    evaluations: int
    kept: str = ""


FIRST, ROUGH, SETTLED, FINE = Effort(1e-2, 4, "base"), Effort(1e-3, 12, "start"), Effort(1e-4, 8), Effort(1e-6, 25)


@dataclass(frozen=True)
class Fit:
    """A fitted set of atoms. `sds`: of each coefficient and tuned setting."""

    atoms: tuple[Atom, ...]
    settings: Mapping[str, float]
    tuned: tuple[str, ...]
    sds: Mapping[str, float]
    model: Model
    cost: float

    @property
    def penalised_cost(self) -> float:
        """The cost with the penalties for its parameters, for the places where it acts, and for strips of the floor."""
        places = {atom.place for atom in self.atoms}
        extra = TERM_SECOND_PLACE_COST * max(len(places) - 1, 0) + sum(
            TERM_PLACE_COST.get(place, TERM_SENSOR_COST) for place in places
        )
        extra += strip_cost(self.cost) if any(atom.is_strip for atom in self.atoms) else 0.0
        return self.cost + PARAMETER_COST * (sum(len(atom.terms) for atom in self.atoms) + len(self.tuned)) + extra


def unfitted(problem: Problem) -> Fit:
    """Returns the base model without terms."""
    point = nominal_point(problem, problem.base)
    residual = residuals(problem, [problem.base])[0]
    return Fit((), {}, (), {}, problem.base, _cost(np.concatenate([residual, prior(problem.free, point, point)])))


def fit(problem: Problem, atoms: tuple[Atom, ...], model: Model, effort: Effort) -> Fit | None:
    """Returns the end of a descent from `model`; None where the plant diverges there.

    A rough fit ends with a higher Huber threshold; the others go on with the ordinary one.
    """
    coordinates = Coordinates(problem, atoms, model)
    low, high = coordinates.bounds()
    point = np.clip(coordinates.start, low + _INSIDE, high - _INSIDE)
    objective = _Objective(problem, coordinates, high)
    if not np.all(np.isfinite(objective.residual(point))):
        return None
    if effort.kept:
        objective.keep_nominal_columns(point if effort.kept == "start" else None)
    rough = max(HUBER_THRESHOLD, _ROUGH_THRESHOLD_RMS * float(np.sqrt(np.mean(objective.residual(point) ** 2))))
    for threshold in dict.fromkeys([rough] if effort.kept else [rough, HUBER_THRESHOLD]):
        found = least_squares(
            objective.residual,
            point,
            jac=objective.jacobian,
            bounds=(low, high),
            loss="soft_l1",
            f_scale=threshold,
            max_nfev=effort.evaluations,
            ftol=effort.tolerance,
            xtol=effort.tolerance,
        )
        point = np.asarray(found.x)
    jacobian = np.asarray(found.jac)
    sds = coordinates.sds(point, np.linalg.pinv(jacobian.T @ jacobian, hermitian=True))
    fitted = coordinates.model_at(point)
    settings = {name: fitted.effects[EFFECT][name] for atom in atoms for name, _ in atom.settings}
    return Fit(atoms, settings, coordinates.tuned, sds, fitted, _cost(objective.residual(point)))


class _Objective:
    """Residual and Jacobian of a fit, priors included."""

    def __init__(self, problem: Problem, coordinates: Coordinates, high: Array) -> None:
        self._problem, self._coordinates, self._high = problem, coordinates, high
        self._count = len(problem.free)
        self._origin = nominal_point(problem, problem.base)
        self._kept: Array | None = None
        self._memory: dict[bytes, Array] = {}

    def keep_nominal_columns(self, point: Array | None) -> None:
        """Keeps the columns of the nominal parameters as they are at `point`, or at the base model for None."""
        self._kept = -self._problem.sensitivities if point is None else self._columns(point, range(self._count))

    def residual(self, point: Array) -> Array:
        return np.concatenate([self._simulated(point), self._prior(point[: self._count])])

    def jacobian(self, point: Array) -> Array:
        count, kept = self._count, self._kept
        own = self._columns(point, range(0 if kept is None else count, len(point)))
        data = own if kept is None else np.hstack([kept, own])
        slopes = self._prior(point[:count] + _STEP) - self._prior(point[:count])
        return np.vstack([data, np.hstack([np.diag(slopes / _STEP), np.zeros((count, len(point) - count))])])

    def _prior(self, nominal: Array) -> Array:
        return prior(self._problem.free, nominal, self._origin)

    def _simulated(self, point: Array) -> Array:
        key = point.tobytes()
        if key not in self._memory:
            self._memory.clear()
            self._memory[key] = residuals(self._problem, [self._coordinates.model_at(point)])[0]
        return self._memory[key]

    def _columns(self, point: Array, which: Sequence[int]) -> Array:
        steps = np.where(point + _STEP < self._high, _STEP, -_STEP)
        models = [self._coordinates.model_at(point + steps * (np.arange(len(point)) == k)) for k in which]
        found = ((residuals(self._problem, models) - self._simulated(point)) / steps[list(which), np.newaxis]).T
        return np.where(np.isfinite(found), found, 0.0)


def _cost(residual: Array) -> float:
    """Returns half the sum of the loss."""
    return float(HUBER_THRESHOLD**2 * np.sum(np.sqrt(1 + (residual / HUBER_THRESHOLD) ** 2) - 1))
