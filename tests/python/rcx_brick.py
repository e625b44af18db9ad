"""An RCX and its infrared tower at the end of a pseudo-terminal, which a test opens as a serial port.

A pseudo-terminal has no baud rate and no parity. Bytes travel as fast as both ends take them. A corrupted byte reaches
the brick together with the result of the parity check that the brick's UART would make.
"""

from __future__ import annotations

import dataclasses
import os
import pty
import random
import select
import threading
import time
import tty
from types import TracebackType
from typing import Protocol

import rcx_brickos
import rcx_lnp
import rcx_rom

BYTE_S = 0.0002
"""Byte time of tests, s. The time-outs of the sender and of the brick are multiples of this time."""


@dataclasses.dataclass(frozen=True)
class Faults:
    """The shares of bytes that are lost and that have flipped bits, in each direction and in echoes."""

    seed: int = 0
    corrupt: float = 0.0
    lose: float = 0.0


class Device(Protocol):
    """The software on the brick. It takes bytes and returns the bytes that it sends."""

    def silence(self, quiet_s: float) -> None:
        """Is called after the line was quiet for `quiet_s` seconds, longer than the receiver waits."""

    def damaged(self) -> None:
        """Is called when a byte arrives with wrong parity."""

    def byte(self, value: int) -> bytes: ...


class _Air:
    """One direction of the infrared link."""

    def __init__(self, faults: Faults, direction: int) -> None:
        self._faults = faults
        self._random = random.Random(faults.seed * 2 + direction)
        self.hit = 0

    def carry(self, data: bytes) -> list[tuple[int, bool]]:
        """Returns the bytes that arrive, each with True if its parity is right."""
        arrived = []
        for value in data:
            if self._random.random() < self._faults.lose:
                self.hit += 1
                continue
            flipped = self._random.randrange(1, 256) if self._random.random() < self._faults.corrupt else 0
            self.hit += flipped != 0
            arrived.append((value ^ flipped, flipped.bit_count() % 2 == 0))
        return arrived


class RcxBrick:
    """A tower that echoes and a brick that replies, for the duration of a `with` block.

    Args:
        faults: faults of the infrared link.
        brickos: True: brickOS runs already; False: the ROM runs until it starts an image.
        tower: whether there is a tower, which echoes.
        on: whether the brick is switched on.
        vanish_after: number of bytes after which the brick receives nothing more, or nothing until `back_after` bytes.
        broken_sums: number of blocks whose checksum the ROM finds wrong.
        lego: the started image replies in the ROM's protocol, as LEGO's firmware does; otherwise it is brickOS.
        lose_replies: numbers of the brick's replies that are lost, counted from 1.
        device: receives all bytes, in place of the ROM and brickOS.
    """

    def __init__(
        self,
        *,
        faults: Faults | None = None,
        brickos: bool = False,
        host: int = 0,
        tower: bool = True,
        on: bool = True,
        vanish_after: int | None = None,
        back_after: int | None = None,
        broken_sums: int = 0,
        lego: bool = False,
        lose_replies: frozenset[int] = frozenset(),
        device: Device | None = None,
    ) -> None:
        self.rom = rcx_rom.Rom(broken_sums=broken_sums)
        self.brickos = rcx_brickos.BrickOs(host)
        self.heard = 0
        """The number of bytes from the host."""
        self._other = device
        self._in_rom, self._lego = not brickos and device is None, lego
        self._tower, self._on = tower, on
        self._vanish_after, self._back_after = vanish_after, back_after
        self._lose_replies, self._replies = lose_replies, 0
        self._to_brick, self._to_host = _Air(faults or Faults(), 0), _Air(faults or Faults(), 1)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._stop_read, self._stop_write = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def firmware(self, length: int) -> bytes:
        """Returns the first `length` bytes of the image in the brick's memory."""
        return bytes(self.rom.memory[0x8000 : 0x8000 + length])

    @property
    def hit(self) -> int:
        """The number of bytes that were lost or corrupted."""
        return self._to_brick.hit + self._to_host.hit

    def __enter__(self) -> RcxBrick:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.write(self._stop_write, b"\0")
        self._thread.join(timeout=5.0)
        for descriptor in (self._master, self._slave, self._stop_read, self._stop_write):
            os.close(descriptor)

    def _serve(self) -> None:
        last = time.monotonic()
        while True:
            ready, _, _ = select.select([self._master, self._stop_read], [], [])
            if self._stop_read in ready:
                return
            data = os.read(self._master, 4096)
            idle = rcx_rom.IDLE_BYTES if self._in_rom else rcx_lnp.IDLE_BYTES
            quiet_s = time.monotonic() - last
            if quiet_s > idle * BYTE_S:
                self._device.silence(quiet_s)
            if self._tower:
                self._send(data)
            self.heard += len(data)
            if self._on and not self._away:
                self._hear(data)
            last = time.monotonic()  # the device's own work does not count as silence on the line

    @property
    def _away(self) -> bool:
        if self._vanish_after is None or self.heard < self._vanish_after:
            return False
        return self._back_after is None or self.heard < self._back_after

    @property
    def _device(self) -> Device:
        if self._other is not None:
            return self._other
        return self.rom if self._in_rom else self.brickos

    def _hear(self, data: bytes) -> None:
        for value, right in self._to_brick.carry(data):
            if not right:
                self._device.damaged()
                continue
            reply = self._device.byte(value)
            if reply:
                self._replies += 1
                if self._replies not in self._lose_replies:
                    self._send(reply)
            if self.rom.entry is not None and not self._lego:
                self._in_rom = False

    def _send(self, data: bytes) -> None:
        os.write(self._master, bytes(value for value, _ in self._to_host.carry(data)))
