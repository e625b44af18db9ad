"""Looks for the longest control period of a brick over starts and settings, with a link that is full both ways.

    PYTHONPATH=tests python tests/loop/worst_case.py [TARGET...] [--flights N] [--seconds S] [--seed N]

It prints a JSON line for each target.

Flights of even seeds begin by themselves after power-on, the others in a host's session, which draws settings. The host
always sends as much as the line carries, or one message in each period. Of its requests for settings, waypoints and
routes, half write and half read. A third of the drawn settings are at each end of their range. The brick sends
telemetry as often as it can.

The period of an AVR chip is the number of its cycles in simavr without sleep. The period of an RCX is the time in ms
from one control step to the next.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from brickpilot.constants import STEP_MS, STEP_S
from brickpilot.hil import rcx_flight
from brickpilot.hil.avr_flight import AvrRobot, avr_image, open_robot
from brickpilot.hil.checkout import AVR_TARGETS
from brickpilot.hil.plant_end import open_plant
from brickpilot.hil.rcx_flight import SimulatedRcx
from brickpilot.link import lnp
from brickpilot.link.links import Message, encode_frame
from brickpilot.link.lnp import InfraredLink
from brickpilot.link.messages import book
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from brickpilot.vehicle.settings import Setting, settings
from lab.avr_budget import PERIOD, Image, Profile
from numpy.typing import NDArray

FULL_BYTES, A_MESSAGE_BYTES = 40, 14
"""Bytes that the host sends in a step: more than the line carries in 3 ms at 117,647 baud; or the frame of one message,
so that no message is lost."""

ROUTE_MM = [(600, 600), (600, -200), (-300, 100)]
BY_ITSELF_S = 3.0
RCX_TARGETS = {f"h8:{sensors}": sensors for sensors in rcx_flight.SENSORS}


def value_of(setting: Setting, drawn: random.Random) -> int:
    """Draws a value of a setting: the lower end, the upper end, or any value of its range, each with chance 1/3."""
    if setting.name == "telemetry_every":
        return 1
    return drawn.choice((setting.low, setting.high, drawn.randint(setting.low, setting.high)))


def requests(drawn: random.Random) -> Iterator[Message]:
    """Yields random requests without end."""
    named, sequence = list(settings().values()), 0
    by_name, commands = book().by_name, book().choices("MODE_COMMAND", "command")
    while True:
        sequence = (sequence + 1) & 255
        kind, write = drawn.randrange(8), drawn.randrange(2)
        if kind < 4:
            setting = drawn.choice(named)
            request, values = by_name["PARAMETER_REQUEST"], (setting.number, write, value_of(setting, drawn))
        elif kind < 6:
            x, y = (drawn.randint(-30000, 30000) for _ in range(2))
            request, values = by_name["WAYPOINT_REQUEST"], (drawn.randrange(32), write, x, y)
        elif kind < 7:
            request, values = by_name["ROUTE_REQUEST"], (drawn.randrange(33), write, drawn.randrange(65536))
        else:
            request, values = by_name["MODE_COMMAND"], (commands[drawn.choice(("start", "start", "reset"))],)
        yield request.id, request.seal(sequence, *values)


def begin(session: Session, drawn: random.Random) -> None:
    """Begins a mission in a host's session, with drawn settings."""
    session.open("coupled", REALTIME)
    for setting in settings().values():
        if drawn.randrange(2) and setting.name not in ("cruise", "silent_time"):
            session.write(setting.name, value_of(setting, drawn))
    session.upload(ROUTE_MM)
    session.command("start")


def planned(sensors: str, seconds: float, seed: int) -> tuple[flight.Plan, NDArray[np.float64], NDArray[np.int16]]:
    """Returns the plan of the packaged mission, and empty arrays for its log and its motor commands."""
    plan = flight.plan(scenario.load(scenario.packaged()["mission"]), rcx(), sensors=sensors, seed=seed)
    room = max(plan.steps, round((seconds + 10 * BY_ITSELF_S) / STEP_S))
    return plan, np.zeros((room, len(flight.log_names()))), np.zeros((room, 2), dtype=np.int16)


