"""Composes a term for what no named effect takes away: few terms of a fixed basis, at one place where that will do.

Sparse regression by forward selection with refits (FROLS: Chen, Billings & Luo 1989), on signatures that simulation
gives instead of on derivatives: a library regressed on derivatives of noisy data finds what the noise looks like. Each
set of terms is fitted by simulation, together with the nominal parameters, before it is compared with others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.gates import LEAST_GAIN, LEAST_GAIN_SHARE, MOST_TERMS, TERM_RIVAL_MARGIN
from brickpilot.discover.terms.basis import EFFECT, Equation, Term, basis, equation
from brickpilot.discover.terms.fit import FINE, FIRST, ROUGH, SETTLED, Effort, Fit, fit, nominal_point, unfitted
from brickpilot.discover.terms.screen import Atom, Problem, Screen, Trial, residuals, values_of, with_terms
from brickpilot.fit.parameters import with_values
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Tell = Callable[[str], None]

_SCREENED, _FOLLOWED = 24, 8  # atoms that are simulated at their size; that are fitted
_HOPELESS = 2.0  # times the cost of the best after a few steps: not fitted on
_NOISE = 0.438  # of cost a sample: half the mean loss of unit normal noise


@dataclass(frozen=True)
class Rival:
    """Another composition that was fitted and left no more than a little above the best: the data cannot decide."""

    terms: tuple[Term, ...]
    settings: Mapping[str, float]
    equation: Equation
    cost: float


@dataclass(frozen=True)
class ComposedTerms:
    """The composed term.

    Attributes:
        terms: with their coefficients and sds, SI; in the order of the table.
        settings: what else shapes them, such as a frequency, and `settings_sd`.
        model: the base model refitted, with the term in ``effects[EFFECT]``; only what is not preset.
        equation: the term written out.
        cost_before, cost_after: half the sum of the residual's loss and priors, in scales, over the fitted runs.
        rms_before, rms_after: of the whitened residual.
        rivals: compositions that did about as well, best first.
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
        """Where it acts, keys of `basis.PLACES`."""
        return tuple(dict.fromkeys(term.basis.place for term in self.terms))


def find_terms(problem: Problem, *, rough: Problem | None = None, tell: Tell = lambda _: None) -> ComposedTerms | None:
    """The term that takes most of the residual's structure away, or None where none is worth its parameters.

    Args:
        problem: what is fitted in the end.
        rough: the same data, cheaper to simulate, for the search; None: `problem`.
        tell: called with what is being done.

    The same problem gives the same result; nothing here is random.
    """
    searched = problem if rough is None else rough
    best, tried = _search(searched, tell)
    if not best.atoms:
        return None
    tell("fitting the composed term")
    before = unfitted(problem)
    final = fit(problem, best.atoms, best.model, FINE)
    if final is None or not _worth(before, final):
        return None
    return _result(problem, before, final, _rivals(best, tried))


def _search(problem: Problem, tell: Tell) -> tuple[Fit, list[Fit]]:
    """Forward, an atom at a time; then each exchanged for a better one; then without those that are not needed."""
    current = unfitted(problem)
    tell("simulating every possible term")
    library = Screen(problem, nominal_point(problem, problem.base))
    everything: list[Fit] = []
    while len(current.atoms) < MOST_TERMS and _may_gain(problem, current):
        tell(f"fitting term {len(current.atoms) + 1}")
        tried = _tried(problem, library, current, library.atoms)
        everything += tried
        if not tried or not _worth(current, tried[0]):
            break
        tell("exchanging terms for others")
        current, more = _exchanged(problem, library, tried[0])
        everything += more
    return _pruned(problem, current), everything


def _tried(problem: Problem, library: Screen, beside: Fit, atoms: Sequence[Atom]) -> list[Fit]:
    """The best of `atoms` fitted beside what `beside` has, best first."""
    usable = [a for a in atoms if a.agrees(beside.settings) and not set(a.names) & _names(beside)]
    trials = _various(library.best(beside.model, usable, _SCREENED))
    fits = [one for trial in trials if (one := _extended(problem, beside, trial)) is not None]
    for effort in (ROUGH, SETTLED):
        fits = _fitted_on(problem, fits, effort)
    return sorted(fits, key=lambda one: one.charged)


