"""Conducts a campaign in a folder, computes the plots of its page, and flies single runs again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign import designs, engine, runs
from brickpilot.campaign.engine import Part, Workers
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.file import runs as count_of
from brickpilot.campaign.inputs import Input
from brickpilot.campaign.store import Parts
from brickpilot.campaign.summary import Table, summary
from brickpilot.campaign.variables import Value
from brickpilot.data.whole_files import write_whole
from brickpilot.errors import InputError
from brickpilot.report import campaign_page
from brickpilot.report.campaign_page import Histogram, Scatter
from brickpilot.vehicle import flight, flight_figures

Array = NDArray[np.float64]

TABLE, SUMMARY, PAGE = "runs.parquet", "summary.json", "report.html"


def conduct(
    campaign: Campaign, folder: Path, workers: Workers, show: Callable[[int, int, str], None], command: str
) -> dict[str, Any]:
    """Flies the runs that `folder` does not hold, writes its files, and returns the content of `summary.json`.

    Args:
        show: called with (parts done, all parts, text).
        command: the command line that conducts this campaign; with `--replay` it flies one run again.

    Raises:
        InputError: the folder holds another campaign, or the workers cannot be reached.
        WorkFailedError: the disk is full, or no worker is left. Finished parts stay, and the same command resumes.
    """
    keys = [part.key for part in runs.parts(campaign)]
    identity = {"campaign": campaign.identity(), "runs": count_of(campaign), "design": designs.made_by(campaign)}
    with Parts(folder, identity) as parts:
        done = parts.done()
        left = (part for part in runs.parts(campaign) if part.key not in done)

        def keep(part: Part, rows: Any) -> None:
            parts.write(part.key, rows)

        what = f"parts of {runs.part_size(campaign)} runs or fewer"
        progress = engine.Progress(show, total=len(keys), done=len(done), what=what)
        if len(done) < len(keys):
            engine.run(runs.fly, left, keep=keep, workers=workers, progress=progress)
        parts.merge(keys, folder / TABLE)
        table = Table(folder / TABLE)
        found = summary(campaign, table)
        write_whole(folder / SUMMARY, json.dumps(found, indent=2, allow_nan=False) + "\n")
        drawn = histograms(table, found["figures"]), scatters(campaign, table, found["sensitivity"])
        write_whole(folder / PAGE, campaign_page.page(found, *drawn, command))
    return found


Ticks = dict[str, Any]


@dataclass(frozen=True)
class Replayed:
    """A run that was flown again.

    Attributes:
        inputs: the values that the campaign drew for the run; a value is None if the robot lacks its effect.
        figures: the keys of `brickpilot run --json`, or of `hil --json` where the run has faults.
        ticks: the columns of ticks.csv; None: the run has no link.
    """

    inputs: dict[str, Value | None]
    flight: flight.Flight
    figures: dict[str, Any]
    ticks: Ticks | None


def replay(campaign: Campaign, index: int) -> Replayed:
    """Flies run `index` again; its motor commands are the same to the last bit.

    Raises:
        InputError: the campaign has no such run.
        SimulationError: the plant diverges, as it did in the campaign.
    """
    if not 0 <= index < count_of(campaign):
        last = count_of(campaign) - 1
        raise InputError(f"the campaign has the runs 0 to {last}", field=f"--replay {index}")
    run = runs.one(campaign, index)
    given = dict(run.drawn) | runs.of_robot(campaign, run)
    if run.plan.scenario.faults:
        found = _over_a_link(run, given)
    else:
        flown = flight.fly(run.plan)
        found = Replayed(given, flown, flight_figures.summary(flown), None)
    found.figures["failure"] = flight_figures.failure(found.figures)
    return found


def _over_a_link(run: runs.Run, given: dict[str, Any]) -> Replayed:
    from brickpilot.hil import fly

    flown = fly.fly_alone(run.plan)
    return Replayed(given, flown.flight, flown.figures(fly.MEMORY, "lockstep"), flown.ticks.columns())


SHOWN = (
    "cross_track_rms_m", "closest_approach_max_m", "position_estimate_error_m", "heading_rms_rad", "time_s", "charge_c",
)  # fmt: skip
"""The figures whose distribution the page draws."""

MOST_DOTS = 1500
"""The largest number of runs in a scatter plot: more points overlap and take long to draw."""

STRONGEST = 3
"""Each figure is drawn against this number of its strongest inputs."""

_DRAWN_OUT = (0.001, 0.999)  # quantiles: range of a histogram; runs beyond it count in its end bars
_BARS = 40


def histograms(table: Table, figures: Mapping[str, Mapping[str, Any]]) -> list[Histogram]:
    """Returns the distributions of the runs' figures, separately for success and failure."""
    success = table.numbers("success") > 0
    found = []
    for name in SHOWN:
        values = table.numbers(name)
        known = np.isfinite(values)
        if known.sum() < 2:
            continue
        low, high = np.quantile(values[known], _DRAWN_OUT)
        edges = np.linspace(low, high if high > low else low + abs(low) * 1e-3 + 1e-9, _BARS + 1)
        inside = np.clip(values, edges[0], edges[-1])
        counts = [np.histogram(inside[known & chosen], edges)[0] for chosen in (success, ~success)]
        found.append(Histogram(name, figures[name]["unit"], edges, *(one.astype(np.float64) for one in counts)))
    return found


def scatters(campaign: Campaign, table: Table, sensitivity: Mapping[str, Any] | None) -> list[Scatter]:
    """Returns each figure against its strongest inputs, for the first `MOST_DOTS` runs."""
    if sensitivity is None:
        return []
    inputs = {one.name: one for one in campaign.drawn}
    success = table.numbers("success")[:MOST_DOTS] > 0
    found = []
    for figure, indices in sensitivity["figures"].items():
        if figure == "success":
            continue
        values = table.numbers(figure)[:MOST_DOTS]
        for index in indices[:STRONGEST]:
            one = inputs[index["input"]]
            x = table.numbers(one.name)[:MOST_DOTS]
            found.append(_scatter(figure, one, x, values, success))
    return found


def _scatter(figure: str, one: Input, x: Array, values: Array, success: NDArray[np.bool_]) -> Scatter:
    known = np.isfinite(x) & np.isfinite(values)
    order = np.argsort(x[known], kind="stable")
    return Scatter(figure, one.name, one.unit, x[known][order], values[known][order], success[known][order])
