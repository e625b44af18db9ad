"""The results of a campaign's table: rates with intervals, quantiles, causes, worst runs, and sensitivity.

The sensitivity says on which inputs a figure depends. It consists of SALib's indices, each with its 95 % interval.

- `saltelli`: Sobol indices, of first order and total (Saltelli et al. 2010, Comput. Phys. Commun. 181).
  The compared runs have the same noise. So if an input changes the effect of the noise, its index includes this change.
- `morris`: mu*, the mean size of an input's elementary effects (Campolongo et al. 2007, Environ. Model. Softw. 22).
- Independent draws: indices of first order by RBD-FAST (Tarantola et al. 2006, Reliab. Eng. Syst. Saf. 91). An input
  that has an effect only together with another input has an index of about 0.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brickpilot import __version__
from brickpilot.campaign import designs, runs
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.runs import INDEX
from brickpilot.errors import InputError

Array = NDArray[np.float64]

EXPLAINED_FIGURES = ("success", "cross_track_rms_m", "position_estimate_error_m", "time_s")

LEAST_RUNS = 100
"""Least number of runs with a known figure for RBD-FAST; with fewer runs, its indices are mostly bias."""

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
        total, total_half: the total index, and half the width of its 95 % interval; only `saltelli` has a total index.
    """

    input: str
    value: float
    half: float
    total: float | None = None
    total_half: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns the index with its interval."""
        numbers = {"input": self.input, "index": self.value, "ci95": [self.value - self.half, self.value + self.half]}
        if self.total is not None and self.total_half is not None:
            ends = [self.total - self.total_half, self.total + self.total_half]
            numbers |= {"total": self.total, "total_ci95": ends}
        return numbers


def sensitivity_method(campaign: Campaign) -> str | None:
    """Returns a description of the indices; None: the design has no indices."""
    if campaign.design == "grid" or not campaign.drawn:
        return None
    return METHODS.get(campaign.design, METHODS[""])


def sensitivity_indices(campaign: Campaign, inputs: Mapping[str, Array], figure: Array) -> list[Index]:
    """Returns a figure's indices, the largest first; empty: the figure is constant, or too few runs have the figure.

    Args:
        inputs: drawn input -> its values (runs,). A number stands for each text. NaN: the run lacks the input's
            effect or fault.
        figure: (runs,); NaN where a run does not have the figure. A block is left out if one of its runs lacks the
            figure.

    Raises:
        InputError: SALib is not installed.
    """
    kept, least = np.isfinite(figure), LEAST_RUNS
    if campaign.block_runs > 1:
        kept = np.repeat(kept.reshape(-1, campaign.block_runs).all(axis=1), campaign.block_runs)
        least = 4 * campaign.block_runs
    values = figure[kept]
    if len(values) < least or np.ptp(values) == 0:
        return []
    # SALib uses random numbers only for the intervals. Its printed notes are suppressed: only `cli` may print.
    with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        indices = _analysed(campaign, inputs, kept, values)
    sound = [index for index in indices if math.isfinite(index.value) and math.isfinite(index.half)]
    return sorted(sound, key=lambda index: (-(index.value if index.total is None else index.total), index.input))


def _analysed(campaign: Campaign, inputs: Mapping[str, Array], kept: NDArray[np.bool_], values: Array) -> list[Index]:
    problem = designs.problem(campaign)
    names = problem["names"]
    seed = 1 + campaign.seed % (2**32 - 1)  # SALib takes 0 as no seed; some of its versions take only 32 bits
    if campaign.design == "saltelli":
        keys: tuple[str, ...] = ("S1", "S1_conf", "ST", "ST_conf")
        analysis = designs.salib("analyze.sobol").analyze(problem, values, calc_second_order=False, seed=seed)
    elif campaign.design == "morris":
        keys = ("mu_star", "mu_star_conf")
        shares = designs.drawn_shares(campaign)(0, len(kept))[kept]
        levels = (shares - designs.MORRIS_EDGE) / (1.0 - 2.0 * designs.MORRIS_EDGE)
        analyse = designs.salib("analyze.morris").analyze
        analysis = analyse(problem, levels, values, num_levels=designs.MORRIS_LEVELS, seed=seed)
    else:
        keys = ("S1", "S1_conf")
        columns = np.column_stack([inputs[name][kept] for name in names])
        if np.isnan(columns).any():
            # If an effect is off, its parameters have no values. If a number replaced such a missing value, the number
            # would show where the effect is off, and SALib would count the switch's influence as the parameter's.
            columns = designs.drawn_shares(campaign)(0, len(kept))[kept]
        analysis = designs.salib("analyze.rbd_fast").analyze(problem, columns, values, seed=seed)
    rows = zip(names, *(analysis[key] for key in keys), strict=True)
    return [Index(name, *map(float, numbers)) for name, *numbers in rows]


WORST = 10
MOST_CHOICES = 12
"""Success rates by value are given only for inputs with at most this number of values."""

QUANTILES = {"min": 0.0, "q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95, "max": 1.0}

_NO_DISTRIBUTION = ("waypoints_total", "seed")


class Table:
    """The merged table, whose columns are read on demand."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def column(self, name: str) -> pa.ChunkedArray:
        """Returns a column of the file without changes."""
        return pq.read_table(self._path, columns=[name]).column(0)

    def numbers(self, name: str) -> Array:
        """Returns a column as numbers (runs,): NaN if missing, 1 if true; texts get numbers by first appearance."""
        column = self.column(name)
        if pa.types.is_string(column.type):
            codes: Array = pc.dictionary_encode(column).combine_chunks().indices.to_numpy(zero_copy_only=False)
            return codes.astype(np.float64)
        return np.asarray(pc.cast(column, pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


_Z = 1.959963984540054  # half the width, in sd, of the interval that holds 95 % of a normal distribution


def rate(success: NDArray[np.bool_], blocks: NDArray[np.int64]) -> dict[str, Any]:
    """Returns the share of runs that succeed, with its 95 % interval by Wilson's score.

    Args:
        success: (runs,).
        blocks: (runs,), see `designs.block`. Runs of a block are correlated. So the interval is that of a smaller
            number of independent runs whose share has the same variance (Kish's effective size).
    """
    count, of = int(success.sum()), len(success)
    share = count / of
    runs = _effective(success, blocks)
    middle = (share + _Z**2 / (2 * runs)) / (1 + _Z**2 / runs)
    half = _Z / (1 + _Z**2 / runs) * math.sqrt(share * (1 - share) / runs + (_Z / (2 * runs)) ** 2)
    return {"count": count, "of": of, "rate": share, "ci95": [max(middle - half, 0.0), min(middle + half, 1.0)]}


def _effective(success: NDArray[np.bool_], blocks: NDArray[np.int64]) -> float:
    """Returns Kish's effective number of runs; if all runs succeed or all fail, the number of blocks."""
    _, codes = np.unique(blocks, return_inverse=True)
    members, hits = np.bincount(codes), np.bincount(codes, weights=success)
    number, of, share = len(members), len(success), float(success.mean())
    if number in (1, of) or share in (0.0, 1.0):
        return float(number)
    variance = number / (number - 1) * float(((hits - share * members) ** 2).sum()) / of**2
    return min(share * (1 - share) / variance, float(of)) if variance > 0 else float(of)


def summary(campaign: Campaign, table: Table) -> dict[str, Any]:
    """Returns the content of `summary.json`; lengths in m, times in s, angles in rad."""
    success = table.numbers("success") > 0
    blocks = np.arange(len(success)) // campaign.block_runs
    causes = Counter(cause for cause in table.column("cause").to_pylist() if cause)
    return {
        "name": campaign.name,
        "design": campaign.design,
        "runs": len(success),
        "seed": campaign.seed,
        "version": __version__,
        "success": rate(success, blocks),
        "by_choice": _by_choice(campaign, table, success, blocks),
        "causes": dict(sorted(causes.items(), key=lambda row: (-row[1], row[0]))),
        "figures": _figures(table),
        "worst": _worst(table),
        "sensitivity": _sensitivity(campaign, table),
    }


def _by_choice(
    campaign: Campaign, table: Table, success: NDArray[np.bool_], blocks: NDArray[np.int64]
) -> dict[str, dict[str, Any]]:
    """Returns input -> value -> success rate, for inputs with few values."""
    rates: dict[str, dict[str, Any]] = {}
    for input_ in campaign.drawn:
        if input_.distribution.kind != "choice" or input_.levels > MOST_CHOICES:
            continue
        column = table.column(input_.name).to_pandas()
        groups = {value: (column == value).to_numpy(dtype=bool) for value in sorted(column.dropna().unique().tolist())}
        rates[input_.name] = {_text(value): rate(success[group], blocks[group]) for value, group in groups.items()}
    return rates


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return value if isinstance(value, str) else f"{value:.6g}"


def _figures(table: Table) -> dict[str, dict[str, Any]]:
    """Returns figure -> its unit, number of runs with this figure, mean, sd and quantiles."""
    figures = {}
    for name, unit in runs.UNITS.items():
        if name in _NO_DISTRIBUTION or name in runs.WORDS:
            continue
        values = table.numbers(name)
        values = values[np.isfinite(values)]
        if not len(values):
            figures[name] = {"unit": unit, "known": 0}
            continue
        quantiles = np.quantile(values, list(QUANTILES.values()))
        figures[name] = {"unit": unit, "known": len(values), "mean": float(values.mean()), "sd": float(values.std())}
        figures[name] |= dict(zip(QUANTILES, map(float, quantiles), strict=True))
    return figures


def _worst(table: Table) -> list[dict[str, Any]]:
    """Returns the `WORST` worst runs: failed runs first, then fewest waypoints, then the largest closest approach."""
    order = np.lexsort(
        (-np.nan_to_num(table.numbers("closest_approach_max_m"), nan=np.inf), table.numbers("waypoints_reached"),
         table.numbers("success"))
    )[:WORST]  # fmt: skip
    columns = (INDEX, "success", "cause", "waypoints_reached", "waypoints_total", "closest_approach_max_m",
               "cross_track_rms_m", "motor_stream_sha256")  # fmt: skip
    rows = [table.column(name).take(pa.array(order)).to_pylist() for name in columns]
    return [dict(zip(columns, row, strict=True)) for row in zip(*rows, strict=True)]


def _sensitivity(campaign: Campaign, table: Table) -> dict[str, Any] | None:
    """Returns the indices of each figure; None: the design has no indices, or SALib is not installed."""
    method = sensitivity_method(campaign)
    if method is None:
        return None
    inputs = {input_.name: table.numbers(input_.name) for input_ in campaign.drawn}
    try:
        indices = {
            name: [input_.to_json() for input_ in sensitivity_indices(campaign, inputs, table.numbers(name))]
            for name in EXPLAINED_FIGURES
        }
    except InputError as error:
        return {"method": str(error), "figures": {}}
    return {"method": method, "figures": indices}
