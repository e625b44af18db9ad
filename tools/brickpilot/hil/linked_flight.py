"""The state of one flight over a link: its session, its telemetry, its ticks and its counts."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import STEP_MS, STEP_S
from brickpilot.hil.ends import Ends
from brickpilot.hil.plant_end import FaultyLink, PlantEnd, controller_restarts
from brickpilot.link.links import Link, Message
from brickpilot.link.messages import SIZE, book
from brickpilot.link.session import LOCKSTEP, Session
from brickpilot.vehicle import flight

Array = NDArray[np.float64]

LOST = "the link was lost"
RESET = "the brick was reset: it restarted, or took an OPEN that this session has not sent"
"""The reasons why a flight ends early."""

START_EVERY = 20
"""Number of steps without a reply after which the command to start is sent again."""

RUNS = 1
"""Number of the mode "run", in which the motors drive."""

MISSION_ENDED = {2, 3}
"""Numbers of the modes "arrived" and "fault", which only a reset can end."""

Progress = Callable[[int, int, str], None]
"""Called with (steps done, all steps, text)."""

Watch = Callable[["LinkedFlight"], None]
"""Called at the beginning of each control step; may send messages, and may end the flight by `LinkedFlight.end_in`."""


class LinkedFlight:
    """The state of one flight over a link."""

    def __init__(self, ends: Ends, spec: str, plan: flight.Plan, pace: str, progress: Progress, watch: Watch) -> None:
        self.restart = ends.restart
        self.faulty = FaultyLink(ends.link, plan.scenario.faults, plan.seed)
        self.link: Link = self.faulty if plan.scenario.faults else ends.link
        self.plan = plan
        self.lockstep = pace == LOCKSTEP
        self.progress = progress
        self.watch = watch
        self.session = Session(self.link, spec, self.take, ends.reply_s, ends.clock)
        self.telemetry = Telemetry()
        self.step = 0
        self.late = 0
        self.without_reply = 0
        self.safe_stops = 0
        # Name of a message -> signal of the newest such message -> raw value, 0 before the first message.
        self.reports: dict[str, Counter[str]] = {name: Counter() for name in ("HEARTBEAT", "FAULTS", "BOARD")}
        self.motors = (0, 0)
        self.commanded_at = 0  # the step of the last motor command
        self.sent_sequence = 0
        self.started = False
        self._over_since = 0
        self.broke_off: str | None = None
        self.recorder = TickRecorder(plan.steps)
        by = book().by_name
        self._motors, self._reply = by["MOTORS"], by["MODE_REPLY"]

    def take(self, identifier: int, data: bytes) -> None:
        """Handles a message that is not the expected reply to a request."""
        self.session.resets.take(identifier, data)
        if self.telemetry.take(identifier, data, self.step, lockstep=self.lockstep):
            return
        if identifier == self._motors.id and not self.lockstep and self._motors.sealed(data):
            left, right, sequence, _, _ = self._motors.unpack(data)
            self.recorder.replied(sequence)
            if (self.sent_sequence - sequence) & 255 < 128:  # it answers one of the last 128 sets of sensor messages
                self.motors, self.commanded_at = (left, right), self.step
        elif identifier == self._reply.id and self._reply.sealed(data):
            self.started = self.started or data[1] == book().choices("MODE_COMMAND", "command")["start"]
        elif (layout := book().by_id.get(identifier)) and layout.name in self.reports and len(data) == SIZE:
            self.reports[layout.name] = Counter(dict(zip(layout.names, layout.unpack(data), strict=True)))

    def receive(self, timeout: float) -> None:
        """Handles the messages that have arrived; waits up to `timeout` s for the first message."""
        for message in self.link.receive(timeout):
            self.take(*message)

    def start_due(self) -> list[Message]:
        """Returns the command to start if it is due in this step; the command is repeated until the brick replies."""
        waited = self.step - self.plan.start_step
        if self.started or waited < 0 or waited % START_EVERY:
            return []
        return [self.session.command_message("start")]

    def break_off(self, why: str, step: int) -> None:
        """Records why and at which step the flight ends early."""
        self.broke_off = f"{why}, {step * STEP_MS / 1e3:.3f} s into the flight"

    def break_off_if_reset(self) -> bool:
        """Ends the flight if the brick has restarted. Returns whether the brick has restarted."""
        if self.session.resets.reset and self.broke_off is None:
            self.break_off(RESET, self.step)
            self.safe_stops += 1
        return self.session.resets.reset

    def end_in(self, steps: int) -> None:
        """Ends the flight after this number of steps, if the plan does not end it earlier."""
        self.plan = dataclasses.replace(self.plan, steps=min(self.plan.steps, self.step + steps))

    def begin_step(self) -> None:
        """Restarts the brick if a fault demands this at the present step, and calls `watch`."""
        self.recorder.begin(self.step)
        self.faulty.step = self.step
        if self.restart is not None and controller_restarts(self.plan.scenario.faults, self.step):
            self.restart()
            self.safe_stops += 1
        self.watch(self)

    def over_for(self) -> int:
        """Returns the number of steps since the brick first reported the mission's end; call it once per step."""
        over = self.started and MISSION_ENDED & {self.telemetry.mode, self.reports["HEARTBEAT"]["mode"]}
        self._over_since = self._over_since if over else self.step
        return self.step - self._over_since

    def exchange(self, end: PlantEnd, tries: int, timeout: float) -> bool:
        """Sends the step's sensor messages up to `tries` times, and takes the motor command; False: no command came."""
        for _ in range(tries):
            self.sent_sequence = self.session.next_sequence()
            expected = partial(self._is_command, self.sent_sequence, end.tick_ms)
            self.recorder.sent(self.step, self.sent_sequence)
            self.link.send(end.messages(self.sent_sequence))
            data = self.session.wait(self._motors.id, expected, timeout)
            if data is not None:
                self.recorder.replied(self.sent_sequence)
                left, right, *_ = self._motors.unpack(data)
                self.motors = (left, right)
                return True
            self.without_reply += 1
        return False

    def _is_command(self, sequence: int, tick_ms: int, data: bytes) -> bool:
        """Returns whether the data are the motor command for the sensor messages with this sequence number and tick."""
        return self._motors.sealed(data) and self._motors.unpack(data)[2:4] == (sequence, tick_ms)

    def end_step(self) -> None:
        """Ends a step of the flight and begins the next."""
        self.count()
        if self.step % 100 == 0:
            mode = ("idle", "run", "arrived", "fault")[self.telemetry.mode]
            self.progress(self.step, self.plan.steps, f"{mode}, waypoint {self.telemetry.newest('waypoint') + 1:.0f}")
        self.step += 1

    def count(self) -> None:
        """Records the counts of faults up to the present step."""
        faults, (late, stops) = self.reports["FAULTS"], self.late_and_stops()
        refused = self.link.damaged + faults["bad"] + faults["stale"]
        lost = self.without_reply + faults["incomplete"] + faults["lost"]
        self.recorder.count(self.step, late, lost, refused, stops)

    def late_and_stops(self) -> tuple[int, int]:
        """Returns the numbers of late ticks and of safe stops at both ends."""
        at_brick = self.reports["HEARTBEAT"]
        return self.late + at_brick["late_ticks"], self.safe_stops + at_brick["aborted"]

    def lost_frames(self) -> int:
        """Returns the number of missing replies plus damaged and incomplete frames at both ends."""
        faults = self.reports["FAULTS"]
        return self.without_reply + self.link.damaged + faults["bad"] + faults["incomplete"] + faults["lost"]


