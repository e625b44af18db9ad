"""Resets an AVR behind a boot loader at random moments of the mission that it began by itself after power-on.

    loader_resets.py LOADER [COUNT [SEED [LAST_S]]]     prints a JSON line for each reset

LOADER is a key of `arduino_loaders.LOADERS`, or "none". COUNT resets come at random times, up to LAST_S seconds after
power-on. The mission is simulated once. At the time of each reset this process forks: the child resets the AVR and
reports what the motors do; the parent goes on with the mission. Run this program in a checkout.
"""

from __future__ import annotations

import dataclasses
import json
import os
import random
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from arduino_loaders import LOADERS, behind
from brickpilot.hil.avr_flight import AvrRobot, avr_image, open_robot
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.link.links import Message
from brickpilot.link.messages import book
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx

STEP_S = 0.003
CAUSES = ("watchdog", "stuck interrupt", "brown-out", "reset pin")
OFF_S = 0.036
"""Longest time, s, for which motors may stay driven after a program hangs: the watchdog's time, and a control step."""

WATCH_S, LOADER_S = 4.5, 1.3
"""Time, s, for which motors are watched: the slowest loader takes LOADER_S, and an image rests for 2 s."""

MOST_START_S = 6.0
"""Latest start of a mission, s after power-on: a loader's time and the rest."""

SUPPLY_V = 2.0
"""Battery voltage in a brown-out: below the threshold of every detector of an Arduino."""


@dataclass(frozen=True)
class Outcome:
    """The result of a reset.

    Attributes:
        resets: number of resets of the chip, including resets by the loader.
        off_s: seconds from the cause until no motor was driven; None: a motor was driven until the end.
        driven_s: seconds for which a motor was driven after `off_s` and after `OFF_S`.
        obeys: whether the robot drives afterwards when a host commands a start.
        said: cause of the chip's start, as bits of the message BOARD; -1: no message.
    """

    loader: str
    cause: str
    at_s: float
    resets: int
    off_s: float | None
    driven_s: float
    obeys: bool
    said: int


class Flight:
    """A flying robot whose motor duties are read after each control step."""

    def __init__(self, robot: AvrRobot) -> None:
        self.robot = robot

    def drives(self) -> bool:
        """Flies one control step, and returns whether a motor was driven at its end."""
        self.robot.fly()
        return bool(np.any(np.nan_to_num(np.array(tuple(self.robot.tell().duty))) != 0))

    def for_s(self, seconds: float) -> list[bool]:
        """Flies `seconds` and returns, for each control step, whether a motor was driven."""
        return [self.drives() for _ in range(round(seconds / STEP_S))]


def _cause(flight_: Flight, cause: str) -> list[bool]:
    """Causes a reset, and returns, for each control step from the cause on, whether a motor was driven."""
    robot = flight_.robot
    name, value, held_s = {
        "watchdog": ("MAIN_HELD", 1.0, None),
        "stuck interrupt": ("INTERRUPT_STUCK", 1.0, None),
        "brown-out": ("BATTERY", SUPPLY_V, 0.1),
        "reset pin": ("RESET_PIN", 1.0, 0.1),
    }[cause]
    before = robot.tell().resets
    robot.fault(name, value)
    driven = []
    if held_s is None:
        while robot.tell().resets == before and len(driven) < round(0.2 / STEP_S):
            driven += flight_.for_s(STEP_S)
    else:
        driven += flight_.for_s(held_s)
    robot.fault(name, 0.0)
    return driven


class InSteps:
    """A host's end of the link to a flying robot; while the host waits for a message, the robot flies control steps.

    Attributes:
        driven: number of these control steps at whose end a motor was driven.
    """

    def __init__(self, flight_: Flight) -> None:
        self.flight, self.now_s, self.driven = flight_, 0.0, 0

    def send(self, messages: Sequence[Message]) -> None:
        self.flight.robot.send(messages)

    def receive(self, timeout: float) -> list[Message]:
        for _ in range(max(1, round(timeout / STEP_S))):
            self.driven += self.flight.drives()
            self.now_s += STEP_S
            if come := self.flight.robot.receive(0.0):
                return come
        return []

    def close(self) -> None:
        """Does nothing."""

    def session(self, other: Callable[[int, bytes], None] = lambda _identifier, _data: None) -> Session:
        """Returns a host's session over this link; its clock is the robot's time."""
        return Session(self, "avr", other, clock=lambda: self.now_s)


