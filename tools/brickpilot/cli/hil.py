"""`brickpilot hil`."""

from __future__ import annotations

import dataclasses
import json
import shlex
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from brickpilot.cli.flight_request import FlightRequest, flight_options
from brickpilot.cli.terminal import as_json, settings_of
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError, SimulationError

if TYPE_CHECKING:
    from brickpilot.hil.fly import HilFlight
    from brickpilot.vehicle.flight import Plan


@click.command()
@flight_options
@click.option(
    "--link",
    "spec",
    metavar="LINK",
    help="serial:pty, tcp, can:slcan, can:virtual and can:udp_multicast start a brick on this machine. serial:PORT, "
    "tcp:HOST:PORT, can:slcan:PORT and can:socketcan:CHANNEL connect to a brick that runs already.",
)
@click.option(
    "--target",
    type=click.Choice(["host", "h8sim", "h8sim:imu", "h8sim:rotation"]),
    default="host",
    help="host (default): the brick is a program of this machine. h8sim: the same firmware on a simulator of the RCX's "
    "processor, in lockstep and without --link. h8sim:imu, h8sim:rotation: the firmware that is built for an RCX with "
    "these sensors.",
)
@click.option(
    "--lockstep/--realtime",
    default=True,
    help="Lockstep (default) simulates one step for each reply. Real time follows the clock.",
)
@click.option(
    "--telemetry-every",
    type=click.IntRange(1, 255),
    metavar="N",
    help="The brick sends telemetry every N steps; default 1 in lockstep, 10 in real time.",
)
@click.option(
    "--set",
    "written",
    multiple=True,
    metavar="NAME=VALUE",
    help="Write this raw value to a setting before the flight; repeatable.",
)
@click.option("--settings", "list_settings", is_flag=True, help="List the brick's settings as raw values; do not fly.")
@click.option(
    "--record", "record_file", metavar="FILE", help="Write the link's traffic to FILE: .asc, .blf or .log (candump's)."
)
@click.option(
    "--replay", "replay_file", metavar="FILE", help="Send the traffic of FILE to the brick again and compare."
)
@click.option("--out", metavar="DIR", help="The run folder to write; default runs/hil-SCENARIO-PROFILE-SENSORS.")
@as_json
def hil(
    request: FlightRequest,
    spec: str | None,
    target: str,
    lockstep: bool,
    telemetry_every: int | None,
    written: tuple[str, ...],
    list_settings: bool,
    record_file: str | None,
    replay_file: str | None,
    out: str | None,
    as_json: bool,
) -> None:
    """Flies SCENARIO with the plant at one end of a link and the controller at the other.

    Without SCENARIO it flies the paper's eight waypoints. In lockstep the motor commands equal those of
    `brickpilot run`, bit for bit. The run folder holds log.csv, summary.json and report.html.
    """
    spec = _link_of(spec, target, lockstep)
    if replay_file is not None:
        _replay(spec, Path(replay_file), as_json)
    elif list_settings:
        _list_settings(spec, request.profile or "coupled", as_json)
    else:
        every = telemetry_every or (1 if lockstep else 10)
        record = None if record_file is None else Path(record_file)
        _fly(request, _Session(spec, lockstep, every, written, record, as_json), out)


@dataclasses.dataclass(frozen=True)
class _Session:
    """The options that `hil` has beside those of a flight."""

    spec: str
    lockstep: bool
    telemetry_every: int
    written: tuple[str, ...]
    record: Path | None
    as_json: bool

    @property
    def pace(self) -> str:
        from brickpilot.link.session import LOCKSTEP, REALTIME

        return LOCKSTEP if self.lockstep else REALTIME


def _link_of(spec: str | None, target: str, lockstep: bool) -> str:
    """Returns what `--link` and `--target` together name for `hil.ends`."""
    from brickpilot.hil import ends

    if target == "host":
        if spec is None:
            raise InputError("is missing: name the link to the brick", field="--link")
        if spec.startswith(ends.INFRARED):
            raise InputError(
                "is too slow for a plant; `brickpilot upload` speaks to an RCX over it", field=f"--link {spec}"
            )
        return spec
    if spec is not None:
        raise InputError("has its own link: leave --link out", field=f"--target {target}")
    if not lockstep:
        raise InputError("runs in lockstep only, because a simulator has no clock", field=f"--target {target}")
    return target


