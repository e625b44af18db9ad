"""The coordinates in which composed terms are fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.terms import periods
from brickpilot.discover.terms.atoms import Atom
from brickpilot.discover.terms.basis import EFFECT, parameters
from brickpilot.discover.terms.problem import Problem, with_terms
from brickpilot.fit.parameters import value_of, with_values
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_LEAST = 1e-12  # SI: the least value in a logarithm


def nominal_point(problem: Problem, model: Model) -> Array:
    """Returns (parameters,): the coordinates of `problem.free` at `model`."""
    return np.array([one.to_coordinate(value_of(model, one.name)) for one in problem.free])


class Coordinates:
    """The nominal coordinates, then those of the atoms, then those of the tuned settings.

    A coefficient moves in its logarithm; the sine and the cosine of one period move in the logarithm of their
    amplitude and in their phase. If the data do not determine the vehicle's mass, for example, all forces grow with
    it, and only in logarithms is that direction straight. The sign of a single coefficient stays that of the start.
    """

    def __init__(self, problem: Problem, atoms: Sequence[Atom], model: Model) -> None:
        self._problem, self._model, self._atoms = problem, model, atoms
        table = model.effects[EFFECT]
        self._infos = {info.name: info for info in parameters()}
        self.tuned = tuple(dict.fromkeys(name for atom in atoms for name in atom.tuned))
        self._signs = {name: math.copysign(1.0, table[name]) for atom in atoms for name in atom.names}
        self._strip = table.get("patch_half_width", 1.0)
        # What swings less than once in a run is a drift or a loss: it would pass for any of them.
        self._slowest = periods.time_resolution(problem.segments, table.get("clock", 0.0))
        start = [one.to_coordinate(value_of(model, one.name)) for one in problem.free]
        for atom in atoms:
            values = [table[name] for name in atom.names]
            start.append(math.log(max(math.hypot(*values), _LEAST)))
            start += [math.atan2(values[1], values[0])] if len(values) == 2 else []
        start += [table[n] / self._strip if n == "patch_x" else math.log(max(table[n], _LEAST)) for n in self.tuned]
        self.start = np.array(start)

    def values_at(self, point: Array) -> dict[str, float]:
        """Returns the coefficients at a point, then the tuned settings."""
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
            values[name] = value * self._strip if name == "patch_x" else _exp(value)
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
                low[first + k], high[first + k] = info.minimum / self._strip, info.maximum / self._strip
            else:
                least = self._slowest if name == "frequency" else max(info.minimum, _LEAST)
                low[first + k], high[first + k] = math.log(least), math.log(info.maximum)
        return low, high

    def sds(self, point: Array, covariance: Array) -> dict[str, float]:
        """Returns the sd of each coefficient and tuned setting, from the covariance of the coordinates."""

        def values(where: Array) -> Array:
            return np.array(list(self.values_at(where).values()))

        slopes = np.array(
            [(values(point + step) - values(point - step)) / 2e-6 for step in np.eye(len(point)) * 1e-6]
        ).T
        return dict(zip(self.values_at(point), np.sqrt(np.diag(slopes @ covariance @ slopes.T)).tolist(), strict=True))


def _exp(value: float) -> float:
    return math.exp(min(value, 700.0))
