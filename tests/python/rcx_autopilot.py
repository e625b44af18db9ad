"""An RCX that runs the autopilot, as hal/rcx/infrared.c has its end of LNP: the firmware, built for this machine."""

from __future__ import annotations

import time
from typing import Any

from brickpilot.hil.ends import brick_interface
from rcx_lnp import Packet, Receiver

HEARTBEAT = 0x180
BRICK, HOST = 0x07, 0x87


class Autopilot:
    """Takes the place of `rcx_brickos.BrickOs`: feed it bytes; it gives the bytes that it sends.

    Args:
        telemetry_after: sends, unasked, a message of telemetry before each so many answers; 0: never.
    """

    def __init__(self, telemetry_after: int = 0) -> None:
        self.obeyed: list[bytes] = []
        self.repeated = 0
        self._ffi: Any
        self._ffi, self._library = brick_interface()
        self._brick = self._ffi.gc(self._library.bp_brick_new(), self._library.bp_brick_free)
        self._receiver = Receiver()
        self._newest: int | None = None
        self._answer = b""
        self._sequence = 0
        self._telemetry_after, self._answered = telemetry_after, 0

    def silence(self) -> None:
        self._receiver.forget()

    def damaged(self) -> None:
        self._receiver.forget()

    def byte(self, value: int) -> bytes:
        packet = self._receiver.byte(value)
        return self._take(packet.data) if packet is not None and packet[:2] == (BRICK, HOST) else b""

    def _take(self, content: bytes) -> bytes:
        if content[0] == self._newest:
            self.repeated += 1
            return self._answer
        self._newest, self._answer = content[0], b""
        self.obeyed.append(content[1:])
        data = content[3:]
        self._library.bp_brick_take(self._brick, content[1] | content[2] << 8, data, len(data))
        self._library.bp_brick_time(self._brick, time.monotonic_ns() // 1000)
        identifier, out = self._ffi.new("unsigned int *"), self._ffi.new("unsigned char[8]")
        while (size := self._library.bp_brick_give(self._brick, identifier, out)) >= 0:
            if identifier[0] < HEARTBEAT:
                self._answer = self._send(identifier[0], bytes(self._ffi.buffer(out, size)))
        self._answered += 1
        if self._telemetry_after and self._answered % self._telemetry_after == 0:
            return self._send(0x190, bytes(8)) + self._answer
        return self._answer

    def _send(self, identifier: int, data: bytes) -> bytes:
        self._sequence = (self._sequence + 1) & 255
        return Packet(HOST, BRICK, bytes([self._sequence, identifier & 255, identifier >> 8]) + data).on_the_line()
