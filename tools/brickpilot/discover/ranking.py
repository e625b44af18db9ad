"""The ranking of a finding: every set of effects that was fitted, and why it was taken or lost."""

from __future__ import annotations

import numpy as np

from brickpilot.discover.finding import Rank
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.search import Searched
from brickpilot.discover.verdict import Verdict
from brickpilot.fit.parameters import value_of

_WORSE = "Fits worse by {:.0f} units of log likelihood."
_GAINS_LITTLE = "Gains too little beside the effects that were taken before."
_MORE_EFFECTS = "Fits a little better, but it has more effects, and the gain may be chance."


def ranking(verdict: Verdict, searched: Searched) -> tuple[Rank, ...]:
    """Returns every set of effects once, as fitted best: those of the verdict first, then those of the search."""
    found = [_rank(one, verdict, verdict.nominal.cost, _why(one, verdict)) for one in verdict.ranked]
    for step in searched.rounds:
        for one in step.tried:
            by = one.penalised_cost - searched.best.penalised_cost
            why = _WORSE.format(max(by, 1.0)) if by > 0 else _GAINS_LITTLE
            found.append(_rank(one, verdict, searched.nominal.cost, why))
    first: dict[tuple[str, ...], Rank] = {}
    for rank in found:
        first.setdefault(rank.names, rank)
    return tuple(first.values())


def _why(one: FittedModel, verdict: Verdict) -> str:
    if one is verdict.best:
        return "Taken: it explains the runs best."
    if one in verdict.rivals:
        return "The data cannot tell it from the best one."
    by = one.penalised_cost - verdict.best.penalised_cost
    return _WORSE.format(max(by, 1.0)) if by > 0 else _MORE_EFFECTS


def _rank(one: FittedModel, verdict: Verdict, before: float, why: str) -> Rank:
    removed = (before - one.cost) / max(before - verdict.noise, 1e-9)
    values = {f"{c.effect}.{name}": value_of(one.model, f"{c.effect}.{name}") for c in one.chosen for name in c.free}
    gap = float(np.sqrt(max(one.cost, 0.0) / max(verdict.noise, 1e-9)))
    return Rank(one.names, values, gap, float(np.clip(removed, 0.0, 1.0)), why)
