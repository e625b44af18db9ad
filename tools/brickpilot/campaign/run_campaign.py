"""Runs a campaign in a folder, computes the plots of its page, and flies single runs again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign import designs, runs
from brickpilot.campaign.file import Campaign
from brickpilot.campaign.inputs import Value
from brickpilot.campaign.run_parts import PartProgress, Workers, run_parts
from brickpilot.campaign.store import Parts
from brickpilot.campaign.summary import Table, summary
from brickpilot.data.whole_files import write_whole
from brickpilot.errors import InputError
from brickpilot.report import campaign_page
from brickpilot.report.campaign_page import Histogram, Scatter
from brickpilot.vehicle import flight, flight_figures

Array = NDArray[np.float64]

TABLE, SUMMARY, PAGE = "runs.parquet", "summary.json", "report.html"


def run_campaign(
    campaign: Campaign, folder: Path, workers: Workers, show: Callable[[int, int, str], None], command: str
) -> dict[str, Any]:
    """Flies the runs that `folder` does not hold yet, writes its files, and returns the content of `summary.json`.

    Args:
        show: called with (parts done, all parts, text).
        command: the command line that runs this campaign; with `--replay` it flies one run again.

    Raises:
        InputError: the folder holds another campaign, or the workers cannot be reached.
        WorkFailedError: the disk is full, or all workers have ended. Finished parts stay, so the same command resumes.
    """
    keys = [part.key for part in runs.parts(campaign)]
    identity = {"campaign": campaign.identity(), "runs": campaign.runs, "design": designs.made_by(campaign)}
    with Parts(folder, identity) as parts:
        done = parts.done()
        left = (part for part in runs.parts(campaign) if part.key not in done)
        what = f"parts of {runs.part_size(campaign)} runs or fewer"
        progress = PartProgress(show, total=len(keys), done=len(done), what=what)
        if len(done) < len(keys):
            run_parts(
                runs.fly, left, keep=lambda part, rows: parts.write(part.key, rows), workers=workers, progress=progress
            )
        parts.merge(keys, folder / TABLE)
        table = Table(folder / TABLE)
        results = summary(campaign, table)
        write_whole(folder / SUMMARY, json.dumps(results, indent=2, allow_nan=False) + "\n")
        plots = histograms(table, results["figures"]), scatters(campaign, table, results["sensitivity"])
        write_whole(folder / PAGE, campaign_page.page(results, *plots, command))
    return results


@dataclass(frozen=True)
class Replayed:
    """A run that was flown again.

    Attributes:
        inputs: name -> the value that was drawn for the run or for its robot; None: the robot lacks this value.
        figures: the figures of `brickpilot run --json`, or of `hil --json` if the run has faults.
        ticks: the columns of ticks.csv; None: the run has no link.
    """

    inputs: dict[str, Value | None]
    flight: flight.Flight
    figures: dict[str, Any]
    ticks: dict[str, Array] | None


def replay(campaign: Campaign, index: int) -> Replayed:
    """Flies run `index` again; the motor commands are the same to the last bit.

    Raises:
        InputError: the campaign has no such run.
        SimulationError: the plant diverges, as it did in the campaign.
    """
    if not 0 <= index < campaign.runs:
        raise InputError(f"the campaign has the runs 0 to {campaign.runs - 1}", field=f"--replay {index}")
    run = runs.single_run(campaign, index)
    ticks = None
    if run.plan.scenario.faults:
        from brickpilot.hil import fly  # needs more libraries than a flight without a link

        linked = fly.fly_alone(run.plan)
        flown, figures, ticks = linked.flight, linked.figures(fly.MEMORY, "lockstep"), linked.ticks
    else:
        flown = flight.fly(run.plan)
        figures = flight_figures.summary(flown)
    figures["failure"] = flight_figures.failure(figures)
    return Replayed(dict(run.drawn) | runs.of_robot(campaign, run), flown, figures, ticks)


SHOWN = (
    "cross_track_rms_m", "closest_approach_max_m", "position_estimate_error_m", "heading_rms_rad", "time_s", "charge_c",
)  # fmt: skip
"""The figures whose distribution the page draws."""

MOST_DOTS = 1500
"""Largest number of runs in a scatter plot; more points would overlap and take long to draw."""

STRONGEST = 3
"""Each figure is drawn against this number of inputs: those on which the figure depends most."""

_DRAWN_OUT = (0.001, 0.999)  # the quantiles at which a histogram ends; its end bars count the runs beyond them
_BARS = 40


def histograms(table: Table, figures: Mapping[str, Mapping[str, Any]]) -> list[Histogram]:
    """Returns the distributions of the runs' figures, separately for success and failure."""
    success = table.numbers("success") > 0
    plots = []
    for name in SHOWN:
        values = table.numbers(name)
        known = np.isfinite(values)
        if known.sum() < 2:
            continue
        low, high = np.quantile(values[known], _DRAWN_OUT)
        edges = np.linspace(low, high if high > low else low + abs(low) * 1e-3 + 1e-9, _BARS + 1)
        inside = np.clip(values, edges[0], edges[-1])
        counts = (np.histogram(inside[known & chosen], edges)[0].astype(np.float64) for chosen in (success, ~success))
        plots.append(Histogram(name, figures[name]["unit"], edges, *counts))
    return plots


def scatters(campaign: Campaign, table: Table, sensitivity: Mapping[str, Any] | None) -> list[Scatter]:
    """Returns plots of each figure against its strongest inputs, for the first `MOST_DOTS` runs."""
    if sensitivity is None:
        return []
    units = {input_.name: input_.unit for input_ in campaign.drawn}
    success = table.numbers("success")[:MOST_DOTS] > 0
    plots = []
    for figure, indices in sensitivity["figures"].items():
        if figure == "success":
            continue
        y = table.numbers(figure)[:MOST_DOTS]
        for name in [index["input"] for index in indices[:STRONGEST]]:
            x = table.numbers(name)[:MOST_DOTS]
            order = np.argsort(x, kind="stable")
            order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
            plots.append(Scatter(figure, name, units[name], x[order], y[order], success[order]))
    return plots
