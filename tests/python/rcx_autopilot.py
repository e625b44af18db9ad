"""An RCX that runs the autopilot: the firmware, built for this machine, and a link that acts as hal/rcx/infrared.c."""

from __future__ import annotations

import time
from typing import Any

from brickpilot.compiled import interface
from brickpilot.link.lnp import BRICK, HOST
from rcx_lnp import LnpDevice, Packet

HEARTBEAT = 0x180
"""The first message id that does not belong to a reply."""


class Autopilot(LnpDevice):
    """A brick that obeys requests; a device for `rcx_brick.RcxBrick`.

    Args:
        telemetry_after: the brick sends a telemetry message before every `telemetry_after` replies; 0: never.
    """

    def __init__(self, telemetry_after: int = 0) -> None:
        super().__init__()
        self.obeyed: list[bytes] = []
        self.repeated = 0
        self._ffi: Any
        self._ffi, self._library = interface("brickpilot_brick")
        self._brick = self._ffi.gc(self._library.bp_brick_new(), self._library.bp_brick_free)
        self._newest: int | None = None
        self._reply = b""
        self._sequence = 0
        self._telemetry_after, self._replied = telemetry_after, 0

    def _take(self, packet: Packet) -> bytes:
        if packet[:2] != (BRICK, HOST):
            return b""
        content = packet.data
        if content[0] == self._newest:
            self.repeated += 1
            return self._reply
        self._newest, self._reply = content[0], b""
        self.obeyed.append(content[1:])
        data = content[3:]
        self._library.bp_brick_take(self._brick, content[1] | content[2] << 8, data, len(data))
        self._library.bp_brick_time(self._brick, time.monotonic_ns() // 1000)
        identifier, out = self._ffi.new("unsigned int *"), self._ffi.new("unsigned char[8]")
        while (size := self._library.bp_brick_give(self._brick, identifier, out)) >= 0:
            if identifier[0] < HEARTBEAT:
                self._reply = self._send(identifier[0], bytes(self._ffi.buffer(out, size)))
        self._replied += 1
        if self._telemetry_after and self._replied % self._telemetry_after == 0:
            return self._send(0x190, bytes(8)) + self._reply
        return self._reply

    def _send(self, identifier: int, data: bytes) -> bytes:
        self._sequence = (self._sequence + 1) & 255
        return Packet(HOST, BRICK, bytes([self._sequence, identifier & 255, identifier >> 8]) + data).on_the_line()
