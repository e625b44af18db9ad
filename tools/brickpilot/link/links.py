"""Links: how messages travel. Each gives and takes pairs (id, data); what is damaged is dropped and counted."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
from collections.abc import Sequence
from typing import Any, Protocol

import can
import serial
from cobs import cobs

from brickpilot.errors import InputError
from brickpilot.link.messages import crc16

Frame = tuple[int, bytes]

SERIAL = "serial"
TCP = "tcp"
CAN = "can"
CAN_KINDS = ("slcan", "virtual", "udp_multicast", "socketcan")


class LinkGoneError(Exception):
    """The other end has closed the link, or the device has been unplugged."""


class Link(Protocol):
    """``damaged``: frames that were refused so far."""

    damaged: int

    def send(self, frames: Sequence[Frame]) -> None:
        """Sends them in order. Raises LinkGoneError."""

    def receive(self, timeout: float) -> list[Frame]:
        """What has come; waits up to `timeout` s for the first, which may give nothing. Raises LinkGoneError."""

    def close(self) -> None:
        """May be called twice."""


def encode_frame(identifier: int, data: bytes) -> bytes:
    """A message as it stands on a serial line, see hal/wire/frame."""
    raw = struct.pack("<HB", identifier, len(data)) + data
    return bytes(cobs.encode(raw + struct.pack("<H", crc16(raw)))) + b"\0"


def decode_frame(block: bytes) -> Frame | None:
    """The message between two delimiters; None where it is damaged."""
    try:
        raw = cobs.decode(block)
    except cobs.DecodeError:
        return None
    if len(raw) < 5 or raw[2] > 8 or raw[2] != len(raw) - 5 or raw[1] > 7:
        return None
    if crc16(raw[:-2]) != raw[-2] | raw[-1] << 8:
        return None
    return raw[0] | raw[1] << 8, raw[3:-2]


class StreamLink:
    """COBS frames over a file descriptor that is ready to be read and written, a terminal's or a socket's.

    Args:
        owner: closed with the link: has fileno() and close().
    """

    def __init__(self, owner: Any) -> None:
        self.damaged = 0
        self._owner = owner
        self._fd = int(owner.fileno())
        os.set_blocking(self._fd, False)
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)
        self._rest = b""
        self._write(b"\0")  # ends whatever stands on the line

    def _write(self, data: bytes) -> None:
        try:
            while data:
                try:
                    data = data[os.write(self._fd, data) :]
                except BlockingIOError:
                    if not select.select([], [self._fd], [], 1.0)[1]:
                        raise LinkGoneError("nobody reads at the other end") from None
        except OSError as error:
            raise LinkGoneError(error.strerror or "closed") from error

    def send(self, frames: Sequence[Frame]) -> None:
        self._write(b"".join([encode_frame(identifier, data) for identifier, data in frames]))

    def receive(self, timeout: float) -> list[Frame]:
        if not self._poll.poll(max(0.0, timeout) * 1000):
            return []
        try:
            chunk = os.read(self._fd, 4096)
        except BlockingIOError:
            return []
        except OSError as error:
            raise LinkGoneError(error.strerror or "closed") from error
        if not chunk:
            raise LinkGoneError("closed by the other end")
        *blocks, self._rest = (self._rest + chunk).split(b"\0")
        self._rest = self._rest[-64:]  # no frame is longer: a line that never ends costs no memory
        found = []
        for block in blocks:
            if not block:
                continue
            frame = decode_frame(block)
            if frame is None:
                self.damaged += 1
            else:
                found.append(frame)
        return found

    def close(self) -> None:
        if self._fd >= 0:
            self._fd = -1
            self._owner.close()


class CanLink:
    """Classic CAN by python-can.

    Args:
        bus: closed with the link.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.damaged = 0
        self._bus: can.BusABC | None = bus

    def send(self, frames: Sequence[Frame]) -> None:
        assert self._bus is not None
        try:
            for identifier, data in frames:
                self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False, check=False))
        except (can.CanError, OSError) as error:
            raise LinkGoneError(str(error)) from error

    def receive(self, timeout: float) -> list[Frame]:
        assert self._bus is not None
        try:
            message = self._bus.recv(max(0.0, timeout))
        except (can.CanError, OSError) as error:
            raise LinkGoneError(str(error)) from error
        except (ValueError, IndexError):  # slcan: a line that is no frame; it has no check of its own
            self.damaged += 1
            return []
        if message is None:
            return []
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd:
            self.damaged += 1
            return []
        return [(message.arbitration_id, bytes(message.data))]

    def close(self) -> None:
        if self._bus is not None:
            with contextlib.suppress(can.CanError, OSError):  # an adapter that has gone cannot be told goodbye
                self._bus.shutdown()
            self._bus = None


def _bad(spec: str, message: str) -> InputError:
    return InputError(message, field=f"--link {spec}")


def open_serial(spec: str, port: str) -> Link:
    """A serial port, ``PORT`` or ``PORT@BAUD`` (default 115200)."""
    path, _, rate = port.partition("@")
    try:
        return StreamLink(serial.Serial(path, int(rate or 115200), timeout=0, exclusive=True))
    except ValueError as error:
        raise _bad(spec, f"{rate} is no baud rate") from error
    except (OSError, LinkGoneError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise _bad(spec, f"{path} cannot be opened: {reason}") from error


def open_tcp(spec: str, address: str) -> Link:
    """A TCP connection to ``HOST:PORT``."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise _bad(spec, "needs tcp:HOST:PORT, the port from 1 to 65535")
    try:
        connection = socket.create_connection((host, int(port)), timeout=5.0)
    except OSError as error:
        raise _bad(spec, f"no connection: {error.strerror or error}") from error
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return StreamLink(connection)


def open_bus(spec: str, kind: str, channel: str | None) -> can.BusABC:
    """A python-can bus of one of CAN_KINDS."""
    extra: dict[str, Any] = {}
    if kind == "slcan":
        extra = {"sleep_after_open": 0, "bitrate": 500_000}
    elif kind == "udp_multicast":
        extra = {"hop_limit": 0}
        channel = channel or "239.74.163.2"
    try:
        return can.Bus(interface=kind, channel=channel, **extra)
    except (can.CanError, ImportError, OSError, ValueError) as error:
        raise _bad(spec, f"cannot be opened: {' '.join(str(error).split())}") from error
