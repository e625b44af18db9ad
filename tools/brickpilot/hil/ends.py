"""Opens the plant's end of a link, and starts the brick at the other end if the link names a brick of this machine.

A brick is a process, a thread at one end of a CAN bus, the far end of a link in memory, or a program on the simulator
of the RCX's processor.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from brickpilot.compiled import interface
from brickpilot.errors import InputError, SimulationError
from brickpilot.hil.checkout import AVR_TARGETS, BRICK_PROGRAM, checkout, script_output
from brickpilot.link import brick, links
from brickpilot.link.links import Link, LinkGoneError, Message
from brickpilot.link.session import REPLY_S

_PRIORITY = 20  # of 1 to 99; threads of the system have higher ones
STARTED = {"serial:pty": "--pty", "tcp": "--listen 127.0.0.1:0", "can:slcan": "--slcan-pty"}
"""Link to a brick that is started as a process on this machine -> the options of this process."""

IN_PROCESS = ("can:virtual", "can:udp_multicast")
FORMS = (*STARTED, *IN_PROCESS, *brick.FORMS)


def claim_priority() -> bool:
    """Requests real-time priority (sched(7), SCHED_FIFO) for this thread and its children.

    With this priority, other programs delay fewer ticks. The others still run, because both ends sleep between ticks.
    macOS and Windows do not have this call. Returns whether the system grants the priority.
    """
    if not hasattr(os, "sched_setscheduler"):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError:
        return False
    return True


@dataclass(frozen=True)
class Ends:
    """The plant's end of a link.

    Attributes:
        link: the open link.
        restart: function that switches the brick off and on; None: the brick was not started on this machine.
        reply_s: in lockstep, the time in s by `clock` after which sensor messages without a reply are sent again.
        clock: function that returns the link's time in s.
    """

    link: Link
    restart: Callable[[], None] | None
    reply_s: float = REPLY_S
    clock: Callable[[], float] = time.monotonic


@contextmanager
def both_ends(spec: str, trace: Path | None = None, image: Path | None = None) -> Iterator[Ends]:
    """Opens the plant's end of a link, and starts the brick at the other end if the link names a brick of this machine.

    Args:
        spec: the link, or one of `H8SIM_TARGETS`.
        trace: for one of `H8SIM_TARGETS`, the file to which the simulator writes the address and the stack pointer of
            each instruction, as native 16-bit words.
        image: see `h8_simulator`.

    Raises:
        InputError: the link is unknown or cannot be opened.
    """
    restart: Callable[[], None] | None = None
    try:
        with ExitStack() as stack:  # the end of this block closes the link, then ends the brick
            if spec in STARTED:
                process, address = start_brick(STARTED[spec])
                stack.callback(end_brick, process)
                link, restart = brick.open_link(address, FORMS), partial(restart_brick, process)
            elif spec in H8SIM_TARGETS:
                simulator, program = h8_simulator(spec, image)
                traced = {} if trace is None else {"H8SIM_TRACE": str(trace)}
                process, link = start_program(["stdbuf", "-o0", simulator, program], traced)
                stack.callback(wait_for_end, process)
            elif spec in IN_PROCESS:
                kind = spec.partition(":")[2]
                channel = f"brickpilot-{os.getpid()}-{time.monotonic_ns()}" if kind == "virtual" else None
                thread = BrickThread(links.CanLink(links.open_bus(spec, kind, channel)))
                stack.callback(thread.stop)
                link, restart = links.CanLink(links.open_bus(spec, kind, channel)), thread.restart
            else:
                link = brick.open_link(spec, FORMS)
            stack.callback(link.close)
            yield Ends(link, restart, H8SIM_REPLY_S if spec in H8SIM_TARGETS else REPLY_S)
    except LinkGoneError as error:
        raise SimulationError(f"{spec}: {error}") from error


def start_brick(options: str) -> tuple[subprocess.Popen[bytes], str]:
    """Starts a brick as a process; returns the process and its link. The process ends when its standard input closes.

    Raises:
        InputError: the package was built on a system that cannot run this process, such as Windows or macOS.
    """
    if not BRICK_PROGRAM.exists():
        raise InputError(
            "this system has no brick as a process; take can:virtual or a brick of your own", field="--link"
        )
    process = subprocess.Popen(
        [BRICK_PROGRAM, *options.split(), "--until-eof"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    )
    assert process.stdout is not None
    ready = select.select([process.stdout], [], [], 5.0)[0]
    address = process.stdout.readline().decode().strip() if ready else ""
    if not address:
        end_brick(process)
        raise SimulationError(f"{BRICK_PROGRAM.name} {options}: the brick did not start")
    return process, address


def end_brick(process: subprocess.Popen[bytes]) -> None:
    """Ends a brick: closes its standard input and waits."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    wait_for_end(process)
    process.stdout.close()


