"""`hil` and its arguments: a flight with the plant at one end of a link and the controller at the other end."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from brickpilot.errors import InputError, SimulationError
from brickpilot.firmware import simulate
from brickpilot.firmware.simulate import OwnImage
from brickpilot.hil import avr_flight, ends
from brickpilot.hil import fly as hil_fly
from brickpilot.hil.avr_flight import avr_image
from brickpilot.hil.ends import check_sensors
from brickpilot.hil.fly import HilFlight
from brickpilot.hil.linked_flight import Progress, Watch
from brickpilot.hil.traffic_log import recorded
from brickpilot.link.brick import INFRARED
from brickpilot.link.session import LOCKSTEP, REALTIME
from brickpilot.public.doors import FlightRequest, Made, command_line, seed_of, silent, whole
from brickpilot.report import flight_text, run_folder, run_page
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle.flight import Plan
from brickpilot.vehicle.settings import named


@dataclasses.dataclass(frozen=True)
class Session:
    """The arguments of `hil` that do not belong to the flight.

    Attributes:
        spec: the link or the simulated processor, as `link_of` returns it.
        telemetry_every: number of steps from one telemetry to the next; None: the default in `every`.
        settings: raw values to write before the flight.
        watch: called at the beginning of each control step.
    """

    spec: str
    lockstep: bool = True
    telemetry_every: int | None = None
    settings: Mapping[str, int] = dataclasses.field(default_factory=dict)
    record: Path | None = None
    junit: Path | None = None
    trace: Path | None = None
    image: OwnImage | None = None
    watch: Watch = lambda _run: None

    @property
    def avr(self) -> bool:
        """Whether the brick is an AVR on simavr."""
        return self.spec.startswith("avr:")

    @property
    def simulated(self) -> bool:
        """Whether the brick is a simulated processor, which `--target` names."""
        return self.avr or self.spec.startswith("h8sim")

    @property
    def every(self) -> int:
        """The number of steps from one telemetry to the next."""
        return self.telemetry_every or (1 if self.lockstep and not self.avr else 10)

    @property
    def pace(self) -> str:
        """What the flight waits for: the brick's replies, the clock, or the simulator of an AVR."""
        if self.avr:
            return "simulated time"
        return LOCKSTEP if self.lockstep else REALTIME


def link_of(spec: str | None, target: str, lockstep: bool) -> str:
    """Returns the link that the options choose, as `hil.ends` names it; InputError: --link and --target conflict."""
    if target == "host":
        if spec is None:
            raise InputError("is missing: name the link to the brick", field="--link")
        if spec.startswith(INFRARED):
            raise InputError(
                "is too slow for a plant; `brickpilot upload` speaks to an RCX over it", field=f"--link {spec}"
            )
        return spec
    if spec is not None:
        raise InputError("has its own link: leave --link out", field=f"--target {target}")
    if not lockstep:
        raise InputError("runs in lockstep only, because a simulator has no clock", field=f"--target {target}")
    return target


def image_of(image: Path, request: FlightRequest, target: str) -> OwnImage:
    """Returns the image that `--image` names.

    Raises:
        InputError: the image cannot be flown, or an option contradicts the image.
    """
    if target != "host":
        raise InputError("cannot be used with --image, which chooses the target", field=f"--target {target}")
    if request.model_file is None:
        raise InputError("needs --model: the robot that the image was made for", field="--image")
    for name, given in (("compensation", request.compensation_file), ("gains", request.gains_file)):
        if given is not None:
            raise InputError("cannot be used with --image, which has its own", field=f"--{name}")
    if request.profile not in (None, "coupled"):
        raise InputError("the image has the profile coupled alone", field=f"--profile {request.profile}")
    return simulate.find_image(image)


def _plan(request: FlightRequest, session: Session) -> Plan:
    """Returns the plan of the flight; raises InputError if the brick cannot have the plan's sensors."""
    if session.image is None:
        plan = flight.plan(request.scenario, **request.choices())
        check_sensors(session.spec, plan.sensors)
        return plan
    request.choices()  # checks that the scenario is given once
    scenario = request.scenario_name or request.scenario_file
    assert request.model_file is not None
    return simulate.image_plan(session.image, Path(request.model_file), scenario, request.sensors, request.seed or 0)


