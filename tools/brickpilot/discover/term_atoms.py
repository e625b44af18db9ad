"""The atoms that a composed law is chosen from: terms with the settings that shape them.

Periods come from the spectra of the residual along time, a wheel's angle and the position, so that no term is tried at
a period that is not there.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import ParameterInfo
from brickpilot.data.axes import Segment, Settings, axes
from brickpilot.discover import numbers
from brickpilot.discover.parts import Part
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.composed_terms import EFFECT, OF_A_MOTOR, Basis, basis, parameters, settings_of, terms_of
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_SLOWEST_SWING_HZ = 0.5  # a pendulum of a metre swings so, and no robot here carries a longer one
_SPRUNG_HZ = (1.0, 2.0, 4.0)  # tried for a sprung mass, beside the peaks of the spectrum
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
        slowest: Hz, the least frequency. What repeats less than once in a run, or is slower than any load swings, is
            a drift or a loss: it would pass for any of them.
    """

    terms: tuple[Basis, ...]
    settings: Settings
    slowest: float

    @property
    def name(self) -> str:
        return " and ".join(self.names)

    @property
    def log_odds(self) -> float:
        """The log of the prior odds: each term is a statement, and so is each setting, picked from many."""
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
        """The settings that are fitted: all but the clock, which is one of two."""
        return tuple(name for name, _ in self.settings if name != "clock")

    def joins(self, table: Mapping[str, float]) -> bool:
        """Returns whether terms at the values of `table` lack it, and have no other settings."""
        there = [one.basis for one in terms_of(table)]
        shaping = settings_of(there, table)
        lacks = not {one.name for one in there} & {*self.names}
        return lacks and all(shaping.get(name, value) == value for name, value in self.settings)

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        """Returns `base` with this atom at `values`. Those of its parameters that are not free in `base` come last."""
        present, table = {one.name for one in base.free}, {**dict(self.settings), **values}
        rows = [self._row(info, table) for info in parameters() if info.name in self.free]
        added = tuple(one for one in rows if one.name not in present)
        return Plan(with_terms(base.model, table), (*base.free, *added), ())

    def removed_from(self, model: Model) -> Model:
        table = {name: value for name, value in model.effects[EFFECT].items() if name not in self.names}
        left = [one for one in basis() if one.name in table]
        if not left:
            return super().removed_from(model)
        table = {one.name: table[one.name] for one in left} | settings_of(left, table)
        return dataclasses.replace(model, effects={**model.effects, EFFECT: table})

    def owns(self, free: Free) -> bool:
        return free.effect is not None and free.effect[0] == EFFECT and free.effect[1] in self.free

    def values_in(self, model: Model) -> Mapping[str, float]:
        return {name: model.effects[EFFECT][name] for name in (*self.names, *(one for one, _ in self.settings))}

    def _row(self, info: ParameterInfo, values: Mapping[str, float]) -> Free:
        """Returns a free parameter. Sine and cosine move in units of their amplitude, a strip in half widths."""
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
    """Returns `model` with coefficients and settings of composed terms added to those that it has."""
    table = {**model.effects.get(EFFECT, {}), **values}
    return dataclasses.replace(model, effects={**model.effects, EFFECT: table})


def find_atoms(vehicle: str, segments: Sequence[Segment], residual: Array) -> list[Atom]:
    """Returns every term, the periodic ones at the periods that `residual` (N,), a projected one, shows.

    Terms on a strip of the floor are left out: see `compose.TermSource`.
    """
    time, *others = axes(segments)
    clocks = [time, *(one for one in others if one.clock)]
    # Names of settings -> settings that are tried, each with the least frequency.
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
    """Returns all atoms that the same settings shape, and this one at neighbouring settings."""
    kept = tuple((name, settings[name]) for name, _ in near.settings)
    groups = _visible_groups(vehicle, segments)
    found = [atom(terms, kept, near.slowest) for terms in groups if terms[0].tuned == near.terms[0].tuned]
    for axis in axes(segments):
        if axis.names == near.terms[0].tuned and {*axis.clock} <= {*kept}:
            found += [atom(near.terms, other, near.slowest) for other in axis.beside(kept)]
    return found


def strip_atom(name: str, middle: float, half_width: float) -> Atom:
    """Returns the atom of a term that acts on a strip across x, m."""
    term = next(one for one in basis() if one.name == name)
    return atom((term,), (("patch_x", middle), ("patch_half_width", half_width)))


def _visible_groups(vehicle: str, segments: Sequence[Segment]) -> list[tuple[Basis, ...]]:
    """Returns the groups of terms whose place the vehicle has and, for a sensor, whose signal was logged."""
    if vehicle == "motor":
        return [terms for terms in _groups() if terms[0].place in OF_A_MOTOR and not terms[0].sided]
    signals = {segment.signal for segment in segments}
    return [terms for terms in _groups() if _SENSOR_SIGNALS.get(terms[0].place, signals) & signals]


def _groups() -> list[tuple[Basis, ...]]:
    """Returns every term alone, but the sine and the cosine of one period together.

    Sine and cosine of the heading stand alone: their phase is known. Each rotation sensor also has a size of its own:
    a fault of one of them is a common term and a difference, and neither of these alone explains anything.
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
