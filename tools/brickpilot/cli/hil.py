"""`brickpilot hil`."""

from __future__ import annotations

import dataclasses
import json
import shlex
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from brickpilot.cli.completion import setting_names
from brickpilot.cli.flight_request import FlightRequest, flight_options
from brickpilot.cli.mission_lines import figure_lines, link_lines, waypoint_lines
from brickpilot.cli.settings import setting_lines
from brickpilot.cli.terminal import as_json, settings_of
from brickpilot.constants import STEP_S
from brickpilot.errors import InputError, SimulationError, WorkFailedError

if TYPE_CHECKING:
    from brickpilot.firmware.own_image import OwnImage
    from brickpilot.hil.fly import HilFlight
    from brickpilot.hil.linked_flight import Progress
    from brickpilot.link.links import Link
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
    type=click.Choice(
        ["host", "h8sim", "h8sim:imu", "h8sim:rotation", "avr:328p-imu", "avr:328p-rotation", "avr:2560"]
    ),
    default="host",
    help="host (default): the brick is a program of this machine. h8sim: the same firmware on a simulator of the RCX's "
    "processor, in lockstep and without --link. h8sim:imu, h8sim:rotation: the firmware that is built for an RCX with "
    "these sensors. avr:328p-imu, avr:328p-rotation, avr:2560: the image for an ATmega328P or ATmega2560 on simavr, "
    "which reads the plant's volts and edges at its pins and drives its motors, in simulated time.",
)
@click.option(
    "--image",
    "image_file",
    metavar="FILE.elf",
    help="Fly this image, which `brickpilot firmware` has made for an Arduino, on simavr: with the robot of --model, "
    "its mission, and the wiring of the folder's include/.",
)
@click.option(
    "--trace", "trace_file", metavar="FILE.vcd", help="With --target avr: write the signals at the pins to FILE (VCD)."
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
    help="The brick sends telemetry every N steps; default 1 in lockstep, 10 in real time and with --target avr.",
)
@click.option(
    "--set",
    "written",
    multiple=True,
    metavar="NAME=VALUE",
    shell_complete=setting_names,
    help="Write this raw value to a setting before the flight; repeatable.",
)
@click.option(
    "--settings",
    "list_settings",
    is_flag=True,
    help="List the settings of this brick; do not fly. `brickpilot settings` lists them without a brick.",
)
@click.option(
    "--record", "record_file", metavar="FILE", help="Write the link's traffic to FILE: .asc, .blf or .log (candump's)."
)
@click.option(
    "--replay", "replay_file", metavar="FILE", help="Send the traffic of FILE to the brick again and compare."
)
@click.option(
    "--junit",
    "junit_file",
    metavar="FILE",
    help="Write the checks of the flight as JUnit XML for Jenkins or GitLab: link, late ticks, controller, safe stops "
    "and each waypoint.",
)
@click.option("--out", metavar="DIR", help="The run folder to write; default runs/hil-SCENARIO-PROFILE-SENSORS.")
@as_json
def hil(
    request: FlightRequest,
    spec: str | None,
    target: str,
    image_file: str | None,
    trace_file: str | None,
    lockstep: bool,
    telemetry_every: int | None,
    written: tuple[str, ...],
    list_settings: bool,
    record_file: str | None,
    replay_file: str | None,
    junit_file: str | None,
    out: str | None,
    as_json: bool,
) -> None:
    """Flies SCENARIO with the plant at one end of a link and the controller at the other.

    Without SCENARIO it flies the paper's eight waypoints. In lockstep the motor commands equal those of
    `brickpilot run`, bit for bit, to the end of the scenario. A flight in real time ends a second after the mission.
    The run folder holds log.csv, ticks.csv, summary.json and report.html. A mission that was not flown, a fault, a
    safe stop and a lost link give one line and exit status 1.
    """
    own = None if image_file is None else _own_image(Path(image_file), request, target)
    target = target if own is None else own.target
    spec = _link_of(spec, target, lockstep)
    if target.startswith("avr:"):
        _check_avr(target, list_settings, replay_file)
    elif trace_file is not None:
        raise InputError("needs --target avr: only there are pins", field="--trace")
    if replay_file is not None:
        _replay(spec, Path(replay_file), as_json)
    elif list_settings:
        _list_settings(spec, request.profile or "coupled", as_json)
    else:
        every = telemetry_every or (1 if lockstep and not target.startswith("avr:") else 10)
        record = None if record_file is None else Path(record_file)
        junit = None if junit_file is None else Path(junit_file)
        trace = None if trace_file is None else Path(trace_file)
        _fly(request, _Session(spec, lockstep, every, written, record, junit, as_json, trace, own), out)


