"""Fits composed terms by simulation, together with the nominal parameters."""

from __future__ import annotations

import math
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
)
from brickpilot.discover.terms.basis import EFFECT, parameters
from brickpilot.discover.terms.screen import Atom, Problem, prior, residuals, with_terms
from brickpilot.fit.parameters import value_of, with_values
from brickpilot.fit.robust import HUBER_THRESHOLD
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_SPARED = 3.0  # rms: while a fit is rough the loss bends no nearer, or a large residual would crawl
_LEAST = 1e-12  # SI: nothing in a logarithm is less
_INSIDE = 1e-9  # of the bounds, in coordinates
_STEP = 1e-5  # of differences, in coordinates: short, for the sake of directions that hardly show


@dataclass(frozen=True)
class Effort:
    """How far a descent goes: relative change of cost at its end, evaluations at most.

    `kept`: nominal sensitivities stay as they are at the start ("start") or at the base model ("base"): they change
    little on the way, and cost most of it.
    """

    tolerance: float
    evaluations: int
    kept: str = ""


FIRST, ROUGH, SETTLED, FINE = Effort(1e-2, 4, "base"), Effort(1e-3, 12, "start"), Effort(1e-4, 8), Effort(1e-6, 25)


@dataclass(frozen=True)
class Fit:
    """A set of atoms fitted. `sds`: of each coefficient and tuned setting."""

    atoms: tuple[Atom, ...]
    settings: Mapping[str, float]
    tuned: tuple[str, ...]
    sds: Mapping[str, float]
    model: Model
    cost: float

    @property
    def charged(self) -> float:
        """The cost with what its parameters, and a second place, have to be worth."""
        places = {atom.place for atom in self.atoms}
        extra = TERM_SECOND_PLACE_COST * max(len(places) - 1, 0) + sum(
            TERM_PLACE_COST.get(place, TERM_SENSOR_COST) for place in places
        )
        return self.cost + PARAMETER_COST * (sum(len(atom.terms) for atom in self.atoms) + len(self.tuned)) + extra


def unfitted(problem: Problem) -> Fit:
    """The base model as it is."""
    point = nominal_point(problem, problem.base)
    left = residuals(problem, [problem.base])[0]
    return Fit((), {}, (), {}, problem.base, _loss(np.concatenate([left, prior(problem.free, point, point)])))


def nominal_point(problem: Problem, model: Model) -> Array:
    """(parameters,): the coordinates of `problem.free` at `model`."""
    return np.array([one.to_coordinate(value_of(model, one.name)) for one in problem.free])


def _exp(value: float) -> float:
    return math.exp(min(value, 700.0))


class _Coordinates:
    """Nominal coordinates as they are, then those of the atoms, then those of the tuned settings.

    Coefficients move in their logarithm, and pairs of sine and cosine in that of their amplitude and in their phase:
    where the data do not know the vehicle's mass, say, all forces grow with it, and only in logarithms is that a
    straight way. The sign of a single coefficient is the start's.
    """

    def __init__(self, problem: Problem, atoms: Sequence[Atom], model: Model) -> None:
        self._problem, self._model, self._atoms = problem, model, atoms
        table = model.effects[EFFECT]
        self._infos = {info.name: info for info in parameters()}
        self.tuned = tuple(dict.fromkeys(name for atom in atoms for name in atom.tuned))
        self._signs = {name: math.copysign(1.0, table[name]) for atom in atoms for name in atom.names}
        self._reach = table.get("patch_half_width", 1.0)
        start = [one.to_coordinate(value_of(model, one.name)) for one in problem.free]
        for atom in atoms:
            values = [table[name] for name in atom.names]
            start.append(math.log(max(math.hypot(*values), _LEAST)))
            start += [math.atan2(values[1], values[0])] if len(values) == 2 else []
        start += [table[n] / self._reach if n == "patch_x" else math.log(max(table[n], _LEAST)) for n in self.tuned]
        self.start = np.array(start)

    def values_at(self, point: Array) -> dict[str, float]:
        """The effect's coefficients, then its tuned settings."""
        rest = iter(point[len(self._problem.free) :].tolist())
        values: dict[str, float] = {}
        for atom in self._atoms:
            size = _exp(next(rest))
            if len(atom.names) == 2:
                phase = next(rest)
                values |= {atom.names[0]: size * math.cos(phase), atom.names[1]: size * math.sin(phase)}
            else:
                values[atom.names[0]] = size * self._signs[atom.names[0]]
        for name in self.tuned:
            value = next(rest)
            values[name] = value * self._reach if name == "patch_x" else _exp(value)
        return {n: min(max(v, self._infos[n].minimum), self._infos[n].maximum) for n, v in values.items()}

    def model_at(self, point: Array) -> Model:
        nominal = {one.name: one.to_value(float(x)) for one, x in zip(self._problem.free, point, strict=False)}
        return with_terms(with_values(self._model, nominal), self.values_at(point))

    def bounds(self) -> tuple[Array, Array]:
        low = np.full(len(self.start), -np.inf)
        high = np.full(len(self.start), np.inf)
        for k, one in enumerate(self._problem.free):
            low[k], high[k] = one.bounds()
        first = len(self.start) - len(self.tuned)
        for k, name in enumerate(self.tuned):
            info = self._infos[name]
            if name == "patch_x":
                low[first + k], high[first + k] = info.minimum / self._reach, info.maximum / self._reach
            else:
                low[first + k], high[first + k] = math.log(max(info.minimum, _LEAST)), math.log(info.maximum)
        return low, high

    def sds(self, point: Array, covariance: Array) -> dict[str, float]:
        """Of each coefficient and tuned setting."""

        def values(where: Array) -> Array:
            return np.array(list(self.values_at(where).values()))

        slopes = np.array(
            [(values(point + step) - values(point - step)) / 2e-6 for step in np.eye(len(point)) * 1e-6]
        ).T
        return dict(zip(self.values_at(point), np.sqrt(np.diag(slopes @ covariance @ slopes.T)).tolist(), strict=True))


