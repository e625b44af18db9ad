"""Links: open connections to a brick that carry messages. A damaged frame is dropped and counted."""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import secrets
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

Message = tuple[int, bytes]
"""The id and the data of a message."""

CAN_KINDS = ("slcan", "virtual", "udp_multicast", "socketcan")


class LinkGoneError(Exception):
    """The other end has closed the link, or the device has been unplugged."""


class Link(Protocol):
    """An open connection. `damaged` counts the frames that were refused."""

    damaged: int

    def send(self, messages: Sequence[Message]) -> None:
        """Sends the messages in order. Raises LinkGoneError."""

    def receive(self, timeout: float) -> list[Message]:
        """Returns the received messages; waits up to `timeout` s for the first message. Raises LinkGoneError."""

    def close(self) -> None:
        """Closes the link; a second call has no effect."""


class WrappedLink:
    """A link that forwards everything to another link; the base of links that change or record messages.

    Args:
        link: the other link; it is closed when this link is closed.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def damaged(self) -> int:
        return self._link.damaged

    @damaged.setter
    def damaged(self, count: int) -> None:
        self._link.damaged = count

    def send(self, messages: Sequence[Message]) -> None:
        self._link.send(messages)

    def receive(self, timeout: float) -> list[Message]:
        return self._link.receive(timeout)

    def close(self) -> None:
        self._link.close()


BUSY = b"another host has this link"
"""Text that a brick sends to a second host before it closes the connection; sim_host/brick holds the same text."""

TOKEN = "BRICKPILOT_TOKEN"
"""The environment variable with the token, 16 to 64 bytes, that both ends of a TCP connection must have."""
ASKS = b"token "
"""The beginning of a brick's request for the token; the challenge follows. See hal/README.md."""


def encode_frame(identifier: int, data: bytes) -> bytes:
    """Returns the frame that carries a message on a serial line; see hal/wire/frame."""
    raw = struct.pack("<HB", identifier, len(data)) + data
    return bytes(cobs.encode(raw + struct.pack("<H", crc16(raw)))) + b"\0"


def decode_frame(block: bytes) -> Message | None:
    """Returns the message in a frame (the bytes between two delimiters); None if the frame is damaged."""
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
    """A link that carries COBS frames over the file descriptor of a serial port or a socket.

    Args:
        owner: an object with fileno() and close(), which is closed with the link.
    """

    def __init__(self, owner: Any) -> None:
        self.damaged = 0
        self._owner = owner
        self._fd = int(owner.fileno())
        os.set_blocking(self._fd, False)
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)
        self._rest = b""
        self._write(b"\0")  # ends an incomplete frame that another program may have left

    def _write(self, data: bytes) -> None:
        try:
            while data:
                try:
                    data = data[os.write(self._fd, data) :]
                except BlockingIOError:
                    if not select.select([], [self._fd], [], 1.0)[1]:
                        raise LinkGoneError("the other end does not read") from None
        except OSError as error:
            raise LinkGoneError(error.strerror or "closed") from error

    def send(self, messages: Sequence[Message]) -> None:
        self._write(b"".join([encode_frame(identifier, data) for identifier, data in messages]))

    def receive(self, timeout: float) -> list[Message]:
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
        self._rest = self._rest[-64:]  # a valid frame is no longer; an endless frame would fill the memory
        messages = []
        for block in blocks:
            if not block:
                continue
            if block == BUSY:
                raise LinkGoneError(BUSY.decode())
            if block.startswith(ASKS):
                raise LinkGoneError(f"the brick asks for a token: set {TOKEN}")
            frame = decode_frame(block)
            if frame is None:
                self.damaged += 1
            else:
                messages.append(frame)
        return messages

    def close(self) -> None:
        if self._fd >= 0:
            self._fd = -1
            self._owner.close()


class CanLink:
    """A link over classic CAN, by python-can.

    Args:
        bus: an open bus, which is closed with the link.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.damaged = 0
        self._bus: can.BusABC | None = bus

    def send(self, messages: Sequence[Message]) -> None:
        assert self._bus is not None
        try:
            for identifier, data in messages:
                self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False, check=False))
        except (can.CanError, OSError) as error:
            raise LinkGoneError(str(error)) from error

    def receive(self, timeout: float) -> list[Message]:
        assert self._bus is not None
        try:
            message = self._bus.recv(max(0.0, timeout))
        except (can.CanError, OSError) as error:
            raise LinkGoneError(str(error)) from error
        except (ValueError, IndexError):  # slcan has no checksum: a damaged line may hold no valid frame
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
            with contextlib.suppress(can.CanError, OSError):  # an adapter that was unplugged fails to shut down
                self._bus.shutdown()
            self._bus = None


def _bad(spec: str, message: str) -> InputError:
    return InputError(message, field=f"--link {spec}")


def open_serial(spec: str, port: str) -> Link:
    """Opens a serial port, `PORT` or `PORT@BAUD` (default 115200)."""
    path, _, rate = port.partition("@")
    try:
        return StreamLink(serial.Serial(path, int(rate or 115200), timeout=0, exclusive=True))
    except ValueError as error:
        raise _bad(spec, f"{rate} is no baud rate") from error
    except (OSError, LinkGoneError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise _bad(spec, f"{path} cannot be opened: {reason}") from error


def open_tcp(spec: str, address: str) -> Link:
    """Opens a TCP connection to `HOST:PORT`; if `TOKEN` is set, proves that this end has the token."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise _bad(spec, "needs tcp:HOST:PORT, the port from 1 to 65535")
    try:
        connection = socket.create_connection((host, int(port)), timeout=5.0)
    except OSError as error:
        raise _bad(spec, f"has no connection: {error.strerror or error}") from error
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        if token := os.environ.get(TOKEN):
            _prove(spec, connection, os.fsencode(token))
        return StreamLink(connection)
    except (InputError, LinkGoneError):
        connection.close()
        raise


def _prove(spec: str, connection: socket.socket, token: bytes) -> None:
    """Proves to the brick that this end has the token, and checks that the brick has it. Raises InputError."""
    challenge = _words(spec, connection)
    if not challenge.startswith(ASKS):
        raise _bad(spec, challenge.decode(errors="replace"))
    digits = secrets.token_hex(16).encode()

    def proof(who: bytes) -> bytes:
        return hmac.new(token, who + b" " + challenge.removeprefix(ASKS) + digits, hashlib.sha256).hexdigest().encode()

    connection.sendall(digits + proof(b"host"))
    answer = _words(spec, connection)
    if not hmac.compare_digest(answer, proof(b"brick")):
        raise _bad(spec, "the token is wrong" if len(answer) == 64 else answer.decode(errors="replace"))


def _words(spec: str, connection: socket.socket) -> bytes:
    """Returns the text that the brick sends before its first frame, between two zero bytes."""
    data = b""
    try:
        while data.count(b"\0") < 2 and len(data) < 256 and (chunk := connection.recv(64)):
            data += chunk
    except OSError:
        raise _bad(spec, f"the brick asks for no token; {TOKEN} is set here") from None
    return data.split(b"\0")[1] if data.count(b"\0") >= 2 else b"the brick does not follow the protocol of the token"


def open_bus(spec: str, kind: str, channel: str | None) -> can.BusABC:
    """Opens a python-can bus; `kind` is one of CAN_KINDS."""
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
