"""Flies a mission over a link: in lockstep, one step for each reply, or in real time."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import SILENT_S, STEP_MS, STEP_S
from brickpilot.errors import InputError
from brickpilot.hil.ends import Ends, memory_ends
from brickpilot.hil.linked_flight import (
    LOST,
    MISSION_ENDED,
    RUNS,
    START_EVERY,
    LinkedFlight,
    Progress,
    Watch,
    board_figures,
)
from brickpilot.hil.plant_end import PlantEnd, open_plant
from brickpilot.link.brick import prepare
from brickpilot.link.links import LinkGoneError
from brickpilot.link.session import LOCKSTEP, REALTIME, NoReplyError
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle.scenario import AVR_KINDS

TRIES = 4
"""In lockstep, the link counts as lost if a step's sensor messages were sent this number of times without a reply."""

LOST_STEPS = int(SILENT_S / STEP_S)
"""In real time, the motors stop after this number of steps without a motor command."""

REST_STEPS = round(1.0 / STEP_S)
"""In real time, the number of steps that a flight lasts after the mission's end, while the robot rolls out."""

GIVE_UP_STEPS = round(2.0 / STEP_S)
"""A flight ends after this number of steps without a link; during these steps the motors are off."""


@dataclass(frozen=True)
class HilFlight:
    """A flight over a link.

    Attributes:
        flight: the log and the motor commands.
        late_ticks: number of steps, at both ends, that began more than a step late.
        lost_frames: number of missing replies and of damaged or incomplete frames, at both ends.
        safe_stops: number of times that one end stopped the motors because the other end was silent.
        broke_off: the reason why the flight ended early, or None.
        ticks: column of ticks.csv -> (steps,); see `TickRecorder.columns`.
        board: signal of the newest message BOARD -> its raw value; empty: the brick has sent no such message.
    """

    flight: flight.Flight
    late_ticks: int
    lost_frames: int
    safe_stops: int
    broke_off: str | None
    ticks: dict[str, NDArray[np.float64]]
    board: Mapping[str, int]

    def figures(self, link: str, pace: str) -> dict[str, Any]:
        """Returns the figures of flight and link for ``summary.json``. `link`, `pace`: the names of link and pace."""
        return flight_figures.summary(self.flight) | {
            "link": link,
            "pace": pace,
            "late_ticks": self.late_ticks,
            "lost_frames": self.lost_frames,
            "safe_stops": self.safe_stops,
            "broke_off": self.broke_off,
            "board": board_figures(self.board),
        }


class Fence:
    """Stops the motors if the brick reports a place beyond `reach_m`; ends the flight 1 s after the mission's end.

    Pass a new fence as the `watch` of each flight. The command to stop is repeated while the brick reports that it
    drives.

    Args:
        reach_m: the largest allowed distance from the start, m.

    Attributes:
        crossed: whether the brick has reported a distance larger than `reach_m`.
    """

    def __init__(self, reach_m: float) -> None:
        self.reach_m = reach_m
        self.crossed = False
        self._since = 0  # the step of the crossing
        self._ending = False

    def __call__(self, run: LinkedFlight) -> None:
        """Checks the position in the newest report of the brick, at the beginning of a step."""
        position = [run.telemetry.newest(column) for column in ("estimate_x_m", "estimate_y_m")]
        if not self.crossed and math.dist(position, run.plan.scenario.start[:2]) > self.reach_m:
            self.crossed, self._since = True, run.step
        if self.crossed and (run.step - self._since) % START_EVERY == 0 and run.telemetry.mode == RUNS:
            run.link.send([run.session.command_message("abort")])
        if run.telemetry.mode in MISSION_ENDED and not self._ending:
            self._ending = True
            run.end_in(REST_STEPS)


def _fly_lockstep(run: LinkedFlight, end: PlantEnd) -> None:
    lost_since: int | None = None
    gone = ""
    while run.step < run.plan.steps:
        run.begin_step()
        end.sense()
        try:
            if run.step == run.plan.start_step:
                run.session.command("start")
            replied = run.exchange(end, *((TRIES, run.session.reply_s) if lost_since is None else (1, STEP_MS * 1e-3)))
        except (LinkGoneError, NoReplyError) as error:
            gone, replied = str(error), False
        if run.break_off_if_reset():
            _coast(run, end, run.step + GIVE_UP_STEPS)
            return
        if replied:
            lost_since = None
        elif lost_since is None:
            lost_since = run.step
            run.safe_stops += 1
        if lost_since is not None:
            run.motors = (0, 0)
            if gone or run.step - lost_since >= GIVE_UP_STEPS:
                run.break_off(f"{LOST}: {gone or 'no reply'}", lost_since)
                _coast(run, end, lost_since + GIVE_UP_STEPS)
                return
        end.act(*run.motors)
        run.end_step()
    _drain(run)


def _coast(run: LinkedFlight, end: PlantEnd, until: int) -> None:
    """Simulates the robot with its motors off. The sensors of the present step must already be read."""
    run.count()
    while run.step < min(until, run.plan.steps):
        end.act(0, 0)
        run.step += 1
        if run.step < run.plan.steps:
            end.sense()


