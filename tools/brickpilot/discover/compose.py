"""Composes a law as a sum of few terms of a fixed basis, where no effect of the library explains the residual.

Terms are searched and weighed like effects, by a sparse regression: forward selection with refits (FROLS: Chen,
Billings & Luo 1989). The regression works on signatures (how a term changes the simulated signals), not on derivatives
of measured signals. An atom is a term with the settings that shape it. A periodic term is tried only at periods near
the peaks in the spectra of the residual along time, a wheel's angle and the position.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import ParameterInfo
from brickpilot.data.axes import Segment, Settings, axes
from brickpilot.discover import numbers
from brickpilot.discover.deadline import COMPOSED, Deadline
from brickpilot.discover.evidence import Judge
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.parts import Part
from brickpilot.discover.prepare import Prepared
from brickpilot.discover.screen import Trial
from brickpilot.discover.search import Found, Search, Tell, Width
from brickpilot.discover.verdict import Verdict, weigh
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.problem import Problem, Projection
from brickpilot.fit.residual import Residual
from brickpilot.vehicle.composed_terms import (
    EFFECT,
    OF_A_MOTOR,
    Basis,
    Term,
    basis,
    parameters,
    settings_of,
    terms_of,
)
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_OUTPUTS = ("wheel_angle_left", "wheel_angle_right", "angle", "x", "position")
_TINY = 1e-8  # small step of a coefficient, as a share of its maximum: far above rounding errors, yet still linear
_SIMULATED = 24  # largest number of atoms that are also simulated: those whose signatures explain the residual best
_SIZES = (1.0, 0.3)  # an atom is simulated at these shares of its linear estimate: few terms are linear
_NEARBY = 8  # largest number of atoms that are fitted at a fitted period and at the periods next to it
_ALIKE = 2  # largest number of trials of the same terms with different settings
_STRIP_TERMS = ("surge_loss_patch", "yaw_loss_patch", "floor_add_patch")
_CELLS, _LEAST_CELL = 24, 4e-3  # cells into which the travel is cut to search for strips; least width of a cell, m
_STRIPS = 2  # largest number of strips that are tried for one term
_MOST_TERMS = 3  # largest number of terms of a law: the basis is large, and a reader can check only a short law
_SLOWEST_SWING_HZ = 0.5  # frequency of a pendulum of one metre: no robot here carries a longer pendulum
_SPRUNG_HZ = (1.0, 2.0, 4.0)  # frequencies tried for a sprung mass, in addition to the peaks of the spectrum
_SENSOR_SIGNALS = {
    "encoder": {
        f"wheel_{kind}_{side}" for kind in ("speed", "angle", "travel", "velocity") for side in ("left", "right")
    },
    "gyro": {"yaw_rate", "yaw_angle"},
    "accel_surge": {"accel_surge"},
    "accel_sway": {"accel_sway"},
}


@dataclass(frozen=True)
class Atom(Part):
    """One term, or the sine and the cosine of one period, with the settings that shape them.

    Attributes:
        slowest: the least frequency, Hz. A slower term would repeat less than once in a run, or swing more slowly than
            any load; it could imitate any drift or loss.
    """

    terms: tuple[Basis, ...]
    settings: Settings
    slowest: float

    @property
    def name(self) -> str:
        return " and ".join(self.names)

    @property
    def log_odds(self) -> float:
        """The log of the prior odds: `numbers.RARE` for each term and for each fitted setting."""
        return math.log(numbers.RARE) * (len(self.terms) + len(self.tuned))

    @property
    def mechanism(self) -> str:
        return self.terms[0].mechanism

    @property
    def place(self) -> str:
        return self.terms[0].place

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(term.name for term in self.terms)

    @property
    def tuned(self) -> tuple[str, ...]:
        """The settings that are fitted: all except the clock, which is chosen."""
        return tuple(name for name, _ in self.settings if name != "clock")

    def joins(self, table: Mapping[str, float]) -> bool:
        """Returns whether the atom can join `table`: its terms are not in `table`, and settings in both are equal."""
        there = [term.basis for term in terms_of(table)]
        shaping = settings_of(there, table)
        lacks = not {term.name for term in there} & {*self.names}
        return lacks and all(shaping.get(name, value) == value for name, value in self.settings)

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        """Returns `base` with this atom at `values`. Free parameters that `base` lacks come last."""
        present, table = {one.name for one in base.free}, {**dict(self.settings), **values}
        rows = [self._row(info, table) for info in parameters() if info.name in self.free]
        added = tuple(one for one in rows if one.name not in present)
        return base.joined(with_terms(base.model, table), added)

    def removed_from(self, model: Model) -> Model:
        table = {name: value for name, value in model.effects[EFFECT].items() if name not in self.names}
        left = [term for term in basis() if term.name in table]
        if not left:
            return super().removed_from(model)
        table = {term.name: table[term.name] for term in left} | settings_of(left, table)
        return dataclasses.replace(model, effects={**model.effects, EFFECT: table})

    def owns(self, free: Free) -> bool:
        return free.effect is not None and free.effect[0] == EFFECT and free.effect[1] in self.free

    def values_in(self, model: Model) -> Mapping[str, float]:
        return {name: model.effects[EFFECT][name] for name in (*self.names, *(one for one, _ in self.settings))}

    def _row(self, info: ParameterInfo, values: Mapping[str, float]) -> Free:
        """Returns a free parameter. Unit of a coefficient: its start amplitude; of a strip's middle: the half width."""
        name = f"{EFFECT}.{info.name}"
        if info.name in self.names:
            if len(self.names) == 1:
                return Free(name, info, None, values[info.name], keeps_sign=True)
            return Free(name, info, None, math.hypot(*(values[one] for one in self.names)))
        if info.name == "frequency":
            info = dataclasses.replace(info, minimum=max(info.minimum, self.slowest))
        return Free(name, info, None, values["patch_half_width"] if info.name == "patch_x" else 0.0)


