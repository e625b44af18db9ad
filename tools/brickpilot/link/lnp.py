"""Packets of brickOS's network protocol, LNP: `F1`, length, destination, source, data and checksum.

An address has 4 bits of host and 4 bits of port. The length counts both addresses and the data. The checksum is 0xFF
plus the sum of all bytes before it. Each message to the autopilot on an RCX travels in one packet, as in
hal/rcx/infrared.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from brickpilot.link.links import LinkGoneError, Message
from brickpilot.link.tower import Tower

HEADER = 0xF1
BRICK, HOST = 0x07, 0x87
"""Addresses of the program of hal/rcx (host 0) and of this end (host 8), both with port 7; the kernel has port 0."""


def address(host: int, port: int = 0) -> int:
    """Returns the address of host 0..15 and port 0..15."""
    return host << 4 | port


def checksum(content: bytes) -> int:
    """Returns the checksum of `content`, which is all bytes before the checksum."""
    return (0xFF + sum(content)) & 0xFF


def packet(data: bytes, to: int, sender: int) -> bytes:
    """Returns a packet with up to 253 bytes of data."""
    content = bytes([HEADER, len(data) + 2, to, sender]) + data
    return content + bytes([checksum(content)])


def each(received: bytes, to: int, sender: int) -> Iterator[bytes]:
    """Yields the data of every complete packet from `sender` to `to`."""
    for at in range(len(received) - 5):
        if received[at] != HEADER or received[at + 2 : at + 4] != bytes([to, sender]):
            continue
        end = at + 2 + received[at + 1]
        if at + 4 < end < len(received) and received[end] == checksum(received[at:end]):
            yield received[at + 4 : end]


def find(received: bytes, to: int, sender: int) -> bytes | None:
    """Returns the data of the first complete packet from `sender` to `to`, or None."""
    return next(each(received, to, sender), None)


HEAD_BYTES = 3
REPLY_BYTES = 4 + HEAD_BYTES + 8 + 1
PATIENCE = 4.0
"""The `patience` for `Tower.exchange`: long, because a brick cannot receive while it sends seven telemetry messages."""

FIRST_TRIES, TRIES = 3, 10
"""Number of tries of a request before the first reply of a session, and after this reply."""


class InfraredLink:
    """A `Link` for requests and replies over an infrared tower. It carries one packet at a time. A packet may be lost.

    So `send` waits for the reply, and sends the same packet again if there is no reply. The brick executes a repeated
    request only once. `damaged` counts the requests that were sent again.

    Args:
        tower: an open tower; it is closed when the link is closed.
    """

    def __init__(self, tower: Tower) -> None:
        self.damaged = 0
        self._tower = tower
        self._sequence = int(time.monotonic() * 10) & 255  # differs from the sequence number of the previous session
        self._replies: list[Message] = []
        self._connected = False

    def send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            try:
                self._request(*message)
            except TimeoutError as error:
                raise LinkGoneError(str(error)) from error

    def _request(self, identifier: int, data: bytes) -> None:
        """Sends one request until its reply arrives, and stores the reply for `receive`."""
        self._sequence = (self._sequence + 1) & 255
        head = bytes([self._sequence, identifier & 255, identifier >> 8])
        request = packet(head + data, BRICK, HOST)

        def reply(received: bytes) -> Message | None:
            for content in each(received, HOST, BRICK):
                message = content[1] | content[2] << 8, content[HEAD_BYTES:]
                if len(content) > HEAD_BYTES and message[0] == identifier + 1 and message[1][0] == data[0]:
                    return message
            return None

        for attempt in range(TRIES if self._connected else FIRST_TRIES):
            answer = self._tower.exchange(request, reply, REPLY_BYTES, PATIENCE)
            self.damaged += attempt > 0
            if answer is not None:
                self._connected = True
                self._replies.append(answer)
                return

    def receive(self, timeout: float) -> list[Message]:
        if not self._replies:
            time.sleep(max(0.0, timeout))
        replies, self._replies = self._replies, []
        return replies

    def close(self) -> None:
        self._tower.close()
