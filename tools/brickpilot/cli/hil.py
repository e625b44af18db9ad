"""`brickpilot hil`."""

from __future__ import annotations

import dataclasses
import json
import shlex
import sys
from contextlib import ExitStack
from pathlib import Path

import click
from tqdm import tqdm

from brickpilot.cli.terminal import as_json, flight_options, settings_of
from brickpilot.errors import InputError, SimulationError


def _link_of(spec: str | None, target: str, lockstep: bool) -> str:
    """What `--link` and `--target` together mean to hil.ends."""
    from brickpilot.hil import ends

    if target == "host":
        if spec is None:
            raise InputError("is missing: which link?", field="--link")
        if spec.startswith(ends.INFRARED):
            raise InputError("carries no plant; `brickpilot upload` speaks to an RCX", field=f"--link {spec}")
        return spec
    if spec is not None:
        raise InputError("has a stream of its own: leave --link out", field=f"--target {target}")
    if not lockstep:
        raise InputError("runs in lockstep only: a simulator has no clock", field=f"--target {target}")
    return target


@click.command()
@flight_options
@click.option(
    "--link",
    "spec",
    metavar="LINK",
    help="serial:pty, tcp, can:slcan, can:virtual or can:udp_multicast start a brick here; serial:PORT, tcp:HOST:PORT, "
    "can:slcan:PORT and can:socketcan:CHANNEL meet one that is there.",
)
@click.option(
    "--target",
    type=click.Choice(["host", "h8sim", "h8sim:imu", "h8sim:rotation"]),
    default="host",
    help="What the brick is: a program of this machine (default), or the same firmware on a simulator of the RCX's "
    "processor, in lockstep and without --link; or there as it is built for an RCX with these sensors.",
)
@click.option(
    "--lockstep/--realtime", default=True, help="Simulated time, a step per answer (default); or the clock's."
)
@click.option(
    "--telemetry-every",
    type=click.IntRange(1, 255),
    metavar="N",
    help="The brick reports every N steps; default 1 in lockstep, 10 in real time.",
)
@click.option(
    "--set",
    "written",
    multiple=True,
    metavar="NAME=VALUE",
    help="Write this setting before the flight, raw; repeatable.",
)
@click.option("--settings", "list_settings", is_flag=True, help="Fly nothing: list the brick's settings, raw.")
@click.option(
    "--record", "record_file", metavar="FILE", help="Write the link's traffic: .asc, .blf or .log (candump's)."
)
@click.option("--replay", "replay_file", metavar="FILE", help="Send a recorded flight to the brick again, and compare.")
@click.option("--out", metavar="DIR", help="The run folder; default runs/hil-SCENARIO-PROFILE-SENSORS.")
@as_json
def hil(
    scenario_name: str | None,
    spec: str | None,
    target: str,
    lockstep: bool,
    scenario_file: str | None,
    profile: str | None,
    sensors: str | None,
    model_file: str | None,
    compensation_file: str | None,
    seed: int | None,
    telemetry_every: int | None,
    written: tuple[str, ...],
    list_settings: bool,
    record_file: str | None,
    replay_file: str | None,
    out: str | None,
    as_json: bool,
) -> None:
    """Flies SCENARIO with the plant at one end of a link and the controller at the other.

    Without SCENARIO the paper's eight waypoints are flown. In lockstep the motor commands are those of
    `brickpilot run`, bit for bit. The run folder holds log.csv, summary.json and report.html.
    """
    from brickpilot.hil import ends
    from brickpilot.hil import fly as hil_fly
    from brickpilot.hil.traffic_log import RecordingLink
    from brickpilot.link.session import LOCKSTEP, REALTIME
    from brickpilot.report import run_folder, run_page
    from brickpilot.vehicle import compensation, flight, model, scenario

    spec = _link_of(spec, target, lockstep)
    if replay_file is not None:
        _replay(spec, Path(replay_file), as_json)
        return
    if list_settings:
        _list_settings(spec, profile or "coupled", as_json)
        return
    settings = settings_of(written)
    if scenario_name is not None and scenario_file is not None:
        raise InputError("a scenario is given twice, as argument and as option", field="--scenario")
    asked = scenario_name or scenario_file or "mission"
    chosen = scenario.load(scenario.find(asked))
    vehicle = model.load(Path(model_file)) if model_file else model.rcx()
    told = compensation.load(Path(compensation_file)) if compensation_file else None
    plan = flight.plan(chosen, vehicle, profile=profile, sensors=sensors, seed=seed, compensation=told)
    ends.check_sensors(spec, plan.sensors)
    folder = Path(out) if out else Path("runs") / f"hil-{chosen.name}-{plan.controller}-{plan.sensors}"
    pace = LOCKSTEP if lockstep else REALTIME
    every = telemetry_every or (1 if lockstep else 10)
    command = ["brickpilot", "hil", asked, "--link", spec, f"--{pace}", "--profile", plan.controller]
    command += ["--sensors", plan.sensors, "--seed", str(plan.seed)]
    command += [word for pair in written for word in ("--set", pair)]
    command += ["--model", model_file] if model_file else []
    command += ["--compensation", compensation_file] if compensation_file else []
    quiet = as_json or not sys.stderr.isatty()
    hurried = not lockstep and ends.claim_priority()
    with (
        tqdm(total=plan.steps, disable=quiet, leave=False, bar_format="{desc} {bar} {percentage:3.0f}%") as bar,
        ends.both_ends(spec) as both,
        ExitStack() as closing,
    ):

        def show(done: int, _: int, text: str) -> None:
            bar.n = done
            bar.set_description_str(f"{done * flight.STEP_S:5.1f} s, {text}")

        if record_file:
            both = dataclasses.replace(both, link=RecordingLink(both.link, Path(record_file)))
            closing.callback(both.link.close)
        flown = hil_fly.fly(both, spec, plan, pace=pace, telemetry_every=every, progress=show, settings=settings)
    figures = flight.summary(flown.flight) | {
        "link": spec,
        "pace": pace,
        "realtime_priority": hurried,
        "late_ticks": flown.late_ticks,
        "lost_frames": flown.lost_frames,
        "safe_stops": flown.safe_stops,
        "broke_off": flown.broke_off,
    }
    page = run_page.page(flown.flight, figures, shlex.join(command))
    run_folder.write(flown.flight, figures, page, folder)
    if as_json:
        click.echo(json.dumps(figures))
    else:
        click.echo(
            f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints in order, {plan.controller}, "
            f"{plan.sensors}, {spec} in {pace}, {figures['times_real_time']:.1f} times real time\n"
            f"late ticks: {flown.late_ticks} of {figures['steps']}, lost frames: {flown.lost_frames}, "
            f"safe stops: {flown.safe_stops}\n"
            f"motor stream: {figures['motor_stream_sha256']}\nreport: {folder / 'report.html'}"
        )
        if not lockstep and not hurried:
            click.echo("note: the system grants no real-time priority (ulimit -r); other work makes ticks late")
    if flown.broke_off:
        raise SimulationError(f"{spec}: the link was lost: {flown.broke_off}; the motors were stopped")


def _list_settings(spec: str, profile: str, as_json: bool) -> None:
    from brickpilot.hil import ends
    from brickpilot.link.session import LOCKSTEP, Session

    with ends.both_ends(spec) as both:
        session = Session(both.link, spec)
        session.open(profile, LOCKSTEP)
        found = {name: session.read(name) for name in session.parameters()}
    if as_json:
        click.echo(json.dumps(found))
    else:
        click.echo("\n".join(f"{name:20}{value:12}" for name, value in found.items()))


def _replay(spec: str, file: Path, as_json: bool) -> None:
    from brickpilot.hil import ends, traffic_log

    with ends.both_ends(spec) as both:
        found = traffic_log.replay(both.link, spec, file)
    if as_json:
        click.echo(json.dumps({"link": spec, "replay": str(file), **dataclasses.asdict(found)}))
    else:
        click.echo(f"{found.steps} steps replayed, {found.differing} motor commands differ")
    if found.differing:
        raise SimulationError(f"{file}: the brick answers step {found.first} otherwise than was recorded")
