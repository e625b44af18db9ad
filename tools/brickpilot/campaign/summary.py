"""The results of a campaign's table: rates with intervals, quantiles, causes, worst runs, and sensitivity."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brickpilot import __version__
from brickpilot.campaign import designs, flight_row, sensitivity
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.runs import INDEX
from brickpilot.errors import InputError

Array = NDArray[np.float64]

WORST = 10
MOST_CHOICES = 12
"""An input with more values than this has no success rate for each value."""

QUANTILES = {"min": 0.0, "q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95, "max": 1.0}

_NO_DISTRIBUTION = ("waypoints_total", "seed")


class Table:
    """The merged table, whose columns are read on demand."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def column(self, name: str) -> pa.ChunkedArray:
        """Returns a column as it is in the file."""
        return pq.read_table(self._path, columns=[name]).column(0)

    def numbers(self, name: str) -> Array:
        """Returns a column as numbers (runs,): NaN where there is none, truth as 1, texts by their order."""
        column = self.column(name)
        if pa.types.is_string(column.type):
            codes: Array = pc.dictionary_encode(column).combine_chunks().indices.to_numpy(zero_copy_only=False)
            return codes.astype(np.float64)
        return np.asarray(pc.cast(column, pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


_Z = 1.959963984540054  # 95 % of a normal distribution lie within so many sd


def rate(success: NDArray[np.bool_], blocks: NDArray[np.int64]) -> dict[str, Any]:
    """Returns the share of runs that succeed, with its 95 % interval by Wilson's score.

    Args:
        success: (runs,).
        blocks: (runs,), see `designs.block`. Runs of a block are alike, so they count as fewer: as the number of
            independent runs whose share would have the variance among blocks (Kish's effective size).
    """
    count, of = int(success.sum()), len(success)
    share = count / of
    runs = _effective(success, blocks)
    middle = (share + _Z**2 / (2 * runs)) / (1 + _Z**2 / runs)
    half = _Z / (1 + _Z**2 / runs) * math.sqrt(share * (1 - share) / runs + (_Z / (2 * runs)) ** 2)
    return {"count": count, "of": of, "rate": share, "ci95": [max(middle - half, 0.0), min(middle + half, 1.0)]}


def _effective(success: NDArray[np.bool_], blocks: NDArray[np.int64]) -> float:
    """Returns how many independent runs give as much information; if all runs end alike, the number of blocks."""
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
    causes = Counter(one for one in table.column("cause").to_pylist() if one)
    return {
        "name": campaign.name,
        "design": campaign.design,
        "runs": len(success),
        "seed": campaign.seed,
        "version": __version__,
        "success": rate(success, _blocks(campaign, len(success))),
        "by_choice": _by_choice(campaign, table, success),
        "causes": dict(sorted(causes.items(), key=lambda one: (-one[1], one[0]))),
        "figures": _figures(table),
        "worst": _worst(table),
        "sensitivity": _sensitivity(campaign, table),
    }


def _by_choice(campaign: Campaign, table: Table, success: NDArray[np.bool_]) -> dict[str, dict[str, Any]]:
    """Returns input -> value -> success rate, for inputs with few values."""
    found: dict[str, dict[str, Any]] = {}
    blocks = _blocks(campaign, len(success))
    for one in campaign.drawn:
        if one.distribution.kind != "choice" or one.levels > MOST_CHOICES:
            continue
        column = table.column(one.name).to_pandas()
        groups = {value: (column == value).to_numpy(dtype=bool) for value in _order(column.dropna().unique())}
        found[one.name] = {_text(value): rate(success[group], blocks[group]) for value, group in groups.items()}
    return found


def _blocks(campaign: Campaign, count: int) -> NDArray[np.int64]:
    return np.array([designs.block(campaign, index) for index in range(count)])


def _order(values: Any) -> list[Any]:
    return sorted(values.tolist())


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return value if isinstance(value, str) else f"{value:.6g}"


def _figures(table: Table) -> dict[str, dict[str, Any]]:
    """Returns figure -> unit, number of runs that have it, mean, sd and quantiles."""
    found = {}
    for name, unit in flight_row.UNITS.items():
        if name in _NO_DISTRIBUTION or name in flight_row.WORDS:
            continue
        values = table.numbers(name)
        values = values[np.isfinite(values)]
        if not len(values):
            found[name] = {"unit": unit, "known": 0}
            continue
        quantiles = np.quantile(values, list(QUANTILES.values()))
        found[name] = {"unit": unit, "known": len(values), "mean": float(values.mean()), "sd": float(values.std())}
        found[name] |= dict(zip(QUANTILES, map(float, quantiles), strict=True))
    return found


def _worst(table: Table) -> list[dict[str, Any]]:
    """Returns the worst runs: failed ones first, then fewer waypoints, then the largest distance from a waypoint."""
    order = np.lexsort(
        (-np.nan_to_num(table.numbers("closest_approach_max_m"), nan=np.inf), table.numbers("waypoints_reached"),
         table.numbers("success"))
    )[:WORST]  # fmt: skip
    columns = (INDEX, "success", "cause", "waypoints_reached", "waypoints_total", "closest_approach_max_m",
               "cross_track_rms_m", "motor_stream_sha256")  # fmt: skip
    rows = [table.column(name).take(pa.array(order)).to_pylist() for name in columns]
    return [dict(zip(columns, row, strict=True)) for row in zip(*rows, strict=True)]


def _sensitivity(campaign: Campaign, table: Table) -> dict[str, Any] | None:
    """Returns the indices of each figure; None: the design has none, or SALib is not installed."""
    method = sensitivity.method(campaign)
    if method is None:
        return None
    inputs = {one.name: table.numbers(one.name) for one in campaign.drawn}
    try:
        found = {
            name: [one.to_json() for one in sensitivity.indices(campaign, inputs, table.numbers(name))]
            for name in sensitivity.FIGURES
        }
    except InputError as error:
        return {"method": str(error), "figures": {}}
    return {"method": method, "figures": found}
