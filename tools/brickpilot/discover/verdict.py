"""The verdict: what the evidence says of all explanations that were found. It is decided here and nowhere else.

The explanations that hold 95 % of the weight are kept. Those that contain another of them say nothing more within the
tolerance, so the simpler one speaks for both. An effect in 95 % of the weight is sure. One minimal explanation, all
sure: `named`. Several: `ambiguous`. The empty one: `none`. What is left over may turn each of these into `unknown`; see
`adequacy`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from brickpilot.discover import evidence, numbers
from brickpilot.discover.adequacy import Adequacy
from brickpilot.discover.evidence import Evidence
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.search import Found

Kind = Literal["none", "named", "ambiguous", "unknown"]


@dataclass(frozen=True, eq=False)
class Weighed:
    """An explanation of the set that holds 95 % of the weight."""

    explanation: Explanation
    weight: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the fit runs say.

    Attributes:
        nominal: the calibrated nominal model.
        best: the explanation that is reported; the nominal model where nothing is needed.
        rivals: the other minimal explanations, the heaviest first.
        held: the set that holds 95 % of the weight, the heaviest first.
        sure: the names of parts with 95 % of the weight.
        temperature: the nats that count as one.
        adequacy: what the best explanation leaves; None: not asked, as time ran out.
        weights: the names of an explanation -> its weight, of all that were weighed.
    """

    kind: Kind
    nominal: Explanation
    best: Explanation
    rivals: tuple[Explanation, ...]
    held: tuple[Weighed, ...]
    sure: frozenset[str]
    temperature: float
    adequacy: Adequacy | None
    ranked: tuple[Evidence, ...]

    @property
    def confidence(self) -> float:
        """The weight of the explanations that say what the best one says: it, and those that contain it."""
        return min(
            1.0,
            sum(
                one.weight
                for one in self.held
                if one.explanation.key == self.best.key or one.explanation.contains(self.best)
            ),
        )


def weigh(found: Found) -> Verdict:
    """Returns the verdict of the evidence alone, before what is left is looked at."""
    temperature = found.temperature
    ranked = found.ranked()
    weight = evidence.weigh(ranked, temperature)
    order = np.argsort(-weight, kind="stable")
    last = int(np.searchsorted(np.cumsum(weight[order]), numbers.SURE))
    held = [Weighed(ranked[index].explanation, float(weight[index])) for index in order[: last + 1].tolist()]
    held_by = evidence.held_by(ranked, weight)
    sure = frozenset(name for name, share in held_by.items() if share >= numbers.SURE)
    least = [one.explanation for one in held if not any(one.explanation.contains(other.explanation) for other in held)]
    best = next((one for one in least if one.effects), least[0])  # runs that differ are no missing law
    nothing = found.nothing.explanation
    if any(one.key == nothing.key for one in least):
        kind: Kind = "none"
        best, least = nothing, [nothing]
    elif len(least) == 1 and best.key - nothing.key <= sure:
        kind = "named"
    else:
        kind = "ambiguous"
    return Verdict(
        kind, nothing, best, tuple(one for one in least if one is not best), tuple(held), sure, temperature, None,
        tuple(ranked),
    )  # fmt: skip