def _fly(request: FlightRequest, session: _Session, out: str | None) -> None:
    """Flies the mission, writes its run folder and prints its figures."""
    from brickpilot.hil import ends
    from brickpilot.hil.h8_simulator import check_sensors
    from brickpilot.report import run_folder, run_page
    from brickpilot.vehicle import flight_figures

    settings = settings_of(session.written)
    plan = request.plan()
    check_sensors(session.spec, plan.sensors)
    folder = Path(out) if out else Path("runs") / f"hil-{plan.scenario.name}-{plan.controller}-{plan.sensors}"
    priority = not session.lockstep and ends.claim_priority()
    flown = _fly_over_the_link(plan, session, settings)
    figures = flight_figures.summary(flown.flight) | {
        "link": session.spec,
        "pace": session.pace,
        "realtime_priority": priority,
        "late_ticks": flown.late_ticks,
        "lost_frames": flown.lost_frames,
        "safe_stops": flown.safe_stops,
        "broke_off": flown.broke_off,
    }
    command = ["brickpilot", "hil", request.scenario, "--link", session.spec, f"--{session.pace}"]
    command += request.options(plan)
    command += [word for pair in session.written for word in ("--set", pair)]
    run_folder.write(flown.flight, figures, run_page.page(flown.flight, figures, shlex.join(command)), folder)
    if session.as_json:
        click.echo(json.dumps(figures))
    else:
        _print_flight(plan, figures, folder, lacks_priority=not session.lockstep and not priority)
    if flown.broke_off:
        raise SimulationError(f"{session.spec}: the link was lost: {flown.broke_off}; the motors were stopped")


def _fly_over_the_link(plan: Plan, session: _Session, settings: dict[str, int]) -> HilFlight:
    """Opens the link, flies `plan` over it with a progress bar, and records the traffic where that was asked for."""
    from brickpilot.hil import ends
    from brickpilot.hil import fly as hil_fly
    from brickpilot.hil.traffic_log import RecordingLink

    quiet = session.as_json or not sys.stderr.isatty()
    with (
        tqdm(total=plan.steps, disable=quiet, leave=False, bar_format="{desc} {bar} {percentage:3.0f}%") as bar,
        ends.both_ends(session.spec) as both,
        ExitStack() as closing,
    ):

        def show(done: int, _: int, text: str) -> None:
            bar.n = done
            bar.set_description_str(f"{done * STEP_S:5.1f} s, {text}")

        if session.record is not None:
            both = dataclasses.replace(both, link=RecordingLink(both.link, session.record))
            closing.callback(both.link.close)
        return hil_fly.fly(
            both,
            session.spec,
            plan,
            pace=session.pace,
            telemetry_every=session.telemetry_every,
            progress=show,
            settings=settings,
        )


def _print_flight(plan: Plan, figures: dict[str, Any], folder: Path, *, lacks_priority: bool) -> None:
    click.echo(
        f"{figures['waypoints_reached']} of {figures['waypoints_total']} waypoints reached in order, "
        f"{plan.controller}, {plan.sensors}, {figures['link']} in {figures['pace']}, "
        f"{figures['times_real_time']:.1f} times real time\n"
        f"late ticks: {figures['late_ticks']} of {figures['steps']}, lost frames: {figures['lost_frames']}, "
        f"safe stops: {figures['safe_stops']}\n"
        f"motor stream: {figures['motor_stream_sha256']}\nreport: {folder / 'report.html'}"
    )
    if lacks_priority:
        click.echo("note: the system grants no real-time priority (see ulimit -r), so other programs can delay ticks")


def _list_settings(spec: str, profile: str, as_json: bool) -> None:
    """Prints every setting of the brick."""
    from brickpilot.hil import ends
    from brickpilot.link.session import LOCKSTEP, Session
    from brickpilot.vehicle.settings import settings

    with ends.both_ends(spec) as both:
        session = Session(both.link, spec)
        session.open(profile, LOCKSTEP)
        found = {name: session.read(name) for name in session.parameters()}
    if as_json:
        click.echo(json.dumps(found))
    else:
        for name, value in found.items():
            row = settings()[name]
            click.echo(f"{name:20}{value:12}  {row.range}, {row.format.text}: {row.meaning}")


def _replay(spec: str, file: Path, as_json: bool) -> None:
    """Replays recorded traffic and ends with status 1 if a motor command differs."""
    from brickpilot.hil import ends, traffic_log

    with ends.both_ends(spec) as both:
        found = traffic_log.replay(both.link, spec, file)
    if as_json:
        click.echo(json.dumps({"link": spec, "replay": str(file), **dataclasses.asdict(found)}))
    else:
        click.echo(f"{found.steps} steps replayed, {found.differing} motor commands differ")
    if found.differing:
        raise SimulationError(f"{file}: the brick's motor command at step {found.first} differs from the recording")
