"""Composes a law without a name, where no effect of the library explains what is left.

A law is a sum of few terms of a fixed basis. They are searched like effects (a sparse regression by forward selection
with refits, FROLS: Chen, Billings & Luo 1989), on signatures from simulation and not on derivatives, and are weighed by
the same evidence.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover import periods
from brickpilot.discover.deadline import COMPOSED, Deadline
from brickpilot.discover.evidence import Evidence, Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.parts import Part
from brickpilot.discover.periods import Segment
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import Trial
from brickpilot.discover.search import Found, Search
from brickpilot.discover.term_atoms import Atom, family, find_atoms, strip_atom, with_terms
from brickpilot.discover.term_basis import EFFECT, OF_A_MOTOR, Basis, Term, basis
from brickpilot.discover.verdict import Verdict, weigh
from brickpilot.fit.replay import Replay
from brickpilot.fit.residual import Problem, Projection, Residual
from brickpilot.vehicle.model import Model

Tell = Callable[[str], None]
Array = NDArray[np.float64]

_OUTPUTS = ("wheel_angle_left", "wheel_angle_right", "angle", "x", "position")
_TINY = 1e-8  # of a coefficient's range: large enough for the arithmetic, small enough to be linear
_SIMULATED = 24  # atoms that are simulated at the sizes that suit them
_SIZES = (1.0, 0.3)  # of the linear estimate, at which they are: few terms are linear
_NEARBY = 8  # atoms at and beside a fitted period that are fitted
_ALIKE = 2  # trials of the same terms with different settings, at most
_STRIP_TERMS = ("surge_loss_patch", "yaw_loss_patch", "floor_add_patch")
_MOST_TERMS = 3  # the basis is large, and a law that a reader can check is short


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
    nothing_needed = any(one.explanation.key == verdict.nominal.key for one in verdict.held)
    bases = {one.key: one for one in (verdict.nominal, verdict.nominal if nothing_needed else verdict.best)}
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


class TermSource:
    """See `search.Source`. Holds the signature of each atom at the model that the search begins with."""

    word, most, pairs = "term", _MOST_TERMS, False

    def __init__(self, data: Residual, base: Explanation) -> None:
        self._data, self._base = data, base.model
        self._residual = data.scaled(self._base)
        self._segments = segments(data, self._base)
        self._changes: dict[Atom, Array] = {}
        projection = Projection(Problem(data, base.plan), base.point)
        rest = projection.remainder(self._residual)
        self._add(find_atoms(self._base.vehicle, self._segments, rest[: len(self._residual)]))
        self._add_strips(projection, rest)

    def screened(self, problem: Problem, point: Array, without: Collection[str], deadline: Deadline) -> list[Trial]:
        """Returns every atom that could gain something, with a diverse choice of settings."""
        return self._best(problem, point, [one for one in self._changes if one.name not in without])

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        """Returns what is worth a fit at the period that the best fit ended at, and at the periods beside it."""
        best = min(fits, key=lambda one: one.cost, default=None)
        if best is None or not isinstance(last := best.parts[-1], Atom) or not last.tuned:
            return []
        near = family(last, best.model.effects[EFFECT], self._base.vehicle, self._segments)
        self._add(near)
        return self._best(problem, current.point, near)[:_NEARBY]

    def _best(self, problem: Problem, point: Array, atoms: Sequence[Atom]) -> list[Trial]:
        """Returns the atoms that could leave least beside the model of `problem` at `point`, the best first.

        All are compared by their signatures at the base model. The best of them are then simulated beside that model.
        """
        model, projection = problem.plan.at(point), Projection(problem, point)
        table, linear = model.effects.get(EFFECT, {}), []
        rest = projection.remainder(problem.data.scaled(model))
        for one in atoms:
            if one.joins(table):
                signatures = projection.signatures(self._changes[one].T)
                sizes = _best_coefficients(one, signatures, rest, table)
                left = rest - signatures @ sizes
                if np.any(sizes):
                    linear.append((float(left @ left) / 2, one, sizes))
        best = sorted(linear, key=lambda found: found[0])[:_SIMULATED]
        sized = [
            (one, {**dict(one.settings), **dict(zip(one.names, (share * sizes).tolist(), strict=True))})
            for _, one, sizes in best
            for share in _SIZES
        ]
        simulated = problem.data.scaled_by([with_terms(model, values) for _, values in sized])
        with np.errstate(over="ignore", invalid="ignore"):  # a size at which the plant runs away is left out below
            trials = [
                Trial.of(one, values, rest, projection.remainder(residual), len(residual))
                for (one, values), residual in zip(sized, simulated, strict=True)
            ]
        return _diverse(sorted((one for one in trials if np.isfinite(one.left)), key=lambda one: one.left))

    def _add(self, atoms: Sequence[Atom]) -> None:
        """Simulates each term that is new."""
        new = [one for one in atoms if one not in self._changes and one.joins(self._base.effects.get(EFFECT, {}))]
        pairs = [(one, term) for one in dict.fromkeys(new) for term in one.terms]
        changes = self._changes_by(pairs)
        for one in dict.fromkeys(new):
            self._changes[one] = changes[:, [k for k, (other, _) in enumerate(pairs) if other is one]]

    def _add_strips(self, projection: Projection, rest: Array) -> None:
        """Adds terms on a strip across x, on those strips that a loss in narrow cells points at."""
        cells = periods.cells(self._segments)
        for name in _STRIP_TERMS if cells else ():
            narrow = [strip_atom(name, *cell) for cell in cells]
            if self._base.vehicle == "motor" and narrow[0].place not in OF_A_MOTOR:
                continue
            signatures = projection.signatures(self._changes_by([(one, one.terms[0]) for one in narrow]).T)
            for first, last in periods.best_windows(signatures, rest):
                middle, half_width = (cells[first][0] + cells[last][0]) / 2, cells[first][1] * (last - first + 1)
                strip = strip_atom(name, middle, half_width)
                self._add(family(strip, dict(strip.settings), self._base.vehicle, self._segments))

    def _changes_by(self, terms: Sequence[tuple[Atom, Basis]]) -> Array:
        """Returns (samples, terms): change of the simulated signals, in scales, per unit of each coefficient."""
        sizes = [_TINY * term.info.maximum for _, term in terms]
        tiny = [
            with_terms(self._base, {**dict(one.settings), term.name: size})
            for (one, term), size in zip(terms, sizes, strict=True)
        ]
        moved = self._data.scaled_by(tiny)
        changes = np.array([(self._residual - one) / size for one, size in zip(moved, sizes, strict=True)])
        changes = changes.reshape(len(terms), len(self._residual))
        changes[~np.isfinite(changes).all(axis=1)] = 0.0
        return changes.T


def _best_coefficients(one: Atom, signatures: Array, rest: Array, table: Mapping[str, float]) -> Array:
    """Returns the coefficients within their ranges that remove most; 0 where an atom does nothing."""
    strength = np.linalg.norm(signatures, axis=0)
    if not np.all(strength > 0):
        return np.zeros(len(one.terms))
    found = np.linalg.lstsq(signatures / strength, rest, rcond=1e-6)[0] / strength
    low = [_lowest(term, table) for term in one.terms]
    return np.asarray(np.clip(found, low, [term.info.maximum for term in one.terms]))


def _lowest(term: Basis, table: Mapping[str, float]) -> float:
    """Returns the lowest coefficient: 0 for dry friction, unless it reduces other dry friction."""
    one_sign = term.kind == "dry" and not any(
        name.startswith(f"{term.place}_dry") and v > 0 for name, v in table.items()
    )
    return 0.0 if one_sign and not term.name.endswith("_angle") and not term.sided else term.info.minimum


def _diverse(trials: Sequence[Trial]) -> list[Trial]:
    """Returns each atom at its better size, and no more than `_ALIKE` of the same terms with different settings."""
    found: dict[Part, Trial] = {}
    for trial in trials:
        if sum(one.free == trial.part.free for one in found) < _ALIKE:
            found.setdefault(trial.part, trial)
    return list(found.values())


def segments(data: Residual, model: Model) -> list[Segment]:
    """Returns the blocks of a residual with the outputs of `model`, that terms may depend on, at their times."""
    outputs = data.replay.simulate([model], threads=data.threads)[0]
    grids = {run.name: run.time for run in data.replay.dataset.runs}
    ages = _ages(data.replay)
    return [
        Segment(
            block.run,
            block.signal,
            block.place,
            block.middle - grids[block.run][0],
            ages[block.run],
            {
                name: np.interp(block.middle, grids[block.run], outputs[block.run][name])
                for name in _OUTPUTS
                if name in outputs[block.run]
            },
        )
        for block in data.blocks
    ]


def _ages(replay: Replay) -> dict[str, float]:
    """Returns run -> s from power-on to its start."""
    ages, age = dict[str, float](), 0.0
    for run in replay.dataset.runs:
        age += run.gap_s
        ages[run.name] = age
        age += float(run.time[-1] - run.time[0])
    return ages
