"""The smallest size of each effect that would have been named in a data set: what the verdict "none" is worth."""

from __future__ import annotations

import math

from brickpilot import catalogue
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import candidates
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.finding import Visible
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.gates import required_gain
from brickpilot.discover.screen import signature_strengths


def smallest(error: BinnedOutputError, best: FittedModel, excitation: Excitation) -> dict[str, Visible]:
    """Returns effect -> the size at which it would gain enough to be named beside the effects of `best`.

    The size is extrapolated from the nearest simulated size. Effects that nothing here excites are left out.
    """
    here = error.with_plan(best.plan)
    here.keep_sensitivities(best.point, len(best.point))
    gate = required_gain(best.cost, error.floor_cost())
    found: dict[str, tuple[float, Visible]] = {}
    for candidate, values, strength in signature_strengths(
        here, best.point, candidates(best.model, here.signals), excitation=excitation
    ):
        name = candidate.free[0]
        size = abs(values[name]) * math.sqrt(gate / max(strength, 1e-12))
        away = abs(math.log(size / abs(values[name]))) if values[name] and size else math.inf
        info = next(one for one in catalogue.effect(candidate.effect).parameters if one.name == name)
        if size > info.maximum or not math.isfinite(away):
            continue
        if candidate.effect not in found or away < found[candidate.effect][0]:
            found[candidate.effect] = (away, Visible(name, size, info.unit))
    return {name: visible for name, (_, visible) in sorted(found.items())}