@dataclasses.dataclass(frozen=True)
class _Session:
    """The options that `hil` has beside those of a flight."""

    spec: str
    lockstep: bool
    telemetry_every: int
    written: tuple[str, ...]
    record: Path | None
    junit: Path | None
    as_json: bool
    trace: Path | None
    image: OwnImage | None

    @property
    def avr(self) -> bool:
        """Whether the brick is an AVR on simavr."""
        return self.spec.startswith("avr:")

    @property
    def simulated(self) -> bool:
        """Whether the brick is a simulated processor, which `--target` names."""
        return self.avr or self.spec.startswith("h8sim")

    @property
    def pace(self) -> str:
        from brickpilot.link.session import LOCKSTEP, REALTIME

        if self.avr:
            return "simulated time"
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


def _own_image(image: Path, request: FlightRequest, target: str) -> OwnImage:
    """Returns the image that --image names.

    Raises:
        InputError: it cannot be flown, or an option contradicts it.
    """
    from brickpilot.firmware import own_image

    if target != "host":
        raise InputError("has an image of its own: leave it or --image out", field=f"--target {target}")
    if request.model_file is None:
        raise InputError("needs --model: the robot that the image was made for", field="--image")
    for name, given in (("compensation", request.compensation_file), ("gains", request.gains_file)):
        if given is not None:
            raise InputError("has no place here: the image has its own", field=f"--{name}")
    if request.profile not in (None, "coupled"):
        raise InputError("the image has the profile coupled alone", field=f"--profile {request.profile}")
    return own_image.find(image)


def _plan(request: FlightRequest, session: _Session) -> Plan:
    """Returns the plan of the flight, for sensors that the brick can have."""
    from brickpilot.firmware import own_image
    from brickpilot.hil.avr_robot import check_avr_sensors
    from brickpilot.hil.h8_simulator import check_sensors

    if session.image is None:
        plan = request.plan()
        (check_avr_sensors if session.avr else check_sensors)(session.spec, plan.sensors)
        return plan
    request.choices()  # checks that the scenario is given once
    scenario = request.scenario_name or request.scenario_file
    assert request.model_file is not None
    return own_image.plan(session.image, Path(request.model_file), scenario, request.sensors, request.seed or 0)


def _check_avr(target: str, list_settings: bool, replay_file: str | None) -> None:
    """Raises InputError for options that an AVR on simavr does not have."""
    if list_settings:
        raise InputError("only flies; `brickpilot settings` lists the settings", field=f"--target {target}")
    if replay_file is not None:
        raise InputError("has sensors of its own, so no recorded readings can be replayed", field=f"--target {target}")


def _fly(request: FlightRequest, session: _Session, out: str | None) -> None:
    """Flies the mission, writes its run folder, prints its figures, and fails if the mission was not flown."""
    from brickpilot.hil import ends
    from brickpilot.report import junit, link_figures, run_folder, run_page
    from brickpilot.vehicle import flight_checks

    settings = settings_of(session.written)
    plan = _plan(request, session)
    folder = Path(out) if out else Path("runs") / f"hil-{plan.scenario.name}-{plan.controller}-{plan.sensors}"
    command = _command(request, session, plan)
    priority = not session.lockstep and ends.claim_priority()
    try:
        flown = (_fly_on_simavr if session.avr else _fly_over_the_link)(plan, session, settings)
    except (InputError, SimulationError) as error:
        _write_junit(session, junit.text_of_error(plan.scenario.name, str(error), command))
        raise
    figures = _figures(flown, session) | {"realtime_priority": priority}
    failure = figures["failure"] = flight_checks.failure(figures)
    ticks = flown.ticks.columns()
    page = run_page.page(
        flown.flight,
        figures,
        command,
        link_figures.shown(ticks, realtime=not session.lockstep, replies=not session.avr),
    )
    run_folder.write(flown.flight, figures, page, folder, ticks)
    _write_junit(session, junit.text(plan.scenario.name, flight_checks.checks(figures), command))
    if session.as_json:
        click.echo(json.dumps(figures))
    else:
        _print_flight(figures, folder, lacks_priority=not session.lockstep and not priority)
    if failure is not None:
        raise WorkFailedError(f"{session.spec}: {failure}")


