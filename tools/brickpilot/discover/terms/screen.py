"""Screens composed terms: which are worth a fit, from one simulation of each.

The signature of a term is what a small size of it does to the residual, with everything projected out that the nominal
parameters can take up.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.terms import atoms as atom_list
from brickpilot.discover.terms import periods
from brickpilot.discover.terms.atoms import Atom, find_atoms, strip_atom
from brickpilot.discover.terms.basis import EFFECT, Basis
from brickpilot.discover.terms.problem import Problem, Projection, residuals, with_terms
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_TINY = 1e-8  # of a coefficient's range: large enough for the arithmetic, small enough to be linear
_SIZES = (1.0, 0.3)  # of the linear estimate, at which the best atoms are simulated
_STRIP_TERMS = ("surge_loss_patch", "yaw_loss_patch")


@dataclass(frozen=True)
class Trial:
    """An atom at the size that fits best.

    Attributes:
        cost: half the squared residual that it would leave if the nominal parameters were linear.
        shift: (parameters,) the step of their coordinates.
    """

    atom: Atom
    coefficients: tuple[float, ...]
    cost: float
    shift: Array = field(default_factory=lambda: np.empty(0), compare=False)


class Screen:
    """The signatures of atoms at the base model, and what each atom could gain beside chosen terms."""

    def __init__(self, problem: Problem, point: Array) -> None:
        self._problem = problem
        self._projection = Projection(problem, point)
        self._base = residuals(problem, [problem.base])[0]
        self._slopes: dict[Atom, Array] = {}
        residual = self._projection.of_residual(self._base)
        self.add(find_atoms(problem.base.vehicle, problem.segments, residual[: len(self._base)]))
        self._add_strips(residual)

    @property
    def atoms(self) -> tuple[Atom, ...]:
        return tuple(self._slopes)

    def family(self, atom: Atom, settings: Mapping[str, float]) -> list[Atom]:
        """Returns all atoms that the same settings shape, and this one at neighbouring settings."""
        return atom_list.family(atom, settings, self._problem.base.vehicle, self._problem.segments)

    def add(self, atoms: Sequence[Atom]) -> None:
        """Simulates each term that is new."""
        new = [(atom, term) for atom in atoms if atom not in self._slopes for term in atom.terms]
        slopes = self._signatures(new)
        for atom in dict.fromkeys(atom for atom, _ in new):
            self._slopes[atom] = slopes[:, [k for k, (other, _) in enumerate(new) if other is atom]]

    def best(self, model: Model, atoms: Sequence[Atom], count: int) -> list[Trial]:
        """Returns the atoms that could leave least beside the terms of `model`, the best first.

        All atoms are compared by their signatures at the base model. The best `count` of them are then simulated
        beside the terms of `model`, at the sizes that suit them.
        """
        residual = self._projection.of_residual(residuals(self._problem, [model])[0])
        linear = []
        for atom in atoms:
            slopes = self._slopes[atom]
            coefficients = _best_coefficients(atom, slopes, residual, model)
            after = residual + slopes @ coefficients
            linear.append(Trial(atom, tuple(coefficients), float(after @ after) / 2))
        best = sorted((one for one in linear if any(one.coefficients)), key=lambda one: one.cost)[:count]
        return _simulated(self._problem, model, self._projection, best)

    def _add_strips(self, residual: Array) -> None:
        """Adds terms on a strip across x, on those strips that a loss in narrow cells points at."""
        cells = periods.cells(self._problem.segments)
        for name in _STRIP_TERMS if cells else ():
            narrow = [strip_atom(name, *cell) for cell in cells]
            if self._problem.base.vehicle == "motor" and narrow[0].place == "yaw":
                continue
            slopes = self._signatures([(atom, atom.terms[0]) for atom in narrow])
            for first, last in periods.best_windows(slopes, residual):
                middle, half_width = (cells[first][0] + cells[last][0]) / 2, cells[first][1] * (last - first + 1)
                strip = strip_atom(name, middle, half_width)
                self.add(self.family(strip, dict(strip.settings)))

    def _signatures(self, terms: Sequence[tuple[Atom, Basis]]) -> Array:
        """Returns (N + parameters, terms): change of the projected residual per unit of each coefficient."""
        base = self._problem.base
        tiny = [with_terms(base, {**dict(a.settings), t.name: _slightly_more(base, t)}) for a, t in terms]
        sizes = np.array([_TINY * term.info.maximum for _, term in terms])
        moved = (residuals(self._problem, tiny) - self._base) / sizes[:, np.newaxis]
        moved[~np.isfinite(moved).all(axis=1)] = 0.0
        return self._projection.of_slopes(moved.T)


def values_of(trial: Trial, model: Model) -> dict[str, float]:
    """Returns the coefficients and settings of the trial, added to the terms of `model`."""
    chosen = model.effects.get(EFFECT, {})
    sums = {t.name: chosen.get(t.name, 0.0) + c for t, c in zip(trial.atom.terms, trial.coefficients, strict=True)}
    return {**dict(trial.atom.settings), **sums}


def _slightly_more(model: Model, term: Basis) -> float:
    return model.effects.get(EFFECT, {}).get(term.name, 0.0) + _TINY * term.info.maximum


def _best_coefficients(atom: Atom, slopes: Array, residual: Array, model: Model) -> Array:
    """Returns the coefficients within their ranges that remove most; 0 where an atom does nothing."""
    strength = np.linalg.norm(slopes, axis=0)
    if not np.all(strength > 0):
        return np.zeros(len(atom.terms))
    found = np.linalg.lstsq(slopes / strength, -residual, rcond=1e-6)[0] / strength
    chosen = model.effects.get(EFFECT, {})
    low = [_lowest(term, chosen) for term in atom.terms]
    return np.asarray(np.clip(found, low, [term.info.maximum for term in atom.terms]))


def _lowest(term: Basis, chosen: Mapping[str, float]) -> float:
    """Returns the lowest coefficient: 0 for dry friction, unless it reduces other dry friction."""
    one_sign = term.kind == "dry" and not any(
        name.startswith(f"{term.place}_dry") and v > 0 for name, v in chosen.items()
    )
    return 0.0 if one_sign and not term.name.endswith("_angle") and not term.sided else term.info.minimum


def _simulated(problem: Problem, model: Model, projection: Projection, trials: Sequence[Trial]) -> list[Trial]:
    """Returns the trials simulated at `_SIZES`, each at its better size, the best first: few terms are linear."""
    sized = [dataclasses.replace(t, coefficients=tuple(s * c for c in t.coefficients)) for t in trials for s in _SIZES]
    simulated = residuals(problem, [with_terms(model, values_of(one, model)) for one in sized])
    tried = []
    for one, residual in zip(sized, simulated, strict=True):
        if np.all(np.isfinite(residual)):
            after = projection.of_residual(residual)
            tried.append(dataclasses.replace(one, cost=float(after @ after) / 2, shift=projection.shift(residual)))
    best: dict[Atom, Trial] = {}
    for one in sorted(tried, key=lambda one: one.cost):
        best.setdefault(one.atom, one)
    return list(best.values())