COLUMNS = {
    "estimate_x_m": ("TELEMETRY_X", "x"),
    "estimate_heading_rad": ("TELEMETRY_X", "heading"),
    "waypoint": ("TELEMETRY_X", "waypoint"),
    "estimate_y_m": ("TELEMETRY_Y", "y"),
    "estimate_speed_m_s": ("TELEMETRY_Y", "speed"),
    "overshoots": ("TELEMETRY_Y", "overshoots"),
    "estimate_yaw_rate_rad_s": ("TELEMETRY_TRACK", "yaw_rate"),
    "cross_track_m": ("TELEMETRY_TRACK", "cross_track"),
    "heading_error_rad": ("TELEMETRY_TRACK", "heading_error"),
    "gyro_full_steps": ("TELEMETRY_EFFORT", "gyro_full"),
    "mode": ("TELEMETRY_TRACK", "mode"),
    "phase": ("TELEMETRY_TRACK", "phase"),
    "at_rest": ("TELEMETRY_TRACK", "at_rest"),
    "bias_unknown": ("TELEMETRY_TRACK", "bias_unknown"),
    "demand_speed_m_s": ("TELEMETRY_DEMAND", "speed"),
    "demand_heading_rad": ("TELEMETRY_DEMAND", "heading"),
    "fault": ("TELEMETRY_DEMAND", "fault"),
    "surge_saturated": ("TELEMETRY_DEMAND", "surge_saturated"),
    "yaw_saturated": ("TELEMETRY_DEMAND", "yaw_saturated"),
    "speed_p_v": ("TELEMETRY_SPEED", "proportional"),
    "speed_i_v": ("TELEMETRY_SPEED", "integral"),
    "speed_d_v": ("TELEMETRY_SPEED", "derivative"),
    "yaw_p_v": ("TELEMETRY_HEADING", "proportional"),
    "yaw_i_v": ("TELEMETRY_HEADING", "integral"),
    "yaw_d_v": ("TELEMETRY_HEADING", "derivative"),
    "surge_effort_v": ("TELEMETRY_EFFORT", "surge"),
    "yaw_effort_v": ("TELEMETRY_EFFORT", "yaw"),
    **{
        f"{channel}_{column}": (f"MONITOR_{channel.upper()}", signal)
        for channel in ("left", "right", "battery")
        for column, signal in (("cause", "cause"), ("cause_size", "amount"), ("cause_since_s", "since"))
    },
}
"""Column of the log -> (message, signal) with its value."""

