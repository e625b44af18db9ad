"""The atoms that a composed law is chosen from: terms with the settings that shape them.

Periods come from the spectra of the residual, so that no term is tried at a period that is not there.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brickpilot.catalogue import ParameterInfo
from brickpilot.discover import numbers, periods
from brickpilot.discover.parts import Part
from brickpilot.discover.periods import Segment
from brickpilot.discover.term_basis import EFFECT, OF_A_MOTOR, Basis, basis, parameters, settings_of, terms_of
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]
Settings = tuple[tuple[str, float], ...]

_SLOWEST_SWING_HZ = 0.5  # a pendulum of a metre swings so, and no robot here carries a longer one
_SPRUNG_HZ = (1.0, 2.0, 4.0)  # tried for a sprung mass, beside the peaks of the spectrum
_NEIGHBOURS = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # times the resolution of a spectrum
_STRIP = ("patch_x", "patch_half_width")
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
    def contains(self) -> tuple[str, ...]:
        return ()

    @property
    def made_of(self) -> tuple[str, ...]:
        return ()

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

    Terms on a strip of the floor are left out: see `source.TermSource`.
    """
    several_ages = len({segment.age for segment in segments}) > 1
    clocks = (0.0, 1.0) if several_ages else (0.0,)
    frequencies = {clock: periods.frequencies(segments, residual, clock) for clock in clocks}
    sprung = sorted({*_SPRUNG_HZ, *(round(f, 6) for f in frequencies[0.0] if f > _SLOWEST_SWING_HZ)})
    orders = periods.angle_orders(segments, residual)
    settings: dict[tuple[str, ...], list[Settings]] = {
        (): [()],
        ("clock",): [(("clock", clock),) for clock in clocks],
        ("frequency", "clock"): [(("frequency", f), ("clock", c)) for c in clocks for f in frequencies[c]],
        ("frequency", "damping"): [(("frequency", f), ("damping", 0.1)) for f in sprung],
        ("order",): [(("order", k),) for k in orders],
        ("wavelength",): [(("wavelength", length),) for length in periods.wavelengths(segments, residual)],
        _STRIP: [],
    }
    return [
        atom(terms, one, _slowest(one, segments))
        for terms in _visible_groups(vehicle, segments)
        for one in settings[terms[0].tuned]
    ]


def family(near: Atom, settings: Mapping[str, float], vehicle: str, segments: Sequence[Segment]) -> list[Atom]:
    """Returns all atoms that the same settings shape, and this one at neighbouring settings."""
    kept = tuple((name, settings[name]) for name, _ in near.settings)
    found = [(terms, kept) for terms in _visible_groups(vehicle, segments) if terms[0].tuned == near.terms[0].tuned]
    found += [(near.terms, other) for other in _neighbours(dict(kept), segments)]
    return [atom(terms, one, near.slowest) for terms, one in found]


def strip_atom(name: str, middle: float, half_width: float) -> Atom:
    """Returns the atom of a term that acts on a strip across x, m."""
    term = next(one for one in basis() if one.name == name)
    return atom((term,), tuple(zip(_STRIP, (middle, half_width), strict=True)))


def _slowest(settings: Settings, segments: Sequence[Segment]) -> float:
    shaping = dict(settings)
    if "frequency" not in shaping:
        return 0.0
    swings = _SLOWEST_SWING_HZ if "damping" in shaping else 0.0
    return max(swings, periods.time_resolution(segments, shaping.get("clock", 0.0)))


def _neighbours(settings: dict[str, float], segments: Sequence[Segment]) -> list[Settings]:
    """Returns the settings with a slightly longer or shorter period: a fit finds the best phase, not the next one."""
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
        return [tuple((settings | {"frequency": frequency}).items()) for frequency in found if frequency >= step]
    return []


def _visible_groups(vehicle: str, segments: Sequence[Segment]) -> list[tuple[Basis, ...]]:
    """Returns the groups of terms whose place the vehicle has and, for a sensor, whose signal was logged."""
    signals = {segment.signal for segment in segments}
    return [terms for terms in _groups() if _is_visible(terms[0], vehicle, signals)]


def _is_visible(term: Basis, vehicle: str, signals: set[str]) -> bool:
    if vehicle == "motor":
        return term.place in OF_A_MOTOR and not term.sided
    return bool(_SENSOR_SIGNALS.get(term.place, signals) & signals)


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