def atom(terms: tuple[Basis, ...], settings: Settings = (), slowest: float = 0.0) -> Atom:
    free = (*(term.name for term in terms), *(name for name, _ in settings if name != "clock"))
    return Atom(EFFECT, free, {}, terms, settings, slowest)


def with_terms(model: Model, values: Mapping[str, float]) -> Model:
    """Returns `model` with `values` added: coefficients and settings of composed terms."""
    table = {**model.effects.get(EFFECT, {}), **values}
    return dataclasses.replace(model, effects={**model.effects, EFFECT: table})


def find_atoms(vehicle: str, segments: Sequence[Segment], residual: Array) -> list[Atom]:
    """Returns the atoms to try. Periodic terms get the periods of peaks in the spectra of `residual` (N,).

    Terms on a strip of the floor are left out: `TermSource` adds them.
    """
    time, *others = axes(segments)
    clocks = [time, *(one for one in others if one.clock)]
    # Names of settings -> the settings that are tried, each with its least frequency in a fit.
    tried: dict[tuple[str, ...], list[tuple[Settings, float]]] = {
        (): [((), 0.0)],
        ("clock",): [(one.clock, 0.0) for one in clocks],
    }
    for axis in (time, *others):
        tried.setdefault(axis.names, []).extend((axis.at(one), axis.least) for one in axis.peaks(residual))
    sprung = {*_SPRUNG_HZ, *(round(one, 6) for one in time.peaks(residual) if one > _SLOWEST_SWING_HZ)}
    slowest = max(_SLOWEST_SWING_HZ, time.least)
    tried["frequency", "damping"] = [((("frequency", one), ("damping", 0.1)), slowest) for one in sorted(sprung)]
    groups = _visible_groups(vehicle, segments)
    return [atom(terms, one, least) for terms in groups for one, least in tried.get(terms[0].tuned, ())]


def family(near: Atom, settings: Mapping[str, float], vehicle: str, segments: Sequence[Segment]) -> list[Atom]:
    """Returns atoms of all terms at the fitted `settings` of `near`, and of the terms of `near` at periods nearby."""
    kept = tuple((name, settings[name]) for name, _ in near.settings)
    groups = _visible_groups(vehicle, segments)
    found = [atom(terms, kept, near.slowest) for terms in groups if terms[0].tuned == near.terms[0].tuned]
    for axis in axes(segments):
        if axis.names == near.terms[0].tuned and {*axis.clock} <= {*kept}:
            found += [atom(near.terms, other, near.slowest) for other in axis.beside(kept)]
    return found


def strip_atom(name: str, middle: float, half_width: float) -> Atom:
    """Returns the atom of a term that acts only on a strip of the floor: `middle` and `half_width` along x, m."""
    term = next(one for one in basis() if one.name == name)
    return atom((term,), (("patch_x", middle), ("patch_half_width", half_width)))


def _visible_groups(vehicle: str, segments: Sequence[Segment]) -> list[tuple[Basis, ...]]:
    """Returns the groups of terms that act on this vehicle; terms of a sensor only if the sensor was logged."""
    if vehicle == "motor":
        return [terms for terms in _groups() if terms[0].place in OF_A_MOTOR and not terms[0].sided]
    signals = {segment.signal for segment in segments}
    return [terms for terms in _groups() if _SENSOR_SIGNALS.get(terms[0].place, signals) & signals]