LAST = "TELEMETRY_EFFORT"
"""The message that the brick sends last in each report of its telemetry."""

TICK_AT = 6
"""Index of the byte with the low byte of the brick's time, in each message of the telemetry."""


class Telemetry:
    """Collects a brick's telemetry."""

    def __init__(self) -> None:
        self._layouts = {
            layout.id: layout for name, layout in book().by_name.items() if name.startswith(("TELEMETRY_", "MONITOR_"))
        }
        self._rows: dict[str, tuple[list[int], list[tuple[int, ...]]]] = {
            layout.name: ([], []) for layout in self._layouts.values()
        }
        self._choices = {
            message.name: [
                (self._layouts[message.frame_id].names.index(signal.name), len(signal.choices))
                for signal in message.signals
                if signal.choices
            ]
            for message in book().database.messages
            if message.frame_id in self._layouts
        }
        # Column -> steps and rows of its message, the column's index in a row, and the SI value of one raw unit.
        self._columns = {
            column: (*self._rows[message], book().by_name[message].names.index(signal), book().scale(message, signal))
            for column, (message, signal) in COLUMNS.items()
        }

    def take(self, identifier: int, data: bytes, step: int, *, lockstep: bool) -> bool:
        """Stores a message. Returns False if the message is no telemetry.

        Args:
            identifier: the id of the message.
            data: the bytes of the message.
            step: the present control step.
            lockstep: whether the brick has the plant's clock. If so, the low byte of the brick's time identifies one of
                the last 85 steps.
        """
        layout = self._layouts.get(identifier)
        if layout is None:
            return False
        if len(data) != SIZE:
            return True
        if lockstep:
            age_ms = (STEP_MS * step - data[TICK_AT]) & 255
            step -= age_ms // STEP_MS
        row = layout.unpack(data)
        if any(row[at] >= count for at, count in self._choices[layout.name]):
            return True  # the message was damaged on a transport without a checksum
        steps, rows = self._rows[layout.name]
        steps.append(max(step, 0))
        rows.append(row)
        return True

    @property
    def newest_step(self) -> int:
        """The step of the newest report that has arrived with its last message; -1: no report."""
        steps, _ = self._rows[LAST]
        return steps[-1] if steps else -1

    def newest(self, column: str) -> float:
        """Returns the newest reported value of `column`, one of COLUMNS, in SI units; 0 before the first report."""
        _, rows, index, scale = self._columns[column]
        return rows[-1][index] * scale if rows else 0.0

    @property
    def mode(self) -> int:
        """The number of the mode that the brick reported last."""
        return int(self.newest("mode"))

    def columns(self, steps: int) -> dict[str, Array]:
        """Returns each of COLUMNS, (steps,): the value reported last up to each step, or 0 before the first report."""
        return {
            column: _held(at, [row[index] for row in rows], steps) * scale
            for column, (at, rows, index, scale) in self._columns.items()
        }


