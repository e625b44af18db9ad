"""`brickpilot run`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.flight_request import FlightRequest, flight_options
from brickpilot.cli.terminal import as_json
from brickpilot.errors import InputError

if TYPE_CHECKING:
    from brickpilot.vehicle.flight import Plan


@click.command()
@flight_options
@click.option("--out", metavar="DIR", help="The run folder to write; default runs/SCENARIO-PROFILE-SENSORS.")
@as_json
def run(request: FlightRequest, out: str | None, as_json: bool) -> None:
    """Flies SCENARIO (a file, or one of: mission, fig4, fig5, forward_1m, spin_one_motor) in software-in-the-loop.

    Without SCENARIO it flies the paper's eight waypoints. The run folder holds log.csv, summary.json and report.html.
    """
    from brickpilot.report import run_folder, run_page
    from brickpilot.vehicle import flight, flight_figures

    plan = request.plan()
    chosen = plan.scenario
    if chosen.faults:
        raise InputError(
            "needs a link, and run has none; fly it with brickpilot hil", file=request.scenario, field="faults"
        )
    command = ["brickpilot", "run", request.scenario, *request.options(plan)]
    folder = Path(out) if out else Path("runs") / f"{chosen.name}-{plan.controller}-{plan.sensors}"
    flown = flight.fly(plan)
    figures = flight_figures.summary(flown)
    run_folder.write(flown, figures, run_page.page(flown, figures, shlex.join(command)), folder)
    if as_json:
        click.echo(json.dumps(figures))
        return
    if chosen.kind == "mission":
        _print_mission(plan, figures)
    else:
        click.echo(
            f"{chosen.title}: {figures['final_speed_m_s']:.3f} m/s, "
            f"{figures['final_yaw_rate_rad_s']:.3f} rad/s at the end"
        )
    click.echo(f"report: {folder / 'report.html'}")


def _print_mission(plan: Plan, figures: dict[str, Any]) -> None:
    """Prints a line for each waypoint and one for the whole mission."""
    approaches = zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True)
    for number, (moment, closest) in enumerate(approaches, 1):
        when = "not reached" if moment is None else f"reached at {moment:6.3f} s"
        click.echo(f"waypoint {number}: {when}, closest approach {closest:.3f} m")
    click.echo(
        f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached in order, "
        f"{plan.controller}, {plan.sensors}, "
        f"cross-track error {_metres(figures['cross_track_rms_m'])} rms, "
        f"error of the position estimate {_metres(figures['position_estimate_error_m'])} rms, "
        f"{figures['times_real_time']:.0f} times real time"
    )


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"
