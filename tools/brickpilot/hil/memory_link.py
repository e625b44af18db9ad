"""A brick in this thread, at the other end of a link in memory, without the system's lines and clock.

Its time passes only while the host waits for a message that does not come. So a flight in lockstep depends on its plan
alone, even on a busy machine, and a wait of a quarter of a second costs no time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from brickpilot.compiled import interface
from brickpilot.hil import fly
from brickpilot.hil.ends import Ends
from brickpilot.hil.fly import HilFlight
from brickpilot.link.links import Message
from brickpilot.link.session import LOCKSTEP
from brickpilot.vehicle.flight import Plan

SPEC = "memory"
"""The name of the link in error messages."""


class MemoryLink:
    """The plant's end of the link, and the brick at the other."""

    def __init__(self) -> None:
        self.damaged = 0
        ffi: Any
        ffi, self._library = interface("brickpilot_brick")
        self._ffi = ffi
        self._identifier, self._data = ffi.new("unsigned int *"), ffi.new("unsigned char[8]")
        self._payload = ffi.buffer(self._data)
        self._now_us = 0
        self._come: list[Message] = []
        self.restart()

    def restart(self) -> None:
        """Switches the brick off and on. Messages that it had sent are lost."""
        self._brick = self._ffi.gc(self._library.bp_brick_new(), self._library.bp_brick_free)
        self._come.clear()
        self._library.bp_brick_time(self._brick, self._now_us)

    def clock(self) -> float:
        """Returns the time of this link, s."""
        return self._now_us * 1e-6

    def send(self, messages: Sequence[Message]) -> None:
        """Hands messages to the brick, which replies at once."""
        take, brick = self._library.bp_brick_take, self._brick
        for identifier, data in messages:
            take(brick, identifier, data, len(data))
            self._collect()

    def receive(self, timeout: float) -> list[Message]:
        """Returns the messages that have come; without any, lets up to `timeout` s of the link's time pass."""
        until = self._now_us + max(round(timeout * 1e6), 1)
        while not self._come and self._now_us < until:
            wait_us = self._library.bp_brick_time(self._brick, self._now_us)
            self._collect()
            self._now_us = self._now_us if self._come else min(self._now_us + max(wait_us, 1), until)
        come, self._come = self._come, []
        return come

    def _collect(self) -> None:
        give, brick, identifier, data = self._library.bp_brick_give, self._brick, self._identifier, self._data
        while (size := give(brick, identifier, data)) >= 0:
            self._come.append((identifier[0], self._payload[:size]))

    def close(self) -> None:
        """Ends the brick."""
        self._come.clear()


@contextmanager
def both_ends() -> Iterator[Ends]:
    """Opens the plant's end, with a brick at the other that was just switched on."""
    link = MemoryLink()
    try:
        yield Ends(link, link.restart, clock=link.clock)
    finally:
        link.close()


def fly_alone(plan: Plan) -> HilFlight:
    """Flies a plan over this link in lockstep, with the faults of its scenario and every step's telemetry.

    Raises:
        InputError: the plan is of a manoeuvre, or a fault needs another brick.
        SimulationError: the plant's state diverges.
    """
    with both_ends() as ends:
        return fly.fly(ends, SPEC, plan, pace=LOCKSTEP, telemetry_every=1, progress=lambda *_: None)