def wait_for_end(process: subprocess.Popen[bytes]) -> int:
    """Waits up to 5 s for the end of a process, then kills it. Returns the exit status."""
    try:
        return process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def restart_brick(process: subprocess.Popen[bytes]) -> None:
    """Restarts the brick in a process by SIGUSR1, and waits up to 2 s until the process prints a line."""
    assert process.stdout is not None
    process.send_signal(signal.SIGUSR1)
    if select.select([process.stdout], [], [], 2.0)[0]:
        process.stdout.readline()


class _Brick:
    """The firmware as a brick in this process."""

    def __init__(self) -> None:
        ffi: Any
        ffi, self._library = interface("brickpilot_brick")
        self._ffi = ffi
        self._identifier, self._data = ffi.new("unsigned int *"), ffi.new("unsigned char[8]")
        self._payload = ffi.buffer(self._data)
        self.restart()

    def restart(self) -> None:
        """Switches the brick off and on."""
        self._brick = self._ffi.gc(self._library.bp_brick_new(), self._library.bp_brick_free)

    def advance(self, now_us: int) -> int:
        """Lets the brick work until the time `now_us`. Returns the number of us until the brick has work again."""
        return int(self._library.bp_brick_time(self._brick, now_us))

    def take(self, identifier: int, data: bytes) -> None:
        """Hands a message to the brick."""
        self._library.bp_brick_take(self._brick, identifier, data, len(data))

    def given(self) -> list[Message]:
        """Returns the messages that the brick has sent since the last call."""
        messages = []
        while (size := self._library.bp_brick_give(self._brick, self._identifier, self._data)) >= 0:
            messages.append((self._identifier[0], self._payload[:size]))
        return messages


class BrickThread:
    """A brick in a thread of this process, at one end of a CAN bus.

    Args:
        link: the brick's end of the bus, which `stop` closes.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._ended = threading.Event()
        self._restart = threading.Event()
        self._thread = threading.Thread(target=self._run, name="brick", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        brick = _Brick()
        while not self._ended.is_set():
            if self._restart.is_set():
                brick.restart()
                self._restart.clear()
            wait_us = brick.advance(time.monotonic_ns() // 1000)
            try:
                self._link.send(brick.given())
                for message in self._link.receive(min(wait_us * 1e-6, 0.1)):
                    brick.take(*message)
                self._link.send(brick.given())
            except LinkGoneError:
                return

    def restart(self) -> None:
        """Switches the brick off and on, and returns when it runs again."""
        self._restart.set()
        while self._restart.is_set() and self._thread.is_alive():
            time.sleep(0.001)

    def stop(self) -> None:
        """Ends the thread, and closes its link."""
        self._ended.set()
        self._thread.join(5.0)
        self._link.close()


class MemoryLink:
    """The plant's end of a link in memory. The brick at the other end runs in this thread.

    The link has its own time, which passes only while the host waits for a message. So a flight in lockstep depends
    only on its plan, even on a busy machine, and waiting costs no real time.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._brick = _Brick()
        self._now_us = 0
        self._received: list[Message] = []
        self._brick.advance(0)

    def restart(self) -> None:
        """Switches the brick off and on. Messages of the brick that the host has not received are lost."""
        self._brick.restart()
        self._received.clear()
        self._brick.advance(self._now_us)

    def clock(self) -> float:
        """Returns the time of this link in s."""
        return self._now_us * 1e-6

    def send(self, messages: Sequence[Message]) -> None:
        """Hands messages to the brick, which replies at once."""
        for message in messages:
            self._brick.take(*message)
            self._received += self._brick.given()

    def receive(self, timeout: float) -> list[Message]:
        """Returns the received messages; if there are none, waits up to `timeout` s of the link's time."""
        until = self._now_us + max(round(timeout * 1e6), 1)
        while not self._received and self._now_us < until:
            wait_us = self._brick.advance(self._now_us)
            self._received += self._brick.given()
            if not self._received:
                self._now_us = min(self._now_us + max(wait_us, 1), until)
        received, self._received = self._received, []
        return received

    def close(self) -> None:
        """Discards the messages that the brick has sent."""
        self._received.clear()


