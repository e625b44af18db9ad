"""An Arduino's boot loader on a pseudo-terminal, with all commands of avrdude's programmer `arduino` (STK500 v1)."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from types import TracebackType

IN_SYNC, OK, END = 0x14, 0x10, 0x20
SIGNATURES = {"atmega328p": bytes((0x1E, 0x95, 0x0F)), "atmega2560": bytes((0x1E, 0x98, 0x01))}


class BootLoader:
    """A board with the boot loader, in a thread; `port` is its serial port and `flash` its memory.

    Args:
        chip: a key of SIGNATURES.
        silent: whether the loader answers nothing.
        worn: whether the flash stores a wrong byte.
    """

    def __init__(self, chip: str = "atmega328p", *, silent: bool = False, worn: bool = False) -> None:
        self.flash = bytearray(b"\xff" * 32768)
        self._signature, self._silent, self._worn = SIGNATURES[chip], silent, worn
        self._address = 0
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> BootLoader:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join(5.0)
        os.close(self._master)
        os.close(self._slave)

    def _byte(self) -> int:
        while not self._ended.is_set():
            if select.select([self._master], [], [], 0.1)[0]:
                return os.read(self._master, 1)[0]
        raise EOFError

    def _bytes(self, count: int) -> bytes:
        return bytes(self._byte() for _ in range(count))

    def _serve(self) -> None:
        try:
            while True:
                answer = self._answer(self._byte())
                if answer is not None and not self._silent:
                    os.write(self._master, bytes((IN_SYNC, *answer, OK)))
        except EOFError:
            return

    def _answer(self, command: int) -> bytes | None:
        """Reads the rest of a command, and returns the answer without IN_SYNC and OK; None: not a command."""
        if command == 0x41:  # a parameter
            self._bytes(2)
            return b"\x03"
        if command in (0x42, 0x45):  # parameters of the device: 20 bytes, or (0x45) 4 to 5 bytes after their number
            self._bytes(21 if command == 0x42 else self._byte())
            return b""
        if command == 0x55:  # the address, in words
            self._address = 2 * int.from_bytes(self._bytes(3)[:2], "little")
            return b""
        if command == 0x56:  # an in-circuit programming instruction
            self._bytes(5)
            return b"\0"
        if command == 0x64:  # a page
            head = self._bytes(3)
            page = bytearray(self._bytes(int.from_bytes(head[:2], "big")))
            self._byte()
            page[0] ^= self._worn
            self.flash[self._address : self._address + len(page)] = page
            return b""
        if command == 0x74:
            head = self._bytes(4)
            return bytes(self.flash[self._address :][: int.from_bytes(head[:2], "big")])
        if command == 0x75:
            self._byte()
            return self._signature
        if command in (0x30, 0x50, 0x51):  # synchronise, begin, end
            return b"" if self._byte() == END else None
        return None
