"""Which composed terms are worth a fit: one simulation a term.

An atom is one term, or the sine and cosine of one period together. Its signature is what a small size of it does to the
residual, with what the nominal parameters can take up projected out. Periods come from the spectra of the
residual, so that no term is tried at a period that is not there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.segment import Segment
from brickpilot.discover.terms import periods
from brickpilot.discover.terms.basis import EFFECT, Basis, basis
from brickpilot.errors import SimulationError
from brickpilot.fit.parameters import Free
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_TINY = 1e-8  # of a coefficient's range: large enough for the arithmetic, small enough to be linear
_SWINGS = (1.0, 2.0, 4.0)  # Hz, tried for a sprung mass beside the spectrum's peaks
_CHUNK = 24  # models simulated at once: what their outputs take of memory
_FARTHEST = 2.0  # in coordinates: how far a linear look moves a nominal parameter at most
_NEIGHBOURS = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # times a spectrum's resolution
_ANCHOR_SD = 30.0  # in coordinates, of a parameter without a prior

_STRIP = ("patch_x", "patch_half_width")
_LOGGED = {"gyro": {"yaw_rate", "yaw_angle"}, "accel_surge": {"accel_surge"}, "accel_sway": {"accel_sway"}}


class Problem(Protocol):
    """The data as a composed term sees them: N whitened residuals, all fitted runs stacked."""

    @property
    def base(self) -> Model:
        """The model that leaves the structure: re-calibrated, with the effects that were named."""

    @property
    def free(self) -> Sequence[Free]:
        """The parameters of `base` that are fitted along, with their priors."""

    @property
    def sensitivities(self) -> Array:
        """(N, parameters): change of what is simulated, whitened, per coordinate of `free`, at `base`."""

    @property
    def segments(self) -> Sequence[Segment]:
        """What the N rows are: all of them, in any order."""

    def residual(self, models: Sequence[Model]) -> Array:
        """(models, N): measured less simulated, over the scale it is judged by; without priors."""


@dataclass(frozen=True)
class Atom:
    """Terms that are chosen together, and the settings that shape them."""

    terms: tuple[Basis, ...]
    settings: tuple[tuple[str, float], ...] = ()

    @property
    def place(self) -> str:
        return self.terms[0].place

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(term.name for term in self.terms)

    @property
    def tuned(self) -> tuple[str, ...]:
        """The settings that are fitted: all but the clock, which is one or the other."""
        return tuple(name for name, _ in self.settings if name != "clock")

    def agrees(self, settings: Mapping[str, float]) -> bool:
        return all(settings.get(name, value) == value for name, value in self.settings)


@dataclass(frozen=True)
class Trial:
    """An atom at the size that fits best.

    Attributes:
        cost: half the squared residual that it would leave, were the nominal parameters linear.
        shift: (parameters,) by which these would move, in coordinates.
    """

    atom: Atom
    coefficients: tuple[float, ...]
    cost: float
    shift: Array = field(default_factory=lambda: np.empty(0), compare=False)


def with_terms(model: Model, values: Mapping[str, float]) -> Model:
    """`model` with coefficients and settings of composed terms put beside those that it has."""
    table = {**model.effects.get(EFFECT, {}), **values}
    return dataclasses.replace(model, effects={**model.effects, EFFECT: table})


def residuals(problem: Problem, models: Sequence[Model]) -> Array:
    """(models, N): `problem.residual` in chunks; NaN where the plant diverges."""
    count = len(problem.sensitivities)
    found = np.empty((len(models), count))
    for first in range(0, len(models), _CHUNK):
        chunk = models[first : first + _CHUNK]
        try:
            found[first : first + len(chunk)] = problem.residual(chunk)
        except SimulationError:
            for k, model in enumerate(chunk):
                try:
                    found[first + k] = problem.residual([model])[0]
                except SimulationError:
                    found[first + k] = np.nan
    return found


def prior(free: Sequence[Free], point: Array, start: Array) -> Array:
    """(parameters,): how far each parameter is from what is known of it, in sds; a loose anchor where nothing is."""
    return np.array(
        [
            (one.to_value(float(x)) - one.known.value) / one.known.sd
            if one.known is not None and one.known.sd
            else (float(x) - float(x0)) / _ANCHOR_SD
            for one, x, x0 in zip(free, point, start, strict=True)
        ]
    )


class Projection:
    """Takes out of a residual what the nominal parameters can take up, as far as their priors let them."""

    def __init__(self, problem: Problem, point: Array) -> None:
        slopes = np.diag((prior(problem.free, point + 1e-4, point) - prior(problem.free, point - 1e-4, point)) / 2e-4)
        self._span, self._triangle = np.linalg.qr(np.vstack([-problem.sensitivities, slopes]))
        self._prior = prior(problem.free, point, point)

    def of_residual(self, residual: Array) -> Array:
        """(N + parameters,): of (N,)."""
        return self._without(np.concatenate([residual, self._prior]))

    def shift(self, residual: Array) -> Array:
        """(parameters,): the step of the nominal coordinates that takes up what they can of (N,)."""
        taken = self._span.T @ np.concatenate([residual, self._prior])
        step = -np.linalg.lstsq(self._triangle, taken, rcond=None)[0]
        return np.asarray(np.clip(step, -_FARTHEST, _FARTHEST))

    def of_slopes(self, slopes: Array) -> Array:
        """Of (N, columns): slopes of the residual, which priors do not feel."""
        return self._without(np.vstack([slopes, np.zeros((self._span.shape[1], slopes.shape[1]))]))

    def _without(self, values: Array) -> Array:
        return np.asarray(values - self._span @ (self._span.T @ values))


class Screen:
    """Signatures of atoms at the base model, computed once, and how well each atom could do beside what is chosen."""

    def __init__(self, problem: Problem, point: Array) -> None:
        self._problem = problem
        self._projection = Projection(problem, point)
        self._base = residuals(problem, [problem.base])[0]
        self._slopes: dict[Atom, Array] = {}
        left = self._projection.of_residual(self._base)
        self.add(find_atoms(problem, left[: len(self._base)]))
        self._add_strips(left)

    @property
    def atoms(self) -> tuple[Atom, ...]:
        return tuple(self._slopes)

    def _add_strips(self, left: Array) -> None:
        """Adds what acts on a strip across x, on the strips that a loss in narrow cells points at."""
        cells = periods.cells(self._problem.segments)
        for name in ("surge_loss_patch", "yaw_loss_patch") if cells else ():
            term = next(one for one in basis() if one.name == name)
            if self._problem.base.vehicle == "motor" and term.place == "yaw":
                continue
            slopes = self._signatures([(Atom((term,), _strip(*cell)), term) for cell in cells])
            for first, last in periods.best_windows(slopes, left):
                strip = _strip((cells[first][0] + cells[last][0]) / 2, cells[first][1] * (last - first + 1))
                self.add(self.family(Atom((term,), strip), dict(strip)))

    def add(self, atoms: Sequence[Atom]) -> None:
        """One simulation for each term that is new."""
        new = [(atom, term) for atom in atoms if atom not in self._slopes for term in atom.terms]
        slopes = self._signatures(new)
        for atom in dict.fromkeys(atom for atom, _ in new):
            self._slopes[atom] = slopes[:, [k for k, (other, _) in enumerate(new) if other is atom]]

    def _signatures(self, terms: Sequence[tuple[Atom, Basis]]) -> Array:
        """(N + parameters, terms): change of the projected residual per unit of each coefficient."""
        base = self._problem.base
        tiny = [with_terms(base, {**dict(a.settings), t.name: _beside(base, t)}) for a, t in terms]
        sizes = np.array([_TINY * term.info.maximum for _, term in terms])
        moved = (residuals(self._problem, tiny) - self._base) / sizes[:, np.newaxis]
        moved[~np.isfinite(moved).all(axis=1)] = 0.0
        return self._projection.of_slopes(moved.T)

    def family(self, atom: Atom, settings: Mapping[str, float]) -> list[Atom]:
        """All atoms that the same settings shape, with these values of them."""
        kept = tuple((name, settings[name]) for name, _ in atom.settings)
        vehicle, signals = self._problem.base.vehicle, {one.signal for one in self._problem.segments}
        found = [
            Atom(terms, kept)
            for terms in _pairs()
            if terms[0].tuned == atom.terms[0].tuned and _shows(terms[0], vehicle, signals)
        ]
        return found + [Atom(atom.terms, near) for near in self._neighbours(dict(kept))]

    def _neighbours(self, settings: dict[str, float]) -> list[tuple[tuple[str, float], ...]]:
        """The same with a period a little longer or shorter: a fit finds the best phase, not the next one."""
        segments = self._problem.segments
        if "wavelength" in settings:
            step = periods.position_resolution(segments)
            found = [1 / settings["wavelength"] + k * step for k in _NEIGHBOURS]
            return [tuple((settings | {"wavelength": 1 / f}).items()) for f in found if f > 0]
        if "order" in settings:
            step = periods.angle_resolution(segments)
            found = [settings["order"] + k * step for k in _NEIGHBOURS]
            return [tuple((settings | {"order": order}).items()) for order in found if order > 0]
        if "frequency" in settings and "damping" not in settings:
            step = periods.time_resolution(segments, settings["clock"])
            found = [settings["frequency"] + k * step for k in _NEIGHBOURS]
            return [tuple((settings | {"frequency": frequency}).items()) for frequency in found if frequency > 0]
        return []

    def best(self, model: Model, atoms: Sequence[Atom], followed: int) -> list[Trial]:
        """The atoms that could leave least beside what `model` has, best first.

        A first look at all of them takes the signatures of the base model; the best `followed` are simulated beside
        the terms that `model` has, at the sizes that suit them.
        """
        left = self._projection.of_residual(residuals(self._problem, [model])[0])
        linear = []
        for atom in atoms:
            slopes = self._slopes[atom]
            coefficients = _suited(atom, slopes, left, model)
            after = left + slopes @ coefficients
            linear.append(Trial(atom, tuple(coefficients), float(after @ after) / 2))
        best = sorted((one for one in linear if any(one.coefficients)), key=lambda one: one.cost)[:followed]
        return _at_size(self._problem, model, self._projection, best)


def _beside(model: Model, term: Basis) -> float:
    return model.effects.get(EFFECT, {}).get(term.name, 0.0) + _TINY * term.info.maximum


def _suited(atom: Atom, slopes: Array, left: Array, model: Model) -> Array:
    """Coefficients that take most away, within their ranges; 0 where that is nothing."""
    strength = np.linalg.norm(slopes, axis=0)
    if not np.all(strength > 0):
        return np.zeros(len(atom.terms))
    found = np.linalg.lstsq(slopes / strength, -left, rcond=1e-6)[0] / strength
    chosen = model.effects.get(EFFECT, {})
    low = [_least(term, chosen) for term in atom.terms]
    return np.asarray(np.clip(found, low, [term.info.maximum for term in atom.terms]))


def _least(term: Basis, chosen: Mapping[str, float]) -> float:
    """Dry friction below 0 is none, unless it takes away from other dry friction."""
    one_sign = term.kind == "dry" and not any(
        name.startswith(f"{term.place}_dry") and v > 0 for name, v in chosen.items()
    )
    return 0.0 if one_sign and not term.name.endswith("_angle") and not term.sided else term.info.minimum


def _at_size(problem: Problem, model: Model, projection: Projection, trials: Sequence[Trial]) -> list[Trial]:
    """The trials simulated at their sizes and at a third of them: few terms are linear."""
    sized = [
        dataclasses.replace(t, coefficients=tuple(s * c for c in t.coefficients)) for t in trials for s in (1.0, 0.3)
    ]
    simulated = residuals(problem, [with_terms(model, values_of(one, model)) for one in sized])
    tried = []
    for one, left in zip(sized, simulated, strict=True):
        if np.all(np.isfinite(left)):
            after = projection.of_residual(left)
            tried.append(dataclasses.replace(one, cost=float(after @ after) / 2, shift=projection.shift(left)))
    best: dict[Atom, Trial] = {}
    for one in sorted(tried, key=lambda one: one.cost):
        best.setdefault(one.atom, one)
    return list(best.values())


def values_of(trial: Trial, model: Model) -> dict[str, float]:
    """What the effect's table holds with the trial beside the terms that `model` has."""
    chosen = model.effects.get(EFFECT, {})
    sums = {t.name: chosen.get(t.name, 0.0) + c for t, c in zip(trial.atom.terms, trial.coefficients, strict=True)}
    return {**dict(trial.atom.settings), **sums}