@contextmanager
def memory_ends() -> Iterator[Ends]:
    """Opens the plant's end of a link in memory, with a newly switched-on brick at the other end."""
    link = MemoryLink()
    yield Ends(link, link.restart, clock=link.clock)


H8SIM_TARGETS = {"h8sim": None, "h8sim:imu": "imu", "h8sim:rotation": "rotation"}
"""Targets that run the firmware on a simulator of the RCX's processor. The link is the simulator's stdin and stdout.

Target -> the sensors for which the firmware is built (firmware/targets/rcx/flags); None: it is built as for a host.
"""

H8SIM_REPLY_S = 10.0
"""Time in s to wait for a reply. The simulator takes microseconds per instruction, and seconds to start."""


def h8_simulator(target: str, image: Path | None = None) -> tuple[str, str]:
    """Returns the paths of the simulator and of the program for it; the project's scripts build both if necessary.

    Args:
        target: one of `H8SIM_TARGETS`.
        image: a program that exists already; None: the program of `target` is built in a checkout.

    Raises:
        InputError: a program has to be built but no checkout is in this folder or above it, or a build fails.
    """
    if image is not None:
        return script_output("hal/h8sim/simulator", field="--image", packed=True), str(image)
    sensors = H8SIM_TARGETS[target]
    built = []
    if sensors is not None:
        folder = checkout(f"--target {target}")
        flags = script_output("firmware/targets/rcx/flags", sensors, field=f"--target {target}").split()
        built = [str(folder / f"build/h8sim-{sensors}"), *flags]
    return (
        script_output("hal/h8sim/simulator", field=f"--target {target}"),
        script_output("firmware/targets/h8sim/build", *built, field=f"--target {target}"),
    )


def check_sensors(target: str, sensors: str) -> None:
    """Raises InputError if the target's brick cannot have these sensors."""
    if target in AVR_TARGETS and sensors not in AVR_TARGETS[target].sensors:
        raise InputError(
            f"{target} flies with {' or '.join(AVR_TARGETS[target].sensors)}", field=f"--sensors {sensors}"
        )
    if H8SIM_TARGETS.get(target) is not None and sensors == "ideal":
        raise InputError(
            f"a brick has no ideal sensors; {target} flies with imu or imu+encoders", field=f"--sensors {sensors}"
        )


def start_program(
    command: Sequence[str | Path], environment: Mapping[str, str] = MappingProxyType({})
) -> tuple[subprocess.Popen[bytes], Link]:
    """Starts a brick that speaks over its standard input and output; returns the process and its link.

    The process ends when the link is closed.
    """
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            command,
            stdin=theirs.fileno(),
            stdout=theirs.fileno(),
            stderr=subprocess.DEVNULL,
            env=os.environ | environment,
        )
    return process, links.StreamLink(ours)
