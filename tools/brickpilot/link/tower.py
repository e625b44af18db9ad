"""The infrared tower on a serial line with 2400 baud, 8 bits and odd parity.

The tower echoes every byte that the host sends. Every time-out is a multiple of the byte time, so that a test with a
faster line waits proportionally less.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

import serial

from brickpilot.errors import InputError

try:
    from termios import error as SetUpError  # noqa: N812
except ImportError:  # Windows has no termios
    SetUpError = OSError  # type: ignore[assignment, misc]

BAUD = 2400
BYTE_S = 11 / BAUD
"""Seconds per byte: a start bit, eight bits, a parity bit and a stop bit."""
TURN_BYTES = 60
"""Time in which a brick has to begin its reply, in byte times: 275 ms, as in firmdl3 and dll."""

_WAKE = b"\x10\xfe\x10\xfe"
_WAKE_TRIES = 10
_NO_ECHO = 10
"""After this number of exchanges in a row without an echo, an error names the tower as missing, not the brick."""

T = TypeVar("T")


class Tower:
    """An open serial port with a tower.

    Args:
        device: path of the serial port.
        byte_s: seconds per byte.

    Raises:
        InputError: there is no such port, or no tower that echoes.
    """

    def __init__(self, device: str, byte_s: float = BYTE_S) -> None:
        self.device = device
        self.byte_s = byte_s
        self._without_echo = 0
        self._disturbed = False
        try:
            self._port = serial.Serial(
                device, BAUD, parity=serial.PARITY_ODD, timeout=4 * byte_s, write_timeout=2000 * byte_s, exclusive=True
            )
        except SetUpError as error:  # pyserial does not catch this error
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
        """Closes the port; a second call has no effect."""
        self._port.close()

    def exchange(
        self, packet: bytes, find: Callable[[bytes], T | None], reply_bytes: int, patience: float = 1.0
    ) -> T | None:
        """Sends `packet`, and searches for the reply after the echo.

        Args:
            packet: the bytes to send.
            find: function that returns the reply if the given bytes contain it, otherwise None.
            reply_bytes: length of the reply on the line.
            patience: time for the brick to begin its reply, in multiples of TURN_BYTES.

        Returns:
            The result of `find`, or None after the time-out. The next exchange then waits until the line is quiet.
        """
        if self._disturbed:
            self._quiet()
        received = bytearray()
        self._write(packet)
        wait = 1.25 * (len(packet) + reply_bytes) + patience * TURN_BYTES
        deadline = time.monotonic() + wait * self.byte_s
        while time.monotonic() < deadline:
            received += self._read()
            reply = find(self._behind_echo(packet, received))
            if reply is not None:
                self._without_echo = 0
                return reply
        self._disturbed = True
        self._without_echo = 0 if received else self._without_echo + 1
        return None

    def lost(self, done: str = "") -> TimeoutError:
        """Returns the error to raise if too many exchanges had no reply.

        Args:
            done: text on how much was done before.
        """
        if self._without_echo >= _NO_ECHO:
            return TimeoutError(
                f"{self.device}: the tower no longer echoes{done}: it is unplugged, or its battery is empty"
            )
        return TimeoutError(f"{self.device}: the brick no longer replies{done}: it is switched off or out of range")

    @staticmethod
    def _behind_echo(packet: bytes, received: bytearray) -> bytes:
        """Returns the bytes after the echo. A damaged echo may be too short, so its last bytes are returned as well."""
        if received.startswith(packet):
            return bytes(received[len(packet) :])
        return bytes(received[max(0, len(packet) - 4 - len(packet) // 50) :])

    def _wake(self) -> None:
        """Wakes the tower with a byte, then sends a pattern until its echo arrives."""
        echoed = False
        self._write(b"\xff")
        for _ in range(_WAKE_TRIES):
            self._quiet()
            self._write(_WAKE)
            received = bytearray()
            deadline = time.monotonic() + (len(_WAKE) + TURN_BYTES) * self.byte_s
            while time.monotonic() < deadline and len(received) < len(_WAKE):
                received += self._read()
            if received == _WAKE:
                return
            echoed |= bool(received)
        if echoed:
            raise InputError(
                "echoes other bytes than were sent: it is no infrared tower, or bright light shines on it",
                field=self.device,
            )
        raise InputError(
            "has no tower: nothing echoes. Is the tower plugged in here, and is its battery good?", field=self.device
        )

    def _quiet(self) -> None:
        """Discards all received bytes until the line is quiet for a quarter of TURN_BYTES."""
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
            raise TimeoutError(f"{self.device}: the port has disappeared: {error}") from None

    def _read(self) -> bytes:
        """Returns the received bytes; empty if no byte arrives within a few byte times."""
        try:
            return self._port.read(max(1, self._port.in_waiting))
        except (serial.SerialException, OSError) as error:
            raise TimeoutError(f"{self.device}: the port has disappeared: {error}") from None