class _InSteps:
    """The host's end of the line to an AVR chip. The robot flies while the host waits."""

    def __init__(self, robot: AvrRobot) -> None:
        self.robot, self.now_s = robot, 0.0
        self.send, self.close = robot.send, robot.close

    def receive(self, timeout: float) -> list[Message]:
        self.robot.fly()
        self.now_s += STEP_S
        return self.robot.receive(0.0)


def avr_cycles(target: str, seconds: float, seed: int) -> NDArray[np.int64]:
    """Returns the cycles of each control period of a flight, without sleep."""
    drawn = random.Random(f"{target} {seed}")
    plan, log, motors = planned(AVR_TARGETS[target].sensors[0], seconds, seed)
    elf = avr_image(target)
    image, asked = Image.of(elf), requests(drawn)
    with open_robot(plan, elf, AVR_TARGETS[target].chip, log, motors) as robot:
        profile = Profile(robot, [(image.at["loop_tick"], 0)], image.vectors_end, len(log))
        if seed % 2:
            line = _InSteps(robot)
            begin(Session(line, target, clock=lambda: line.now_s), drawn)
        else:
            for _ in range(round(BY_ITSELF_S / STEP_S)):
                robot.fly()
        least = drawn.choice((FULL_BYTES, A_MESSAGE_BYTES))
        for _ in range(round(seconds / STEP_S)):
            sent = b""
            while len(sent) < least:
                sent += encode_frame(*next(asked))
            robot.send_bytes(sent)
            robot.fly()
            robot.receive(0.0)
        return profile.counted()[0][:, -1]


def rcx_ticks_ms(target: str, seconds: float, seed: int) -> NDArray[np.float64]:
    """Returns the time from each control step of a flight to the next step, ms."""
    drawn = random.Random(f"{target} {seed}")
    sensors = RCX_TARGETS[target]
    plan, log, motors = planned(rcx_flight.SENSORS[sensors], seconds, seed)
    asked, ahead_ms, times = requests(drawn), 0.0, []
    with SimulatedRcx() as brick, open_plant(plan, log, motors) as plant:
        brick.convert(319, 512, 512, 512)
        rcx_flight.start(brick, rcx_flight.build(sensors))
        if seed % 2:
            begin(Session(InfraredLink(rcx_flight._Line(brick)), target), drawn)
        brick.watched()
        waiting = b""
        for step in range(round(seconds / STEP_S)):
            plant.sense()
            brick.convert(*rcx_flight._raw(plant.readings, plan.sensors))
            if ahead_ms < STEP_MS:
                if not waiting:
                    identifier, data = next(asked)
                    waiting = lnp.packet(
                        bytes([seed & 255, identifier & 255, identifier >> 8]) + data, lnp.BRICK, lnp.HOST
                    )
                before = brick.ms
                brick.bring(waiting[0])
                waiting = waiting[1:]
                ahead_ms += brick.ms - before
                driven = tuple(round(us * STEP_MS / (brick.ms - before)) for us in brick.driven)
            ahead_ms -= STEP_MS
            plant.act(*(rcx_flight._duty(us) for us in driven))
            if step % 100 == 99:
                times.append(brick.watched())
    return 1e3 * np.diff(np.concatenate(times))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=[*RCX_TARGETS, *AVR_TARGETS])
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for target in options.targets:
        periods: NDArray[Any] = np.concatenate([
            (avr_cycles if target in AVR_TARGETS else rcx_ticks_ms)(target, options.seconds, options.seed + number)
            for number in range(options.flights)
        ])  # fmt: skip
        told: dict[str, Any] = {"target": target, "periods": len(periods), "longest": round(float(periods.max()), 2)}
        if target in AVR_TARGETS:
            told["share"] = round(told["longest"] / PERIOD, 3)
        print(json.dumps(told), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
