"""An RCX and its infrared tower at the end of a pseudo-terminal, for whoever opens it as a serial port.

A pseudo-terminal has no baud rate and no parity: bytes come as fast as both ends take them, and a byte that is
corrupted on its way to the brick is handed over with what the brick's UART would say of its parity.
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
"""What tests call a byte time. The time-outs of the sender and of the brick both follow from it."""


@dataclasses.dataclass(frozen=True)
class Faults:
    """Shares of bytes that are lost, or have bits flipped, in each direction; echoes are hit too."""

    seed: int = 0
    corrupt: float = 0.0
    lose: float = 0.0


class Device(Protocol):
    """What is on the brick: is fed bytes, and gives the bytes that it sends."""

    def silence(self) -> None:
        """The line was quiet for longer than its receiver waits."""

    def damaged(self) -> None:
        """A byte came with wrong parity."""

    def byte(self, value: int) -> bytes: ...


class _Air:
    """One direction."""

    def __init__(self, faults: Faults, direction: int) -> None:
        self._faults = faults
        self._random = random.Random(faults.seed * 2 + direction)
        self.hit = 0

    def carry(self, data: bytes) -> list[tuple[int, bool]]:
        """The bytes that arrive, each with whether its parity is right."""
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
    """A tower that echoes and a brick that answers, until the block is left.

    Args:
        faults: what happens on the way.
        brickos: brickOS runs already; otherwise the ROM is alone until it is given an image and told to start it.
        tower: whether anything echoes.
        on: whether the brick hears anything.
        vanish_after: bytes after which it hears nothing more, or nothing until `back_after` bytes.
        broken_sums: of so many blocks the ROM finds the checksum wrong.
        lego: what is started answers by the ROM's protocol, as LEGO's firmware does; else it is brickOS.
        lose_replies: those of the brick's answers that are lost, counted from 1.
        device: hears all, in place of the ROM and brickOS.
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
        """Bytes that came from the host."""
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
        """What stands in its memory from where the ROM puts an image."""
        return bytes(self.rom.memory[0x8000 : 0x8000 + length])

    @property
    def hit(self) -> int:
        """Bytes lost or corrupted."""
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
            now = time.monotonic()
            idle = rcx_rom.IDLE_BYTES if self._in_rom else rcx_lnp.IDLE_BYTES
            if now - last > idle * BYTE_S:
                self._device.silence()
            last = now
            if self._tower:
                self._send(data)
            self.heard += len(data)
            if self._on and not self._away:
                self._hear(data)

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