def _fitted_on(problem: Problem, fits: Sequence[Fit], effort: Effort) -> list[Fit]:
    """The same fits, in the order of the screen, those taken further that are ahead in it or by now.

    Where a nominal parameter has to go far, the screen sees more of an atom's worth than a fit's first steps do.
    """
    ahead = {0, 1} if effort is ROUGH else {0}
    best = min((one.charged for one in fits), default=0.0)
    near = sorted(range(len(fits)), key=lambda k: fits[k].charged)[: len(ahead)]
    ahead |= {k for k in near if fits[k].charged < _HOPELESS * best}
    found = list(fits)
    for k in sorted(ahead & set(range(len(fits)))):
        more = fit(problem, fits[k].atoms, fits[k].model, effort) if _may_gain(problem, fits[k]) else None
        found[k] = more if more is not None and more.cost < fits[k].cost else fits[k]
    return found


def _exchanged(problem: Problem, library: Screen, found: Fit) -> tuple[Fit, list[Fit]]:
    """Another atom in the place of one: at a period that is fitted now, or beside atoms that it was not tried with."""
    everything: list[Fit] = []
    for atom in found.atoms:
        if atom not in found.atoms or not (atom.tuned or len(found.atoms) > 1):
            continue
        rest = _without(problem, found, atom)
        if rest is None:
            continue
        others = library.family(atom, found.settings) if atom.tuned else []
        library.add(others)
        others += [one for one in library.atoms if len(found.atoms) > 1 and one not in others]
        tried = _tried(problem, library, rest, [one for one in others if one != atom])
        everything += tried
        if tried and tried[0].charged < found.charged:
            found = tried[0]
    return found, everything


def _may_gain(problem: Problem, found: Fit) -> bool:
    """Whether more is left than noise leaves, by as much as a term has to take away."""
    return found.cost - _NOISE * len(problem.sensitivities) > max(LEAST_GAIN, LEAST_GAIN_SHARE * found.cost)


def _names(found: Fit) -> set[str]:
    return {name for atom in found.atoms for name in atom.names}


def _various(trials: Sequence[Trial]) -> list[Trial]:
    """The best trials, no more than two of the same terms with other settings."""
    found: list[Trial] = []
    for trial in trials:
        if sum(one.atom.names == trial.atom.names for one in found) < 2:
            found.append(trial)
    return found[:_FOLLOWED]


def _worth(before: Fit, after: Fit) -> bool:
    return before.charged - after.charged > max(LEAST_GAIN, LEAST_GAIN_SHARE * after.cost)


def _extended(problem: Problem, beside: Fit, trial: Trial) -> Fit | None:
    """The first steps of a fit, from where the screen saw the nominal parameters go, if that is better."""
    atoms = (*beside.atoms, trial.atom)
    model = with_terms(beside.model, values_of(trial, beside.model))
    point = nominal_point(problem, model) + trial.shift
    moved = with_values(model, {one.name: one.to_value(float(x)) for one, x in zip(problem.free, point, strict=True)})
    left = np.sum(residuals(problem, [model, moved]) ** 2, axis=1)
    return fit(problem, atoms, moved if left[1] < left[0] else model, FIRST)


def _pruned(problem: Problem, found: Fit) -> Fit:
    while len(found.atoms) > 1:
        shorter = [_without(problem, found, atom) for atom in found.atoms]
        best = min((one for one in shorter if one is not None), key=lambda one: one.charged, default=None)
        if best is None or _worth(best, found):
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
    for other in sorted(tried, key=lambda one: one.charged):
        names = frozenset(_names(other))
        if other.charged - best.charged <= TERM_RIVAL_MARGIN and not _names(best) <= names:
            terms = _terms(other)
            found.setdefault(names, Rival(terms, other.settings, equation(terms, other.settings), other.cost))
    return tuple(found.values())


def _terms(found: Fit) -> tuple[Term, ...]:
    table, names = found.model.effects[EFFECT], _names(found)
    return tuple(Term(one, table[one.name], found.sds[one.name]) for one in basis() if one.name in names)


def _result(problem: Problem, before: Fit, final: Fit, rivals: tuple[Rival, ...]) -> ComposedTerms:
    terms = _terms(final)
    left = residuals(problem, [problem.base, final.model])
    rms = np.sqrt(np.mean(left**2, axis=1))
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