def _obeys(flight_: Flight) -> tuple[bool, int]:
    """Returns whether a host can drive the robot, and the content of BOARD."""
    said: list[int] = []

    def other(identifier: int, data: bytes) -> None:
        if identifier == book().by_name["BOARD"].id:
            said.append(book().by_name["BOARD"].unpack(data)[0])

    session = InSteps(flight_).session(other)
    try:
        session.open("coupled", REALTIME)
        session.upload([(1000, 0)])
        session.command("start")
    except Exception as error:  # a brick that does not answer
        print(error, file=sys.stderr)
        return False, -1
    driven = flight_.for_s(0.5)
    for message in flight_.robot.receive(0.0):
        other(*message)
    return any(driven), said[-1] if said else -1


def _outcome(flight_: Flight, loader: str, cause: str, at_s: float) -> Outcome:
    driven = _cause(flight_, cause)
    watch_s = WATCH_S - LOADER_S * (loader == "none")
    driven += flight_.for_s(watch_s - len(driven) * STEP_S)
    off = driven.index(False) if False in driven else None
    driven_s = 0.0 if off is None else sum(driven[max(off, round(OFF_S / STEP_S)) :]) * STEP_S
    resets = int(flight_.robot.tell().resets)
    obeys, said = _obeys(flight_)
    return Outcome(loader, cause, at_s, resets, None if off is None else off * STEP_S, driven_s, obeys, said)


def in_child(work: Callable[[], Any]) -> Any:
    """Runs `work` in a copy of this process and returns its result through JSON; this process does not change."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.write(writing, json.dumps(work()).encode())
            status = 0
        finally:
            os._exit(status)
    os.close(writing)
    with os.fdopen(reading) as told:
        text = told.read()
    os.waitpid(child, 0)
    return json.loads(text)


def planned(target: str, last_s: float) -> flight.Plan:
    """Returns the plan of the packaged mission for a target, long enough for everything that follows a reset."""
    sensors = AVR_TARGETS[target].sensors[0]
    plan = flight.plan(scenario.load(scenario.packaged()["mission"]), rcx(), profile="coupled", sensors=sensors)
    return dataclasses.replace(plan, steps=round((last_s + WATCH_S + 10) / STEP_S))


def resets(loader: str, count: int, seed: int, last_s: float) -> Iterator[Outcome]:
    """Yields the results of `count` resets, at random times from the mission's start to `last_s` after power-on."""
    drawn = random.Random(seed)
    target = "avr:328p-imu" if loader == "none" else LOADERS[loader].target
    image = avr_image(target)
    plan = planned(target, last_s)
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors = np.zeros((plan.steps, 2), dtype=np.int16)
    with tempfile.TemporaryDirectory() as folder:
        if loader != "none":
            image = behind(LOADERS[loader], image.with_suffix(".hex"), Path(folder))
        with open_robot(plan, image, AVR_TARGETS[target].chip, log, motors) as robot:
            flight_ = Flight(robot)
            step = 1
            while not flight_.drives():
                step += 1
                if step * STEP_S > MOST_START_S:
                    raise RuntimeError(f"{loader}: no mission begins after power-on")
            moments = sorted(drawn.randrange(step, round(last_s / STEP_S)) for _ in range(count))
            for number, moment in enumerate(moments):
                driven = True
                while step < moment or not driven:  # a motor has to be driven when the reset comes
                    driven = flight_.drives()
                    step += 1
                cause, at_s = CAUSES[(number + seed) % len(CAUSES)], round(step * STEP_S, 3)
                yield Outcome(
                    **in_child(
                        lambda cause=cause, at_s=at_s: dataclasses.asdict(_outcome(flight_, loader, cause, at_s))
                    )  # type: ignore[misc]
                )


def main() -> None:
    if not 2 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    loader, count, seed, last_s = (*sys.argv[1:], *("4", "0", "12")[len(sys.argv) - 2 :])
    for outcome in resets(loader, int(count), int(seed), float(last_s)):
        print(json.dumps(dataclasses.asdict(outcome)), flush=True)


if __name__ == "__main__":
    main()
