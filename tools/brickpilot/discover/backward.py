"""Removes effects that a model does not need."""

from __future__ import annotations

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.evidence import held_out_change
from brickpilot.discover.fitting import FittedModel, refine, without_effect
from brickpilot.discover.gates import gains_enough


def prune(
    error: BinnedOutputError, found: FittedModel, jobs: int, held_out: BinnedOutputError | None = None
) -> FittedModel:
    """Returns `found` without the effects that the others make needless, fitted again. At least one effect stays.

    Args:
        held_out: an effect that the held-out runs contradict is needless, however well it fits.
    """
    while len(found.chosen) > 1:
        shorter = refine(error, [without_effect(found, name) for name in found.names], jobs)
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
