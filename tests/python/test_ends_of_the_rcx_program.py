"""The button Run ends the RCX's program at any tick of a host's mission: motors off, no answers, commands forgotten."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
from brickpilot.constants import STEP_MS
from brickpilot.hil import rcx_flight
from brickpilot.hil.plant_end import open_plant
from brickpilot.hil.rcx_flight import PRESS_MS, RUN_BUTTON, Image, SimulatedRcx
from brickpilot.link import lnp
from brickpilot.link.lnp import InfraredLink
from brickpilot.link.messages import book
from brickpilot.link.session import REALTIME, Session
from brickpilot.vehicle import flight, scenario
from brickpilot.vehicle.model import rcx
from rcx_kernel import PROGRAMS, SYSTEM_TASKS, TASKS

TICK_MS = 9
"""Control step of the RCX's program, ms."""
NOTICED_MS = 4
"""Time, ms, in which the kernel notices a button: twice the 2 ms after which it reads buttons and switches tasks."""
LAST_S = 6.0
ROUTE_MM = [(600, 600), (600, -200)]
SLOWER = 4000
"""Value of the setting cruise, in 1/16 mm/s: less than the image's own."""


def copy_of(brick: SimulatedRcx, folder: Path) -> SimulatedRcx:
    """Returns a copy of a brick, which runs independently."""
    path = folder / "copy"
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX) as waiting:
        waiting.bind(str(path))
        waiting.listen(1)
        waiting.settimeout(10.0)
        brick._write(struct.pack(">sB", b"f", len(str(path))) + str(path).encode())
        end, _ = waiting.accept()
    copy = SimulatedRcx.__new__(SimulatedRcx)
    copy.ms, copy.driven, copy._lock = brick.ms, (0, 0), threading.Lock()
    process = SimpleNamespace(stdin=end.makefile("wb"), stdout=end.makefile("rb"), wait=lambda timeout: end.close())
    copy._process = cast("subprocess.Popen[bytes]", process)
    return copy


def session(brick: SimulatedRcx) -> Session:
    """Returns a host's session over the infrared line of a simulated brick."""
    return Session(InfraredLink(rcx_flight._Line(brick)), "infrared")


def answers(brick: SimulatedRcx) -> bool:
    """Returns whether the brick answers one request of a host to reset the mode."""
    layout = book().by_name["MODE_COMMAND"]
    head = bytes([200, layout.id & 255, layout.id >> 8])
    packet = lnp.packet(head + layout.seal(9, 3), lnp.BRICK, lnp.HOST)

    def reply(received: bytes) -> bytes | None:
        found = lnp.each(received, lnp.HOST, lnp.BRICK)
        return next((one for one in found if one[1] | one[2] << 8 == layout.id + 1), None)

    return rcx_flight._Line(brick).exchange(packet, reply, 0) is not None


def ends(brick: SimulatedRcx) -> int:
    """Presses Run, and returns the ms after which no motor was driven any more."""
    brick.hold(RUN_BUTTON)
    last = 0
    for ms in range(1, PRESS_MS + 1):
        brick.run(1)
        last = ms if brick.driven != (0, 0) else last
    brick.hold(0)
    brick.run(PRESS_MS)
    assert brick.driven == (0, 0)
    return last


def tasks(brick: SimulatedRcx) -> int:
    return brick.word(TASKS) - brick.word(SYSTEM_TASKS)


@dataclass(frozen=True)
class Program:
    """The autopilot's image, and address and size, bytes, of the host's commands in it: session, settings, route."""

    image: Image
    begins: int
    size: int

    def remembers(self, brick: SimulatedRcx) -> bytes:
        return brick.memory(self.begins - self.image.program.base + brick.word(PROGRAMS), self.size)


def built(folder: Path) -> Program:
    image = rcx_flight.build("imu", folder)
    call = ["h8300-hms-nm", folder / "brickpilot.coff"]
    listed = subprocess.run(call, check=True, stdout=subprocess.PIPE, text=True).stdout
    at = {name: int(found, 16) & 0xFFFF for found, name in re.findall(r"^(\w+) b _(commands|state)$", listed, re.M)}
    return Program(image, at["commands"], at["state"] - at["commands"])


def flies(brick: SimulatedRcx) -> Iterator[int]:
    """Flies a host's mission in the plant, and yields the number of each tick."""
    plan = flight.plan(scenario.load(scenario.packaged()["mission"]), rcx(), profile="coupled", sensors="imu")
    log = np.zeros((plan.steps, len(flight.log_names())))
    motors = np.zeros((plan.steps, 2), dtype=np.int16)
    with open_plant(plan, log, motors) as plant:
        for tick in range(round(1000 * LAST_S / TICK_MS)):
            for _ in range(TICK_MS // STEP_MS):
                plant.sense()
                brick.convert(*rcx_flight._raw(plant.readings, plan.sensors))
                brick.run(STEP_MS)
                plant.act(*(rcx_flight._duty(us) for us in brick.driven))
            yield tick


def test_its_motors_are_off_nobody_answers_and_it_begins_as_new(tmp_path: Path, full: bool) -> None:
    """The test presses Run in each tenth tick of 6 s (--full: each tick), at varying ms: at rest, in turns, on legs."""
    program = built(tmp_path)
    every, tried, drove = 1 if full else 10, 0, 0
    with SimulatedRcx() as brick:
        brick.convert(319, 512, 512, 512)
        rcx_flight.start(brick, program.image)
        new = program.remembers(brick)
        host = session(brick)
        host.open("coupled", REALTIME)
        host.upload(ROUTE_MM)
        host.write("cruise", SLOWER)
        host.command("start")
        assert program.remembers(brick) != new
        for tick in flies(brick):
            if tick % every:
                continue
            tried += 1
            with copy_of(brick, tmp_path) as copy:
                copy.run(1 + tried % TICK_MS)
                drove += copy.driven != (0, 0)
                assert ends(copy) <= NOTICED_MS + TICK_MS, tick
                assert tasks(copy) == 0, tick
                assert not answers(copy), tick
                copy.press(RUN_BUTTON)
                assert copy.shows("rESt "), tick
                assert copy.driven == (0, 0), tick
                assert program.remembers(copy) == new, tick
        assert 2 * drove > tried
        asked = (answers(brick) for _ in range(lnp.TRIES))  # the brick loses requests while it sends telemetry
        assert any(asked), "one that was not ended"
        ends(brick)
        brick.press(RUN_BUTTON)
        again = session(brick)
        again.open("coupled", REALTIME)
        assert again.route() == []
        assert again.read("cruise") != SLOWER
        again.upload(ROUTE_MM)
        again.command("start")
        brick.run(300)
        assert brick.driven != (0, 0)
    assert tried == (667 if full else 67)