def hil(
    scenario: str | Path = "mission", *, link: str | None = None, target: str = "host", lockstep: bool = True,
    profile: str | None = None, sensors: str | None = None, model: str | Path | None = None,
    compensation: str | Path | None = None, gains: str | Path | None = None, seed: int = 0,
    settings: Mapping[str, int] | None = None, image: str | Path | None = None, trace: str | Path | None = None,
    record: str | Path | None = None, junit: str | Path | None = None, telemetry_every: int | None = None,
    out: str | Path | None = None, progress: Progress | None = None,
) -> Made:  # fmt: skip
    """Flies a scenario with the plant at one end of a link and the controller at the other, and writes its run folder.

    Args:
        scenario: the name or the file of the scenario.
        link: "serial:pty", "tcp", "can:virtual" and others start a brick on this machine; "serial:PORT" and others
            connect to a running brick; see `brickpilot hil --help`. None: `target` names a simulated processor.
        target: the processor of the brick: "host", "h8sim", "avr:328p-imu", ...
        lockstep: whether one step is simulated for each reply; if not, the simulation follows the clock.
        profile, sensors, model, compensation, gains: as in `brickpilot run`; the last three are files.
        seed: the seed of the sensors' noise, 0 or more.
        settings: setting -> raw value that is written before the flight.
        image: an Arduino's ELF file or an RCX's brickpilot.h8sim, made by `firmware` for the robot of `model`.
        trace, record, junit: files to write: the signals at the pins (VCD), the link's traffic, and the checks (JUnit
            XML).
        telemetry_every: number of steps from one telemetry to the next, 1..255; None: 10 in real time or with an AVR,
            else 1.
        out: the run folder; None: runs/hil-SCENARIO-PROFILE-SENSORS.
        progress: called with (steps done, all steps, text).

    Raises:
        InputError: an argument is wrong, or a link cannot be opened.
        SimulationError: the link is lost, or the plant diverges.
    """

    def path(file: str | Path | None) -> Path | None:
        return None if file is None else Path(file)

    request = FlightRequest(str(scenario), None, profile, sensors, model, compensation, gains, seed_of(seed))
    if telemetry_every is not None:
        whole("telemetry_every", telemetry_every, 1, 255)
    own = None if image is None else image_of(Path(image), request, target)
    spec = link_of(link, target if own is None else own.target, lockstep)
    for name, value in (settings or {}).items():
        named(name).check(value)
    written = settings or {}
    session = Session(spec, lockstep, telemetry_every, written, path(record), path(junit), path(trace), own)
    return fly_over(request, session, out, progress or silent)


def fly_over(request: FlightRequest, session: Session, out: str | Path | None, progress: Progress) -> Made:
    """Flies the requested flight and writes its run folder; see `hil`."""
    if session.trace is not None and not session.avr:
        raise InputError("needs --target avr, the only target with pins", field="--trace")
    plan = _plan(request, session)
    folder = Path(out) if out else Path("runs") / f"hil-{plan.scenario.name}-{plan.controller}-{plan.sensors}"
    command = _command(request, session, plan)
    priority = not session.lockstep and ends.claim_priority()
    try:
        flown = (_fly_on_simavr if session.avr else _fly_over_the_link)(plan, session, progress)
    except (InputError, SimulationError) as error:
        link = flight_figures.Check("link", None)
        _write_junit(session, flight_text.junit_text(plan.scenario.name, [link], command, str(error)))
        raise
    image = None if session.image is None else str(session.image.path)
    figures = flown.figures(session.spec, session.pace) | {"realtime_priority": priority, "image": image}
    failure = figures["failure"] = flight_figures.failure(figures)
    shown = run_page.link_figures(flown.ticks, realtime=not session.lockstep, replies=not session.avr)
    run_folder.write(flown.flight, figures, run_page.page(flown.flight, figures, command, shown), folder, flown.ticks)
    _write_junit(session, flight_text.junit_text(plan.scenario.name, flight_figures.checks(figures), command))
    return Made(folder, failure or f"{plan.scenario.title or plan.scenario.name} is flown", figures)


def _command(request: FlightRequest, session: Session, plan: Plan) -> str:
    """Returns the command line that repeats the flight."""
    where: dict[str, Any] = {"link": session.spec, session.pace: True}
    if session.simulated:
        where = {"target": session.spec} if session.image is None else {"image": session.image.path}
    own_mission = session.image is not None and request.scenario_name is None and request.scenario_file is None
    settings = [f"{name}={value}" for name, value in session.settings.items()]
    named = [] if own_mission else [request.scenario]
    return command_line("hil", *named, **where, **request.options(plan), settings=settings)


def _write_junit(session: Session, text: str) -> None:
    """Writes the JUnit file, if it was requested."""
    if session.junit is not None:
        run_folder.write_file(text, session.junit)


def _fly_over_the_link(plan: Plan, session: Session, progress: Progress) -> HilFlight:
    """Opens the link, flies `plan` over it, and records the traffic if a recording was requested."""
    image = None if session.image is None else session.image.path
    with ends.both_ends(session.spec, image=image) as both, recorded(both.link, session.record) as link:
        return hil_fly.fly(
            dataclasses.replace(both, link=link),
            session.spec,
            plan,
            pace=session.pace,
            telemetry_every=session.every,
            progress=progress,
            settings=dict(session.settings),
            watch=session.watch,
        )


def _fly_on_simavr(plan: Plan, session: Session, progress: Progress) -> HilFlight:
    """Flies `plan` with an AVR as the brick, and records traffic and signals if these recordings were requested."""
    return avr_flight.fly(
        plan,
        session.spec,
        avr_image(session.spec) if session.image is None else session.image.path,
        telemetry_every=session.every,
        progress=progress,
        settings=dict(session.settings),
        trace=session.trace,
        scales={} if session.image is None else session.image.scales,
        record=session.record,
        watch=session.watch,
    )
