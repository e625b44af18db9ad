"""Flies a mission over a link: in lockstep, one step for each reply, or in real time."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import SILENT_S, STEP_MS, STEP_S
from brickpilot.errors import InputError
from brickpilot.hil.ends import Ends
from brickpilot.hil.faults import FaultyLink, controller_restarts
from brickpilot.hil.plant_end import PlantEnd, open_plant
from brickpilot.hil.telemetry import Telemetry
from brickpilot.link.links import Link, LinkGoneError
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP, REALTIME, NoReplyError, Session
from brickpilot.vehicle import flight
from brickpilot.vehicle.settings import compensations
from brickpilot.vehicle.settings import settings as known_settings

TRIES = 4
"""In lockstep, the link is lost when a set was sent so often without a reply."""

LOST_STEPS = int(SILENT_S / STEP_S)
"""In real time, the motors stop after so many steps without a motor command."""

GIVE_UP_STEPS = round(2.0 / STEP_S)
"""A flight ends after so many steps without its link, with the motors off."""

SEQUENCE_AT = 4  # in MOTORS; the tick follows

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class HilFlight:
    """A flight over a link.

    Attributes:
        flight: the log and the motor commands.
        late_ticks: steps of either end that began more than a step late.
        lost_frames: missing replies, and frames that were damaged or incomplete, at both ends.
        safe_stops: times that either end stopped the motors because the other was silent.
        broke_off: the reason why the flight ended early, or None.
    """

    flight: flight.Flight
    late_ticks: int
    lost_frames: int
    safe_stops: int
    broke_off: str | None


class _Run:
    """The state of one flight over a link."""

    def __init__(self, ends: Ends, spec: str, plan: flight.Plan, pace: str, reply_s: float, progress: Progress) -> None:
        self.restart = ends.restart
        self.reply_s = reply_s
        self.faulty = FaultyLink(ends.link, plan.scenario.faults, plan.seed)
        self.link: Link = self.faulty if plan.scenario.faults else ends.link
        link = self.link
        self.plan = plan
        self.lockstep = pace == LOCKSTEP
        self.progress = progress
        self.session = Session(link, spec, self.take, reply_s)
        self.telemetry = Telemetry()
        self.step = 0
        self.late = 0
        self.without_reply = 0
        self.safe_stops = 0
        self.heartbeat: dict[str, int] = {}
        self.faults: dict[str, int] = {}
        self.motors = (0, 0)
        self.commanded_at = 0  # the step of the last motor command
        self.sent_sequence = 0
        self.expected = b""  # sequence number and tick of the reply
        self.started = False
        self.broke_off: str | None = None
        by = book().by_name
        self._motors, self._reply = by["MOTORS"], by["MODE_REPLY"]
        self._reports = {by["HEARTBEAT"].id: "heartbeat", by["FAULTS"].id: "faults"}

    def take(self, identifier: int, data: bytes) -> None:
        """Takes a message that is not the expected reply to a request."""
        if self.telemetry.take(identifier, data, self.step, lockstep=self.lockstep):
            return
        if identifier == self._motors.id and not self.lockstep and self._motors.sealed(data):
            left, right, sequence, _, _ = self._motors.unpack(data)
            if (self.sent_sequence - sequence) & 255 < 128:  # neither from the future nor more than 127 sets old
                self.motors, self.commanded_at = (left, right), self.step
        elif identifier == self._reply.id and self._reply.sealed(data):
            self.started = self.started or data[1] == book().choices("MODE_COMMAND", "command")["start"]
        elif identifier in self._reports and len(data) == 8:
            layout = book().by_id[identifier]
            setattr(self, self._reports[identifier], dict(zip(layout.names, layout.unpack(data), strict=True)))

    def begin_step(self) -> None:
        """Applies the faults that restart the brick, at the beginning of a step."""
        self.faulty.step = self.step
        if self.plan.scenario.faults and controller_restarts(self.plan.scenario.faults, self.step):
            assert self.restart is not None
            self.restart()
            self.safe_stops += 1

    def exchange(self, end: PlantEnd, tries: int, timeout: float) -> bool:
        """Sends the step's set until its reply comes, and takes the motor command. Returns False if none came."""
        for _ in range(tries):
            self.sent_sequence = self.session.next_sequence()
            self.expected = bytes((self.sent_sequence, end.tick_ms))
            self.link.send(end.messages(self.sent_sequence))
            data = self.session.wait(self._motors.id, self._is_reply, timeout)
            if data is not None:
                left, right, *_ = self._motors.unpack(data)
                self.motors = (left, right)
                return True
            self.without_reply += 1
        return False

    def _is_reply(self, data: bytes) -> bool:
        return self._motors.sealed(data) and data[SEQUENCE_AT : SEQUENCE_AT + 2] == self.expected

    def show(self) -> None:
        if self.step % 100 == 0:
            mode = ("idle", "run", "arrived", "fault")[self.telemetry.mode]
            text = f"{mode}, waypoint {self.telemetry.waypoint + 1}"
            self.progress(self.step, self.plan.steps, text)

    def lost_frames(self) -> int:
        at_brick = self.faults.get("bad", 0) + self.faults.get("incomplete", 0) + self.faults.get("lost", 0)
        return self.without_reply + self.link.damaged + at_brick


