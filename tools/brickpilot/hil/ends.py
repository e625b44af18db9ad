"""Opens the plant's end of a link, and starts a brick at the other end if the link names one on this machine."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from brickpilot.errors import InputError, SimulationError
from brickpilot.hil.brick_process import end_brick, restart_brick, start_brick, wait_for_end
from brickpilot.hil.brick_thread import BrickThread
from brickpilot.hil.h8_simulator import H8SIM_REPLY_S, H8SIM_TARGETS, start_h8
from brickpilot.link.infrared import InfraredLink
from brickpilot.link.links import CAN_KINDS, CanLink, Link, LinkGoneError, open_bus, open_serial, open_tcp
from brickpilot.link.session import REPLY_S
from brickpilot.link.tower import Tower

_PRIORITY = 20  # of 99; the system's own threads have more
STARTED = {"serial:pty": "--pty", "tcp": "--listen 127.0.0.1:0", "can:slcan": "--slcan-pty"}
"""Link whose brick is a process that is started here -> the options of that process."""

INFRARED = "infrared"
"""The infrared tower of an RCX. It is too slow for a plant; only `brickpilot upload` uses it."""

IN_PROCESS = ("can:virtual", "can:udp_multicast")
FORMS = (*STARTED, *IN_PROCESS, "serial:PORT", "tcp:HOST:PORT", "can:slcan:PORT", "can:socketcan:CHANNEL")


def claim_priority() -> bool:
    """Requests real-time priority (sched(7), SCHED_FIFO) for this thread and its children.

    Returns False if it is refused, or the system (macOS, Windows) has no such call.

    With it, other programs make fewer ticks late. Both ends sleep between their ticks.
    """
    if not hasattr(os, "sched_setscheduler"):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError:
        return False
    return True


def open_link(spec: str) -> Link:
    """Opens this end of a link to a brick that runs already.

    Raises:
        InputError: the link is unknown or cannot be opened.
    """
    kind, _, rest = spec.partition(":")
    if kind == "serial" and rest:
        return open_serial(spec, rest)
    if kind == "tcp" and rest:
        return open_tcp(spec, rest)
    if kind == INFRARED and rest:
        return InfraredLink(Tower(rest))
    name, _, channel = rest.partition(":")
    if kind == "can" and name in CAN_KINDS and channel and name != "virtual":
        return CanLink(open_bus(spec, name, channel))
    raise InputError(f"is no link; known links: {', '.join(FORMS)}", field=f"--link {spec}")


@dataclass(frozen=True)
class Ends:
    """The plant's end of a link.

    Attributes:
        link: the open link.
        restart: switches the brick off and on; None if the brick was not started here.
        reply_s: time for a reply in lockstep, s of the clock, before the set is sent again.
        clock: the clock, s.
    """

    link: Link
    restart: Callable[[], None] | None
    reply_s: float = REPLY_S
    clock: Callable[[], float] = time.monotonic


@contextmanager
def both_ends(spec: str, trace: Path | None = None, image: Path | None = None) -> Iterator[Ends]:
    """Opens the plant's end of a link, and starts the brick at the other end if the link names one here.

    Args:
        spec: the link, or one of `H8SIM_TARGETS`.
        trace, image: see `start_h8`.

    Raises:
        InputError: the link is unknown or cannot be opened.
    """
    process: subprocess.Popen[bytes] | None = None
    simulator: subprocess.Popen[bytes] | None = None
    thread: BrickThread | None = None
    link: Link | None = None
    restart: Callable[[], None] | None = None
    try:
        if spec in STARTED:
            process, address = start_brick(STARTED[spec])
            link = open_link(address)
            restart = partial(restart_brick, process)
        elif spec in H8SIM_TARGETS:
            simulator, link = start_h8(spec, trace, image)
        elif spec in IN_PROCESS:
            kind = spec.partition(":")[2]
            channel = f"brickpilot-{os.getpid()}-{time.monotonic_ns()}" if kind == "virtual" else None
            thread = BrickThread(open_bus(spec, kind, channel))
            restart = thread.restart
            link = CanLink(open_bus(spec, kind, channel))
        else:
            link = open_link(spec)
        yield Ends(link, restart, H8SIM_REPLY_S if spec in H8SIM_TARGETS else REPLY_S)
    except LinkGoneError as error:
        raise SimulationError(f"{spec}: {error}") from error
    finally:
        if link is not None:
            link.close()
        if thread is not None:
            thread.stop()
        if process is not None:
            end_brick(process)
        if simulator is not None:
            wait_for_end(simulator)
