"""The infrared tower: a serial line, 2400 baud, 8 bits, odd parity; it sends what it is given, and hears itself do it.

Every time-out follows from the line's byte time, so that a faster line (a test's) waits in proportion.
"""

from __future__ import annotations

import termios
import time
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

import serial

from brickpilot.errors import InputError

BAUD = 2400
BYTE_S = 11 / BAUD
"""Seconds per byte: start bit, eight bits, parity, stop bit."""
TURN_BYTES = 60
"""How long a brick may take to begin its answer, in byte times: 275 ms, as firmdl3 and dll wait."""

_WAKE = b"\x10\xfe\x10\xfe"
_WAKE_TRIES = 10
_DEAF = 10
"""Exchanges without an echo, in a row, after which it is not the brick that is missing."""

T = TypeVar("T")


class Tower:
    """An open port with a tower at its end.

    Args:
        device: path of the serial port.
        byte_s: seconds that a byte takes.

    Raises:
        InputError: no such port, or no tower that echoes.
    """

    def __init__(self, device: str, byte_s: float = BYTE_S) -> None:
        self.device = device
        self.byte_s = byte_s
        self._deaf = 0
        self._disturbed = False
        try:
            self._port = serial.Serial(
                device, BAUD, parity=serial.PARITY_ODD, timeout=4 * byte_s, write_timeout=2000 * byte_s, exclusive=True
            )
        except termios.error as error:  # pyserial lets this one through
            raise InputError(f"cannot be set up as the tower's serial port: {error.args[-1]}", field=device) from None
        except (serial.SerialException, OSError) as error:
            why = {2: "no such device", 13: "no permission to use it", 11: "another program uses it"}
            raise InputError(
                why.get(error.errno or 0, f"cannot be opened as a serial port: {error.strerror or error}"), field=device
            ) from None
        try:
            self._wake()
        except BaseException:
            self._port.close()
            raise

    def __enter__(self) -> Tower:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """May be called twice."""
        self._port.close()

    def exchange(
        self, packet: bytes, find: Callable[[bytes], T | None], reply_bytes: int, patience: float = 1.0
    ) -> T | None:
        """Sends `packet` and looks for its answer in what comes after the echo.

        Args:
            packet: the bytes to send.
            find: gives the answer if the bytes it gets hold it, otherwise None.
            reply_bytes: length of the answer on the line.
            patience: how many times TURN_BYTES the brick may think.

        Returns:
            What `find` gave, or None when time was up: then the line has been listened to until it was quiet.
        """
        if self._disturbed:
            self._quiet()
        heard = bytearray()
        self._write(packet)
        wait = 1.25 * (len(packet) + reply_bytes) + patience * TURN_BYTES
        deadline = time.monotonic() + wait * self.byte_s
        while time.monotonic() < deadline:
            heard += self._read()
            reply = find(self._behind_echo(packet, heard))
            if reply is not None:
                self._deaf = 0
                return reply
        self._disturbed = True
        self._deaf = 0 if heard else self._deaf + 1
        return None

    def lost(self, done: str = "") -> TimeoutError:
        """What to raise when exchange has come back empty too often.

        Args:
            done: how far it had come.
        """
        if self._deaf >= _DEAF:
            return TimeoutError(f"{self.device}: the tower no longer echoes{done}: unplugged, or its battery is empty")
        return TimeoutError(f"{self.device}: the brick fell silent{done}: switched off, or out of range")

    @staticmethod
    def _behind_echo(packet: bytes, heard: bytearray) -> bytes:
        """What came after the echo; where that is damaged, its last bytes too, for some may have been lost."""
        if heard.startswith(packet):
            return bytes(heard[len(packet) :])
        return bytes(heard[max(0, len(packet) - 4 - len(packet) // 50) :])

    def _wake(self) -> None:
        """A tower sleeps until its line moves: a byte to wake it, then a pattern that must come back."""
        heard_any = False
        self._write(b"\xff")
        for _ in range(_WAKE_TRIES):
            self._quiet()
            self._write(_WAKE)
            heard = bytearray()
            deadline = time.monotonic() + (len(_WAKE) + TURN_BYTES) * self.byte_s
            while time.monotonic() < deadline and len(heard) < len(_WAKE):
                heard += self._read()
            if heard == _WAKE:
                return
            heard_any |= bool(heard)
        if heard_any:
            raise InputError(
                "echoes, but not what was sent: no infrared tower, or harsh light on it", field=self.device
            )
        raise InputError("no tower: nothing echoes; is it plugged in here, with a good battery?", field=self.device)

    def _quiet(self) -> None:
        """Listens until nothing has come for a quarter of a turn, and forgets it."""
        last = time.monotonic()
        end = last + 2000 * self.byte_s
        while time.monotonic() - last < TURN_BYTES / 4 * self.byte_s and time.monotonic() < end:
            if self._read():
                last = time.monotonic()
        self._disturbed = False

    def _write(self, packet: bytes) -> None:
        try:
            self._port.write(packet)
        except (serial.SerialException, OSError) as error:
            raise TimeoutError(f"{self.device}: the port has gone: {error}") from None

    def _read(self) -> bytes:
        """What has come, or nothing after a few byte times."""
        try:
            return self._port.read(max(1, self._port.in_waiting))
        except (serial.SerialException, OSError) as error:
            raise TimeoutError(f"{self.device}: the port has gone: {error}") from None
