"""Removes effects that a model does not need."""

from __future__ import annotations

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.fitting import FittedModel, refine, without_effect
from brickpilot.discover.gates import HELD_OUT_SHARE, gains_enough


def prune(
    error: BinnedOutputError, found: FittedModel, jobs: int, held_out: BinnedOutputError | None = None
) -> FittedModel:
    """Returns `found` without the effects that the others make needless, fitted again. At least one effect stays.

    Args:
        held_out: an effect that does not help on the held-out runs is needless, however well it fits.
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
    """Returns whether `after` gains enough over the smaller model `before`, on fit runs and on held-out runs."""
    if not gains_enough(before.penalised_cost, after.penalised_cost, error.floor_cost()):
        return False
    if held_out is None:
        return True
    fall = 1 - held_out.losses(after.model).sum() / max(float(held_out.losses(before.model).sum()), 1e-12)
    expected = 1 - after.losses.sum() / max(float(before.losses.sum()), 1e-12)
    return bool(fall > HELD_OUT_SHARE * expected)