def _groups() -> list[tuple[Basis, ...]]:
    """Returns every term alone, except the sine and the cosine of one period, which form one group.

    Sine and cosine of the heading stand alone: their phase is known. Rotation sensors also get a group of two terms:
    one for equal errors on both sides, one for opposite errors. A fault of one sensor is the sum of both terms.
    """
    by_name = {term.name: term for term in basis()}
    found: list[tuple[Basis, ...]] = []
    for name, term in by_name.items():
        periodic = bool({"frequency", "order", "wavelength"} & set(term.tuned)) and "sprung" not in name
        if periodic and "cos_" in name:
            continue
        found.append((term, by_name[name.replace("sin_", "cos_")]) if periodic else (term,))
        if term.place == "encoder" and term.sided and not periodic:
            found.append((by_name[name.replace("_diff_", "_")], term))
    return found


@dataclass(frozen=True, eq=False)
class Composed:
    """A composed law.

    Attributes:
        explanation: the base model fitted together with the terms.
        terms: the terms with their coefficients, SI, in the order of `basis`.
        settings: parameters that shape the terms, such as a frequency.
    """

    explanation: Explanation
    terms: tuple[Term, ...]
    settings: Mapping[str, float]

    @classmethod
    def of(cls, found: Explanation) -> Composed:
        """Returns the law of the terms that an explanation holds, with the values of its fit."""
        table = found.model.effects[EFFECT]
        atoms = [one for one in found.parts if isinstance(one, Atom)]
        names = {name for one in atoms for name in one.names}
        settings = {name: table[name] for one in atoms for name, _ in one.settings}
        return cls(found, tuple(Term(one, table[one.name]) for one in basis() if one.name in names), settings)

    @property
    def mechanism(self) -> str:
        return self.terms[0].basis.mechanism


def compose(prepared: Prepared, judge: Judge, verdict: Verdict, tell: Tell) -> Composed | None:
    """Returns the law of few terms that explains the fit runs best, with or without the best named effects.

    None if the evidence on the terms gives the verdict `none`: see `weigh`.
    """
    deadline = prepared.deadline.until(COMPOSED)
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
    _, best = max(sure, key=lambda pair: pair[0].table[pair[1].best.key].log_weight(pair[0].temperature))
    return Composed.of(best.best)


class TermSource:
    """The atoms, as a `search.Source`. All signatures are computed once, at the model where the search begins."""

    word, most, width = "term", _MOST_TERMS, Width(paired=0, swapped=0)

    def __init__(self, data: Residual, base: Explanation) -> None:
        self._data, self._base = data, base.model
        self._residual = data.scaled(self._base)
        self._segments = segments(data, self._base)
        self._changes: dict[Atom, Array] = {}
        projection = Projection(Problem(data, base.plan), base.point)
        rest = projection.remainder(self._residual)
        self._add(find_atoms(self._base.vehicle, self._segments, rest[: len(self._residual)]))
        self._add_strips(projection, rest)

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns trials of the atoms that reduce the residual most; at most `_ALIKE` trials have the same terms."""
        return self._best(problem, point, list(self._changes))

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        """Returns trials that are worth a fit, at the period of the best of `fits` and at the periods next to it."""
        best = min(fits, key=lambda one: one.cost, default=None)
        if best is None or not isinstance(last := best.parts[-1], Atom) or not last.tuned:
            return []
        near = family(last, best.model.effects[EFFECT], self._base.vehicle, self._segments)
        self._add(near)
        return self._best(problem, current.point, near)[:_NEARBY]

    def _best(self, problem: Problem, point: Array, atoms: Sequence[Atom]) -> list[Trial]:
        """Returns trials of the atoms that could reduce the residual of `problem` at `point` most, the best first.

        All atoms are compared by their signatures at the base model. The best atoms are then simulated at `point`.
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
        with np.errstate(over="ignore", invalid="ignore"):  # the line below drops sizes at which the plant diverges
            trials = [
                Trial.of(one, values, rest, projection.remainder(residual), len(residual))
                for (one, values), residual in zip(sized, simulated, strict=True)
            ]
        return _diverse(sorted((one for one in trials if np.isfinite(one.left)), key=lambda one: one.left))

    def _add(self, atoms: Sequence[Atom]) -> None:
        """Computes the signatures of those `atoms` that have none yet."""
        table = self._base.effects.get(EFFECT, {})
        self._changes |= self._changes_by([one for one in atoms if one not in self._changes and one.joins(table)])

    def _add_strips(self, projection: Projection, rest: Array) -> None:
        """Adds terms that act only on a strip of the floor, for the strips that explain most of the residual."""
        narrow = _cells(self._segments)
        for name in _STRIP_TERMS if narrow else ():
            alone = [strip_atom(name, *cell) for cell in narrow]
            if self._base.vehicle == "motor" and alone[0].place not in OF_A_MOTOR:
                continue
            changes = self._changes_by(alone)
            signatures = projection.signatures([changes[one][:, 0] for one in alone])
            for first, last in _best_windows(signatures, rest):
                middle, half_width = (narrow[first][0] + narrow[last][0]) / 2, narrow[first][1] * (last - first + 1)
                strip = strip_atom(name, middle, half_width)
                self._add(family(strip, dict(strip.settings), self._base.vehicle, self._segments))

    def _changes_by(self, atoms: Sequence[Atom]) -> dict[Atom, Array]:
        """Returns atom -> (samples, terms): the change of the residual, in scales, for a coefficient of 1."""
        own = [(one, term, _TINY * term.info.maximum) for one in dict.fromkeys(atoms) for term in one.terms]
        tiny = [with_terms(self._base, {**dict(one.settings), term.name: size}) for one, term, size in own]
        changes: dict[Atom, list[Array]] = {}
        for (one, _, size), moved in zip(own, self._data.scaled_by(tiny), strict=True):
            change = (self._residual - moved) / size
            changes.setdefault(one, []).append(change if np.isfinite(change).all() else np.zeros_like(change))
        return {one: np.column_stack(columns) for one, columns in changes.items()}


