"""The effects of the library as candidates of the search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.candidates import candidates
from brickpilot.discover.deadline import Deadline
from brickpilot.discover.excitation import Excitation
from brickpilot.discover.fitting import FittedModel
from brickpilot.discover.gates import MOST_EFFECTS, STRUCTURED
from brickpilot.discover.screen import Trial, screen
from brickpilot.discover.search_round import Start

Array = NDArray[np.float64]


class EffectSource:
    """See `search_round.Source`."""

    word, most, pairs = "effect", MOST_EFFECTS, True

    def __init__(self, excitation: Excitation) -> None:
        self.excitation = excitation

    def screened(self, error: BinnedOutputError, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns each set of parameters of each effect that the model lacks, from its best size."""
        chosen = candidates(error.plan.at(point), error.signals)
        first: dict[tuple[str, tuple[str, ...]], Trial] = {}
        for trial in screen(error, point, chosen, excitation=self.excitation, deadline=deadline):
            first.setdefault((trial.candidate.effect, trial.candidate.free), trial)
        return list(first.values())

    def nearby(self, error: BinnedOutputError, current: FittedModel, fits: Sequence[FittedModel]) -> list[Start]:
        """Returns a second phase for each fit that gave both wheels one, from where that ended.

        The linear screen cannot find two phases at once: it starts from no effect, where wheels stop and slip in turn.
        """
        return [
            Start(other, found.model.effects[other.effect], found.point[: len(current.point)])
            for found in fits
            for other in candidates(current.model)
            if other.effect == found.names[-1] and {*other.free} - {*found.chosen[-1].free} == {"phase_difference"}
        ]

    def is_finished(self, error: BinnedOutputError, current: FittedModel) -> bool:
        """Returns whether the search ends at a periodic effect that leaves structure over whole runs.

        Simulated wheels get out of phase, and what is tried beside the effect would fit that error.
        """
        loses_phase = self.excitation.wheels_measured and not self.excitation.windowed and current.is_periodic
        return loses_phase and current.cost > STRUCTURED * error.noise_cost()