def _drain(run: LinkedFlight) -> None:
    """Waits for the telemetry of the last step."""
    last = run.step = run.step - 1
    clock = run.session.now
    until = clock() + 0.1
    with contextlib.suppress(LinkGoneError):  # the flight is over; without the link, the log repeats the last report
        while run.telemetry.newest_step < last and (left := until - clock()) > 0:
            run.receive(left)
    run.count()
    run.step = last + 1


def _fly_realtime(run: LinkedFlight, end: PlantEnd) -> None:
    began = time.perf_counter()
    stopped = False
    while run.step < run.plan.steps and run.over_for() < REST_STEPS:
        due = began + run.step * STEP_MS * 1e-3
        while (left := due - time.perf_counter()) > 0:
            run.receive(left)
        run.late += -left > STEP_MS * 1e-3
        run.begin_step()
        end.sense()
        if run.break_off_if_reset():
            _coast(run, end, run.step + GIVE_UP_STEPS)
            return
        run.sent_sequence = run.session.next_sequence()
        messages = [*run.start_due(), *end.messages(run.sent_sequence)]
        run.recorder.sent(run.step, run.sent_sequence)
        run.link.send(messages)
        silent = run.step - run.commanded_at > LOST_STEPS
        run.safe_stops += silent and not stopped
        stopped = silent
        end.act(*((0, 0) if silent else run.motors))
        if run.step - run.commanded_at > GIVE_UP_STEPS:
            run.break_off(f"{LOST}: no reply", run.commanded_at)
            run.end_step()
            return
        run.end_step()


def fly(
    ends: Ends,
    spec: str,
    plan: flight.Plan,
    *,
    pace: str,
    telemetry_every: int,
    progress: Progress,
    settings: Mapping[str, int] = MappingProxyType({}),
    watch: Watch = lambda _run: None,
) -> HilFlight:
    """Flies the plan with the brick at the other end of the link.

    Args:
        ends: the open link.
        spec: the link as the user named it, for error messages.
        plan: the plan of a mission; the faults of its scenario are injected.
        pace: LOCKSTEP or REALTIME.
        telemetry_every: the number of steps from one telemetry to the next, 1..255; in between, the log repeats values.
        progress: called with (steps done, steps in all, text).
        settings: raw values that are written before the flight; they override those of the plan.
        watch: called at the beginning of each step.

    Raises:
        InputError: no brick replies, the brick refuses a message, or the plan is for a manoeuvre.
        SimulationError: the plant's state diverges.
    """
    _check_plan(ends, spec, plan)
    run = LinkedFlight(ends, spec, plan, pace, progress, watch)
    prepare(run.session, plan, pace, telemetry_every, settings)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors: NDArray[np.int16] = np.zeros((plan.steps, 2), dtype=np.int16)
    began = time.perf_counter()
    with open_plant(plan, log, motors) as end:
        try:
            (_fly_realtime if pace == REALTIME else _fly_lockstep)(run, end)
        except LinkGoneError as error:
            run.break_off(f"{LOST}: {error}", run.step)
            run.safe_stops += 1
            _coast(run, end, run.step + GIVE_UP_STEPS)
    return flown(run, log, motors, time.perf_counter() - began)


def _check_plan(ends: Ends, spec: str, plan: flight.Plan) -> None:
    """Raises InputError if the plan cannot be flown over this link."""
    if plan.scenario.kind != "mission":
        raise InputError("is a manoeuvre, which needs no controller; hil flies missions", field=plan.scenario.name)
    for fault in plan.scenario.faults:
        if fault.kind in AVR_KINDS:
            raise InputError("needs --target avr: it is a fault of that brick", field=fault.kind)
    restarts = any(fault.kind in ("controller_restart", "brown_out") for fault in plan.scenario.faults)
    if restarts and ends.restart is None:
        raise InputError(
            "has a brick that was not started here, and so cannot be switched off and on", field=f"--link {spec}"
        )


def flown(run: LinkedFlight, log: NDArray[np.float64], motors: NDArray[np.int16], elapsed_s: float) -> HilFlight:
    """Returns the finished flight: the plant's log with the columns of telemetry, and the counts of faults."""
    done = run.step
    run.break_off_if_reset()
    columns = {name: np.ascontiguousarray(log[:done, index]) for index, name in enumerate(flight.log_names())}
    columns |= run.telemetry.columns(done)
    columns["left_duty"], columns["right_duty"] = (motors[:done, side] / 32767.0 for side in (0, 1))
    plan = dataclasses.replace(run.plan, steps=done)
    late_ticks, safe_stops = run.late_and_stops()
    return HilFlight(
        flight.Flight(plan, columns, motors[:done], done * STEP_S / elapsed_s),
        late_ticks=late_ticks,
        lost_frames=run.lost_frames() + run.session.repeated,
        safe_stops=safe_stops,
        broke_off=run.broke_off,
        ticks=run.recorder.columns(done),
        board=run.reports["BOARD"],
    )


MEMORY = "memory"
"""The name of the link in memory, for error messages."""


def fly_alone(plan: flight.Plan) -> HilFlight:
    """Flies a plan over a link in memory in lockstep, with its scenario's faults and telemetry in every step.

    Raises:
        InputError: the plan is for a manoeuvre, or a fault needs another brick.
        SimulationError: the plant's state diverges.
    """
    with memory_ends() as ends:
        return fly(ends, MEMORY, plan, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None)
