"""The state of one flight over a link: its session, its telemetry and its counts."""

from __future__ import annotations

from collections.abc import Callable

from brickpilot.constants import STEP_MS
from brickpilot.hil.ends import Ends
from brickpilot.hil.fault_injection import FaultyLink, controller_restarts
from brickpilot.hil.plant_end import PlantEnd
from brickpilot.hil.telemetry import Telemetry
from brickpilot.hil.ticks import TickRecorder
from brickpilot.link.links import Link
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP, Session
from brickpilot.vehicle import flight

SEQUENCE_AT = 4
"""Place of the sequence number in MOTORS; the tick follows it."""

LOST = "the link was lost"
RESET = "the brick was reset: it restarted, or took an OPEN that this session has not sent"
"""Why a flight ends before its time."""

MISSION_ENDED = {2, 3}
"""The modes arrived and fault: only a reset leaves them."""

Progress = Callable[[int, int, str], None]
"""Takes (steps done, steps in all, text)."""


class LinkedFlight:
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
        self.session = Session(link, spec, self.take, reply_s, ends.clock)
        self.telemetry = Telemetry()
        self.step = 0
        self.late = 0
        self.without_reply = 0
        self.safe_stops = 0
        self.heartbeat: dict[str, int] = {}
        self.faults: dict[str, int] = {}
        self.board: dict[str, int] = {}
        self.motors = (0, 0)
        self.commanded_at = 0  # the step of the last motor command
        self.sent_sequence = 0
        self.expected = b""  # sequence number and tick of the reply
        self.started = False
        self._over_since = 0
        self.broke_off: str | None = None
        self.recorder = TickRecorder(plan.steps)
        by = book().by_name
        self._motors, self._reply = by["MOTORS"], by["MODE_REPLY"]
        self._reports = {by["HEARTBEAT"].id: "heartbeat", by["FAULTS"].id: "faults", by["BOARD"].id: "board"}

    def take(self, identifier: int, data: bytes) -> None:
        """Handles a message that is not the expected reply to a request."""
        self.session.resets.take(identifier, data)
        if self.telemetry.take(identifier, data, self.step, lockstep=self.lockstep):
            return
        if identifier == self._motors.id and not self.lockstep and self._motors.sealed(data):
            left, right, sequence, _, _ = self._motors.unpack(data)
            self.recorder.replied(sequence)
            if (self.sent_sequence - sequence) & 255 < 128:  # not from the future, and at most 127 sets old
                self.motors, self.commanded_at = (left, right), self.step
        elif identifier == self._reply.id and self._reply.sealed(data):
            self.started = self.started or data[1] == book().choices("MODE_COMMAND", "command")["start"]
        elif identifier in self._reports and len(data) == 8:
            layout = book().by_id[identifier]
            setattr(self, self._reports[identifier], dict(zip(layout.names, layout.unpack(data), strict=True)))

    def break_off(self, why: str, step: int) -> None:
        """Notes why the flight ends before its time, and since which step."""
        self.broke_off = f"{why}, {step * STEP_MS / 1e3:.3f} s into the flight"

    def break_off_if_reset(self) -> bool:
        """Ends the flight if the brick has restarted. Returns whether it has."""
        if self.session.resets.reset and self.broke_off is None:
            self.break_off(RESET, self.step)
            self.safe_stops += 1
        return self.session.resets.reset

    def begin_step(self) -> None:
        """Applies the faults that restart the brick, at the beginning of a step."""
        self.recorder.begin(self.step)
        self.faulty.step = self.step
        if self.plan.scenario.faults and controller_restarts(self.plan.scenario.faults, self.step):
            assert self.restart is not None
            self.restart()
            self.safe_stops += 1

    def over_for(self) -> int:
        """Returns for how many steps the brick has reported that the mission ended; call it once per step."""
        over = self.started and MISSION_ENDED & {self.telemetry.mode, self.heartbeat.get("mode", 0)}
        self._over_since = self._over_since if over else self.step
        return self.step - self._over_since

    def exchange(self, end: PlantEnd, tries: int, timeout: float) -> bool:
        """Sends the step's set until its reply comes, and takes the motor command. Returns False if none came."""
        for _ in range(tries):
            self.sent_sequence = self.session.next_sequence()
            self.expected = bytes((self.sent_sequence, end.tick_ms))
            self.recorder.sent(self.step, self.sent_sequence)
            self.link.send(end.messages(self.sent_sequence))
            data = self.session.wait(self._motors.id, self._is_reply, timeout)
            if data is not None:
                self.recorder.replied(self.sent_sequence)
                left, right, *_ = self._motors.unpack(data)
                self.motors = (left, right)
                return True
            self.without_reply += 1
        return False

    def _is_reply(self, data: bytes) -> bool:
        return self._motors.sealed(data) and data[SEQUENCE_AT : SEQUENCE_AT + 2] == self.expected

    def end_step(self) -> None:
        """Ends a step of the flight and goes on to the next."""
        self.count()
        self._show()
        self.step += 1

    def count(self) -> None:
        """Records the known faults until the end of the present step."""
        faults = self.faults
        refused = self.link.damaged + faults.get("bad", 0) + faults.get("stale", 0)
        lost = self.without_reply + faults.get("incomplete", 0) + faults.get("lost", 0)
        stops = self.safe_stops + self.heartbeat.get("aborted", 0)
        self.recorder.count(self.step, self.late + self.heartbeat.get("late_ticks", 0), lost, refused, stops)

    def _show(self) -> None:
        if self.step % 100 == 0:
            mode = ("idle", "run", "arrived", "fault")[self.telemetry.mode]
            text = f"{mode}, waypoint {self.telemetry.waypoint + 1}"
            self.progress(self.step, self.plan.steps, text)

    def lost_frames(self) -> int:
        at_brick = self.faults.get("bad", 0) + self.faults.get("incomplete", 0) + self.faults.get("lost", 0)
        return self.without_reply + self.link.damaged + at_brick
