"""Decides whether a model with more candidates is worth it, and removes what it does not need."""

from __future__ import annotations

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.evidence import held_out_change
from brickpilot.discover.fitting import FittedModel, refine, without
from brickpilot.discover.gates import GAIN_SHARE_OF_EARLIER, PRIOR_STRAINED_SD, STRAIN_RELEASED, gains_enough
from brickpilot.discover.search_round import largest_prior_shift


def prune(
    error: BinnedOutputError,
    nominal: FittedModel,
    found: FittedModel,
    jobs: int,
    held_out: BinnedOutputError | None = None,
) -> FittedModel:
    """Returns `found` without what the others make needless, fitted again. At least one candidate stays.

    Args:
        nominal: the model that the search began with; its candidates stay.
        held_out: an effect that the held-out runs contradict is needless, however well it fits.
    """
    kept = len(nominal.chosen)
    while len(found.chosen) > kept + 1:
        shorter = refine(error, [without(found, one) for one in found.chosen[kept:]], jobs)
        needless = [one for one in shorter if not passes_gates(error, nominal, one, found, held_out)]
        if not needless:
            return found
        found = needless[0]
    return found


def passes_gates(
    error: BinnedOutputError,
    nominal: FittedModel,
    before: FittedModel,
    after: FittedModel,
    held_out: BinnedOutputError | None,
) -> bool:
    """Returns whether `after` explains enough more than the smaller model `before`, and no held-out run contradicts it.

    Held-out runs that do not excite what `after` adds say nothing about it.
    """
    if not explains_more(error, nominal, before, after):
        return False
    return held_out is None or not held_out_change(held_out, before.model, after.model).is_contradicted


def explains_more(error: BinnedOutputError, nominal: FittedModel, before: FittedModel, after: FittedModel) -> bool:
    """Returns whether `after` gains enough over `before`, and more than a slightly wrong law of `before` leaves.

    The same holds for what is added and for what may go: in which order the candidates were found does not matter.
    Where `before` strains a nominal value and `after` does not, the gain is not of that kind.
    """
    gain = before.penalised_cost - after.penalised_cost
    released = (
        largest_prior_shift(error, before) > PRIOR_STRAINED_SD > STRAIN_RELEASED * largest_prior_shift(error, after)
    )
    least = 0.0 if released else GAIN_SHARE_OF_EARLIER * (nominal.cost - before.cost)
    return gains_enough(before.penalised_cost, after.penalised_cost, error.floor_cost()) and gain > least