def prepare(
    session: Session, plan: flight.Plan, pace: str, telemetry_every: int | None, settings: Mapping[str, int]
) -> None:
    """Opens a session and sends all that the flight needs: settings, compensation and route.

    Raises:
        InputError: the brick refuses one of them.
    """
    session.open(plan.controller, pace)
    if telemetry_every is not None:
        session.write("telemetry_every", telemetry_every)
    if plan.cruise > 0:
        session.write("cruise", known_settings()["cruise"].raw(plan.cruise))
    if plan.compensation is not None:
        for key, raw in plan.compensation.raw.items():
            session.write(compensations()[key].name, raw)
    for name, raw in settings.items():
        session.write(name, raw)
    session.upload([(round(x * 1e3), round(y * 1e3)) for x, y in plan.scenario.waypoints])


def _fly_lockstep(run: _Run, end: PlantEnd) -> None:
    lost_since: int | None = None
    while run.step < run.plan.steps:
        run.begin_step()
        end.sense()
        try:
            if run.step == run.plan.start_step:
                run.session.command("start")
            replied = run.exchange(end, *((TRIES, run.reply_s) if lost_since is None else (1, STEP_MS * 1e-3)))
        except (LinkGoneError, NoReplyError) as error:
            run.broke_off = str(error)
            replied = False
        if replied:
            lost_since = None
        elif lost_since is None:
            lost_since = run.step
            run.safe_stops += 1
        if lost_since is not None:
            run.motors = (0, 0)
            if run.broke_off or run.step - lost_since >= GIVE_UP_STEPS:
                run.broke_off = f"{run.broke_off or 'no reply'}, {lost_since * STEP_MS / 1e3:.3f} s into the flight"
                _coast(run, end, lost_since + GIVE_UP_STEPS)
                return
        end.act(*run.motors)
        run.show()
        run.step += 1
    _drain(run)


def _coast(run: _Run, end: PlantEnd, until: int) -> None:
    """Simulates the robot with its motors off. The sensors of the present step were read already."""
    while run.step < min(until, run.plan.steps):
        end.act(0, 0)
        run.step += 1
        if run.step < run.plan.steps:
            end.sense()


def _drain(run: _Run) -> None:
    """Waits for the telemetry of the last step."""
    last = run.step = run.step - 1
    until = time.monotonic() + 0.1
    with contextlib.suppress(LinkGoneError):  # the flight is over, and the log repeats the last report
        while run.telemetry.newest_step < last and (left := until - time.monotonic()) > 0:
            for message in run.link.receive(left):
                run.take(*message)
    run.step = last + 1


