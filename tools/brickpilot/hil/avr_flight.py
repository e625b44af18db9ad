"""Flies a mission with an AVR as the brick: it reads its own sensors and drives its own motors, in simulated time."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brickpilot.constants import STEP_S
from brickpilot.errors import InputError
from brickpilot.hil import fly as over_a_link
from brickpilot.hil.avr_robot import AvrRobot, open_robot
from brickpilot.hil.avr_targets import AVR_TARGETS
from brickpilot.hil.ends import Ends
from brickpilot.hil.fault_injection import BROWN_OUT_MV
from brickpilot.hil.linked_flight import LinkedFlight, Progress
from brickpilot.link.links import Link
from brickpilot.link.session import REALTIME
from brickpilot.vehicle import flight
from brickpilot.vehicle.faults import AVR_KINDS, MESSAGE_KINDS, Fault

REPLY_S = 2.0
"""Simulated time for a reply."""

START_EVERY = 20
"""The command to start is sent again after so many steps without its reply."""

RESET_STEPS = round(2.5 / STEP_S)
"""A flight ends so many steps after a reset. An image that drives by itself rests for 2 s before; it must not drive."""

MOST_PULSES_PER_S = 20_000.0
"""False pulses at a rotation sensor where `encoder_noise` has a rate of 1."""

Wrap = Callable[[Link], Link]


def fly(
    plan: flight.Plan,
    target: str,
    image: Path,
    *,
    telemetry_every: int,
    progress: Progress,
    settings: Mapping[str, int] = MappingProxyType({}),
    trace: Path | None = None,
    scales: Mapping[str, float] = MappingProxyType({}),
    wrap: Wrap = lambda link: link,
    each_step: Callable[[AvrRobot, int], None] = lambda _robot, _step: None,
) -> over_a_link.HilFlight:
    """Flies the plan on simavr. The same arguments give the same bits.

    Args:
        plan: the plan of a mission; the faults of its scenario act.
        target: of `AVR_TARGETS`.
        image: its ELF file.
        telemetry_every: the brick sends telemetry every so many steps, 1..255.
        progress: called with (steps done, steps in all, text).
        settings: raw values that are written before the flight; they override the plan's.
        trace: a VCD file of the signals at the pins.
        scales: of the sensors of an image with others than the packaged one's: see `open_robot`.
        wrap: puts another link over the host's line, such as one that records.
        each_step: called with the robot and the number of each control step before it is flown.

    Raises:
        InputError: the brick refuses something, or the plan is of a manoeuvre or has faults of another kind of brick.
        SimulationError: the plant's state diverges.
    """
    _check_plan(plan, target)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors: NDArray[np.int16] = np.zeros((plan.steps, 2), dtype=np.int16)
    with open_robot(plan, image, AVR_TARGETS[target].chip, log, motors, trace, scales) as robot:
        run = LinkedFlight(Ends(wrap(robot), None, REPLY_S), target, plan, REALTIME, REPLY_S, progress)
        over_a_link.prepare(run.session, plan, REALTIME, telemetry_every, settings)
        began = time.perf_counter()
        _fly(run, robot, each_step)
        elapsed = time.perf_counter() - began
    flown = over_a_link.flown(run, log, motors, elapsed)
    ticks = dataclasses.replace(flown.ticks, begun_s=flown.ticks.time_s)  # the brick's own time has no jitter here
    return dataclasses.replace(flown, ticks=ticks)


def _fly(run: LinkedFlight, robot: AvrRobot, each_step: Callable[[AvrRobot, int], None]) -> None:
    """Flies until a second after the mission's end, or until the robot's behaviour after a reset is clear."""
    ends_at = run.plan.steps
    resets = robot.tell().resets
    while run.step < ends_at and run.over_for() < over_a_link.REST_STEPS:
        run.recorder.begin(run.step)
        run.faulty.step = run.step
        for fault in run.plan.scenario.faults:
            _act(robot, fault, run.step)
        if run.step >= run.plan.start_step and not run.started and (run.step - run.plan.start_step) % START_EVERY == 0:
            run.link.send([run.session.command_message("start")])
        each_step(robot, run.step)
        robot.fly()
        for message in run.link.receive(0.0):
            run.take(*message)
        if robot.tell().resets > resets and run.broke_off is None:
            run.break_off("the brick was reset by its watchdog or its brown-out detector", run.step)
            run.safe_stops += 1
            ends_at = min(ends_at, run.step + RESET_STEPS)
        if run.broke_off is None and run.break_off_if_reset():
            ends_at = min(ends_at, run.step + RESET_STEPS)
        run.end_step()


def _act(robot: AvrRobot, fault: Fault, step: int) -> None:
    """Begins or ends a fault of the brick, if this is its first step or the step after it."""
    if not (fault.begins(step) or fault.ends(step)):
        return
    acts = fault.begins(step)
    if fault.kind == "brown_out":
        robot.fault("BATTERY", BROWN_OUT_MV * 1e-3 if acts else 0.0)
    elif fault.kind == "overrun":
        robot.fault("LINE_OVERRUN", fault.rate if acts else 0.0)
    elif fault.kind == "encoder_noise":
        robot.fault("ENCODER_NOISE", fault.rate * MOST_PULSES_PER_S if acts else 0.0)
    elif fault.kind in AVR_KINDS:
        robot.fault(fault.kind.upper(), 1.0 if acts else 0.0)


def _check_plan(plan: flight.Plan, target: str) -> None:
    """Raises InputError if the plan cannot be flown by an AVR."""
    if plan.scenario.kind != "mission":
        raise InputError("is a manoeuvre, which needs no controller; hil flies missions", field=plan.scenario.name)
    possible = {*AVR_KINDS, *MESSAGE_KINDS, "brown_out"}
    for fault in plan.scenario.faults:
        if fault.kind not in possible:
            raise InputError(
                f"an AVR has its own sensors and clock; its faults are {', '.join(sorted(possible))}",
                field=f"--target {target}: {fault.kind}",
            )
    if plan.controller != "coupled":
        raise InputError("the image has the profile coupled alone", field=f"--profile {plan.controller}")
