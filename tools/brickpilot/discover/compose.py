"""Composes a law without a name, where no effect of the library explains what is left.

A law is a sum of few terms of a fixed basis. They are searched like effects (a sparse regression by forward selection
with refits, FROLS: Chen, Billings & Luo 1989), on signatures from simulation and not on derivatives, and are weighed by
the same evidence.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from brickpilot.discover.deadline import COMPOSED
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.search import Found, Search
from brickpilot.discover.terms.atoms import Atom
from brickpilot.discover.terms.basis import EFFECT, Term, basis
from brickpilot.discover.terms.source import TermSource
from brickpilot.discover.verdict import Verdict, weigh

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Composed:
    """A composed law.

    Attributes:
        explanation: the base model fitted together with the terms.
        terms: with coefficients, SI, in the order of the table.
        settings: parameters that shape the terms, such as a frequency.
        alone: the terms stand without effects beside them.
    """

    explanation: Explanation
    terms: tuple[Term, ...]
    settings: Mapping[str, float]
    alone: bool

    @property
    def mechanism(self) -> str:
        return self.terms[0].basis.mechanism


def compose(prepared: Prepared, judge: Judge, verdict: Verdict, tell: Tell) -> Composed | None:
    """Returns the law of few terms that explains the fit runs best, beside no effect or beside the best names.

    None where no term is sure: each holds 95 % of the weight beside its base.
    """
    deadline = prepared.until(COMPOSED)
    if not deadline.allows("a composed term"):
        return None
    tell("composing a term for the rest")
    bases = {one.key: one for one in (verdict.nominal, verdict.best)}
    tried: list[tuple[Found, Verdict]] = []
    for base in bases.values():
        search = Search(
            prepared.coarse, base, TermSource(prepared.coarse, base), prepared.excitation, prepared.jobs, deadline, tell
        )
        found = search.run(judge)
        tried.append((found, weigh(found)))
    sure = [(found, one) for found, one in tried if one.kind in ("named", "ambiguous")]
    if not sure:
        return None
    found, best = max(sure, key=lambda pair: _score(pair[0], pair[1].best))
    return _composed(best.best, alone=best.nominal.key == verdict.nominal.key)


def _score(found: Found, one: Explanation) -> float:
    known: Evidence = found.table[one.key]
    return known.log_weight(found.temperature)


def _composed(found: Explanation, *, alone: bool) -> Composed:
    table = found.model.effects[EFFECT]
    atoms = [one for one in found.parts if isinstance(one, Atom)]
    names = {name for one in atoms for name in one.names}
    settings = {name: table[name] for one in atoms for name, _ in one.settings}
    return Composed(found, tuple(Term(one, table[one.name]) for one in basis() if one.name in names), settings, alone)


def refitted(found: Composed, explanation: Explanation) -> Composed:
    """Returns the law with the values of a later fit of the same parts."""
    return dataclasses.replace(_composed(explanation, alone=found.alone))
