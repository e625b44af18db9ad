"""`brickpilot run`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import click

from brickpilot.cli.terminal import as_json, flight_options
from brickpilot.errors import InputError


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"


@click.command()
@flight_options
@click.option("--out", metavar="DIR", help="The run folder; default runs/SCENARIO-PROFILE-SENSORS.")
@as_json
def run(
    scenario_name: str | None,
    scenario_file: str | None,
    profile: str | None,
    sensors: str | None,
    model_file: str | None,
    compensation_file: str | None,
    seed: int | None,
    out: str | None,
    as_json: bool,
) -> None:
    """Flies SCENARIO (a file, or one of: mission, fig4, fig5, forward_1m, spin_one_motor) in software-in-the-loop.

    Without SCENARIO the paper's eight waypoints are flown. The run folder holds log.csv, summary.json and report.html.
    """
    from brickpilot.report import run_folder, run_page
    from brickpilot.vehicle import compensation, flight, model, scenario

    if scenario_name is not None and scenario_file is not None:
        raise InputError("a scenario is given twice, as argument and as option", field="--scenario")
    asked = scenario_file if scenario_name is None else scenario_name
    asked = "mission" if asked is None else asked
    chosen = scenario.load(scenario.find(asked))
    vehicle = model.load(Path(model_file)) if model_file else model.rcx()
    told = compensation.load(Path(compensation_file)) if compensation_file else None
    plan = flight.plan(chosen, vehicle, profile=profile, sensors=sensors, seed=seed, compensation=told)
    command = [
        "brickpilot",
        "run",
        asked,
        "--profile",
        plan.controller,
        "--sensors",
        plan.sensors,
        "--seed",
        str(plan.seed),
    ]
    command += ["--model", model_file] if model_file else []
    command += ["--compensation", compensation_file] if compensation_file else []
    if chosen.faults:
        raise InputError("act on a link, and run has none: brickpilot hil flies them", file=asked, field="faults")
    folder = Path(out) if out else Path("runs") / f"{chosen.name}-{plan.controller}-{plan.sensors}"
    flown = flight.fly(plan)
    figures = flight.summary(flown)
    run_folder.write(flown, figures, run_page.page(flown, figures, shlex.join(command)), folder)
    if as_json:
        click.echo(json.dumps(figures))
    elif chosen.kind == "mission":
        for number, (moment, closest) in enumerate(
            zip(figures["reached_at_s"], figures["closest_approach_m"], strict=True), 1
        ):
            when = "not reached" if moment is None else f"reached at {moment:6.3f} s"
            click.echo(f"waypoint {number}: {when}, closest approach {closest:.3f} m")
        click.echo(
            f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints in order, "
            f"{plan.controller}, {plan.sensors}, "
            f"cross-track error {_metres(figures['cross_track_rms_m'])} rms, "
            f"position known to {_metres(figures['position_estimate_error_m'])} rms, "
            f"{figures['times_real_time']:.0f} times real time"
        )
    else:
        click.echo(
            f"{chosen.title}: {figures['final_speed_m_s']:.3f} m/s, "
            f"{figures['final_yaw_rate_rad_s']:.3f} rad/s at the end"
        )
    if not as_json:
        click.echo(f"report: {folder / 'report.html'}")
