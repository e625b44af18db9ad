"""Flies a mission over a link: in lockstep, a step for each answer, or in real time."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brickpilot.errors import InputError
from brickpilot.hil.ends import Ends
from brickpilot.hil.faults import FaultyLink, controller_restarts
from brickpilot.hil.plant_end import PlantEnd, open_plant
from brickpilot.hil.telemetry import STEP_MS, Telemetry
from brickpilot.link.links import Link, LinkGoneError
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP, REALTIME, NoAnswerError, Session
from brickpilot.vehicle import flight
from brickpilot.vehicle.settings import compensations
from brickpilot.vehicle.settings import settings as known_settings

TRIES = 4
"""In lockstep a set is sent so often before the link counts as lost."""

LOST_STEPS = 33
"""In real time: the motors stop when they have not been commanded for so many steps, 0.1 s."""

GIVE_UP_STEPS = 667
"""A flight whose link stays lost ends after so many steps, 2 s, with the motors off."""

SEQUENCE_AT = 4  # in MOTORS; the tick follows

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class HilFlight:
    """``broke_off``: why the flight ended before its time, or None. Counts are of the whole flight."""

    flight: flight.Flight
    late_ticks: int  # steps of either end that began more than a step late
    lost_frames: int  # answers that did not come, frames that were damaged or incomplete, as seen from both ends
    safe_stops: int  # times that either end stopped the motors for want of the other
    broke_off: str | None


class _Run:
    """What one flight accumulates."""

    def __init__(
        self, ends: Ends, spec: str, plan: flight.Plan, pace: str, answer_s: float, progress: Progress
    ) -> None:
        self.restart = ends.restart
        self.answer_s = answer_s
        self.faulty = FaultyLink(ends.link, plan.scenario.faults, plan.seed)
        self.link: Link = self.faulty if plan.scenario.faults else ends.link
        link = self.link
        self.plan = plan
        self.lockstep = pace == LOCKSTEP
        self.progress = progress
        self.session = Session(link, spec, self.take, answer_s)
        self.telemetry = Telemetry()
        self.step = 0
        self.late = 0
        self.unanswered = 0
        self.safe_stops = 0
        self.heartbeat: dict[str, int] = {}
        self.faults: dict[str, int] = {}
        self.motors = (0, 0)
        self.heard_at = 0  # the step in which the motors were commanded last
        self.sent_sequence = 0
        self.awaited = b""  # sequence and tick of the answer
        self.started = False
        self.broke_off: str | None = None
        by = book().by_name
        self._motors, self._reply = by["MOTORS"], by["MODE_REPLY"]
        self._reports = {by["HEARTBEAT"].id: "heartbeat", by["FAULTS"].id: "faults"}

    def take(self, identifier: int, data: bytes) -> None:
        """Anything that is not the answer to a request."""
        if self.telemetry.take(identifier, data, self.step, lockstep=self.lockstep):
            return
        if identifier == self._motors.id and not self.lockstep and self._motors.sealed(data):
            left, right, sequence, _, _ = self._motors.unpack(data)
            if (self.sent_sequence - sequence) & 255 < 128:  # not of a time to come, nor older than half a round
                self.motors, self.heard_at = (left, right), self.step
        elif identifier == self._reply.id and self._reply.sealed(data):
            self.started = self.started or data[1] == book().choices("MODE_COMMAND", "command")["start"]
        elif identifier in self._reports and len(data) == 8:
            layout = book().by_id[identifier]
            setattr(self, self._reports[identifier], dict(zip(layout.names, layout.unpack(data), strict=True)))

    def begin_step(self) -> None:
        """Faults of the ends, at the beginning of a step."""
        self.faulty.step = self.step
        if self.plan.scenario.faults and controller_restarts(self.plan.scenario.faults, self.step):
            assert self.restart is not None
            self.restart()
            self.safe_stops += 1

    def exchange(self, end: PlantEnd, tries: int, timeout: float) -> bool:
        """Sends the step's set until it is answered, and takes the answer; false: it was not."""
        for _ in range(tries):
            self.sent_sequence = self.session.next_sequence()
            self.awaited = bytes((self.sent_sequence, end.tick_ms))
            self.link.send(end.messages(self.sent_sequence))
            data = self.session.wait(self._motors.id, self._is_answer, timeout)
            if data is not None:
                left, right, *_ = self._motors.unpack(data)
                self.motors = (left, right)
                return True
            self.unanswered += 1
        return False

    def _is_answer(self, data: bytes) -> bool:
        return self._motors.sealed(data) and data[SEQUENCE_AT : SEQUENCE_AT + 2] == self.awaited

    def show(self) -> None:
        if self.step % 100 == 0:
            mode = ("idle", "run", "arrived", "fault")[self.telemetry.mode]
            text = f"{mode}, waypoint {self.telemetry.waypoint + 1}"
            self.progress(self.step, self.plan.steps, text)

    def lost_frames(self) -> int:
        seen = self.faults.get("bad", 0) + self.faults.get("incomplete", 0) + self.faults.get("lost", 0)
        return self.unanswered + self.link.damaged + seen


