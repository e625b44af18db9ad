"""Detects that a brick has restarted in the middle of a session."""

from __future__ import annotations

from brickpilot.link.messages import book

HEARTBEAT_TICKS = 100
"""A brick that keeps its own pace sends a HEARTBEAT every so many ticks, the first at tick 0 (firmware/app/loop.c)."""


class ResetWatch:
    """Tells whether the brick has begun anew: bytes of an OPEN came twice, or another host has opened a session.

    Two messages show it. HELLO answers an OPEN, and there are more of them than this session has sent. The tick of
    HEARTBEAT counts from OPEN, and goes back. HEARTBEAT has no check, so only a tick that a brick can send counts.
    """

    def __init__(self) -> None:
        by = book().by_name
        self._hello, self._heartbeat = by["HELLO"], by["HEARTBEAT"]
        self._watching = False
        self._due = 0  # replies to a repeated OPEN may still come
        self._newest_tick = 0
        self.reset = False

    def opened(self, repeats: int) -> None:
        """Notes a session that was opened after an OPEN and `repeats` more of it."""
        self._watching, self._due, self._newest_tick, self.reset = False, repeats, 0, False

    def begin(self) -> None:
        """Begins to watch: from now on only this session sends to the brick."""
        self._watching = True

    def take(self, identifier: int, data: bytes) -> None:
        """Handles a message that answers no request; sets `reset` if it shows that the brick restarted."""
        if identifier == self._hello.id and self._hello.sealed(data):
            if self._due > 0:
                self._due -= 1
            else:
                self.reset = self.reset or self._watching
        elif identifier == self._heartbeat.id and len(data) == 8 and self._watching:
            tick = self._heartbeat.unpack(data)[self._heartbeat.names.index("tick")]
            if tick % HEARTBEAT_TICKS == 0:
                self.reset = self.reset or tick < self._newest_tick
                self._newest_tick = tick
