"""Removes what a model does not need."""

from __future__ import annotations

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.evidence import held_out_change
from brickpilot.discover.fitting import FittedModel, refine, without
from brickpilot.discover.gates import gains_enough


def prune(
    error: BinnedOutputError, found: FittedModel, jobs: int, held_out: BinnedOutputError | None = None, kept: int = 0
) -> FittedModel:
    """Returns `found` without what the others make needless, fitted again. At least one candidate stays.

    Args:
        held_out: an effect that the held-out runs contradict is needless, however well it fits.
        kept: so many of the first candidates stay in any case, and one more.
    """
    while len(found.chosen) > kept + 1:
        shorter = refine(error, [without(found, one) for one in found.chosen[kept:]], jobs)
        needless = [one for one in shorter if not passes_gates(error, one, found, held_out)]
        if not needless:
            return found
        found = needless[0]
    return found


def passes_gates(
    error: BinnedOutputError, before: FittedModel, after: FittedModel, held_out: BinnedOutputError | None
) -> bool:
    """Returns whether `after` gains enough over the smaller model `before`, and no held-out run contradicts it.

    Held-out runs that do not excite what `after` adds say nothing about it.
    """
    if not gains_enough(before.penalised_cost, after.penalised_cost, error.floor_cost()):
        return False
    return held_out is None or not held_out_change(held_out, before.model, after.model).is_contradicted
