"""`brickpilot run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brickpilot.cli.terminal import as_json, flight_options, show
from brickpilot.errors import WorkFailedError
from brickpilot.report.flight_text import figure_lines, waypoint_lines

if TYPE_CHECKING:
    from brickpilot.public.doors import FlightRequest


@click.command(short_help="Flies a mission or a manoeuvre in simulation.")
@flight_options
@click.option("--out", metavar="DIR", help="The run folder to write; default runs/SCENARIO-PROFILE-SENSORS.")
@as_json
def run(request: FlightRequest, out: str | None, as_json: bool) -> None:
    """Flies SCENARIO (a file, or one of: mission, fig4, fig5, forward_1m, spin_one_motor) in software-in-the-loop.

    Without SCENARIO it flies the paper's eight waypoints. The run folder holds log.csv, summary.json and report.html.
    If a mission missed a waypoint or ended with a fault, one line says so and the exit status is 1.
    """
    from brickpilot.public.doors import command_line
    from brickpilot.report import run_folder, run_page
    from brickpilot.vehicle import flight_figures

    flown = flight_figures.fly(request.scenario, **request.choices())
    figures, plan = flown.figures, flown.flight.plan
    chosen = plan.scenario
    command = command_line("run", request.scenario, **request.options(plan))
    folder = Path(out) if out else Path("runs") / f"{chosen.name}-{plan.controller}-{plan.sensors}"
    run_folder.write(flown.flight, figures, run_page.page(flown.flight, figures, command), folder)
    show(figures, [*_lines(chosen.title, figures), f"report: {folder / 'report.html'}"], as_json=as_json)
    if flown.failure is not None:
        raise WorkFailedError(f"{chosen.name}: {flown.failure}")


def _lines(title: str, figures: dict[str, Any]) -> list[str]:
    """Returns the printed lines of a mission, or the motion at the end of a manoeuvre."""
    if "waypoints_total" in figures:
        return [*waypoint_lines(figures), *figure_lines(figures)]
    return [f"{title}: {figures['final_speed_m_s']:.3f} m/s, {figures['final_yaw_rate_rad_s']:.3f} rad/s at the end"]