def _best_coefficients(candidate: Atom, signatures: Array, rest: Array, table: Mapping[str, float]) -> Array:
    """Returns the coefficients, within their ranges, that remove most of `rest`; all 0 if a term changes no signal."""
    strength = np.linalg.norm(signatures, axis=0)
    if not np.all(strength > 0):
        return np.zeros(len(candidate.terms))
    found = np.linalg.lstsq(signatures / strength, rest, rcond=1e-6)[0] / strength
    low = [_lowest(term, table) for term in candidate.terms]
    return np.asarray(np.clip(found, low, [term.info.maximum for term in candidate.terms]))


def _lowest(term: Basis, table: Mapping[str, float]) -> float:
    """Returns the least coefficient of a term: 0 for dry friction, if `table` has no dry friction to reduce."""
    one_sign = term.kind == "dry" and not any(
        name.startswith(f"{term.place}_dry") and v > 0 for name, v in table.items()
    )
    return 0.0 if one_sign and not term.name.endswith("_angle") and not term.sided else term.info.minimum


def _diverse(trials: Sequence[Trial]) -> list[Trial]:
    """Returns the best (first) trial of each atom, for at most `_ALIKE` atoms that differ only in settings."""
    found: dict[Part, Trial] = {}
    for trial in trials:
        if sum(one.free == trial.part.free for one in found) < _ALIKE:
            found.setdefault(trial.part, trial)
    return list(found.values())


def _cells(segments: Sequence[Segment]) -> list[tuple[float, float]]:
    """Returns middle and half width, m, of the cells into which the travel is cut; none if the vehicle hardly moves."""
    travels = [segment.at[name] for segment in segments for name in ("x", "position") if name in segment.at]
    if not travels:
        return []
    low, high = min(float(np.min(travel)) for travel in travels), max(float(np.max(travel)) for travel in travels)
    width = (high - low) / _CELLS
    return [(low + width * (k + 0.5), width / 2) for k in range(_CELLS)] if width > _LEAST_CELL else []


def _best_windows(slopes: Array, residual: Array) -> list[tuple[int, int]]:
    """Returns the first and last cell of the strips that explain most of `residual`; no strip overlaps a better one.

    Args:
        slopes: (N, cells): the change of `residual` (N,) by a term that acts on one cell alone.
    """
    own, along = slopes.T @ slopes, slopes.T @ residual
    gains = {
        (first, end - 1): float(along[first:end].sum()) ** 2 / max(float(own[first:end, first:end].sum()), 1e-300)
        for first, end in itertools.combinations(range(slopes.shape[1] + 1), 2)
    }
    found: list[tuple[int, int]] = []
    for window in sorted(gains, key=lambda one: -gains[one]):
        if gains[window] > 0 and all(window[1] < other[0] or window[0] > other[1] for other in found):
            found.append(window)
        if len(found) == _STRIPS:
            break
    return found


def segments(data: Residual, model: Model) -> list[Segment]:
    """Returns the blocks of a residual, each with those simulated outputs of `model` on which terms depend."""
    outputs = data.replay.simulate([model], threads=data.threads)[0]
    runs = {run.name: (run.time, age) for run, age in data.replay.aged}
    found = []
    for block in data.blocks:
        (time, age), simulated = runs[block.run], outputs[block.run]
        at = {name: np.interp(block.middle, time, simulated[name]) for name in _OUTPUTS if name in simulated}
        since = block.middle - time[0]
        found.append(Segment(block.run, block.signal, block.place, since, age, at))
    return found
