"""How long a discovery may take, and what it leaves out so as to keep to that."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass, field

SEARCHED, COMPOSED = 0.7, 0.9
"""Shares of the budget after which the search and a composed term have to be done. The rest goes into what cannot be
left out: proving the written model, intervals and the report."""


@dataclass(frozen=True)
class Deadline:
    """The time that is left. A stage asks it before each part of its work that can be left out.

    Attributes:
        budget_s: None: no limit.
        share: the part of the budget after which the stage has to be done.
        began: s of `time.perf_counter`.
        left_out: what there was no time for, in order; all stages share it.
    """

    budget_s: float | None = None
    share: float = 1.0
    began: float = field(default_factory=time.perf_counter)
    left_out: dict[str, None] = field(default_factory=dict)

    def until(self, share: float) -> Deadline:
        """Returns the deadline of a stage that has to be done after this share of the budget."""
        return dataclasses.replace(self, share=share)

    @property
    def passed(self) -> bool:
        return self.budget_s is not None and time.perf_counter() - self.began >= self.share * self.budget_s

    def allows(self, work: str) -> bool:
        """Returns whether there is time for `work`, and notes it as left out where there is none."""
        if self.passed:
            self.left_out[work] = None
        return not self.passed


NO_LIMIT = Deadline()