def fit(problem: Problem, atoms: tuple[Atom, ...], model: Model, effort: Effort) -> Fit | None:
    """The end of a descent from `model`; None where the plant diverges there."""
    places = _Coordinates(problem, atoms, model)
    count = len(problem.free)
    origin = nominal_point(problem, problem.base)
    memory: dict[bytes, Array] = {}

    def simulated(point: Array) -> Array:
        key = point.tobytes()
        if key not in memory:
            memory.clear()
            memory[key] = residuals(problem, [places.model_at(point)])[0]
        return memory[key]

    def residual(point: Array) -> Array:
        return np.concatenate([simulated(point), prior(problem.free, point[:count], origin)])

    low, high = places.bounds()

    def columns(point: Array, which: Sequence[int]) -> Array:
        steps = np.where(point + _STEP < high, _STEP, -_STEP)
        models = [places.model_at(point + steps * (np.arange(len(point)) == k)) for k in which]
        found = ((residuals(problem, models) - simulated(point)) / steps[list(which), np.newaxis]).T
        return np.where(np.isfinite(found), found, 0.0)

    def slopes(point: Array) -> Array:
        own = columns(point, range(0 if nominal is None else count, len(point)))
        data = own if nominal is None else np.hstack([nominal, own])
        known = prior(problem.free, point[:count] + _STEP, origin) - prior(problem.free, point[:count], origin)
        return np.vstack([data, np.hstack([np.diag(known / _STEP), np.zeros((count, len(point) - count))])])

    at = np.clip(places.start, low + _INSIDE, high - _INSIDE)
    if not np.all(np.isfinite(residual(at))):
        return None
    nominal: Array | None = None
    if effort.kept:
        nominal = columns(at, range(count)) if effort.kept == "start" else -problem.sensitivities
    bend = max(HUBER_THRESHOLD, _SPARED * float(np.sqrt(np.mean(residual(at) ** 2))))
    for loss_bend in dict.fromkeys([bend] if effort.kept else [bend, HUBER_THRESHOLD]):
        found = least_squares(
            residual,
            at,
            jac=slopes,
            bounds=(low, high),
            loss="soft_l1",
            f_scale=loss_bend,
            max_nfev=effort.evaluations,
            ftol=effort.tolerance,
            xtol=effort.tolerance,
        )
        at = np.asarray(found.x)
    jacobian = np.asarray(found.jac)
    sds = places.sds(at, np.linalg.pinv(jacobian.T @ jacobian, hermitian=True))
    model = places.model_at(at)
    settings = {name: model.effects[EFFECT][name] for atom in atoms for name, _ in atom.settings}
    return Fit(atoms, settings, places.tuned, sds, model, _loss(residual(at)))


def _loss(residual: Array) -> float:
    """Half the sum of the fit's loss."""
    return float(HUBER_THRESHOLD**2 * np.sum(np.sqrt(1 + (residual / HUBER_THRESHOLD) ** 2) - 1))
