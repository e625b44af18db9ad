"""Finds the terms that explain what no named effect does: few terms of a fixed basis, at one place if possible.

The search is that of named effects: a sparse regression by forward selection with refits (FROLS: Chen, Billings & Luo
1989). It works on signatures from simulation, not on derivatives: a library that is regressed on derivatives of noisy
data finds the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from brickpilot.discover.deadline import NO_LIMIT, Deadline
from brickpilot.discover.fitting import FittedModel, best_first, refine
from brickpilot.discover.gates import TERM_RIVAL_MARGIN, gains_enough
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search import search
from brickpilot.discover.terms.atoms import Atom
from brickpilot.discover.terms.basis import EFFECT, Term, basis
from brickpilot.discover.terms.equation import Equation, equation
from brickpilot.discover.terms.source import TermSource

Tell = Callable[[str], None]


@dataclass(frozen=True)
class ComposedTerms:
    """The terms that were found.

    Attributes:
        fitted: the base model fitted together with the terms, at the measured samples.
        terms: with coefficients, SI, in the order of the table.
        settings: parameters that shape the terms, such as a frequency.
        rivals: other sets of terms that fit about as well on the coarse grid, the best first.
    """

    fitted: FittedModel
    terms: tuple[Term, ...]
    settings: Mapping[str, float]
    rivals: tuple[tuple[Term, ...], ...]

    @property
    def equation(self) -> Equation:
        """The terms written as an equation."""
        return equation(self.terms, self.settings)

    @property
    def places(self) -> tuple[str, ...]:
        """Where they act: keys of `basis.PLACES`."""
        return tuple(dict.fromkeys(term.basis.place for term in self.terms))


def find_terms(
    prepared: Prepared, base: FittedModel, *, tell: Tell = lambda _: None, deadline: Deadline = NO_LIMIT
) -> ComposedTerms | None:
    """Returns the terms that remove most of the structure in the residual; None if no term gains enough.

    Args:
        base: the model that leaves structure, fitted at the measured samples.
        tell: called with what is being done.
        deadline: the best terms so far are taken when it passes.

    Nothing here is random: the same data give the same result.
    """
    started = refine(prepared.coarse, [base], prepared.jobs)
    if not started:
        return None
    tell("simulating every possible term")
    source = TermSource(prepared.coarse, started[0], prepared.excitation)
    searched = search(prepared, source, started[0], tell, deadline, "a part of the search for term 1")
    if searched.best is searched.nominal:
        return None
    tell("fitting the composed term")
    final = refine(prepared.fine, [searched.best], prepared.jobs)
    if not final or not gains_enough(base.penalised_cost, final[0].penalised_cost, prepared.fine.floor_cost()):
        return None
    tried = best_first([one for step in searched.rounds for one in step.tried])
    return ComposedTerms(final[0], _terms(final[0]), _settings(final[0]), _rivals(searched.best, tried))


def _rivals(best: FittedModel, tried: list[FittedModel]) -> tuple[tuple[Term, ...], ...]:
    found: dict[frozenset[str], tuple[Term, ...]] = {}
    for other in tried:
        names = frozenset(_names(other))
        if other.penalised_cost - best.penalised_cost <= TERM_RIVAL_MARGIN and not _names(best) <= names:
            found.setdefault(names, _terms(other))
    return tuple(found.values())


def _atoms(found: FittedModel) -> list[Atom]:
    return [one for one in found.chosen if isinstance(one, Atom)]


def _names(found: FittedModel) -> set[str]:
    return {name for one in _atoms(found) for name in one.names}


def _terms(found: FittedModel) -> tuple[Term, ...]:
    table, names = found.model.effects[EFFECT], _names(found)
    return tuple(Term(one, table[one.name]) for one in basis() if one.name in names)


def _settings(found: FittedModel) -> dict[str, float]:
    table = found.model.effects[EFFECT]
    return {name: table[name] for one in _atoms(found) for name, _ in one.settings}