def _strip(middle: float, half_width: float) -> tuple[tuple[str, float], ...]:
    return tuple(zip(_STRIP, (middle, half_width), strict=True))


def find_atoms(problem: Problem, left: Array) -> list[Atom]:
    """Every term, and what is periodic at the periods that `left` (N,), a projected residual, shows."""
    several_ages = len({segment.age for segment in problem.segments}) > 1
    clocks = (0.0, 1.0) if several_ages else (0.0,)
    frequencies = {clock: periods.frequencies(problem.segments, left, clock) for clock in clocks}
    swings = sorted({*_SWINGS, *(round(f, 6) for f in frequencies[0.0])})
    orders = periods.angle_orders(problem.segments, left)
    settings: dict[tuple[str, ...], list[tuple[tuple[str, float], ...]]] = {
        (): [()],
        ("clock",): [(("clock", clock),) for clock in clocks],
        ("frequency", "clock"): [(("frequency", f), ("clock", c)) for c in clocks for f in frequencies[c]],
        ("frequency", "damping"): [(("frequency", f), ("damping", 0.1)) for f in swings],
        ("order",): [(("order", k),) for k in orders],
        ("wavelength",): [(("wavelength", length),) for length in periods.wavelengths(problem.segments, left)],
        _STRIP: [],  # Screen looks for them
    }
    signals = {segment.signal for segment in problem.segments}
    found = []
    for terms in _pairs():
        if _shows(terms[0], problem.base.vehicle, signals):
            found += [Atom(terms, one) for one in settings[terms[0].tuned]]
    return found


def _shows(term: Basis, vehicle: str, signals: set[str]) -> bool:
    """Whether this vehicle has the term's place and its sensor, if it is one, was logged."""
    if vehicle == "motor":
        return term.place in ("drive", "wheel", "surge") and not term.sided
    return bool(_LOGGED.get(term.place, signals) & signals)


def _pairs() -> list[tuple[Basis, ...]]:
    """Every term; sine and cosine of one thing together. Of the heading each stands alone as well as any."""
    by_name = {term.name: term for term in basis()}
    found: list[tuple[Basis, ...]] = []
    for name, term in by_name.items():
        periodic = bool({"frequency", "order", "wavelength"} & set(term.tuned)) and "sprung" not in name
        if periodic and "cos_" in name:
            continue
        found.append((term, by_name[name.replace("sin_", "cos_")]) if periodic else (term,))
    return found
