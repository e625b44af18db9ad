"""Which inputs a figure depends on: SALib's indices, each with its 95 % interval.

- `saltelli`: Sobol indices, of first order and total (Saltelli et al. 2010, Comput. Phys. Commun. 181).
  The runs that are compared share their noise, so an input's interaction with noise counts as its own effect.
- `morris`: mu*, the mean size of an input's elementary effects (Campolongo et al. 2007, Environ. Model. Softw. 22).
- Independent draws: indices of first order by RBD-FAST (Tarantola et al. 2006, Reliab. Eng. Syst. Saf. 91). An input
  that matters only together with another one has no index.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign import designs
from brickpilot.campaign.file import Campaign

Array = NDArray[np.float64]

FIGURES = ("success", "cross_track_rms_m", "position_estimate_error_m", "time_s")

LEAST_RUNS = 100
"""The least number of runs with a known figure: with fewer, RBD-FAST is mostly bias, since it uses ten harmonics."""

METHODS = {
    "saltelli": "Sobol indices: the share of the figure's variance that the input explains alone, and with all others "
    "(total)",
    "morris": "Morris's mu*: how much the figure changes on average when the input alone goes over its whole range",
    "": "first-order indices by RBD-FAST: the share of the figure's variance that the input explains alone",
}


@dataclass(frozen=True)
class Index:
    """How much a figure depends on an input.

    Attributes:
        value, half: the index, and half the width of its 95 % interval.
        total, total_half: the total index, of `saltelli` alone.
    """

    input: str
    value: float
    half: float
    total: float | None = None
    total_half: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns the index with its interval."""
        found = {"input": self.input, "index": self.value, "ci95": [self.value - self.half, self.value + self.half]}
        if self.total is not None and self.total_half is not None:
            ends = [self.total - self.total_half, self.total + self.total_half]
            found |= {"total": self.total, "total_ci95": ends}
        return found


def method(campaign: Campaign) -> str | None:
    """Returns a description of the indices; None: the design has none."""
    if campaign.design == "grid" or not campaign.drawn:
        return None
    return METHODS.get(campaign.design, METHODS[""])


def indices(campaign: Campaign, inputs: Mapping[str, Array], figure: Array) -> list[Index]:
    """Returns the indices of one figure, the largest first; none if too few runs have it, or all have the same.

    Args:
        inputs: input that was drawn -> (runs,); texts as their numbers, NaN where the run lacks its effect or fault.
        figure: (runs,); NaN where a run does not have it. If a design compares runs with one another, a block with a
            missing one is left out.

    Raises:
        InputError: SALib is not installed.
    """
    kept = _known(campaign, figure)
    values = figure[kept]
    if len(values) < _least(campaign) or np.ptp(values) == 0:
        return []
    # SALib's random numbers are for the intervals alone. It prints notes; only `cli` may.
    with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        found = _analysed(campaign, inputs, kept, values)
    sound = [one for one in found if math.isfinite(one.value) and math.isfinite(one.half)]
    return sorted(sound, key=lambda one: (-(one.value if one.total is None else one.total), one.input))


def _least(campaign: Campaign) -> int:
    block = len(campaign.drawn) + (2 if campaign.design == "saltelli" else 1)
    return 4 * block if campaign.design in ("saltelli", "morris") else LEAST_RUNS


def _known(campaign: Campaign, figure: Array) -> NDArray[np.bool_]:
    known = np.isfinite(figure)
    if campaign.design in ("saltelli", "morris"):
        size = len(campaign.drawn) + (2 if campaign.design == "saltelli" else 1)
        known = np.repeat(known.reshape(-1, size).all(axis=1), size)
    return np.asarray(known)


def _analysed(campaign: Campaign, inputs: Mapping[str, Array], kept: NDArray[np.bool_], values: Array) -> list[Index]:
    problem, names = designs.problem(campaign), [one.name for one in campaign.drawn]
    if campaign.design == "saltelli":
        found = designs.salib("analyze.sobol").analyze(problem, values, calc_second_order=False, seed=0)
        rows = zip(names, found["S1"], found["S1_conf"], found["ST"], found["ST_conf"], strict=True)
        return [Index(name, *map(float, row)) for name, *row in rows]
    if campaign.design == "morris":
        shares = designs.drawn_shares(campaign)(0, len(kept))[kept]
        levels = (shares - designs.MORRIS_EDGE) / (1.0 - 2.0 * designs.MORRIS_EDGE)
        analyse = designs.salib("analyze.morris").analyze
        found = analyse(problem, levels, values, num_levels=designs.MORRIS_LEVELS, seed=0)
        return [
            Index(name, float(a), float(b))
            for name, a, b in zip(names, found["mu_star"], found["mu_star_conf"], strict=True)
        ]
    columns = np.column_stack([inputs[name][kept] for name in names])
    if np.isnan(columns).any():
        # A number of an effect that is off has no value. A filled-in value would act as the switch, and get its index.
        columns = designs.drawn_shares(campaign)(0, len(kept))[kept]
    found = designs.salib("analyze.rbd_fast").analyze(problem, columns, values, seed=0)
    return [Index(name, float(a), float(b)) for name, a, b in zip(names, found["S1"], found["S1_conf"], strict=True)]