def _command(request: FlightRequest, session: _Session, plan: Plan) -> str:
    """Returns the command line that repeats the flight."""
    simulated = ["--target", session.spec] if session.image is None else ["--image", str(session.image.path)]
    where = simulated if session.simulated else ["--link", session.spec, f"--{session.pace}"]
    own_mission = session.image is not None and request.scenario_name is None and request.scenario_file is None
    words = ["brickpilot", "hil", *([] if own_mission else [request.scenario]), *where]
    words += request.options(plan)
    return shlex.join(words + [word for pair in session.written for word in ("--set", pair)])


def _figures(flown: HilFlight, session: _Session) -> dict[str, Any]:
    """Returns the figures of the flight, and those of its link."""
    from brickpilot.hil import board
    from brickpilot.vehicle import flight_figures

    return flight_figures.summary(flown.flight) | {
        "link": session.spec,
        "pace": session.pace,
        "late_ticks": flown.late_ticks,
        "lost_frames": flown.lost_frames,
        "safe_stops": flown.safe_stops,
        "broke_off": flown.broke_off,
        "board": board.told(flown.board),
    }


def _write_junit(session: _Session, text: str) -> None:
    """Writes the JUnit file, where one was asked for."""
    from brickpilot.vehicle import whole_file

    if session.junit is None:
        return
    try:
        session.junit.parent.mkdir(parents=True, exist_ok=True)
        whole_file.write(session.junit, text)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=session.junit) from error


def _fly_over_the_link(plan: Plan, session: _Session, settings: dict[str, int]) -> HilFlight:
    """Opens the link, flies `plan` over it with a progress bar, and records the traffic where that was asked for."""
    from brickpilot.hil import ends
    from brickpilot.hil import fly as hil_fly
    from brickpilot.hil.traffic_log import RecordingLink

    with _progress(plan, session) as show, ends.both_ends(session.spec) as both, ExitStack() as closing:
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


@contextmanager
def _progress(plan: Plan, session: _Session) -> Iterator[Progress]:
    """Yields what shows the progress of a flight in a bar."""
    quiet = session.as_json or not sys.stderr.isatty()
    with tqdm(total=plan.steps, disable=quiet, leave=False, bar_format="{desc} {bar} {percentage:3.0f}%") as bar:

        def show(done: int, _: int, text: str) -> None:
            bar.n = done
            bar.set_description_str(f"{done * STEP_S:5.1f} s, {text}")

        yield show


def _fly_on_simavr(plan: Plan, session: _Session, settings: dict[str, int]) -> HilFlight:
    """Flies `plan` with an AVR as the brick, and records the traffic and the signals where that was asked for."""
    from brickpilot.hil import avr_flight
    from brickpilot.hil.avr_robot import avr_image
    from brickpilot.hil.traffic_log import RecordingLink

    with _progress(plan, session) as show, ExitStack() as closing:

        def wrap(link: Link) -> Link:
            if session.record is None:
                return link
            recording = RecordingLink(link, session.record)
            closing.callback(recording.close)
            return recording

        return avr_flight.fly(
            plan,
            session.spec,
            avr_image(session.spec) if session.image is None else session.image.path,
            telemetry_every=session.telemetry_every,
            progress=show,
            settings=settings,
            trace=session.trace,
            scales={} if session.image is None else session.image.scales,
            wrap=wrap,
        )


def _print_flight(figures: dict[str, Any], folder: Path, *, lacks_priority: bool) -> None:
    for line in (*waypoint_lines(figures), *figure_lines(figures), *link_lines(figures)):
        click.echo(line)
    click.echo(f"report: {folder / 'report.html'}")
    if lacks_priority:
        click.echo("note: the system grants no real-time priority (see ulimit -r), so other programs can delay ticks")


def _list_settings(spec: str, profile: str, as_json: bool) -> None:
    """Prints every setting of the brick."""
    from brickpilot.hil import ends
    from brickpilot.link.session import LOCKSTEP, Session

    with ends.both_ends(spec) as both:
        session = Session(both.link, spec)
        session.open(profile, LOCKSTEP)
        found = {name: session.read(name) for name in session.parameters()}
    if as_json:
        click.echo(json.dumps(found))
    else:
        for line in setting_lines(found, "now"):
            click.echo(line)


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