def prepare(
    session: Session, plan: flight.Plan, pace: str, telemetry_every: int | None, settings: Mapping[str, int]
) -> None:
    """Opens a session and tells the brick all that the flight needs: settings, what is known of the robot, the route.

    Raises:
        InputError: the brick refuses something.
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
            answered = run.exchange(end, *((TRIES, run.answer_s) if lost_since is None else (1, STEP_MS * 1e-3)))
        except (LinkGoneError, NoAnswerError) as error:
            run.broke_off = str(error)
            answered = False
        if answered:
            lost_since = None
        elif lost_since is None:
            lost_since = run.step
            run.safe_stops += 1
        if lost_since is not None:
            run.motors = (0, 0)
            if run.broke_off or run.step - lost_since >= GIVE_UP_STEPS:
                run.broke_off = f"{run.broke_off or 'no answer'}, {lost_since * STEP_MS / 1e3:.3f} s into the flight"
                _coast(run, end, lost_since + GIVE_UP_STEPS)
                return
        end.act(*run.motors)
        run.show()
        run.step += 1
    _drain(run)


def _coast(run: _Run, end: PlantEnd, until: int) -> None:
    """The robot without its brick, motors off; the sensors of the current step have been read."""
    while run.step < min(until, run.plan.steps):
        end.act(0, 0)
        run.step += 1
        if run.step < run.plan.steps:
            end.sense()


def _drain(run: _Run) -> None:
    """Takes what the brick still has to say of the last step."""
    last = run.step = run.step - 1
    until = time.monotonic() + 0.1
    with contextlib.suppress(LinkGoneError):  # the flight is over; what is missing of the log is held
        while run.telemetry.newest_step < last and (left := until - time.monotonic()) > 0:
            for frame in run.link.receive(left):
                run.take(*frame)
    run.step = last + 1


def _fly_realtime(run: _Run, end: PlantEnd) -> None:
    began = time.perf_counter()
    stopped = False
    while run.step < run.plan.steps:
        due = began + run.step * STEP_MS * 1e-3
        while (left := due - time.perf_counter()) > 0:
            for frame in run.link.receive(left):
                run.take(*frame)
        run.late += -left > STEP_MS * 1e-3
        run.begin_step()
        end.sense()
        run.sent_sequence = run.session.next_sequence()
        frames = end.messages(run.sent_sequence)
        if run.step >= run.plan.start_step and not run.started and (run.step - run.plan.start_step) % 20 == 0:
            frames.insert(0, run.session.command_message("start"))
        run.link.send(frames)
        silent = run.step - run.heard_at > LOST_STEPS
        run.safe_stops += silent and not stopped
        stopped = silent
        end.act(*((0, 0) if silent else run.motors))
        if run.step - run.heard_at > GIVE_UP_STEPS:
            run.broke_off = f"no answer, {run.heard_at * STEP_MS / 1e3:.3f} s into the flight"
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
    answer_s: float | None = None,
    settings: Mapping[str, int] = MappingProxyType({}),
) -> HilFlight:
    """Flies the plan with the brick at the other end of the link.

    Args:
        ends: the link, open.
        spec: the link as the user named it, for messages.
        plan: of a mission; the faults of its scenario act.
        pace: LOCKSTEP or REALTIME.
        telemetry_every: the brick reports every so many steps, 1..255; the log holds its last report in between.
        progress: called as (steps done, steps in all, text).
        settings: written before the flight, raw; they win over the plan's.
        answer_s: how long an answer may take, s of the clock, before the question is repeated; default the ends' own.

    Raises:
        InputError: no brick answers, or it refuses; or the plan is of a manoeuvre.
        SimulationError: the plant's state left every bound.
    """
    if plan.scenario.kind != "mission":
        raise InputError(
            "is a manoeuvre, in which no controller takes part; hil flies missions", field=plan.scenario.name
        )
    if ends.restart is None and any(
        fault.kind in ("controller_restart", "brown_out") for fault in plan.scenario.faults
    ):
        raise InputError("a brick that is not started here cannot be switched off and on", field=f"--link {spec}")
    run = _Run(ends, spec, plan, pace, ends.answer_s if answer_s is None else answer_s, progress)
    prepare(run.session, plan, pace, telemetry_every, settings)
    names = flight.log_names()
    log = np.zeros((plan.steps, len(names)))
    motors: NDArray[np.int16] = np.zeros((plan.steps, 2), dtype=np.int16)
    began = time.perf_counter()
    with open_plant(plan, log, motors) as end:
        try:
            (_fly_realtime if pace == REALTIME else _fly_lockstep)(run, end)
        except LinkGoneError as error:
            run.broke_off = f"{error}, {run.step * STEP_MS / 1e3:.3f} s into the flight"
            run.safe_stops += 1
            _coast(run, end, run.step + GIVE_UP_STEPS)
    elapsed = time.perf_counter() - began
    done = run.step
    columns = {name: np.ascontiguousarray(log[:done, index]) for index, name in enumerate(names)}
    columns |= run.telemetry.columns(done)
    columns["left_duty"], columns["right_duty"] = (motors[:done, side] / 32767.0 for side in (0, 1))
    flown = flight.Flight(dataclasses.replace(plan, steps=done), columns, motors[:done], done * flight.STEP_S / elapsed)
    return HilFlight(
        flown,
        late_ticks=run.late + run.heartbeat.get("late_ticks", 0),
        lost_frames=run.lost_frames() + run.session.repeated,
        safe_stops=run.safe_stops + run.heartbeat.get("aborted", 0),
        broke_off=run.broke_off,
    )
