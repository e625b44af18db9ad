"""Drops parameters that the data do not determine."""

from __future__ import annotations

from brickpilot import catalogue
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import Candidate, sizes_of
from brickpilot.discover.fitting import FittedModel, refine, without_parameter
from brickpilot.discover.gates import INDISPENSABLE
from brickpilot.fit.uncertainty import Estimate, assess


def drop_undetermined(error: BinnedOutputError, found: FittedModel, jobs: int) -> FittedModel:
    """Returns `found` without sizes whose interval holds zero, dropped one at a time, the least certain one first.

    An effect without any size left is dropped as a whole. A size without an interval may be known but for its unit, as
    all forces are where nobody stated a mass: it stays if the data cannot do without it.
    """
    indispensable: set[tuple[str, str]] = set()
    while found.chosen:
        estimates = assess(error.with_plan(found.plan), found.model, found.plan.free).estimates
        doubtful = [
            (_certainty(estimate), candidate, name)
            for candidate in found.chosen
            for name in sizes_of(candidate)
            if (candidate.effect, name) not in indispensable
            and not _excludes_zero(estimate := estimates[f"{candidate.effect}.{name}"])
        ]
        if not doubtful:
            return found
        _, candidate, doubted = min(doubtful, key=lambda one: one[0])
        name = _dropped_first(candidate, doubted)
        shorter = refine(error, [without_parameter(found, candidate, name)], jobs)
        if not shorter:
            return found
        unbounded = estimates[f"{candidate.effect}.{name}"].ci95 is None
        least = max(found.penalised_cost, error.floor_cost())
        if unbounded and shorter[0].penalised_cost > INDISPENSABLE * least:
            indispensable |= {(candidate.effect, name), (candidate.effect, doubted)}
            continue
        found = shorter[0]
    return found


def _dropped_first(candidate: Candidate, name: str) -> str:
    """Returns what goes before `name` does: an addition to it, as a breakaway torque is to dry friction."""
    infos = catalogue.effect(candidate.effect).parameters
    return next((one.name for one in infos if one.only_with == name and one.name in sizes_of(candidate)), name)


def _excludes_zero(estimate: Estimate) -> bool:
    return estimate.ci95 is not None and (estimate.ci95[0] > 0 or estimate.ci95[1] < 0)


def _certainty(estimate: Estimate) -> float:
    """Returns the value over the width of its interval; 0 if it has none."""
    if estimate.ci95 is None:
        return 0.0
    return abs(estimate.value) / max(estimate.ci95[1] - estimate.ci95[0], 1e-300)