def _held(value_steps: list[int], values: list[int], steps: int) -> Array:
    """Returns, for each step, the value that was reported last, (steps,). `value_steps`: the step of each value."""
    reports = np.array(value_steps, dtype=int)
    newest = np.zeros(steps, dtype=int)  # index of the newest report in `values`, plus 1; 0: no report
    inside = reports < steps
    newest[reports[inside]] = 1 + np.flatnonzero(inside)
    return np.array([0, *values], dtype=np.float64)[np.maximum.accumulate(newest)]


TROUBLES = ("late_ticks", "lost_frames", "refused_frames", "safe_stops")
"""The faults that both ends count: late ticks, frames that were missing, damaged or old, and safe stops."""


class TickRecorder:
    """Records the ticks of a flight of at most `steps` steps."""

    def __init__(self, steps: int) -> None:
        self._begun: Array = np.full(steps, np.nan)
        self._round_trip: Array = np.full(steps, np.nan)
        self._counted: Array = np.full((steps, len(TROUBLES)), np.nan)
        self._sent: dict[int, tuple[int, float]] = {}  # sequence number -> step and time

    def begin(self, step: int) -> None:
        """Records that a tick begins."""
        self._begun[step] = time.perf_counter()

    def sent(self, step: int, sequence: int) -> None:
        """Records that the sensor messages of a step are sent; if they are sent again, the round trip starts again."""
        self._sent[sequence] = step, time.perf_counter()

    def replied(self, sequence: int) -> None:
        """Records the arrival of the motor command that answers the sensor messages with this sequence number."""
        step, sent = self._sent.pop(sequence, (-1, 0.0))
        if step >= 0:
            self._round_trip[step] = 1e3 * (time.perf_counter() - sent)

    def count(self, step: int, *totals: int) -> None:
        """Records the total counts of TROUBLES since the flight began."""
        self._counted[step] = totals

    def columns(self, steps: int) -> dict[str, Array]:
        """Returns the columns of ticks.csv for the first `steps` ticks, each (steps,).

        - time_s: time since the flight began.
        - begun_s: time, by the host's clock, from the beginning of the first tick to the beginning of this tick, in s.
        - round_trip_ms: time from sending the sensor messages to the arrival of the motor command; NaN: no command.
        - each of TROUBLES: how often it happened in the tick. The brick reports its counts with a delay. In a tick
          without counts, such as after a lost link, the column is 0.
        """
        counted = np.vstack([np.zeros(len(TROUBLES)), self._counted[:steps]])
        last = np.maximum.accumulate(np.where(np.isnan(counted[:, 0]), 0, np.arange(len(counted))))
        more = np.maximum(np.diff(counted[last], axis=0), 0.0)
        first = self._begun[0] if steps else 0.0
        return {
            "time_s": STEP_S * np.arange(steps, dtype=np.float64),
            "begun_s": self._begun[:steps] - first,
            "round_trip_ms": self._round_trip[:steps],
            **dict(zip(TROUBLES, more.T, strict=True)),
        }


RESET_CAUSES = {1: "power-on", 2: "the reset pin", 4: "a brown-out", 8: "the watchdog"}
"""Bit of `started_by` -> cause of the reset, as in hal/wire/brickpilot.dbc."""


def board_figures(board: Mapping[str, int]) -> dict[str, Any] | None:
    """Returns the cause of the last start, in words, and the counts since power-on.

    Args:
        board: signal of the message BOARD -> its raw value; empty: the brick has sent no such message.

    Returns:
        `started_by` and the counts, with the names of the signals as keys; None if `board` is empty.
    """
    if not board:
        return None
    causes = [name for bit, name in RESET_CAUSES.items() if board["started_by"] & bit]
    return {**board, "started_by": " and ".join(causes) or "an unknown cause"}
