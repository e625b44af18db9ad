"""Lets a composed term compete with the named effects where they leave structure behind."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover import composed_source
from brickpilot.discover.band import Band
from brickpilot.discover.candidates import PARAMETER_COST
from brickpilot.discover.compose import Composed, compose
from brickpilot.discover.composed_screen import Segment
from brickpilot.discover.composed_terms import EFFECT, PLACES, parameters
from brickpilot.discover.finding import Term
from brickpilot.discover.select import Fitted, enough
from brickpilot.discover.verdict import Judged
from brickpilot.fit.parameters import Free, Plan
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

_SHARE_OF_NAMES = 0.05  # of what the named effects take away: a term that adds less does not shake them
_OUTPUTS = ("wheel_angle_left", "wheel_angle_right", "angle", "x", "position")


@dataclass(frozen=True)
class Composition:
    """A term that explains the data better than any name. `alone`: without the named effects beside it."""

    model: Model
    plan: Plan
    found: Composed
    alone: bool


class View:
    """A band as the composer sees it: see `composed_screen.Problem`."""

    def __init__(self, band: Band, found: Fitted) -> None:
        self._band = band.with_plan(found.plan)
        self._point = found.point
        self.base: Model = found.model
        self.free: Sequence[Free] = found.plan.free

    @cached_property
    def sensitivities(self) -> Array:
        return self._band.sensitivity(self._point) * self._band.weight()[:, np.newaxis]

    @cached_property
    def segments(self) -> Sequence[Segment]:
        return [Segment(*one) for one in self._band.courses(self.base, _OUTPUTS)]

    def residual(self, models: Sequence[Model]) -> Array:
        return self._band.whitened(self._band.predict(models))


def composed(coarse: Band, fine: Band, judged: Judged, tell: Callable[[str], None]) -> Composition | None:
    """The composed term, where it leaves less than the best named effects do; None where it does not."""
    bases = [judged.nominal] if judged.best is judged.nominal else [judged.nominal, judged.best]
    found: list[tuple[float, bool, Composed]] = []
    for base in bases:
        one = compose(View(fine, base), rough=View(coarse, base), tell=tell)
        if one is not None:
            each = PARAMETER_COST * max(1.0, one.cost_after / fine.trusted())
            charged = one.cost_after + each * (len(one.terms) + len(one.settings))
            charged += base.charged - base.cost
            found.append((charged, base is judged.nominal, one))
    if not found:
        return None
    charged, alone, best = min(found, key=lambda one: one[0])
    if not enough(judged.best.charged, charged, fine.trusted()):
        return None
    if judged.best.charged - charged < _SHARE_OF_NAMES * (judged.nominal.cost - judged.best.cost):
        return None
    base = judged.nominal if alone else judged.best
    return Composition(best.model, _plan(base.plan, best), best, alone)


def term_of(found: Composed, vehicle: str, name: str, removed_held_out: float) -> Term:
    """The term as the finding holds it. `name`: of the C file, without its ending."""
    source = composed_source.render(found.terms, found.settings, name=name, vehicle=vehicle)
    place = ", ".join(PLACES[place] for place in found.places)
    html = f"{found.equation.mathml}<p>{found.equation.legend}</p>"
    return Term(place, f"{found.equation.text}. {found.equation.legend}", html, f"{name}.c", source, removed_held_out)


def _plan(base: Plan, found: Composed) -> Plan:
    """The plan of the base model with the term's own parameters free."""
    names = {term.basis.name for term in found.terms} | found.settings.keys() - {"clock"}  # a choice, not a size
    added = tuple(Free(f"{EFFECT}.{info.name}", info, None) for info in parameters() if info.name in names)
    model = dataclasses.replace(base.model, effects={**base.model.effects, EFFECT: found.model.effects[EFFECT]})
    return Plan(model, (*base.free, *added), ())