def _fly_realtime(run: _Run, end: PlantEnd) -> None:
    began = time.perf_counter()
    stopped = False
    while run.step < run.plan.steps:
        due = began + run.step * STEP_MS * 1e-3
        while (left := due - time.perf_counter()) > 0:
            for message in run.link.receive(left):
                run.take(*message)
        run.late += -left > STEP_MS * 1e-3
        run.begin_step()
        end.sense()
        run.sent_sequence = run.session.next_sequence()
        messages = end.messages(run.sent_sequence)
        if run.step >= run.plan.start_step and not run.started and (run.step - run.plan.start_step) % 20 == 0:
            messages.insert(0, run.session.command_message("start"))
        run.link.send(messages)
        silent = run.step - run.commanded_at > LOST_STEPS
        run.safe_stops += silent and not stopped
        stopped = silent
        end.act(*((0, 0) if silent else run.motors))
        if run.step - run.commanded_at > GIVE_UP_STEPS:
            run.broke_off = f"no reply, {run.commanded_at * STEP_MS / 1e3:.3f} s into the flight"
            run.step += 1
            return
        run.show()
        run.step += 1


def fly(
    ends: Ends,
    spec: str,
    plan: flight.Plan,
    *,
    pace: str,
    telemetry_every: int,
    progress: Progress,
    reply_s: float | None = None,
    settings: Mapping[str, int] = MappingProxyType({}),
) -> HilFlight:
    """Flies the plan with the brick at the other end of the link.

    Args:
        ends: the open link.
        spec: the link as the user named it, for error messages.
        plan: the plan of a mission; the faults of its scenario act.
        pace: LOCKSTEP or REALTIME.
        telemetry_every: the brick sends telemetry every so many steps, 1..255; the log repeats it in between.
        progress: called with (steps done, steps in all, text).
        settings: raw values that are written before the flight; they override the plan's.
        reply_s: time for a reply, s of the clock, before the set is sent again; default: that of `ends`.

    Raises:
        InputError: no brick replies, or it refuses something, or the plan is of a manoeuvre.
        SimulationError: the plant's state diverges.
    """
    _check_plan(ends, spec, plan)
    run = _Run(ends, spec, plan, pace, ends.reply_s if reply_s is None else reply_s, progress)
    prepare(run.session, plan, pace, telemetry_every, settings)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors: NDArray[np.int16] = np.zeros((plan.steps, 2), dtype=np.int16)
    began = time.perf_counter()
    with open_plant(plan, log, motors) as end:
        try:
            (_fly_realtime if pace == REALTIME else _fly_lockstep)(run, end)
        except LinkGoneError as error:
            run.broke_off = f"{error}, {run.step * STEP_MS / 1e3:.3f} s into the flight"
            run.safe_stops += 1
            _coast(run, end, run.step + GIVE_UP_STEPS)
    return _flown(run, log, motors, time.perf_counter() - began)


def _check_plan(ends: Ends, spec: str, plan: flight.Plan) -> None:
    """Raises InputError if the plan cannot be flown over this link."""
    if plan.scenario.kind != "mission":
        raise InputError("is a manoeuvre, which needs no controller; hil flies missions", field=plan.scenario.name)
    restarts = any(fault.kind in ("controller_restart", "brown_out") for fault in plan.scenario.faults)
    if restarts and ends.restart is None:
        raise InputError(
            "has a brick that was not started here, and so cannot be switched off and on", field=f"--link {spec}"
        )


def _flown(run: _Run, log: NDArray[np.float64], motors: NDArray[np.int16], elapsed_s: float) -> HilFlight:
    """Returns the flight as far as it went: the plant's log with the columns that telemetry gives, and the counts."""
    done = run.step
    columns = {name: np.ascontiguousarray(log[:done, index]) for index, name in enumerate(flight.log_names())}
    columns |= run.telemetry.columns(done)
    columns["left_duty"], columns["right_duty"] = (motors[:done, side] / 32767.0 for side in (0, 1))
    plan = dataclasses.replace(run.plan, steps=done)
    return HilFlight(
        flight.Flight(plan, columns, motors[:done], done * STEP_S / elapsed_s),
        late_ticks=run.late + run.heartbeat.get("late_ticks", 0),
        lost_frames=run.lost_frames() + run.session.repeated,
        safe_stops=run.safe_stops + run.heartbeat.get("aborted", 0),
        broke_off=run.broke_off,
    )
