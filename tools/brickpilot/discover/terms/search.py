"""Searches for the terms that explain what no named effect does: few terms of a fixed basis, at one place if possible.

The search is a sparse regression by forward selection with refits (FROLS: Chen, Billings & Luo 1989). It works on
signatures from simulation, not on derivatives: a library that is regressed on derivatives of noisy data finds the
noise. Each set of terms is fitted by simulation, together with the nominal parameters, before it is compared.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.gates import LEAST_GAIN, LEAST_GAIN_SHARE, MOST_TERMS, TERM_RIVAL_MARGIN
from brickpilot.discover.terms.atoms import Atom
from brickpilot.discover.terms.basis import EFFECT, Term, basis
from brickpilot.discover.terms.coordinates import nominal_point
from brickpilot.discover.terms.equation import Equation, equation
from brickpilot.discover.terms.fit import FINE, FIRST, ROUGH, SETTLED, Effort, Fit, fit, unfitted
from brickpilot.discover.terms.problem import Problem, residuals, with_terms
from brickpilot.discover.terms.screen import Screen, Trial, values_of
from brickpilot.fit.parameters import with_values
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Tell = Callable[[str], None]

_SIMULATED, _FITTED = 24, 8  # atoms that are simulated at their size; that are fitted
_HOPELESS = 2.0  # times the cost of the best after a few steps: fitted no further
_NOISE_COST = 0.438  # mean cost of a sample of unit normal noise


@dataclass(frozen=True)
class Rival:
    """Another set of terms that was fitted nearly as well: the data cannot tell it from the best one."""

    terms: tuple[Term, ...]
    settings: Mapping[str, float]
    equation: Equation
    cost: float


@dataclass(frozen=True)
class ComposedTerms:
    """The terms that were found.

    Attributes:
        terms: with coefficients and sds, SI, in the order of the table.
        settings, settings_sd: parameters that shape the terms, such as a frequency, and their sds.
        model: the base model fitted together with the terms. ``effects[EFFECT]`` holds only what differs from presets.
        equation: the terms written as an equation.
        cost_before, cost_after: cost over the fit runs, in scales, without and with the terms.
        rms_before, rms_after: rms of the whitened residual.
        rivals: other sets of terms that fit about as well, the best first.
    """

    terms: tuple[Term, ...]
    settings: Mapping[str, float]
    settings_sd: Mapping[str, float]
    model: Model
    equation: Equation
    cost_before: float
    cost_after: float
    rms_before: float
    rms_after: float
    rivals: tuple[Rival, ...]

    @property
    def places(self) -> tuple[str, ...]:
        """Where they act: keys of `basis.PLACES`."""
        return tuple(dict.fromkeys(term.basis.place for term in self.terms))


def find_terms(
    problem: Problem, *, rough: Problem | None = None, tell: Tell = lambda _: None, deadline: Deadline = NO_LIMIT
) -> ComposedTerms | None:
    """Returns the terms that remove most of the structure in the residual; None if no term gains enough.

    Args:
        problem: the data of the last fit.
        rough: the same data for the search, faster to simulate; None: `problem`.
        tell: called with what is being done.
        deadline: the best terms so far are taken when it passes.

    Nothing here is random: the same problem gives the same result.
    """
    searched = problem if rough is None else rough
    best, tried = _search(searched, tell, deadline)
    if not best.atoms:
        return None
    tell("fitting the composed term")
    before = unfitted(problem)
    final = fit(problem, best.atoms, best.model, FINE)
    if final is None or not _gains_enough(before, final):
        return None
    return _result(problem, before, final, _rivals(best, tried))


def _search(problem: Problem, tell: Tell, deadline: Deadline) -> tuple[Fit, list[Fit]]:
    """Adds one atom at a time, exchanges each for a better one, and removes needless ones; returns all fits too."""
    current = unfitted(problem)
    tell("simulating every possible term")
    library = Screen(problem, nominal_point(problem, problem.base))
    everything: list[Fit] = []
    while len(current.atoms) < MOST_TERMS and _may_gain(problem, current) and not (everything and deadline.passed):
        tell(f"fitting term {len(current.atoms) + 1}")
        tried = _fit_beside(problem, library, current, library.atoms, deadline)
        everything += tried
        if not tried or not _gains_enough(current, tried[0]):
            break
        tell("exchanging terms for others")
        current, more = _exchange(problem, library, tried[0], deadline)
        everything += more
    deadline.allows("a part of the search for composed terms")
    return _pruned(problem, current), everything


def _fit_beside(problem: Problem, library: Screen, beside: Fit, atoms: Sequence[Atom], deadline: Deadline) -> list[Fit]:
    """Returns the best of `atoms`, each fitted beside those of `beside`, the best first."""
    usable = [a for a in atoms if a.agrees(beside.settings) and not set(a.names) & _names(beside)]
    trials = _diverse(library.best(beside.model, usable, _SIMULATED))
    begun = (trial for trial in trials if trial is trials[0] or not deadline.passed)
    fits = [one for trial in begun if (one := _fit_trial(problem, beside, trial)) is not None]
    for effort in (ROUGH, SETTLED):
        if deadline.passed:
            break
        fits = _fitted_further(problem, fits, effort)
    return sorted(fits, key=lambda one: one.penalised_cost)


def _fitted_further(problem: Problem, fits: Sequence[Fit], effort: Effort) -> list[Fit]:
    """Returns the fits in the order of the screen. Those that lead the screen, or lead by now, are fitted further.

    Where a nominal parameter has to move far, the screen shows more of an atom's gain than the first steps of a fit.
    """
    ahead = {0, 1} if effort is ROUGH else {0}
    best = min((one.penalised_cost for one in fits), default=0.0)
    near = sorted(range(len(fits)), key=lambda k: fits[k].penalised_cost)[: len(ahead)]
    ahead |= {k for k in near if fits[k].penalised_cost < _HOPELESS * best}
    found = list(fits)
    for k in sorted(ahead & set(range(len(fits)))):
        more = fit(problem, fits[k].atoms, fits[k].model, effort) if _may_gain(problem, fits[k]) else None
        found[k] = more if more is not None and more.cost < fits[k].cost else fits[k]
    return found


def _exchange(problem: Problem, library: Screen, found: Fit, deadline: Deadline) -> tuple[Fit, list[Fit]]:
    """Replaces each atom by a better one: at the period that is fitted now, or one not tried beside the rest."""
    everything: list[Fit] = []
    for atom in found.atoms:
        if deadline.passed:
            break
        if atom not in found.atoms or not (atom.tuned or len(found.atoms) > 1):
            continue
        rest = _without(problem, found, atom)
        if rest is None:
            continue
        others = library.family(atom, found.settings) if atom.tuned else []
        library.add(others)
        others += [one for one in library.atoms if len(found.atoms) > 1 and one not in others]
        tried = _fit_beside(problem, library, rest, [one for one in others if one != atom], deadline)
        everything += tried
        if tried and tried[0].penalised_cost < found.penalised_cost:
            found = tried[0]
    return found, everything


def _may_gain(problem: Problem, found: Fit) -> bool:
    """Returns whether the cost above that of noise is as much as a term has to gain."""
    return found.cost - _NOISE_COST * len(problem.sensitivities) > max(LEAST_GAIN, LEAST_GAIN_SHARE * found.cost)


def _names(found: Fit) -> set[str]:
    return {name for atom in found.atoms for name in atom.names}


def _diverse(trials: Sequence[Trial]) -> list[Trial]:
    """Returns the best trials, at most two of the same terms with different settings."""
    found: list[Trial] = []
    for trial in trials:
        if sum(one.atom.names == trial.atom.names for one in found) < 2:
            found.append(trial)
    return found[:_FITTED]


def _gains_enough(before: Fit, after: Fit) -> bool:
    return before.penalised_cost - after.penalised_cost > max(LEAST_GAIN, LEAST_GAIN_SHARE * after.cost)


def _fit_trial(problem: Problem, beside: Fit, trial: Trial) -> Fit | None:
    """Returns the first steps of a fit, from where the screen moved the nominal parameters if that is better."""
    atoms = (*beside.atoms, trial.atom)
    model = with_terms(beside.model, values_of(trial, beside.model))
    point = nominal_point(problem, model) + trial.shift
    moved = with_values(model, {one.name: one.to_value(float(x)) for one, x in zip(problem.free, point, strict=True)})
    squares = np.sum(residuals(problem, [model, moved]) ** 2, axis=1)
    return fit(problem, atoms, moved if squares[1] < squares[0] else model, FIRST)


def _pruned(problem: Problem, found: Fit) -> Fit:
    """Returns `found` without needless atoms; at least one stays."""
    while len(found.atoms) > 1:
        shorter = [_without(problem, found, atom) for atom in found.atoms]
        best = min((one for one in shorter if one is not None), key=lambda one: one.penalised_cost, default=None)
        if best is None or _gains_enough(best, found):
            return found
        found = best
    return found


def _without(problem: Problem, found: Fit, atom: Atom) -> Fit | None:
    kept = tuple(one for one in found.atoms if one is not atom)
    if not kept:
        return unfitted(problem)
    needed = {name for one in kept for term in one.terms for name in (term.name, *term.tuned)}
    own = set(problem.base.effects.get(EFFECT, {}))
    table = {k: v for k, v in found.model.effects[EFFECT].items() if k in needed or k in own}
    model = dataclasses.replace(found.model, effects={**found.model.effects, EFFECT: table})
    return fit(problem, kept, model, ROUGH)


def _rivals(best: Fit, tried: Sequence[Fit]) -> tuple[Rival, ...]:
    found: dict[frozenset[str], Rival] = {}
    for other in sorted(tried, key=lambda one: one.penalised_cost):
        names = frozenset(_names(other))
        if other.penalised_cost - best.penalised_cost <= TERM_RIVAL_MARGIN and not _names(best) <= names:
            terms = _terms(other)
            found.setdefault(names, Rival(terms, other.settings, equation(terms, other.settings), other.cost))
    return tuple(found.values())


def _terms(found: Fit) -> tuple[Term, ...]:
    table, names = found.model.effects[EFFECT], _names(found)
    return tuple(Term(one, table[one.name], found.sds[one.name]) for one in basis() if one.name in names)


def _result(problem: Problem, before: Fit, final: Fit, rivals: tuple[Rival, ...]) -> ComposedTerms:
    terms = _terms(final)
    rms = np.sqrt(np.mean(residuals(problem, [problem.base, final.model]) ** 2, axis=1))
    return ComposedTerms(
        terms,
        final.settings,
        {name: final.sds[name] for name in final.tuned},
        final.model,
        equation(terms, final.settings),
        before.cost,
        final.cost,
        float(rms[0]),
        float(rms[1]),
        rivals,
    )
